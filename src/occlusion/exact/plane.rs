//! The planes that bound the visible region: those of the occluders' facets, and the horizon.
//!
//! A plane here is a hyperplane of R^D through p. Where two generators lie on different sides of it the edge between
//! them crosses it, at a point whose direction depends on the ratio of two values: these are computed anew, with all
//! digits, where rounding would move the crossing.
//!
//! Directions within the plane get D - 1 coordinates in an orthonormal basis, a [`Chart`]: the columns of the
//! Householder reflection that takes e_D to the plane's normal.

use super::generators::{Generators, Signed, direction};
use super::span::Span;
use crate::geometry::{Expansion, Vector64};

/// A direction within a plane: D - 1 coordinates, and zero for what D = 3 has no use for.
pub(super) type Flat = Vector64<3>;

/// How large the error of a value may be, relative to the values whose ratio is taken, before it is refined.
const RATIO_ERROR: f64 = 1e-12;

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

    /// How far a generator is from the plane, within `error` or with all digits.
    fn distance(&self, generators: &Generators<D>, id: u32, side: Signed, error: f64) -> f64 {
        let mut side = side;
        if side.bound > error {
            side = match &self.span {
                None => Signed::of(&generators.exact_height(id)),
                Some(span) => span.refined(generators, id),
            };
        }
        if side.bound > error {
            side = Signed::of(&self.exact(generators, id));
        }
        side.value.abs()
    }

    fn exact(&self, generators: &Generators<D>, id: u32) -> Expansion {
        match &self.span {
            None => generators.exact_height(id),
            Some(span) => span.exact(generators, id),
        }
    }

    /// Where the edge between two generators on opposite sides crosses the plane, as a unit vector.
    pub fn crossing(
        &self,
        generators: &Generators<D>,
        (a, side_a): (u32, Signed),
        (b, side_b): (u32, Signed),
    ) -> Vector64<D> {
        let error = RATIO_ERROR * (side_a.value.abs() + side_b.value.abs());
        let distance_a = self.distance(generators, a, side_a, error);
        let distance_b = self.distance(generators, b, side_b, error);
        let sum = distance_a + distance_b;
        let magnitude = |id| {
            let exact = self.exact(generators, id);
            if exact.sign() < 0 { exact.negate() } else { exact }
        };
        let exact_weights = || [magnitude(b), magnitude(a)];
        generators.combine((a, distance_b / sum), (b, distance_a / sum), exact_weights)
    }
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
        let moves = if D % 2 == 0 { -1.0 } else { 1.0 };
        Self { axis, factor: 2.0 / axis.norm_squared(), handedness: -image * moves }
    }

    /// The coordinates of a vector of the plane, as a unit vector.
    #[inline]
    pub fn flatten(&self, v: &Vector64<D>) -> Flat {
        let scale = self.factor * self.axis.dot(v);
        let mut flat = Flat::zeros();
        for i in 0..D - 1 {
            flat[i] = v[i] - scale * self.axis[i];
        }
        flat[0] *= self.handedness;
        flat / flat.norm()
    }
}
