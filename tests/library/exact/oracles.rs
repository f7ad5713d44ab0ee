//! Values known in closed form, brackets around them, and rays.

use ao4d::geometry::{Vector, widen};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;

use super::scenes::*;

in_3d_and_4d! {
    nothing_occludes_nothing orthant half_space fold enclosed_in_a_box enclosed_in_a_ball convex_body_alone ball_above_a_horizon circular_cone random_soup_by_rays
}

fn nothing_occludes_nothing<const D: usize>() {
    let p = Vector::<D>::from_element(0.3);
    assert!((value(&p, &(axis(0) * 7.0 + axis(1)), &[]) - 1.0).abs() < 1e-14);
}

fn orthant<const D: usize>() {
    let expected = 1.0 - 0.5f64.powi(D as i32 - 1);
    for at in 0..D {
        let orthant: [Vector<D>; D] = std::array::from_fn(axis);
        let a = value(&Vector::zeros(), &axis(at), &[orthant]);
        assert!((a - expected).abs() < 1e-14, "{a}");
        let a = value(&Vector::zeros(), &axis(at), &[orthant; 3]);
        assert!((a - expected).abs() < 1e-14, "the same three times: {a}");
        assert_eq!(value(&Vector::zeros(), &-axis::<D>(at), &[orthant]), 1.0);
    }
}

fn half_space<const D: usize>() {
    let half: Simplices<D> = (0..1usize << (D - 1))
        .map(|signs| std::array::from_fn(|i| if i > 0 && signs >> (i - 1) & 1 == 1 { -axis::<D>(i) } else { axis(i) }))
        .collect();
    for at in 1..D {
        let a = value(&Vector::zeros(), &axis(at), &half);
        assert!((a - 0.5).abs() < 1e-14, "{a}");
    }
    assert_eq!(value(&Vector::zeros(), &axis(0), &half), 0.0);
    assert!((value(&Vector::zeros(), &-axis::<D>(0), &half) - 1.0).abs() < 1e-14);
    // A plane tilted by 60 degrees leaves (1 + cos) / 2, whatever the dimension.
    let tilted = axis::<D>(0) * 3.0f32 + axis(1) * 4.0;
    let a = value(&Vector::zeros(), &tilted, &half);
    assert!((a - (1.0 - 0.6) / 2.0).abs() < 1e-14, "{a}");
}

fn fold<const D: usize>() {
    // Two half-hyperplanes, towards x_0 and towards x_1, both along all other axes: each a fan around p.
    let p = Vector::<D>::zeros();
    let mut simplices = Vec::new();
    for wall in [0, 1] {
        for signs in 0..1usize << (D - 2) {
            simplices.push(std::array::from_fn(|i| match i {
                0 => p,
                1 => axis(wall),
                _ => axis::<D>(i) * if signs >> (i - 2) & 1 == 1 { -1.0 } else { 1.0 },
            }));
        }
    }
    let concave = value(&p, &(axis(0) + axis(1)), &simplices);
    assert!((concave - 0.5f64.sqrt()).abs() < 1e-14, "{concave}");
    let convex = value(&p, &-(axis::<D>(0) + axis(1)), &simplices);
    assert!((convex - 1.0).abs() < 1e-14, "{convex}");
}

fn enclosed_in_a_box<const D: usize>() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut worst = 0.0f64;
    for n in 1..=3 {
        let body = box_surface::<D>([-1.0; D], std::array::from_fn(|i| 1.0 + i as f32), n);
        let mut points = vec![Vector::zeros(), axis(0) * 0.5, Vector::from_element(0.25)];
        points.extend((0..3).map(|_| random_vector::<D>(&mut rng) * 0.999));
        for p in points {
            for normal in [axis(0), axis(D - 1), Vector::from_element(1.0), random_vector(&mut rng)] {
                worst = worst.max(value(&p, &normal, &body).abs());
            }
        }
    }
    println!("largest |A| inside boxes: {worst:e}");
    assert!(worst < 1e-12);
}

fn enclosed_in_a_ball<const D: usize>() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let mut worst = 0.0f64;
    for levels in 0..=2 {
        let body = ball::<D>(Vector::zeros(), 1.0, levels);
        for _ in 0..4 {
            let p = random_vector::<D>(&mut rng) * 0.4;
            worst = worst.max(value(&p, &random_vector(&mut rng), &body).abs());
        }
    }
    println!("largest |A| inside balls: {worst:e}");
    assert!(worst < 1e-12);
}

fn convex_body_alone<const D: usize>() {
    let mut worst = 0.0f64;
    for n in 1..=2 {
        let body = box_surface::<D>([-1.0; D], std::array::from_fn(|i| 1.0 + i as f32), n);
        for p in body.iter().flatten() {
            let centre = Vector::<D>::from_fn(|i, _| i as f32 / 2.0);
            worst = worst.max((value(p, &(p - centre), &body) - 1.0).abs());
        }
    }
    println!("largest |A - 1| on convex bodies: {worst:e}");
    assert!(worst < 1e-13);
}

/// A ball of radius r at distance d in direction u takes (r / d)^(D-1) (u . n).
fn ball_above_a_horizon<const D: usize>() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    for (levels, width) in [(1, 0.2), (2, 0.08), (3, 0.025)] {
        for _ in 0..3 {
            let p = random_vector::<D>(&mut rng);
            let n = random_vector::<D>(&mut rng).normalize();
            let u = (random_vector::<D>(&mut rng) * 0.3 + n).normalize();
            let body = ball(p + u * 1.5, 0.7, levels);
            let taken = |radius: f64| (radius / 1.5).powi(D as i32 - 1) * widen(&u).dot(&widen(&n));
            let (low, high) = (taken(inradius(&body, p + u * 1.5)), taken(0.7));
            let a = 1.0 - value(&p, &n, &body);
            assert!(low - 1e-6 < a && a < high + 1e-6, "{low} < {a} < {high}");
            assert!(high - low < width, "the bracket is narrow: {low} {high}");
        }
    }
}

/// A circular cone of half-angle a around n takes sin^(D-1) a.
fn circular_cone<const D: usize>() {
    // The directions of the horizon, as simplices of D - 1 points on the unit sphere, and their inradius.
    let (rim, inradius): (Vec<Vec<Vector<D>>>, f64) = if D == 3 {
        let point = |k: usize| {
            let angle = (k % 64) as f64 * std::f64::consts::TAU / 64.0;
            Vector::<D>::from_fn(|r, _| [angle.cos(), angle.sin(), 0.0][r] as f32)
        };
        ((0..64).map(|k| vec![point(k), point(k + 1)]).collect(), (std::f64::consts::PI / 64.0).cos())
    } else {
        let sphere = ball::<3>(Vector::zeros(), 1.0, 3);
        let lift = |v: &Vector<3>| Vector::<D>::from_fn(|r, _| if r < 3 { v[r] } else { 0.0 });
        (sphere.iter().map(|s| s.iter().map(lift).collect()).collect(), inradius(&sphere, Vector::zeros()))
    };
    let n = axis::<D>(D - 1);
    for half_angle in [0.1f64, 0.5, 1.2] {
        let cone: Simplices<D> = rim
            .iter()
            .map(|rim| {
                std::array::from_fn(|i| {
                    if i == 0 { n } else { rim[i - 1] * half_angle.sin() as f32 + n * half_angle.cos() as f32 }
                })
            })
            .collect();
        let taken = 1.0 - value(&Vector::zeros(), &n, &cone);
        let power = |angle: f64| angle.sin().powi(D as i32 - 1);
        let (low, high) = (power((half_angle.tan() * inradius).atan()), power(half_angle));
        assert!(low - 1e-7 < taken && taken < high + 1e-7, "{low} < {taken} < {high}");
    }
}

fn random_soup_by_rays<const D: usize>() {
    for seed in 0..6 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut simplices = soup::<D>(&mut rng, 12, 0.5);
        let p = simplices[0][0];
        simplices.push(std::array::from_fn(|i| if i == 1 { p } else { random_vector(&mut rng) }));
        let n = random_vector::<D>(&mut rng);
        let exact = value(&p, &n, &simplices);
        let (mean, error) = monte_carlo(&mut rng, &p, &n, &simplices, 40_000);
        println!("{exact:.6} {mean:.6} +- {error:.6}");
        assert!((exact - mean).abs() < 4.5 * error, "{exact} {mean} {error}");
    }
}

/// The same scenes against many rays.
#[test]
#[ignore = "eight million rays"]
fn one_scene_by_many_rays() {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let simplices = soup::<4>(&mut rng, 12, 0.5);
    let (p, n) = (Vector::zeros(), Vector::from_element(1.0));
    let exact = value(&p, &n, &simplices);
    let (mean, error) = monte_carlo(&mut rng, &p, &n, &simplices, 8_000_000);
    println!("{exact:.8} {mean:.8} +- {error:.8}");
    assert!((exact - mean).abs() < 4.0 * error);
}
