//! Scenes of simplices, and what is asked of them.

use ao4d::geometry::{Column, Cone, Vector, Vector64, narrow, normal_of, widen};
use ao4d::occlusion::exact::{Budget, visible_fraction};
use rand::{RngExt, rngs::ChaCha8Rng};

pub type Simplices<const D: usize> = Vec<[Vector<D>; D]>;

pub fn axis<const D: usize>(i: usize) -> Vector<D> {
    Vector::from_fn(|r, _| f32::from(u8::from(r == i)))
}

/// The exact value at `p`, simplices that contain it sorted out by identity.
pub fn value<const D: usize>(p: &Vector<D>, n: &Vector<D>, simplices: &[[Vector<D>; D]]) -> f64 {
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
pub fn box_surface<const D: usize>(min: [f32; D], max: [f32; D], n: usize) -> Simplices<D> {
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
pub fn ball<const D: usize>(centre: Vector<D>, radius: f64, levels: usize) -> Simplices<D> {
    let mut simplices: Vec<[Vector64<D>; D]> = (0..1usize << D)
        .map(|signs| std::array::from_fn(|i| widen(&axis::<D>(i)) * if signs >> i & 1 == 1 { -1.0 } else { 1.0 }))
        .collect();
    for _ in 0..levels {
        simplices = simplices.iter().flat_map(bisect_edges).collect();
    }
    simplices.iter().map(|s| s.map(|v| narrow(&(v.normalize() * radius + widen(&centre))))).collect()
}

/// Distance of the planes of a tessellated ball's simplices from its centre, at least.
pub fn inradius<const D: usize>(simplices: &[[Vector<D>; D]], centre: Vector<D>) -> f64 {
    let distance = |simplex: &[Vector<D>; D]| {
        let vertices = simplex.each_ref().map(widen);
        normal_of(&vertices).normalize().dot(&(vertices[0] - widen(&centre))).abs()
    };
    simplices.iter().map(distance).fold(f64::INFINITY, f64::min)
}

/// Cuts a simplex at the midpoints of its edges: corners, and (4D) the octahedron between them in four.
pub fn bisect_edges<const D: usize>(s: &[Vector64<D>; D]) -> Vec<[Vector64<D>; D]> {
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

/// Turned by an angle in each plane of neighbouring axes.
pub fn turned<const D: usize>(v: &Vector64<D>, angle: f64) -> Vector64<D> {
    let (sin, cos) = angle.sin_cos();
    let mut v = *v;
    for i in 1..D {
        (v[i - 1], v[i]) = (v[i - 1] * cos - v[i] * sin, v[i - 1] * sin + v[i] * cos);
    }
    v
}

pub fn random_vector<const D: usize>(rng: &mut ChaCha8Rng) -> Vector<D> {
    Vector::from_fn(|_, _| rng.random::<f32>() * 2.0 - 1.0)
}

/// Random simplices with edges of about `size`, around the origin but not at it.
pub fn soup<const D: usize>(rng: &mut ChaCha8Rng, count: usize, size: f32) -> Simplices<D> {
    (0..count)
        .map(|_| {
            let centre = random_vector::<D>(rng).normalize() * (0.3 + rng.random::<f32>());
            std::array::from_fn(|_| centre + random_vector::<D>(rng) * size)
        })
        .collect()
}

/// Mean visibility and its standard error by rays, each tested against every cone with exact signs.
pub fn monte_carlo<const D: usize>(
    rng: &mut ChaCha8Rng,
    p: &Vector<D>,
    n: &Vector<D>,
    simplices: &[[Vector<D>; D]],
    rays: usize,
) -> (f64, f64) {
    let (_, mean, error) = monte_carlo_vector(rng, p, n, simplices, rays);
    (mean, error)
}

/// The same beside the mean of direction times visibility.
pub fn monte_carlo_vector<const D: usize>(
    rng: &mut ChaCha8Rng,
    p: &Vector<D>,
    n: &Vector<D>,
    simplices: &[[Vector<D>; D]],
    rays: usize,
) -> (Vector64<D>, f64, f64) {
    let mut vector = Vector64::<D>::zeros();
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
        if !cones.iter().any(|cone| cone.contains(&direction)) {
            open += 1;
            vector += widen(&direction);
        }
    }
    let mean = open as f64 / rays as f64;
    let error = (mean * (1.0 - mean) / rays as f64).sqrt().max(1.0 / rays as f64);
    (vector / rays as f64, mean, error)
}
