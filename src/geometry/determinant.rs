//! Small determinants, written out: the generalised cross product and the D x D determinant, for D = 3 and 4.

use super::{Dimension, Vector64};

#[inline(always)]
fn det2(a: f64, b: f64, c: f64, d: f64) -> f64 {
    a * d - b * c
}

/// The generalised cross product of D - 1 vectors: the vector n with `n . x = det[x, edges...]` for every x
/// (the formal determinant of the thesis, 4.4). It is orthogonal to all of them, and its length is the
/// (D-1)-measure of the parallelotope they span, (D-1)! times that of the simplex.
///
/// # Panics
/// If `edges` does not hold D - 1 vectors.
#[inline]
pub fn cross<const D: usize>(edges: &[Vector64<D>]) -> Vector64<D> {
    assert_eq!(edges.len(), D - 1);
    let mut n = Vector64::<D>::zeros();
    match Dimension::of::<D>() {
        Dimension::Three => {
            let (a, b) = (&edges[0], &edges[1]);
            n[0] = det2(a[1], a[2], b[1], b[2]);
            n[1] = -det2(a[0], a[2], b[0], b[2]);
            n[2] = det2(a[0], a[1], b[0], b[1]);
        }
        Dimension::Four => {
            let (a, b, c) = (&edges[0], &edges[1], &edges[2]);
            let xy = det2(b[0], b[1], c[0], c[1]);
            let xz = det2(b[0], b[2], c[0], c[2]);
            let xw = det2(b[0], b[3], c[0], c[3]);
            let yz = det2(b[1], b[2], c[1], c[2]);
            let yw = det2(b[1], b[3], c[1], c[3]);
            let zw = det2(b[2], b[3], c[2], c[3]);
            n[0] = a[1] * zw - a[2] * yw + a[3] * yz;
            n[1] = -(a[0] * zw - a[2] * xw + a[3] * xz);
            n[2] = a[0] * yw - a[1] * xw + a[3] * xy;
            n[3] = -(a[0] * yz - a[1] * xz + a[2] * xy);
        }
    }
    n
}

/// The determinant of the matrix with these columns.
#[inline]
pub fn determinant<const D: usize>(columns: &[Vector64<D>; D]) -> f64 {
    columns[0].dot(&cross(&columns[1..]))
}

/// The same over any numbers, from the first D - 1 of the columns: the cofactors of a column that is left open.
#[inline]
pub(crate) fn cofactors<T: Copy, const D: usize>(
    columns: &[[T; D]; D],
    times: impl Fn(T, T) -> T + Copy,
    plus: impl Fn(T, T) -> T + Copy,
    minus: impl Fn(T, T) -> T + Copy,
) -> [T; D] {
    let minor = |a: usize, b: usize, i: usize, j: usize| {
        minus(times(columns[a][i], columns[b][j]), times(columns[a][j], columns[b][i]))
    };
    std::array::from_fn(|skip| {
        // The rows left, in order, with the first two exchanged where the cofactor's sign is negative.
        let mut rows = [0; D];
        for (place, row) in (0..D).filter(|&row| row != skip).enumerate() {
            rows[place] = row;
        }
        if skip % 2 == 1 {
            rows.swap(0, 1);
        }
        match Dimension::of::<D>() {
            Dimension::Three => minor(0, 1, rows[0], rows[1]),
            Dimension::Four => {
                let (i, j, k) = (rows[0], rows[1], rows[2]);
                let first = times(columns[0][i], minor(1, 2, j, k));
                let second = times(columns[0][j], minor(1, 2, i, k));
                let third = times(columns[0][k], minor(1, 2, i, j));
                plus(minus(first, second), third)
            }
        }
    })
}

/// An integer of 192 bits: `high` times 2^64 plus `low`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WideInteger {
    high: i128,
    low: u64,
}

impl WideInteger {
    /// The determinant of columns of integers, exactly, if an entry has 63 bits at most, and so few that products of one
    /// of each but the first column have 124.
    #[inline]
    pub fn determinant<const D: usize>(columns: &[[i128; D]; D]) -> Self {
        let mut others = *columns;
        others.rotate_left(1);
        let minors = cofactors(&others, |a, b| a * b, |a, b| a + b, |a, b| a - b);
        // The products with the minors may take more than 128 bits: high parts and 64-bit low parts are added apart.
        const LOW: i128 = u64::MAX as i128;
        let (mut high, mut low) = (0i128, 0i128);
        for (entry, minor) in columns[0].into_iter().zip(minors) {
            let product = entry * (minor & LOW);
            high += entry * (minor >> 64) + (product >> 64);
            low += product & LOW;
        }
        Self { high: high + (low >> 64), low: low as u64 }
    }

    /// -1, 0 or 1.
    pub fn sign(self) -> i32 {
        if self.high == 0 { i32::from(self.low != 0) } else { self.high.signum() as i32 }
    }

    /// The number, if it has 128 bits at most.
    pub fn low_128(self) -> i128 {
        self.high << 64 | i128::from(self.low)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check<const D: usize>() {
        // det[x, edges] expands x along the cross product; unit vectors give the signed permutation determinants.
        let unit: [Vector64<D>; D] = std::array::from_fn(|i| Vector64::from_fn(|r, _| f64::from(r == i)));
        assert_eq!(determinant(&unit), 1.0);
        let mut swapped = unit;
        swapped.swap(0, D - 1);
        assert_eq!(determinant(&swapped), -1.0);
        let m: [Vector64<D>; D] =
            std::array::from_fn(|i| Vector64::from_fn(|r, _| ((3 * i + r * r + 1) % 7) as f64 - 2.5));
        let n = cross(&m[1..]);
        for edge in &m[1..] {
            assert!(n.dot(edge).abs() < 1e-12);
        }
        let by_nalgebra = nalgebra::DMatrix::from_fn(D, D, |r, c| m[c][r]).determinant();
        assert!((determinant(&m) - by_nalgebra).abs() < 1e-12 * by_nalgebra.abs().max(1.0));
    }

    #[test]
    fn cross_is_orthogonal_and_determinant_agrees_with_nalgebra() {
        check::<3>();
        check::<4>();
    }
}
