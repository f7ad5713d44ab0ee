//! The generators of the occluders' cones: edges from the point p to the vertices it sees, each kept once.
//!
//! Two occluders that share a vertex share a generator, so that shared facets are known by their numbers and not by
//! comparing coordinates. Generator 0 is the inverted normal -n (or -d, if p is approached from d), the last edge of every cone that belongs to a
//! simplex containing p. Everything is a difference of two stored `f32` vectors, hence exact signs are to be had.

use std::collections::HashMap;

use super::precise::{PAIR_ROUNDING, Pair, dot_pairs, pairs};
use crate::geometry::{Column, Expansion, Vector, Vector64, widen};

/// The number of the generator -n.
pub(super) const INVERTED_NORMAL: u32 = 0;

/// Rounding of a dot product of a normal with a difference, relative to the product of the 1-norms that went in: as
/// for the determinants of [`crate::geometry::Cone`].
pub(super) const ROUNDING: f64 = 32.0 * (f64::EPSILON / 2.0);

/// A signed quantity whose sign is exact: `value` is zero only if the quantity is.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Signed {
    pub value: f64,
    /// Bound on the error of `value`; below it in any case.
    pub bound: f64,
}

impl Signed {
    /// A rounded value, if its bound lets the sign be trusted. A bound of zero means that all terms are zero.
    #[inline]
    pub fn new(value: f64, bound: f64) -> Option<Self> {
        (value.abs() > bound || bound == 0.0).then_some(Self { value, bound })
    }

    pub fn of(exact: &Expansion) -> Self {
        Self { value: exact.estimate(), bound: 0.0 }
    }

    #[inline]
    pub fn sign(&self) -> i32 {
        i32::from(self.value > 0.0) - i32::from(self.value < 0.0)
    }
}

/// All the generators at one point.
#[derive(Clone, Debug)]
pub(super) struct Generators<const D: usize> {
    point: Vector<D>,
    normal: Vector<D>,
    numbers: HashMap<[u32; D], u32>,
    columns: Vec<Column<D>>,
    vectors: Vec<Vector64<D>>,
    heights: Vec<Signed>,
}

impl<const D: usize> Generators<D> {
    pub fn new(point: Vector<D>, normal: Vector<D>, approach: Vector<D>) -> Self {
        let mut generators = Self {
            point,
            normal,
            numbers: HashMap::new(),
            columns: Vec::new(),
            vectors: Vec::new(),
            heights: Vec::new(),
        };
        generators.push(Column::vector(-approach));
        generators
    }

    fn push(&mut self, column: Column<D>) {
        let vector = widen(&column.head) - widen(&column.tail);
        let (value, bound) = dot(&widen(&self.normal), &vector);
        self.columns.push(column);
        self.vectors.push(vector);
        let id = self.columns.len() as u32 - 1;
        let height = Signed::new(value, bound).unwrap_or_else(|| Signed::of(&self.exact_height(id)));
        self.heights.push(height);
    }

    /// The number of the edge to this vertex, new or known. Minus zero is zero.
    pub fn edge_to(&mut self, vertex: &Vector<D>) -> u32 {
        let key: [u32; D] = std::array::from_fn(|i| (vertex[i] + 0.0).to_bits());
        let next = self.columns.len() as u32;
        let id = *self.numbers.entry(key).or_insert(next);
        if id == next {
            self.push(Column::edge(*vertex, self.point));
        }
        id
    }

    pub fn len(&self) -> usize {
        self.columns.len()
    }

    #[inline]
    pub fn column(&self, id: u32) -> Column<D> {
        self.columns[id as usize]
    }

    #[inline]
    pub fn vector(&self, id: u32) -> &Vector64<D> {
        &self.vectors[id as usize]
    }

    /// The height above the horizon: n . g, with n as given, not normalised.
    #[inline]
    pub fn height(&self, id: u32) -> Signed {
        self.heights[id as usize]
    }

    pub fn exact_height(&self, id: u32) -> Expansion {
        let column = self.column(id);
        (0..D).fold(Expansion::default(), |sum, r| {
            let entry = Expansion::difference(f64::from(column.head[r]), f64::from(column.tail[r]));
            sum.add(&entry.multiply(&Expansion::difference(f64::from(self.normal[r]), 0.0)))
        })
    }

    /// The height above the horizon with all digits of a pair.
    #[cold]
    pub fn height_pair(&self, id: u32) -> Pair {
        let normal = pairs(&Column::vector(self.normal));
        let value = dot_pairs(&normal, &pairs(&self.column(id)));
        let (_, bound) = dot(&widen(&self.normal), self.vector(id));
        if value.high.abs() * f64::EPSILON > bound / ROUNDING * PAIR_ROUNDING {
            value
        } else {
            Pair::of(&self.exact_height(id))
        }
    }
}

/// The unit vector along `v`, safe from underflow and overflow.
#[inline]
pub(super) fn direction<const D: usize>(v: &Vector64<D>) -> Vector64<D> {
    let scaled = v / v.amax();
    scaled / scaled.norm()
}

/// A dot product and a bound on its rounding.
#[inline]
pub(super) fn dot<const D: usize>(a: &Vector64<D>, b: &Vector64<D>) -> (f64, f64) {
    let (mut sum, mut size) = (0.0, 0.0);
    for i in 0..D {
        let product = a[i] * b[i];
        sum += product;
        size += product.abs();
    }
    (sum, ROUNDING * size)
}
