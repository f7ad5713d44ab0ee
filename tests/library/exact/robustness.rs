//! What must not matter, on scenes where planes coincide or all but coincide; and what is refused.

use ao4d::geometry::{Cone, Vector, Vector64, narrow, widen};
use ao4d::occlusion::exact::{Budget, Hemisphere, visible_fraction};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

use super::scenes::*;

in_3d_and_4d! {
    subdivided_occluder complementary_parts_of_an_enclosure copies_moved_by_an_ulp symmetric_scenes slivers tiny_distances over_budget
}

fn subdivided_occluder<const D: usize>() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut worst = 0.0f64;
    for _ in 0..20 {
        // Coordinates on a coarse grid, so that midpoints are exact.
        let grid = |simplices: Simplices<D>| -> Simplices<D> {
            simplices.iter().map(|s| s.map(|v| v.map(|x| (x * 1024.0).round() / 1024.0))).collect()
        };
        let whole = grid(soup::<D>(&mut rng, 5, 0.8));
        let mut pieces = whole.clone();
        for _ in 0..2 {
            pieces = pieces
                .iter()
                .flat_map(|s| bisect_edges(&s.map(|v| widen(&v))))
                .map(|s| s.map(|v| narrow(&v)))
                .collect();
        }
        let p = Vector::zeros();
        let n = random_vector::<D>(&mut rng);
        let both: Simplices<D> = whole.iter().chain(&pieces).copied().collect();
        let (a, b, c) = (value(&p, &n, &whole), value(&p, &n, &pieces), value(&p, &n, &both));
        worst = worst.max((a - b).abs()).max((a - c).abs());
    }
    println!("largest change by subdivision: {worst:e}");
    assert!(worst < 1e-12);
}

/// A convex surface around p tiles its directions: what one part of it leaves open the rest covers. Turned boxes
/// have planes that all but coincide; points close to walls, edges and corners see them nearly from within.
fn complementary_parts_of_an_enclosure<const D: usize>() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let (mut worst, mut count, mut skipped) = (0.0f64, 0, 0);
    for round in 0..96 {
        let mut body = box_surface::<D>([-1.0; D], [1.0; D], 1 + round % 2);
        let (turn, scale, shift) =
            ([false, true][round / 8 % 2], [1.0, 1e-6, 1e5][round / 16 % 3], [0.0, 100.0][round / 48 % 2]);
        let angle = rng.random::<f64>();
        let place = |v: &Vector64<D>| {
            let mut v = *v;
            if turn {
                v = turned(&v, angle);
            }
            narrow(&((v + Vector64::from_element(shift)) * scale))
        };
        for simplex in &mut body {
            *simplex = simplex.map(|v| place(&widen(&v)));
        }
        // From the middle to within 1e-6 of a wall, of two, of three (and a corner).
        for close in 0..=D {
            let p = Vector64::<D>::from_fn(|i, _| {
                if i < close {
                    1.0 - [0.1, 1e-4, 1e-6, 1.2e-7][round / 2 % 4] * (1.0 + rng.random::<f64>())
                } else {
                    rng.random::<f64>() - 0.5
                }
            });
            let p = place(&p);
            let middle = place(&Vector64::zeros());
            // Rounding may put p outside, or a wall's simplices behind each other as seen from so close.
            let orientation = |from, simplex| Cone::of_simplex(from, simplex).orientation();
            if body.iter().any(|simplex| orientation(&p, simplex) != orientation(&middle, simplex)) {
                skipped += 1;
                continue;
            }
            count += 1;
            let n = random_vector::<D>(&mut rng);
            let (mut part, mut rest) = (Vec::new(), Vec::new());
            for simplex in &body {
                if rng.random() { part.push(*simplex) } else { rest.push(*simplex) }
            }
            let (a, b) = (value(&p, &n, &part), value(&p, &n, &rest));
            worst = worst.max((a + b - 1.0).abs());
        }
    }
    println!("largest error of complements: {worst:e}, {count} points, {skipped} not seeing all of the inside");
    assert!(count > 3 * skipped);
    assert!(worst < 1e-12);
}

/// Occluders beside copies of themselves that differ in the last bits: nothing may jump.
fn copies_moved_by_an_ulp<const D: usize>() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut worst = 0.0f64;
    for round in 0..12 {
        let mut whole = soup::<D>(&mut rng, 3, 0.8);
        whole.extend(box_surface::<D>(std::array::from_fn(|i| 0.2 + i as f32 / 8.0), [0.9; D], 1));
        let mut copies = whole.clone();
        for copy in 0..1 + round % 3 {
            for simplex in &whole {
                copies.push(simplex.map(|v| {
                    v.map(|x| match rng.random_range(0..3 + copy) {
                        0 => x.next_up(),
                        1 => x.next_down(),
                        _ => x,
                    })
                }));
            }
        }
        let p = Vector::zeros();
        let n = random_vector::<D>(&mut rng);
        let (a, b) = (value(&p, &n, &whole), value(&p, &n, &copies));
        worst = worst.max((a - b).abs());
        let mut shuffled = copies.clone();
        for i in (1..shuffled.len()).rev() {
            shuffled.swap(i, rng.random_range(0..=i));
        }
        let c = value(&p, &n, &shuffled);
        assert!((b - c).abs() < 1e-12, "order matters: {b} {c}");
    }
    println!("largest change by copies an ulp away: {worst:e}");
    assert!(worst < 1e-6);
}

/// Exchanging and mirroring axes changes no value; nor does the order, the scale or a turn by much.
fn symmetric_scenes<const D: usize>() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let mut worst = 0.0f64;
    for _ in 0..10 {
        let mut scene = soup::<D>(&mut rng, 15, 0.6);
        scene.extend(box_surface::<D>([0.5; D], std::array::from_fn(|i| 1.0 + i as f32 / 4.0), 2));
        scene.extend(ball::<D>(-Vector::<D>::from_element(0.6), 0.5, 1));
        let (p, n) = (Vector::zeros(), random_vector::<D>(&mut rng));
        let a = value(&p, &n, &scene);
        for round in 0..D {
            let place = |v: &Vector<D>| {
                Vector::<D>::from_fn(|r, _| v[(r + round) % D] * if round >> (r % 2) & 1 == 1 { -2.0 } else { 2.0 })
            };
            let mut moved: Simplices<D> = scene.iter().map(|s| s.each_ref().map(place)).collect();
            moved.reverse();
            moved.iter_mut().for_each(|s| s.rotate_left(round % D));
            worst = worst.max((value(&p, &place(&n), &moved) - a).abs());
        }
        let turn = |v: &Vector<D>| narrow(&turned(&widen(v), 0.4));
        let moved: Simplices<D> = scene.iter().map(|s| s.each_ref().map(turn)).collect();
        assert!((value(&p, &turn(&n), &moved) - a).abs() < 1e-5);
    }
    println!("largest change by symmetries: {worst:e}");
    assert!(worst < 1e-12);
    // A cross-polytope's corners see the same.
    let body = ball::<D>(Vector::zeros(), 1.0, 0);
    for shell in [0.5f32, 2.0] {
        let mut scene = body.clone();
        scene.extend(box_surface::<D>([-shell; D], [shell; D], 2).iter().filter(|s| s[0][0].abs() != s[1][0].abs()));
        let values: Vec<f64> = (1..D).map(|i| value(&axis(i), &axis(i), &scene)).collect();
        assert!(values.iter().all(|v| (v - values[0]).abs() < 1e-14), "{values:?}");
    }
}

/// Flat and needle-like simplices, some of them all but in a plane with p.
fn slivers<const D: usize>() {
    let mut rng = ChaCha8Rng::seed_from_u64(10);
    let mut worst = 0.0f64;
    for round in 0..40 {
        let flatness = [1e-3f32, 1e-6, 1e-9, 0.0][round % 4];
        let mut scene = soup::<D>(&mut rng, 20, 1.0);
        for (k, simplex) in scene.iter_mut().enumerate() {
            match k % 3 {
                // The last vertex nearly on an edge, or on the ray through another, or the first axis squeezed.
                0 => simplex[D - 1] = (simplex[0] + simplex[1]) * 0.5 + random_vector(&mut rng) * flatness,
                1 => simplex[D - 1] = simplex[0] * 2.0 + random_vector(&mut rng) * flatness,
                _ => simplex.iter_mut().for_each(|v| v[0] = 0.3 * v[1] + v[0] * flatness),
            }
        }
        let (p, n) = (Vector::zeros(), random_vector::<D>(&mut rng));
        let a = value(&p, &n, &scene);
        let (mean, error) = monte_carlo(&mut rng, &p, &n, &scene, 5000);
        assert!((a - mean).abs() < 5.0 * error, "{a} {mean} {error}");
        let mut reversed = scene.clone();
        reversed.reverse();
        reversed.extend(&scene);
        worst = worst.max((value(&p, &n, &reversed) - a).abs());
    }
    println!("largest change by order among slivers: {worst:e}");
    assert!(worst < 1e-12);
}

/// A point at all but no distance from a corner, an edge, ... of its enclosure: cones that are all but half-spaces.
fn tiny_distances<const D: usize>() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut worst = 0.0f64;
    for round in 0..60 {
        let distance = [1e-3f32, 1e-10, 1e-20, 1e-30][round % 4];
        let near = round / 4 % (D + 1);
        let body = box_surface::<D>([-1.0; D], [0.0; D], 1 + round % 2);
        let p = Vector::<D>::from_fn(|i, _| if i < near { -distance } else { -0.9 * rng.random::<f32>() });
        let n = random_vector::<D>(&mut rng);
        let whole = value(&p, &n, &body);
        worst = worst.max(whole.abs());
        let (part, rest): (Simplices<D>, Simplices<D>) = body.iter().partition(|_| rng.random());
        let error = (value(&p, &n, &part) + value(&p, &n, &rest) - 1.0).abs();
        worst = worst.max(error);
    }
    println!("largest error at tiny distances: {worst:e}");
    assert!(worst < 1e-12);
}

fn over_budget<const D: usize>() {
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    let scene = soup::<D>(&mut rng, 50, 1.0);
    let p = Vector::zeros();
    let error = visible_fraction(&p, &axis(0), [], scene, Budget { cones: 20 }).unwrap().unwrap_err();
    let message = error.to_string();
    for part in ["simplices above the horizon", "(0, 0, 0", "more than 20 cones", "max_cones", "method: sobol"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn bad_input_is_refused() {
    let p = Vector::<4>::zeros();
    assert!(Hemisphere::new(&p, &p).is_none());
    assert!(Hemisphere::new(&p, &(axis(0) * f32::NAN)).is_none());
    let mut hemisphere = Hemisphere::new(&p, &axis(0)).unwrap();
    assert!(hemisphere.add(&[axis(0) * f32::INFINITY; 4]).is_none());
    assert!(hemisphere.add_incident(&[axis(0); 2]).is_none());
    assert_eq!(hemisphere.occluders(), 0);
}
