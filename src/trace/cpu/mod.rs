//! The value at every vertex of a mesh, on all cores.

use rayon::prelude::*;

use super::estimate::Tally;
use super::{Cancelled, Estimate, Level, Sequence, Settings, Site, Stream, Target};
use crate::accel::Tracer;
use crate::mesh::{Incidence, Mesh};
use crate::progress::Progress;

/// Rays between two looks at whether to go on, about.
const BATCH_RAYS: usize = 1 << 13;

/// Values at the vertices of a mesh, in vertex order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Estimates {
    /// Ambient occlusion.
    pub values: Vec<f32>,
    /// The standard error of each, 0 where it is known, NaN where nobody asked for it.
    pub errors: Vec<f32>,
    /// Rays asked in all.
    pub rays: u64,
}

impl Estimates {
    /// The root mean square of the errors, of those values that were asked for.
    pub fn error(&self) -> f64 {
        let (mut squares, mut count) = (0.0, 0usize);
        for error in self.errors.iter().filter(|e| !e.is_nan()) {
            squares += f64::from(*error).powi(2);
            count += 1;
        }
        (squares / count.max(1) as f64).sqrt()
    }
}

/// Estimates A at one point: the share of cosine-weighted rays that escape, of `settings.samples`, or of as many as meet
/// the target. `number` tells points apart: each has its own rays. This is the slow way, ray by ray, which defines the
/// value.
pub fn estimate_at<const D: usize>(
    tracer: &Tracer<D>,
    site: &Site<D>,
    settings: &Settings,
    target: Option<Target>,
    number: u64,
) -> Estimate {
    if site.normal.amax() == 0.0 {
        return Estimate::known(1.0);
    }
    let frame = site.frame();
    let mut sequence = Sequence::new(settings.sampler, settings.seed, number);
    let mut tally = Tally::new(settings.sampler);
    while tally.rays() < settings.samples && !target.is_some_and(|target| target.is_met(&tally)) {
        let visible = site.is_visible(tracer, sequence.next_direction(&frame), settings.max_distance);
        tally.add(u64::from(visible), 1);
    }
    tally.estimate()
}

/// The value alone, of all rays.
pub fn ambient_occlusion<const D: usize>(tracer: &Tracer<D>, site: &Site<D>, settings: &Settings, number: u64) -> f32 {
    estimate_at(tracer, site, settings, None, number).value
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
    Ok(estimate_vertices(level, tracer, settings, None, progress)?.values)
}

/// [`at_vertices_with`] with errors, and until a target is met if there is one; at most `settings.samples` rays a vertex.
///
/// # Errors
/// [`Cancelled`] if `progress` says so.
///
/// # Panics
/// If this processor lacks the instructions.
pub fn estimate_vertices<const D: usize>(
    level: Level,
    tracer: &Tracer<D>,
    settings: &Settings,
    target: Option<Target>,
    progress: &dyn Progress,
) -> Result<Estimates, Cancelled> {
    estimate_wanted(level, tracer, settings, target, None, progress)
}

/// [`estimate_vertices`] at those that are wanted, or at all.
pub(super) fn estimate_wanted<const D: usize>(
    level: Level,
    tracer: &Tracer<D>,
    settings: &Settings,
    target: Option<Target>,
    wanted: Option<&[bool]>,
    progress: &dyn Progress,
) -> Result<Estimates, Cancelled> {
    let incidence = Incidence::new(tracer.mesh());
    let usual = target.map_or(settings.samples, |_| Target::FEWEST.min(settings.samples));
    let batch = (BATCH_RAYS / usual.max(1) as usize).clamp(1, 64);
    let estimate =
        |stream: &mut Stream<D>, vertex| stream.estimate_at_vertex(tracer, &incidence, settings, target, vertex);
    everywhere(tracer, batch, wanted, progress, || Stream::new(level), estimate)
}

/// Asks for every vertex that is wanted, or for all, on all cores, a batch at a time.
pub(super) fn everywhere<const D: usize, S>(
    tracer: &Tracer<D>,
    batch: usize,
    wanted: Option<&[bool]>,
    progress: &dyn Progress,
    memory: impl Fn() -> S + Sync + Send,
    estimate: impl Fn(&mut S, u32) -> Estimate + Sync + Send,
) -> Result<Estimates, Cancelled> {
    tracer.prepare_wide();
    let mut order = spatial_order(tracer);
    let count = order.len();
    if let Some(wanted) = wanted {
        order.retain(|&vertex| wanted[vertex as usize]);
    }
    let batches = order.par_chunks(batch).with_min_len(8).map_init(memory, |memory, vertices| {
        if progress.cancelled() {
            return Err(Cancelled);
        }
        let found: Vec<Estimate> = vertices.iter().map(|&vertex| estimate(memory, vertex)).collect();
        progress.advance(found.len() as u64);
        Ok(found)
    });
    let found: Vec<Vec<Estimate>> = batches.collect::<Result<_, _>>()?;
    let mut estimates = Estimates { values: vec![1.0; count], errors: vec![f32::NAN; count], rays: 0 };
    for (&vertex, estimate) in order.iter().zip(found.into_iter().flatten()) {
        estimates.values[vertex as usize] = estimate.value;
        estimates.errors[vertex as usize] = estimate.error;
        estimates.rays += u64::from(estimate.rays);
    }
    Ok(estimates)
}

/// All vertices, those that are close in the hierarchy close to each other: then the nodes that one of them needs are
/// still in the cache for the next.
pub(super) fn spatial_order<const D: usize>(tracer: &Tracer<D>) -> Vec<u32> {
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
