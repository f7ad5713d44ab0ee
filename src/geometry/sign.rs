//! The exact sign of a determinant whose columns are differences of `f32` points.

use super::determinant::WideInteger;
use super::{Expansion, Vector};

/// One column of a determinant: the difference of two stored points, not yet rounded.
/// A direction is a column whose second point is the origin.
#[derive(Clone, Copy, Debug)]
pub struct Column<const D: usize> {
    /// The point subtracted from.
    pub head: Vector<D>,
    /// The point subtracted.
    pub tail: Vector<D>,
}

impl<const D: usize> Column<D> {
    /// The edge from `tail` to `head`.
    pub fn edge(head: Vector<D>, tail: Vector<D>) -> Self {
        Self { head, tail }
    }

    /// A vector that is stored as such.
    pub fn vector(v: Vector<D>) -> Self {
        Self { head: v, tail: Vector::zeros() }
    }

    fn entry(&self, row: usize) -> Expansion {
        Expansion::difference(f64::from(self.head[row]), f64::from(self.tail[row]))
    }
}

/// The exact determinant of the square matrix of these columns of the rows: minors of the last rows by Laplace expansion, each made
/// once and used for all those of one row more.
fn laplace(rows: &[Vec<Expansion>], columns: &[usize]) -> Expansion {
    let count = columns.len();
    // For each set of columns, a bit each, the minor of as many rows, the last ones.
    let mut minors = vec![Expansion::difference(1.0, 0.0)];
    for set in 1usize..1 << count {
        let row = &rows[count - set.count_ones() as usize];
        let mut minor = Expansion::default();
        let members = (0..count).filter(|column| set >> column & 1 == 1);
        for (k, column) in members.enumerate() {
            let term = row[columns[column]].multiply(&minors[set & !(1 << column)]);
            minor = minor.add(&if k % 2 == 0 { term } else { term.negate() });
        }
        minors.push(minor);
    }
    minors.pop().unwrap_or_default()
}

/// The determinant of the D columns, exactly.
pub fn exact_determinant<const D: usize>(columns: &[Column<D>; D]) -> Expansion {
    let transposed: Vec<Vec<Expansion>> = columns.iter().map(|c| (0..D).map(|r| c.entry(r)).collect()).collect();
    laplace(&transposed, &(0..D).collect::<Vec<_>>())
}

/// The sign of the determinant of the D columns, exactly: -1, 0 or 1.
#[cold]
pub fn determinant_sign<const D: usize>(columns: &[Column<D>; D]) -> i32 {
    integer_sign(columns).unwrap_or_else(|| exact_determinant(columns).sign())
}

/// Bits of a column's entries as integers: minors of three such columns fit into 128 bits.
const ENTRY_BITS: i32 = 40;

/// The sign in integer arithmetic, for columns whose entries are all multiples of some power of two (one a column) by
/// less than 2^40. That is the rule: coordinates of a scene have similar sizes. About a hundred times faster than
/// expansions, which matters where much lies exactly in one hyperplane, as on the faces of a cube.
fn integer_sign<const D: usize>(columns: &[Column<D>; D]) -> Option<i32> {
    let mut m = [[0i128; D]; D];
    for (column, integers) in columns.iter().zip(&mut m) {
        let ends = column.head.iter().chain(column.tail.iter());
        let nonzero = ends.filter(|x| **x != 0.0);
        let (low, high) = nonzero.fold((i32::MAX, i32::MIN), |(low, high), x| {
            let exponent = (x.to_bits() >> 23 & 0xff) as i32;
            let lowest = exponent.max(1) - 150 + (x.to_bits() & 0x7f_ffff | 1 << 23).trailing_zeros() as i32;
            (low.min(lowest), high.max(exponent - 126))
        });
        if low == i32::MAX {
            return Some(0);
        }
        // One bit more for the difference.
        if high - low + 1 > ENTRY_BITS {
            return None;
        }
        // Exact: a power of two times a double of at most 40 bits.
        let scale = |x: f32| (f64::from(x) * 2f64.powi(-low)) as i128;
        for (r, integer) in integers.iter_mut().enumerate() {
            *integer = scale(column.head[r]) - scale(column.tail[r]);
        }
    }
    Some(WideInteger::determinant(&m).sign())
}

/// The sign of the minor that leaves row `skip` out of D - 1 columns, exactly.
#[cold]
pub(super) fn minor_sign<const D: usize>(columns: &[Column<D>], skip: usize) -> i32 {
    let transposed: Vec<Vec<Expansion>> = columns.iter().map(|c| (0..D).map(|r| c.entry(r)).collect()).collect();
    let rows: Vec<usize> = (0..D).filter(|&r| r != skip).collect();
    laplace(&transposed, &rows).sign()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn agree<const D: usize>() {
        let mut state = 9u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state >> 8
        };
        let mut zeros = 0;
        for k in 0..4000 {
            let mut coordinate = || match (k % 4, random()) {
                (0, r) => (r % 5) as f32 - 2.0,
                (1, r) => r as f32 / (1 << 23) as f32 - 1.0,
                (2, r) => 1.0e5 + (r % 7) as f32 * 0.007_812_5,
                (_, r) => (r as f32 - 8e6) * 2f32.powi((r % 40) as i32 - 30),
            };
            let mut columns: [Column<D>; D] = std::array::from_fn(|_| {
                Column::edge(Vector::from_fn(|_, _| coordinate()), Vector::from_fn(|_, _| coordinate()))
            });
            if k % 3 == 0 {
                // The last column a copy, or the sum of two: the determinant is exactly zero.
                columns[D - 1] = columns[0];
            }
            let exact = exact_determinant(&columns).sign();
            zeros += usize::from(exact == 0);
            if let Some(sign) = integer_sign(&columns) {
                assert_eq!(sign, exact, "{columns:?}");
            }
            assert_eq!(determinant_sign(&columns), exact);
        }
        assert!(zeros > 1000);
        let plain = Column::edge(Vector::<D>::from_element(0.1), Vector::from_element(-0.3));
        assert_eq!(integer_sign(&[plain; D]), Some(0), "the fast path is taken where it is meant to be");
    }

    #[test]
    fn integers_and_expansions_agree() {
        agree::<3>();
        agree::<4>();
    }
}
