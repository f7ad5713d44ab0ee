//! What a file holds, and how far two files are apart: `ao4d info` and `ao4d compare`.
//!
//! [`Contents::read`] takes in every kind of file that this program reads or writes. VTK's files tell by themselves what
//! they hold; the others have nothing but their names to go by:
//!
//! | file | read as |
//! | --- | --- |
//! | `.vti`, `.vtu`, `.vtp`, `.vtk`, `.pvti`, `.pvtu`, `.pvtp` | an image or a mesh, as [`crate::io::vtk`] reads it |
//! | `.pvd`, `.vti.series` | images over time, described but not compared, or one mesh |
//! | `.stl`, `.obj`, `.ply`, `.msh` | a mesh, with the cells that the file has |
//! | `.nii`, `.nrrd`, `.nc`, `.tif` | an image, described but not compared ([`image`]) |
//! | `.f32` | values at vertices, and what the sidecar says about them if there is one |
//! | `.raw` | colours without a header: only how many |
//!
//! From there [`compare()`] goes number by number, and [`Info`] describes: ranges of arrays, and of a simplicial mesh
//! whether it is closed, oriented and welded ([`surface`]).

pub mod compare;
mod error;
mod floats;
pub mod folders;
pub mod image;
mod info;
pub mod picture;
mod pipeline;
mod range;
mod reports;
pub mod surface;
mod tolerances;

use std::path::{Path, PathBuf};

pub use error::Error;
pub use info::{Description, Info};
pub use pipeline::pipeline;
pub use range::{ArraySummary, Range};

use self::compare::{Comparison, Tolerance};
use self::floats::Floats;
use crate::io::vtk::{self, DataSet, Field, Image, UnstructuredGrid, Wanted};
use crate::io::{Input, InputError};
use crate::occlusion::{self, Sidecar};
use crate::volume::{Array, Kind, Values, available_memory};

/// What values at vertices are called, here as in the files of meshes.
const OCCLUSION: &str = "ambient_occlusion";
/// What the colours of a `.raw` file are called, as in images.
const COLOURS: &str = "rgb";

/// What a file holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Contents {
    /// An image.
    Image(Image),
    /// Points and cells.
    Mesh(UnstructuredGrid),
    /// One value a vertex, and what is known about them.
    Occlusion(Values, Option<Sidecar>),
    /// Red, green and blue of each voxel, of an image whose dimensions are told elsewhere.
    Raw(Values),
}

impl Contents {
    /// Reads a file.
    ///
    /// # Errors
    /// If it can't be read, is damaged, cut short, or of a kind that isn't known here.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let ending = ending(path);
        if ENDINGS.contains(&ending.as_str()) {
            check_memory(path, BYTES_IN_MEMORY)?;
        }
        match ending.as_str() {
            "f32" => occlusion_file(path),
            "raw" => numbers(path, RAW_UNIT, RAW_WHY).map(Self::Raw),
            "stl" | "ply" | "obj" | "msh" | "pvd" | "series" => mesh(path).map(Self::Mesh),
            "vti" | "vtu" | "vtp" | "pvti" | "pvtu" | "pvtp" | "vtk" | "xml" => Ok(match vtk::read(path)? {
                DataSet::Image(image) => Self::Image(image),
                DataSet::Unstructured(mesh) => Self::Mesh(mesh),
            }),
            other => Err(match crate::io::mesh::remedy(other) {
                Some(remedy) => {
                    Error::Mesh { path: path.into(), message: format!("unsupported: .{other} files; {remedy}") }
                }
                None => Error::Unknown { path: path.into() },
            }),
        }
    }

    /// What kind of thing it is, with its article.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Image(_) => "an image",
            Self::Mesh(_) => "a mesh",
            Self::Occlusion(..) => "an occlusion file",
            Self::Raw(_) => "a raw file",
        }
    }

    /// What belongs to it as a whole.
    fn fields(&self) -> &[Field] {
        match self {
            Self::Image(image) => &image.field_data,
            Self::Mesh(mesh) => &mesh.field_data,
            Self::Occlusion(..) | Self::Raw(_) => &[],
        }
    }

    /// The names of its arrays, as [`compare()`] takes them.
    pub fn array_names(&self) -> Vec<&str> {
        fn names(arrays: &[Array]) -> Vec<&str> {
            arrays.iter().map(|a| a.name.as_str()).collect()
        }
        match self {
            Self::Image(image) => [names(&image.point_arrays), names(&image.cell_arrays)].concat(),
            Self::Mesh(mesh) => [vec!["points"], names(&mesh.point_arrays), names(&mesh.cell_arrays)].concat(),
            Self::Occlusion(..) => vec![OCCLUSION],
            Self::Raw(_) => vec![COLOURS],
        }
    }
}

/// Compares two files, number by number.
///
/// # Errors
/// If one can't be read, if they hold different kinds of things, or if neither has an array that is asked for.
pub fn compare(a: &Path, b: &Path, tolerance: &Tolerance) -> Result<Comparison, Error> {
    if let (Some((x, name, _)), Some((y, other, _))) = (floats(a)?, floats(b)?)
        && name == other
        && tolerance.takes_all_of(name)
    {
        return x.compare(y, name, tolerance);
    }
    let (first, second) = (Contents::read(a)?, Contents::read(b)?);
    let mut known = first.array_names();
    known.extend(second.array_names().into_iter().filter(|name| !first.array_names().contains(name)));
    let told =
        |name: &str| [&first, &second].iter().any(|contents| compare::text_of(contents.fields(), name).is_some());
    let unknown = |name: &&String| !known.contains(&name.as_str()) && !told(name);
    if let Some(name) = tolerance.arrays.iter().find(unknown) {
        return Err(Error::NoArray { name: name.clone(), a: a.into(), b: b.into(), known: known.join(", ") });
    }
    Ok(match (&first, &second) {
        (Contents::Image(x), Contents::Image(y)) => compare::images(x, y, tolerance),
        (Contents::Mesh(x), Contents::Mesh(y)) => compare::meshes(x, y, tolerance),
        (Contents::Occlusion(x, _), Contents::Occlusion(y, _)) => compare::lists(OCCLUSION, x, y, tolerance),
        (Contents::Raw(x), Contents::Raw(y)) => compare::lists(COLOURS, x, y, tolerance),
        _ => {
            return Err(Error::Kinds { a: a.into(), first: first.kind(), b: b.into(), second: second.kind() });
        }
    })
}

/// What files are read as a whole.
const ENDINGS: [&str; 16] = [
    "f32", "raw", "stl", "ply", "obj", "msh", "pvd", "series", "vti", "vtu", "vtp", "pvti", "pvtu", "pvtp", "vtk",
    "xml",
];
/// How many bytes of memory a byte of a file takes at least, while it is read.
const BYTES_IN_MEMORY: u64 = 3;
/// Bytes of a colour.
const RAW_UNIT: usize = 12;
const RAW_WHY: &str = "colours are three floats of four bytes each";
/// Bytes of a value at a vertex.
const VALUE_UNIT: usize = 4;
const VALUE_WHY: &str = "values are floats of four bytes each";

fn ending(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

/// A file of floats that nothing but its name tells about, to be looked at block by block; none of any other file.
fn floats(path: &Path) -> Result<Option<(Floats, &'static str, usize)>, Error> {
    Ok(match ending(path).as_str() {
        "raw" => Some((Floats::open(path, RAW_UNIT, RAW_WHY)?, COLOURS, 3)),
        "f32" if !beside(path).exists() => Some((Floats::open(path, VALUE_UNIT, VALUE_WHY)?, OCCLUSION, 1)),
        _ => None,
    })
}

/// Refuses a file that takes more memory than there is: so many bytes for each of its own.
fn check_memory(path: &Path, times: u64) -> Result<(), Error> {
    let bytes = crate::input::length(path).map_err(|cause| Error::Open { path: path.into(), cause })?;
    needs(path, bytes.saturating_mul(times))
}

/// Refuses what takes more memory than there is.
fn needs(path: &Path, needed: u64) -> Result<(), Error> {
    match available_memory().filter(|&available| available < needed) {
        Some(available) => Err(Error::Memory { path: path.into(), needed, available }),
        None => Ok(()),
    }
}

/// The sidecar's path.
fn beside(path: &Path) -> PathBuf {
    let mut beside = path.as_os_str().to_owned();
    beside.push(".yaml");
    beside.into()
}

/// All floats of a file whose length is a multiple of `unit` bytes.
fn numbers(path: &Path, unit: usize, why: &'static str) -> Result<Values, Error> {
    let bytes = crate::input::read(path).map_err(|cause| Error::Open { path: path.into(), cause })?;
    if bytes.is_empty() || bytes.len() % unit != 0 {
        return Err(Error::Length { path: path.into(), found: bytes.len(), unit, why });
    }
    Ok(Kind::F32.decode(&bytes, true))
}

/// With a sidecar the file must be what that says; without one it is a list of floats, whatever they are.
fn occlusion_file(path: &Path) -> Result<Contents, Error> {
    let beside = &beside(path);
    if !beside.exists() {
        return Ok(Contents::Occlusion(numbers(path, VALUE_UNIT, VALUE_WHY)?, None));
    }
    let text = crate::input::read_text(beside).map_err(|cause| Error::Open { path: beside.into(), cause })?;
    let bytes = crate::input::read(path).map_err(|cause| Error::Open { path: path.into(), cause })?;
    let damaged = |cause| Error::Occlusion { path: path.into(), cause };
    let sidecar = Sidecar::from_yaml(&text).map_err(damaged)?;
    let values = occlusion::decode(&bytes, sidecar.count).map_err(damaged)?;
    Ok(Contents::Occlusion(values.into(), Some(sidecar)))
}

/// A mesh from a file that isn't VTK's.
fn mesh(path: &Path) -> Result<UnstructuredGrid, Error> {
    Input::new("", Path::new(""), path).read_cells(Wanted::All).map_err(|error| match error {
        InputError::Unreadable { path, source, .. } => Error::Open { path, cause: source },
        InputError::Content { path, message, .. } => Error::Mesh { path, message },
        InputError::Invalid { message, .. } => Error::Mesh { path: path.into(), message },
    })
}
