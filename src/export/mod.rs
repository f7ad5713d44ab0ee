//! Files: images, meshes and pictures, written whole or not at all.
//!
//! Every format is a writer over any `Write`, so it can be tested in memory; [`AtomicFile`] is the one place that
//! opens files. Images are streamed in slabs of z layers ([`vti`], [`raw`], [`png`]), so that an image need never be
//! in memory as a whole. Meshes ([`vtu`]) are. A figure for
//! ParaView ([`paraview`]) is a script that finds its images beside itself.

mod atomic;
mod error;
pub mod paraview;
pub mod png;
pub mod pvd;
pub mod raw;
pub mod vti;
pub mod vtu;
mod xml;

pub use atomic::{AtomicFile, check_free_space, check_writable, free_space};
pub use error::Error;
