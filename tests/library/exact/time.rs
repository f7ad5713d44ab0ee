//! A sweep that measures time.

use ao4d::geometry::{Vector, narrow, widen};
use rand::{SeedableRng, rngs::ChaCha8Rng};

use super::scenes::*;

/// Prints the time per vertex for closed bodies beside a partner; run with `--release --ignored --nocapture`.
#[test]
#[ignore = "a sweep that measures time"]
fn time_per_vertex() {
    fn measure<const D: usize>(name: &str, simplices: &Simplices<D>, centre: Vector<D>) {
        let mut points: Vec<Vector<D>> = simplices.iter().flatten().copied().collect();
        points.sort_by(|a, b| a.iter().partial_cmp(b.iter()).unwrap());
        points.dedup();
        let step = points.len().div_ceil(40);
        let start = std::time::Instant::now();
        let (mut count, mut sum, mut slowest) = (0, 0.0, 0.0f64);
        for p in points.iter().step_by(step) {
            let began = std::time::Instant::now();
            sum += value(p, &(p - centre), simplices);
            slowest = slowest.max(began.elapsed().as_secs_f64());
            count += 1;
        }
        println!(
            "{name}: {} simplices, {} vertices, {:.2} ms a vertex (slowest {:.2}), mean {:.6}",
            simplices.len(),
            points.len(),
            start.elapsed().as_secs_f64() * 1e3 / count as f64,
            slowest * 1e3,
            sum / count as f64
        );
    }
    for n in 1..=6 {
        let mut scene = box_surface::<4>([-1.0; 4], [1.0; 4], n);
        scene.extend(box_surface::<4>([1.1, -0.7, -0.6, -0.5], [1.9, 0.8, 0.9, 0.7], n));
        measure(&format!("tesseract and box, n = {n}"), &scene, Vector::zeros());
        for simplex in &mut scene {
            *simplex = simplex.map(|v| narrow(&turned(&widen(&v), 0.7)));
        }
        measure(&format!("the same, turned, n = {n}"), &scene, Vector::zeros());
    }
    for levels in 0..=3 {
        let mut scene = ball::<4>(Vector::zeros(), 1.0, levels);
        scene.extend(ball::<4>(Vector::from([1.5, 0.3, 0.1, 0.2]), 0.6, levels));
        measure(&format!("two balls, level {levels}"), &scene, Vector::zeros());
    }
    for levels in 0..=5 {
        let mut scene = ball::<3>(Vector::zeros(), 1.0, levels);
        scene.extend(ball::<3>(Vector::from([1.5, 0.3, 0.1]), 0.6, levels));
        measure(&format!("3D: two balls, level {levels}"), &scene, Vector::zeros());
    }
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    for count in [10, 30, 100, 300] {
        measure(&format!("soup of {count}"), &soup::<4>(&mut rng, count, 0.3), Vector::zeros());
    }
}
