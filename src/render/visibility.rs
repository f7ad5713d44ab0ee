//! What each voxel sees.

use std::ops::Range;

use rayon::prelude::*;

use super::Camera;
use crate::accel::Tracer;
use crate::occlusion::Cancelled;
use crate::progress::Progress;
use crate::volume::Grid;

/// Stands for a simplex where a voxel sees none.
pub const NOTHING: u32 = u32::MAX;

/// The simplex that the ray through each voxel of some layers hits first, x fastest, or [`NOTHING`], by ray casting.
///
/// # Errors
/// [`Cancelled`] if `progress` says so.
pub fn ray_cast<const D: usize>(
    tracer: &Tracer<D>,
    camera: &Camera<D>,
    grid: &Grid,
    layers: Range<usize>,
    progress: &dyn Progress,
) -> Result<Vec<u32>, Cancelled> {
    let [width, height, _] = grid.dimensions;
    let mut visible = vec![NOTHING; grid.layer_len() * layers.len()];
    visible.par_chunks_mut(width).enumerate().try_for_each(|(row, voxels)| {
        if progress.cancelled() {
            return Err(Cancelled);
        }
        let (j, k) = (row % height, layers.start + row / height);
        for (i, voxel) in voxels.iter_mut().enumerate() {
            if let Some(hit) = tracer.closest_hit(&camera.voxel_ray(grid, [i, j, k])) {
                *voxel = hit.simplex;
            }
        }
        progress.advance(width as u64);
        Ok(())
    })?;
    Ok(visible)
}
