//! Grids of values from files: `.vti`, `.pvti` and `.vtk`, `.raw`, `.nii` and `.nii.gz`, `.tif`, `.nc`, `.nrrd`; single files, and
//! sequences with a file for each step of time, named one by one or by a list (`.pvd`, `.series`).
//!
//! Whatever the format, a reader opens a file to [`Opened`]: its axes as they are stored, each with what it is, where its points
//! are and which way it runs, and a stream of [`Numbers`]. [`Opened::arrange`] makes an [`Image`] of it: x, y, z and time, in
//! this order, with one number a point. So a reader holds a few thousand values where the format allows it, a page of a TIFF, or
//! one file of a sequence of `.vti`. Declared sizes are held against the file's length before anything is allocated.
//!
//! What a format says and this module doesn't heed is told in notes; what can't be read is refused, with what would help.

mod axes;
mod list;
mod netcdf;
mod nifti;
mod nrrd;
mod numbers;
mod raw;
mod sequence;
mod tiff;
mod units;
mod vti;

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::axes::{Axis, Frame, Image, Opened, Placement, Positions, Role};
pub use self::numbers::Numbers;
use self::numbers::Packing;
use super::{Input, InputError as Error, series};
use crate::volume::{Kind, available_memory};

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

/// What a file does not say of itself, or what is to be taken of it.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// Which array, variable or image, where there are several.
    pub array: Option<String>,
    /// Sizes of a raw file, or how the pages of a TIFF are z and time.
    pub dimensions: Option<[usize; 4]>,
    /// The type of a raw file's numbers.
    pub number: Option<Number>,
    /// The order of their bytes.
    pub byte_order: ByteOrder,
    /// Bytes before the first number of a raw file.
    pub offset: u64,
    /// Which of several values at each point.
    pub channel: Option<usize>,
    /// What the stored axes are, the fastest first, instead of what the file says.
    pub axes: Option<Vec<Role>>,
    /// Where it is put.
    pub placement: Placement,
    /// Which way x, y and z are to point: `RAS` or the like.
    pub space: Option<String>,
    /// Whether times are counted, whatever the files say.
    pub count_times: bool,
}

/// Opens an image, or several as one with the files following each other in time.
///
/// # Errors
/// If a file can't be read, is damaged or foreign, or doesn't go on from the first.
pub fn open(key: &str, folder: &Path, files: &[PathBuf], request: &Request) -> Result<Image, Error> {
    let inputs: Vec<Input> = files.iter().map(|file| Input::new(key, folder, file)).collect();
    match inputs.as_slice() {
        [] => Err(Error::invalid(key, "names no file")),
        [one] => arranged(one, request),
        _ => sequence::open(inputs, request),
    }
}

/// The files that are read besides this one: those that it names.
pub fn data_files(path: &Path) -> Vec<PathBuf> {
    match format(path) {
        Some(Format::Nrrd) => nrrd::data_files(path),
        Some(Format::Nifti) => nifti::data_files(path),
        Some(Format::Pieces) => super::vtk::piece_files(path),
        Some(Format::List) => listed_files(path),
        _ => Vec::new(),
    }
}

/// The files that a list names, and those that they name.
fn listed_files(path: &Path) -> Vec<PathBuf> {
    let files = series::files(path).into_iter().filter(|file| !series::is_list(file));
    files.flat_map(|file| [data_files(&file), vec![file]].concat()).collect()
}

/// Whether the files of a list are images, by the name of the first; a `.vtk` can be either, and is looked into.
fn list_is_of_images(path: &Path) -> bool {
    let Some(first) = series::files(path).into_iter().next() else { return false };
    match first.extension().unwrap_or_default().to_string_lossy().to_lowercase().as_str() {
        "vtk" => {
            matches!(super::vtk::read_wanted(&first, super::vtk::Wanted::Named(&[])), Ok(super::vtk::DataSet::Image(_)))
        }
        ending => !super::mesh::ENDINGS.contains(&ending),
    }
}

/// Whether `info` tells of a file as an image of measurements, with time among its axes. Images of VTK and files without a header,
/// which hold whatever this program writes, are told of otherwise.
pub fn is_measurement(path: &Path) -> bool {
    match format(path) {
        None | Some(Format::Vti | Format::Pieces | Format::Raw) => false,
        Some(Format::List) => list_is_of_images(path),
        Some(Format::Nifti | Format::Tiff | Format::Netcdf | Format::Nrrd) => true,
    }
}

/// Opens a file as it is stored.
///
/// # Errors
/// As [`open()`].
pub fn open_stored(path: &Path, request: &Request) -> Result<Opened, Error> {
    stored(&Input::new("", Path::new(""), path), request)
}

/// The formats of files.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Format {
    Vti,
    Raw,
    Nifti,
    Tiff,
    Netcdf,
    Nrrd,
    /// Files of VTK that make one image.
    Pieces,
    /// Files over time.
    List,
}

/// The format of a file, by its name.
fn format(path: &Path) -> Option<Format> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let ends = |endings: &[&str]| endings.iter().any(|ending| name.ends_with(ending));
    Some(match () {
        () if ends(&[".vti", ".vtk"]) => Format::Vti,
        () if ends(&[".pvti"]) => Format::Pieces,
        () if ends(&[".pvd", ".series"]) => Format::List,
        () if ends(&[".raw", ".bin", ".dat"]) => Format::Raw,
        () if ends(&[".nii", ".nii.gz", ".hdr", ".hdr.gz"]) => Format::Nifti,
        () if ends(&[".tif", ".tiff"]) => Format::Tiff,
        () if ends(&[".nc", ".cdf", ".nc4", ".cdf5", ".h5", ".hdf5", ".he5"]) => Format::Netcdf,
        () if ends(&[".nrrd", ".nhdr"]) => Format::Nrrd,
        () => return None,
    })
}

fn stored(input: &Input, request: &Request) -> Result<Opened, Error> {
    let length = crate::input::length(&input.path).map_err(|source| input.unreadable(source))?;
    if length == 0 {
        return Err(input.wrong("is empty"));
    }
    let open: fn(&Path, u64, &Request) -> Result<Opened, String> = match format(&input.path) {
        Some(Format::Vti | Format::Pieces) => vti::open,
        Some(Format::List) => list::open,
        Some(Format::Raw) => raw::open,
        Some(Format::Nifti) => nifti::open,
        Some(Format::Tiff) => tiff::open,
        Some(Format::Netcdf) => netcdf::open,
        Some(Format::Nrrd) => nrrd::open,
        None => {
            let known = ".vti, .pvti, .vtk, .pvd, .vti.series, .raw, .nii, .nii.gz, .tif, .nc, .nrrd";
            return Err(input.wrong(format!("can't tell what it holds; the name must end in one of {known}")));
        }
    };
    open(&input.path, length, request).map(Opened::in_one_unit).map_err(|message| input.wrong(message))
}

fn arranged(input: &Input, request: &Request) -> Result<Image, Error> {
    stored(input, request)?.arrange(request).map_err(|message| input.wrong(message))
}

/// Refuses to hold so many bytes where there is no room for them, and says why they are held at all.
fn room_for(bytes: u64, why: &str) -> Result<(), String> {
    match available_memory().filter(|&available| bytes > available) {
        None => Ok(()),
        Some(available) => Err(format!(
            "takes {bytes} bytes of memory or more, and {available} are free: {why}; \
             save it as .nrrd, .nii or .raw, which are read value by value"
        )),
    }
}

/// The most bytes that come out of one byte of gzip: 258 for two bits, in a long run of one value.
const MOST_FROM_GZIP: u64 = 1032;

/// Refuses a size that a file can't hold from this byte on, even if compressed, before anything is made of that size.
fn holds(needed: u64, offset: u64, length: u64, packing: Packing) -> Result<(), String> {
    let packed = packing == Packing::Gzip;
    let there = length.saturating_sub(offset).saturating_mul(if packed { MOST_FROM_GZIP } else { 1 });
    if needed <= there {
        return Ok(());
    }
    let most = if packed { " when unpacked at most" } else { "" };
    Err(format!("is cut off: {needed} bytes of values from byte {offset} on, but there are {there}{most}"))
}

/// Looks at what is left of a file after its values: refused where nothing may be left, told otherwise.
fn fits(needed: u64, offset: u64, length: u64, exactly: bool, notes: &mut Vec<String>) -> Result<(), String> {
    let left = length.saturating_sub(offset).saturating_sub(needed);
    if left > 0 && exactly {
        return Err(format!(
            "has {} bytes of values from byte {offset} on, and the sizes and type make {needed}: they don't fit; \
             if it has a header of its own, say by byte skip how long that is",
            needed + left
        ));
    }
    if left > 0 {
        notes.push(format!("{left} bytes behind the values are not read"));
    }
    Ok(())
}

/// The bytes that so many points take at this many bytes a point, which are as many as can be and some.
fn counted(points: &[usize], bytes_a_point: usize) -> Result<u64, String> {
    if points.contains(&0) {
        return Err(format!("holds no point: its sizes are {points:?}"));
    }
    let bytes = points.iter().try_fold(bytes_a_point as u64, |product, &n| product.checked_mul(n as u64));
    bytes.filter(|&n| n < 1 << 62).ok_or_else(|| format!("declares {points:?} points, more than can be"))
}
