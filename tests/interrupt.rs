//! The wish to stop is heard within a second, be it in the middle of a single point that takes minutes. What counts is the
//! processor's time of each thread: on a busy machine the clock tells how long others took.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use ao4d::accel::Tracer;
use ao4d::geometry::Vector;
use ao4d::mesh::Mesh;
use ao4d::occlusion::exact::Budget;
use ao4d::occlusion::{Deviations, Error, Estimator};
use ao4d::progress::Progress;
use ao4d::trace::cpu::{CpuBackend, ScalarBackend};
use ao4d::trace::{RayBackend, Sampling, ShadingPoint, Target};
use rustix::time::{ClockId, clock_gettime};

mod support;

use support::{Random, mesh};

/// Wishes to stop when told so.
struct Watch(AtomicBool);

impl Progress for Watch {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, _steps: u64) {}
    fn end(&self) {}
    fn cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Seconds of this process, a thread.
fn cpu_seconds() -> f64 {
    let t = clock_gettime(ClockId::ProcessCPUTime);
    (t.tv_sec as f64 + 1e-9 * t.tv_nsec as f64) / rayon::current_num_threads() as f64
}

/// Wishes to stop a while after the start; tells the seconds from there to the end, and none if there was nothing to stop any more.
fn stopped<const D: usize>(
    wait: Duration,
    estimator: Estimator,
    backend: &dyn RayBackend<D>,
    points: &[ShadingPoint<D>],
) -> Option<f64> {
    let watch = Watch(AtomicBool::new(false));
    let (found, seconds) = std::thread::scope(|scope| {
        let work = scope.spawn(|| estimator.estimate(backend, points, None, &watch));
        std::thread::sleep(wait);
        let wished = cpu_seconds();
        watch.0.store(true, Ordering::Relaxed);
        let found = work.join().unwrap();
        (found, cpu_seconds() - wished)
    });
    match found {
        Ok(_) => None,
        Err(error) => {
            assert_eq!(error, Error::Cancelled, "{D}D, {estimator:?}");
            Some(seconds)
        }
    }
}

/// The wish to stop is heard within a second. How long the work would take depends on the machine, so the wish comes sooner where the
/// work was done before it.
fn stops<const D: usize>(what: &str, estimator: Estimator, backend: &dyn RayBackend<D>, points: &[ShadingPoint<D>]) {
    backend.tracer().prepare_wide();
    let waits = [300, 100, 30, 10, 3, 1].map(Duration::from_millis);
    let stopped = waits.iter().find_map(|&wait| Some((wait, stopped(wait, estimator, backend, points)?)));
    let Some((wait, seconds)) = stopped else {
        panic!("{D}D, {what}, {estimator:?}: it takes less than a millisecond, or does not hear the wish to stop");
    };
    println!("{D}D, {what}, {estimator:?}: {seconds:.3} s, after {wait:?}");
    assert!(seconds < 1.0, "{D}D, {what}, {estimator:?}: it took {seconds} s to stop");
}

fn inside<const D: usize>(mesh: &Mesh<D>, simplex: u32) -> ShadingPoint<D> {
    let position = mesh.corners(simplex).into_iter().sum::<Vector<D>>() / D as f32;
    let normal = mesh.normals[mesh.simplices[simplex as usize][0] as usize];
    ShadingPoint::Inside { position, normal, simplex, number: 0 }
}

fn single_points_stop<const D: usize>() {
    let tracer = Arc::new(Tracer::new(mesh::<D>(&Random(3).soup(2000, 1.0, false))));
    let many = Sampling::new(1 << 24, 1);
    let unreachable = Sampling { target: Some(Target { error: 1e-9 }), ..many };
    let estimators = [
        Estimator::Sampled(many),
        Estimator::Sampled(unreachable),
        Estimator::Sampled(Sampling::random(1 << 24, 1)),
        Estimator::Adaptive(many),
        Estimator::AsPublished(many, Deviations::PUBLISHED),
        Estimator::AsPublished(many, Deviations::NONE),
        Estimator::Exact(Budget { cones: usize::MAX }),
    ];
    let (cpu, scalar) = (CpuBackend::new(tracer.clone()), ScalarBackend::new(tracer.clone()));
    for estimator in estimators {
        for point in [ShadingPoint::Vertex(17), inside(tracer.mesh(), 17)] {
            stops("one point", estimator, &cpu, &[point]);
        }
    }
    stops("one point, ray by ray", Estimator::Sampled(many), &scalar, &[ShadingPoint::Vertex(17)]);
}

#[test]
fn one_point_stops_within_a_second() {
    single_points_stop::<3>();
    single_points_stop::<4>();
}

/// All points of a larger scene, whose closed forms have much to look at before the first piece is cut.
fn scenes_stop<const D: usize>() {
    let tracer = Arc::new(Tracer::new(mesh::<D>(&Random(4).soup(60_000, 0.05, false))));
    let points = ShadingPoint::vertices(tracer.mesh());
    let cpu = CpuBackend::new(tracer);
    for estimator in [
        Estimator::Sampled(Sampling::new(1 << 16, 1)),
        Estimator::Adaptive(Sampling::new(1 << 16, 1)),
        Estimator::AsPublished(Sampling::new(1 << 16, 1), Deviations::PUBLISHED),
        Estimator::Exact(Budget { cones: usize::MAX }),
    ] {
        stops("a scene", estimator, &cpu, &points);
    }
}

#[test]
fn a_scene_stops_within_a_second() {
    scenes_stop::<3>();
    scenes_stop::<4>();
}
