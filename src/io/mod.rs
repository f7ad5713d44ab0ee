//! Files: every format in one place, reading and writing beside each other.
//!
//! | what | formats | where |
//! | --- | --- | --- |
//! | meshes read | `.stl`, `.obj`, `.ply`, `.msh`, `.vtk`, `.vtp`, `.vtu` | [`mesh`] |
//! | images read | `.vti`, `.raw`, `.nii`, `.tif`, `.nc`, `.nrrd` | [`image`] |
//! | VTK's files read, as one model | `.vti`, `.vtu`, `.vtp`, each also in pieces, legacy `.vtk` | [`vtk`] |
//! | lists of files over time read | `.pvd`, `.vti.series` | [`series`] |
//! | images written | `.vti`, `.raw`, `.png` | [`vti`], [`raw`], [`png`] |
//! | meshes, slices and sequences written | `.vtu`, `.vtp`, `.pvd` | [`vtu`], [`vtp`], [`pvd`] |
//! | lists of parts written | `.pvti`, `.pvtu` | [`parts`] |
//! | figures for ParaView written | a script that finds its images beside itself | [`paraview`] |
//!
//! Every writer works over any `Write`, so it can be tested in memory; [`AtomicFile`] is the one place that opens
//! outputs, written whole or not at all. Images are written in slabs of z layers, so that an image need never be in
//! memory as a whole. Readers trust no file: sizes are held against its length before memory is asked for.

mod atomic;
mod error;
pub mod image;
mod inline;
mod input;
pub mod mesh;
pub mod page;
pub mod paraview;
pub mod parts;
pub mod png;
pub mod pvd;
pub mod raw;
pub mod series;
pub mod vti;
pub mod vtk;
pub mod vtp;
pub mod vtu;
pub(crate) mod xml;

/// The name under which files tell of the pipeline that they were made by.
pub const PIPELINE: &str = "pipeline";

pub use atomic::{AtomicFile, Unfinished, abandon, check_free_space, check_writable, free_space, together};
pub use error::Error;
pub use input::{Input, InputError};
