//! Shading points on a device.

use std::sync::PoisonError;
use std::sync::atomic::Ordering;
use std::time::Instant;

use rayon::prelude::*;

use super::backend::OpenClBackend;
use super::bits::Bits;
use super::device::Argument;
use super::layout::{self, Float4, StarCone};
use super::program::SET;
use super::scene::{MOST_RAYS, OnDevice, Part, float4, is_exact, sampled_point};
use crate::geometry::{Cone, Dimension, Frame, Vector, widen};
use crate::progress::{Cancelled, Progress};
use crate::trace::backend::{Error, NOTHING};
use crate::trace::estimate::{Accumulator, Estimate};
use crate::trace::point::ShadingPoint;
use crate::trace::sampling::{Sampler, Sampling, Sequence, Target};
use crate::trace::surroundings::{Star, Surroundings};

/// The most points that are prepared together,
const POINTS: usize = 1 << 16;
/// and the most vertices, each of which has dozens of cones in 4D.
const VERTICES: usize = 1 << 14;
/// Rays that are worth a launch of their own.
const FEW_RAYS: usize = 1 << 19;

/// Points that one thread prepares at a time.
const BLOCK: usize = 512;

/// A point with what its rays need.
struct Prepared {
    /// As the device knows it, but for the next ray.
    point: layout::Point,
    /// Whether the device can be asked.
    serves: bool,
}

/// [`BLOCK`] points.
struct Block {
    points: Vec<Prepared>,
    /// Where their cones begin on the device.
    star_first: u32,
}

/// Points that are worked on together.
struct Chunk<'a, const D: usize> {
    points: &'a [ShadingPoint<D>],
    blocks: Vec<Block>,
    sampling: &'a Sampling,
    /// Whether directions are made here and handed over.
    given: bool,
}

impl<const D: usize> Chunk<'_, D> {
    /// A point as the device knows it, with its next ray.
    fn point(&self, r: &Running) -> layout::Point {
        let block = &self.blocks[r.index / BLOCK];
        let point = block.points[r.index % BLOCK].point;
        layout::Point { next: r.sequence.next, star_first: point.star_first + block.star_first, ..point }
    }

    fn serves(&self, r: &Running) -> bool {
        self.blocks[r.index / BLOCK].points[r.index % BLOCK].serves
    }
}

/// How far a point's rays have come.
struct Running {
    /// The point's place in its chunk.
    index: usize,
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
            let chunk = Chunk { points: jobs[i], blocks, sampling, given };
            self.estimate_chunk(on, &mut on_device, &chunk, progress)
        };
        Ok(scene.share(jobs.len(), job)?.concat())
    }

    /// Brings what simplices around the points hide to the device.
    fn prepare(
        &self,
        on: &Part,
        on_device: &mut OnDevice,
        points: &[ShadingPoint<D>],
        sampling: &Sampling,
        serves: bool,
    ) -> Result<Vec<Block>, Error> {
        let block = |points: &[ShadingPoint<D>]| {
            let mut star = Vec::new();
            let prepared = |point| self.prepared(point, sampling, serves, &mut star);
            (Block { points: points.iter().map(prepared).collect(), star_first: 0 }, star)
        };
        let (mut blocks, stars): (Vec<Block>, Vec<Vec<StarCone>>) = points.par_chunks(BLOCK).map(block).unzip();
        let cones = stars.iter().map(Vec::len).sum();
        let memory = on.device.room_for_input(&mut on_device.room.star, cones, "cones around points")?;
        let mut first = 0;
        for (block, star) in blocks.iter_mut().zip(&stars) {
            on.device.write(memory, first, star)?;
            block.star_first = first as u32;
            first += star.len();
        }
        Ok(blocks)
    }

    /// A point, and after the cones of others those that its star hides.
    fn prepared(
        &self,
        point: &ShadingPoint<D>,
        sampling: &Sampling,
        serves: bool,
        star: &mut Vec<StarCone>,
    ) -> Prepared {
        let mesh = self.tracer.mesh();
        let position = point.position(mesh);
        let ignored = point.ignored(&self.tracer);
        let first = star.len();
        let Star { cones, straight } = Star::of(&self.tracer, point);
        star.extend(cones.iter().filter_map(|(_, cone)| star_cone(cone)));
        let normal = point.normal(mesh);
        let heights = cones.iter().map(|(_, cone)| if straight { height(cone, &normal) } else { 2.0 });
        let sequence = Sequence::new(sampling.sampler, sampling.seed, point.number());
        Prepared {
            point: layout::Point {
                position: float4(&self.scale.scaled(&position)),
                ignored: ignored.first().copied().unwrap_or(NOTHING),
                star_first: first as u32,
                star_count: (star.len() - first) as u32,
                star_height: heights.fold(-2.0, f32::max),
                vertex: match point {
                    ShadingPoint::Vertex(vertex) => mesh.identity[*vertex as usize],
                    ShadingPoint::Inside { .. } => NOTHING,
                },
                ..sampled_point(&Frame::new(&normal), &sequence)
            },
            // The kernel knows of one simplex that is ignored.
            serves: serves && ignored.len() <= 1 && is_exact(&self.scale, &position),
        }
    }

    /// All points of a chunk: those that need more rays go on together, each with as many as the others.
    fn estimate_chunk(
        &self,
        on: &Part,
        on_device: &mut OnDevice,
        chunk: &Chunk<D>,
        progress: &dyn Progress,
    ) -> Result<Vec<Estimate>, Error> {
        let (sampling, mesh) = (chunk.sampling, self.tracer.mesh());
        let run = |&index: &usize| Running {
            index,
            sequence: Sequence::new(sampling.sampler, sampling.seed, chunk.points[index].number()),
            accumulator: Accumulator::new(sampling.sampler, Dimension::of::<D>()),
        };
        // Without a normal there is nothing to ask.
        let asked = |&index: &usize| chunk.points[index].normal(mesh).amax() > 0.0;
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

    /// Which of the next `piece` rays of each point of a part are open.
    fn launch(
        &self,
        on: &Part,
        on_device: &mut OnDevice,
        chunk: &Chunk<D>,
        part: &mut [Running],
        piece: u32,
    ) -> Result<Bits, Error> {
        let (size, device, mesh) = (piece as usize, &on.device, self.tracer.mesh());
        let total = part.len() * size;
        let points: Vec<layout::Point> = part.par_iter().with_min_len(BLOCK).map(|r| chunk.point(r)).collect();
        let next = |r: &mut Running| {
            if !chunk.given {
                r.sequence.next = r.sequence.next.wrapping_add(piece);
                return Vec::new();
            }
            let frame = Frame::new(&chunk.points[r.index].normal(mesh));
            (0..piece).map(|_| r.sequence.next_direction::<D>(&frame)).collect()
        };
        let directions: Vec<Vector<D>> = part.par_iter_mut().with_min_len(BLOCK).flat_map_iter(next).collect();
        let given: Vec<Float4> = directions.par_iter().map(float4).collect();
        let room = &mut on_device.room;
        let on_points = device.filled(&mut room.points, &points, "points")?;
        let star = device.room_for_input(&mut room.star, 0, "cones around points")?;
        let given = device.filled(&mut room.directions, &given, "rays")?;
        let found = device.room(&mut room.found, total, "results")?;
        let (mut is_open, mut is_unsure) = (Bits::new(total), Bits::new(total));
        let words = is_open.0.len();
        let open = device.room(&mut room.open, words, "results")?;
        let unsure = device.room(&mut room.unsure, words, "results")?;
        let rays = || {
            let mut arguments = on_device.mesh.arguments();
            arguments.extend([
                on_points.argument(),
                star.argument(),
                on_device.mesh.matrices.argument(),
                given.argument(),
                Argument::U32(u32::from(chunk.given)),
                Argument::U32(piece),
                Argument::F32((f64::from(chunk.sampling.max_distance) * self.scale.factor) as f32),
            ]);
            arguments
        };
        let kernels = &on_device.kernels;
        let mut arguments = rays();
        let (kernel, items) = match &kernels.occluded_sets {
            Some(kernel) => (kernel, part.len() * size.div_ceil(SET)),
            None => (&kernels.occluded, total),
        };
        arguments.extend([Argument::U64(items as u64), found.argument()]);
        device.launch(kernel, &arguments, items)?;
        let arguments = [found.argument(), Argument::U64(total as u64), open.argument(), unsure.argument()];
        device.launch(&kernels.packed, &arguments, words)?;
        device.read(open, &mut is_open.0)?;
        device.read(unsure, &mut is_unsure.0)?;
        let mut left: Vec<u32> = is_unsure.places().map(|place| place as u32).collect();
        if device.info.double && !left.is_empty() {
            let again = device.filled(&mut room.again, &left, "rays")?;
            let mut arguments = rays();
            arguments.extend([again.argument(), Argument::U64(left.len() as u64), found.argument()]);
            device.launch(&kernels.occluded_again, &arguments, left.len())?;
            let mut becomes = vec![layout::OPEN; left.len()];
            device.read(found, &mut becomes)?;
            for (&place, &found) in left.iter().zip(&becomes) {
                is_open.set(place as usize, found == layout::OPEN);
            }
            let mut becomes = becomes.iter();
            left.retain(|_| becomes.next() == Some(&layout::UNSURE));
        }
        // What the device must not be asked.
        for (k, _) in part.iter().enumerate().filter(|(_, r)| !chunk.serves(r)) {
            left.extend((k * size..(k + 1) * size).map(|place| place as u32));
        }
        left.sort_unstable();
        left.dedup();
        let of_points: Vec<&[u32]> = left.chunk_by(|&a, &b| a as usize / size == b as usize / size).collect();
        let settle = |&places: &&[u32]| {
            let k = places[0] as usize / size;
            let rays = places.iter().map(|&place| place - (k * size) as u32);
            let given = directions.get(k * size..(k + 1) * size);
            let visible = self.settle(chunk, part[k].index, points[k].next, given, rays);
            places.iter().copied().zip(visible).collect::<Vec<_>>()
        };
        for (place, visible) in of_points.par_iter().flat_map_iter(settle).collect::<Vec<_>>() {
            is_open.set(place as usize, visible);
        }
        self.settled.fetch_add(left.len() as u64, Ordering::Relaxed);
        Ok(is_open)
    }

    /// Decides exactly which of some rays of a point are open: those with these numbers among the ones that were `given`, or
    /// else in its sequence from `next` on.
    fn settle(
        &self,
        chunk: &Chunk<D>,
        index: usize,
        next: u32,
        given: Option<&[Vector<D>]>,
        rays: impl Iterator<Item = u32>,
    ) -> Vec<bool> {
        let (point, sampling) = (&chunk.points[index], chunk.sampling);
        let around = Surroundings::of(&self.tracer, point);
        let frame = around.frame();
        let direction = |ray: u32| {
            if let Some(given) = given {
                return given[ray as usize];
            }
            let mut sequence = Sequence::new(sampling.sampler, sampling.seed, point.number());
            sequence.next = next.wrapping_add(ray);
            sequence.next_direction(&frame)
        };
        rays.map(|ray| around.is_visible(&self.tracer, direction(ray), sampling.max_distance)).collect()
    }
}

/// How high above the tangent hyperplane of a vertex with this normal the directions of a cone go that a simplex hides of it, or
/// higher, if the vertex is approached along the normal: the sine of the angle between the hyperplane and that of
/// the simplex (why is told in `cpu/packet/star.rs`).
fn height<const D: usize>(cone: &Cone<D>, normal: &Vector<D>) -> f32 {
    let (own, bound) = cone.facet(D - 1);
    let normal = widen(normal);
    let product = own.dot(&normal).abs() - bound * normal.iter().map(|x| x.abs()).sum::<f64>();
    let cosine = (product.max(0.0) / (own.norm() + 2.0 * bound)).min(1.0) * (1.0 - 1e-6);
    // Directions are as long as rounding makes them.
    ((1.0 - cosine * cosine).sqrt() + 1e-5) as f32
}

/// A cone for the device; none if it is flat, and holds no direction.
fn star_cone<const D: usize>(cone: &Cone<D>) -> Option<StarCone> {
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
