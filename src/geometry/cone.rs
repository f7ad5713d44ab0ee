//! The cone of the directions in which a simplex is seen from a point, and whether it holds a direction.
//!
//! With the edges e_i = v_i - p from a point p to the D vertices of a simplex, a ray from p in direction w hits the
//! simplex at some t > 0 exactly if w = sum mu_i e_i with all mu_i >= 0; then t = 1 / sum mu_i. By Cramer's rule
//! mu_i = det[.. w in place of e_i ..] / det[e], so D + 1 signs decide: those of the D facets and that of the
//! simplex's own hyperplane. No sign depends on a tolerance:
//!
//! - a zero facet determinant counts as inside, for both neighbours, so no ray slips between them;
//! - a point in the simplex's own hyperplane (det[e] = 0) sees nothing of it.
//!
//! Each value is computed in `f64` beside a bound on its rounding error, and exactly where the bound exceeds it.

use super::{Column, Expansion, Vector, Vector64, cross, determinant_sign, exact_determinant, widen};

/// Rounding of a D x D determinant of edges, relative to the product of the 1-norms of its columns: each of the D!
/// products has D differences and D - 1 multiplications, then at most D (D - 1) / 2 + D additions; 32 half-ulps are
/// more than all of them together for D = 4.
const ROUNDING: f64 = 32.0 * (f64::EPSILON / 2.0);

/// The cone spanned by D vectors, with its facets' inward normals.
#[derive(Clone, Debug)]
pub struct Cone<const D: usize> {
    columns: [Column<D>; D],
    /// `det[w in place of column i] = normals[i] . w`, not normalised, before `orientation` is applied.
    normals: [Vector64<D>; D],
    /// Bounds on the rounding of `normals[i] . w`, for |w|_1 = 1.
    bounds: [f64; D],
    /// The sign of the determinant of the columns, -1, 0 or 1.
    orientation: i32,
    /// The determinant of the columns, rounded, and a bound on that rounding.
    determinant: f64,
    determinant_bound: f64,
}

/// Where a ray meets a simplex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing<const D: usize> {
    /// Distance along the ray, in lengths of its direction; above zero.
    pub t: f64,
    /// A bound on the rounding error of `t`; infinite where rounding left no digit.
    pub error: f64,
    /// Barycentric coordinates of the point: at least 0, their sum 1.
    pub barycentric: [f64; D],
}

impl<const D: usize> Cone<D> {
    /// The cone in which `vertices` are seen from `origin`.
    #[inline]
    pub fn of_simplex(origin: &Vector<D>, vertices: &[Vector<D>; D]) -> Self {
        Self::new(vertices.map(|v| Column::edge(v, *origin)))
    }

    /// The cone spanned by D vectors.
    #[inline]
    pub fn new(columns: [Column<D>; D]) -> Self {
        let edges: [Vector64<D>; D] = columns.each_ref().map(|c| widen(&c.head) - widen(&c.tail));
        let lengths = edges.each_ref().map(|e| e.iter().map(|x| x.abs()).sum::<f64>());
        let mut normals = [Vector64::zeros(); D];
        let mut bounds = [ROUNDING; D];
        for i in 0..D {
            let mut others = [Vector64::<D>::zeros(); 4];
            for (n, j) in (0..D).filter(|&j| j != i).enumerate() {
                others[n] = edges[j];
                bounds[i] *= lengths[j];
            }
            // Moving column i to the front takes i transpositions.
            let normal = cross(&others[..D - 1]);
            normals[i] = if i % 2 == 0 { normal } else { -normal };
        }
        let determinant = normals[0].dot(&edges[0]);
        let determinant_bound = bounds[0] * lengths[0];
        let orientation = if determinant.abs() > determinant_bound {
            if determinant > 0.0 { 1 } else { -1 }
        } else if determinant_bound == 0.0 {
            // A column is zero: the origin is a corner of the simplex.
            0
        } else {
            determinant_sign(&columns)
        };
        Self { columns, normals, bounds, orientation, determinant, determinant_bound }
    }

    /// Which side of the simplex's hyperplane the origin is on: -1, 0 (in it) or 1.
    #[inline]
    pub fn orientation(&self) -> i32 {
        self.orientation
    }

    /// The vector N with `det[w in place of column i] = N . w`, rounded, and a bound on the error of that product for
    /// |w|_1 = 1. Times [`Cone::orientation`] it points inwards.
    #[inline]
    pub fn facet(&self, i: usize) -> (Vector64<D>, f64) {
        (self.normals[i], self.bounds[i])
    }

    /// The determinant of the columns, rounded, and a bound on that error.
    #[inline]
    pub fn determinant(&self) -> (f64, f64) {
        (self.determinant, self.determinant_bound)
    }

    #[inline]
    fn facet_sign(&self, i: usize, direction: &Vector<D>, direction64: &Vector64<D>, norm1: f64) -> i32 {
        let value = self.normals[i].dot(direction64);
        if value.abs() > self.bounds[i] * norm1 {
            return if value > 0.0 { 1 } else { -1 };
        }
        determinant_sign(&self.replaced(i, direction))
    }

    fn replaced(&self, i: usize, direction: &Vector<D>) -> [Column<D>; D] {
        let mut columns = self.columns;
        columns[i] = Column::vector(*direction);
        columns
    }

    /// Whether the cone, its boundary included, holds the direction. A flat cone holds none.
    #[inline]
    pub fn contains(&self, direction: &Vector<D>) -> bool {
        if self.orientation == 0 {
            return false;
        }
        let wide = widen(direction);
        let norm1 = wide.iter().map(|x| x.abs()).sum::<f64>();
        (0..D).all(|i| self.facet_sign(i, direction, &wide, norm1) * self.orientation >= 0)
    }

    /// Whether the direction lies in the hyperplane of the facet opposite to column `i`.
    pub fn is_on_facet(&self, i: usize, direction: &Vector<D>) -> bool {
        let wide = widen(direction);
        let norm1 = wide.iter().map(|x| x.abs()).sum::<f64>();
        self.facet_sign(i, direction, &wide, norm1) == 0
    }

    /// Whether the interior of the cone holds the direction; `None` where the direction is in the boundary of the
    /// cone or in the hyperplane of one of its facets, or where the cone is flat.
    pub fn strictly_contains(&self, direction: &Vector<D>) -> Option<bool> {
        let wide = widen(direction);
        let norm1 = wide.iter().map(|x| x.abs()).sum::<f64>();
        let signs: [i32; D] = std::array::from_fn(|i| self.facet_sign(i, direction, &wide, norm1) * self.orientation);
        if signs.contains(&0) { None } else { Some(signs.iter().all(|&s| s > 0)) }
    }

    /// Whether the interior of the cone holds a direction infinitesimally beside one that the cone holds: moved towards the
    /// inside of the simplex that these columns, from the same origin, lead to, and by ever smaller steps along the axes
    /// where that still leaves it in the boundary. So of several cones that share a facet just those on one side hold it,
    /// whichever facet it is.
    pub fn contains_beside(&self, direction: &Vector<D>, towards: &[Column<D>; D]) -> bool {
        let wide = widen(direction);
        let norm1 = wide.iter().map(|x| x.abs()).sum::<f64>();
        (0..D).all(|i| {
            let sign = self.facet_sign(i, direction, &wide, norm1);
            let sign = if sign == 0 { self.sign_beside(i, towards) } else { sign };
            sign * self.orientation > 0
        })
    }

    /// The sign of a facet's determinant for the first of these steps that leaves the facet's hyperplane: the sum of the
    /// columns, then the axes. It is zero only if the facet is flat, and the cone with it.
    #[cold]
    fn sign_beside(&self, i: usize, towards: &[Column<D>; D]) -> i32 {
        let edges = towards.each_ref().map(|c| widen(&c.head) - widen(&c.tail));
        let sum = edges.iter().fold(Vector64::zeros(), |sum, edge| sum + edge);
        let lengths: f64 = edges.iter().flatten().map(|x| x.abs()).sum();
        let value = self.normals[i].dot(&sum);
        // Twice: for the rounding of the sum itself.
        if value.abs() > 2.0 * self.bounds[i] * lengths {
            return if value > 0.0 { 1 } else { -1 };
        }
        let exact = towards.iter().fold(Expansion::default(), |sum, column| {
            let mut columns = self.columns;
            columns[i] = *column;
            sum.add(&exact_determinant(&columns))
        });
        let axis = |a: usize| Vector::from_fn(|r, _| if r == a { 1.0 } else { 0.0 });
        let along_axes = (0..D).map(|a| determinant_sign(&self.replaced(i, &axis(a))));
        std::iter::once(exact.sign()).chain(along_axes).find(|&sign| sign != 0).unwrap_or(0)
    }

    /// Distance and barycentric coordinates of the point where a direction within the cone meets its base, the
    /// simplex whose vertices are the heads of the columns.
    #[inline]
    pub fn crossing(&self, direction: &Vector<D>) -> Crossing<D> {
        let wide = widen(direction);
        let sign = f64::from(self.orientation);
        let weights: [f64; D] = std::array::from_fn(|i| (self.normals[i].dot(&wide) * sign).max(0.0));
        let sum: f64 = weights.iter().sum();
        let norm1 = wide.iter().map(|x| x.abs()).sum::<f64>();
        let sum_error = norm1 * self.bounds.iter().sum::<f64>();
        let size = self.determinant.abs();
        if sum > 2.0 * sum_error && size > 2.0 * self.determinant_bound {
            let t = size / sum;
            let error = 2.0 * t * (sum_error / sum + self.determinant_bound / size + f64::EPSILON);
            Crossing { t, error, barycentric: weights.map(|w| w / sum) }
        } else {
            let (numerator, exact) = self.exact_weights(direction);
            let weights = exact.map(|w| w.estimate().abs());
            let sum: f64 = weights.iter().sum();
            let t = numerator.estimate().abs() / sum;
            Crossing { t, error: 8.0 * f64::EPSILON * t, barycentric: weights.map(|w| w / sum) }
        }
    }

    fn exact_weights(&self, direction: &Vector<D>) -> (Expansion, [Expansion; D]) {
        let weights = std::array::from_fn(|i| exact_determinant(&self.replaced(i, direction)));
        (exact_determinant(&self.columns), weights)
    }

    /// The distance along a direction within the cone as an exact fraction, numerator and denominator both positive.
    #[cold]
    pub fn exact_distance(&self, direction: &Vector<D>) -> (Expansion, Expansion) {
        let (numerator, weights) = self.exact_weights(direction);
        let denominator = weights.iter().fold(Expansion::default(), |sum, w| sum.add(w));
        if self.orientation > 0 { (numerator, denominator) } else { (numerator.negate(), denominator.negate()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis<const D: usize>(i: usize) -> Vector<D> {
        Vector::from_fn(|r, _| if r == i { 1.0 } else { 0.0 })
    }

    fn positive_orthant<const D: usize>() {
        let simplex: [Vector<D>; D] = std::array::from_fn(axis);
        let cone = Cone::of_simplex(&Vector::zeros(), &simplex);
        assert_eq!(cone.orientation(), 1);
        let inside = Vector::<D>::from_element(1.0);
        assert!(cone.contains(&inside));
        assert!(!cone.contains(&-inside));
        let crossing = cone.crossing(&inside);
        assert!((crossing.t - 1.0 / D as f64).abs() < 1e-15);
        assert!(crossing.barycentric.iter().all(|b| (b - 1.0 / D as f64).abs() < 1e-15));
        for i in 0..D {
            assert!(cone.contains(&axis(i)), "a vertex counts as inside");
            let mut outside = inside;
            outside[i] = -f32::MIN_POSITIVE;
            assert!(!cone.contains(&outside));
            outside[i] = 0.0;
            assert!(cone.contains(&outside), "a facet counts as inside");
        }
        // From a point in the hyperplane of the simplex nothing of it is seen.
        let cone = Cone::of_simplex(&(axis::<D>(0) * 2.0 - axis(1)), &simplex);
        assert_eq!(cone.orientation(), 0);
        assert!(!cone.contains(&(axis::<D>(1) - axis(0))));
    }

    /// The faces of the cross-polytope of R^D seen from its middle: a direction in many boundaries is beside them in one cone.
    fn one_cone_holds_what_is_beside<const D: usize>() {
        let corners = |n: usize| std::array::from_fn(|i| if n >> i & 1 == 0 { axis::<D>(i) } else { -axis::<D>(i) });
        for n in 0..3usize.pow(D as u32) {
            let direction = Vector::<D>::from_fn(|r, _| (n / 3usize.pow(r as u32) % 3) as f32 - 1.0);
            if direction.amax() == 0.0 {
                continue;
            }
            for seen in 0..1 << D {
                let towards = corners(seen).map(|v| Column::edge(v, Vector::zeros()));
                let cone = |n: usize| Cone::of_simplex(&Vector::zeros(), &corners(n));
                let holding: Vec<usize> = (0..1 << D).filter(|&n| cone(n).contains(&direction)).collect();
                let beside = holding.iter().filter(|&&n| cone(n).contains_beside(&direction, &towards));
                let beside: Vec<usize> = beside.copied().collect();
                assert_eq!(beside.len(), 1, "{D}D, {direction:?}, {holding:?}");
                assert!(!holding.contains(&seen) || beside[0] == seen);
            }
        }
    }

    #[test]
    fn what_is_beside_a_boundary_is_in_one_cone() {
        one_cone_holds_what_is_beside::<3>();
        one_cone_holds_what_is_beside::<4>();
    }

    #[test]
    fn orthant_holds_its_boundary() {
        positive_orthant::<3>();
        positive_orthant::<4>();
    }
}
