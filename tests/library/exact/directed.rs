//! The vector b beside A: values in closed form, integrals over the occluders' surfaces, and rays.

use std::f64::consts::PI;

use ao4d::geometry::{Vector, Vector64, normal_of, widen};
use ao4d::occlusion::exact::{Budget, Hemisphere};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;

use super::scenes::*;

in_3d_and_4d! {
    open_hidden_half_and_fold simplices_apart_from_each_other crossing_simplices_by_rays
}

/// c_D, by which the integral over an open hemisphere is 1.
fn constant<const D: usize>() -> f64 {
    if D == 3 { 1.0 / PI } else { 3.0 / (4.0 * PI) }
}

/// |b| where all is open.
fn open<const D: usize>() -> f64 {
    if D == 3 { 2.0 / 3.0 } else { 3.0 * PI / 16.0 }
}

/// A and b at a point with these simplices around.
fn directed<const D: usize>(p: &Vector<D>, n: &Vector<D>, simplices: &[[Vector<D>; D]]) -> (f64, Vector64<D>) {
    let mut hemisphere = Hemisphere::new(p, n).unwrap();
    for simplex in simplices {
        match simplex.iter().position(|v| v == p) {
            None => hemisphere.add(simplex).unwrap(),
            Some(at) => {
                let mut others = *simplex;
                others.swap(at, D - 1);
                hemisphere.add_incident(&others[..D - 1]).unwrap();
            }
        }
    }
    let (fraction, vector) = hemisphere.directed(Budget::default()).unwrap();
    assert_eq!(fraction, hemisphere.visible_fraction(Budget::default()).unwrap(), "A is the same with b beside it");
    (fraction, vector)
}

/// Simplices that hide all directions with w_wall > 0 from the origin.
fn half<const D: usize>(wall: usize) -> Simplices<D> {
    let sign = |signs: usize, i: usize| if signs >> i & 1 == 1 { -1.0f32 } else { 1.0 };
    (0..1usize << (D - 1))
        .map(|signs| {
            let mut free = 0;
            std::array::from_fn(|i| {
                if i == wall {
                    return axis::<D>(i);
                }
                free += 1;
                axis::<D>(i) * sign(signs, free - 1)
            })
        })
        .collect()
}

fn open_hidden_half_and_fold<const D: usize>() {
    let (p, n) = (Vector::<D>::zeros(), axis::<D>(0));
    let (_, b) = directed(&p, &(n * 5.0), &[]);
    assert!((b - widen(&n) * open::<D>()).norm() < 1e-13, "{b}");
    // All but w_1 > 0: half along n, and along the wall's axis the integral of w_0 w_1 over an orthant.
    let (a, b) = directed(&p, &n, &half::<D>(1));
    let across = if D == 3 { 2.0 / (3.0 * PI) } else { 3.0 / 16.0 };
    let expected = widen(&n) * (open::<D>() / 2.0) - widen(&axis::<D>(1)) * across;
    assert!((a - 0.5).abs() < 1e-14 && (b - expected).norm() < 1e-12, "{b} {expected}");
    // A fold of any angle: w_0 > 0 and w . t > 0, with t turned by the angle from n in the plane of the first two axes. In
    // that plane the integrand is the disc's, whose share along e_phi is cos(phi) * e_phi.
    for angle in [0.3f64, 1.0, 1.5, 2.2, 3.0] {
        let wall = Vector::<D>::from_fn(|r, _| match r {
            0 => angle.cos() as f32,
            1 => angle.sin() as f32,
            _ => 0.0,
        });
        let along = Vector::<D>::from_fn(|r, _| match r {
            0 => -wall[1],
            1 => wall[0],
            _ => 0.0,
        });
        // The hidden directions are the cone over -t and +-along and the other axes.
        let hidden: Simplices<D> = (0..1usize << (D - 1))
            .map(|signs| {
                std::array::from_fn(|i| {
                    let sign = if i > 0 && signs >> (i - 1) & 1 == 1 { -1.0f32 } else { 1.0 };
                    match i {
                        0 => -wall,
                        1 => along * sign,
                        _ => axis::<D>(i) * sign,
                    }
                })
            })
            .collect();
        let (a, b) = directed(&p, &n, &hidden);
        // Directions phi in the plane from n, |phi| < pi/2 and |phi - angle| < pi/2. The rest of the sphere gives each the
        // factor c_D times the integral of the squared distance from the axes: 4/3 in 3D and pi/2 in 4D.
        let wall_angle = f64::from(wall[1]).atan2(f64::from(wall[0]));
        let (from, to) = (wall_angle - PI / 2.0, PI / 2.0);
        let radial = constant::<D>() * if D == 3 { 4.0 / 3.0 } else { PI / 2.0 };
        let along_n = 0.5 * (to - from) + 0.25 * ((2.0 * to).sin() - (2.0 * from).sin());
        let across = 0.5 * (to.sin().powi(2) - from.sin().powi(2));
        let expected = (widen(&n) * along_n + widen(&axis::<D>(1)) * across) * radial;
        assert!((a - (1.0 + wall_angle.cos()) / 2.0).abs() < 1e-12, "{a}");
        assert!((b - expected).norm() < 1e-12, "{angle}: {b} {expected}");
    }
}

/// Nodes and weights of Gauss and Legendre on [0, 1], by Newton's method.
fn gauss(count: usize) -> Vec<(f64, f64)> {
    let legendre = |x: f64| {
        let (mut p, mut q) = (1.0, 0.0);
        for k in 0..count {
            let k = k as f64;
            (p, q) = (((2.0 * k + 1.0) * x * p - k * q) / (k + 1.0), p);
        }
        (p, count as f64 * (x * p - q) / (x * x - 1.0))
    };
    let node = |i: usize| {
        let mut x = (PI * (i as f64 + 0.75) / (count as f64 + 0.5)).cos();
        for _ in 0..50 {
            let (p, slope) = legendre(x);
            x -= p / slope;
        }
        let (_, slope) = legendre(x);
        (0.5 + 0.5 * x, 1.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..count).map(node).collect()
}

/// What a simplex wholly above the horizon takes of b, as an integral over its surface instead of over directions:
/// dw = |cos| dS / r^(D-1).
fn taken<const D: usize>(p: &Vector<D>, n: &Vector<D>, simplex: &[Vector<D>; D], nodes: &[(f64, f64)]) -> Vector64<D> {
    let (p, n, corners) = (widen(p), widen(n).normalize(), simplex.each_ref().map(widen));
    let normal = normal_of(&corners).normalize();
    let edges: Vec<Vector64<D>> = (1..D).map(|i| corners[i] - corners[0]).collect();
    // The Gram determinant: the measure of the parallelotope, whose share of the simplex the Duffy weights have.
    let gram = nalgebra::DMatrix::from_fn(D - 1, D - 1, |i, j| edges[i].dot(&edges[j]));
    let size = gram.determinant().sqrt();
    let mut sum = Vector64::zeros();
    for place in 0..nodes.len().pow(D as u32 - 1) {
        let (mut rest, mut left, mut weight, mut x) = (place, 1.0, 1.0, corners[0]);
        for edge in &edges {
            let (node, w) = nodes[rest % nodes.len()];
            rest /= nodes.len();
            let share = left * node;
            weight *= w * left;
            left -= share;
            x += edge * share;
        }
        let way = x - p;
        let r = way.norm();
        let w = way / r;
        sum += w * (w.dot(&n) * w.dot(&normal).abs() / r.powi(D as i32 - 1) * weight * size);
    }
    sum * constant::<D>()
}

fn simplices_apart_from_each_other<const D: usize>() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let nodes = gauss(40);
    let mut worst = 0.0f64;
    for _ in 0..6 {
        let p = random_vector::<D>(&mut rng);
        let n = random_vector::<D>(&mut rng);
        let up = n.normalize();
        // Three small simplices in three directions, each all above the horizon.
        let mut simplices: Simplices<D> = Vec::new();
        let side = Vector::<D>::from_fn(|r, _| [-up[1], up[0]].get(r).copied().unwrap_or(0.0));
        for shift in [-1.3f32, 0.1, 1.6] {
            let centre = p + up * 1.4 + side * shift * 1.5;
            let simplex = std::array::from_fn(|_| centre + random_vector::<D>(&mut rng) * 0.45);
            if simplex.iter().all(|v: &Vector<D>| (v - p).dot(&up) > 0.05) {
                simplices.push(simplex);
            }
        }
        // Those that overlap another in view count twice in the sum of integrals: A tells whether they do.
        let alone: f64 = simplices.iter().map(|s| 1.0 - directed(&p, &n, &[*s]).0).sum();
        let (a, b) = directed(&p, &n, &simplices);
        if simplices.is_empty() || (1.0 - a - alone).abs() > 1e-13 {
            continue;
        }
        let expected = widen(&n).normalize() * open::<D>()
            - simplices.iter().map(|s| taken(&p, &n, s, &nodes)).fold(Vector64::zeros(), |x, y| x + y);
        worst = worst.max((b - expected).norm());
    }
    println!("{D}D: b is at most {worst:e} off the integrals over surfaces");
    assert!(worst > 0.0 && worst < 1e-7, "{worst:e}");
}

/// Simplices that cross each other and the horizon, and a fold at the point, against rays.
fn crossing_simplices_by_rays<const D: usize>() {
    for seed in 0..4 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut simplices = soup::<D>(&mut rng, 12, 0.6);
        let p = simplices[0][0];
        simplices.push(std::array::from_fn(|i| if i == 1 { p } else { random_vector(&mut rng) }));
        let n = random_vector::<D>(&mut rng);
        let (a, b) = directed(&p, &n, &simplices);
        let (mean, open, error) = monte_carlo_vector(&mut rng, &p, &n, &simplices, 10_000);
        assert!((a - open).abs() < 5.0 * error, "{a} {open}");
        // No component varies by more than a half.
        assert!((b - mean).amax() < 4.0 * 0.5 / 100.0, "{b} {mean}");
    }
}
