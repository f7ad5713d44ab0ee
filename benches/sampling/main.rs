//! What point sets, stratification, refinement and closed forms are worth: the error at equal numbers of rays, as a share
//! of that of random rays, against the exact values. Prints the tables of docs/sampling.md:
//!
//! ```text
//! cargo bench --bench sampling
//! ```
//!
//! Each candidate sees a hemisphere as the unit (D-1)-ball that it projects onto, and asks for the visibility of points
//! of it. Only `random`, `sobol` and `adaptive` are in the program; the others are here because they were tried.

#[path = "../../tests/library/methods/scenes.rs"]
mod scenes;

mod candidates;
mod found;

use std::time::Instant;

use ao4d::accel::Tracer;
use ao4d::geometry::{Frame, Vector};
use ao4d::occlusion::Estimator;
use ao4d::progress::Silent;
use ao4d::trace::cpu::CpuBackend;
use ao4d::trace::{RayBackend, Sampling, ShadingPoint, Surroundings};

use candidates::CANDIDATES;
use scenes::Scene;

/// Vertices that are partly occluded, at most.
const VERTICES: usize = 16;

/// Sums over all values of a candidate.
#[derive(Default)]
struct Sums {
    squares: f64,
    errors: f64,
    rays: u64,
    values: u32,
}

impl Sums {
    fn add(&mut self, error: f64, rays: u32) {
        self.squares += error * error;
        self.errors += error;
        self.rays += u64::from(rays);
        self.values += 1;
    }

    fn rmse(&self) -> f64 {
        (self.squares / f64::from(self.values)).sqrt()
    }

    /// The mean error, if chance doesn't explain it: beyond 3.5 of its standard errors.
    fn bias(&self) -> Option<f64> {
        let mean = self.errors / f64::from(self.values);
        (mean.abs() > 3.5 * self.rmse() / f64::from(self.values).sqrt()).then_some(mean)
    }

    fn cell(&self, random: f64) -> String {
        let bias = self.bias().map(|b| format!(" (bias {b:+.4})")).unwrap_or_default();
        format!("{:.2}{bias}", self.rmse() / random)
    }
}

/// Asks every candidate; one row a number of rays.
fn table<const D: usize>(scene: &Scene<D>) {
    let tracer = Tracer::new(scene.mesh.clone());
    let exact = scene.exact(&tracer);
    let mut chosen: Vec<(u32, f64)> = scene.vertices.iter().copied().zip(exact).collect();
    chosen.retain(|(_, a)| (0.001..0.999).contains(a));
    chosen.truncate(VERTICES);
    for (samples, seeds) in [(64, 32), (256, 32), (1024, 12)] {
        let mut cells = Vec::new();
        let mut random = 0.0;
        for (name, candidate) in CANDIDATES {
            let mut sums = Sums::default();
            for &(vertex, truth) in &chosen {
                let surroundings = Surroundings::of(&tracer, &ShadingPoint::Vertex(vertex));
                let frame = surroundings.frame();
                for seed in 0..seeds {
                    let mut rays = 0;
                    let mut see = |point: [f32; 3]| {
                        rays += 1;
                        surroundings.is_visible(&tracer, lifted(&frame, point), f32::INFINITY)
                    };
                    let value = candidate(samples, seed * 1_000_003 + u64::from(vertex), D - 1, &mut see);
                    sums.add(value - truth, rays);
                }
            }
            if *name == "random" {
                random = sums.rmse();
            }
            cells.push(sums.cell(random));
        }
        let mut sums = Sums::default();
        for &(vertex, truth) in &chosen {
            for seed in 0..seeds.min(8) {
                let value = found::estimate(&scene.mesh, &tracer, vertex, samples, seed);
                sums.add(value - truth, samples);
            }
        }
        cells.push(sums.cell(random));
        println!("| {} | {samples} | {random:.1e} | {} |", scene.name, cells[1..].join(" | "));
    }
}

/// A point of the ball as a direction.
fn lifted<const D: usize>(frame: &Frame<D>, point: [f32; 3]) -> Vector<D> {
    let mut local = Vector::<D>::zeros();
    local.as_mut_slice()[..D - 1].copy_from_slice(&point[..D - 1]);
    ao4d::trace::direction(&mut local, frame)
}

/// The methods of the program on whole scenes: time a vertex and error.
fn times<const D: usize>(scene: &Scene<D>) {
    let backend = CpuBackend::new(Tracer::new(scene.mesh.clone()));
    let (tracer, points) = (backend.tracer(), ShadingPoint::vertices(&scene.mesh));
    let start = Instant::now();
    let exact = scene.exact(tracer);
    let expensive = start.elapsed().as_secs_f64() / exact.len() as f64;
    let mut row = format!("| {} | {} | {:.0} |", scene.name, scene.mesh.simplices.len(), expensive * 1e6);
    for estimator in [
        Estimator::Sampled(Sampling::random(256, 1)),
        Estimator::Sampled(Sampling::new(256, 1)),
        Estimator::Adaptive(Sampling::new(256, 1)),
    ] {
        tracer.wide();
        let start = Instant::now();
        let Ok(found) = estimator.estimate(&backend, &points, None, &Silent) else { continue };
        let time = start.elapsed().as_secs_f64() / found.values.len() as f64;
        let mut sums = Sums::default();
        for (&vertex, truth) in scene.vertices.iter().zip(&exact) {
            sums.add(f64::from(found.values[vertex as usize]) - truth, 0);
        }
        let known = found.errors.iter().filter(|&&e| e == 0.0).count() as f64 / found.errors.len() as f64;
        row += &format!(" {:.1} | {:.1e} |", time * 1e6, sums.rmse());
        if matches!(estimator, Estimator::Adaptive(_)) {
            row += &format!(" {:.0} % |", 100.0 * known);
        }
    }
    println!("{row}");
}

fn main() {
    let names: Vec<&str> = CANDIDATES[1..].iter().map(|(name, _)| *name).collect();
    println!("| scene | rays | random | {} | found |", names.join(" | "));
    println!("|{}", " --- |".repeat(names.len() + 4));
    scenes::all::<3>(60).iter().for_each(table);
    scenes::all::<4>(60).iter().for_each(table);
    println!(
        "\n| scene | simplices | exact us | random us | RMSE | sobol us | RMSE | adaptive us | RMSE | in closed form |"
    );
    println!("|{}", " --- |".repeat(10));
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().ok();
    scenes::all::<3>(60).iter().for_each(times);
    scenes::all::<4>(60).iter().for_each(times);
}
