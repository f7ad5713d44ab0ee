//! Estimated errors against real ones, targets, and what the samplers are worth.

use ao4d::accel::Tracer;
use ao4d::mesh::Incidence;
use ao4d::occlusion::{Estimate, Method, Sampler, Settings, Site, Stream, Target, estimate_at};
use ao4d::progress::Silent;

use crate::scenes::{self, Scene};

in_3d_and_4d! { estimates_are_calibrated targets_are_met half_the_error_of_random_rays fast_is_slow }

fn settings(sampler: Sampler, samples: u32, seed: u64) -> Settings {
    Settings { sampler, samples, seed, max_distance: f32::INFINITY }
}

/// Estimates at the chosen vertices of a scene, under several seeds, each with its real error.
fn against_exact<const D: usize>(
    scene: &Scene<D>,
    tracer: &Tracer<D>,
    exact: &[f64],
    seeds: u64,
    mut estimate: impl FnMut(&mut Stream<D>, &Incidence, u64, u32) -> Estimate,
) -> Vec<(Estimate, f64)> {
    let incidence = Incidence::new(tracer.mesh());
    let mut stream = Stream::default();
    let mut found = Vec::new();
    for seed in 0..seeds {
        for (&vertex, exact) in scene.vertices.iter().zip(exact) {
            let estimate = estimate(&mut stream, &incidence, seed, vertex);
            found.push((estimate, f64::from(estimate.value) - exact));
        }
    }
    found
}

fn rms(errors: impl Iterator<Item = f64> + Clone) -> f64 {
    (errors.clone().map(|e| e * e).sum::<f64>() / errors.count().max(1) as f64).sqrt()
}

/// Of the values whose rays differ at least 90 % lie within two standard errors, on every scene.
fn estimates_are_calibrated<const D: usize>() {
    for scene in scenes::all::<D>(24) {
        let tracer = Tracer::new(&scene.mesh);
        let exact = scene.exact(&tracer);
        for sampler in [Sampler::Sobol, Sampler::Random] {
            for samples in [64, 256, 1000, 1024] {
                let found = against_exact(&scene, &tracer, &exact, 6, |stream, incidence, seed, vertex| {
                    let settings = settings(sampler, samples, seed);
                    stream.estimate_at_vertex(&tracer, incidence, &settings, None, vertex)
                });
                assert!(found.iter().all(|(e, _)| e.error >= 1.5 / samples as f32 && e.rays == samples));
                let differ: Vec<_> = found.iter().filter(|(e, _)| e.value > 0.0 && e.value < 1.0).collect();
                assert!(differ.len() >= 20, "{}: only {} values whose rays differ", scene.name, differ.len());
                let within = differ.iter().filter(|(e, real)| real.abs() <= 2.0 * f64::from(e.error)).count();
                let share = within as f64 / differ.len() as f64;
                let (said, real) =
                    (rms(differ.iter().map(|(e, _)| f64::from(e.error))), rms(differ.iter().map(|d| d.1)));
                let name = &scene.name;
                println!(
                    "{name} {sampler:?} {samples}: {:.1} % within two, said {said:.1e}, is {real:.1e}",
                    100.0 * share
                );
                assert!(share >= 0.9, "{name} {sampler:?} {samples}: {share} of {}", differ.len());
                // Not by saying too much, either.
                assert!(said < 3.0 * real + 1.5 / f64::from(samples), "{name} {sampler:?} {samples}: {said} {real}");
            }
        }
    }
}

/// Every vertex gets as many rays as it needs and no more than are allowed, and the errors are as small as was asked.
fn targets_are_met<const D: usize>() {
    for scene in scenes::all::<D>(24) {
        let tracer = Tracer::new(&scene.mesh);
        let exact = scene.exact(&tracer);
        for error in [0.02, 0.005] {
            let most = 1 << 15;
            let found = against_exact(&scene, &tracer, &exact, 3, |stream, incidence, seed, vertex| {
                let settings = settings(Sampler::Sobol, most, seed);
                stream.estimate_at_vertex(&tracer, incidence, &settings, Some(Target { error }), vertex)
            });
            let real = rms(found.iter().map(|f| f.1));
            let rays = found.iter().map(|(e, _)| f64::from(e.rays)).sum::<f64>() / found.len() as f64;
            println!("{}, target {error}: error {real:.1e}, {rays:.0} rays a vertex", scene.name);
            for (estimate, _) in &found {
                assert!(estimate.error <= error && estimate.rays < most, "{estimate:?}");
                assert!(estimate.rays >= Target::FEWEST && estimate.rays.is_power_of_two(), "{estimate:?}");
            }
            assert!(real <= f64::from(error), "{}: {real} instead of {error}", scene.name);
            let few = found.iter().map(|(e, _)| e.rays).min();
            let many = found.iter().map(|(e, _)| e.rays).max();
            assert!(few < many, "{}: all vertices take {few:?} rays", scene.name);
        }
        // A target out of reach takes all that is allowed.
        let vertex = scene.vertices[exact.iter().position(|&a| a < 0.95 && a > 0.05).unwrap()];
        let out_of_reach = Some(Target { error: 1e-6 });
        let settings = settings(Sampler::Sobol, 500, 1);
        let incidence = Incidence::new(tracer.mesh());
        let mut stream = Stream::default();
        let estimate = stream.estimate_at_vertex(&tracer, &incidence, &settings, out_of_reach, vertex);
        assert_eq!(estimate.rays, 500);
        assert_eq!(estimate.value, stream.at_vertex(&tracer, &incidence, &settings, vertex));
    }
}

/// At 256 rays `adaptive` has at most half of the error of `random` on every scene, and `sobol` on those of the
/// pipelines.
fn half_the_error_of_random_rays<const D: usize>() {
    for scene in scenes::all::<D>(40) {
        let tracer = Tracer::new(&scene.mesh);
        let exact = scene.exact(&tracer);
        let error_of = |sampler| {
            let found = against_exact(&scene, &tracer, &exact, 8, |stream, incidence, seed, vertex| {
                stream.estimate_at_vertex(&tracer, incidence, &settings(sampler, 256, seed), None, vertex)
            });
            (rms(found.iter().map(|f| f.1)), found.iter().map(|f| f.1).sum::<f64>() / found.len() as f64)
        };
        let (random, sobol) = (error_of(Sampler::Random).0, error_of(Sampler::Sobol).0);
        let adaptive = Method::Adaptive(settings(Sampler::Sobol, 256, 1), None).at_vertices(&tracer, &Silent).unwrap();
        let found = scene.vertices.iter().map(|&v| f64::from(adaptive.values[v as usize])).zip(&exact);
        let adaptive = rms(found.map(|(value, exact)| value - exact));
        println!(
            "{}: random {random:.1e}, sobol {:.2}, adaptive {:.2} of that",
            scene.name,
            sobol / random,
            adaptive / random
        );
        assert!(adaptive <= 0.5 * random, "{}: {adaptive} {random}", scene.name);
        let limit = if scene.name.ends_with(".yaml") { 0.5 } else { 0.95 };
        assert!(sobol <= limit * random, "{}: {sobol} {random}", scene.name);
    }
}

/// The fast engine says what the slow one says, of values and errors, with targets and without.
fn fast_is_slow<const D: usize>() {
    for scene in scenes::all::<D>(6) {
        let tracer = Tracer::new(&scene.mesh);
        let incidence = Incidence::new(&scene.mesh);
        let mut stream = Stream::default();
        for sampler in [Sampler::Sobol, Sampler::Random] {
            for (samples, target) in
                [(7, None), (100, None), (256, None), (777, None), (2048, Some(Target { error: 0.015 }))]
            {
                for &vertex in &scene.vertices {
                    let settings = settings(sampler, samples, 4);
                    let fast = stream.estimate_at_vertex(&tracer, &incidence, &settings, target, vertex);
                    let site = Site::at_vertex(&tracer, &incidence, vertex);
                    assert_eq!(fast, estimate_at(&tracer, &site, &settings, target, u64::from(vertex)));
                }
            }
        }
    }
}
