//! The planes that bound the visible region: those of the occluders' facets, and the horizon.
//!
//! A plane here is a hyperplane of R^D through p. What it needs to know is on which side each generator lies, and
//! that sign is exact: it is the sign of the determinant of D generators (or of n . g, for the horizon). Where two
//! generators lie on different sides the edge between them crosses the plane at a point whose direction depends on
//! the ratio of the two values, so these are computed anew, exactly, where rounding would move the crossing.
//!
//! Directions within the plane get D - 1 coordinates in an orthonormal basis, a [`Chart`]: the columns of the
//! Householder reflection that takes e_D to the plane's normal.

use super::generators::{Generators, INVERTED_NORMAL, ROUNDING, Signed, direction};
use crate::geometry::{Column, Expansion, Vector, Vector64, cross, exact_determinant};

/// A direction within a plane: D - 1 coordinates, and zero for what D = 3 has no use for.
pub(super) type Flat = Vector64<3>;

/// How large the error of a value may be, relative to the values whose ratio is taken, before it is computed exactly.
const RATIO_ERROR: f64 = 4e-12;

/// A normal shorter than this, relative to the columns it is the cross product of, has lost digits.
const LOST_DIGITS: f64 = 1e-3;

/// A hyperplane through p.
#[derive(Clone, Debug)]
pub(super) struct Plane<const D: usize> {
    /// The generators that span a facet's plane, ascending, D - 1 of them; the rest is unused. `None`: the horizon.
    span: Option<[u32; D]>,
    /// A spanning generator that is an edge; the others are taken relative to it.
    base: u32,
    normal: Vector64<D>,
    factor: f64,
    unit: Vector64<D>,
    chart: Chart<D>,
}

impl<const D: usize> Plane<D> {
    /// The plane n . x = 0.
    pub fn horizon(unit_normal: Vector64<D>) -> Self {
        Self {
            span: None,
            base: INVERTED_NORMAL,
            normal: unit_normal,
            factor: 0.0,
            unit: unit_normal,
            chart: Chart::new(&unit_normal),
        }
    }

    /// The plane of a facet, `span` being its D - 1 generators in ascending order and then anything.
    pub fn of_facet(generators: &Generators<D>, span: [u32; D]) -> Self {
        let (normal, base, factor) = spanned(generators, &span);
        let unit = if normal.norm() > LOST_DIGITS * factor / ROUNDING {
            direction(&normal)
        } else {
            direction(&Vector64::from_fn(|r, _| {
                let axis = Vector::from_fn(|row, _| f32::from(u8::from(row == r)));
                exact_determinant(&with_span(generators, Column::vector(axis), &span)).estimate()
            }))
        };
        Self { span: Some(span), base, normal, factor, unit, chart: Chart::new(&unit) }
    }

    /// The unit normal. A facet's is the direction in which [`Plane::side`] is positive.
    pub fn unit_normal(&self) -> &Vector64<D> {
        &self.unit
    }

    /// The coordinates within the plane.
    pub fn chart(&self) -> &Chart<D> {
        &self.chart
    }

    fn exact(&self, generators: &Generators<D>, id: u32) -> Expansion {
        match &self.span {
            None => generators.exact_height(id),
            Some(span) => exact_side(generators, span, id),
        }
    }

    /// The side a generator is on, as a signed measure.
    #[inline]
    pub fn side(&self, generators: &Generators<D>, id: u32) -> Signed {
        match &self.span {
            None => generators.height(id),
            Some(span) => side_of(generators, span, (&self.normal, self.base, self.factor), id),
        }
    }

    /// The side a generator is on of the plane that others span, without the cost of a [`Plane`].
    pub fn side_of_span(generators: &Generators<D>, span: &[u32; D], id: u32) -> Signed {
        let (normal, base, factor) = spanned(generators, span);
        side_of(generators, span, (&normal, base, factor), id)
    }

    /// Where the edge between two generators on opposite sides crosses the plane, as a unit vector.
    pub fn crossing(
        &self,
        generators: &Generators<D>,
        (a, side_a): (u32, Signed),
        (b, side_b): (u32, Signed),
    ) -> Vector64<D> {
        let (mut value_a, mut value_b) = (side_a.value.abs(), side_b.value.abs());
        let limit = RATIO_ERROR * (value_a + value_b);
        if side_a.bound > limit {
            value_a = self.exact(generators, a).estimate().abs();
        }
        if side_b.bound > limit {
            value_b = self.exact(generators, b).estimate().abs();
        }
        let sum = value_a + value_b;
        let magnitude = |id| {
            let exact = self.exact(generators, id);
            if exact.sign() < 0 { exact.negate() } else { exact }
        };
        let exact_weights = || [magnitude(b), magnitude(a)];
        generators.combine((a, value_b / sum), (b, value_a / sum), exact_weights)
    }
}

/// The normal of the plane that the generators span, an edge among them, and the factor that bounds the rounding of
/// its product with a difference. Edges are taken relative to the first one: vertices that are seen close together
/// keep their digits so.
fn spanned<const D: usize>(generators: &Generators<D>, span: &[u32; D]) -> (Vector64<D>, u32, f64) {
    let base_at = usize::from(span[0] == INVERTED_NORMAL);
    let base = span[base_at];
    let mut columns = [Vector64::<D>::zeros(); D];
    let mut factor = ROUNDING;
    for (i, &id) in span[..D - 1].iter().enumerate() {
        columns[i] = *generators.vector(id);
        if i > base_at {
            columns[i] -= generators.vector(base);
        }
        factor *= columns[i].iter().map(|x| x.abs()).sum::<f64>();
    }
    (cross(&columns[..D - 1]), base, factor)
}

#[inline]
fn side_of<const D: usize>(
    generators: &Generators<D>,
    span: &[u32; D],
    (normal, base, factor): (&Vector64<D>, u32, f64),
    id: u32,
) -> Signed {
    if span[..D - 1].contains(&id) {
        return Signed::default();
    }
    let relative =
        if id == INVERTED_NORMAL { *generators.vector(id) } else { generators.vector(id) - generators.vector(base) };
    let size: f64 = relative.iter().map(|x| x.abs()).sum();
    Signed::new(normal.dot(&relative), factor * size, || exact_side(generators, span, id))
}

#[cold]
fn exact_side<const D: usize>(generators: &Generators<D>, span: &[u32; D], id: u32) -> Expansion {
    exact_determinant(&with_span(generators, generators.column(id), span))
}

fn with_span<const D: usize>(generators: &Generators<D>, first: Column<D>, span: &[u32; D]) -> [Column<D>; D] {
    std::array::from_fn(|i| if i == 0 { first } else { generators.column(span[i - 1]) })
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
