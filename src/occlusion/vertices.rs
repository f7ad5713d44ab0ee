//! The value at every vertex of a mesh, on all cores.

use rayon::prelude::*;

use super::{Cancelled, Sequence, Settings, Site};
use crate::accel::Tracer;
use crate::mesh::Incidence;
use crate::progress::Progress;

/// Vertices between two looks at whether to go on.
const BATCH: usize = 64;

/// Estimates A at one point: the share of `settings.samples` cosine-weighted rays that escape. `number` tells points
/// apart: each has its own rays.
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
/// result is the same on any number of threads.
///
/// # Errors
/// [`Cancelled`] if `progress` says so.
pub fn at_vertices<const D: usize>(
    tracer: &Tracer<D>,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Vec<f32>, Cancelled> {
    let incidence = Incidence::new(tracer.mesh());
    let mut values = vec![1.0; tracer.mesh().vertices.len()];
    values.par_chunks_mut(BATCH).enumerate().try_for_each(|(batch, values)| {
        if progress.cancelled() {
            return Err(Cancelled);
        }
        for (i, value) in values.iter_mut().enumerate() {
            let vertex = (batch * BATCH + i) as u32;
            let site = Site::at_vertex(tracer, &incidence, vertex);
            *value = ambient_occlusion(tracer, &site, settings, u64::from(vertex));
        }
        progress.advance(values.len() as u64);
        Ok(())
    })?;
    Ok(values)
}

/// The root mean square over all values of the standard error that so many independent samples have. Scrambled Sobol'
/// points do better, so for them this is an upper estimate.
pub fn error_estimate(values: &[f32], samples: u64) -> f64 {
    let variance = |&v: &f32| f64::from(v) * (1.0 - f64::from(v)) / samples as f64;
    (values.iter().map(variance).sum::<f64>() / values.len().max(1) as f64).sqrt()
}
