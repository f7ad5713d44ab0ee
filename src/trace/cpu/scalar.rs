//! The slow twin: one ray after another through the binary hierarchy, without SIMD. It defines the values of all others.

use std::sync::Arc;

use rayon::prelude::*;

use crate::accel::Tracer;
use crate::geometry::{Dimension, Ray};
use crate::progress::{Cancelled, Progress};
use crate::trace::estimate::{Accumulator, Estimate, Watch};
use crate::trace::{Error, NOTHING, RayBackend, Sampling, Sequence, ShadingPoint, Surroundings, translucent};

/// Rays between two looks at whether to go on: some milliseconds, in very large scenes a tenth of a second.
pub(super) const RAYS_BETWEEN_LOOKS: u32 = 1 << 10;

/// Estimates A at one point: the share of cosine-weighted rays that escape, of `sampling.samples`, or of as many as meet
/// the target.
///
/// # Errors
/// [`Cancelled`] if `progress` says so.
pub fn estimate_at<const D: usize>(
    tracer: &Tracer<D>,
    point: &ShadingPoint<D>,
    sampling: &Sampling,
    progress: &dyn Progress,
) -> Result<Estimate, Cancelled> {
    if tracer.mesh().is_translucent() {
        return translucent::estimate_at(tracer, point, sampling, progress);
    }
    watched_at(tracer, point, sampling, None, progress)
}

/// The same of opaque objects, and tells each ray to `watch`: where it goes, and whether it escapes.
pub(super) fn watched_at<const D: usize>(
    tracer: &Tracer<D>,
    point: &ShadingPoint<D>,
    sampling: &Sampling,
    mut watch: Option<&mut Watch<D>>,
    progress: &dyn Progress,
) -> Result<Estimate, Cancelled> {
    let surroundings = Surroundings::of(tracer, point);
    if surroundings.normal.amax() == 0.0 {
        return Ok(Estimate::known(1.0));
    }
    let frame = surroundings.frame();
    let mut sequence = Sequence::new(sampling.sampler, sampling.seed, point.number());
    let mut accumulator = Accumulator::new(sampling.sampler, Dimension::of::<D>());
    while accumulator.rays() < sampling.samples && !sampling.target.is_some_and(|target| target.is_met(&accumulator)) {
        if accumulator.rays().is_multiple_of(RAYS_BETWEEN_LOOKS) && progress.cancelled() {
            return Err(Cancelled);
        }
        let direction = sequence.next_direction(&frame);
        let visible = surroundings.is_visible(tracer, direction, sampling.max_distance);
        if let Some(watch) = &mut watch {
            watch(direction, visible);
        }
        accumulator.add(u64::from(visible), 1);
    }
    Ok(accumulator.estimate())
}

/// The slow twin as a backend: for comparisons, and to look things up in.
#[derive(Clone, Debug)]
pub struct ScalarBackend<const D: usize> {
    tracer: Arc<Tracer<D>>,
}

impl<const D: usize> ScalarBackend<D> {
    /// For rays through this mesh.
    pub fn new(tracer: impl Into<Arc<Tracer<D>>>) -> Self {
        Self { tracer: tracer.into() }
    }
}

impl<const D: usize> RayBackend<D> for ScalarBackend<D> {
    fn tracer(&self) -> &Arc<Tracer<D>> {
        &self.tracer
    }

    fn prepare(&self) -> Result<(), Error> {
        self.tracer.prepare();
        Ok(())
    }

    fn first_hits(&self, rays: &[Ray<D>], after: Option<&[u32]>, progress: &dyn Progress) -> Result<Vec<u32>, Error> {
        Ok(first_hits(&self.tracer, rays, after, progress)?)
    }

    fn open_fractions(
        &self,
        points: &[ShadingPoint<D>],
        sampling: &Sampling,
        progress: &dyn Progress,
    ) -> Result<Vec<Estimate>, Error> {
        self.tracer.prepare();
        let estimate = |point| {
            let found = estimate_at(&self.tracer, point, sampling, progress)?;
            progress.advance(1);
            Ok(found)
        };
        points.par_iter().map(estimate).collect()
    }
}

/// First hits on all threads. A first hit is sought ray by ray in either CPU backend.
pub(super) fn first_hits<const D: usize>(
    tracer: &Tracer<D>,
    rays: &[Ray<D>],
    after: Option<&[u32]>,
    progress: &dyn Progress,
) -> Result<Vec<u32>, Cancelled> {
    assert!(after.is_none_or(|after| after.len() == rays.len()), "one bound a ray");
    tracer.prepare();
    let mut found = vec![NOTHING; rays.len()];
    let size = RAYS_BETWEEN_LOOKS as usize / 4;
    found.par_chunks_mut(size).enumerate().try_for_each(|(n, found)| {
        if progress.cancelled() {
            return Err(Cancelled);
        }
        for (i, found) in found.iter_mut().enumerate() {
            let i = n * size + i;
            *found = first_hit(tracer, &rays[i], after.map_or(NOTHING, |after| after[i]));
        }
        Ok(())
    })?;
    Ok(found)
}

/// The first hit of one ray, behind its hit of `after` unless that is [`NOTHING`].
#[inline]
pub(in crate::trace) fn first_hit<const D: usize>(tracer: &Tracer<D>, ray: &Ray<D>, after: u32) -> u32 {
    let hit = if after == NOTHING { tracer.closest_hit(ray) } else { tracer.next_hit(ray, after) };
    hit.map_or(NOTHING, |hit| hit.simplex)
}
