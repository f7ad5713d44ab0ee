//! The published algorithm against the truth: all or nothing on pairs of simplices that hardly see each other, and nothing
//! of that once its deviations are mended.

use ao4d::accel::Tracer;
use ao4d::geometry::Vector64;
use ao4d::mesh::{Mesh, MeshBuilder, Orientation, Surface};
use ao4d::occlusion::exact::{Budget, Hemisphere};
use ao4d::occlusion::{Deviations, Estimator};
use ao4d::progress::Silent;
use ao4d::trace::cpu::CpuBackend;
use ao4d::trace::{RayBackend, Sampling, ShadingPoint};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

/// Two simplices with edges of about 0.5, near each other.
fn pair<const D: usize>(random: &mut ChaCha8Rng) -> Mesh<D> {
    let mut vector = |size: f64| Vector64::<D>::from_fn(|_, _| (random.random::<f64>() - 0.5) * size);
    let mut vertices = Vec::new();
    for _ in 0..2 {
        let centre = vector(1.0);
        vertices.extend((0..D).map(|_| centre + vector(0.5)));
    }
    let simplices = (0..2).map(|s| std::array::from_fn(|i| (s * D + i) as u32)).collect();
    let mut builder = MeshBuilder::new();
    let surface = Surface { vertices, simplices, normals: None };
    builder.add("pair", [1.0; 3], &surface, Orientation::Input).unwrap();
    builder.finish()
}

/// The published values of a mesh, at its vertices.
fn published<const D: usize>(backend: &CpuBackend<D>, deviations: Deviations, samples: u32, seed: u64) -> Vec<f32> {
    let points = ShadingPoint::vertices(backend.tracer().mesh());
    let estimator = Estimator::AsPublished(Sampling::random(samples, seed), deviations);
    estimator.estimate(backend, &points, None, &Silent).unwrap().values
}

/// Occlusion at all vertices of many pairs.
struct Occlusion {
    truth: Vec<f64>,
    published: Vec<f64>,
}

impl Occlusion {
    fn of_pairs<const D: usize>(count: usize, deviations: Deviations, samples: u32) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(11);
        let (mut truth, mut published) = (Vec::new(), Vec::new());
        for _ in 0..count {
            let mesh = pair::<D>(&mut random);
            let points = ShadingPoint::vertices(&mesh);
            let backend = CpuBackend::new(Tracer::new(mesh));
            let view = |point| Hemisphere::over(backend.tracer(), point).unwrap();
            truth.extend(points.iter().map(|point| 1.0 - view(point).visible_fraction(Budget::default()).unwrap()));
            published.extend(self::published(&backend, deviations, samples, 2).iter().map(|&a| 1.0 - f64::from(a)));
        }
        Self { truth, published }
    }

    fn share(values: &[f64], condition: impl Fn(f64) -> bool) -> f64 {
        values.iter().filter(|&&v| condition(v)).count() as f64 / values.len() as f64
    }

    fn print(&self, what: &str, dimension: usize) {
        let quantiles = |values: &[f64]| {
            let mut sorted = values.to_vec();
            sorted.sort_by(f64::total_cmp);
            [0, 1, 2, 3, 4].map(|q| sorted[(sorted.len() - 1) * q / 4])
        };
        let (found, truth) = (quantiles(&self.published), quantiles(&self.truth));
        println!("{dimension}D, {what}: least, quartiles and largest occlusion {found:.3?}; truly {truth:.3?}");
    }
}

fn all_or_nothing<const D: usize>() {
    let found = Occlusion::of_pairs::<D>(40, Deviations::PUBLISHED, 256);
    found.print("as published", D);
    assert!(Occlusion::share(&found.truth, |o| o < 0.03) > 0.9, "the simplices hardly see each other");
    assert!(Occlusion::share(&found.published, |o| o > 0.7) > 0.7, "most vertices are published as black");
    // Fused products exchange black and white here and there: rounding decides.
    let fused = Occlusion::of_pairs::<D>(40, Deviations { contracted: true, ..Deviations::PUBLISHED }, 256);
    fused.print("products fused into sums", D);
    let changed = (found.published.iter().zip(&fused.published)).filter(|(a, b)| (*a - *b).abs() > 0.5).count();
    println!("{D}D: {changed} of {} vertices change sides", found.truth.len());
    assert!(changed * 10 > found.truth.len());
    // t > 0 helps most vertices; single ones stay black, where rounding makes t positive.
    let ahead = Occlusion::of_pairs::<D>(40, Deviations { hits_at_zero: false, ..Deviations::PUBLISHED }, 256);
    ahead.print("only t > 0", D);
    assert!(Occlusion::share(&ahead.published, |o| o < 0.05) > 0.75);
    if D == 4 {
        assert!(Occlusion::share(&ahead.published, |o| o > 0.5) > 0.0);
    }
}

#[test]
fn self_hits_make_all_or_nothing() {
    all_or_nothing::<3>();
    all_or_nothing::<4>();
}

fn mended<const D: usize>() {
    // Without its deviations it is the truth, but for the noise of its rays.
    let samples = 4096;
    let found = Occlusion::of_pairs::<D>(40, Deviations::NONE, samples);
    found.print("all deviations mended", D);
    for (value, truth) in found.published.iter().zip(&found.truth) {
        let error = (truth * (1.0 - truth) / f64::from(samples)).sqrt().max(1.0 / f64::from(samples));
        assert!((value - truth).abs() < 5.0 * error, "{value} {truth}");
    }
    // Exact signs alone leave no self-hits: what remains is the wrong density of directions.
    let exact_signs =
        Occlusion::of_pairs::<D>(40, Deviations { single_precision: false, ..Deviations::PUBLISHED }, samples);
    exact_signs.print("exact signs", D);
    assert!(exact_signs.published.iter().zip(&exact_signs.truth).all(|(value, truth)| (value - truth).abs() < 0.2));
    let own = Occlusion::of_pairs::<D>(40, Deviations { own_simplices: false, ..Deviations::PUBLISHED }, samples);
    own.print("own simplices by their star", D);
    assert!(own.published.iter().zip(&own.truth).all(|(value, truth)| (value - truth).abs() < 0.2));
}

#[test]
fn without_its_deviations_it_is_right() {
    mended::<3>();
    mended::<4>();
}

#[test]
fn values_depend_on_the_seed_alone() {
    let mesh = pair::<4>(&mut ChaCha8Rng::seed_from_u64(3));
    let backend = CpuBackend::new(Tracer::new(mesh));
    let deviations = Deviations { own_simplices: false, ..Deviations::PUBLISHED };
    let values = |seed| published(&backend, deviations, 64, seed);
    assert_eq!(values(1), values(1));
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(one.install(|| values(1)), values(1));
}
