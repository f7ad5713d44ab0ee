//! The error of pictures against the rays and the time they take, for every way to shade.
//!
//! ```text
//! cargo bench --bench picture -- [NAMES of scenes, or parts of them] [--voxels 48] [--truth 2048]
//! ```
//!
//! The truth is `voxel` shading with so many rays, the error the RMS of ambient occlusion over the voxels that see
//! something. Images have `--voxels` voxels along their longest axis, pixels of 3D scenes five times as many. `measured` is
//! what a picture finds when it looks at 512 of its voxels again, `said` the RMS of its voxels' standard errors, `bias` the mean error. Times are wall clock, all threads, one run.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use ao4d::accel::Tracer;
use ao4d::mesh::Mesh;
use ao4d::occlusion::{Error, Estimator};
use ao4d::pipeline::Pipeline;
use ao4d::progress::Silent;
use ao4d::render::filters::denoise::Refine;
use ao4d::render::filters::{ImageFilter, denoise};
use ao4d::render::{Aov, Renderer, ScreenSpace, Shading, Slab};
use ao4d::stages::camera::camera;
use ao4d::stages::render::RenderPlan;
use ao4d::stages::scene::AnyMesh;
use ao4d::trace::cpu::CpuBackend;
use ao4d::trace::{RayBackend, Sampling, ShadingPoint};

/// The scenes, by the names of their pipelines.
const SCENES: [&str; 8] =
    ["two_cut_cubes", "thesis/fig_2_3", "polytopes", "droplet", "thesis/fig_5_5", "products", "ant", "tiger"];

/// Ambient occlusion and its error, where something is seen.
struct Image {
    values: Vec<f64>,
    errors: Vec<f64>,
    /// The RMS error that the picture measures itself.
    measured: f64,
    seconds: f64,
}

fn image<const D: usize>(make: impl Fn() -> Renderer<D>) -> Image {
    let start = Instant::now();
    let mut renderer = make();
    renderer.audit = Some(Sampling::new(256, 77));
    let aovs = [Aov::AmbientOcclusion, Aov::OcclusionError, Aov::Opacity];
    let mut arrays = Vec::new();
    let whole = |slab: Slab| {
        arrays = slab.arrays;
        Ok::<(), Error>(())
    };
    let accuracy = renderer.render(&aovs, Some(renderer.grid.dimensions[2]), &Silent, whole).expect("nobody cancels");
    let seconds = start.elapsed().as_secs_f64();
    let [values, errors, opacity] = [0, 1, 2].map(|i| arrays[i].values.to_f64());
    let seen = |all: Vec<f64>| all.into_iter().zip(&opacity).filter(|(_, o)| **o > 0.0).map(|(v, _)| v).collect();
    Image { values: seen(values), errors: seen(errors), measured: accuracy.map_or(0.0, |a| a.rms), seconds }
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0), |(s, n), v| (s + v * v, n + 1));
    (sum / f64::from(count.max(1))).sqrt()
}

fn measure<const D: usize>(name: &str, pipeline: &Pipeline, mesh: Mesh<D>, longest: usize, truth: u32) {
    let mut renders = pipeline.plan.all::<RenderPlan>().map(|(_, plan)| plan);
    let Some(plan) = renders.find(|render| render.occlusion.is_some()) else { return };
    let camera = camera::<D>(&plan.camera).expect("a camera");
    let wanted = if D == 3 { 5 * longest } else { longest };
    let most = plan.dimensions.iter().copied().max().unwrap_or(1);
    let dimensions = plan.dimensions.map(|d| (d * wanted).div_ceil(most).clamp(1, d.max(wanted)));
    let tracer = Arc::new(Tracer::new(mesh));
    let backend: Arc<dyn RayBackend<D>> = Arc::new(CpuBackend::new(Arc::clone(&tracer)));
    tracer.prepare_wide();
    let points = ShadingPoint::vertices(tracer.mesh());
    let renderer = |shading: Shading| Renderer::new(Arc::clone(&backend), camera.clone(), dimensions, shading);
    let by_rays = |samples| Estimator::Sampled(Sampling::new(samples, 1));
    let reference = image(|| renderer(Shading::Voxel(by_rays(truth))));
    let count = reference.values.len();
    println!(
        "\n{name}: {} simplices, {} vertices, {dimensions:?}, {count} voxels see something, truth {:.1} s",
        tracer.mesh().simplices.len(),
        points.len(),
        reference.seconds
    );
    println!("| shading | rays | RMSE | measured | said | bias | largest | million rays | s |");
    println!("|---|---|---|---|---|---|---|---|---|");
    let row = |shading: &str, rays: u32, asked: usize, found: Image| {
        let errors: Vec<f64> = found.values.iter().zip(&reference.values).map(|(a, b)| a - b).collect();
        println!(
            "| {shading} | {rays} | {:.4} | {:.4} | {:.4} | {:+.4} | {:.3} | {:.2} | {:.2} |",
            rms(errors.iter().copied()),
            found.measured,
            rms(found.errors.iter().copied()),
            errors.iter().sum::<f64>() / count.max(1) as f64,
            errors.iter().fold(0.0, |most: f64, e| most.max(e.abs())),
            (asked * rays as usize) as f64 * 1e-6,
            found.seconds
        );
    };
    for rays in [64, 256] {
        let smooth = || {
            let found = by_rays(rays).estimate(&*backend, &points, None, &Silent).expect("nobody cancels");
            renderer(Shading::Smooth(Arc::new(found)))
        };
        row("smooth", rays, points.len(), image(smooth));
    }
    for rays in [64, 256] {
        for (own, tolerance) in
            [(4, None), (16, None), (4, Some(0.01)), (8, Some(0.01)), (16, Some(0.01)), (16, Some(0.005))]
        {
            let auto = || {
                let found = by_rays(rays).estimate(&*backend, &points, None, &Silent).expect("nobody cancels");
                let mut renderer = renderer(Shading::Auto(Arc::new(found), by_rays(own)));
                renderer.filters.extend(denoise(&renderer.camera, &renderer.grid, Sampling::new(own, 1)));
                let most = Sampling::new(256, 1);
                let refine = |t| Box::new(Refine::new(Arc::clone(&backend), most, t)) as Box<dyn ImageFilter<D>>;
                renderer.filters.extend(tolerance.map(refine));
                renderer
            };
            let asked = points.len() + count * own as usize / rays as usize;
            let told = tolerance.map_or(String::new(), |t| format!(", to {t}"));
            row(&format!("auto, {own} a voxel{told}"), rays, asked, image(auto));
        }
    }
    for (slices, steps) in [(8, 8), (16, 16), (32, 16), (64, 32)] {
        let settings = ScreenSpace { slices, steps, ..ScreenSpace::default() };
        let name = format!("screen_space, {slices} slices x {steps} steps");
        row(&name, 0, count, image(|| renderer(Shading::ScreenSpace(settings))));
    }
    for rays in [1, 4, 16, 64] {
        row("voxel", rays, count, image(|| renderer(Shading::Voxel(by_rays(rays)))));
        let filtered = || {
            let mut renderer = renderer(Shading::Voxel(by_rays(rays)));
            renderer.filters.extend(denoise(&renderer.camera, &renderer.grid, Sampling::new(rays, 1)));
            renderer
        };
        row("voxel, denoised", rays, count, image(filtered));
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let number = |key: &str, default: usize| {
        let at = arguments.iter().position(|a| a == key);
        at.map_or(default, |i| arguments[i + 1].parse().expect("a number"))
    };
    let (voxels, truth) = (number("--voxels", 48), number("--truth", 2048));
    let names: Vec<&String> =
        arguments.iter().filter(|a| a.parse::<usize>().is_err() && !a.starts_with("--")).collect();
    for scene in SCENES.iter().filter(|s| names.is_empty() || names.iter().any(|n| s.contains(n.as_str()))) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("pipelines/{scene}.yaml"));
        let pipeline = Pipeline::load(&path, &[], None).expect("a shipped pipeline");
        let prepared = pipeline.prepare(|_| true).expect("a scene");
        match prepared.meshes.into_iter().flatten().next() {
            Some(AnyMesh::Three(mesh)) => measure(scene, &pipeline, mesh, voxels, truth as u32),
            Some(AnyMesh::Four(mesh)) => measure(scene, &pipeline, mesh, voxels, truth as u32),
            None => {}
        }
    }
}
