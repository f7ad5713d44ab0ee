//! Why a file can't be told about or compared.

use std::path::PathBuf;

use crate::io::vtk;
use crate::occlusion::FileError;

/// Something is wrong with a file, or two of them don't go together.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The operating system refuses.
    #[error("{}: cannot be read: {cause}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// Its reason.
        cause: std::io::Error,
    },
    /// Its name doesn't tell what it holds.
    #[error("{}: can't tell what it holds; the name should end in .vti, .vtu, .vtp, .vtk, .f32, .raw, .stl, .obj, .ply, .msh or .pvd, of images also in .nii, .hdr (of a .img), .nrrd, .nhdr, .nc, .h5 or .tif", path.display())]
    Unknown {
        /// The file.
        path: PathBuf,
    },
    /// A file of tolerances that isn't one.
    #[error("{}: expected tolerances, such as `arrays: {{rgba: {{atol: 2}}}}`: {message}", path.display())]
    Tolerances {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        message: String,
    },
    /// A picture that can't be taken in.
    #[error("{}: can't be read as a PNG: {message}", path.display())]
    Picture {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        message: String,
    },
    /// A VTK file that can't be taken in.
    #[error(transparent)]
    Vtk(#[from] vtk::Error),
    /// Another mesh that can't be taken in.
    #[error("{}: {message}", path.display())]
    Mesh {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        message: String,
    },
    /// An occlusion file that isn't what its sidecar says.
    #[error("{}: {cause}", path.display())]
    Occlusion {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        cause: FileError,
    },
    /// A length that no whole number of values has.
    #[error("{}: holds {found} bytes, which is no multiple of {unit} above 0 ({why}); it is cut short, or something else", path.display())]
    Length {
        /// The file.
        path: PathBuf,
        /// Its length.
        found: usize,
        /// Bytes of one value.
        unit: usize,
        /// Why they are so many.
        why: &'static str,
    },
    /// More memory than there is.
    #[error("{}: needs about {needed} bytes of memory, and {available} can be had; look at it on a larger machine, or at a part of it", path.display())]
    Memory {
        /// The file.
        path: PathBuf,
        /// How much it needs.
        needed: u64,
        /// How much there is.
        available: u64,
    },
    /// A file that tells of no pipeline.
    #[error("{}: tells of no pipeline: {message}", path.display())]
    Pipeline {
        /// The file.
        path: PathBuf,
        /// Why.
        message: String,
    },
    /// Two files that have nothing in common.
    #[error("{} is {first} and {} is {second}; give two of a kind", a.display(), b.display())]
    Kinds {
        /// The first file.
        a: PathBuf,
        /// What it is.
        first: &'static str,
        /// The second file.
        b: PathBuf,
        /// What it is.
        second: &'static str,
    },
    /// An array that is asked for, and nowhere.
    #[error("neither {} nor {} has an array `{name}`; there is {known}", a.display(), b.display())]
    NoArray {
        /// The array.
        name: String,
        /// The first file.
        a: PathBuf,
        /// The second file.
        b: PathBuf,
        /// The arrays that there are.
        known: String,
    },
}
