//! The value at every vertex of a mesh, on all cores.

use rayon::prelude::*;

use super::{Cancelled, Level, Sequence, Settings, Site, Stream};
use crate::accel::Tracer;
use crate::mesh::{Incidence, Mesh};
use crate::progress::Progress;

/// Rays between two looks at whether to go on, about.
const BATCH_RAYS: usize = 1 << 13;

/// Estimates A at one point: the share of `settings.samples` cosine-weighted rays that escape. `number` tells points
/// apart: each has its own rays. This is the slow way, ray by ray, which defines the value.
pub fn ambient_occlusion<const D: usize>(tracer: &Tracer<D>, site: &Site<D>, settings: &Settings, number: u64) -> f32 {
    if site.normal.amax() == 0.0 {
        return 1.0;
    }
    let frame = site.frame();
    let mut sequence = Sequence::new(settings.sampler, settings.seed, number);
    let visible = (0..settings.samples)
        .filter(|_| site.is_visible(tracer, sequence.next_direction(&frame), settings.max_distance))
        .count();
    (visible as f64 / f64::from(settings.samples)) as f32
}

/// Estimates A at every vertex of the mesh, in vertex order. A vertex that belongs to no simplex has the value 1. The
/// result is the same on any number of threads and on any processor, and that of [`ambient_occlusion`].
///
/// # Errors
/// [`Cancelled`] if `progress` says so.
pub fn at_vertices<const D: usize>(
    tracer: &Tracer<D>,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Vec<f32>, Cancelled> {
    at_vertices_with(Level::best(), tracer, settings, progress)
}

/// [`at_vertices`] with the instructions of a level, for comparisons.
///
/// # Errors
/// [`Cancelled`] if `progress` says so.
///
/// # Panics
/// If this processor lacks the instructions.
pub fn at_vertices_with<const D: usize>(
    level: Level,
    tracer: &Tracer<D>,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Vec<f32>, Cancelled> {
    let mesh = tracer.mesh();
    let incidence = Incidence::new(mesh);
    let order = spatial_order(tracer);
    let batch = (BATCH_RAYS / settings.samples.max(1) as usize).clamp(1, 64);
    let batches = order.par_chunks(batch).with_min_len(8).map_init(
        || Stream::new(level),
        |stream, vertices| {
            if progress.cancelled() {
                return Err(Cancelled);
            }
            let values: Vec<f32> =
                vertices.iter().map(|&vertex| stream.at_vertex(tracer, &incidence, settings, vertex)).collect();
            progress.advance(values.len() as u64);
            Ok(values)
        },
    );
    let found: Vec<Vec<f32>> = batches.collect::<Result<_, _>>()?;
    let mut values = vec![1.0; mesh.vertices.len()];
    for (&vertex, value) in order.iter().zip(found.into_iter().flatten()) {
        values[vertex as usize] = value;
    }
    Ok(values)
}

/// The root mean square over all values of the standard error that so many independent samples have. Scrambled Sobol'
/// points do better, so for them this is an upper estimate.
pub fn error_estimate(values: &[f32], samples: u64) -> f64 {
    let variance = |&v: &f32| f64::from(v) * (1.0 - f64::from(v)) / samples as f64;
    (values.iter().map(variance).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// All vertices, those that are close in the hierarchy close to each other: then the nodes that one of them needs are
/// still in the cache for the next.
fn spatial_order<const D: usize>(tracer: &Tracer<D>) -> Vec<u32> {
    let mesh: &Mesh<D> = tracer.mesh();
    let mut seen = vec![false; mesh.vertices.len()];
    let mut order = Vec::with_capacity(mesh.vertices.len());
    let corners = tracer.bvh().order.iter().flat_map(|&simplex| mesh.simplices[simplex as usize]);
    for vertex in corners.chain(0..mesh.vertices.len() as u32) {
        if !std::mem::replace(&mut seen[vertex as usize], true) {
            order.push(vertex);
        }
    }
    order
}
