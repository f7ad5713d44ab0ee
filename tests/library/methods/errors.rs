//! Estimated errors against real ones, targets, and what the samplers are worth.

use std::sync::Arc;

use ao4d::accel::Tracer;
use ao4d::occlusion::Estimator;
use ao4d::progress::Silent;
use ao4d::trace::cpu::{CpuBackend, PacketTracer, estimate_at};
use ao4d::trace::{Estimate, Sampler, Sampling, ShadingPoint, Target};

use super::scenes::{self, Scene};

in_3d_and_4d! { estimates_are_calibrated targets_are_met half_the_error_of_random_rays fast_is_slow }

fn sampling(sampler: Sampler, samples: u32, seed: u64) -> Sampling {
    Sampling { sampler, ..Sampling::new(samples, seed) }
}

/// Estimates at the chosen vertices of a scene, under several seeds, each with its real error.
fn against_exact<const D: usize>(
    scene: &Scene<D>,
    tracer: &Tracer<D>,
    exact: &[f64],
    seeds: u64,
    sampling: impl Fn(u64) -> Sampling,
) -> Vec<(Estimate, f64)> {
    let mut packets = PacketTracer::default();
    let mut found = Vec::new();
    for seed in 0..seeds {
        for (&vertex, exact) in scene.vertices.iter().zip(exact) {
            let point = ShadingPoint::Vertex(vertex);
            let estimate = packets.estimate(tracer, &point, &sampling(seed), &Silent).unwrap();
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
        let tracer = Arc::new(Tracer::new(scene.mesh.clone()));
        let exact = scene.exact(&tracer);
        for sampler in [Sampler::Sobol, Sampler::Random] {
            for samples in [64, 256, 1000, 1024] {
                let found = against_exact(&scene, &tracer, &exact, 24, |seed| sampling(sampler, samples, seed));
                let least = if sampler == Sampler::Sobol { 0.3 } else { 1.5 } / samples as f32;
                assert!(found.iter().all(|(e, _)| e.error >= least && e.rays == samples));
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
                assert!(said < 1.5 * real + 0.3 / f64::from(samples), "{name} {sampler:?} {samples}: {said} {real}");
                assert!(said > 0.75 * real, "{name} {sampler:?} {samples}: {said} {real}");
            }
        }
    }
}

/// Every vertex gets as many rays as it needs and no more than are allowed, and the errors are as small as was asked.
fn targets_are_met<const D: usize>() {
    for scene in scenes::all::<D>(24) {
        let tracer = Arc::new(Tracer::new(scene.mesh.clone()));
        let exact = scene.exact(&tracer);
        for error in [0.02, 0.005] {
            let most = 1 << 15;
            let found = against_exact(&scene, &tracer, &exact, 3, |seed| Sampling {
                target: Some(Target { error }),
                ..sampling(Sampler::Sobol, most, seed)
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
        let all = sampling(Sampler::Sobol, 500, 1);
        let at = |sampling| estimate_at(&tracer, &ShadingPoint::Vertex(vertex), &sampling, &Silent).unwrap();
        let estimate = at(Sampling { target: out_of_reach, ..all });
        assert_eq!(estimate.rays, 500);
        assert_eq!(estimate, at(all));
    }
}

/// At 256 rays `adaptive` has at most half of the error of `random` on every scene, and `sobol` on those of the
/// pipelines.
fn half_the_error_of_random_rays<const D: usize>() {
    for scene in scenes::all::<D>(40) {
        let tracer = Arc::new(Tracer::new(scene.mesh.clone()));
        let exact = scene.exact(&tracer);
        let error_of = |sampler| {
            let found = against_exact(&scene, &tracer, &exact, 8, |seed| sampling(sampler, 256, seed));
            (rms(found.iter().map(|f| f.1)), found.iter().map(|f| f.1).sum::<f64>() / found.len() as f64)
        };
        let (random, sobol) = (error_of(Sampler::Random).0, error_of(Sampler::Sobol).0);
        let backend = CpuBackend::new(tracer.clone());
        let points = ShadingPoint::vertices(tracer.mesh());
        let adaptive = Estimator::Adaptive(sampling(Sampler::Sobol, 256, 1));
        let adaptive = adaptive.estimate(&backend, &points, None, &Silent).unwrap();
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
        let tracer = Arc::new(Tracer::new(scene.mesh.clone()));
        let mut packets = PacketTracer::default();
        for sampler in [Sampler::Sobol, Sampler::Random] {
            for (samples, target) in
                [(7, None), (100, None), (256, None), (777, None), (2048, Some(Target { error: 0.015 }))]
            {
                for &vertex in &scene.vertices {
                    let sampling = Sampling { target, ..sampling(sampler, samples, 4) };
                    let point = ShadingPoint::Vertex(vertex);
                    let fast = packets.estimate(&tracer, &point, &sampling, &Silent);
                    assert_eq!(fast, estimate_at(&tracer, &point, &sampling, &Silent));
                }
            }
        }
    }
}
