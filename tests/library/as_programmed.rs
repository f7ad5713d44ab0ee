//! The thesis's program as it was written, on its own two tetrahedra: the first is dark and the second isn't occluded at
//! all; and the truth once its deviations are taken back.

use ao4d::accel::Tracer;
use ao4d::geometry::Vector64;
use ao4d::mesh::{Mesh, MeshBuilder, Orientation, Surface};
use ao4d::occlusion::exact::{Budget, Hemisphere};
use ao4d::occlusion::{Estimator, ProgramDeviations};
use ao4d::progress::Silent;
use ao4d::trace::cpu::CpuBackend;
use ao4d::trace::{Sampling, ShadingPoint};

/// The vertices that the program held, of the scene of Figs. 5.1 and 5.2.
const VERTICES: [[f64; 4]; 8] = [
    [-0.25, 0.0, 0.0, 0.0],
    [-0.25, 0.25, -0.25, 0.0],
    [-0.3, 0.0, 0.5, 0.0],
    [-0.5, 0.0, 0.0, 0.0],
    [-0.5, 0.25, 0.0, 0.5],
    [-0.35, 0.25, -0.25, 0.5],
    [0.25, 0.0, 0.0, 0.0],
    [0.5, 0.0, 0.0, 0.0],
];

const SAMPLES: u32 = 20_000;

fn scene() -> Mesh<4> {
    let surface = Surface {
        vertices: VERTICES.map(Vector64::from).to_vec(),
        simplices: vec![[0, 1, 2, 3], [4, 5, 6, 7]],
        normals: None,
    };
    let mut builder = MeshBuilder::new();
    builder.add("two", [1.0; 3], &surface, Orientation::Input).unwrap();
    builder.finish()
}

/// Occlusion at the vertices of a mesh.
fn programmed(mesh: Mesh<4>, deviations: ProgramDeviations, seed: u64) -> Vec<f64> {
    let points = ShadingPoint::vertices(&mesh);
    let backend = CpuBackend::new(Tracer::new(mesh));
    let estimator = Estimator::AsProgrammed(Sampling::random(SAMPLES, seed), deviations);
    let values = estimator.estimate(&backend, &points, None, &Silent).unwrap().values;
    values.iter().map(|&a| 1.0 - f64::from(a)).collect()
}

fn exact(mesh: Mesh<4>) -> Vec<f64> {
    let points = ShadingPoint::vertices(&mesh);
    let tracer = Tracer::new(mesh);
    let view = |point| Hemisphere::over(&tracer, point).unwrap();
    points.iter().map(|point| 1.0 - view(point).visible_fraction(Budget::default()).unwrap()).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn print(what: &str, occlusion: &[f64]) {
    let (first, second) = occlusion.split_at(4);
    println!("| {what} | {:.3} | {:.3} | {occlusion:.3?} |", mean(first), mean(second));
}

#[test]
fn the_first_tetrahedron_is_dark_and_the_second_not_occluded_at_all() {
    let truth = exact(scene());
    let mut deviations = ProgramDeviations::PROGRAMMED;
    let written = programmed(scene(), deviations, 1);
    print("the program as written", &written);
    let fused = programmed(scene(), ProgramDeviations { contracted: true, ..deviations }, 1);
    print("products fused into sums", &fused);
    // Whatever the rounding: dark, and not occluded at all.
    for occlusion in [&written, &fused] {
        assert!(mean(&occlusion[..4]) > 0.6, "{occlusion:?}");
        assert_eq!(occlusion[4..], [0.0; 4]);
    }
    assert!((mean(&written[..4]) - 0.987).abs() < 0.005, "{written:?}");

    deviations.first_simplex_only = false;
    let both = programmed(scene(), deviations, 1);
    print("the return moved out of the loop", &both);
    assert!(mean(&both[..4]) > 0.6 && mean(&both[4..]) > 0.6, "{both:?}");
    deviations.points_as_directions = false;
    let directions = programmed(scene(), deviations, 1);
    print("and directions from the vertex", &directions);
    assert!(mean(&directions[..4]) > 0.6 && mean(&directions[4..]) > 0.6, "{directions:?}");
    deviations.hits_behind = false;
    let ahead = programmed(scene(), deviations, 1);
    print("and only hits ahead count", &ahead);
    let mended = programmed(scene(), ProgramDeviations::NONE, 1);
    print("and cosine-weighted directions", &mended);
    print("truth, in closed form", &truth);
    for (k, &truth) in truth.iter().enumerate() {
        assert!((ahead[k] - truth).abs() < 0.006, "vertex {k}: {} {truth}", ahead[k]);
        assert!((mended[k] - truth).abs() < 0.004, "vertex {k}: {} {truth}", mended[k]);
    }
}

#[test]
fn values_depend_on_the_seed_alone() {
    let values = |seed| programmed(scene(), ProgramDeviations::PROGRAMMED, seed);
    assert_eq!(values(1), values(1));
    assert_ne!(values(1), values(2));
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(one.install(|| values(1)), values(1));
}
