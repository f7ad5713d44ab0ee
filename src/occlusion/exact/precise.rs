//! The steps between `f64` and exact expansions, as fast as they can be had.
//!
//! Turned boxes and finely cut flat walls see many generators within rounding of a plane, where `f64` can't tell the
//! side, or not to enough digits. Numbers of two doubles (Dekker 1971) have 106 bits and settle nearly all of these.
//! A determinant that is zero needs a proof: where the entries of each column are integers of some 30 bits, up to a
//! power of two, it is computed in 128-bit integers. Only what is left goes to expansions, which are some hundred
//! times slower.

use crate::geometry::{Column, Expansion, Vector64, WideInteger, cofactors, two_product, two_sum};

/// Rounding of a sum of products of D pairs' numbers, relative to the product of the columns' 1-norms. Each operation
/// rounds by less than 2^-103 of its result; a D x D determinant has fewer than 2^6 of them on any path of additions.
pub(super) const PAIR_ROUNDING: f64 = 1.0 / (1u128 << 96) as f64;

/// An unevaluated sum of two doubles, the second below half an ulp of the first.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Pair {
    pub high: f64,
    pub low: f64,
}

impl From<(f64, f64)> for Pair {
    #[inline]
    fn from((high, low): (f64, f64)) -> Self {
        Self { high, low }
    }
}

#[inline]
fn rounded_sum(a: f64, b: f64) -> Pair {
    two_sum(a, b).into()
}

impl Pair {
    /// `a - b`, exactly.
    #[inline]
    pub fn difference(a: f32, b: f32) -> Self {
        rounded_sum(f64::from(a), -f64::from(b))
    }

    /// A sum of two doubles of which the second is the smaller.
    pub fn of(exact: &Expansion) -> Self {
        let high = exact.estimate();
        Self { high, low: exact.add(&Expansion::difference(-high, 0.0)).estimate() }
    }

    /// The absolute value.
    pub fn abs(self) -> Self {
        if self.high < 0.0 { Self { high: -self.high, low: -self.low } } else { self }
    }

    #[inline]
    pub fn plus(self, other: Self) -> Self {
        let (high, low) = (rounded_sum(self.high, other.high), rounded_sum(self.low, other.low));
        let sum = rounded_sum(high.high, high.low + low.high);
        rounded_sum(sum.high, sum.low + low.low)
    }

    #[inline]
    fn minus(self, other: Self) -> Self {
        self.plus(Self { high: -other.high, low: -other.low })
    }

    #[inline]
    pub fn times(self, other: Self) -> Self {
        let product: Pair = two_product(self.high, other.high).into();
        rounded_sum(product.high, product.low + (self.high * other.low + self.low * other.high))
    }
}

/// The differences of a column.
#[inline]
pub(super) fn pairs<const D: usize>(column: &Column<D>) -> [Pair; D] {
    std::array::from_fn(|r| Pair::difference(column.head[r], column.tail[r]))
}

/// The dot product.
#[inline]
pub(super) fn dot_pairs<const D: usize>(a: &[Pair; D], b: &[Pair; D]) -> Pair {
    (1..D).fold(a[0].times(b[0]), |sum, i| sum.plus(a[i].times(b[i])))
}

/// The generalised cross product of the first D - 1 vectors, as [`crate::geometry::cross`].
pub(super) fn cross_pairs<const D: usize>(columns: &[[Pair; D]; D]) -> [Pair; D] {
    cofactors(columns, Pair::times, Pair::plus, Pair::minus)
}

/// The determinant of the columns, exact up to the last rounding, if they are integers times powers of two with few
/// enough bits to be computed so; then it is zero only if the determinant is.
pub(super) fn integer_determinant<const D: usize>(columns: &[Column<D>; D]) -> Option<f64> {
    let mut integers = [[0i128; D]; D];
    let (mut bits, mut exponent) = (0, 0);
    for (column, integer) in columns.iter().zip(&mut integers) {
        let differences = pairs(column);
        if differences.iter().any(|difference| difference.low != 0.0) {
            return None;
        }
        let quantum = differences.iter().filter(|d| d.high != 0.0).map(|d| lowest_bit(d.high)).min()?;
        let (scale, mut largest) = (power_of_two(-quantum)?, 0);
        for (entry, difference) in integer.iter_mut().zip(&differences) {
            let scaled = difference.high * scale;
            if scaled.abs() >= 9e18 {
                return None;
            }
            *entry = scaled as i128;
            largest = largest.max(entry.unsigned_abs());
        }
        bits += 128 - largest.leading_zeros();
        exponent += quantum;
    }
    // Up to 4! products of D entries: 5 bits more.
    if bits + 5 > 126 {
        return None;
    }
    Some(WideInteger::determinant(&integers).low_128() as f64 * power_of_two(exponent)?)
}

/// The exponent of the lowest bit set in a double that is neither zero nor subnormal.
fn lowest_bit(x: f64) -> i32 {
    let bits = x.to_bits();
    let mantissa = bits & ((1 << 52) - 1) | 1 << 52;
    (bits >> 52 & 0x7ff) as i32 - 1075 + mantissa.trailing_zeros() as i32
}

fn power_of_two(exponent: i32) -> Option<f64> {
    (-1022..=1023).contains(&exponent).then(|| f64::from_bits(((exponent + 1023) as u64) << 52))
}

/// The 1-norm.
#[inline]
pub(super) fn norm1<const D: usize>(v: &Vector64<D>) -> f64 {
    v.iter().map(|x| x.abs()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Vector, exact_determinant};

    /// Columns of small odd fractions, the last one a sum of the others plus `nudge` in its first entry.
    fn columns<const D: usize>(round: u32, nudge: f32) -> [Column<D>; D] {
        let entry = |i: usize, r: usize| ((round as usize * 31 + i * 17 + r * r * 7) % 23) as f32 / 16.0 - 0.5;
        let mut columns: [Vector<D>; D] = std::array::from_fn(|i| Vector::from_fn(|r, _| entry(i, r)));
        columns[D - 1] = (0..D - 1).fold(Vector::zeros(), |sum, i| sum + columns[i]);
        columns[D - 1][0] += nudge;
        let tail = Vector::from_fn(|r, _| r as f32 / 8.0);
        columns.map(|v| Column::edge(v + tail, tail))
    }

    fn check<const D: usize>() {
        for round in 0..50 {
            for nudge in [0.0, 0.125, 1.0 / 65536.0] {
                let columns = columns::<D>(round, nudge);
                let exact = exact_determinant(&columns);
                assert_eq!(integer_determinant(&columns), Some(exact.estimate()));
                let pairs = columns.each_ref().map(pairs);
                let mut rest = pairs;
                rest.rotate_left(1);
                let value = dot_pairs(&cross_pairs(&rest), &pairs[0]);
                assert!((value.high - exact.estimate()).abs() < 1e-28, "{value:?}");
            }
        }
        // One entry far smaller than the others has too many bits.
        let mut fine = columns::<D>(1, 0.0);
        fine[0].head[0] = 1e-20;
        fine[0].tail[0] = 0.0;
        assert_eq!(integer_determinant(&fine), None);
    }

    #[test]
    fn agree_with_expansions() {
        check::<3>();
        check::<4>();
    }

    #[test]
    fn pairs_hold_what_a_double_can_not() {
        let tiny = Pair::difference(1.0, -1e-15).minus(Pair::difference(1.0, 0.0));
        assert_eq!(tiny, Pair { high: f64::from(1e-15f32), low: 0.0 });
        let third = Pair { high: 1.0 / 3.0, low: (1.0 / 3.0) * f64::EPSILON / 4.0 };
        assert!(third.times(Pair::difference(3.0, 0.0)).minus(Pair::difference(1.0, 0.0)).high.abs() < 1e-31);
    }
}
