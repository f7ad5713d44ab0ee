//! Ambient occlusion at the visible points themselves, and the light that depends on it.

use rayon::prelude::*;

use super::gbuffer::{Columns, GBuffer};
use super::inside::inside;
use super::{NOTHING, Skylight};
use crate::mesh::Mesh;
use crate::occlusion::{Directional, Error, Estimates, Estimator};
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
    let seen = seen(buffer);
    let found = at(backend, estimator, buffer, &seen, progress)?;
    set(buffer, &seen, &found);
    Ok(())
}

/// The same, and where the buffer has columns for it, the open directions and the light of other surfaces, by the same rays.
///
/// # Errors
/// Those of the estimator.
pub(super) fn occlude_and_light<const D: usize>(
    backend: &dyn RayBackend<D>,
    estimator: Estimator,
    buffer: &mut GBuffer<D>,
    skylight: Option<&Skylight<D>>,
    progress: &dyn Progress,
) -> Result<(), Error> {
    if !buffer.columns().intersects(Columns::DIRECTION | Columns::HIDDEN | Columns::BOUNCE_ERROR) {
        return occlude(backend, estimator, buffer, progress);
    }
    let seen = seen(buffer);
    let points = points(backend.tracer().mesh(), buffer, &seen);
    let is_lit = buffer.columns().intersects(Columns::HIDDEN | Columns::BOUNCE_ERROR);
    let radiosity = skylight.and_then(|skylight| skylight.radiosity.as_ref()).filter(|_| is_lit);
    let found = estimator.directional(backend, &points, radiosity.map(|r| r.as_slice()), progress);
    let Directional { estimates, vectors, bounced } =
        found.map_err(|error| error.placed(|at| voxel(buffer, seen[at])))?;
    set(buffer, &seen, &estimates);
    for (n, &i) in seen.iter().enumerate() {
        let open = estimates.values[n];
        if let Some(direction) = buffer.direction.get_mut(i).filter(|_| open > 0.0) {
            *direction = vectors[n] / open;
        }
        let Some(bounced) = &bounced else { continue };
        if let Some(hidden) = buffer.hidden.get_mut(i).filter(|_| open < 1.0) {
            *hidden = bounced.light[n].map(|c| c / (1.0 - open));
        }
        if let Some(error) = buffer.bounce_error.get_mut(i) {
            *error = bounced.errors[n];
        }
    }
    if let (Some(skylight), Some(bounced)) = (skylight, &bounced) {
        skylight.count(bounced);
    }
    Ok(())
}

/// The voxels that see something, by their places in the buffer.
fn seen<const D: usize>(buffer: &GBuffer<D>) -> Vec<usize> {
    (0..buffer.len()).filter(|&i| buffer.simplex[i] != NOTHING).collect()
}

/// Sets occlusion and its error at these places.
fn set<const D: usize>(buffer: &mut GBuffer<D>, places: &[usize], found: &Estimates) {
    for ((&i, &value), &found_error) in places.iter().zip(&found.values).zip(&found.errors) {
        if let Some(occlusion) = buffer.occlusion.get_mut(i) {
            *occlusion = value.clamp(0.0, 1.0);
        }
        if let Some(error) = buffer.error.get_mut(i) {
            *error = found_error;
        }
    }
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
    let points = points(backend.tracer().mesh(), buffer, places);
    let found = estimator.estimate(backend, &points, None, progress);
    found.map_err(|error| error.placed(|place| voxel(buffer, places[place])))
}

/// The points that these voxels show.
fn points<const D: usize>(mesh: &Mesh<D>, buffer: &GBuffer<D>, places: &[usize]) -> Vec<ShadingPoint<D>> {
    let first = buffer.layers().start * buffer.layer_len();
    let point = |&i: &usize| ShadingPoint::Inside {
        position: inside(mesh, buffer.simplex[i], &buffer.position[i]),
        normal: buffer.normal[i],
        simplex: buffer.simplex[i],
        number: (first + i) as u64,
    };
    places.par_iter().map(point).collect()
}

/// What the user calls the voxel at this place.
fn voxel<const D: usize>(buffer: &GBuffer<D>, place: usize) -> String {
    let n = buffer.layers().start * buffer.layer_len() + place;
    let [width, height, _] = buffer.dimensions();
    format!("voxel ({}, {}, {})", n % width, n / width % height, n / width / height)
}
