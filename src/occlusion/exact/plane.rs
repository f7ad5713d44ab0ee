//! The planes that bound the visible region: those of the occluders' facets, and the horizon.
//!
//! A plane here is a hyperplane of R^D through p. Where two generators lie on different sides of it the edge between
//! them crosses it, at a point whose direction depends on the ratio of two values: these are computed anew, with all
//! digits, where rounding would move the crossing.
//!
//! Directions within the plane get D - 1 coordinates in an orthonormal basis, a [`Chart`]: the columns of the
//! Householder reflection that takes e_D to the plane's normal.

use super::generators::{Generators, Signed, direction};
use super::precise::{Pair, norm1, pairs};
use super::span::Span;
use crate::geometry::{Expansion, Vector64};

/// A direction within a plane: D - 1 coordinates, and zero for what D = 3 has no use for.
pub(super) type Flat = Vector64<3>;

/// How large the error of a value may be, relative to the values whose ratio is taken, before it is refined.
const RATIO_ERROR: f64 = 1e-12;

/// The square of what must be left of a sum of generators, relative to its terms, or it is taken of pairs.
const CANCELLED: f64 = 1e-3;

/// What must be left of a sum of pairs, relative to its terms: the pairs' 31 digits less these leave 15.
const KEPT_PAIRS: f64 = 1e-15;

/// A hyperplane through p.
#[derive(Clone, Debug)]
pub(super) struct Plane<const D: usize> {
    /// The facet's generators; `None`: the horizon.
    span: Option<Span<D>>,
    unit_normal: Vector64<D>,
    chart: Chart<D>,
}

impl<const D: usize> Plane<D> {
    /// The plane n . x = 0, for a normal of any length.
    pub fn horizon(normal: &Vector64<D>) -> Self {
        let unit_normal = direction(normal);
        Self { span: None, unit_normal, chart: Chart::new(&unit_normal) }
    }

    /// The plane of a facet.
    pub fn of_facet(generators: &Generators<D>, span: Span<D>) -> Self {
        let unit_normal = span.unit_normal(generators);
        Self { span: Some(span), unit_normal, chart: Chart::new(&unit_normal) }
    }

    /// The unit normal, the direction in which [`Plane::side`] is positive.
    pub fn unit_normal(&self) -> &Vector64<D> {
        &self.unit_normal
    }

    /// The coordinates within the plane.
    pub fn chart(&self) -> &Chart<D> {
        &self.chart
    }

    /// The side a generator is on, as a signed measure.
    #[inline]
    pub fn side(&self, generators: &Generators<D>, id: u32) -> Signed {
        match &self.span {
            None => generators.height(id),
            Some(span) => span.side(generators, id),
        }
    }

    /// Where the edge between two generators on opposite sides crosses the plane, as a unit vector.
    pub fn crossing(
        &self,
        generators: &Generators<D>,
        (a, side_a): (u32, Signed),
        (b, side_b): (u32, Signed),
    ) -> Vector64<D> {
        let (distance_a, distance_b) = (side_a.value.abs(), side_b.value.abs());
        let total = distance_a + distance_b;
        if side_a.bound + side_b.bound <= RATIO_ERROR * total {
            let (u, v) = (generators.vector(a) * (distance_b / total), generators.vector(b) * (distance_a / total));
            let sum = u + v;
            // Of nearly opposite generators little is left.
            if sum.norm_squared() > CANCELLED * (u.norm_squared() + v.norm_squared()) {
                return direction(&sum);
            }
        }
        self.refined_crossing(generators, a, b)
    }

    #[cold]
    fn refined_crossing(&self, generators: &Generators<D>, a: u32, b: u32) -> Vector64<D> {
        let (sum, kept) = self.crossing_pairs(generators, a, b);
        if kept > KEPT_PAIRS {
            direction(&rounded(&sum))
        } else {
            direction(&estimates(&self.exact_crossing(generators, a, b)))
        }
    }

    /// The crossing, of any length, with all digits of pairs but those that cancelled, and how much these left.
    fn crossing_pairs(&self, generators: &Generators<D>, a: u32, b: u32) -> ([Pair; D], f64) {
        if a == b {
            return (pairs(&generators.column(a)), 1.0);
        }
        let distance = |id| {
            let side = match &self.span {
                None => generators.height_pair(id),
                Some(span) => span.side_pair(generators, id),
            };
            side.abs()
        };
        let (weight_a, weight_b) = (distance(b), distance(a));
        let u = pairs(&generators.column(a)).map(|x| x.times(weight_a));
        let v = pairs(&generators.column(b)).map(|x| x.times(weight_b));
        let sum: [Pair; D] = std::array::from_fn(|r| u[r].plus(v[r]));
        let kept = norm1(&rounded(&sum)) / (norm1(&rounded(&u)) + norm1(&rounded(&v)));
        (sum, kept)
    }

    fn exact_crossing(&self, generators: &Generators<D>, a: u32, b: u32) -> [Expansion; D] {
        let entry = |id, r: usize| {
            let column = generators.column(id);
            Expansion::difference(f64::from(column.head[r]), f64::from(column.tail[r]))
        };
        if a == b {
            return std::array::from_fn(|r| entry(a, r));
        }
        let distance = |id| {
            magnitude(&match &self.span {
                None => generators.exact_height(id),
                Some(span) => span.exact(generators, id),
            })
        };
        let (weight_a, weight_b) = (distance(b), distance(a));
        std::array::from_fn(|r| entry(a, r).multiply(&weight_a).add(&entry(b, r).multiply(&weight_b)))
    }

    /// The direction between two corners that are nearly opposite, at a right angle to the first. Each corner is given
    /// by the generators whose edge crosses the plane there, or by one generator twice.
    ///
    /// It is found from a direction between them in which the largest coordinate of the first vanishes: the mean of two
    /// unit vectors would be at the mercy of the rounding of their lengths.
    #[cold]
    pub fn between(&self, generators: &Generators<D>, corners: [(u32, u32); 2]) -> Vector64<D> {
        let [(a, kept_a), (b, kept_b)] = corners.map(|(a, b)| self.crossing_pairs(generators, a, b));
        let (u, v) = (rounded(&a), rounded(&b));
        let largest = u.iamax();
        let (weight_a, weight_b) = (b[largest].abs(), a[largest].abs());
        let sum: [Pair; D] = std::array::from_fn(|r| a[r].times(weight_a).plus(b[r].times(weight_b)));
        let sum = rounded(&sum);
        if kept_a.min(kept_b) * norm1(&sum) > KEPT_PAIRS * norm1(&u) * norm1(&v) {
            return across(&sum, &u);
        }
        let [a, b] = corners.map(|(a, b)| self.exact_crossing(generators, a, b));
        let largest = estimates(&a).iamax();
        let (weight_a, weight_b) = (magnitude(&b[largest]), magnitude(&a[largest]));
        let sum = std::array::from_fn(|r| a[r].multiply(&weight_a).add(&b[r].multiply(&weight_b)));
        across(&estimates(&sum), &estimates(&a))
    }
}

/// The unit vector at a right angle to `b` in the plane of both, towards `a`.
fn across<const D: usize>(a: &Vector64<D>, b: &Vector64<D>) -> Vector64<D> {
    let (a, b) = (direction(a), direction(b));
    direction(&(a - b * a.dot(&b)))
}

fn magnitude(exact: &Expansion) -> Expansion {
    if exact.sign() < 0 { exact.negate() } else { exact.clone() }
}

fn rounded<const D: usize>(v: &[Pair; D]) -> Vector64<D> {
    Vector64::from_fn(|r, _| v[r].high)
}

fn estimates<const D: usize>(v: &[Expansion; D]) -> Vector64<D> {
    Vector64::from_fn(|r, _| v[r].estimate())
}

/// An orthonormal basis of a hyperplane through p.
#[derive(Clone, Debug)]
pub(super) struct Chart<const D: usize> {
    axis: Vector64<D>,
    factor: f64,
    /// -1 if the first coordinate is mirrored, so that with the plane's normal in front the basis is right-handed.
    handedness: f64,
}

impl<const D: usize> Chart<D> {
    fn new(unit_normal: &Vector64<D>) -> Self {
        // The reflection takes e_D to -n or n, whichever is farther from e_D.
        let image = if unit_normal[D - 1] > 0.0 { -1.0 } else { 1.0 };
        let mut axis = unit_normal * -image;
        axis[D - 1] += 1.0;
        // A reflection turns handedness over once, moving the last axis to the front D - 1 times.
        let moves = if D.is_multiple_of(2) { -1.0 } else { 1.0 };
        Self { axis, factor: 2.0 / axis.norm_squared(), handedness: -image * moves }
    }

    /// The coordinates of a vector of the plane, as a unit vector.
    #[inline]
    pub fn flatten(&self, v: &Vector64<D>) -> Flat {
        let flat = self.project(v);
        flat / flat.norm()
    }

    /// The coordinates of a vector's projection to the plane.
    #[inline]
    pub fn project(&self, v: &Vector64<D>) -> Flat {
        let scale = self.factor * self.axis.dot(v);
        let mut flat = Flat::zeros();
        for i in 0..D - 1 {
            flat[i] = v[i] - scale * self.axis[i];
        }
        flat[0] *= self.handedness;
        flat
    }

    /// The vector of the plane with these coordinates.
    pub fn unflatten(&self, flat: &Flat) -> Vector64<D> {
        let mut v = Vector64::<D>::from_fn(|r, _| if r < D - 1 { flat[r] } else { 0.0 });
        v[0] *= self.handedness;
        v - self.axis * (self.factor * self.axis.dot(&v))
    }
}
