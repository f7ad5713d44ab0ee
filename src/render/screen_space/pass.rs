//! Screen space as a step of pictures: what voxels show, and the light that leaves it.

use rayon::prelude::*;

use super::DepthImage;
use crate::geometry::{Vector, Vector64, widen};
use crate::mesh::Mesh;
use crate::occlusion::Error;
use crate::progress::Progress;
use crate::render::NOTHING;
use crate::render::gbuffer::{Columns, GBuffer};
use crate::render::light::reflectance;

/// What a visible point is made of, and what becomes of it.
pub(in crate::render) const COLUMNS: Columns =
    Columns::SIMPLEX.union(Columns::POSITION).union(Columns::NORMAL).union(Columns::OCCLUSION);

/// Sets the occlusion where a voxel of the buffer shows a point, and, where the buffer has columns for it, the open directions
/// and the light of other surfaces, as far as the image is made to look for them. How far off they are is not known.
///
/// # Errors
/// [`Error::Cancelled`] if `progress` says so.
pub(in crate::render) fn occlude<const D: usize>(
    image: &DepthImage<D>,
    buffer: &mut GBuffer<D>,
    progress: &dyn Progress,
) -> Result<(), Error> {
    let [_, height, _] = buffer.dimensions();
    let first = buffer.layers().start;
    buffer.rows_mut().into_par_iter().enumerate().try_for_each(|(row, out)| {
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        for i in (0..out.simplex.len()).filter(|&i| out.simplex[i] != NOTHING) {
            let seen = image.seen(&out.position[i], &out.normal[i], [i, row % height, first + row / height]);
            out.occlusion[i] = seen.open;
            if let Some(direction) = out.direction.get_mut(i).filter(|_| seen.open > 0.0) {
                *direction = seen.vector / seen.open;
            }
            if let Some(hidden) = out.hidden.get_mut(i).filter(|_| seen.open < 1.0) {
                *hidden = seen.bounced.map(|c| c / (1.0 - seen.open));
            }
            for error in [out.error.get_mut(i), out.bounce_error.get_mut(i)].into_iter().flatten() {
                *error = f32::NAN;
            }
        }
        progress.advance(out.simplex.len() as u64);
        Ok(())
    })
}

/// The light that leaves what the voxels of a buffer show, under a sky of this gradient, once [`occlude`] has found where
/// the sky is open: the reflectance times A + g . b; with the normal. Black where nothing is.
pub(in crate::render) fn radiosity<const D: usize>(
    mesh: &Mesh<D>,
    buffer: &GBuffer<D>,
    gradient: &Vector64<D>,
) -> Vec<([f32; 3], Vector<D>)> {
    let light = |i: usize| {
        let simplex = buffer.simplex[i];
        if simplex == NOTHING {
            return ([0.0; 3], Vector::zeros());
        }
        let arrives = f64::from(buffer.occlusion[i]) * (1.0 + gradient.dot(&widen(&buffer.direction[i]))).max(0.0);
        let light = reflectance(mesh.objects[mesh.object_of(simplex)].color).map(|c| (c * arrives) as f32);
        (light, buffer.normal[i])
    };
    (0..buffer.len()).into_par_iter().with_min_len(4096).map(light).collect()
}
