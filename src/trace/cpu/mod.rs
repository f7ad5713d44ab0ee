//! Rays on the processor, on all its cores.
//!
//! - [`CpuBackend`]: the packets of a [`PacketTracer`], eight lanes wide, with the best instructions there are;
//! - [`ScalarBackend`]: the slow twin, ray by ray, which defines the values; the packets give the same bits.

mod packet;
mod passing;
mod scalar;

pub use packet::{Level, PacketTracer, Visits};
pub use scalar::{ScalarBackend, estimate_at};

pub(super) use scalar::first_hit;

use std::sync::Arc;

use rayon::prelude::*;

use super::{Error, Estimate, RayBackend, Sampling, ShadingPoint, Target};
use crate::accel::Tracer;
use crate::geometry::Ray;
use crate::progress::Progress;

/// Rays between two reports of progress, about.
const BATCH_RAYS: usize = 1 << 13;

/// The processor's cores, with SIMD instructions.
#[derive(Clone, Debug)]
pub struct CpuBackend<const D: usize> {
    tracer: Arc<Tracer<D>>,
    level: Level,
}

impl<const D: usize> CpuBackend<D> {
    /// For rays through this mesh, with the best instructions that the processor has.
    pub fn new(tracer: impl Into<Arc<Tracer<D>>>) -> Self {
        Self { tracer: tracer.into(), level: Level::best() }
    }

    /// With the instructions of a level, for comparisons.
    ///
    /// # Panics
    /// If this processor lacks them.
    pub fn with_level(tracer: impl Into<Arc<Tracer<D>>>, level: Level) -> Self {
        assert!(Level::available().contains(&level), "this processor lacks {level:?}");
        Self { tracer: tracer.into(), level }
    }
}

impl<const D: usize> RayBackend<D> for CpuBackend<D> {
    fn tracer(&self) -> &Arc<Tracer<D>> {
        &self.tracer
    }

    fn prepare(&self) -> Result<(), Error> {
        self.tracer.prepare_wide();
        Ok(())
    }

    fn first_hits(&self, rays: &[Ray<D>], after: Option<&[u32]>, progress: &dyn Progress) -> Result<Vec<u32>, Error> {
        Ok(scalar::first_hits(&self.tracer, rays, after, progress)?)
    }

    fn open_fractions(
        &self,
        points: &[ShadingPoint<D>],
        sampling: &Sampling,
        progress: &dyn Progress,
    ) -> Result<Vec<Estimate>, Error> {
        if self.tracer.mesh().is_translucent() {
            return Ok(passing::open_fractions(&self.tracer, points, sampling, progress)?);
        }
        self.tracer.prepare_wide();
        let usual = sampling.target.map_or(sampling.samples, |_| Target::FEWEST.min(sampling.samples));
        let batch = (BATCH_RAYS / usual.max(1) as usize).clamp(1, 64);
        // A packet tracer is 0.2 MB, so one serves several batches; but no thread is to wait for another's many.
        let batches = points.len().div_ceil(batch);
        let together = (batches / (8 * rayon::current_num_threads())).clamp(1, 8);
        let found = points.par_chunks(batch).with_min_len(together).map_init(
            || PacketTracer::new(self.level),
            |packets, points| {
                let estimate = |point| packets.estimate(&self.tracer, point, sampling, progress);
                let found: Vec<Estimate> = points.iter().map(estimate).collect::<Result<_, _>>()?;
                progress.advance(found.len() as u64);
                Ok(found)
            },
        );
        Ok(found.collect::<Result<Vec<_>, Error>>()?.concat())
    }
}
