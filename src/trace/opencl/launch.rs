//! A batch of rays on a device, and what becomes of them.

use std::sync::atomic::Ordering;

use rayon::prelude::*;

use super::backend::OpenClBackend;
use super::bits::Bits;
use super::device::{Argument, Device, Kept, Kernels, Memory};
use super::error::Error;
use super::layout::{self, Float4, float4};
use super::order;
use super::points::{Chunk, Running};
use super::program::{SET, spread};
use super::scene::{MeshCopy, OnDevice, Part, Room};
use super::stars::BLOCK;
use crate::geometry::{Frame, Vector};
use crate::trace::sampling::Sequence;
use crate::trace::surroundings::Surroundings;

/// The next rays of some points, as many of each.
struct Batch<'a, const D: usize> {
    chunk: &'a Chunk<'a, D>,
    part: &'a [Running],
    /// The points, with their next rays.
    points: Vec<layout::Point>,
    /// The directions, if they are made here.
    directions: Vec<Vector<D>>,
    rays: u32,
    /// Beyond which hits don't count, in scaled coordinates.
    limit: f32,
}

impl<'a, const D: usize> Batch<'a, D> {
    /// Takes them from the points' sequences.
    fn take(chunk: &'a Chunk<'a, D>, part: &'a mut [Running], rays: u32, limit: f32) -> Self {
        let points = part.par_iter().with_min_len(BLOCK).map(|r| chunk.point(r)).collect();
        let next = |r: &mut Running| {
            if !chunk.given {
                r.sequence.next = r.sequence.next.wrapping_add(rays);
                return Vec::new();
            }
            let frame = Frame::new(&chunk.normal(r));
            (0..rays).map(|_| r.sequence.next_direction::<D>(&frame)).collect()
        };
        let directions = part.par_iter_mut().with_min_len(BLOCK).flat_map_iter(next).collect();
        Self { chunk, part, points, directions, rays, limit }
    }

    fn all_rays(&self) -> usize {
        self.points.len() * self.rays as usize
    }

    /// The place of the point that a ray belongs to.
    fn of(&self, ray: u32) -> usize {
        (ray / self.rays) as usize
    }
}

/// Memory that the kernels share while they trace a batch.
struct Tracing<'a> {
    device: &'a Device,
    kernels: &'a Kernels,
    mesh: &'a MeshCopy,
    points: &'a Memory<layout::Point>,
    star: &'a Memory<layout::StarCone>,
    given: &'a Memory<Float4>,
    /// What is known of each ray.
    found: &'a Memory<u8>,
}

impl Tracing<'_> {
    /// What kernels are told that make directions.
    fn rays<const D: usize>(&self, batch: &Batch<D>) -> [Argument<'_>; 7] {
        [
            self.points.argument(),
            self.star.argument(),
            self.mesh.sums.argument(),
            self.given.argument(),
            Argument::U32(u32::from(batch.chunk.given)),
            Argument::U32(batch.rays),
            Argument::F32(batch.limit),
        ]
    }

    /// Starts to trace all rays, in sets or one by one, neighbours side by side.
    fn start<const D: usize>(
        &self,
        batch: &Batch<D>,
        directions: &mut Kept<Float4>,
        numbers: &mut Kept<u32>,
    ) -> Result<(), Error> {
        let total = batch.all_rays();
        if let Some(kernel) = &self.kernels.occluded_sets {
            let items = batch.points.len() * (batch.rays as usize).div_ceil(SET);
            let mut arguments = self.mesh.arguments();
            arguments.extend(self.rays(batch));
            arguments.extend([Argument::U64(items as u64), self.found.argument()]);
            return self.device.launch(kernel, &arguments, items);
        }
        let directions = self.device.room(directions, total, "rays")?;
        let numbers = self.device.room(numbers, total, "rays")?;
        let mut arguments = Vec::from(self.rays(batch));
        arguments.extend([
            Argument::U32(order::run(batch.rays, batch.points.iter().map(|point| point.next))),
            self.mesh.places.argument(),
            Argument::U64(total as u64),
            directions.argument(),
            numbers.argument(),
            self.found.argument(),
        ]);
        self.device.launch(&self.kernels.aimed, &arguments, total)?;
        let mut arguments = self.mesh.arguments();
        arguments.extend([
            self.points.argument(),
            directions.argument(),
            numbers.argument(),
            Argument::U32(batch.rays),
            Argument::F32(batch.limit),
            Argument::U64(total as u64),
            self.found.argument(),
        ]);
        self.device.launch(&self.kernels.occluded, &arguments, total)
    }

    /// Traces rays again that were in doubt, in double precision. Those that are open are marked; those that still are in doubt
    /// are left.
    fn trace_again<const D: usize>(
        &self,
        batch: &Batch<D>,
        again: &mut Kept<u32>,
        left: &mut Vec<u32>,
        is_open: &mut Bits,
    ) -> Result<(), Error> {
        let numbers = self.device.filled(again, left, "rays")?;
        let mut arguments = self.mesh.arguments();
        arguments.extend(self.rays(batch));
        arguments.extend([numbers.argument(), Argument::U64(left.len() as u64), self.found.argument()]);
        let items = left.len() * spread(self.kernels.occluded_sets.is_some());
        self.device.launch(&self.kernels.occluded_again, &arguments, items)?;
        let mut becomes = vec![layout::OPEN; left.len()];
        self.device.read(self.found, &mut becomes)?;
        for (&ray, &found) in left.iter().zip(&becomes) {
            is_open.set(ray as usize, found == layout::OPEN);
        }
        let mut becomes = becomes.iter();
        left.retain(|_| becomes.next() == Some(&layout::UNSURE));
        Ok(())
    }
}

impl<const D: usize> OpenClBackend<D> {
    /// Which of the next `rays` rays of each point of a part are open.
    pub(super) fn launch(
        &self,
        on: &Part,
        on_device: &mut OnDevice,
        chunk: &Chunk<D>,
        part: &mut [Running],
        rays: u32,
    ) -> Result<Bits, Error> {
        let limit = f64::from(chunk.sampling.max_distance) * self.scale.factor;
        let batch = Batch::take(chunk, part, rays, limit as f32);
        let (mut is_open, mut left) = on_device.trace(&on.device, &batch)?;
        self.settle(&batch, &mut left, &mut is_open);
        Ok(is_open)
    }

    /// Decides exactly what becomes of the rays that are left, and of those that the device must not be asked.
    fn settle(&self, batch: &Batch<D>, left: &mut Vec<u32>, is_open: &mut Bits) {
        if !batch.chunk.all_serve {
            for (k, _) in batch.part.iter().enumerate().filter(|(_, r)| !batch.chunk.serves(r)) {
                left.extend(k as u32 * batch.rays..(k as u32 + 1) * batch.rays);
            }
            left.sort_unstable();
            left.dedup();
        }
        let of_points: Vec<&[u32]> = left.chunk_by(|&a, &b| batch.of(a) == batch.of(b)).collect();
        let settled = |rays: &&[u32]| {
            let visible = self.settled_of(batch, rays);
            rays.iter().copied().zip(visible).collect::<Vec<_>>()
        };
        for (ray, visible) in of_points.par_iter().flat_map_iter(settled).collect::<Vec<_>>() {
            is_open.set(ray as usize, visible);
        }
        self.settled.fetch_add(left.len() as u64, Ordering::Relaxed);
    }

    /// Which of some rays of one point are open.
    fn settled_of(&self, batch: &Batch<D>, rays: &[u32]) -> Vec<bool> {
        let k = batch.of(rays[0]);
        let point = &batch.chunk.points[batch.part[k].index];
        let around = Surroundings::of(&self.tracer, point);
        let frame = around.frame();
        let sampling = batch.chunk.sampling;
        let direction = |ray: u32| {
            if batch.chunk.given {
                return batch.directions[ray as usize];
            }
            let mut sequence = Sequence::new(sampling.sampler, sampling.seed, point.number());
            sequence.next = batch.points[k].next.wrapping_add(ray % batch.rays);
            sequence.next_direction(&frame)
        };
        rays.iter().map(|&ray| around.is_visible(&self.tracer, direction(ray), sampling.max_distance)).collect()
    }
}

impl OnDevice {
    /// Traces a batch: which rays are open, and which are left to the host, ascending.
    fn trace<const D: usize>(&mut self, device: &Device, batch: &Batch<D>) -> Result<(Bits, Vec<u32>), Error> {
        let given: Vec<Float4> = batch.directions.par_iter().map(float4).collect();
        let Room { points, star, given: room, directions, numbers, found, open, unsure, again, .. } = &mut self.room;
        let total = batch.all_rays();
        let tracing = Tracing {
            device,
            kernels: &self.kernels,
            mesh: &self.mesh,
            points: device.filled(points, &batch.points, "points")?,
            star: device.room(star, 0, "cones around points")?,
            given: device.filled(room, &given, "rays")?,
            found: device.room(found, total, "results")?,
        };
        tracing.start(batch, directions, numbers)?;
        let (mut is_open, mut is_unsure) = (Bits::new(total), Bits::new(total));
        let words = is_open.0.len();
        let [open, unsure] = [device.room(open, words, "results")?, device.room(unsure, words, "results")?];
        let arguments = [tracing.found.argument(), Argument::U64(total as u64), open.argument(), unsure.argument()];
        device.launch(&self.kernels.packed, &arguments, words)?;
        device.read(open, &mut is_open.0)?;
        device.read(unsure, &mut is_unsure.0)?;
        let mut left: Vec<u32> = is_unsure.places().map(|place| place as u32).collect();
        if device.info.double && !left.is_empty() {
            tracing.trace_again(batch, again, &mut left, &mut is_open)?;
        }
        Ok((is_open, left))
    }
}
