//! One table of ambient occlusion: scenes x methods x backends x dimensions, each with the value that is known and how far it may
//! be off.
//!
//! A row is a scene of boxes and balls, a ray that finds the point, the value in closed form, and what the scene itself is
//! off by (a tessellated ball is no ball, a wide wall no infinite one). Every method has a tolerance of its own.

use std::path::Path;
use std::sync::Arc;

use ao4d::accel::Tracer;
use ao4d::geometry::{Ray, Vector, narrow, normal_of, widen};
use ao4d::mesh::{Mesh, MeshBuilder, Orientation, normals::unit};
use ao4d::occlusion::{Estimator, exact::Budget};
use ao4d::progress::Silent;
use ao4d::scene::{ObjectSpec, build_object};
use ao4d::trace::cpu::{CpuBackend, Level, ScalarBackend};
use ao4d::trace::opencl::{OpenCl, OpenClBackend};
use ao4d::trace::{NOTHING, RayBackend, Sampler, Sampling, ShadingPoint};
use serde_json::{Value, json};

struct Row {
    name: &'static str,
    objects: Vec<Value>,
    /// Where a ray starts that goes along -x and meets the point, and how far the point lies from the first axis there.
    from: Vec<f64>,
    expected: f64,
    tolerance: f64,
}

/// A vector of dimension D: these numbers, then the last again and again.
fn all<const D: usize>(numbers: &[f64]) -> Vec<f64> {
    (0..D).map(|i| *numbers.get(i).or(numbers.last()).unwrap()).collect()
}

fn rows<const D: usize>() -> Vec<Row> {
    let cuboid = |low: &[f64], high: &[f64]| json!({"box": {"min": all::<D>(low), "max": all::<D>(high)}});
    // Its upper side is x = 0.
    let floor = || cuboid(&[-1.0, -1e3], &[0.0, 1e3]);
    let ball = |radius: f64, height: f64| {
        let translate = json!({"translate": all::<D>(&[height, 0.0])});
        json!({"hypersphere": {"radius": radius, "subdivisions": 4}, "transform": [translate]})
    };
    let above = |y: f64| all::<D>(&[1e-3, y, 0.3]);
    let share = |x: f64| x.powi(D as i32 - 1);
    vec![
        Row { name: "a floor alone", objects: vec![floor()], from: above(0.1), expected: 1.0, tolerance: 0.0 },
        Row {
            name: "the inside of a closed box",
            objects: vec![floor(), cuboid(&[-2.0, -2e3], &[5.0, 2e3])],
            from: above(0.1),
            expected: 0.0,
            tolerance: 0.0,
        },
        Row {
            name: "the foot of a wall at a right angle",
            objects: vec![floor(), cuboid(&[-0.5, 0.0, -1e3], &[1e3, 2.0, 1e3])],
            from: above(-1e-3),
            expected: 0.5,
            tolerance: 2e-3,
        },
        Row {
            name: "a ball straight above",
            objects: vec![floor(), ball(1.0, 2.0)],
            from: all::<D>(&[1e-3, 0.0]),
            expected: 1.0 - share(0.5),
            tolerance: 0.02,
        },
        Row {
            name: "a ball aside, above the horizon",
            objects: vec![floor(), ball(0.5, 2.0)],
            from: all::<D>(&[1e-3, 1.5, 0.0]),
            expected: 1.0 - share(0.5 / 2.5) * 2.0 / 2.5,
            tolerance: 0.01,
        },
    ]
}

/// The methods, and how far each may be off.
fn methods() -> Vec<(&'static str, Estimator, f64)> {
    let sampling = |sampler, samples| Sampling { sampler, ..Sampling::new(samples, 1) };
    vec![
        ("sobol", Estimator::Sampled(sampling(Sampler::Sobol, 1 << 12)), 0.01),
        ("random", Estimator::Sampled(sampling(Sampler::Random, 1 << 12)), 0.03),
        ("adaptive", Estimator::Adaptive(sampling(Sampler::Sobol, 1 << 12)), 0.01),
        ("exact", Estimator::Exact(Budget::default()), 1e-6),
    ]
}

fn mesh<const D: usize>(objects: &[Value]) -> Mesh<D> {
    let mut builder = MeshBuilder::<D>::new();
    for (i, object) in objects.iter().enumerate() {
        let spec: ObjectSpec = serde_json::from_value(object.clone()).unwrap();
        let surface = build_object::<D>(&spec, Path::new("")).unwrap();
        builder.add(&i.to_string(), [0.8; 3], &surface, Orientation::Input).unwrap();
    }
    builder.finish()
}

/// The point that a ray along -x meets, on the side that the ray comes from.
fn point<const D: usize>(tracer: &Arc<Tracer<D>>, from: &[f64]) -> ShadingPoint<D> {
    let origin = Vector::from_fn(|i, _| from[i] as f32);
    let ray = Ray::new(origin, Vector::from_fn(|i, _| if i == 0 { -1.0 } else { 0.0 }));
    let hit = tracer.closest_hit(&ray).unwrap();
    assert_ne!(hit.simplex, NOTHING);
    let normal = normal_of(&tracer.mesh().corners(hit.simplex).map(|v| widen(&v)));
    let normal = if normal[0] < 0.0 { -normal } else { normal };
    ShadingPoint::Inside { position: narrow(&ray.at(hit.t)), normal: unit(&normal), simplex: hit.simplex, number: 7 }
}

/// Holds every row against every method on the backends that `backends` makes.
fn table<const D: usize>(backends: impl Fn(&Arc<Tracer<D>>) -> Vec<(String, Box<dyn RayBackend<D>>)>) {
    for row in rows::<D>() {
        let tracer = Arc::new(Tracer::new(mesh::<D>(&row.objects)));
        let point = point(&tracer, &row.from);
        for (method, estimator, off) in methods() {
            let mut first: Option<u32> = None;
            for (backend, rays) in backends(&tracer) {
                let found = estimator.estimate(&*rays, &[point], None, &Silent).unwrap().values[0];
                let least = (f64::from(found) - row.expected).abs();
                assert!(least <= row.tolerance + off, "{D}D, {}, {method}, {backend}: {found}", row.name);
                // Backends differ in speed alone.
                assert_eq!(*first.get_or_insert(found.to_bits()), found.to_bits(), "{}, {method}, {backend}", row.name);
            }
        }
    }
}

fn processors<const D: usize>(tracer: &Arc<Tracer<D>>) -> Vec<(String, Box<dyn RayBackend<D>>)> {
    let mut all: Vec<(String, Box<dyn RayBackend<D>>)> =
        vec![("ray by ray".into(), Box::new(ScalarBackend::new(Arc::clone(tracer))))];
    for level in Level::available() {
        all.push((format!("{level:?}"), Box::new(CpuBackend::with_level(Arc::clone(tracer), level))));
    }
    all
}

#[test]
fn on_processors() {
    table::<3>(processors);
    table::<4>(processors);
}

#[test]
#[ignore = "needs an OpenCL device: run tests/all"]
fn on_devices() {
    let opencl = OpenCl::open(&[]).unwrap();
    let device = |tracer: &Arc<Tracer<3>>| -> (String, Box<dyn RayBackend<3>>) {
        ("OpenCL".into(), Box::new(OpenClBackend::new(&opencl, Arc::clone(tracer))))
    };
    table::<3>(|tracer| [processors(tracer), vec![device(tracer)]].into_iter().flatten().collect());
    let device = |tracer: &Arc<Tracer<4>>| -> (String, Box<dyn RayBackend<4>>) {
        ("OpenCL".into(), Box::new(OpenClBackend::new(&opencl, Arc::clone(tracer))))
    };
    table::<4>(|tracer| [processors(tracer), vec![device(tracer)]].into_iter().flatten().collect());
}
