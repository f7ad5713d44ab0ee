//! Simplices of R^D: D points, a triangle in 3D and a tetrahedron in 4D.

use super::sign::minor_sign;
use super::{Column, Cone, Dimension, Vector, Vector64, cross, widen};

/// The normal of a simplex: the generalised cross product of its edges from vertex 0, of length (D-1)! times its
/// measure. Exchanging two vertices turns it round.
///
/// With D + 1 points of R^D, `normal_of(facet) . (apex - facet[0])` is `det[apex - facet[0], edges...]`.
#[inline]
pub fn normal_of<const D: usize>(vertices: &[Vector64<D>; D]) -> Vector64<D> {
    let mut edges = [Vector64::<D>::zeros(); 4];
    for i in 1..D {
        edges[i - 1] = vertices[i] - vertices[0];
    }
    cross(&edges[..D - 1])
}

/// The (D-1)-measure: the area of a triangle, the 3-volume of a tetrahedron.
pub fn measure<const D: usize>(vertices: &[Vector64<D>; D]) -> f64 {
    normal_of(vertices).norm() / f64::from(Dimension::of::<D>().simplices_a_cube())
}

/// Whether the simplex has measure zero, exactly.
pub fn is_degenerate<const D: usize>(vertices: &[Vector<D>; D]) -> bool {
    let wide = vertices.each_ref().map(widen);
    let normal = normal_of(&wide);
    let bound: f64 = (1..D).map(|i| (wide[i] - wide[0]).iter().map(|x| x.abs()).sum::<f64>()).product();
    if normal.iter().any(|x| x.abs() > 32.0 * f64::EPSILON * bound) {
        return false;
    }
    let columns: Vec<Column<D>> = (1..D).map(|i| Column::edge(vertices[i], vertices[0])).collect();
    (0..D).all(|row| minor_sign(&columns, row) == 0)
}

/// Which side of the simplex's hyperplane a point is on, exactly: 1 where its normal points, -1 behind, 0 in it.
pub fn plane_side<const D: usize>(vertices: &[Vector<D>; D], point: &Vector<D>) -> i32 {
    // det[v_i - p] = -(normal . (p - v_0)).
    -Cone::of_simplex(point, vertices).orientation()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check<const D: usize>() {
        // The corner simplex 0, e_1, ..., e_(D-1) lies in x_D = 0, and its normal is along x_D.
        let corner: [Vector<D>; D] =
            std::array::from_fn(|i| Vector::from_fn(|r, _| if i > 0 && r == i - 1 { 1.0 } else { 0.0 }));
        let wide = corner.each_ref().map(widen);
        let normal = normal_of(&wide);
        assert_eq!(normal.norm(), 1.0);
        assert!((measure(&wide) - Dimension::of::<D>().pick(0.5, 1.0 / 6.0)).abs() < 1e-16);
        let ahead = Vector::<D>::from_fn(|r, _| normal[r] as f32);
        assert_eq!(plane_side(&corner, &ahead), 1);
        assert_eq!(plane_side(&corner, &-ahead), -1);
        assert_eq!(plane_side(&corner, &Vector::from_fn(|r, _| if r == D - 1 { 0.0 } else { 7.5 })), 0);
        assert!(!is_degenerate(&corner));
        let mut flat = corner;
        flat[D - 1] = (flat[0] + flat[1]) * 0.5;
        assert!(is_degenerate(&flat));
        flat[D - 1][D - 1] = f32::MIN_POSITIVE;
        assert!(!is_degenerate(&flat), "a sliver is not degenerate, however thin");
    }

    #[test]
    fn normals_sides_and_degeneracy() {
        check::<3>();
        check::<4>();
    }
}
