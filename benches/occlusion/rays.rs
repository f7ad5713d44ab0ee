//! The rays that Embree gets: cosine-weighted directions from one stratified pattern, turned about each vertex's normal by
//! a random rotation; origins a little off the surface. The same numbers as `ao_common.h` makes of the same pattern.

use ao4d::geometry::{Vector, Vector64, normal_of};

use crate::meshes::Mesh;

struct Pcg32(u64);

impl Pcg32 {
    fn new(key: u64) -> Self {
        let mut r = Self(key.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(0xD1B5_4A32_D192_ED03));
        r.next();
        r.next();
        r
    }

    fn next(&mut self) -> u32 {
        let o = self.0;
        self.0 = o.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((((o >> 18) ^ o) >> 27) as u32).rotate_right((o >> 59) as u32)
    }

    fn symmetric(&mut self) -> f32 {
        2.0 * ((self.next() >> 8) as f32 * 5.960_464_5e-8) - 1.0
    }
}

/// `n` points of the unit (D-1)-ball, one in each cell of a recursive median split, so that neighbours in the list are
/// neighbours in the ball; each with the height of the hemisphere over it.
pub fn pattern<const D: usize>(n: usize) -> Vec<[f32; D]> {
    const OVER: usize = 32;
    let mut random = Pcg32::new(12345 + D as u64);
    let mut points = Vec::new();
    while points.len() < n * OVER {
        let p: Vec<f32> = (0..D - 1).map(|_| random.symmetric()).collect();
        if p.iter().map(|x| x * x).sum::<f32>() < 1.0 {
            points.push(p);
        }
    }
    let mut table = Vec::new();
    split(&mut points, OVER, &mut random, &mut table);
    let height = |p: &[f32]| (1.0 - p.iter().map(|x| x * x).sum::<f32>()).max(0.0).sqrt();
    table.iter().map(|p| std::array::from_fn(|k| if k < D - 1 { p[k] } else { height(p) })).collect()
}

fn split(points: &mut [Vec<f32>], over: usize, random: &mut Pcg32, table: &mut Vec<Vec<f32>>) {
    if points.len() <= over {
        table.push(points[random.next() as usize % points.len()].clone());
        return;
    }
    let extent = |d: usize| {
        let (low, high) = points.iter().fold((9f32, -9f32), |(l, h), p| (l.min(p[d]), h.max(p[d])));
        high - low
    };
    let axis = (0..points[0].len()).max_by(|&a, &b| extent(a).total_cmp(&extent(b))).unwrap();
    points.sort_by(|p, q| p[axis].total_cmp(&q[axis]));
    let half = (points.len() / over / 2 * over).max(over);
    let (left, right) = points.split_at_mut(half);
    split(left, over, random, table);
    split(right, over, random, table);
}

/// Measure-weighted vertex normals.
pub fn normals<const D: usize>(mesh: &Mesh) -> Vec<Vector<D>> {
    let vertex = |i: u32| Vector64::<D>::from_fn(|r, _| f64::from(mesh.v[i as usize * D + r]));
    let mut sums = vec![Vector64::<D>::zeros(); mesh.nv()];
    for simplex in mesh.f.chunks(D) {
        let normal = normal_of(&std::array::from_fn(|k| vertex(simplex[k])));
        simplex.iter().for_each(|&i| sums[i as usize] += normal);
    }
    let up = Vector::from_fn(|r, _| f32::from(r == D - 1));
    sums.iter().map(|s| if s.norm() > 0.0 { (s / s.norm()).map(|x| x as f32) } else { up }).collect()
}

/// How far origins are off the surface.
pub fn offset<const D: usize>(mesh: &Mesh) -> f32 {
    let square = |d: usize| {
        let all = mesh.v.iter().skip(d).step_by(D);
        let (low, high) = all.fold((1e30f32, -1e30f32), |(l, h), &x| (l.min(x), h.max(x)));
        f64::from(high - low).powi(2)
    };
    (1e-4 * (0..D).map(square).sum::<f64>().sqrt()) as f32
}

/// The vertices to trace: all, or above the budget evenly spread blocks of 64 neighbours.
pub fn work_list(vertices: usize, n: usize, max_rays: f64) -> Vec<u32> {
    let blocks = vertices.div_ceil(64);
    let want = ((max_rays / (64.0 * n as f64)) as usize).max(1);
    if want >= blocks {
        return (0..vertices as u32).collect();
    }
    let starts = (0..want).map(|b| (b as f64 * blocks as f64 / want as f64) as usize * 64);
    starts.flat_map(|s| s as u32..(s + 64).min(vertices) as u32).collect()
}

/// The directions for one vertex.
pub fn directions<const D: usize>(table: &[[f32; D]], vertex: u32, n: &Vector<D>, out: &mut Vec<Vector<D>>) {
    let mut t = [Vector::<D>::zeros(); 3];
    let s = 1f32.copysign(n[D - 1]);
    let mut r = Pcg32::new(u64::from(vertex));
    if D == 3 {
        let a = -1.0 / (s + n[2]);
        let b = n[0] * n[1] * a;
        t[0].copy_from_slice(&[1.0 + s * n[0] * n[0] * a, s * b, -s * n[0]]);
        t[1].copy_from_slice(&[b, s + n[1] * n[1] * a, -n[1]]);
        let (mut x, mut y, mut l);
        loop {
            (x, y) = (r.symmetric(), r.symmetric());
            l = x * x + y * y;
            if (1e-6..1.0).contains(&l) {
                break;
            }
        }
        l = 1.0 / l.sqrt();
        (x, y) = (x * l, y * l);
        for d in 0..3 {
            let (a, b) = (t[0][d], t[1][d]);
            t[0][d] = x * a + y * b;
            t[1][d] = x * b - y * a;
        }
    } else {
        let mut u = *n;
        u[D - 1] += s;
        let k = 2.0 / u.iter().map(|x| x * x).sum::<f32>();
        for i in 0..D - 1 {
            t[i] = Vector::from_fn(|d, _| (if i == d { 1.0 } else { 0.0 }) - k * u[i] * u[d]);
        }
        let mut q = [0f32; 4];
        loop {
            q.iter_mut().for_each(|c| *c = r.symmetric());
            let l = q.iter().map(|c| c * c).sum::<f32>();
            if (1e-6..1.0).contains(&l) {
                q.iter_mut().for_each(|c| *c *= 1.0 / l.sqrt());
                break;
            }
        }
        let [w, x, y, z] = q;
        let m = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ];
        let old = t;
        (0..3).for_each(|i| t[i] = old[0] * m[i][0] + old[1] * m[i][1] + old[2] * m[i][2]);
    }
    out.clear();
    out.extend(table.iter().map(|point| {
        // The point of the ball, and how high the hemisphere is over it.
        let (p, z) = (&point[..D - 1], point[D - 1]);
        let mut q = *n * z;
        for k in 0..D - 1 {
            for d in 0..D {
                q[d] += p[k] * t[k][d];
            }
        }
        q
    }));
}
