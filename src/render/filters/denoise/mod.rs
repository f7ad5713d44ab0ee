//! Denoising of ambient occlusion: each voxel's few rays, and what its neighbours' say.
//!
//! 1. [`Fit`]: what the surroundings of a voxel suggest, by a local linear fit;
//! 2. [`Settle`]: between that and the voxel's own value, by the noise of the one and what the other leaves out;
//! 3. [`Refine`]: more rays where the error is still larger than it may be.
//!
//! All three carry the standard error along. What a voxel gets depends on its window alone, so neither slabs nor threads
//! change a bit.

mod fit;
mod refine;
mod settle;
#[cfg(test)]
mod tests;
mod window;

pub use fit::Fit;
pub use refine::Refine;
pub use settle::Settle;

use super::ImageFilter;
use crate::render::Camera;
use crate::render::gbuffer::Columns;
use crate::trace::Sampling;
use crate::volume::Grid;

/// What the first two read or write.
const COLUMNS: Columns = Columns::SIMPLEX
    .union(Columns::POSITION)
    .union(Columns::NORMAL)
    .union(Columns::OBJECT)
    .union(Columns::OCCLUSION)
    .union(Columns::ERROR)
    .union(Columns::FITTED)
    .union(Columns::MISFIT);

/// The filters that denoise images of this grid whose occlusion comes from these rays a voxel: a fit, and what is settled
/// between it and the voxels' own values.
pub fn denoise<const D: usize>(camera: &Camera<D>, grid: &Grid, sampling: Sampling) -> [Box<dyn ImageFilter<D>>; 2] {
    [Box::new(Fit::new(camera, grid, sampling)), Box::new(Settle::new(camera, grid, sampling))]
}

/// The smallest side of a voxel in the image.
fn spacing<const D: usize>(grid: &Grid) -> f64 {
    grid.spacing[..D - 1].iter().copied().fold(f64::INFINITY, f64::min)
}
