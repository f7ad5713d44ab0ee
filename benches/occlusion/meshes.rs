//! The meshes that occlusion is timed on: deterministic, in three sizes, the same that Embree gets.

#![allow(clippy::many_single_char_names)]

use std::collections::HashMap;
use std::f64::consts::PI;
use std::io::Write;
use std::path::Path;

/// Simplices over shared vertices, flat: `dim` numbers a vertex, `dim` indices a simplex.
pub struct Mesh {
    pub dim: usize,
    pub v: Vec<f32>,
    pub f: Vec<u32>,
}

impl Mesh {
    fn new(dim: usize) -> Self {
        Mesh { dim, v: vec![], f: vec![] }
    }

    pub fn nv(&self) -> usize {
        self.v.len() / self.dim
    }

    pub fn nf(&self) -> usize {
        self.f.len() / self.dim
    }

    fn push(&mut self, p: &[f64]) -> u32 {
        let i = self.nv() as u32;
        self.v.extend(p.iter().map(|x| *x as f32));
        i
    }

    /// Writes `.smx`: "SMX1", then dimension, counts, vertices and indices, little endian.
    pub fn save(&self, path: &Path) -> std::io::Result<()> {
        let mut w = std::io::BufWriter::new(std::fs::File::create(path)?);
        w.write_all(b"SMX1")?;
        for x in [self.dim, self.nv(), self.nf()] {
            w.write_all(&(x as u32).to_le_bytes())?;
        }
        for x in &self.v {
            w.write_all(&x.to_le_bytes())?;
        }
        for x in &self.f {
            w.write_all(&x.to_le_bytes())?;
        }
        w.flush()
    }
}

/// One of the meshes by name, `bumpy3_10k` to `soup4_1m`.
pub fn named(name: &str) -> Option<Mesh> {
    let (shape, size) = name.split_once('_')?;
    let k = ["10k", "100k", "1m"].iter().position(|s| *s == size)?;
    Some(match shape {
        "bumpy3" => bumpy3([22, 71, 224][k]),
        "knot3" => knot3([357, 1136, 3572][k], [14, 44, 140][k]),
        "cubes3" => cubes3([50, 160, 500][k], [14, 45, 144][k]),
        "soup3" => soup(3, [10_000, 100_000, 1_000_000][k], 0.7),
        "bumpy4" => bumpy4([6, 13, 27][k]),
        "cubes4" => cubes4([9, 20, 43][k], [4, 8, 17][k]),
        "soup4" => soup(4, [10_000, 100_000, 1_000_000][k], 1.25),
        _ => return None,
    })
}

struct Pcg(u64);
impl Pcg {
    fn u32(&mut self) -> u32 {
        let o = self.0;
        self.0 = o.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        let x = (((o >> 18) ^ o) >> 27) as u32;
        x.rotate_right((o >> 59) as u32)
    }
    fn f(&mut self) -> f64 {
        self.u32() as f64 / 4294967296.0
    }
    fn s(&mut self) -> f64 {
        2.0 * self.f() - 1.0
    }
    fn gauss(&mut self) -> f64 {
        let a = self.f().max(1e-12);
        (-2.0 * a.ln()).sqrt() * (2.0 * PI * self.f()).cos()
    }
    fn unit(&mut self, d: usize) -> Vec<f64> {
        let v: Vec<f64> = (0..d).map(|_| self.gauss()).collect();
        norm(&v)
    }
}
fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}
fn norm(a: &[f64]) -> Vec<f64> {
    let l = dot(a, a).sqrt();
    a.iter().map(|x| x / l).collect()
}

// Radial displacement for the unit sphere of any dimension: ridged sines along random fixed axes.
fn bump(p: &[f64]) -> f64 {
    let mut r = Pcg(77);
    let mut h = 0.0;
    for (k, amp) in [(3.0, 0.16), (5.0, 0.10), (9.0, 0.055), (17.0, 0.025)] {
        for _ in 0..2 {
            let a = r.unit(p.len());
            let ph = r.f() * 2.0 * PI;
            let s = (k * dot(&a, p) + ph).sin().abs();
            h += amp * (1.0 - s) * (1.0 - s);
        }
    }
    0.75 + h
}

// Geodesic icosphere of frequency f: 20 f^2 triangles.
fn bumpy3(f: usize) -> Mesh {
    let t = (1.0 + 5f64.sqrt()) / 2.0;
    let iv: Vec<[f64; 3]> = vec![
        [-1., t, 0.],
        [1., t, 0.],
        [-1., -t, 0.],
        [1., -t, 0.],
        [0., -1., t],
        [0., 1., t],
        [0., -1., -t],
        [0., 1., -t],
        [t, 0., -1.],
        [t, 0., 1.],
        [-t, 0., -1.],
        [-t, 0., 1.],
    ];
    let fc = [
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    let mut m = Mesh::new(3);
    let mut ids: HashMap<Vec<(usize, usize)>, u32> = HashMap::new();
    for q in fc {
        let mut get = |i: usize, j: usize, m: &mut Mesh| -> u32 {
            let w = [(q[0], f - i - j), (q[1], i), (q[2], j)];
            let mut key: Vec<(usize, usize)> = w.iter().cloned().filter(|x| x.1 > 0).collect();
            key.sort();
            *ids.entry(key).or_insert_with(|| {
                let mut p = [0.0; 3];
                for (c, k) in w {
                    for d in 0..3 {
                        p[d] += iv[c][d] * k as f64
                    }
                }
                let u = norm(&p);
                let r = bump(&u);
                m.push(&[u[0] * r, u[1] * r, u[2] * r])
            })
        };
        for i in 0..f {
            for j in 0..f - i {
                let a = get(i, j, &mut m);
                let b = get(i + 1, j, &mut m);
                let c = get(i, j + 1, &mut m);
                m.f.extend([a, b, c]);
                if i + j + 2 <= f {
                    let d = get(i + 1, j + 1, &mut m);
                    m.f.extend([b, d, c]);
                }
            }
        }
    }
    m
}

fn knot3(nu: usize, nv: usize) -> Mesh {
    let mut m = Mesh::new(3);
    let c = |t: f64| -> [f64; 3] {
        let (p, q) = (3.0, 7.0);
        let r = 1.0 + 0.45 * (q * t).cos();
        [r * (p * t).cos(), r * (p * t).sin(), 0.45 * (q * t).sin()]
    };
    for i in 0..nu {
        let t = 2.0 * PI * i as f64 / nu as f64;
        let (a, b, o) = (c(t + 1e-4), c(t - 1e-4), c(t));
        let tg = norm(&[a[0] - b[0], a[1] - b[1], a[2] - b[2]]);
        let up = [o[0] + 0.3, o[1] - 0.2, o[2] + 2.0];
        let cr = |x: &[f64], y: &[f64]| {
            vec![x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]
        };
        let n = norm(&cr(&tg, &up));
        let bi = cr(&tg, &n);
        for j in 0..nv {
            let s = 2.0 * PI * j as f64 / nv as f64;
            let r = 0.13 * (1.0 + 0.15 * (8.0 * s).cos());
            let p: Vec<f64> = (0..3).map(|d| o[d] + r * (s.cos() * n[d] + s.sin() * bi[d])).collect();
            m.push(&p);
        }
    }
    for i in 0..nu {
        for j in 0..nv {
            let id = |a: usize, b: usize| ((a % nu) * nv + b % nv) as u32;
            m.f.extend([id(i, j), id(i + 1, j + 1), id(i + 1, j), id(i, j), id(i, j + 1), id(i + 1, j + 1)]);
        }
    }
    m
}

fn quad(m: &mut Mesh, o: [f64; 3], u: [f64; 3], v: [f64; 3], n: usize) {
    let b = m.nv() as u32;
    let k = n as u32 + 1;
    for i in 0..=n {
        for j in 0..=n {
            let (a, c) = (i as f64 / n as f64, j as f64 / n as f64);
            m.push(&[o[0] + a * u[0] + c * v[0], o[1] + a * u[1] + c * v[1], o[2] + a * u[2] + c * v[2]]);
        }
    }
    for i in 0..n as u32 {
        for j in 0..n as u32 {
            let p = b + i * k + j;
            m.f.extend([p, p + k, p + k + 1, p, p + k + 1, p + 1]);
        }
    }
}
fn cubes3(nfl: usize, nc: usize) -> Mesh {
    let mut m = Mesh::new(3);
    quad(&mut m, [-4.0, -4.0, 0.0], [8.0, 0.0, 0.0], [0.0, 8.0, 0.0], nfl);
    for (cx, cy, s, ang) in [(-0.9, -0.2, 1.4, 0.3f64), (1.1, 0.4, 1.8, -0.5)] {
        let (c, sn) = (ang.cos(), ang.sin());
        let p = |x: f64, y: f64, z: f64| [cx + s * (c * x - sn * y), cy + s * (sn * x + c * y), 0.02 + s * (z + 0.5)];
        let h = 0.5;
        for d in 0..3 {
            for sg in [-1.0, 1.0] {
                let mk = |a: f64, b: f64| {
                    let mut q = [0.0; 3];
                    q[d] = sg * h;
                    q[(d + 1) % 3] = a;
                    q[(d + 2) % 3] = b;
                    p(q[0], q[1], q[2])
                };
                let (o, mut e1, mut e2) = (mk(-h, -h), mk(h, -h), mk(-h, h));
                if sg < 0.0 {
                    std::mem::swap(&mut e1, &mut e2)
                }
                let u = [e1[0] - o[0], e1[1] - o[1], e1[2] - o[2]];
                let v = [e2[0] - o[0], e2[1] - o[1], e2[2] - o[2]];
                quad(&mut m, o, u, v, nc);
            }
        }
    }
    m
}
// random simplices in the unit cube; edge length ~ c * n^(-1/dim)
fn soup(dim: usize, n: usize, c: f64) -> Mesh {
    let mut m = Mesh::new(dim);
    let mut r = Pcg(4242 + dim as u64);
    let s = c * (n as f64).powf(-1.0 / dim as f64);
    for i in 0..n {
        let o: Vec<f64> = (0..dim).map(|_| r.f()).collect();
        for k in 0..dim {
            let p: Vec<f64> = o.iter().map(|x| x + s * r.s()).collect();
            m.push(&p);
            m.f.push((dim * i + k) as u32);
        }
    }
    m
}

// ---- 4D: tetrahedral hypersurfaces in R^4 ----
// Kuhn/Freudenthal split of an n^3 lattice cell (6 tets), consistent across neighbours.
const KUHN: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
fn orient4(m: &Mesh, t: [u32; 4], out: &dyn Fn(&[f64]) -> Vec<f64>) -> [u32; 4] {
    let p: Vec<Vec<f64>> = t.iter().map(|i| (0..4).map(|d| m.v[*i as usize * 4 + d] as f64).collect()).collect();
    let n = normal4(&p);
    let c: Vec<f64> = (0..4).map(|d| (p[0][d] + p[1][d] + p[2][d] + p[3][d]) / 4.0).collect();
    if dot(&n, &out(&c)) < 0.0 { [t[0], t[1], t[3], t[2]] } else { t }
}
fn normal4(p: &[Vec<f64>]) -> Vec<f64> {
    let e: Vec<Vec<f64>> = (1..4).map(|k| (0..4).map(|d| p[k][d] - p[0][d]).collect()).collect();
    (0..4)
        .map(|d| {
            let i: Vec<usize> = (0..4).filter(|x| *x != d).collect();
            let q = |r: usize, c: usize| e[r][i[c]];
            let det = q(0, 0) * (q(1, 1) * q(2, 2) - q(1, 2) * q(2, 1))
                - q(0, 1) * (q(1, 0) * q(2, 2) - q(1, 2) * q(2, 0))
                + q(0, 2) * (q(1, 0) * q(2, 1) - q(1, 1) * q(2, 0));
            if d % 2 == 0 { det } else { -det }
        })
        .collect()
}
// Add the image of an n0 x n1 x n2 lattice block.
fn block4(
    m: &mut Mesh,
    n: [usize; 3],
    ids: &mut HashMap<Vec<i64>, u32>,
    map: &dyn Fn([usize; 3]) -> Vec<f64>,
    out: &dyn Fn(&[f64]) -> Vec<f64>,
) {
    let mut get = |p: [usize; 3], m: &mut Mesh| -> u32 {
        let x = map(p);
        let key: Vec<i64> = x.iter().map(|c| (c * 1e6).round() as i64).collect();
        *ids.entry(key).or_insert_with(|| m.push(&x))
    };
    for i in 0..n[0] {
        for j in 0..n[1] {
            for k in 0..n[2] {
                for pm in KUHN {
                    let mut p = [i, j, k];
                    let mut t = [0u32; 4];
                    t[0] = get(p, m);
                    for s in 0..3 {
                        p[pm[s]] += 1;
                        t[s + 1] = get(p, m);
                    }
                    let t = orient4(m, t, out);
                    m.f.extend(t);
                }
            }
        }
    }
}
// Bumpy 3-sphere: the 8 cells of a tesseract, each an n^3 lattice, projected to S^3: 48 n^3 tets.
fn bumpy4(n: usize) -> Mesh {
    let mut m = Mesh::new(4);
    let mut ids = HashMap::new();
    for d in 0..4 {
        for sg in [-1.0, 1.0] {
            let map = |p: [usize; 3]| {
                let mut x = vec![0.0; 4];
                x[d] = sg;
                for s in 0..3 {
                    x[(d + 1 + s) % 4] = (PI / 4.0 * (2.0 * p[s] as f64 / n as f64 - 1.0)).tan();
                }
                let u = norm(&x);
                let r = bump(&u);
                u.iter().map(|c| c * r).collect()
            };
            block4(&mut m, [n, n, n], &mut ids, &map, &|c| c.to_vec());
        }
    }
    m
}
// Two tesseracts above a floor (a 3-flat in R^4), split per cell: floor 6 nf^3 + 16 cells * 6 nc^3.
fn cubes4(nfl: usize, nc: usize) -> Mesh {
    let mut m = Mesh::new(4);
    block4(
        &mut m,
        [nfl; 3],
        &mut HashMap::new(),
        &|p| {
            let g = |i: usize| -4.0 + 8.0 * p[i] as f64 / nfl as f64;
            vec![g(0), g(1), g(2), 0.0]
        },
        &|_| vec![0.0, 0.0, 0.0, 1.0],
    );
    for (c3, s, a1, a2) in [([-0.9, -0.2, 0.1], 1.4, 0.3f64, 0.2f64), ([1.1, 0.4, -0.1], 1.8, -0.5, 0.4)] {
        let place = move |q: &[f64]| -> Vec<f64> {
            let (x, y) = (a1.cos() * q[0] - a1.sin() * q[1], a1.sin() * q[0] + a1.cos() * q[1]);
            let (y, z) = (a2.cos() * y - a2.sin() * q[2], a2.sin() * y + a2.cos() * q[2]);
            vec![c3[0] + s * x, c3[1] + s * y, c3[2] + s * z, 0.02 + s * (q[3] + 0.5)]
        };
        let cen = place(&[0.0; 4]);
        for d in 0..4 {
            for sg in [-1.0, 1.0] {
                let map = |p: [usize; 3]| {
                    let mut q = vec![0.0; 4];
                    q[d] = 0.5 * sg;
                    for k in 0..3 {
                        q[(d + 1 + k) % 4] = p[k] as f64 / nc as f64 - 0.5
                    }
                    place(&q)
                };
                let cen = cen.clone();
                block4(&mut m, [nc; 3], &mut HashMap::new(), &map, &move |c| {
                    c.iter().zip(&cen).map(|(a, b)| a - b).collect()
                });
            }
        }
    }
    m
}
