//! A mesh on devices, and first hits there.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock, PoisonError};
use std::time::Duration;

use rayon::prelude::*;

use super::device::Argument;
use super::error::Error;
use super::layout::{self, Float4, float4};
use super::open::OpenCl;
use super::scene::{Part, Scene, Tuning, is_exact};
use crate::accel::{Scale, Tracer};
use crate::geometry::{Cone, Ray};
use crate::progress::{Cancelled, Progress};
use crate::trace::backend::{Error as TraceError, NOTHING, RayBackend};
use crate::trace::cpu::{CpuBackend, first_hit};
use crate::trace::estimate::Estimate;
use crate::trace::point::ShadingPoint;
use crate::trace::sampling::Sampling;

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

impl<const D: usize> OpenClBackend<D> {
    /// Keeps the mesh for the devices.
    pub fn new(opencl: &OpenCl, tracer: impl Into<Arc<Tracer<D>>>) -> Self {
        let tracer = tracer.into();
        let scale = Scale::of(&tracer.mesh().vertices);
        let (opencl, scene, settled) = (opencl.clone(), OnceLock::new(), AtomicU64::new(0));
        Self { opencl, tuning: Tuning::default(), tracer, scale, scene, settled }
    }

    /// The same, with rays traced in sets, as processors want them, or one by one, as graphics processors do; whatever the devices are. For tests.
    #[doc(hidden)]
    pub fn in_sets(mut self, sets: bool) -> Self {
        self.tuning.sets = Some(sets);
        self
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

    /// How long the devices have worked on what was asked so far, their kernels alone: without preparations, transfers and what
    /// the host settles. Devices that work side by side count each for itself.
    pub fn busy(&self) -> Duration {
        let Some(Ok(scene)) = self.scene.get() else { return Duration::ZERO };
        scene.parts.iter().map(|part| part.device.busy()).sum()
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
            let state = &mut *on_device;
            let room = &mut state.room;
            let origins = on.device.filled(&mut room.origins, &origins, "rays")?;
            let directions = on.device.filled(&mut room.directions, &directions, "rays")?;
            let passed = on.device.filled(&mut room.passed, &passed, "simplices that rays have passed")?;
            let bounds = on.device.filled(&mut room.bounds, &bounds, "distances that rays have passed")?;
            let out = on.device.room(&mut room.hits, part.len(), "results")?;
            let mut arguments = state.mesh.arguments();
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
            on.device.read(out, found)?;
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Vector, Vector64};
    use crate::mesh::{MeshBuilder, Orientation, Surface};
    use crate::progress::Silent;

    fn pieces_and_lanes<const D: usize>(opencl: &OpenCl) {
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
            Tuning { piece: None, lanes: Some(2), sets: Some(false) },
            Tuning { piece: Some(60), lanes: Some(1), sets: Some(true) },
            Tuning { piece: Some(149), lanes: Some(3), sets: Some(false) },
            Tuning { piece: None, lanes: Some(2), sets: Some(true) },
        ] {
            let device = OpenClBackend { tuning, ..OpenClBackend::new(opencl, Arc::clone(&tracer)) };
            assert!(ask(&device) == expected, "{tuning:?}");
        }
    }

    #[test]
    #[ignore = "needs an OpenCL device: run tests/all"]
    fn neither_pieces_nor_lanes_change_a_bit() {
        let opencl = OpenCl::open(&[]).unwrap();
        pieces_and_lanes::<3>(&opencl);
        pieces_and_lanes::<4>(&opencl);
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
