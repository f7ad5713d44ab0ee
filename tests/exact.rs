//! Exact ambient occlusion against values known by other means, in 3D and 4D.

use ao4d::geometry::{Column, Cone, Vector, Vector64, narrow, normal_of, widen};
use ao4d::occlusion::exact::{Budget, Hemisphere, visible_fraction};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

type Simplices<const D: usize> = Vec<[Vector<D>; D]>;

fn axis<const D: usize>(i: usize) -> Vector<D> {
    Vector::from_fn(|r, _| f32::from(u8::from(r == i)))
}

/// The exact value at `p`, simplices that contain it sorted out by identity.
fn value<const D: usize>(p: &Vector<D>, n: &Vector<D>, simplices: &[[Vector<D>; D]]) -> f64 {
    let incident = simplices.iter().filter_map(|s| {
        let at = s.iter().position(|v| v == p)?;
        let mut others = *s;
        others.swap(at, D - 1);
        Some(others)
    });
    let others = simplices.iter().filter(|s| !s.contains(p)).copied();
    visible_fraction(p, n, incident, others, Budget::default()).expect("sound input").expect("within the budget")
}

/// The (D-1)! simplices of the unit cube in the axes `axes`, as steps of 0 or 1 along each axis (Kuhn).
fn kuhn<const D: usize>(axes: &[usize]) -> Vec<Vec<[usize; D]>> {
    fn walk<const D: usize>(
        at: [usize; D],
        left: &[usize],
        path: &mut Vec<[usize; D]>,
        out: &mut Vec<Vec<[usize; D]>>,
    ) {
        path.push(at);
        if left.is_empty() {
            out.push(path.clone());
        }
        for (i, &axis) in left.iter().enumerate() {
            let mut next = at;
            next[axis] += 1;
            let mut rest = left.to_vec();
            rest.remove(i);
            walk(next, &rest, path, out);
        }
        path.pop();
    }
    let mut out = Vec::new();
    walk([0; D], axes, &mut Vec::new(), &mut out);
    out
}

/// The boundary of a box, each edge cut into n.
fn box_surface<const D: usize>(min: [f32; D], max: [f32; D], n: usize) -> Simplices<D> {
    let corner = |steps: [usize; D]| {
        Vector::<D>::from_fn(|r, _| {
            if steps[r] == n { max[r] } else { min[r] + (max[r] - min[r]) * steps[r] as f32 / n as f32 }
        })
    };
    let mut simplices = Vec::new();
    for fixed in 0..D {
        let free: Vec<usize> = (0..D).filter(|&i| i != fixed).collect();
        let paths = kuhn::<D>(&free);
        for side in [0, n] {
            for cell in 0..n.pow(D as u32 - 1) {
                let mut base = [0; D];
                base[fixed] = side;
                let mut rest = cell;
                for &i in &free {
                    base[i] = rest % n;
                    rest /= n;
                }
                for path in &paths {
                    simplices.push(std::array::from_fn(|k| corner(std::array::from_fn(|i| base[i] + path[k][i]))));
                }
            }
        }
    }
    simplices
}

/// The boundary of the cross-polytope, its simplices' edges cut into 2 `levels` times and its vertices moved to the sphere.
fn ball<const D: usize>(centre: Vector<D>, radius: f64, levels: usize) -> Simplices<D> {
    let mut simplices: Vec<[Vector64<D>; D]> = (0..1usize << D)
        .map(|signs| std::array::from_fn(|i| widen(&axis::<D>(i)) * if signs >> i & 1 == 1 { -1.0 } else { 1.0 }))
        .collect();
    for _ in 0..levels {
        simplices = simplices.iter().flat_map(|s| bisect_longest(s)).collect();
    }
    simplices.iter().map(|s| s.map(|v| narrow(&(v.normalize() * radius + widen(&centre))))).collect()
}

/// Cuts a simplex at the midpoints of its edges: corners, and (4D) the octahedron between them in four.
fn bisect_longest<const D: usize>(s: &[Vector64<D>; D]) -> Simplices64<D> {
    let m = |i: usize, j: usize| (s[i] + s[j]) / 2.0;
    let pick = |list: &[Vector64<D>]| -> [Vector64<D>; D] { std::array::from_fn(|i| list[i]) };
    if D == 3 {
        let (a, b, c) = (m(0, 1), m(1, 2), m(2, 0));
        return vec![pick(&[s[0], a, c]), pick(&[a, s[1], b]), pick(&[c, b, s[2]]), pick(&[a, b, c])];
    }
    let (ab, ac, ad, bc, bd, cd) = (m(0, 1), m(0, 2), m(0, 3), m(1, 2), m(1, 3), m(2, 3));
    vec![
        pick(&[s[0], ab, ac, ad]),
        pick(&[s[1], ab, bc, bd]),
        pick(&[s[2], ac, bc, cd]),
        pick(&[s[3], ad, bd, cd]),
        pick(&[ab, cd, ac, ad]),
        pick(&[ab, cd, ad, bd]),
        pick(&[ab, cd, bd, bc]),
        pick(&[ab, cd, bc, ac]),
    ]
}
type Simplices64<const D: usize> = Vec<[Vector64<D>; D]>;

/// Turned by an angle in each plane of neighbouring axes.
fn turned<const D: usize>(v: &Vector64<D>, angle: f64) -> Vector64<D> {
    let (sin, cos) = angle.sin_cos();
    let mut v = *v;
    for i in 1..D {
        (v[i - 1], v[i]) = (v[i - 1] * cos - v[i] * sin, v[i - 1] * sin + v[i] * cos);
    }
    v
}

fn random_vector<const D: usize>(rng: &mut ChaCha8Rng) -> Vector<D> {
    Vector::from_fn(|_, _| rng.random::<f32>() * 2.0 - 1.0)
}

/// Random simplices with edges of about `size`, around the origin but not at it.
fn soup<const D: usize>(rng: &mut ChaCha8Rng, count: usize, size: f32) -> Simplices<D> {
    (0..count)
        .map(|_| {
            let centre = random_vector::<D>(rng).normalize() * (0.3 + rng.random::<f32>());
            std::array::from_fn(|_| centre + random_vector::<D>(rng) * size)
        })
        .collect()
}

/// Mean visibility and its standard error by rays, each tested against every cone with exact signs.
fn monte_carlo<const D: usize>(
    rng: &mut ChaCha8Rng,
    p: &Vector<D>,
    n: &Vector<D>,
    simplices: &[[Vector<D>; D]],
    rays: usize,
) -> (f64, f64) {
    let cones: Vec<Cone<D>> = simplices
        .iter()
        .map(|s| match s.iter().position(|v| v == p) {
            None => Cone::of_simplex(p, s),
            Some(at) => {
                Cone::new(std::array::from_fn(|i| if i == at { Column::vector(-n) } else { Column::edge(s[i], *p) }))
            }
        })
        .collect();
    let normal = widen(n).normalize();
    let mut open = 0usize;
    for _ in 0..rays {
        // A point of the unit ball of the horizon, lifted to the hemisphere: cosine-weighted.
        let direction = loop {
            let v = Vector64::<D>::from_fn(|_, _| rng.random::<f64>() * 2.0 - 1.0);
            let flat = v - normal * v.dot(&normal);
            // The flat part of a point of the cube is uniform near the centre only where the cube reaches: use the ball.
            if v.norm() <= 1.0 {
                let radius = rng.random::<f64>().powf(1.0 / (D as f64 - 1.0));
                let tangent = flat.normalize() * radius;
                break tangent + normal * (1.0 - radius * radius).max(0.0).sqrt();
            }
        };
        let direction = narrow(&direction);
        open += usize::from(!cones.iter().any(|cone| cone.contains(&direction)));
    }
    let mean = open as f64 / rays as f64;
    (mean, (mean * (1.0 - mean) / rays as f64).sqrt().max(1.0 / rays as f64))
}

macro_rules! in_3d_and_4d {
    ($($name:ident)*) => { $(
        mod $name {
            #[test] fn in_3d() { super::checks::$name::<3>() }
            #[test] fn in_4d() { super::checks::$name::<4>() }
        }
    )* };
}

in_3d_and_4d! {
    nothing_occludes_nothing orthant half_space fold enclosed_in_a_box enclosed_in_a_ball convex_body_alone
    random_soup_by_rays subdivided_occluder complementary_parts_of_an_enclosure copies_moved_by_an_ulp
    ball_above_a_horizon circular_cone symmetric_scenes slivers tiny_distances over_budget
}

mod checks {
    use super::*;

    pub fn nothing_occludes_nothing<const D: usize>() {
        let p = Vector::<D>::from_element(0.3);
        assert!((value(&p, &(axis(0) * 7.0 + axis(1)), &[]) - 1.0).abs() < 1e-14);
    }

    pub fn orthant<const D: usize>() {
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

    pub fn half_space<const D: usize>() {
        let half: Simplices<D> = (0..1usize << (D - 1))
            .map(|signs| {
                std::array::from_fn(|i| if i > 0 && signs >> (i - 1) & 1 == 1 { -axis::<D>(i) } else { axis(i) })
            })
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

    pub fn fold<const D: usize>() {
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

    pub fn enclosed_in_a_box<const D: usize>() {
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

    pub fn enclosed_in_a_ball<const D: usize>() {
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

    pub fn convex_body_alone<const D: usize>() {
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

    pub fn random_soup_by_rays<const D: usize>() {
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

    pub fn subdivided_occluder<const D: usize>() {
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
                    .flat_map(|s| bisect_longest(&s.map(|v| widen(&v))))
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
    pub fn complementary_parts_of_an_enclosure<const D: usize>() {
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
    pub fn copies_moved_by_an_ulp<const D: usize>() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut worst = 0.0f64;
        for round in 0..40 {
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

    /// Distance of the planes of a tessellated ball's simplices from its centre, at least.
    fn inradius<const D: usize>(simplices: &[[Vector<D>; D]], centre: Vector<D>) -> f64 {
        let distance = |simplex: &[Vector<D>; D]| {
            let vertices = simplex.each_ref().map(widen);
            normal_of(&vertices).normalize().dot(&(vertices[0] - widen(&centre))).abs()
        };
        simplices.iter().map(distance).fold(f64::INFINITY, f64::min)
    }

    /// A ball of radius r at distance d in direction u takes (r / d)^(D-1) (u . n).
    pub fn ball_above_a_horizon<const D: usize>() {
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
    pub fn circular_cone<const D: usize>() {
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

    /// Exchanging and mirroring axes changes no value; nor does the order, the scale or a turn by much.
    pub fn symmetric_scenes<const D: usize>() {
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
            scene
                .extend(box_surface::<D>([-shell; D], [shell; D], 2).iter().filter(|s| s[0][0].abs() != s[1][0].abs()));
            let values: Vec<f64> = (1..D).map(|i| value(&axis(i), &axis(i), &scene)).collect();
            assert!(values.iter().all(|v| (v - values[0]).abs() < 1e-14), "{values:?}");
        }
    }

    /// Flat and needle-like simplices, some of them all but in a plane with p.
    pub fn slivers<const D: usize>() {
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
    pub fn tiny_distances<const D: usize>() {
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

    pub fn over_budget<const D: usize>() {
        let mut rng = ChaCha8Rng::seed_from_u64(12);
        let scene = soup::<D>(&mut rng, 50, 1.0);
        let p = Vector::zeros();
        let error = visible_fraction(&p, &axis(0), [], scene, Budget { cones: 20 }).unwrap().unwrap_err();
        let message = error.to_string();
        for part in ["exact occlusion", "(0, 0, 0", "more than 20 cones", "method: sobol"] {
            assert!(message.contains(part), "{message}");
        }
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
    for n in 3..=4 {
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
