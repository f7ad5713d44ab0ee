//! A plan for reading: what `ao4d check` prints, as text or as JSON.

use std::fmt;
use std::path::Path;

use serde::{Serialize, Serializer};

use super::{OcclusionPlan, OcclusionSource, Plan, ProjectionPlan, RenderPlan, Samples, StageRef, WritePlan};
use crate::geometry::Dimension;
use crate::pipeline::spec::{Compression, Projection, Shading};

/// How much is in a scene, once it is built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct SceneCounts {
    /// Vertices of all objects.
    pub vertices: u64,
    /// Simplices of all objects.
    pub simplices: u64,
}

/// A plan with its counts.
#[derive(Clone, Debug, Serialize)]
pub struct Description<'a> {
    /// The plan itself.
    #[serde(flatten)]
    plan: &'a Plan,
    /// One for each scene; empty if the scenes weren't built.
    counts: &'a [SceneCounts],
    /// The sums over all stages.
    totals: Totals,
}

/// Sums over a plan's stages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
struct Totals {
    /// Rays of all occlusions, where the scenes were built.
    occlusion_rays: Option<u64>,
    /// Voxels of all renders, which is the number of their rays.
    voxels: u64,
    /// Bytes of all volumes' files before compression.
    bytes: u64,
}

impl Plan {
    /// The plan for reading. `counts` has one entry for each scene, or is empty where the scenes weren't built.
    pub fn describe<'a>(&'a self, counts: &'a [SceneCounts]) -> Description<'a> {
        let rays = self.occlusions.iter().map(|o| rays(o, counts)).collect::<Option<Vec<u64>>>();
        let totals = Totals {
            occlusion_rays: rays.map(|rays| rays.iter().fold(0, |sum: u64, &n| sum.saturating_add(n))),
            voxels: self.renders.iter().fold(0, |sum: u64, render| sum.saturating_add(render.voxels())),
            bytes: self.writes.iter().fold(0, |sum: u64, write| sum.saturating_add(bytes(self, write))),
        };
        Description { plan: self, counts, totals }
    }
}

/// Rays of an occlusion, where they are known: at most so many for a target error.
fn rays(occlusion: &OcclusionPlan, counts: &[SceneCounts]) -> Option<u64> {
    let vertices = counts.get(occlusion.scene)?.vertices;
    let each = match &occlusion.source {
        OcclusionSource::Load(_) => 0,
        OcclusionSource::Compute(computation) => match computation.samples {
            Samples::Exact => 0,
            Samples::Fixed(n) | Samples::Target { max_samples: n, .. } => n,
        },
    };
    Some(vertices.saturating_mul(each))
}

/// Bytes of a write's volumes before compression.
fn bytes(plan: &Plan, write: &WritePlan) -> u64 {
    let voxels = plan.renders[write.render].voxels();
    let vti: u64 = write.arrays.iter().filter(|_| write.vti.is_some()).map(|array| array.bytes::<4>() as u64).sum();
    let raw = if write.raw.is_some() { 12 } else { 0 };
    voxels.saturating_mul(vti + raw)
}

impl fmt::Display for Description<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plan = self.plan;
        writeln!(f, "{}: seed {}, output in {}", plan.name, plan.seed, plan.out.display())?;
        let width = plan.order.iter().map(|&stage| self.id(stage).chars().count()).max().unwrap_or(0);
        for &stage in &plan.order {
            writeln!(f, "  {:9}  {:width$}  {}", stage.kind(), self.id(stage), self.line(stage))?;
        }
        let Totals { occlusion_rays, voxels, bytes } = self.totals;
        let rays = occlusion_rays.map(|n| format!("{} occlusion rays, ", grouped(n))).unwrap_or_default();
        writeln!(f, "  in all: {rays}{} voxels, {} of volumes", grouped(voxels), size(bytes))
    }
}

impl Description<'_> {
    fn id(&self, stage: StageRef) -> &str {
        self.plan.id(stage)
    }

    fn line(&self, stage: StageRef) -> String {
        let plan = self.plan;
        match stage {
            StageRef::Scene(i) => {
                let scene = &plan.scenes[i];
                let counts = self
                    .counts
                    .get(i)
                    .map(|c| format!(", {} vertices, {} simplices", grouped(c.vertices), grouped(c.simplices)));
                let objects = if scene.objects.len() == 1 { "object" } else { "objects" };
                format!("{}D, {} {objects}{}", scene.dimension, scene.objects.len(), counts.unwrap_or_default())
            }
            StageRef::Occlusion(i) => self.occlusion(&plan.occlusions[i]),
            StageRef::Render(i) => self.render(&plan.renders[i]),
            StageRef::Write(i) => {
                let write = &plan.writes[i];
                let files: Vec<String> = write.files().map(|file| file.display().to_string()).collect();
                let packed = if write.vti.is_some() && write.compression != Compression::None {
                    " before compression"
                } else {
                    ""
                };
                let size = match bytes(plan, write) {
                    0 => String::new(),
                    bytes => format!(" ({}{packed})", size(bytes)),
                };
                format!("{} -> {}{size}", plan.renders[write.render].id, files.join(", "))
            }
            StageRef::Figure(i) => {
                let figure = &plan.figures[i];
                let writes: Vec<&str> = figure.writes.iter().map(|&w| plan.writes[w].id.as_str()).collect();
                let picture = figure.screenshot.iter().map(|file| format!(", {}", file.display()));
                format!("{} -> {}{}", writes.join(", "), figure.state.display(), picture.collect::<String>())
            }
        }
    }

    fn occlusion(&self, occlusion: &OcclusionPlan) -> String {
        let scene = &self.plan.scenes[occlusion.scene].id;
        let how = match &occlusion.source {
            OcclusionSource::Load(file) => format!("from {}", file.display()),
            OcclusionSource::Compute(computation) => {
                let method = computation.method.as_str();
                match computation.samples {
                    Samples::Exact => method.to_owned(),
                    Samples::Fixed(n) => format!("{method}, {} samples a vertex", grouped(n)),
                    Samples::Target { error, max_samples } => {
                        format!("{method}, error below {error}, at most {} samples a vertex", grouped(max_samples))
                    }
                }
            }
        };
        let rays = rays(occlusion, self.counts).filter(|&n| n > 0).map(|n| format!(", {} rays", grouped(n)));
        let file = occlusion.file.as_ref().map(|file| format!(" -> {}", file.display()));
        format!("of {scene}: {how}{}{}", rays.unwrap_or_default(), file.unwrap_or_default())
    }

    fn render(&self, render: &RenderPlan) -> String {
        let [x, y, z] = render.dimensions;
        let scene = &self.plan.scenes[render.scene];
        let with = match render.occlusion {
            Some(i) => format!("with {}", self.plan.occlusions[i].id),
            None => "without occlusion".into(),
        };
        let projection = match render.camera.projection {
            ProjectionPlan::Perspective { field_of_view } => format!("perspective {field_of_view} degrees"),
            ProjectionPlan::Parallel { height } => format!("parallel, height {height}"),
        };
        let extent = match scene.dimension {
            Dimension::Three => format!("{x} x {y}"),
            Dimension::Four => format!("{x} x {y} x {z}"),
        };
        let voxels = grouped(render.voxels());
        format!("{} {with}: {extent} = {voxels} voxels, {}, {projection}", scene.id, render.shading.as_str())
    }
}

impl Shading {
    /// As the pipeline names it.
    pub fn as_str(self) -> &'static str {
        match self {
            Shading::Smooth => "smooth",
            Shading::Flat => "flat",
            Shading::Voxel => "voxel",
        }
    }
}

impl Projection {
    /// As the pipeline names it.
    pub fn as_str(self) -> &'static str {
        match self {
            Projection::Perspective => "perspective",
            Projection::Parallel => "parallel",
        }
    }
}

/// A path in JSON, with what isn't Unicode in it replaced.
pub(super) fn path<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&path.to_string_lossy())
}

/// A list in JSON as its length.
pub(super) fn count<T, S: Serializer>(list: &[T], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_u64(list.len() as u64)
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
