//! Shading points on a device.

use std::sync::PoisonError;
use std::time::Instant;

use rayon::prelude::*;

use super::backend::OpenClBackend;
use super::layout;
use super::scene::{MOST_RAYS, OnDevice, Part};
use super::stars::{BLOCK, Block};
use crate::geometry::{Dimension, Vector};
use crate::mesh::Mesh;
use crate::progress::{Cancelled, Progress};
use crate::trace::backend::Error;
use crate::trace::estimate::{Accumulator, Estimate};
use crate::trace::point::ShadingPoint;
use crate::trace::sampling::{Sampler, Sampling, Sequence, Target};

/// The most points that are prepared together,
const POINTS: usize = 1 << 16;
/// and the most vertices, each of which has dozens of cones in 4D.
const VERTICES: usize = 1 << 14;
/// Rays that are worth a launch of their own.
const FEW_RAYS: usize = 1 << 19;

/// Points that are worked on together.
pub(super) struct Chunk<'a, const D: usize> {
    pub points: &'a [ShadingPoint<D>],
    blocks: Vec<Block>,
    mesh: &'a Mesh<D>,
    pub sampling: &'a Sampling,
    /// Whether directions are made here and handed over.
    pub given: bool,
    /// Whether the device can be asked about every point.
    pub all_serve: bool,
}

impl<const D: usize> Chunk<'_, D> {
    /// A point as the device knows it, with its next ray.
    pub fn point(&self, r: &Running) -> layout::Point {
        layout::Point { next: r.sequence.next, ..self.blocks[r.index / BLOCK].point(r.index % BLOCK) }
    }

    /// Whether the device can be asked about it.
    pub fn serves(&self, r: &Running) -> bool {
        self.blocks[r.index / BLOCK].points[r.index % BLOCK].serves
    }

    pub fn normal(&self, r: &Running) -> Vector<D> {
        self.points[r.index].normal(self.mesh)
    }
}

/// How far a point's rays have come.
pub(super) struct Running {
    /// The point's place in its chunk.
    pub index: usize,
    pub sequence: Sequence,
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
        // All parts get some, and launches are neither small nor larger than one may be.
        let share = points.len().div_ceil(4 * scene.parts.len());
        let most = if matches!(points.first(), Some(ShadingPoint::Vertex(_))) { VERTICES } else { POINTS };
        let [few, many] = [FEW_RAYS, MOST_RAYS].map(|rays| (rays / sampling.samples as usize).clamp(1, most));
        let size = if scene.parts.len() == 1 { many } else { share.clamp(few, many) };
        let jobs: Vec<&[ShadingPoint<D>]> = points.chunks(size).collect();
        let job = |on: &Part, i: usize| {
            let mut on_device = on.on_device.lock().unwrap_or_else(PoisonError::into_inner);
            let given = sampling.sampler == Sampler::Random || !on.makes_directions;
            let blocks = self.prepare(on, &mut on_device, jobs[i], sampling, scene.serves)?;
            let all_serve = blocks.iter().flat_map(|block| &block.points).all(|point| point.serves);
            let chunk = Chunk { points: jobs[i], blocks, mesh: self.tracer.mesh(), sampling, given, all_serve };
            self.estimate_chunk(on, &mut on_device, &chunk, progress)
        };
        Ok(scene.share(jobs.len(), job)?.concat())
    }

    /// All points of a chunk: those that need more rays go on together, each with as many as the others.
    fn estimate_chunk(
        &self,
        on: &Part,
        on_device: &mut OnDevice,
        chunk: &Chunk<D>,
        progress: &dyn Progress,
    ) -> Result<Vec<Estimate>, Error> {
        let sampling = chunk.sampling;
        let run = |&index: &usize| Running {
            index,
            sequence: Sequence::new(sampling.sampler, sampling.seed, chunk.points[index].number()),
            accumulator: Accumulator::new(sampling.sampler, Dimension::of::<D>()),
        };
        // Without a normal there is nothing to ask.
        let asked = |&index: &usize| chunk.points[index].normal(chunk.mesh).amax() > 0.0;
        let asked: Vec<usize> = (0..chunk.points.len()).filter(asked).collect();
        let mut running: Vec<Running> = asked.par_iter().map(run).collect();
        let mut estimates = vec![Estimate::known(1.0); chunk.points.len()];
        progress.advance((estimates.len() - running.len()) as u64);
        let mut done = 0;
        while !running.is_empty() {
            let step =
                sampling.target.map_or(sampling.samples, |_| done.max(Target::FEWEST)).min(sampling.samples - done);
            self.trace(on, on_device, chunk, step, &mut running, progress)?;
            done += step;
            let is_done = |r: &Running| sampling.target.is_none_or(|target| target.is_met(&r.accumulator));
            let (finished, more): (Vec<Running>, Vec<Running>) = if done == sampling.samples {
                (running, Vec::new())
            } else {
                running.into_par_iter().partition(is_done)
            };
            let found: Vec<Estimate> = finished.par_iter().map(|r| r.accumulator.estimate()).collect();
            finished.iter().zip(found).for_each(|(r, estimate)| estimates[r.index] = estimate);
            progress.advance(finished.len() as u64);
            running = more;
        }
        Ok(estimates)
    }

    /// Traces so many more rays of the points, a launch at a time.
    fn trace(
        &self,
        on: &Part,
        on_device: &mut OnDevice,
        chunk: &Chunk<D>,
        rays: u32,
        running: &mut [Running],
        progress: &dyn Progress,
    ) -> Result<(), Error> {
        let mut traced = 0;
        while traced < rays {
            // Many rays of a point go piece by piece, in multiples of 64 but for the last.
            let piece = (rays - traced).min(MOST_RAYS as u32 / 4);
            let size = piece as usize;
            let mut left = &mut *running;
            while !left.is_empty() {
                if progress.cancelled() {
                    return Err(Cancelled.into());
                }
                let count = (on_device.rays / size).clamp(1, left.len());
                let (part, others) = left.split_at_mut(count);
                let start = Instant::now();
                let open = self.launch(on, on_device, chunk, part, piece)?;
                on_device.learn(count * size, start.elapsed().as_secs_f64());
                part.par_iter_mut().with_min_len(BLOCK).enumerate().for_each(|(k, running)| {
                    for first in (0..size).step_by(64) {
                        let count = (size - first).min(64);
                        running.accumulator.add(open.from(k * size + first, count), count as u32);
                    }
                });
                left = others;
            }
            traced += piece;
        }
        Ok(())
    }
}
