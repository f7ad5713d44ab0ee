//! A mesh on devices, and first hits there.

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use rayon::prelude::*;

use super::device::{Argument, Device, Kernels, Memory};
use super::devices::Kind;
use super::error::Error;
use super::layout::{self, Float4};
use super::open::OpenCl;
use super::program::{PIECES, Shape};
use super::wide::Wide;
use crate::accel::{Scale, Tracer};
use crate::geometry::{Cone, Frame, Ray, Vector};
use crate::progress::{Cancelled, Progress};
use crate::trace::backend::{Error as TraceError, NOTHING, RayBackend};
use crate::trace::cpu::{CpuBackend, first_hit};
use crate::trace::estimate::Estimate;
use crate::trace::point::ShadingPoint;
use crate::trace::sampling::{Sampler, Sampling, Sequence, Source, sobol_matrices};

/// Rays of a launch to begin with.
const RAYS: usize = 1 << 17;
/// The most rays of a launch.
pub(super) const MOST_RAYS: usize = 1 << 21;
/// Seconds that a launch may take: long enough to be worth it, short enough for watchdogs.
const LAUNCH: f64 = 0.06;

/// A mesh with its hierarchy on one device or several. It owns what it needs, and can be kept in anything. The devices get the
/// mesh when rays are first asked for: a picture that is only scan-converted needs none.
#[derive(Debug)]
pub struct OpenClBackend<const D: usize> {
    opencl: OpenCl,
    tuning: Tuning,
    pub(super) tracer: Arc<Tracer<D>>,
    pub(super) scale: Scale<D>,
    scene: OnceLock<Result<Scene, Error>>,
    /// Rays that the devices left to the host.
    pub(super) settled: AtomicU64,
}

/// What is otherwise chosen by the device, for tests.
#[derive(Clone, Copy, Debug, Default)]
struct Tuning {
    /// The most simplices in one piece of memory.
    piece: Option<usize>,
    /// Whether the rays of a group are sorted.
    sorted: Option<bool>,
}

/// The mesh on the devices.
#[derive(Debug)]
pub(super) struct Scene {
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
    nodes: Memory<layout::Node>,
    /// Of the simplices, piece after piece.
    corners: Vec<Memory<Float4>>,
    simplices: Memory<u32>,
    pub matrices: Memory<u32>,
    is_empty: bool,
    /// How many rays a launch takes now.
    pub rays: usize,
}

impl OnDevice {
    /// What kernels are told of the mesh.
    pub fn mesh(&self) -> Vec<Argument<'_>> {
        let mut arguments = vec![self.nodes.argument()];
        // Pieces that there aren't are never looked at.
        arguments.extend((0..PIECES).map(|piece| self.corners[piece.min(self.corners.len() - 1)].argument()));
        arguments.extend([self.simplices.argument(), Argument::U32(u32::from(self.is_empty))]);
        arguments
    }

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

impl Scene {
    /// Brings the mesh and its hierarchy to the devices, and compiles the kernels for them.
    fn new<const D: usize>(
        opencl: &OpenCl,
        tracer: &Tracer<D>,
        scale: &Scale<D>,
        tuning: Tuning,
    ) -> Result<Self, Error> {
        tracer.prepare();
        let mesh = tracer.mesh();
        let serves = mesh.vertices.par_iter().all(|v| is_exact(scale, v));
        let wide = Wide::new(tracer.bvh(), scale);
        let corners: Vec<Float4> =
            (wide.order.par_iter()).flat_map_iter(|&s| mesh.corners(s).map(|v| float4(&scale.scaled(&v)))).collect();
        let part = |device: &Arc<Device>| {
            let fits = device.info.largest as usize / (D * size_of::<Float4>());
            let most = tuning.piece.unwrap_or(if device.info.largest == 0 { usize::MAX } else { fits.max(1) });
            let is_whole = wide.order.len() <= most;
            let shape = Shape {
                dimension: D,
                depth: wide.depth,
                piece: (!is_whole).then(|| wide.order.len().div_ceil(PIECES).max(1)),
                // On a processor neighbours don't go side by side.
                sorted: tuning.sorted.unwrap_or(device.info.kind == Kind::Gpu),
            };
            let kernels = device.build(shape)?;
            let matrices = device.input(&sobol_matrices(), "tables")?;
            let makes_directions = makes_directions::<D>(device, &kernels, &matrices)?;
            let piece = |corners: &[Float4]| device.input(corners, "the corners of the simplices");
            let pieces = match shape.piece {
                None => vec![piece(&corners)?],
                Some(size) => corners.chunks(D * size).map(piece).collect::<Result<_, _>>()?,
            };
            let on_device = OnDevice {
                kernels,
                nodes: device.input(&wide.nodes, "the nodes of the hierarchy")?,
                corners: pieces,
                simplices: device.input(&wide.order, "the simplices")?,
                matrices,
                is_empty: wide.nodes.is_empty(),
                rays: RAYS,
            };
            Ok(Part { device: Arc::clone(device), makes_directions, on_device: Mutex::new(on_device) })
        };
        let parts = opencl.devices.iter().map(part).collect::<Result<_, Error>>()?;
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
}

impl<const D: usize> OpenClBackend<D> {
    /// Keeps the mesh for the devices.
    pub fn new(opencl: &OpenCl, tracer: impl Into<Arc<Tracer<D>>>) -> Self {
        let tracer = tracer.into();
        let scale = Scale::of(&tracer.mesh().vertices);
        let (opencl, scene, settled) = (opencl.clone(), OnceLock::new(), AtomicU64::new(0));
        Self { opencl, tuning: Tuning::default(), tracer, scale, scene, settled }
    }

    /// The mesh on the devices; brought there when first asked for.
    pub(super) fn scene(&self) -> Result<&Scene, Error> {
        // Not within `get_or_init`: a thread that waits there for its part of the work takes up other work, and would wait
        // for itself if that asked for the scene.
        if self.scene.get().is_none() {
            let _ = self.scene.set(Scene::new(&self.opencl, &self.tracer, &self.scale, self.tuning));
        }
        self.scene.wait().as_ref().map_err(Error::clone)
    }

    /// Whether the rays of the samplers are made on the devices; else they are made here and handed over.
    ///
    /// # Errors
    /// [`Error`] if a device has not enough memory or the kernels don't compile.
    pub fn makes_directions(&self) -> Result<bool, Error> {
        Ok(self.scene()?.parts.iter().all(|part| part.makes_directions))
    }

    /// How many rays the devices couldn't decide so far, which the host did.
    pub fn settled(&self) -> u64 {
        self.settled.load(Ordering::Relaxed)
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
            let mut arguments = state.mesh();
            arguments.extend([
                origins.argument(),
                directions.argument(),
                Argument::U32(u32::from(after.is_some())),
                passed.argument(),
                bounds.argument(),
                Argument::U64(part.len() as u64),
                out.argument(),
            ]);
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

    fn prepare(&self) -> Result<(), TraceError> {
        if self.tracer.mesh().is_translucent() {
            self.tracer.prepare_wide();
            return Ok(());
        }
        Ok(self.scene().map(|_| ())?)
    }

    fn first_hits(
        &self,
        rays: &[Ray<D>],
        after: Option<&[u32]>,
        progress: &dyn Progress,
    ) -> Result<Vec<u32>, TraceError> {
        assert!(after.is_none_or(|after| after.len() == rays.len()), "one bound a ray");
        let scene = self.scene()?;
        if !scene.serves {
            return CpuBackend::new(Arc::clone(&self.tracer)).first_hits(rays, after, progress);
        }
        let count = scene.parts.len();
        let size = if count == 1 { rays.len().max(1) } else { rays.len().div_ceil(4 * count).max(1) };
        let jobs: Vec<&[Ray<D>]> = rays.chunks(size).collect();
        let job = |part: &Part, i: usize| {
            let after = after.map(|after| &after[i * size..i * size + jobs[i].len()]);
            self.first_hits_on(part, jobs[i], after, progress)
        };
        Ok(scene.share(jobs.len(), job)?.concat())
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
        self.opencl.devices().all(|device| device.kind != Kind::Cpu)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vector64;
    use crate::mesh::{MeshBuilder, Orientation, Surface};
    use crate::progress::Silent;

    fn pieces_and_orders<const D: usize>(opencl: &OpenCl) {
        let mut state = 5u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 23) - 1.0
        };
        let mut surface = Surface::<D> { vertices: Vec::new(), simplices: Vec::new(), normals: None };
        for s in 0..150 {
            let centre = Vector64::<D>::from_fn(|_, _| random());
            surface.vertices.extend((0..D).map(|_| centre + Vector64::from_fn(|_, _| 0.5 * random())));
            surface.simplices.push(std::array::from_fn(|i| (s * D + i) as u32));
        }
        let mut builder = MeshBuilder::new();
        builder.add("soup", [1.0; 3], &surface, Orientation::Input).unwrap();
        let tracer = Arc::new(Tracer::new(builder.finish()));
        let points = ShadingPoint::vertices(tracer.mesh());
        let rays: Vec<Ray<D>> = (0..2000)
            .map(|_| Ray::new(Vector::from_fn(|_, _| 2.0 * random() as f32), Vector::from_fn(|_, _| random() as f32)))
            .collect();
        let cpu = CpuBackend::new(Arc::clone(&tracer));
        let ask = |backend: &dyn RayBackend<D>| {
            // Fewer rays a point than a group has, as many, and more.
            let open =
                [5, 64, 300].map(|rays| backend.open_fractions(&points, &Sampling::new(rays, 3), &Silent).unwrap());
            // And a single one.
            let one = backend.open_fractions(&points[..1], &Sampling::new(1, 3), &Silent).unwrap();
            (open, one, backend.first_hits(&rays, None, &Silent).unwrap())
        };
        let expected = ask(&cpu);
        for tuning in [
            Tuning { piece: None, sorted: Some(true) },
            Tuning { piece: Some(60), sorted: Some(false) },
            Tuning { piece: Some(149), sorted: Some(true) },
        ] {
            let device = OpenClBackend { tuning, ..OpenClBackend::new(opencl, Arc::clone(&tracer)) };
            assert!(ask(&device) == expected, "{tuning:?}");
        }
    }

    #[test]
    #[ignore = "needs an OpenCL device: run tests/all"]
    fn neither_pieces_nor_the_order_of_rays_change_a_bit() {
        let opencl = OpenCl::open(&[]).unwrap();
        pieces_and_orders::<3>(&opencl);
        pieces_and_orders::<4>(&opencl);
    }

    #[test]
    #[ignore = "needs an OpenCL device: run tests/all"]
    fn devices_get_the_mesh_when_rays_are_asked_for() {
        let opencl = OpenCl::open(&[]).unwrap();
        let surface = Surface::<3> {
            vertices: (0..3).map(|i| Vector64::from_fn(|k, _| f64::from(u8::from(i == k)))).collect(),
            simplices: vec![[0, 1, 2]],
            normals: None,
        };
        let mut builder = MeshBuilder::new();
        builder.add("one", [1.0; 3], &surface, Orientation::Input).unwrap();
        let device = OpenClBackend::new(&opencl, Tracer::new(builder.finish()));
        assert!(device.scene.get().is_none());
        let ray = Ray::new(Vector::zeros(), Vector::from_element(1.0));
        assert_eq!(device.first_hits(&[ray], None, &Silent), Ok(vec![0]));
        assert!(device.scene.get().is_some());
    }
}
