//! Small determinants, written out: the generalised cross product and the D x D determinant, for D = 3 and 4.

use super::Vector64;

#[inline(always)]
fn det2(a: f64, b: f64, c: f64, d: f64) -> f64 {
    a * d - b * c
}

/// The generalised cross product of D - 1 vectors: the vector n with `n . x = det[x, edges...]` for every x
/// (the formal determinant of the thesis, 4.4). It is orthogonal to all of them, and its length is the
/// (D-1)-measure of the parallelotope they span, (D-1)! times that of the simplex.
///
/// # Panics
/// If `edges` does not hold D - 1 vectors, or D is neither 3 nor 4.
#[inline]
pub fn cross<const D: usize>(edges: &[Vector64<D>]) -> Vector64<D> {
    assert_eq!(edges.len(), D - 1);
    let mut n = Vector64::<D>::zeros();
    match D {
        3 => {
            let (a, b) = (&edges[0], &edges[1]);
            n[0] = det2(a[1], a[2], b[1], b[2]);
            n[1] = -det2(a[0], a[2], b[0], b[2]);
            n[2] = det2(a[0], a[1], b[0], b[1]);
        }
        4 => {
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
        _ => panic!("D is 3 or 4, not {D}"),
    }
    n
}

/// The determinant of the matrix with these columns.
#[inline]
pub fn determinant<const D: usize>(columns: &[Vector64<D>; D]) -> f64 {
    columns[0].dot(&cross(&columns[1..]))
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
