//! A mesh with its hierarchy on devices, and work shared out among them.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use rayon::prelude::*;

use super::device::{Argument, Device, Kept, Kernels, Memory};
use super::devices::Kind;
use super::error::Error;
use super::facet::{self, facet};
use super::layout::{self, Float4, StarCone, float4};
use super::open::OpenCl;
use super::order;
use super::program::{PIECES, Shape};
use super::wide::Wide;
use crate::accel::{Scale, Tracer};
use crate::geometry::{Dimension, Frame, Vector};
use crate::trace::backend::{Error as TraceError, NOTHING};
use crate::trace::sampling::{Sampler, Sequence, Source, sobol_sums};

/// Rays of a launch to begin with.
const RAYS: usize = 1 << 17;
/// The same on a GPU, which is idle in part with fewer.
const RAYS_OF_GPU: usize = 1 << 20;
/// The most rays of a launch.
pub(super) const MOST_RAYS: usize = 1 << 22;
/// Seconds that a launch may take: long enough to be worth it, short enough for watchdogs.
const LAUNCH: f64 = 0.06;

/// What is otherwise chosen by the device, for tests.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tuning {
    /// The most simplices in one piece of memory.
    pub piece: Option<usize>,
    /// How many launches are prepared at a time.
    pub lanes: Option<usize>,
    /// Whether rays are traced in sets.
    pub sets: Option<bool>,
}

/// The mesh on the devices.
#[derive(Debug)]
pub(super) struct Scene {
    /// What works side by side: two parts of each device but of processors, as one prepares its rays while the other's are traced.
    pub parts: Vec<Part>,
    /// Whether scaled coordinates lose nothing. If they do, the device isn't asked.
    pub serves: bool,
}

/// A device with the mesh on it.
#[derive(Debug)]
pub(super) struct Part {
    pub device: Arc<Device>,
    /// Whether the device makes directions like the host.
    pub makes_directions: bool,
    pub on_device: Mutex<OnDevice>,
}

/// What is on the device, used by one thread at a time.
#[derive(Debug)]
pub(super) struct OnDevice {
    pub kernels: Kernels,
    pub mesh: Arc<MeshCopy>,
    /// How many rays a launch takes now.
    pub rays: usize,
    pub room: Room,
}

/// The mesh on the device.
#[derive(Debug)]
pub(super) struct MeshCopy {
    nodes: Memory<layout::Node>,
    /// The boxes of the nodes, and what their sides are told from.
    sides: Memory<Float4>,
    middle: Memory<Float4>,
    /// Of the simplices, piece after piece: what is told of them, and their corners.
    facets: Vec<Memory<Float4>>,
    corners: Vec<Memory<Float4>>,
    simplices: Memory<u32>,
    /// Of each simplex, what vertices with the same coordinates have in common.
    vertices: Memory<[u32; 4]>,
    /// The simplices around each vertex, as they are numbered here, and where they begin.
    pub around: [Memory<u32>; 2],
    /// What makes Sobol' points, and where the rays of a point go ([`order`]).
    pub sums: Memory<u32>,
    pub places: Memory<u16>,
    is_empty: bool,
}

/// Room for what launches need and find.
#[derive(Debug, Default)]
pub(super) struct Room {
    pub points: Kept<layout::Point>,
    pub apices: Kept<layout::Apex>,
    pub star: Kept<StarCone>,
    pub origins: Kept<Float4>,
    pub given: Kept<Float4>,
    pub directions: Kept<Float4>,
    pub numbers: Kept<u32>,
    pub passed: Kept<u32>,
    pub bounds: Kept<[f32; 2]>,
    pub found: Kept<u8>,
    pub open: Kept<u32>,
    pub unsure: Kept<u32>,
    pub again: Kept<u32>,
    pub hits: Kept<u32>,
}

impl MeshCopy {
    /// What kernels are told of the mesh.
    pub fn arguments(&self) -> Vec<Argument<'_>> {
        let mut arguments = vec![self.nodes.argument(), self.sides.argument(), self.middle.argument()];
        for pieces in [&self.facets, &self.corners] {
            // Those that there aren't are never looked at.
            arguments.extend((0..PIECES).map(|piece| pieces[piece.min(pieces.len() - 1)].argument()));
        }
        let is_empty = Argument::U32(u32::from(self.is_empty));
        arguments.extend([self.simplices.argument(), self.vertices.argument(), is_empty]);
        arguments
    }
}

impl OnDevice {
    /// Takes more or fewer rays the next time, after so many took so long.
    pub fn learn(&mut self, rays: usize, seconds: f64) {
        let right = rays as f64 * (LAUNCH / seconds.max(1e-6)).clamp(0.25, 2.0);
        if rays * 2 >= self.rays {
            self.rays = (right as usize).clamp(1 << 12, MOST_RAYS);
        }
    }
}

impl Scene {
    /// Brings the mesh and its hierarchy to the devices, and compiles the kernels for them.
    pub fn new<const D: usize>(
        opencl: &OpenCl,
        tracer: &Tracer<D>,
        scale: &Scale<D>,
        tuning: Tuning,
    ) -> Result<Self, Error> {
        tracer.prepare();
        let mesh = tracer.mesh();
        let serves = mesh.vertices.par_iter().all(|v| is_exact(scale, v));
        let wide = Wide::new(tracer.bvh(), scale);
        let scaled = |&simplex: &u32| mesh.corners(simplex).map(|v| scale.scaled(&v));
        let corners: Vec<Float4> = wide.order.par_iter().flat_map_iter(|s| scaled(s).map(|v| float4(&v))).collect();
        let facets: Vec<Float4> = wide.order.par_iter().flat_map_iter(|s| facet(&scaled(s))).collect();
        let vertices = |&simplex: &u32| {
            let mut found = [NOTHING; 4];
            found[..D].copy_from_slice(&mesh.simplices[simplex as usize].map(|v| mesh.identity[v as usize]));
            found
        };
        let vertices: Vec<[u32; 4]> = wide.order.par_iter().map(vertices).collect();
        let incidence = tracer.incidence();
        let mut place_of = vec![NOTHING; mesh.simplices.len()];
        wide.order.iter().zip(0..).for_each(|(&simplex, place)| place_of[simplex as usize] = place);
        let around: Vec<u32> = incidence.simplices().par_iter().map(|&simplex| place_of[simplex as usize]).collect();
        let mut parts = Vec::new();
        for device in &opencl.devices {
            let (is_gpu, is_processor) = (device.info.kind == Kind::Gpu, device.info.kind == Kind::Cpu);
            let fits = device.info.largest as usize / (facet::vectors::<D>() * size_of::<Float4>());
            let most = tuning.piece.unwrap_or(if device.info.largest == 0 { usize::MAX } else { fits.max(1) });
            let is_whole = wide.order.len() <= most;
            let shape = Shape {
                dimension: D,
                depth: wide.depth,
                // What a processor has side by side is in its registers.
                sets: tuning.sets.unwrap_or(is_processor),
                piece: (!is_whole).then(|| wide.order.len().div_ceil(PIECES).max(1)),
            };
            let kernels = device.build(shape)?;
            let sums = device.input(&sobol_sums(), "tables")?;
            let makes_directions = makes_directions::<D>(device, &kernels, &sums)?;
            let size = shape.piece.unwrap_or(wide.order.len()).max(1);
            let pieces = |all: &[Float4], vectors: usize, what| {
                let chunks = if all.is_empty() { vec![all] } else { all.chunks(vectors * size).collect() };
                chunks.into_iter().map(|piece| device.input(piece, what)).collect::<Result<Vec<_>, _>>()
            };
            let mesh = Arc::new(MeshCopy {
                nodes: device.input(&wide.nodes, "the nodes of the hierarchy")?,
                sides: device.input(&wide.sides, "the boxes of the hierarchy")?,
                middle: device.input(&[wide.middle], "the boxes of the hierarchy")?,
                facets: pieces(&facets, facet::vectors::<D>(), "the simplices")?,
                corners: pieces(&corners, D, "the corners of the simplices")?,
                simplices: device.input(&wide.order, "the numbers of the simplices")?,
                vertices: device.input(&vertices, "the vertices of the simplices")?,
                around: [device.input(incidence.starts(), "the vertices")?, device.input(&around, "the vertices")?],
                sums,
                places: device.input(&order::places(Dimension::of::<D>()), "tables")?,
                is_empty: wide.nodes.is_empty(),
            });
            let part = |device, kernels| {
                let (mesh, rays) = (Arc::clone(&mesh), if is_gpu { RAYS_OF_GPU } else { RAYS });
                let on_device = Mutex::new(OnDevice { kernels, mesh, rays, room: Room::default() });
                Part { device, makes_directions, on_device }
            };
            // A processor has nothing better to do than the device's work.
            for _ in 1..tuning.lanes.unwrap_or(if is_processor { 1 } else { 2 }) {
                parts.push(part(Arc::new(device.beside()?), device.again(&kernels)?));
            }
            parts.push(part(Arc::clone(device), kernels));
        }
        Ok(Self { parts, serves })
    }

    /// Does jobs 0 to `count` - 1, each on the device that is free next.
    pub fn share<R: Send>(
        &self,
        count: usize,
        job: impl Fn(&Part, usize) -> Result<R, TraceError> + Sync,
    ) -> Result<Vec<R>, TraceError> {
        if let [part] = &self.parts[..] {
            return (0..count).map(|i| job(part, i)).collect();
        }
        let next = AtomicUsize::new(0);
        let of_part = |part| {
            let taken = || Some(next.fetch_add(1, Ordering::Relaxed)).filter(|&i| i < count);
            std::iter::from_fn(taken).map(|i| Ok((i, job(part, i)?))).collect::<Result<Vec<_>, TraceError>>()
        };
        // On this pool's threads, so that there are no more of them than were asked for.
        let mut found: Vec<Result<Vec<(usize, R)>, TraceError>> = self.parts.iter().map(|_| Ok(Vec::new())).collect();
        rayon::scope(|scope| {
            let of_part = &of_part;
            for (part, found) in self.parts.iter().zip(&mut found) {
                scope.spawn(move |_| *found = of_part(part));
            }
        });
        let mut all: Vec<(usize, R)> = Vec::with_capacity(count);
        for part in found {
            all.extend(part?);
        }
        all.sort_by_key(|(i, _)| *i);
        Ok(all.into_iter().map(|(_, found)| found).collect())
    }
}

/// Whether scaling the point loses nothing.
pub(super) fn is_exact<const D: usize>(scale: &Scale<D>, point: &Vector<D>) -> bool {
    let scaled = scale.scaled(point);
    (0..D).all(|i| scaled[i].is_finite() && f64::from(scaled[i]) == f64::from(point[i]) * scale.factor)
}

/// A point as the device knows it, so far as its rays are concerned.
pub(super) fn sampled_point<const D: usize>(frame: &Frame<D>, sequence: &Sequence) -> layout::Point {
    let (axis, factor, turned) = frame.parts();
    let keys = match &sequence.source {
        Source::Sobol(keys) => *keys,
        Source::Random(_) => [0; 4],
    };
    let (turned, next) = (u32::from(turned), sequence.next);
    layout::Point { axis: float4(axis), keys, factor, turned, next, ..layout::Point::default() }
}

/// Tries whether the device makes the host's directions, of some thousand rays.
fn makes_directions<const D: usize>(device: &Device, kernels: &Kernels, sums: &Memory<u32>) -> Result<bool, Error> {
    const POINTS: u64 = 64;
    const RAYS: u32 = 128;
    let frame = |point: u64| {
        let normal = Vector::<D>::from_fn(|i, _| ((point * 7 + 3 * i as u64) % 11) as f32 - 4.9).normalize();
        Frame::new(&normal)
    };
    let sequence = |point| Sequence::new(Sampler::Sobol, 1, point);
    let points: Vec<layout::Point> = (0..POINTS).map(|point| sampled_point(&frame(point), &sequence(point))).collect();
    let count = (POINTS * u64::from(RAYS)) as usize;
    let (points, out) = (device.input(&points, "points")?, device.output::<Float4>(count, "results")?);
    let arguments = [points.argument(), sums.argument(), Argument::U32(RAYS), out.argument()];
    device.launch(&kernels.directions, &arguments, count)?;
    let mut found = vec![Float4::default(); count];
    device.read(&out, &mut found)?;
    let mut found = found.iter();
    Ok((0..POINTS).all(|point| {
        let (frame, mut sequence) = (frame(point), sequence(point));
        (0..RAYS).all(|_| {
            let expected = float4(&sequence.next_direction::<D>(&frame)).0.map(f32::to_bits);
            found.next().is_some_and(|f| (0..D).all(|i| f.0[i].to_bits() == expected[i]))
        })
    }))
}
