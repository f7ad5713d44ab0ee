//! Ambient occlusion at visible points beside that at vertices, in millions of rays a second of the processor's time:
//!
//! ```text
//! cargo bench --bench visible_points [-- PIPELINE ...]
//! ```
//!
//! For the first picture of each pipeline: the points that its voxels see, evenly spread ones of them, and the vertices,
//! with 64 scrambled Sobol' rays each. Vertices and points in turn, the medians of the rounds.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use ao4d::accel::Tracer;
use ao4d::geometry::{Cone, narrow, normal_of, widen};
use ao4d::mesh::Mesh;
use ao4d::occlusion::Estimator;
use ao4d::pipeline::Pipeline;
use ao4d::progress::Silent;
use ao4d::render::{NOTHING, Visibility, visibility};
use ao4d::stages::camera::camera;
use ao4d::stages::render::RenderPlan;
use ao4d::stages::scene::{AnyMesh, ScenePlan};
use ao4d::trace::cpu::CpuBackend;
use ao4d::trace::{RayBackend, Sampling, ShadingPoint};
use rustix::time::{ClockId, clock_gettime};

const SAMPLES: u32 = 64;
/// At most about so many points of either kind.
const MOST: usize = 20_000;
const ROUNDS: usize = 5;
/// Seconds that a timing takes at least.
const SECONDS: f64 = 0.2;

fn cpu_seconds() -> f64 {
    let t = clock_gettime(ClockId::ProcessCPUTime);
    t.tv_sec as f64 + 1e-9 * t.tv_nsec as f64
}

/// Millions of rays a second of the processor's time.
fn rate<const D: usize>(backend: &dyn RayBackend<D>, points: &[ShadingPoint<D>]) -> f64 {
    let estimator = Estimator::Sampled(Sampling::new(SAMPLES, 1));
    let (start, mut rays) = (cpu_seconds(), 0);
    while cpu_seconds() - start < SECONDS {
        rays += estimator.estimate(backend, points, None, &Silent).expect("nobody cancels").rays;
    }
    rays as f64 / (cpu_seconds() - start) * 1e-6
}

/// Evenly spread ones.
fn some<T: Copy>(all: &[T]) -> Vec<T> {
    all.iter().copied().step_by(all.len().div_ceil(MOST).max(1)).collect()
}

fn measure<const D: usize>(name: &str, pipeline: &Pipeline, mesh: Mesh<D>) {
    let Some((_, render)) = pipeline.plan.all::<RenderPlan>().next() else { return };
    let backend: Arc<dyn RayBackend<D>> = Arc::new(CpuBackend::new(Tracer::new(mesh)));
    backend.tracer().prepare_wide();
    let mesh = backend.tracer().mesh();
    let camera = camera::<D>(&render.camera).expect("a camera");
    let grid = camera.grid(render.dimensions);
    let visibility = Visibility::new(Arc::clone(&backend), &camera, &grid, visibility::Method::Auto);
    let seen = visibility.first_hits(0..grid.dimensions[2], &Silent).expect("nobody cancels");
    let seen: Vec<(usize, u32)> = seen.into_iter().enumerate().filter(|(_, simplex)| *simplex != NOTHING).collect();
    let point = |(n, simplex): (usize, u32)| {
        let ray = camera.voxel_ray(&grid, grid.index(n));
        let corners = mesh.corners(simplex);
        let crossing = Cone::of_simplex(&ray.origin, &corners).crossing(&ray.direction);
        let normal = normal_of(&corners.map(|v| widen(&v))).normalize();
        let normal = if normal.dot(&widen(&ray.direction)) > 0.0 { -normal } else { normal };
        ShadingPoint::Inside {
            position: narrow(&ray.at(crossing.t)),
            normal: narrow(&normal),
            simplex,
            number: n as u64,
        }
    };
    let points: Vec<ShadingPoint<D>> = some(&seen).into_iter().map(point).collect();
    let vertices = some(&ShadingPoint::vertices(mesh));
    let mut rates: Vec<[f64; 2]> =
        (0..ROUNDS).map(|_| [rate(&*backend, &vertices), rate(&*backend, &points)]).collect();
    let mut median = |which: usize| {
        rates.sort_by(|a, b| a[which].total_cmp(&b[which]));
        rates[ROUNDS / 2][which]
    };
    let [at_vertices, at_points] = [median(0), median(1)];
    println!(
        "| {name} | {} | {} | {at_vertices:.2} | {} | {at_points:.2} | {:.2} |",
        mesh.simplices.len(),
        vertices.len(),
        points.len(),
        at_points / at_vertices
    );
}

fn main() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines");
    let mut files: Vec<PathBuf> = std::env::args().skip(1).filter(|a| a != "--bench").map(PathBuf::from).collect();
    if files.is_empty() {
        let usual = ["two_cut_cubes.yaml", "thesis/fig_2_3.yaml", "polytopes.yaml", "droplet.yaml"];
        files = usual.map(|name| folder.join(name)).to_vec();
    }
    println!("| pipeline | simplices | vertices | Mrays/s | visible points | Mrays/s | ratio |");
    println!("| --- | ---: | ---: | ---: | ---: | ---: | ---: |");
    for file in files {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let pipeline = Pipeline::load(&file, &[], None).unwrap_or_else(|error| panic!("{error}"));
        let Some((scene, _)) = pipeline.plan.all::<ScenePlan>().next() else { continue };
        match AnyMesh::build(&pipeline.plan, scene, &mut Vec::new(), &Silent).unwrap_or_else(|error| panic!("{error}"))
        {
            AnyMesh::Three(mesh) => measure(&name, &pipeline, mesh),
            AnyMesh::Four(mesh) => measure(&name, &pipeline, mesh),
        }
    }
}
