//! Ambient occlusion at the visible points themselves.

use rayon::prelude::*;

use super::NOTHING;
use super::gbuffer::{Columns, GBuffer};
use crate::occlusion::{Error, Estimates, Estimator};
use crate::progress::Progress;
use crate::trace::{RayBackend, ShadingPoint};

/// What a visible point is made of.
pub(super) const COLUMNS: Columns = Columns::SIMPLEX.union(Columns::POSITION).union(Columns::NORMAL);

/// Sets occlusion and its error where a voxel of the buffer shows a point.
///
/// # Errors
/// Those of the estimator.
pub(super) fn occlude<const D: usize>(
    backend: &dyn RayBackend<D>,
    estimator: Estimator,
    buffer: &mut GBuffer<D>,
    progress: &dyn Progress,
) -> Result<(), Error> {
    let seen: Vec<usize> = (0..buffer.len()).filter(|&i| buffer.simplex[i] != NOTHING).collect();
    let found = at(backend, estimator, buffer, &seen, progress)?;
    for ((&i, value), found_error) in seen.iter().zip(found.values).zip(found.errors) {
        if let Some(occlusion) = buffer.occlusion.get_mut(i) {
            *occlusion = value.clamp(0.0, 1.0);
        }
        if let Some(error) = buffer.error.get_mut(i) {
            *error = found_error;
        }
    }
    Ok(())
}

/// The occlusion at the points that some voxels of the buffer show.
///
/// # Errors
/// Those of the estimator, which name the voxel.
pub(super) fn at<const D: usize>(
    backend: &dyn RayBackend<D>,
    estimator: Estimator,
    buffer: &GBuffer<D>,
    places: &[usize],
    progress: &dyn Progress,
) -> Result<Estimates, Error> {
    let first = buffer.layers().start * buffer.layer_len();
    let point = |&i: &usize| ShadingPoint::Inside {
        position: buffer.position[i],
        normal: buffer.normal[i],
        simplex: buffer.simplex[i],
        number: (first + i) as u64,
    };
    let points: Vec<ShadingPoint<D>> = places.par_iter().map(point).collect();
    let [width, height, _] = buffer.dimensions();
    let voxel = |place: usize| {
        let n = first + places[place];
        format!("voxel ({}, {}, {})", n % width, n / width % height, n / width / height)
    };
    estimator.estimate(backend, &points, None, progress).map_err(|error| error.placed(voxel))
}
