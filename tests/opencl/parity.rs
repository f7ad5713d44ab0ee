//! The same bits as on the processor.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::on_rays::{on_rays, stars_on_rays};
use super::smaller;
use ao4d::accel::Tracer;
use ao4d::geometry::{Ray, Vector, Vector64};
use ao4d::mesh::{Mesh, MeshBuilder, Orientation, Surface};
use ao4d::occlusion::Estimator;
use ao4d::pipeline::{Backend, Pipeline, run};
use ao4d::progress::Silent;
use ao4d::trace::cpu::{CpuBackend, ScalarBackend};
use ao4d::trace::opencl::{OpenCl, OpenClBackend};
use ao4d::trace::{Error, NOTHING, RayBackend, Sampler, Sampling, ShadingPoint, Target};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

/// All files of a folder but the cache.
fn contents(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.file_name().is_some_and(|name| name != ".ao4d-cache.json"));
    files.sort();
    files.iter().map(|path| (path.file_name().unwrap().into(), std::fs::read(path).unwrap())).collect()
}

fn same_files(path: &Path, overrides: &[&str]) {
    let overrides: Vec<String> = overrides.iter().map(|s| s.to_string()).collect();
    let mut found = Vec::new();
    for backend in [Backend::Cpu, Backend::OpenCl(Vec::new())] {
        let folder = tempfile::tempdir().unwrap();
        let pipeline = Pipeline::load(path, &overrides, Some(folder.path().to_owned())).unwrap();
        let settings = ao4d::pipeline::Settings { backend, ..Default::default() };
        run(&pipeline, &settings, &Silent).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        found.push(contents(folder.path()));
    }
    let (cpu, opencl) = (&found[0], &found[1]);
    assert!(!cpu.is_empty() && cpu.len() == opencl.len());
    for ((name, bytes), (_, other)) in cpu.iter().zip(opencl) {
        assert!(bytes == other, "{}: {} differs", path.display(), name.display());
    }
}

#[test]
#[ignore = "needs an OpenCL device: run tests/all"]
fn every_pipeline_gives_the_same_files() {
    // The lessons are more of the same stages; what `bounce` is about is traced on the processor anyway.
    let is_left_out = |path: &Path| path.iter().any(|part| part == "lessons" || part == "bounce.yaml");
    for path in smaller::pipelines().into_iter().filter(|path| !is_left_out(path)) {
        let overrides = smaller::smaller(&path);
        same_files(&path, &overrides.iter().map(String::as_str).collect::<Vec<_>>());
    }
}

const SCENE: &str = "name: p
seed: 3
stages:
  - scene:
      DIMENSION
      objects:
        - cut_cube: {min: LOW, max: HIGH, cuts: [{from: FROM, to: HIGH}], subdivisions: 3}
        - box: {min: SMALL, max: MIDDLE}
  - occlusion: {id: ao, OCCLUSION, file: ao.f32}
  - render: {id: image, dimensions: SIZE, SHADING, visibility: ray_cast}
  - write: {vti: image.vti, vtu: scene.vtu, arrays: [rgba, ambient_occlusion, opacity, depth, object, normal]}
";

#[test]
#[ignore = "needs an OpenCL device: run tests/all"]
fn methods_and_shadings() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.yaml");
    for dimension in [3, 4] {
        let vector = |x: f64| format!("{:?}", vec![x; dimension]);
        for (occlusion, shading) in [
            ("samples: 100", "shading: smooth"),
            ("method: random, samples: 70, max_distance: 0.6", "shading: voxel"),
            ("target_error: 0.02, max_samples: 900", "shading: voxel"),
            ("method: adaptive, samples: 64", "shading: voxel"),
            ("method: exact", "shading: voxel"),
            ("method: as_published, samples: 16", "shading: flat"),
            ("samples: 1", "shading: voxel"),
        ] {
            let text = SCENE
                .replace("DIMENSION", &format!("dimension: {dimension}"))
                .replace("LOW", &vector(-0.6))
                .replace("HIGH", &vector(0.6))
                .replace("FROM", &vector(0.1))
                .replace("SMALL", &vector(0.15))
                .replace("MIDDLE", &vector(0.35))
                .replace("SIZE", if dimension == 3 { "[24, 20]" } else { "[9, 8, 7]" })
                .replace("OCCLUSION", occlusion)
                .replace("SHADING", shading);
            let eye = if dimension == 3 { "camera: {eye: [2, 1.5, 1.8]}" } else { "camera: {eye: [1, 0.8, 0.9, 2]}" };
            std::fs::write(&path, text.replace("visibility:", &format!("{eye}, visibility:"))).unwrap();
            same_files(&path, &[]);
        }
    }
}

fn vector<const D: usize>(random: &mut ChaCha8Rng, size: f64) -> Vector64<D> {
    Vector64::from_fn(|_, _| (random.random::<f64>() - 0.5) * 2.0 * size)
}

/// Simplices anywhere; on a lattice, so that much coincides, if `step` is not 0.
fn soup<const D: usize>(
    random: &mut ChaCha8Rng,
    count: usize,
    size: f64,
    step: f64,
    factor: f64,
    offset: f64,
) -> Mesh<D> {
    let mut surface = Surface { vertices: Vec::new(), simplices: Vec::new(), normals: None };
    for s in 0..count as u32 {
        let centre = vector::<D>(random, 1.0);
        for _ in 0..D {
            let point = centre + vector::<D>(random, size);
            let point = if step > 0.0 { point.map(|x| (x / step).round() * step) } else { point };
            surface.vertices.push(point.map(|x| x * factor + offset));
        }
        surface.simplices.push(std::array::from_fn(|i| s * D as u32 + i as u32));
    }
    let mut builder = MeshBuilder::new();
    builder.add("soup", [1.0; 3], &surface, Orientation::Input).unwrap();
    builder.finish()
}

fn soups<const D: usize>(opencl: &OpenCl) {
    let mut random = ChaCha8Rng::seed_from_u64(8);
    let sobol = Sampling::new(130, 5);
    let cases = [
        (0, 0.5, 0.0, 1.0, 0.0),
        (1, 0.5, 0.0, 1.0, 0.0),
        (40, 0.8, 0.0, 1.0, 0.0),
        (400, 0.2, 0.0, 1.0, 0.0),
        (60, 0.7, 0.25, 1.0, 0.0),
        (60, 0.7, 0.0, 1e-6, 0.0),
        (60, 0.7, 0.0, 1e6, 0.0),
        (60, 0.7, 0.0, 1.0, 1e5),
        (60, 0.7, 0.0, 1e-30, 0.0),
        (60, 0.7, 0.0, 1e25, 0.0),
        // Some vertices vanish beside the rest when scaled.
        (60, 0.7, 0.5, 1e27, 1e-15),
    ];
    for (count, size, step, factor, offset) in cases {
        let mesh = soup::<D>(&mut random, count, size, step, factor, offset);
        let tracer = Arc::new(Tracer::new(mesh));
        let mesh = tracer.mesh();
        let device = OpenClBackend::new(opencl, tracer.clone());
        let name = format!("{D}D, {count} simplices, step {step}, times {factor:e}, plus {offset:e}");
        let mut points = ShadingPoint::vertices(mesh);
        for simplex in 0..mesh.simplices.len() as u32 {
            // In double precision, as sums of large coordinates overflow.
            let sum = mesh.corners(simplex).iter().fold(Vector64::<D>::zeros(), |sum, c| sum + c.map(f64::from));
            let normal = vector::<D>(&mut random, 1.0).normalize().map(|x| x as f32);
            let position = (sum / D as f64).map(|x| x as f32);
            points.push(ShadingPoint::Inside { position, normal, simplex, number: u64::from(simplex) });
        }
        for sampling in [
            sobol,
            Sampling { target: Some(Target { error: 0.03 }), ..sobol },
            Sampling { sampler: Sampler::Random, max_distance: 0.5 * factor as f32, ..sobol },
        ] {
            let estimate = |backend: &dyn RayBackend<D>| {
                Estimator::Sampled(sampling).estimate(backend, &points, None, &Silent).unwrap()
            };
            let slow = estimate(&ScalarBackend::new(tracer.clone()));
            assert_eq!(estimate(&CpuBackend::new(tracer.clone())), slow, "{name}");
            assert_eq!(estimate(&device), slow, "{name}");
        }
        let rays: Vec<Ray<D>> = (0..3000)
            .map(|k| {
                let origin = vector::<D>(&mut random, 2.0 * factor).map(|x| (x + offset) as f32);
                let aim = |random: &mut ChaCha8Rng| mesh.vertices[random.random_range(0..mesh.vertices.len())];
                let direction = if k % 2 == 0 && count > 0 {
                    (aim(&mut random) - origin).map(|x| (f64::from(x) / factor) as f32)
                } else {
                    vector::<D>(&mut random, 1.0).map(|x| x as f32)
                };
                Ray::new(origin, direction)
            })
            .filter(|ray| ray.direction.amax() > 0.0)
            .collect();
        // Layer after layer: what is hit first, then what is behind that, and so on.
        let hits =
            |backend: &dyn RayBackend<D>, after: Option<&[u32]>| backend.first_hits(&rays, after, &Silent).unwrap();
        let cpu = CpuBackend::new(tracer.clone());
        let mut after = hits(&device, None);
        for (ray, simplex) in rays.iter().zip(&after) {
            let expected = tracer.closest_hit(ray).map_or(NOTHING, |hit| hit.simplex);
            assert_eq!(*simplex, expected, "{name}");
        }
        for layer in 1..5 {
            let found = hits(&device, Some(&after));
            assert_eq!(found, hits(&cpu, Some(&after)), "{name}, layer {layer}");
            after = found;
        }
        println!("{name}: {} rays left to the host", device.settled());
    }
}

#[test]
#[ignore = "needs an OpenCL device: run tests/all"]
fn random_soups_at_all_scales() {
    let opencl = OpenCl::open(&[]).unwrap();
    soups::<3>(&opencl);
    soups::<4>(&opencl);
}

fn close_calls<const D: usize>(opencl: &OpenCl) {
    for (points, simplices, samples, offset) in [(4000, 2, 64, 0.0), (100, 30, 64, 0.0), (200, 6, 64, 700.0)] {
        for max_distance in [f32::INFINITY, 0.03] {
            let sampling = Sampling { max_distance, ..Sampling::new(samples, 5) };
            let (mesh, points) = on_rays::<D>(points, simplices, offset, &sampling);
            let tracer = Arc::new(Tracer::new(mesh));
            let slow = ScalarBackend::new(tracer.clone()).open_fractions(&points, &sampling, &Silent).unwrap();
            for sets in [false, true] {
                let device = OpenClBackend::new(opencl, tracer.clone()).in_sets(sets);
                let found = device.open_fractions(&points, &sampling, &Silent).unwrap();
                assert!(found == slow, "{D}D, {simplices} simplices a point, {offset}, {max_distance}, sets: {sets}");
            }
        }
    }
    for (vertices, samples, offset) in [(4000, 64, 0.0), (300, 1024, 0.0), (500, 64, 700.0)] {
        let sampling = Sampling::new(samples, 5);
        let (mesh, points) = stars_on_rays::<D>(vertices, offset, &sampling);
        let tracer = Arc::new(Tracer::new(mesh));
        let slow = ScalarBackend::new(tracer.clone()).open_fractions(&points, &sampling, &Silent).unwrap();
        let open = slow.iter().map(|estimate| estimate.value).sum::<f32>() / slow.len() as f32;
        assert!((0.02..0.98).contains(&open), "{D}D, {offset}: {open} is open");
        for sets in [false, true] {
            let device = OpenClBackend::new(opencl, tracer.clone()).in_sets(sets);
            let found = device.open_fractions(&points, &sampling, &Silent).unwrap();
            assert!(found == slow, "{D}D, {vertices} stars, {samples} rays, {offset}, sets: {sets}");
        }
    }
}

#[test]
#[ignore = "needs an OpenCL device: run tests/all"]
fn rays_that_all_but_miss_a_corner_are_those_of_the_slow_twin() {
    let opencl = OpenCl::open(&[]).unwrap();
    close_calls::<3>(&opencl);
    close_calls::<4>(&opencl);
}

#[test]
#[ignore = "needs an OpenCL device: run tests/all"]
fn directions_are_made_there_and_few_rays_are_left_here() {
    let opencl = OpenCl::open(&[]).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(9);
    let mesh = soup::<4>(&mut random, 2000, 0.1, 0.0, 1.0, 0.0);
    let tracer = Arc::new(Tracer::new(mesh));
    let device = OpenClBackend::new(&opencl, tracer.clone());
    assert!(device.makes_directions().unwrap());
    let sampling = Sampling::new(64, 5);
    let points: Vec<ShadingPoint<4>> = (0..8000).map(ShadingPoint::Vertex).collect();
    let first = device.open_fractions(&points, &sampling, &Silent).unwrap();
    assert!(device.settled() < 8000 * 64 / 100, "{} of {} rays", device.settled(), 8000 * 64);
    // Once more, and in another order: the same.
    assert_eq!(first, device.open_fractions(&points, &sampling, &Silent).unwrap());
    let back: Vec<ShadingPoint<4>> = points.iter().rev().copied().collect();
    let mut backwards = device.open_fractions(&back, &sampling, &Silent).unwrap();
    backwards.reverse();
    assert_eq!(first, backwards);
    // And by two devices together, or one opened twice.
    let two = OpenCl::open(&[(0, 0), (0, 0)]).unwrap();
    let device = OpenClBackend::new(&two, tracer.clone());
    assert_eq!(first, device.open_fractions(&points, &sampling, &Silent).unwrap());
    let mesh = tracer.mesh();
    let ray = |k: usize| Ray::new(mesh.vertices[k], mesh.vertices[(k * 7 + 1) % 8000] - mesh.vertices[k]);
    let rays: Vec<Ray<4>> = (0..4000).map(ray).collect();
    let found = device.first_hits(&rays, None, &Silent).unwrap();
    assert!(rays.iter().zip(found).all(|(r, f)| f == tracer.closest_hit(r).map_or(u32::MAX, |hit| hit.simplex)));
}

/// The kernels' boxes are made for origins in the scene; other points are left to the host.
#[test]
#[ignore = "needs an OpenCL device: run tests/all"]
fn points_far_from_the_scene_see_what_the_slow_twin_sees() {
    let opencl = OpenCl::open(&[]).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let tracer = Arc::new(Tracer::new(soup::<4>(&mut random, 400, 2.0, 0.0, 1.0, 0.0)));
    let away = |number: u64| {
        let position = vector::<4>(&mut ChaCha8Rng::seed_from_u64(number), 1.0).normalize().map(|x| 9.0 * x as f32);
        ShadingPoint::Inside { position, normal: -position.normalize(), simplex: 0, number }
    };
    let points: Vec<ShadingPoint<4>> = (0..20).map(away).collect();
    let sampling = Sampling::new(2048, 5);
    let slow = ScalarBackend::new(tracer.clone()).open_fractions(&points, &sampling, &Silent).unwrap();
    assert!(slow.iter().any(|estimate| estimate.value < 1.0));
    for sets in [false, true] {
        let device = OpenClBackend::new(&opencl, tracer.clone()).in_sets(sets);
        assert!(device.open_fractions(&points, &sampling, &Silent).unwrap() == slow, "sets: {sets}");
    }
}

/// A mesh without any simplex that could be hit.
#[test]
#[ignore = "needs an OpenCL device: run tests/all"]
fn where_there_is_nothing_all_rays_are_open() {
    let opencl = OpenCl::open(&[]).unwrap();
    let corner = |x: f64| Vector64::<3>::from_element(x);
    let surface =
        Surface { vertices: [0.0, 0.25, 0.5].map(corner).to_vec(), simplices: vec![[0, 1, 2]], normals: None };
    let mut builder = MeshBuilder::new();
    builder.add("flat", [0.8; 3], &surface, Orientation::Input).unwrap();
    let tracer = Arc::new(Tracer::new(builder.finish()));
    let (position, normal) = (Vector::from_element(0.25), Vector::from_fn(|axis, _| f32::from(axis == 2)));
    let points: Vec<ShadingPoint<3>> =
        (0..3).map(|number| ShadingPoint::Inside { position, normal, simplex: 0, number }).collect();
    for sets in [false, true] {
        let device = OpenClBackend::new(&opencl, tracer.clone()).in_sets(sets);
        let found = device.open_fractions(&points, &Sampling::new(100, 5), &Silent).unwrap();
        assert!(found.iter().all(|estimate| estimate.value == 1.0), "sets: {sets}: {found:?}");
        let ray = Ray::new(Vector::zeros(), Vector::from_element(0.5));
        assert_eq!(device.first_hits(&[ray], None, &Silent), Ok(vec![u32::MAX]));
    }
}

/// Stops at once.
struct Stop;

impl ao4d::progress::Progress for Stop {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, _steps: u64) {}
    fn end(&self) {}
    fn cancelled(&self) -> bool {
        true
    }
}

#[test]
#[ignore = "needs an OpenCL device: run tests/all"]
fn it_can_be_stopped() {
    let opencl = OpenCl::open(&[]).unwrap();
    let mesh = soup::<4>(&mut ChaCha8Rng::seed_from_u64(1), 100, 0.2, 0.0, 1.0, 0.0);
    let points = ShadingPoint::vertices(&mesh);
    let device = OpenClBackend::new(&opencl, Tracer::new(mesh));
    let stopped = Estimator::Sampled(Sampling::new(64, 5)).estimate(&device, &points, None, &Stop);
    assert_eq!(stopped, Err(ao4d::occlusion::Error::Cancelled));
    let ray = Ray::new(Vector::zeros(), Vector::from_element(0.5));
    assert_eq!(device.first_hits(&[ray], None, &Stop), Err(Error::Cancelled));
}
