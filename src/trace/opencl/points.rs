//! Shading points on a device.

use std::sync::PoisonError;
use std::sync::atomic::Ordering;
use std::time::Instant;

use rayon::prelude::*;

use super::backend::{MOST_RAYS, OnDevice, OpenClBackend, Part, float4, is_exact, sampled_point};
use super::device::Argument;
use super::layout::{self, Float4, StarCone};
use crate::geometry::{Cone, Dimension, Frame, Vector};
use crate::progress::{Cancelled, Progress};
use crate::trace::backend::{Error, NOTHING};
use crate::trace::estimate::{Accumulator, Estimate};
use crate::trace::point::ShadingPoint;
use crate::trace::sampling::{Sampler, Sampling, Sequence, Target};
use crate::trace::surroundings::{Surroundings, star_cones};

/// Points that are prepared together.
const POINTS: usize = 1 << 14;

/// A point with what its rays need.
struct Prepared<const D: usize> {
    position: Vector<D>,
    frame: Frame<D>,
    number: u64,
    ignored: u32,
    /// Whether the device can be asked.
    serves: bool,
    star: Vec<StarCone>,
}

/// Points that are worked on together.
struct Chunk<'a, const D: usize> {
    points: &'a [ShadingPoint<D>],
    prepared: Vec<Prepared<D>>,
    sampling: &'a Sampling,
    /// Whether directions are made here and handed over.
    given: bool,
}

/// How far a point's rays have come.
struct Running {
    sequence: Sequence,
    accumulator: Accumulator,
}

impl<const D: usize> OpenClBackend<D> {
    /// Estimates A at points, in their order, as [`crate::trace::cpu::estimate_at`] does.
    pub(super) fn estimate(
        &self,
        points: &[ShadingPoint<D>],
        sampling: &Sampling,
        progress: &dyn Progress,
    ) -> Result<Vec<Estimate>, Error> {
        let scene = self.scene()?;
        let devices = scene.parts.len();
        let size = POINTS.min(points.len().div_ceil(if devices == 1 { 1 } else { 4 * devices }));
        let jobs: Vec<&[ShadingPoint<D>]> = points.chunks(size.max(1)).collect();
        let job = |on: &Part, i: usize| {
            let prepared = jobs[i].par_iter().map(|point| self.prepared(point, scene.serves)).collect();
            let given = sampling.sampler == Sampler::Random || !on.makes_directions;
            let chunk = Chunk { points: jobs[i], prepared, sampling, given };
            self.estimate_chunk(on, &chunk, progress)
        };
        Ok(scene.share(jobs.len(), job)?.concat())
    }

    fn prepared(&self, point: &ShadingPoint<D>, serves: bool) -> Prepared<D> {
        let mesh = self.tracer.mesh();
        let position = point.position(mesh);
        let ignored = point.ignored(&self.tracer);
        Prepared {
            position,
            frame: Frame::new(&point.normal(mesh)),
            number: point.number(),
            ignored: ignored.first().copied().unwrap_or(NOTHING),
            // The kernel knows of one.
            serves: serves && ignored.len() <= 1 && is_exact(&self.scale, &position),
            star: star_cones(&self.tracer, point).into_iter().filter_map(|(_, cone)| star_cone(cone)).collect(),
        }
    }

    /// All points of a chunk: those that need more rays go on together, each with as many as the others.
    fn estimate_chunk(&self, on: &Part, chunk: &Chunk<D>, progress: &dyn Progress) -> Result<Vec<Estimate>, Error> {
        let sampling = chunk.sampling;
        let run = |p: &Prepared<D>| Running {
            sequence: Sequence::new(sampling.sampler, sampling.seed, p.number),
            accumulator: Accumulator::new(sampling.sampler, Dimension::of::<D>()),
        };
        let mut running: Vec<Running> = chunk.prepared.par_iter().map(run).collect();
        // Without a normal there is nothing to ask.
        let open: Vec<bool> = chunk.points.iter().map(|p| p.normal(self.tracer.mesh()).amax() == 0.0).collect();
        let mut active: Vec<usize> = (0..open.len()).filter(|&i| !open[i]).collect();
        progress.advance((open.len() - active.len()) as u64);
        let mut done = 0;
        while !active.is_empty() {
            let step =
                sampling.target.map_or(sampling.samples, |_| done.max(Target::FEWEST)).min(sampling.samples - done);
            self.trace(on, chunk, &active, step, &mut running, progress)?;
            done += step;
            let before = active.len();
            let goes_on = |accumulator| {
                done < sampling.samples && sampling.target.is_none_or(|target| !target.is_met(accumulator))
            };
            active.retain(|&i| goes_on(&running[i].accumulator));
            progress.advance((before - active.len()) as u64);
        }
        let estimate = |(open, r): (bool, Running)| if open { Estimate::known(1.0) } else { r.accumulator.estimate() };
        Ok(open.into_iter().zip(running).map(estimate).collect())
    }

    /// Traces so many more rays of the active points, a launch at a time.
    fn trace(
        &self,
        on: &Part,
        chunk: &Chunk<D>,
        active: &[usize],
        rays: u32,
        running: &mut [Running],
        progress: &dyn Progress,
    ) -> Result<(), Error> {
        let mut on_device = on.on_device.lock().unwrap_or_else(PoisonError::into_inner);
        let mut traced = 0;
        while traced < rays {
            // Many rays of a point go piece by piece, in multiples of 64 but for the last.
            let piece = (rays - traced).min(MOST_RAYS as u32 / 4);
            let mut begin = 0;
            while begin < active.len() {
                if progress.cancelled() {
                    return Err(Cancelled.into());
                }
                let count = (on_device.rays / piece as usize).clamp(1, active.len() - begin);
                let part = &active[begin..begin + count];
                let start = Instant::now();
                let found = self.launch(on, &on_device, chunk, part, piece, running)?;
                on_device.learn(found.len(), start.elapsed().as_secs_f64());
                for (&i, found) in part.iter().zip(found.chunks(piece as usize)) {
                    for word in found.chunks(64) {
                        let open = word.iter().rev().fold(0u64, |bits, &f| bits << 1 | u64::from(f == layout::OPEN));
                        running[i].accumulator.add(open, word.len() as u32);
                    }
                }
                begin += count;
            }
            traced += piece;
        }
        Ok(())
    }

    /// What becomes of the next `piece` rays of each point of a part: open or hit, point after point.
    fn launch(
        &self,
        on: &Part,
        on_device: &OnDevice,
        chunk: &Chunk<D>,
        part: &[usize],
        piece: u32,
        running: &mut [Running],
    ) -> Result<Vec<u8>, Error> {
        let size = piece as usize;
        let total = part.len() * size;
        let mut points = Vec::with_capacity(part.len());
        let mut star = Vec::new();
        for &i in part {
            let point = &chunk.prepared[i];
            points.push(layout::Point {
                position: float4(&self.scale.scaled(&point.position)),
                ignored: point.ignored,
                star_first: star.len() as u32,
                star_count: point.star.len() as u32,
                ..sampled_point(&point.frame, &running[i].sequence)
            });
            star.extend_from_slice(&point.star);
        }
        let firsts: Vec<u32> = part.iter().map(|&i| running[i].sequence.next).collect();
        let mut directions = Vec::new();
        for &i in part {
            let sequence = &mut running[i].sequence;
            if chunk.given {
                directions.extend((0..piece).map(|_| sequence.next_direction::<D>(&chunk.prepared[i].frame)));
            } else {
                sequence.next = sequence.next.wrapping_add(piece);
            }
        }
        let given: Vec<Float4> = directions.iter().map(float4).collect();
        let (points, star) = (on.device.input(&points, "points")?, on.device.input(&star, "cones around points")?);
        let (given, out) = (on.device.input(&given, "rays")?, on.device.output::<u8>(total, "results")?);
        let mut arguments = on_device.mesh();
        arguments.extend([
            points.argument(),
            star.argument(),
            on_device.matrices.argument(),
            given.argument(),
            Argument::U32(u32::from(chunk.given)),
            Argument::U32(piece),
            Argument::U64(total as u64),
            Argument::F32((f64::from(chunk.sampling.max_distance) * self.scale.factor) as f32),
            out.argument(),
        ]);
        on.device.launch(&on_device.kernels.occluded, &arguments, total)?;
        let mut found = vec![layout::OPEN; total];
        on.device.read(&out, &mut found)?;
        found.par_chunks_mut(size).enumerate().for_each(|(k, found)| {
            let direction = |n: usize| {
                if chunk.given {
                    return directions[k * size + n];
                }
                let point = &chunk.prepared[part[k]];
                let mut sequence = Sequence::new(chunk.sampling.sampler, chunk.sampling.seed, point.number);
                sequence.next = firsts[k].wrapping_add(n as u32);
                sequence.next_direction(&point.frame)
            };
            self.settle(chunk, part[k], found, direction);
        });
        Ok(found)
    }

    /// Decides exactly what the device left open, of the rays of one point.
    fn settle(&self, chunk: &Chunk<D>, index: usize, found: &mut [u8], direction: impl Fn(usize) -> Vector<D>) {
        let (mut surroundings, mut settled) = (None, 0);
        for (n, found) in found.iter_mut().enumerate() {
            if chunk.prepared[index].serves && matches!(*found, layout::OPEN | layout::HIT) {
                continue;
            }
            let around = surroundings.get_or_insert_with(|| Surroundings::of(&self.tracer, &chunk.points[index]));
            settled += 1;
            let visible = around.is_visible(&self.tracer, direction(n), chunk.sampling.max_distance);
            *found = if visible { layout::OPEN } else { layout::HIT };
        }
        self.settled.fetch_add(settled, Ordering::Relaxed);
    }
}

/// A cone for the device; none if it is flat, and holds no direction.
fn star_cone<const D: usize>(cone: Cone<D>) -> Option<StarCone> {
    let sign = f64::from(cone.orientation());
    if sign == 0.0 {
        return None;
    }
    let mut found = StarCone::default();
    for i in 0..D {
        let (normal, bound) = cone.facet(i);
        let size = normal.amax();
        if size > 0.0 {
            found.normals[i] = float4(&normal.map(|x| (x * sign / size) as f32));
        }
        // The normal's rounding here, that of the product there, and what is too small for single precision.
        found.bounds.0[i] = if size > 0.0 { (bound / size) as f32 * 1.01 + 1e-6 } else { 1.0 };
    }
    Some(found)
}
