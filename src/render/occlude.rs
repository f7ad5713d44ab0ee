//! Ambient occlusion at the visible points themselves.

use rayon::prelude::*;

use super::gbuffer::{Columns, GBuffer};
use super::{NOTHING, Renderer};
use crate::occlusion::opencl::Point;
use crate::occlusion::{Error, Estimate, Method};
use crate::progress::Progress;

/// What a visible point is made of.
pub(super) const COLUMNS: Columns = Columns::SIMPLEX.union(Columns::POSITION).union(Columns::NORMAL);

/// Sets occlusion and its error where a voxel of the buffer shows a point.
///
/// # Errors
/// Those of the method.
pub(super) fn occlude<const D: usize>(
    renderer: &Renderer<D>,
    method: Method,
    buffer: &mut GBuffer<D>,
    progress: &dyn Progress,
) -> Result<(), Error> {
    let seen: Vec<usize> = (0..buffer.len()).filter(|&i| buffer.simplex[i] != NOTHING).collect();
    let first = buffer.layers().start * buffer.layer_len();
    let point = |&i: &usize| Point::Inside {
        position: buffer.position[i],
        normal: buffer.normal[i],
        simplex: buffer.simplex[i],
        number: (first + i) as u64,
    };
    let points: Vec<Point<D>> = seen.par_iter().map(point).collect();
    let found: Vec<Estimate> = match renderer.device.filter(|_| method.is_traced()) {
        Some(device) => method.at_points_on(device, &points, progress)?,
        None => {
            let [width, height, _] = buffer.dimensions();
            let tracer = renderer.tracer;
            tracer.prepare();
            (points.par_iter())
                .map(|point| {
                    if progress.cancelled() {
                        return Err(Error::Cancelled);
                    }
                    let Point::Inside { position, normal, simplex, number } = point else {
                        return Ok(Estimate::known(1.0));
                    };
                    let n = *number as usize;
                    let place = || format!("voxel ({}, {}, {})", n % width, n / width % height, n / width / height);
                    method.at_point(tracer, position, normal, *simplex, *number, place)
                })
                .collect::<Result<_, _>>()?
        }
    };
    for (&i, estimate) in seen.iter().zip(found) {
        if let Some(occlusion) = buffer.occlusion.get_mut(i) {
            *occlusion = estimate.value.clamp(0.0, 1.0);
        }
        if let Some(error) = buffer.error.get_mut(i) {
            *error = estimate.error;
        }
    }
    Ok(())
}
