//! More rays where few and their neighbours are not enough.
//!
//! A voxel whose standard error is above the tolerance by half gets as many more rays as bring it down to the tolerance,
//! as far as their noise can be told beforehand ([`Sampling::expected_variance`]); the two values count by the inverse of
//! their variances. So rays go where occlusion jumps or ripples, and a picture of flat bodies pays for nothing else.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::geometry::Dimension;
use crate::occlusion::{Error, Estimator};
use crate::progress::{Progress, Uncounted};
use crate::render::filters::ImageFilter;
use crate::render::gbuffer::{Columns, GBuffer};
use crate::render::{NOTHING, occlude};
use crate::trace::{RayBackend, Sampling};

/// How far above the tolerance an error may be: below that, more rays gain little.
const SLACK: f64 = 1.5;
/// The fewest rays that are worth asking.
const FEWEST: u32 = 16;
/// Takes these rays from elsewhere than a voxel's first.
const OTHER_SEED: u64 = 0x9e37_79b9_7f4a_7c15;

/// The filter.
#[derive(Debug)]
pub struct Refine<const D: usize> {
    backend: Arc<dyn RayBackend<D>>,
    /// The rays at voxels; `samples` is the most that are added.
    sampling: Sampling,
    tolerance: f64,
}

impl<const D: usize> Refine<D> {
    /// Brings errors down to `tolerance`, by at most as many rays a voxel as `sampling` has.
    pub fn new(backend: Arc<dyn RayBackend<D>>, sampling: Sampling, tolerance: f64) -> Self {
        Self { backend, sampling: Sampling { seed: sampling.seed ^ OTHER_SEED, ..sampling }, tolerance }
    }

    /// How many rays bring a value with this error down to the tolerance; none if it is there.
    fn rays(&self, value: f64, error: f64) -> Option<u32> {
        if error <= SLACK * self.tolerance {
            return None;
        }
        let wanted = 1.0 / (self.tolerance.powi(-2) - error.powi(-2));
        let mut rays = FEWEST.min(self.sampling.samples);
        while rays < self.sampling.samples && self.variance(rays, value) > wanted {
            rays = (2 * rays).min(self.sampling.samples);
        }
        Some(rays)
    }

    fn variance(&self, rays: u32, value: f64) -> f64 {
        Sampling { samples: rays, ..self.sampling }.expected_variance(Dimension::of::<D>(), value)
    }
}

impl<const D: usize> ImageFilter<D> for Refine<D> {
    fn columns(&self) -> Columns {
        occlude::COLUMNS | Columns::OCCLUSION | Columns::ERROR
    }

    fn halo(&self) -> usize {
        0
    }

    fn apply(&self, _: &GBuffer<D>, out: &mut GBuffer<D>, progress: &dyn Progress) -> Result<(), Error> {
        let mut by_rays: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for n in (0..out.len()).filter(|&n| out.simplex[n] != NOTHING) {
            if let Some(rays) = self.rays(out.occlusion[n].into(), out.error[n].into()) {
                by_rays.entry(rays).or_default().push(n);
            }
        }
        for (rays, places) in by_rays {
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            let estimator = Estimator::Sampled(Sampling { samples: rays, ..self.sampling });
            // These points are no steps of their own: their voxels are counted already.
            let found = occlude::at(&*self.backend, estimator, out, &places, &Uncounted(progress))?;
            for (n, value) in places.into_iter().zip(found.values) {
                let (before, error) = (f64::from(out.occlusion[n]), f64::from(out.error[n]));
                let (old, new) = (error.powi(-2), 1.0 / self.variance(rays, before));
                let both = (before * old + f64::from(value) * new) / (old + new);
                out.occlusion[n] = both.clamp(0.0, 1.0) as f32;
                out.error[n] = (old + new).powf(-0.5) as f32;
            }
        }
        Ok(())
    }
}
