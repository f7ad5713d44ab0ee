//! Eight cones with a common apex, and a filter for whether they hold a direction.
//!
//! As in [`crate::geometry::Cone`], a direction w is in the cone of the vectors e_i if all facet values
//! f_i = det[.. w in place of e_i ..] have the sign of det[e], or are zero. Here the facet normals are computed once for
//! eight cones in `f32`, turned so that inside is positive, and with them a bound E_i on the rounding of f_i for any w
//! of length 1. Then D dot products tell for eight cones at once:
//!
//! - some f_i < -E_i: w is surely outside;
//! - all f_i > E_i: w is surely inside;
//! - else, in rare cases, the exact cone decides.
//!
//! *Rounding.* f_i is a sum of products of D - 1 differences of coordinates and a component of w. On the way into it a
//! product takes a rounding from each difference (D - 1), each multiplication (D - 1) and each sum it goes through, at most
//! 5 for D = 3 and 7 for D = 4: 13 roundings. The sum of the absolute values of all products is at most the product
//! of the 1-norms of the vectors e_j, j != i, as no component of w exceeds 1. So E_i is [`ROUNDING`] times that product,
//! plus [`UNDERFLOW`].

use super::lanes::{Lanes, Row};
use crate::accel::WIDTH;
use crate::geometry::Dimension;

/// 20 half-ulps: the 13 of the facet values, those of the bound itself, and some to spare.
const ROUNDING: f32 = 20.0 / (1 << 24) as f32;
/// More than what products of numbers below 4 lose by underflow.
const UNDERFLOW: f32 = 1e-35;
/// A bound that makes any value negative: a lane that holds nothing.
const NOTHING: f32 = -1e30;

/// Eight cones.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(super) struct Cones<const D: usize> {
    normals: [[Row; D]; D],
    bounds: [Row; D],
    /// Lanes whose orientation is lost in rounding: their normals may point in or out.
    unoriented: u8,
    /// Lanes for which "surely inside" may be believed.
    pub trusted: u8,
}

/// What the filter says of a direction and eight cones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Verdict {
    /// Cones that hold it.
    pub inside: u8,
    /// Cones that may hold it.
    pub doubtful: u8,
}

impl<const D: usize> Cones<D> {
    pub fn new() -> Self {
        let zero = [0.0; WIDTH];
        Self { normals: [[zero; D]; D], bounds: [[NOTHING; WIDTH]; D], unoriented: 0, trusted: 0 }
    }

    /// Sets them to the cones of these vectors, each of 1-norm below 4. Lanes with the sign bit set in `unused` hold
    /// nothing, and those with a zero vector neither: they are flat. Returns the determinants and the squares of the
    /// last facet normals.
    #[inline(always)]
    pub fn set<L: Lanes>(&mut self, edges: &[[L; D]; D], unused: L) -> [L; 2] {
        let zero = L::splat(0.0);
        let mut lengths = [zero; D];
        for i in 0..D {
            lengths[i] = edges[i][0].abs();
            for k in 1..D {
                lengths[i] = lengths[i].add(edges[i][k].abs());
            }
        }
        let normals = facet_normals(edges);
        let determinant = dot(&normals[0], &edges[0]);
        let mut shortest = lengths[0];
        let mut all = lengths[0];
        for &length in &lengths[1..] {
            shortest = shortest.min(length);
            all = all.mul(length);
        }
        for i in 0..D {
            let mut bound = L::splat(ROUNDING);
            for (j, &length) in lengths.iter().enumerate() {
                if j != i {
                    bound = bound.mul(length);
                }
            }
            let mut bound = bound.add(L::splat(UNDERFLOW));
            if i == 0 {
                // 0 - x is negative for every x > 0, however small.
                bound = zero.sub(shortest).select(bound, L::splat(NOTHING));
                bound = unused.select(L::splat(NOTHING), bound);
            }
            bound.store(&mut self.bounds[i]);
        }
        let bound = all.mul_add(L::splat(ROUNDING), L::splat(UNDERFLOW));
        let nothing = L::load(&self.bounds[0]).negative();
        self.unoriented = determinant.abs().less_or_equal(bound) & !nothing;
        self.trusted = !self.unoriented;
        for i in 0..D {
            for k in 0..D {
                normals[i][k].turned_by(determinant).store(&mut self.normals[i][k]);
            }
        }
        [determinant, dot(&normals[D - 1], &normals[D - 1])]
    }

    /// Makes a lane hold nothing.
    pub fn remove(&mut self, lane: usize) {
        self.bounds[0][lane] = NOTHING;
        self.unoriented &= !(1 << lane);
    }

    /// The bounds on the last facet values, and the lanes that hold something.
    #[inline(always)]
    pub fn last_bounds<L: Lanes>(&self) -> (L, u8) {
        (L::load(&self.bounds[D - 1]), !L::load(&self.bounds[0]).negative())
    }

    #[inline(always)]
    fn raised_value<L: Lanes>(&self, i: usize, direction: &[L; D]) -> L {
        let mut value = L::load(&self.bounds[i]);
        for (normal, &component) in self.normals[i].iter().zip(direction) {
            value = L::load(normal).mul_add(component, value);
        }
        value
    }

    /// The cones that may hold the direction. It is the same in all lanes, and no component exceeds 1 by more than
    /// rounding.
    #[inline(always)]
    pub fn candidates<L: Lanes>(&self, direction: &[L; D]) -> u8 {
        let mut least = self.raised_value(0, direction);
        for i in 1..D {
            least = least.min(self.raised_value(i, direction));
        }
        let mut candidates = !least.negative();
        if self.unoriented != 0 {
            let mut greatest = L::splat(f32::NEG_INFINITY);
            for i in 0..D {
                let twice = L::splat(2.0).mul(L::load(&self.bounds[i]));
                greatest = greatest.max(self.raised_value(i, direction).sub(twice));
            }
            candidates |= self.unoriented & greatest.less_or_equal(L::splat(0.0));
        }
        candidates
    }

    /// Tells candidates that surely hold the direction from those that may.
    #[inline(always)]
    pub fn judge<L: Lanes>(&self, candidates: u8, direction: &[L; D]) -> Verdict {
        let mut margin = L::splat(f32::INFINITY);
        for i in 0..D {
            let twice = L::splat(2.01).mul(L::load(&self.bounds[i]));
            margin = margin.min(self.raised_value(i, direction).sub(twice));
        }
        let inside = candidates & self.trusted & !margin.less_or_equal(L::splat(0.0));
        Verdict { inside, doubtful: candidates & !inside }
    }
}

#[inline(always)]
pub(super) fn dot<L: Lanes, const D: usize>(a: &[L; D], b: &[L; D]) -> L {
    let mut sum = a[0].mul(b[0]);
    for k in 1..D {
        sum = a[k].mul_add(b[k], sum);
    }
    sum
}

/// a d - b c
#[inline(always)]
pub(super) fn minor<L: Lanes>(a: L, b: L, c: L, d: L) -> L {
    a.mul_sub(d, b.mul(c))
}

/// The minors of rows (0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3).
#[inline(always)]
pub(super) fn minors<L: Lanes, const D: usize>(a: &[L; D], b: &[L; D]) -> [L; 6] {
    let mut minors = [a[0]; 6];
    for (m, (p, q)) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)].into_iter().enumerate() {
        minors[m] = minor(a[p], a[q], b[p], b[q]);
    }
    minors
}

/// a_0 m_0 - a_1 m_1 + a_2 m_2
#[inline(always)]
pub(super) fn triple<L: Lanes>(a: [L; 3], m: [L; 3]) -> L {
    a[2].mul_add(m[2], a[0].mul_sub(m[0], a[1].mul(m[1])))
}

/// For each i the vector n_i with `n_i . x = det[.. x in place of edge i ..]`.
#[inline(always)]
fn facet_normals<L: Lanes, const D: usize>(edges: &[[L; D]; D]) -> [[L; D]; D] {
    let mut normals = *edges;
    match Dimension::of::<D>() {
        Dimension::Three => {
            for i in 0..3 {
                let (a, b) = (&edges[(i + 1) % 3], &edges[(i + 2) % 3]);
                for k in 0..3 {
                    let (p, q) = ((k + 1) % 3, (k + 2) % 3);
                    normals[i][k] = minor(a[p], a[q], b[p], b[q]);
                }
            }
        }
        Dimension::Four => {
            // The 2 x 2 minors of the first two and of the last two edges serve two normals each.
            let (first, last) = (minors(&edges[0], &edges[1]), minors(&edges[2], &edges[3]));
            let zero = L::splat(0.0);
            for i in 0..4 {
                let (a, [xy, xz, xw, yz, yw, zw]) = (&edges[i ^ 1], if i < 2 { last } else { first });
                let n = [
                    triple([a[1], a[2], a[3]], [zw, yw, yz]),
                    zero.sub(triple([a[0], a[2], a[3]], [zw, xw, xz])),
                    triple([a[0], a[1], a[3]], [yw, xw, xy]),
                    zero.sub(triple([a[0], a[1], a[2]], [yz, xz, xy])),
                ];
                for k in 0..4 {
                    normals[i][k] = if i % 2 == 0 { n[k] } else { zero.sub(n[k]) };
                }
            }
        }
    }
    normals
}
