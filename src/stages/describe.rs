//! A plan for reading: what `ao4d check` prints, as text or as JSON.

use std::fmt;
use std::path::Path;

use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};
use serde_json::{Map, Value};

use super::{LISTS, Plan};

/// How much is in a scene, once it is built.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Vertices of all objects.
    pub vertices: u64,
    /// Simplices of all objects.
    pub simplices: u64,
}

/// Sums over a plan's stages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Totals {
    /// Rays of all occlusions, where the scenes were built.
    pub occlusion_rays: Option<u64>,
    /// Voxels of all renders, which is the number of their rays.
    pub voxels: u64,
    /// Bytes of all volumes' files before compression.
    pub bytes: u64,
}

impl Default for Totals {
    /// Nothing.
    fn default() -> Self {
        Self { occlusion_rays: Some(0), voxels: 0, bytes: 0 }
    }
}

impl Totals {
    fn add(self, other: Self) -> Self {
        Self {
            occlusion_rays: self.occlusion_rays.zip(other.occlusion_rays).map(|(a, b)| a.saturating_add(b)),
            voxels: self.voxels.saturating_add(other.voxels),
            bytes: self.bytes.saturating_add(other.bytes),
        }
    }
}

/// A plan with its counts.
#[derive(Clone, Debug)]
pub struct Description<'a> {
    plan: &'a Plan,
    /// One for each scene; empty if the scenes weren't built.
    counts: &'a [Counts],
    totals: Totals,
}

impl Plan {
    /// The plan for reading. `counts` has one entry for each scene, or is empty where the scenes weren't built.
    pub fn describe<'a>(&'a self, counts: &'a [Counts]) -> Description<'a> {
        let stages = 0..self.stages.len();
        let totals = stages.map(|index| self.totals_of(index, counts)).fold(Totals::default(), Totals::add);
        Description { plan: self, counts, totals }
    }
}

impl Serialize for Description<'_> {
    /// The stages in lists by kind, as they refer to each other by their number in those.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let plan = self.plan;
        let mut lists: Vec<Vec<Value>> = vec![Vec::new(); LISTS.len()];
        let mut order = Vec::new();
        for (index, stage) in plan.stages.iter().enumerate() {
            let kind = LISTS.iter().position(|(kind, _)| *kind == plan.kind(index)).unwrap_or_default();
            order.push(Map::from_iter([(plan.kind(index).to_owned(), lists[kind].len().into())]));
            let mut shown = Map::from_iter([("id".to_owned(), stage.id.clone().into())]);
            let Value::Object(mut fields) = plan.fields(index) else { continue };
            plan.show(index, &mut fields);
            shown.append(&mut fields);
            lists[kind].push(shown.into());
        }
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("name", &plan.name)?;
        map.serialize_entry("seed", &plan.seed)?;
        map.serialize_entry("out", &plan.out.to_string_lossy())?;
        map.serialize_entry("order", &order)?;
        for ((_, name), list) in LISTS.iter().zip(&lists) {
            map.serialize_entry(name, list)?;
        }
        map.serialize_entry("counts", self.counts)?;
        map.serialize_entry("totals", &self.totals)?;
        map.end()
    }
}

impl fmt::Display for Description<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plan = self.plan;
        writeln!(f, "{}: seed {}, output in {}", plan.name, plan.seed, plan.out.display())?;
        let width = plan.stages.iter().map(|stage| stage.id.chars().count()).max().unwrap_or(0);
        for (index, stage) in plan.stages.iter().enumerate() {
            writeln!(f, "  {:9}  {:width$}  {}", plan.kind(index), stage.id, plan.line(index, self.counts))?;
        }
        let Totals { occlusion_rays, voxels, bytes } = self.totals;
        let rays = occlusion_rays.map(|n| format!("{} occlusion rays, ", grouped(n))).unwrap_or_default();
        writeln!(f, "  in all: {rays}{} voxels, {} of volumes", grouped(voxels), size(bytes))
    }
}

/// A path in JSON, with what isn't Unicode in it replaced.
pub(super) fn path<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&path.to_string_lossy())
}

/// A number with its digits in threes: `1,234,567`.
pub fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

/// A number of bytes in the unit that leaves at most three digits before the point: `1.5 MB`, with 1 kB = 1000 bytes.
pub fn size(bytes: u64) -> String {
    let mut value = bytes as f64;
    let mut unit = "bytes";
    for larger in ["kB", "MB", "GB", "TB", "PB"] {
        if value < 1000.0 {
            break;
        }
        value /= 1000.0;
        unit = larger;
    }
    if unit == "bytes" { format!("{bytes} bytes") } else { format!("{value:.1} {unit}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_for_reading() {
        assert_eq!([0, 999, 1000, 1234567].map(grouped), ["0", "999", "1,000", "1,234,567"]);
        assert_eq!([0, 999, 1500, 12_000_000_000].map(size), ["0 bytes", "999 bytes", "1.5 kB", "12.0 GB"]);
    }
}
