//! What voxels see: scan conversion and ray casting on spheres of tetrahedra, as NTracer's scene, in millions of voxels
//! per second.
//!
//! ```text
//! cargo bench --bench visibility -- [--subdivisions 4,9,18] [--dimensions 128x128x64,128x128x128] [--threads 1,2]
//!                                   [--view 90]
//! ```
//!
//! The sphere of radius 1 is seen from a distance of 3, as in NTracer's scene (16 n^3 tetrahedra; 18 gives 93,312). Times
//! are the best of some repeats: `wall` by the clock, `cpu` of all threads together, which other work on the
//! machine disturbs less. Below each way stands what eight layers take, with the number of surfaces in all of them.
//! Hierarchy and boxes are told apart; both are made once a picture. Below stand rays of ambient
//! occlusion, 64 at each vertex, in millions a second, and the share that escapes: nearly all, as of NTracer's shadow rays.

use std::sync::Arc;
use std::time::Instant;

use ao4d::accel::Tracer;
use ao4d::geometry::Vector64;
use ao4d::mesh::{Mesh, MeshBuilder, Orientation};
use ao4d::occlusion::{Estimates, Estimator};
use ao4d::progress::Silent;
use ao4d::render::visibility::Method;
use ao4d::render::{Aov, Camera, NOTHING, Projection, Renderer, Shading, View};
use ao4d::scene::{ObjectSpec, build_object};
use ao4d::trace::cpu::CpuBackend;
use ao4d::trace::{RayBackend, Sampling, ShadingPoint};
use rustix::time::{ClockId, clock_gettime};

fn cpu_seconds() -> f64 {
    let t = clock_gettime(ClockId::ProcessCPUTime);
    t.tv_sec as f64 + 1e-9 * t.tv_nsec as f64
}

/// Seconds of the clock and of all threads: the least of some repeats.
fn time<T>(mut work: impl FnMut() -> T) -> (T, f64, f64) {
    let (mut wall, mut cpu) = (f64::INFINITY, f64::INFINITY);
    let begin = Instant::now();
    loop {
        let (start, used) = (Instant::now(), cpu_seconds());
        let result = work();
        wall = wall.min(start.elapsed().as_secs_f64());
        cpu = cpu.min(cpu_seconds() - used);
        if begin.elapsed().as_secs_f64() > 0.5 {
            return (result, wall, cpu);
        }
    }
}

fn sphere(subdivisions: u32) -> Mesh<4> {
    let description = serde_json::json!({"hypersphere": {"radius": 1.0, "subdivisions": subdivisions}});
    let spec: ObjectSpec = serde_json::from_value(description).expect("a sphere");
    let surface = build_object(&spec, ".".as_ref()).expect("a sphere");
    let mut builder = MeshBuilder::new();
    builder.add("sphere", [0.8; 3], &surface, Orientation::Input).expect("a sphere");
    builder.finish()
}

fn list(name: &str, default: &str) -> Vec<String> {
    let given: Vec<String> = std::env::args().collect();
    let value = given.iter().position(|a| a == name).and_then(|i| given.get(i + 1));
    value.map_or(default, String::as_str).split(',').map(str::to_owned).collect()
}

fn main() {
    println!(
        "tetrahedra  voxels         threads  way         prepare s   wall s    cpu s   Mvoxels/s (wall, cpu)  seen"
    );
    for n in list("--subdivisions", "4,9,18") {
        let mesh = Arc::new(sphere(n.parse().expect("a number")));
        for size in list("--dimensions", "128x128x64,128x128x128") {
            let d: Vec<usize> = size.split('x').map(|n| n.parse().expect("a number")).collect();
            let eye = Vector64::from([0.0, 0.0, 0.0, 3.0]);
            let field_of_view = list("--view", "90")[0].parse().expect("degrees");
            let projection = Projection::Perspective { field_of_view };
            let camera = Camera::new(&View { eye, projection, ..View::default() }).expect("a camera");
            let grid = camera.grid([d[0], d[1], d[2]]);
            for threads in list("--threads", "1,2") {
                let threads: usize = threads.parse().expect("a number");
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
                pool.install(|| {
                    let row = |way: &str, prepare: f64, wall: f64, cpu: f64, seen: usize| {
                        let rate = grid.len() as f64 * 1e-6;
                        println!(
                            "{:>10}  {size:13}  {threads:>7}  {way:10}  {prepare:9.4}  {wall:7.4}  {cpu:7.4}   {:9.2} {:9.2}    {seen}",
                            mesh.simplices.len(), rate / wall, rate / cpu
                        );
                    };
                    let backend: Arc<dyn RayBackend<4>> = Arc::new(CpuBackend::new(Tracer::new(Arc::clone(&mesh))));
                    for (way, method) in [("ray_cast", Method::RayCast), ("rasterize", Method::Rasterize)] {
                        let (_, prepare, _) = time(|| match method {
                            Method::RayCast => Tracer::new(Arc::clone(&mesh)).prepare(),
                            _ => drop(ao4d::render::Visibility::new(Arc::clone(&backend), &camera, &grid, method)),
                        });
                        let visibility = ao4d::render::Visibility::new(Arc::clone(&backend), &camera, &grid, method);
                        let layers = || 0..grid.dimensions[2];
                        let (hits, wall, cpu) =
                            time(|| visibility.first_hits(layers(), &Silent).expect("nobody cancels"));
                        row(way, prepare, wall, cpu, hits.iter().filter(|&&s| s != NOTHING).count());
                        let (passages, wall, cpu) =
                            time(|| visibility.passages(layers(), 8, &Silent).expect("nobody cancels"));
                        row("  8 layers", 0.0, wall, cpu, passages.all().len());
                    }
                    let count = mesh.vertices.len();
                    let estimates = Estimates { values: vec![0.5; count], errors: vec![0.0; count], rays: 0 };
                    let shading = Shading::Smooth(Arc::new(estimates));
                    let mut renderer = Renderer::new(Arc::clone(&backend), camera.clone(), grid.dimensions, shading);
                    let aovs = [Aov::Rgba, Aov::AmbientOcclusion, Aov::Opacity];
                    for supersample in [1, 2, 3] {
                        renderer.supersample = supersample;
                        let slab = |_| Ok::<(), ao4d::occlusion::Error>(());
                        let (_, wall, cpu) = time(|| renderer.render(&aovs, None, &Silent, slab).expect("a picture"));
                        row(&format!("shaded, {supersample}"), 0.0, wall, cpu, 0);
                    }
                    // The nearest alone, with depth and occlusion, and eight layers of them.
                    let aovs = [Aov::Depth, Aov::Object, Aov::AmbientOcclusion];
                    let of_layers = [Aov::LayerDepth, Aov::LayerObject, Aov::LayerAmbientOcclusion, Aov::LayerSide];
                    renderer.supersample = 1;
                    for (way, layers) in [("nearest", 0), ("8 layers", 8)] {
                        renderer.layers = layers;
                        let aovs = if layers == 0 { aovs.to_vec() } else { of_layers.to_vec() };
                        let slab = |_| Ok::<(), ao4d::occlusion::Error>(());
                        let (_, wall, cpu) = time(|| renderer.render(&aovs, None, &Silent, slab).expect("a picture"));
                        row(way, 0.0, wall, cpu, 0);
                    }
                    let sobol = Estimator::Sampled(Sampling::new(64, 1));
                    let points = ShadingPoint::vertices(&mesh);
                    let start = Instant::now();
                    backend.tracer().prepare_wide();
                    let prepare = start.elapsed().as_secs_f64();
                    let (values, wall, cpu) = time(|| {
                        sobol.estimate(&*backend, &points, None, &Silent).expect("nobody cancels").values
                    });
                    let rays = (64 * values.len()) as f64 * 1e-6;
                    println!(
                        "{:>10}  occlusion      {threads:>7}  {:>6.2} Mrays  {prepare:6.4}  {wall:7.4}  {cpu:7.4}   {:9.2} {:9.2}    {:.2} %",
                        mesh.simplices.len(), rays, rays / wall, rays / cpu,
                        100.0 * values.iter().sum::<f32>() / values.len() as f32
                    );
                });
            }
        }
    }
}
