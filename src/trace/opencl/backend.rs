//! A mesh on a device.

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use super::device::{Argument, Device, Kernels, Memory};
use super::layout::{self, Float4};
use super::{Error, Kind, OpenCl};
use crate::accel::{Scale, Tracer};
use crate::geometry::{Ray, Vector};
use crate::occlusion::sampling::sobol_matrices;
use crate::occlusion::{Cancelled, Error as OcclusionError, Sampler, Sequence};
use crate::progress::Progress;

/// What boxes grow by on each side, in widths of the scene, beside the rounding of that: far more than what
/// `inverted` of the kernels moves a ray by, and so little that it only matters around 0.
const GROWTH: f32 = 1e-18;
/// Rays of a launch to begin with.
const RAYS: usize = 1 << 17;
/// The most rays of a launch.
pub(super) const MOST_RAYS: usize = 1 << 21;
/// Seconds that a launch may take: long enough to be worth it, short enough for watchdogs.
const LAUNCH: f64 = 0.06;

/// A mesh with its hierarchy on one device or several.
#[derive(Debug)]
pub struct Scene<'s, const D: usize> {
    pub(super) parts: Vec<Part<'s>>,
    pub(super) tracer: &'s Tracer<'s, D>,
    pub(super) scale: Scale<D>,
    /// Whether scaled coordinates lose nothing. If they do, the device isn't asked.
    pub(super) serves: bool,
    /// Rays that the devices left to the host.
    pub(super) settled: AtomicU64,
}

/// A device with the mesh on it.
#[derive(Debug)]
pub(super) struct Part<'s> {
    pub device: &'s Device,
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

impl<'s, const D: usize> Scene<'s, D> {
    /// Brings the mesh and its hierarchy to the devices, and compiles the kernels for them.
    ///
    /// # Errors
    /// [`Error`] if the device has not enough memory or the kernels don't compile.
    pub fn new(opencl: &'s OpenCl, tracer: &'s Tracer<'s, D>) -> Result<Self, Error> {
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
        let part = |device| {
            let kernels = Device::build(device, D, bvh.depth())?;
            let matrices = device.filled(&sobol_matrices(), "tables")?;
            let makes_directions = makes_directions::<D>(device, &kernels, &matrices)?;
            let on_device = OnDevice {
                kernels,
                nodes: device.filled(&nodes, "the nodes of the hierarchy")?,
                corners: device.filled(&corners, "the corners of the simplices")?,
                simplices: device.filled(&bvh.order, "the simplices")?,
                matrices,
                rays: RAYS,
            };
            Ok(Part { device, makes_directions, on_device: Mutex::new(on_device) })
        };
        let parts = opencl.devices.iter().map(part).collect::<Result<_, Error>>()?;
        Ok(Self { parts, tracer, scale, serves, settled: AtomicU64::new(0) })
    }

    /// The mesh and its hierarchy.
    pub fn tracer(&self) -> &'s Tracer<'s, D> {
        self.tracer
    }

    /// Whether no device is the processor itself.
    pub fn is_apart(&self) -> bool {
        self.parts.iter().all(|part| part.device.info.kind != Kind::Cpu)
    }

    /// Whether the rays of the samplers are made on the devices; else they are made here and handed over.
    pub fn makes_directions(&self) -> bool {
        self.parts.iter().all(|part| part.makes_directions)
    }

    /// Does jobs 0 to `count` - 1, each on the device that is free next.
    pub(super) fn share<R: Send>(
        &self,
        count: usize,
        job: impl Fn(&Part, usize) -> Result<R, OcclusionError> + Sync,
    ) -> Result<Vec<R>, OcclusionError> {
        if let [part] = &self.parts[..] {
            return (0..count).map(|i| job(part, i)).collect();
        }
        let next = AtomicUsize::new(0);
        let of_part = |part| {
            let taken = || Some(next.fetch_add(1, Ordering::Relaxed)).filter(|&i| i < count);
            std::iter::from_fn(taken).map(|i| Ok((i, job(part, i)?))).collect::<Result<Vec<_>, OcclusionError>>()
        };
        let found: Vec<Result<Vec<(usize, R)>, OcclusionError>> = std::thread::scope(|scope| {
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

    /// The simplex that each ray hits first, as [`Tracer::closest_hit`] tells; `u32::MAX` if there is none.
    ///
    /// # Errors
    /// [`OcclusionError::Cancelled`] if `progress` says so, [`OcclusionError::OpenCl`] if a call fails.
    pub fn first_hits(&self, rays: &[Ray<D>], progress: &dyn Progress) -> Result<Vec<u32>, OcclusionError> {
        let host = |ray: &Ray<D>| self.tracer.closest_hit(ray).map_or(layout::NONE, |hit| hit.simplex);
        if !self.serves {
            return Ok(rays.par_iter().map(host).collect());
        }
        let count = self.parts.len();
        let size = if count == 1 { rays.len().max(1) } else { rays.len().div_ceil(4 * count).max(1) };
        let jobs: Vec<&[Ray<D>]> = rays.chunks(size).collect();
        Ok(self.share(jobs.len(), |part, i| self.first_hits_on(part, jobs[i], &host, progress))?.concat())
    }

    fn first_hits_on(
        &self,
        on: &Part,
        rays: &[Ray<D>],
        host: &(impl Fn(&Ray<D>) -> u32 + Sync),
        progress: &dyn Progress,
    ) -> Result<Vec<u32>, OcclusionError> {
        let mut found = vec![layout::NONE; rays.len()];
        let mut on_device = on.on_device.lock().unwrap_or_else(PoisonError::into_inner);
        let mut begin = 0;
        while begin < rays.len() {
            if progress.cancelled() {
                return Err(Cancelled.into());
            }
            let part = &rays[begin..rays.len().min(begin + on_device.rays)];
            let found = &mut found[begin..begin + part.len()];
            let start = std::time::Instant::now();
            let origins: Vec<Float4> = part.par_iter().map(|r| float4(&self.scale.scaled(&r.origin))).collect();
            let ways: Vec<Float4> = part.par_iter().map(|r| float4(&r.direction)).collect();
            let origins = on.device.filled(&origins, "rays")?;
            let ways = on.device.filled(&ways, "rays")?;
            let out = on.device.empty::<u32>(part.len(), "results")?;
            let state = &*on_device;
            let arguments = [
                state.nodes.argument(),
                state.corners.argument(),
                state.simplices.argument(),
                Argument::U32(u32::from(self.is_empty())),
                origins.argument(),
                ways.argument(),
                Argument::U64(part.len() as u64),
                out.argument(),
            ];
            on.device.launch(&state.kernels.first_hit, &arguments, part.len())?;
            on.device.read(&out, found)?;
            on_device.learn(part.len(), start.elapsed().as_secs_f64());
            found.par_iter_mut().zip(part).for_each(|(found, ray)| {
                if *found == layout::UNSURE_SIMPLEX || !is_exact(&self.scale, &ray.origin) {
                    *found = host(ray);
                    self.settled.fetch_add(1, Ordering::Relaxed);
                }
            });
            begin += part.len();
        }
        Ok(found)
    }
}

/// Whether scaling the point loses nothing.
pub(super) fn is_exact<const D: usize>(scale: &Scale<D>, point: &Vector<D>) -> bool {
    let scaled = scale.scaled(point);
    (0..D).all(|i| scaled[i].is_finite() && f64::from(scaled[i]) == f64::from(point[i]) * scale.factor)
}

/// Tries whether the device makes the host's directions, of some thousand rays.
fn makes_directions<const D: usize>(device: &Device, kernels: &Kernels, matrices: &Memory<u32>) -> Result<bool, Error> {
    const SITES: u64 = 64;
    const RAYS: u32 = 128;
    let frame = |site: u64| {
        let normal = Vector::<D>::from_fn(|i, _| ((site * 7 + 3 * i as u64) % 11) as f32 - 4.9).normalize();
        crate::geometry::Frame::new(&normal)
    };
    let sequence = |site| Sequence::new(Sampler::Sobol, 1, site);
    let sites: Vec<layout::Site> =
        (0..SITES).map(|site| super::points::sampled_site(&frame(site), &sequence(site))).collect();
    let count = (SITES * u64::from(RAYS)) as usize;
    let (sites, out) = (device.filled(&sites, "points")?, device.empty::<Float4>(count, "results")?);
    let arguments = [sites.argument(), matrices.argument(), Argument::U32(RAYS), out.argument()];
    device.launch(&kernels.directions, &arguments, count)?;
    let mut found = vec![Float4::default(); count];
    device.read(&out, &mut found)?;
    let mut found = found.iter();
    Ok((0..SITES).all(|site| {
        let (frame, mut sequence) = (frame(site), sequence(site));
        (0..RAYS).all(|_| {
            let expected = float4(&sequence.next_direction::<D>(&frame)).0.map(f32::to_bits);
            found.next().is_some_and(|f| (0..D).all(|i| f.0[i].to_bits() == expected[i]))
        })
    }))
}
