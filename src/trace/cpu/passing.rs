//! Ambient occlusion among objects that let light through, by packets: they tell which rays hit nothing at all, and the others are
//! looked at ray by ray ([`translucent`](crate::trace::translucent)).

use rayon::prelude::*;

use super::PacketTracer;
use crate::accel::Tracer;
use crate::geometry::Dimension;
use crate::progress::{Cancelled, Progress};
use crate::trace::estimate::Estimate;
use crate::trace::shares::Shares;
use crate::trace::translucent::{Rays, estimate_at};
use crate::trace::{Sampling, ShadingPoint};

/// Points that a thread takes at a time.
const BATCH: usize = 16;

/// The values at points, in their order.
pub(super) fn open_fractions<const D: usize>(
    tracer: &Tracer<D>,
    points: &[ShadingPoint<D>],
    sampling: &Sampling,
    progress: &dyn Progress,
) -> Result<Vec<Estimate>, Cancelled> {
    tracer.prepare();
    tracer.prepare_wide();
    // What takes nothing is hit by packets all the same, and counts at vertices for the ways they are approached.
    let has_nothing = tracer.mesh().objects.iter().any(|object| object.opacity <= 0.0);
    let found = points.par_chunks(BATCH).map_init(PacketTracer::default, |packets, points| {
        let estimate = |point| {
            let found = match has_nothing || sampling.target.is_some() {
                true => estimate_at(tracer, point, sampling, progress)?,
                false => estimate_by(packets, tracer, point, sampling, progress)?,
            };
            progress.advance(1);
            Ok(found)
        };
        points.iter().map(estimate).collect::<Result<Vec<_>, Cancelled>>()
    });
    Ok(found.collect::<Result<Vec<_>, Cancelled>>()?.concat())
}

/// The value at one point, of as many rays as the sampling says: [`estimate_at`]'s, bit for bit.
fn estimate_by<const D: usize>(
    packets: &mut PacketTracer<D>,
    tracer: &Tracer<D>,
    point: &ShadingPoint<D>,
    sampling: &Sampling,
    progress: &dyn Progress,
) -> Result<Estimate, Cancelled> {
    let rays = Rays::of(tracer, point, sampling);
    if rays.normal.amax() == 0.0 {
        return Ok(Estimate::known(1.0));
    }
    let mut shares = Shares::new(sampling.sampler, Dimension::of::<D>());
    let mut watch = |direction, is_open| shares.add(if is_open { 1.0 } else { rays.share(direction) });
    packets.watched(tracer, point, sampling, &mut watch, progress)?;
    Ok(shares.estimate())
}
