//! What an image of a format of measurements holds: NIfTI, NRRD, NetCDF, TIFF. Axes as they are stored, where they lie and in
//! what, and the numbers: their range, and a histogram.
//!
//! The values are gone over twice as a stream, so that an image may be larger than the memory.

use std::fmt;
use std::path::Path;

use serde::Serialize;

use super::Error;
use super::range::{BARS, Short, bar, histogram_line};
use crate::io::image::{self, Axis, Positions, Request};
use crate::io::{AtomicFile, InputError};

/// Values that are looked at together.
const BLOCK: usize = 1 << 16;

/// An axis, as it is stored.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AxisSummary {
    /// What the file calls it.
    pub name: String,
    /// `x`, `y`, `z`, `time` or `channel`, if the file says so.
    pub role: Option<&'static str>,
    /// How many points there are.
    pub points: usize,
    /// Where the first one is, along the axis.
    pub first: f64,
    /// Where the last one is.
    pub last: f64,
    /// Whether they are equally far from each other.
    pub even: bool,
    /// In what.
    pub unit: Option<String>,
    /// The unit vector along which it runs, if the file gives one.
    pub direction: Option<[f64; 4]>,
}

/// An image, summarised.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ImageSummary {
    /// The format.
    pub format: String,
    /// The axes, the fastest first.
    pub axes: Vec<AxisSummary>,
    /// Where the first point lies.
    pub origin: [f64; 4],
    /// Which way x, y and z point, if the file says so.
    pub space: Option<String>,
    /// The type of the numbers stored.
    pub number: String,
    /// What they measure.
    pub unit: Option<String>,
    /// The least and the largest number, and the mean; none if there is no number.
    pub range: Option<[f64; 3]>,
    /// Values that are no numbers.
    pub missing: u64,
    /// How many values there are in each of equal parts of the range.
    pub histogram: Vec<u64>,
    /// What is worth telling.
    pub notes: Vec<String>,
}

/// An error of reading an image.
fn failed(path: &Path, error: InputError) -> Error {
    let message = match error {
        InputError::Unreadable { path, source, .. } => return Error::Open { path, cause: source },
        InputError::Content { message, .. } | InputError::Invalid { message, .. } => message,
    };
    Error::Mesh { path: path.into(), message }
}

impl ImageSummary {
    /// Of a file.
    ///
    /// # Errors
    /// If it can't be read.
    pub fn read(path: &Path, array: Option<&str>) -> Result<Self, Error> {
        let request = Request { array: array.map(str::to_owned), ..Request::default() };
        let open = || image::open_stored(path, &request).map_err(|error| failed(path, error));
        let first = open()?;
        let count: u64 = first.axes.iter().map(|axis| axis.size as u64).product();
        let axes = first.axes.iter().map(summary).collect();
        let (mut low, mut high, mut sum, mut numbers, mut missing) =
            (f64::INFINITY, f64::NEG_INFINITY, 0.0, 0u64, 0u64);
        let go_over = |values: Box<dyn image::Numbers>, look: &mut dyn FnMut(f64)| {
            let mut values = values;
            let mut left = count;
            let mut block = vec![0.0; BLOCK];
            while left > 0 {
                let now = left.min(BLOCK as u64) as usize;
                values.read(&mut block[..now]).map_err(|message| Error::Mesh { path: path.into(), message })?;
                block[..now].iter().for_each(|value| look(*value));
                left -= now as u64;
            }
            Ok::<(), Error>(())
        };
        go_over(first.values, &mut |value| {
            if value.is_finite() {
                (low, high) = (low.min(value), high.max(value));
                sum += value;
                numbers += 1;
            } else {
                missing += u64::from(value.is_nan());
            }
        })?;
        let mut histogram = vec![0u64; BARS];
        if numbers > 0 {
            go_over(open()?.values, &mut |value| {
                if value.is_finite() {
                    histogram[bar(value, low, high)] += 1;
                }
            })?;
        }
        Ok(Self {
            format: first.format.to_owned(),
            axes,
            origin: first.origin,
            space: first.space,
            number: first.number,
            unit: first.unit,
            range: (numbers > 0).then(|| [low, high, sum / numbers as f64]),
            missing,
            histogram,
            notes: first.notes,
        })
    }
}

/// Writes all values, as a scene would take them: float64, little-endian, x fastest, then y, z, time. Returns how many along each.
///
/// # Errors
/// If the image can't be read, its axes aren't told, or the file can't be written.
pub fn write_values(path: &Path, array: Option<&str>, to: &Path) -> Result<[usize; 4], Error> {
    use std::io::Write;
    let request = Request { array: array.map(str::to_owned), ..Request::default() };
    let key = path.display().to_string();
    let mut image =
        image::open(&key, Path::new(""), &[path.to_owned()], &request).map_err(|error| failed(path, error))?;
    let points = image.points();
    let mut left: u64 = points.iter().map(|&n| n as u64).product();
    let refused = |cause: crate::io::Error| Error::Mesh { path: to.into(), message: cause.to_string() };
    let mut file = AtomicFile::create(to).map_err(refused)?;
    let mut block = vec![0.0; BLOCK];
    while left > 0 {
        let now = left.min(BLOCK as u64) as usize;
        image.values.read(&mut block[..now]).map_err(|message| Error::Mesh { path: path.into(), message })?;
        let bytes: Vec<u8> = block[..now].iter().flat_map(|value| value.to_le_bytes()).collect();
        file.write_all(&bytes).map_err(|cause| Error::Open { path: to.into(), cause })?;
        left -= now as u64;
    }
    file.commit().map_err(refused)?;
    Ok(points)
}

fn summary(axis: &Axis) -> AxisSummary {
    AxisSummary {
        name: axis.name.clone(),
        role: axis.role.map(|role| role.name()),
        points: axis.size,
        first: axis.positions.at(0),
        last: axis.positions.at(axis.size.saturating_sub(1)),
        even: match &axis.positions {
            Positions::Even { .. } => true,
            Positions::Listed(list) => {
                let step = (list[list.len() - 1] - list[0]) / (list.len().max(2) - 1) as f64;
                list.iter().enumerate().all(|(i, at)| (at - list[0] - i as f64 * step).abs() <= 1e-6 * step.abs())
            }
        },
        unit: axis.unit.clone(),
        direction: axis.direction,
    }
}

impl fmt::Display for ImageSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let list = |numbers: &[f64]| numbers.iter().map(|&x| Short(x).to_string()).collect::<Vec<_>>().join(", ");
        writeln!(f, "an image, {}, of {} numbers", self.format, self.number)?;
        writeln!(f, "axes, the fastest first:")?;
        for axis in &self.axes {
            let role =
                axis.role.filter(|role| *role != axis.name).map_or(String::new(), |role| format!(", which is {role}"));
            let role = if axis.role.is_none() { ", of which the file doesn't say what it is".to_owned() } else { role };
            let unit = axis.unit.as_ref().map_or(String::new(), |unit| format!(" {unit}"));
            let even = if axis.even { "" } else { ", not evenly" };
            write!(f, "  {}{role}: {} points", axis.name, axis.points)?;
            // In full: two dates may agree in their first six digits.
            write!(f, " from {} to {}{unit}{even}", axis.first, axis.last)?;
            match &axis.direction {
                Some(direction) => writeln!(f, ", along ({})", list(direction)),
                None => writeln!(f),
            }?;
        }
        let space = self.space.as_ref().map_or(String::new(), |space| format!(", in {space}"));
        writeln!(f, "origin ({}){space}", list(&self.origin))?;
        match &self.range {
            Some([low, high, mean]) => {
                let unit = self.unit.as_ref().map_or(String::new(), |unit| format!(" {unit}"));
                writeln!(f, "values from {} to {}{unit}, mean {}", Short(*low), Short(*high), Short(*mean))?;
                writeln!(f, "{}", histogram_line(&self.histogram))?;
            }
            None => writeln!(f, "no value is a number")?,
        }
        if self.missing > 0 {
            writeln!(f, "{} values are no numbers", self.missing)?;
        }
        self.notes.iter().try_for_each(|note| writeln!(f, "note: {note}"))
    }
}
