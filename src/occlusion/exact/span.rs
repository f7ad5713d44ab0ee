//! The hyperplane through p that D - 1 generators span, and on which side of it each other generator lies.
//!
//! The side is the sign of a determinant, and it is exact. Edges are taken relative to one of them, the base, which
//! leaves the determinant as it is: vertices that are seen close together keep their digits so. Each value comes
//! from the cheapest arithmetic that is sure of it: `f64`, pairs of doubles, integers, expansions.

use std::cell::OnceCell;

use super::generators::{Generators, INVERTED_NORMAL, ROUNDING, Signed, direction};
use super::precise::{PAIR_ROUNDING, Pair, cross_pairs, dot_pairs, integer_determinant, norm1, pairs};
use crate::geometry::{Column, Expansion, Vector, Vector64, cross, exact_determinant, widen};

/// A normal shorter than this, relative to the columns it is the cross product of, has lost digits.
const LOST_DIGITS: f64 = 1e-3;

/// The same for a normal of pairs.
const LOST_PAIRS: f64 = 1e-12;

/// A hyperplane through p.
#[derive(Clone, Debug)]
pub(super) struct Span<const D: usize> {
    /// The spanning generators, ascending; the last entry is not one of them.
    ids: [u32; D],
    /// The spanning generator that the others are taken relative to.
    base: u32,
    normal: Vector64<D>,
    /// The product of the 1-norms of the columns that the normal is the cross product of.
    size: f64,
    normal_of_pairs: OnceCell<[Pair; D]>,
}

impl<const D: usize> Span<D> {
    /// The plane of the first D - 1 generators of the list, ascending. At least one of them is an edge.
    pub fn new(generators: &Generators<D>, ids: [u32; D]) -> Self {
        let base = ids[usize::from(ids[0] == INVERTED_NORMAL)];
        let mut columns = [Vector64::<D>::zeros(); D];
        let mut size = 1.0;
        for (column, &id) in columns.iter_mut().zip(&ids[..D - 1]) {
            let relative = relative_to(generators, base, id);
            *column = widen(&relative.head) - widen(&relative.tail);
            size *= norm1(column);
        }
        Self { ids, base, normal: cross(&columns[..D - 1]), size, normal_of_pairs: OnceCell::new() }
    }

    /// The unit normal, the direction in which [`Span::side`] is positive.
    pub fn unit_normal(&self, generators: &Generators<D>) -> Vector64<D> {
        if self.normal.norm() > LOST_DIGITS * self.size {
            return direction(&self.normal);
        }
        let normal = self.pairs(generators).map(|pair| pair.high);
        let normal: Vector64<D> = Vector64::from_fn(|r, _| normal[r]);
        if normal.norm() > LOST_PAIRS * self.size {
            return direction(&normal);
        }
        direction(&Vector64::from_fn(|r, _| {
            let axis = Vector::from_fn(|row, _| f32::from(u8::from(row == r)));
            exact_determinant(&self.columns(generators, Column::vector(axis))).estimate()
        }))
    }

    /// The side a generator is on, as a signed measure.
    #[inline]
    pub fn side(&self, generators: &Generators<D>, id: u32) -> Signed {
        if self.ids[..D - 1].contains(&id) {
            return Signed::default();
        }
        let relative = relative_to(generators, self.base, id);
        let vector = widen(&relative.head) - widen(&relative.tail);
        let bound = ROUNDING * self.size * norm1(&vector);
        Signed::new(self.normal.dot(&vector), bound).unwrap_or_else(|| self.refined(generators, id))
    }

    /// The same with all digits, or nearly.
    #[cold]
    fn refined(&self, generators: &Generators<D>, id: u32) -> Signed {
        let (value, bound) = self.rounded_pair(generators, id);
        // A few digits are asked for, not only the sign.
        if value.high.abs() > 1e4 * bound {
            return Signed { value: value.high, bound: bound + f64::EPSILON * value.high.abs() };
        }
        match integer_determinant(&self.columns(generators, generators.column(id))) {
            Some(value) => Signed { value, bound: f64::EPSILON * value.abs() },
            None => Signed::of(&self.exact(generators, id)),
        }
    }

    /// The same with all digits of a pair.
    #[cold]
    pub fn side_pair(&self, generators: &Generators<D>, id: u32) -> Pair {
        let (value, bound) = self.rounded_pair(generators, id);
        if value.high.abs() * f64::EPSILON > bound { value } else { Pair::of(&self.exact(generators, id)) }
    }

    fn rounded_pair(&self, generators: &Generators<D>, id: u32) -> (Pair, f64) {
        let relative = relative_to(generators, self.base, id);
        let vector = widen(&relative.head) - widen(&relative.tail);
        let bound = PAIR_ROUNDING * self.size * norm1(&vector);
        (dot_pairs(self.pairs(generators), &pairs(&relative)), bound)
    }

    /// The same as an expansion.
    #[cold]
    pub fn exact(&self, generators: &Generators<D>, id: u32) -> Expansion {
        exact_determinant(&self.columns(generators, generators.column(id)))
    }

    fn pairs(&self, generators: &Generators<D>) -> &[Pair; D] {
        self.normal_of_pairs.get_or_init(|| {
            let mut columns = [[Pair::default(); D]; D];
            for (column, &id) in columns.iter_mut().zip(&self.ids[..D - 1]) {
                *column = pairs(&relative_to(generators, self.base, id));
            }
            cross_pairs(&columns)
        })
    }

    fn columns(&self, generators: &Generators<D>, first: Column<D>) -> [Column<D>; D] {
        std::array::from_fn(|i| if i == 0 { first } else { generators.column(self.ids[i - 1]) })
    }
}

/// A generator relative to the base: as edges have p in common, the difference of two vertices.
#[inline]
fn relative_to<const D: usize>(generators: &Generators<D>, base: u32, id: u32) -> Column<D> {
    let column = generators.column(id);
    if id == base || id == INVERTED_NORMAL { column } else { Column::edge(column.head, generators.column(base).head) }
}
