//! Exact sums and products of doubles: a number as an unevaluated sum of non-overlapping `f64`, after Shewchuk,
//! *Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates*, 1997.
//!
//! Exact as long as nothing overflows or underflows. For polynomials of degree 4 in differences of `f32` that can't
//! happen: the smallest bit is 2^(-149 * 4), the largest value below 2^(129 * 4 + 5).

/// An exact number: components of increasing magnitude that do not overlap, and strongly so in Shewchuk's sense: no two neighbours
/// are adjacent unless both are powers of two. The empty list is zero.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Expansion(Vec<f64>);

/// The rounded sum, and what rounding lost (Knuth).
#[inline]
pub(crate) fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let b_part = sum - a;
    let a_part = sum - b_part;
    (sum, (a - a_part) + (b - b_part))
}

#[inline]
fn split(a: f64) -> (f64, f64) {
    let c = 134_217_729.0 * a; // 2^27 + 1
    let high = c - (c - a);
    (high, a - high)
}

/// The rounded product, and what rounding lost (Dekker, Veltkamp).
#[inline]
pub(crate) fn two_product(a: f64, b: f64) -> (f64, f64) {
    let product = a * b;
    let (a_high, a_low) = split(a);
    let (b_high, b_low) = split(b);
    let error = ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low;
    (product, error)
}

impl Expansion {
    /// `a - b`, exactly.
    pub fn difference(a: f64, b: f64) -> Self {
        let (sum, error) = two_sum(a, -b);
        let mut e = Self::default();
        e.push(error);
        e.push(sum);
        e
    }

    fn push(&mut self, component: f64) {
        if component != 0.0 {
            self.0.push(component);
        }
    }

    /// The exact sum: all components merged by magnitude, and summed from the least on (Shewchuk's *fast expansion sum*, which keeps
    /// them strongly nonoverlapping).
    pub fn add(&self, other: &Self) -> Self {
        let (mut left, mut right) = (self.0.as_slice(), other.0.as_slice());
        let mut result = Self(Vec::with_capacity(left.len() + right.len()));
        let mut carry = 0.0;
        loop {
            let component = match (left, right) {
                ([a, rest @ ..], [b, ..]) if a.abs() < b.abs() => {
                    left = rest;
                    *a
                }
                (_, [b, rest @ ..]) => {
                    right = rest;
                    *b
                }
                ([a, rest @ ..], []) => {
                    left = rest;
                    *a
                }
                ([], []) => break,
            };
            let (sum, error) = two_sum(carry, component);
            result.push(error);
            carry = sum;
        }
        result.push(carry);
        result
    }

    /// The exact negative.
    pub fn negate(&self) -> Self {
        Self(self.0.iter().map(|c| -c).collect())
    }

    fn scale(&self, b: f64) -> Self {
        let mut result = Self(Vec::with_capacity(2 * self.0.len()));
        let mut carry = 0.0;
        for &component in &self.0 {
            let (product, product_error) = two_product(component, b);
            let (sum, error) = two_sum(carry, product_error);
            result.push(error);
            let (high, low) = two_sum(product, sum);
            result.push(low);
            carry = high;
        }
        result.push(carry);
        result
    }

    /// The exact product.
    pub fn multiply(&self, other: &Self) -> Self {
        let (short, long) = if self.0.len() < other.0.len() { (self, other) } else { (other, self) };
        short.0.iter().fold(Self::default(), |sum, &component| sum.add(&long.scale(component)))
    }

    /// -1, 0 or 1: the largest component decides, as the others can't reach it.
    pub fn sign(&self) -> i32 {
        match self.0.last() {
            Some(&largest) if largest > 0.0 => 1,
            Some(_) => -1,
            None => 0,
        }
    }

    /// The nearest double, up to an ulp.
    pub fn estimate(&self) -> f64 {
        self.0.iter().sum()
    }
}

#[cfg(test)]
mod tests {
    use num_bigint::BigInt;

    use super::*;

    /// In units of 2^-1200.
    fn whole(x: f64) -> BigInt {
        let bits = x.to_bits();
        let (exponent, digits) = ((bits >> 52 & 0x7ff) as i64, bits & ((1 << 52) - 1));
        let digits = BigInt::from(if exponent == 0 { digits } else { digits | 1 << 52 });
        let size = digits << (exponent.max(1) - 1075 + 1200);
        if x < 0.0 { -size } else { size }
    }

    fn of(e: &Expansion) -> BigInt {
        e.0.iter().map(|&x| whole(x)).sum()
    }

    /// Whether each component is below the lowest bit of the next.
    fn overlaps(e: &Expansion) -> bool {
        e.0.windows(2).any(|pair| {
            let lowest = whole(pair[1]).trailing_zeros().unwrap_or(0);
            whole(pair[0]).magnitude().bits() > lowest
        })
    }

    #[test]
    fn sums_and_products_are_exact_and_do_not_overlap() {
        let mut state = 11u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            state >> 33
        };
        let mut number = |k: u64| {
            // Of many sizes, of few digits, powers of two, and zero.
            let digits = match k % 4 {
                0 => (random() % 9) as f64 - 4.0,
                1 => 2f64.powi((random() % 24) as i32),
                _ => random() as f64 - 1e9,
            };
            f64::from((digits * 2f64.powi((random() % 60) as i32 - 40)) as f32)
        };
        let unit = BigInt::from(1) << 1200;
        for k in 0..3000 {
            let all: Vec<f64> = (0..6).map(|i| number(k + i)).collect();
            let pair = |i: usize| Expansion::difference(all[i], all[i + 1]);
            let [a, b, c] = [0, 2, 4].map(pair);
            let (ab, sum) = (a.multiply(&b), a.add(&c));
            let abc = ab.add(&sum).multiply(&c).add(&a.multiply(&sum).negate());
            assert_eq!(of(&ab) * &unit, of(&a) * of(&b));
            assert_eq!(of(&sum), of(&a) + of(&c));
            assert_eq!(
                of(&abc) * &unit * &unit,
                (of(&a) * of(&b) + of(&sum) * &unit) * of(&c) - of(&a) * of(&sum) * &unit
            );
            for e in [&a, &ab, &sum, &abc] {
                assert!(!overlaps(e), "{e:?}");
                assert_eq!(e.sign(), if of(e) == BigInt::ZERO { 0 } else { 2 * i32::from(of(e) > BigInt::ZERO) - 1 });
            }
            assert_eq!(abc.add(&abc.negate()), Expansion::default());
        }
    }

    #[test]
    fn keeps_what_doubles_lose() {
        let big = Expansion::difference(1e30, 1e-30);
        let difference = big.add(&Expansion::difference(0.0, 1e30));
        assert_eq!(difference.estimate(), -1e-30);
        // (a - b)(a + b) - a^2 + b^2 = 0 exactly, for values that doubles can't square.
        let (a, b) = (f64::from(0.1f32), f64::from(1.0e-7f32));
        let product = Expansion::difference(a, b).multiply(&Expansion::difference(a, -b));
        let square = |x: f64| Expansion::difference(x, 0.0).multiply(&Expansion::difference(x, 0.0));
        let rest = product.add(&square(a).negate()).add(&square(b));
        assert_eq!(rest.sign(), 0);
        assert_eq!(rest, Expansion::default());
    }
}
