//! A mesh on devices, and first hits there.

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;

use super::device::{Argument, Device, Kernels, Memory};
use super::devices::Kind;
use super::error::Error;
use super::layout::{self, Float4};
use super::open::OpenCl;
use crate::accel::{Scale, Tracer};
use crate::geometry::{Cone, Frame, Ray, Vector};
use crate::progress::{Cancelled, Progress};
use crate::trace::backend::{Error as TraceError, NOTHING, RayBackend};
use crate::trace::cpu::{CpuBackend, first_hit};
use crate::trace::estimate::Estimate;
use crate::trace::point::ShadingPoint;
use crate::trace::sampling::{Sampler, Sampling, Sequence, Source, sobol_matrices};

/// What boxes grow by on each side, in widths of the scene, beside the rounding of that: far more than what
/// `inverted` of the kernels moves a ray by, and so little that it only matters around 0.
const GROWTH: f32 = 1e-18;
/// Rays of a launch to begin with.
const RAYS: usize = 1 << 17;
/// The most rays of a launch.
pub(super) const MOST_RAYS: usize = 1 << 21;
/// Seconds that a launch may take: long enough to be worth it, short enough for watchdogs.
const LAUNCH: f64 = 0.06;

/// A mesh with its hierarchy on one device or several. It owns what it needs, and can be kept in anything.
#[derive(Debug)]
pub struct OpenClBackend<const D: usize> {
    pub(super) parts: Vec<Part>,
    pub(super) tracer: Arc<Tracer<D>>,
    pub(super) scale: Scale<D>,
    /// Whether scaled coordinates lose nothing. If they do, the device isn't asked.
    pub(super) serves: bool,
    /// Rays that the devices left to the host.
    pub(super) settled: AtomicU64,
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
    pub nodes: Memory<layout::Node>,
    pub corners: Memory<Float4>,
    pub simplices: Memory<u32>,
    pub matrices: Memory<u32>,
    /// How many rays a launch takes now.
    pub rays: usize,
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

pub(super) fn float4<const D: usize>(v: &Vector<D>) -> Float4 {
    let mut all = [0.0; 4];
    all[..D].copy_from_slice(v.as_slice());
    Float4(all)
}

impl<const D: usize> OpenClBackend<D> {
    /// Brings the mesh and its hierarchy to the devices, and compiles the kernels for them.
    ///
    /// # Errors
    /// [`Error`] if the device has not enough memory or the kernels don't compile.
    pub fn new(opencl: &OpenCl, tracer: impl Into<Arc<Tracer<D>>>) -> Result<Self, Error> {
        let tracer = tracer.into();
        tracer.prepare();
        let (mesh, bvh) = (tracer.mesh(), tracer.bvh());
        let scale = Scale::of(&mesh.vertices);
        let serves = mesh.vertices.par_iter().all(|v| is_exact(&scale, v));
        let nodes: Vec<layout::Node> = (bvh.nodes.par_iter())
            .map(|node| {
                let low = scale.scaled(&node.bounds.min).map(|x| x.next_down() - GROWTH);
                let high = scale.scaled(&node.bounds.max).map(|x| x.next_up() + GROWTH);
                let (low, high) = (float4(&low), float4(&high));
                layout::Node { low, high, first: node.first, count: node.count, padding: [0; 2] }
            })
            .collect();
        let corners: Vec<Float4> =
            (bvh.order.par_iter()).flat_map_iter(|&s| mesh.corners(s).map(|v| float4(&scale.scaled(&v)))).collect();
        let part = |device: &Arc<Device>| {
            let kernels = device.build(D, bvh.depth())?;
            let matrices = device.input(&sobol_matrices(), "tables")?;
            let makes_directions = makes_directions::<D>(device, &kernels, &matrices)?;
            let on_device = OnDevice {
                kernels,
                nodes: device.input(&nodes, "the nodes of the hierarchy")?,
                corners: device.input(&corners, "the corners of the simplices")?,
                simplices: device.input(&bvh.order, "the simplices")?,
                matrices,
                rays: RAYS,
            };
            Ok(Part { device: Arc::clone(device), makes_directions, on_device: Mutex::new(on_device) })
        };
        let parts = opencl.devices.iter().map(part).collect::<Result<_, Error>>()?;
        Ok(Self { parts, tracer, scale, serves, settled: AtomicU64::new(0) })
    }

    /// Whether the rays of the samplers are made on the devices; else they are made here and handed over.
    pub fn makes_directions(&self) -> bool {
        self.parts.iter().all(|part| part.makes_directions)
    }

    /// Does jobs 0 to `count` - 1, each on the device that is free next.
    pub(super) fn share<R: Send>(
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
        let found: Vec<Result<Vec<(usize, R)>, TraceError>> = std::thread::scope(|scope| {
            let threads: Vec<_> = self.parts.iter().map(|part| scope.spawn(|| of_part(part))).collect();
            let join = |thread: std::thread::ScopedJoinHandle<'_, _>| match thread.join() {
                Ok(found) => found,
                Err(panic) => std::panic::resume_unwind(panic),
            };
            threads.into_iter().map(join).collect()
        });
        let mut all: Vec<(usize, R)> = Vec::with_capacity(count);
        for part in found {
            all.extend(part?);
        }
        all.sort_by_key(|(i, _)| *i);
        Ok(all.into_iter().map(|(_, found)| found).collect())
    }

    /// How many rays the devices couldn't decide so far, which the host did.
    pub fn settled(&self) -> u64 {
        self.settled.load(Ordering::Relaxed)
    }

    /// Whether there is nothing to hit.
    pub(super) fn is_empty(&self) -> bool {
        self.tracer.bvh().nodes.is_empty()
    }

    /// First hits of some rays by one device.
    fn first_hits_on(
        &self,
        on: &Part,
        rays: &[Ray<D>],
        after: Option<&[u32]>,
        progress: &dyn Progress,
    ) -> Result<Vec<u32>, TraceError> {
        let mut found = vec![NOTHING; rays.len()];
        let mut on_device = on.on_device.lock().unwrap_or_else(PoisonError::into_inner);
        let mut begin = 0;
        while begin < rays.len() {
            if progress.cancelled() {
                return Err(Cancelled.into());
            }
            let range = begin..rays.len().min(begin + on_device.rays);
            let part = &rays[range.clone()];
            let after = after.map(|after| &after[range.clone()]);
            let found = &mut found[range];
            let start = std::time::Instant::now();
            let origins: Vec<Float4> = part.par_iter().map(|r| float4(&self.scale.scaled(&r.origin))).collect();
            let directions: Vec<Float4> = part.par_iter().map(|r| float4(&r.direction)).collect();
            let bounds: Vec<(u32, [f32; 2])> = match after {
                Some(after) => part.par_iter().zip(after).map(|(ray, &after)| self.bound(ray, after)).collect(),
                None => Vec::new(),
            };
            let (passed, bounds): (Vec<u32>, Vec<[f32; 2]>) = bounds.into_iter().unzip();
            let origins = on.device.input(&origins, "rays")?;
            let directions = on.device.input(&directions, "rays")?;
            let passed = on.device.input(&passed, "simplices that rays have passed")?;
            let bounds = on.device.input(&bounds, "distances that rays have passed")?;
            let out = on.device.output::<u32>(part.len(), "results")?;
            let state = &*on_device;
            let arguments = [
                state.nodes.argument(),
                state.corners.argument(),
                state.simplices.argument(),
                Argument::U32(u32::from(self.is_empty())),
                origins.argument(),
                directions.argument(),
                Argument::U32(u32::from(after.is_some())),
                passed.argument(),
                bounds.argument(),
                Argument::U64(part.len() as u64),
                out.argument(),
            ];
            on.device.launch(&state.kernels.first_hit, &arguments, part.len())?;
            on.device.read(&out, found)?;
            on_device.learn(part.len(), start.elapsed().as_secs_f64());
            found.par_iter_mut().zip(part).enumerate().for_each(|(i, (found, ray))| {
                if *found == layout::UNSURE_SIMPLEX || !is_exact(&self.scale, &ray.origin) {
                    *found = first_hit(&self.tracer, ray, after.map_or(NOTHING, |after| after[i]));
                    self.settled.fetch_add(1, Ordering::Relaxed);
                }
            });
            begin += part.len();
        }
        Ok(found)
    }

    /// The simplex that bounds a ray, if it does, and two distances between which the ray surely hits it, as the device
    /// measures them.
    fn bound(&self, ray: &Ray<D>, after: u32) -> (u32, [f32; 2]) {
        let unbounded = (NOTHING, [0.0; 2]);
        let mesh = self.tracer.mesh();
        if after as usize >= mesh.simplices.len() {
            return unbounded;
        }
        let cone = Cone::of_simplex(&ray.origin, &mesh.corners(after));
        if !cone.contains(&ray.direction) {
            return unbounded;
        }
        let crossing = cone.crossing(&ray.direction);
        let scaled = |t: f64| (t * self.scale.factor) as f32;
        let low = scaled((crossing.t - crossing.error) * (1.0 - 1e-6)).next_down();
        let high = scaled((crossing.t + crossing.error) * (1.0 + 1e-6)).next_up();
        (after, [low, high])
    }
}

impl<const D: usize> RayBackend<D> for OpenClBackend<D> {
    fn tracer(&self) -> &Arc<Tracer<D>> {
        &self.tracer
    }

    fn first_hits(
        &self,
        rays: &[Ray<D>],
        after: Option<&[u32]>,
        progress: &dyn Progress,
    ) -> Result<Vec<u32>, TraceError> {
        assert!(after.is_none_or(|after| after.len() == rays.len()), "one bound a ray");
        if !self.serves {
            return CpuBackend::new(Arc::clone(&self.tracer)).first_hits(rays, after, progress);
        }
        let count = self.parts.len();
        let size = if count == 1 { rays.len().max(1) } else { rays.len().div_ceil(4 * count).max(1) };
        let jobs: Vec<&[Ray<D>]> = rays.chunks(size).collect();
        let job = |part: &Part, i: usize| {
            let after = after.map(|after| &after[i * size..i * size + jobs[i].len()]);
            self.first_hits_on(part, jobs[i], after, progress)
        };
        Ok(self.share(jobs.len(), job)?.concat())
    }

    fn open_fractions(
        &self,
        points: &[ShadingPoint<D>],
        sampling: &Sampling,
        progress: &dyn Progress,
    ) -> Result<Vec<Estimate>, TraceError> {
        // Devices know of rays that escape, not of shares of them.
        if self.tracer.mesh().is_translucent() {
            return CpuBackend::new(Arc::clone(&self.tracer)).open_fractions(points, sampling, progress);
        }
        self.estimate(points, sampling, progress)
    }

    fn is_apart(&self) -> bool {
        self.parts.iter().all(|part| part.device.info.kind != Kind::Cpu)
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
fn makes_directions<const D: usize>(device: &Device, kernels: &Kernels, matrices: &Memory<u32>) -> Result<bool, Error> {
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
    let arguments = [points.argument(), matrices.argument(), Argument::U32(RAYS), out.argument()];
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
