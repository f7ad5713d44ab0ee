//! Grids of values from files: `.vti`, `.raw`, `.nii` and `.nii.gz`, `.tif`, `.nc`, `.nrrd`; single files, and sequences with
//! a file for each step of time.
//!
//! Whatever the format, an image is a [`Header`] and then its xy slices one after the other, z before time. So a reader holds
//! no more than a slice where the format allows it (raw, NIfTI, NRRD, TIFF), or one file of a sequence where it does not
//! (`.vti`, NetCDF). Declared sizes are held against the file's length before anything is allocated.

mod bytes;
mod netcdf;
mod netcdf_header;
mod nifti;
mod nrrd;
mod tiff;
mod vti;

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Input, InputError as Error};
use crate::volume::{Kind, available_memory};

/// The sizes and places of an image: x, y, z, time.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// Points along each axis; at least 1.
    pub points: [usize; 4],
    /// Where the points of each axis are.
    pub positions: [Vec<f64>; 4],
}

impl Header {
    /// Evenly spaced points. Spacings that are no use become 1: many files leave them 0.
    fn even(points: [usize; 4], origin: [f64; 4], spacing: [f64; 4]) -> Self {
        let positions = |axis: usize| {
            let usable = spacing[axis].is_finite() && spacing[axis] != 0.0 && origin[axis].is_finite();
            let (start, step) = if usable { (origin[axis], spacing[axis].abs()) } else { (0.0, 1.0) };
            (0..points[axis]).map(|i| start + i as f64 * step).collect()
        };
        Self { points, positions: std::array::from_fn(positions) }
    }
}

/// The xy slices of an image, in the order of z, then time.
pub trait Slices {
    /// The next slice, x fastest. There are as many as the header says.
    fn next(&mut self) -> Result<Vec<f64>, String>;
}

/// An image whose header has been read.
pub struct Image {
    /// Sizes and places.
    pub header: Header,
    /// The values.
    pub slices: Box<dyn Slices>,
}

/// The type of the numbers in a raw file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs)]
pub enum Number {
    Int8,
    UInt8,
    Int16,
    UInt16,
    Int32,
    UInt32,
    Int64,
    UInt64,
    Float32,
    Float64,
}

impl Number {
    fn kind(self) -> Kind {
        match self {
            Number::Int8 => Kind::I8,
            Number::UInt8 => Kind::U8,
            Number::Int16 => Kind::I16,
            Number::UInt16 => Kind::U16,
            Number::Int32 => Kind::I32,
            Number::UInt32 => Kind::U32,
            Number::Int64 => Kind::I64,
            Number::UInt64 => Kind::U64,
            Number::Float32 => Kind::F32,
            Number::Float64 => Kind::F64,
        }
    }
}

/// The order of a number's bytes in a raw file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ByteOrder {
    /// The lowest byte first.
    #[default]
    Little,
    /// The highest byte first.
    Big,
}

/// What a file does not say of itself.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// Which array or variable, where there are several.
    pub array: Option<String>,
    /// Sizes of a raw file, or how the pages of a TIFF are z and time.
    pub dimensions: Option<[usize; 4]>,
    /// The type of a raw file's numbers.
    pub number: Option<Number>,
    /// The order of their bytes.
    pub byte_order: ByteOrder,
    /// Bytes before the first number of a raw file.
    pub offset: u64,
    /// Which channel of a TIFF.
    pub channel: usize,
}

/// Opens an image, or several as one with the files following each other in time.
///
/// # Errors
/// If a file can't be read, is damaged or foreign, or differs in size from the first.
pub fn open(key: &str, folder: &Path, files: &[PathBuf], request: &Request) -> Result<Image, Error> {
    let inputs: Vec<Input> = files.iter().map(|file| Input::new(key, folder, file)).collect();
    let Some(input) = inputs.first() else {
        return Err(Error::invalid(key, "names no file"));
    };
    let first = open_one(input, request)?;
    if inputs.len() == 1 {
        return Ok(first);
    }
    let mut header = first.header.clone();
    let frames = header.points[3] * inputs.len();
    let step = header.positions[3].get(1).map_or(1.0, |second| second - header.positions[3][0]);
    header.points[3] = frames;
    header.positions[3] = (0..frames).map(|i| header.positions[3][0] + i as f64 * step).collect();
    let points = first.header.points;
    let left = points[2] * points[3];
    let mut rest = inputs.into_iter();
    let current = rest.next().map(|input| (input, first.slices));
    Ok(Image { header, slices: Box::new(Sequence { rest, request: request.clone(), points, current, left }) })
}

fn open_one(input: &Input, request: &Request) -> Result<Image, Error> {
    let length = crate::input::length(&input.path).map_err(|source| input.unreadable(source))?;
    if length == 0 {
        return Err(input.wrong("is empty"));
    }
    let name = input.path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let ends = |endings: &[&str]| endings.iter().any(|ending| name.ends_with(ending));
    let open: fn(&Path, u64, &Request) -> Result<Image, String> = if ends(&[".vti"]) {
        vti::open
    } else if ends(&[".raw", ".bin", ".dat"]) {
        bytes::open_raw
    } else if ends(&[".nii", ".nii.gz"]) {
        nifti::open
    } else if ends(&[".tif", ".tiff"]) {
        tiff::open
    } else if ends(&[".nc", ".cdf"]) {
        netcdf::open
    } else if ends(&[".nrrd", ".nhdr"]) {
        nrrd::open
    } else {
        let known = ".vti, .raw, .nii, .nii.gz, .tif, .nc, .nrrd";
        return Err(input.wrong(format!("can't tell what it holds; the name must end in one of {known}")));
    };
    let image = open(&input.path, length, request).map_err(|message| input.wrong(message))?;
    if image.header.points.contains(&0) {
        return Err(input.wrong(format!("holds no point: its sizes are {:?}", image.header.points)));
    }
    Ok(image)
}

/// Files one after the other.
struct Sequence {
    rest: std::vec::IntoIter<Input>,
    request: Request,
    points: [usize; 4],
    current: Option<(Input, Box<dyn Slices>)>,
    left: usize,
}

impl Slices for Sequence {
    fn next(&mut self) -> Result<Vec<f64>, String> {
        if self.left == 0 {
            let input = self.rest.next().ok_or("has no more slices")?;
            let image = open_one(&input, &self.request).map_err(|error| error.to_string())?;
            if image.header.points != self.points {
                return Err(format!(
                    "{} has {:?} points, unlike the first file, which has {:?}",
                    input.path.display(),
                    image.header.points,
                    self.points
                ));
            }
            self.left = self.points[2] * self.points[3];
            self.current = Some((input, image.slices));
        }
        self.left -= 1;
        let (input, slices) = self.current.as_mut().ok_or("has no slices")?;
        slices.next().map_err(|message| format!("{}: {message}", input.path.display()))
    }
}

/// Slices of a whole array in memory, x fastest.
struct Held {
    values: Vec<f64>,
    size: usize,
    next: usize,
}

impl Held {
    fn new(values: Vec<f64>, points: [usize; 4]) -> Self {
        Self { values, size: points[0] * points[1], next: 0 }
    }
}

impl Slices for Held {
    fn next(&mut self) -> Result<Vec<f64>, String> {
        let slice = self.values.get(self.next..self.next + self.size).ok_or("has no more slices")?;
        self.next += self.size;
        Ok(slice.to_vec())
    }
}

/// Refuses to hold so many bytes where there is no room for them.
fn room_for(bytes: u64) -> Result<(), String> {
    match available_memory().filter(|&available| bytes > available) {
        None => Ok(()),
        Some(available) => Err(format!(
            "takes {bytes} bytes of memory or more, and {available} are free: this format is read as a whole; \
             save it as .nrrd, .nii or .raw, which are read layer by layer"
        )),
    }
}

/// The most bytes that come out of one byte of gzip: 258 for two bits, in a long run of one value.
const MOST_FROM_GZIP: u64 = 1032;

/// Refuses a size that a file can't hold from this byte on, even if compressed, before anything is made of that size.
fn holds(needed: u64, offset: u64, length: u64, compressed: bool) -> Result<(), String> {
    let there = length.saturating_sub(offset).saturating_mul(if compressed { MOST_FROM_GZIP } else { 1 });
    if needed <= there {
        return Ok(());
    }
    let most = if compressed { " when unpacked at most" } else { "" };
    Err(format!("is cut off: {needed} bytes of values from byte {offset} on, but there are {there}{most}"))
}

/// The bytes that so many points take at this many bytes a point, which are as many as can be and some.
fn counted(points: [usize; 4], bytes_a_point: usize) -> Result<u64, String> {
    if points.contains(&0) {
        return Err(format!("holds no point: its sizes are {points:?}"));
    }
    points
        .iter()
        .try_fold(bytes_a_point as u64, |product, &n| product.checked_mul(n as u64))
        .ok_or_else(|| format!("declares {points:?} points, more than can be"))
}
