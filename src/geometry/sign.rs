//! The exact sign of a determinant whose columns are differences of `f32` points.

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

/// The exact determinant of the square matrix of these rows, by Laplace expansion along the first one.
fn laplace(rows: &[Vec<Expansion>], columns: &[usize]) -> Expansion {
    let Some((first, rest)) = rows.split_first() else {
        return Expansion::difference(1.0, 0.0);
    };
    let mut sum = Expansion::default();
    for (k, &column) in columns.iter().enumerate() {
        if first[column].sign() == 0 {
            continue;
        }
        let others: Vec<usize> = columns.iter().copied().filter(|&c| c != column).collect();
        let term = first[column].multiply(&laplace(rest, &others));
        sum = sum.add(&if k % 2 == 0 { term } else { term.negate() });
    }
    sum
}

/// The determinant of the D columns, exactly.
pub fn exact_determinant<const D: usize>(columns: &[Column<D>; D]) -> Expansion {
    let transposed: Vec<Vec<Expansion>> = columns.iter().map(|c| (0..D).map(|r| c.entry(r)).collect()).collect();
    laplace(&transposed, &(0..D).collect::<Vec<_>>())
}

/// The sign of the determinant of the D columns, exactly: -1, 0 or 1.
#[cold]
pub fn determinant_sign<const D: usize>(columns: &[Column<D>; D]) -> i32 {
    exact_determinant(columns).sign()
}

/// The sign of the minor that leaves row `skip` out of D - 1 columns, exactly.
#[cold]
pub(super) fn minor_sign<const D: usize>(columns: &[Column<D>], skip: usize) -> i32 {
    let transposed: Vec<Vec<Expansion>> = columns.iter().map(|c| (0..D).map(|r| c.entry(r)).collect()).collect();
    let rows: Vec<usize> = (0..D).filter(|&r| r != skip).collect();
    laplace(&transposed, &rows).sign()
}
