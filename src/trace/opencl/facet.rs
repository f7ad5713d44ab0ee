//! What devices are told of a simplex: what `crossed` of `kernels/trace.cl` would otherwise make anew for each ray.

use super::layout::Float4;
use crate::geometry::{Dimension, Vector};

/// How many vectors tell a simplex.
pub(super) const fn vectors<const D: usize>() -> usize {
    if D == 4 { 7 } else { 4 }
}

/// The pairs of axes, in the order of the minors of a ray.
const PAIRS: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// A simplex by its corners, of which single precision holds all digits. In this order:
/// - the first corner;
/// - the normal n, with det(x, d1, ..) = x n for each x, where d1, d2 and d3 are the edges from the first corner;
/// - in 3D -d2 and d1, so that their products with w x e are det(e, w, d2) and det(e, d1, w);
/// - in 4D six numbers each whose sums of products with the minors of w and e are det(e, w, d2, d3), det(e, d1, w, d3) and
///   det(e, d1, d2, w);
/// - the size of those numbers, and the size of the normal: what bounds on rounding are made of.
///
/// All is computed in double precision and rounded once.
pub(super) fn facet<const D: usize>(corners: &[Vector<D>; D]) -> Vec<Float4> {
    let edge = |i: usize| -> [f64; 4] {
        let mut edge = [0.0; 4];
        (0..D).for_each(|axis| edge[axis] = f64::from(corners[i][axis]) - f64::from(corners[0][axis]));
        edge
    };
    let size = |edge: &[f64; 4]| edge.iter().map(|x| x.abs()).sum::<f64>();
    let mut numbers = Vec::with_capacity(4 * vectors::<D>());
    numbers.extend((0..4).map(|axis| if axis < D { f64::from(corners[0][axis]) } else { 0.0 }));
    match Dimension::of::<D>() {
        Dimension::Three => {
            let [d1, d2] = [1, 2].map(edge);
            let cross = |i: usize, k: usize| d1[i] * d2[k] - d1[k] * d2[i];
            numbers.extend([cross(1, 2), cross(2, 0), cross(0, 1), 0.0]);
            let [s1, s2] = [&d1, &d2].map(size);
            numbers.extend([-d2[0], -d2[1], -d2[2], s1.max(s2)]);
            numbers.extend([d1[0], d1[1], d1[2], s1 * s2]);
        }
        Dimension::Four => {
            let [d1, d2, d3] = [1, 2, 3].map(edge);
            // Of g and h, what stands beside the minors of w and e in det(w, e, g, h).
            let beside = |g: &[f64; 4], h: &[f64; 4], sign: f64| {
                let of = |pair: usize| {
                    let [i, k] = PAIRS[5 - pair];
                    let sign = if pair == 1 || pair == 4 { -sign } else { sign };
                    sign * (g[i] * h[k] - g[k] * h[i])
                };
                [0, 1, 2, 3, 4, 5].map(of)
            };
            let minors = beside(&d2, &d3, 1.0);
            // det(x, d1, d2, d3), x being one axis after the other.
            let normal = [0, 1, 2, 3].map(|axis| {
                let mut of_axis = 0.0;
                for (pair, [i, k]) in PAIRS.into_iter().enumerate() {
                    of_axis += match axis {
                        _ if axis == i => d1[k] * minors[pair],
                        _ if axis == k => -d1[i] * minors[pair],
                        _ => 0.0,
                    };
                }
                of_axis
            });
            numbers.extend(normal);
            numbers.extend(minors.map(|x| -x));
            numbers.extend(beside(&d1, &d3, 1.0));
            numbers.extend(beside(&d1, &d2, -1.0));
            let [s1, s2, s3] = [&d1, &d2, &d3].map(size);
            numbers.extend([(s2 * s3).max(s1 * s3).max(s1 * s2), s1 * s2 * s3]);
        }
    }
    numbers.chunks_exact(4).map(|v| Float4([0, 1, 2, 3].map(|axis| v[axis] as f32))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By Laplace's expansion of the first column.
    fn determinant(columns: &[Vec<f64>]) -> f64 {
        let Some((first, others)) = columns.split_first() else { return 1.0 };
        let without = |row: usize| -> Vec<Vec<f64>> {
            let mut rest = others.to_vec();
            rest.iter_mut().for_each(|column| _ = column.remove(row));
            rest
        };
        let sign = |row: usize| if row.is_multiple_of(2) { 1.0 } else { -1.0 };
        (0..columns.len()).map(|row| sign(row) * first[row] * determinant(&without(row))).sum()
    }

    /// Small whole numbers, so that all is exact.
    fn check<const D: usize>(state: &mut u32) {
        let mut random = || {
            *state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (*state >> 28) as f32 - 7.0
        };
        let corners: [Vector<D>; D] = std::array::from_fn(|_| Vector::from_fn(|_, _| random()));
        let (w, position) = (Vector::<D>::from_fn(|_, _| random()), Vector::<D>::from_fn(|_, _| random()));
        let found: Vec<f64> = facet(&corners).iter().flat_map(|v| v.0.map(f64::from)).collect();
        assert_eq!(found.len(), 4 * vectors::<D>());
        let wide = |v: Vector<D>| v.iter().map(|&x| f64::from(x)).collect::<Vec<f64>>();
        let e = wide(corners[0] - position);
        let edges: Vec<Vec<f64>> = (1..D).map(|i| wide(corners[i] - corners[0])).collect();
        let with = |first: &[f64]| determinant(&[&[first.to_vec()], &edges[..]].concat());
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let w = wide(w);
        assert_eq!(found[..D], wide(corners[0]));
        assert_eq!([dot(&found[4..], &e), dot(&found[4..], &w)], [with(&e), with(&w)]);
        let minor = |i: usize, k: usize| w[i] * e[k] - w[k] * e[i];
        let (minors, each) = match D {
            3 => (vec![minor(1, 2), minor(2, 0), minor(0, 1)], 4),
            _ => (PAIRS.map(|[i, k]| minor(i, k)).to_vec(), 6),
        };
        for weight in 0..D - 1 {
            let mut columns = [vec![e.clone()], edges.clone()].concat();
            columns[weight + 1] = w.clone();
            assert_eq!(dot(&found[8 + each * weight..], &minors), determinant(&columns), "{D} {weight}");
        }
        let sizes: Vec<f64> = edges.iter().map(|d| d.iter().map(|x| x.abs()).sum()).collect();
        let all: f64 = sizes.iter().product();
        let least = sizes.iter().copied().fold(f64::INFINITY, f64::min);
        let told = if D == 3 { [found[11], found[15]] } else { [found[26], found[27]] };
        assert!(least == 0.0 || told == [(all / least) as f32, all as f32].map(f64::from), "{told:?}");
    }

    #[test]
    fn products_are_the_determinants() {
        let mut state = 3;
        for _ in 0..200 {
            check::<3>(&mut state);
            check::<4>(&mut state);
        }
    }
}
