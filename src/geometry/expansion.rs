//! Exact sums and products of doubles: a number as an unevaluated sum of non-overlapping `f64`, after Shewchuk,
//! *Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates*, 1997.
//!
//! Exact as long as nothing overflows or underflows. For polynomials of degree 4 in differences of `f32` that can't
//! happen: the smallest bit is 2^(-149 * 4), the largest value below 2^(129 * 4 + 5).

/// An exact number: components of increasing magnitude that do not overlap; the empty list is zero.
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

    fn add_component(&self, b: f64) -> Self {
        let mut result = Self(Vec::with_capacity(self.0.len() + 1));
        let mut carry = b;
        for &component in &self.0 {
            let (sum, error) = two_sum(carry, component);
            result.push(error);
            carry = sum;
        }
        result.push(carry);
        result
    }

    /// The exact sum.
    pub fn add(&self, other: &Self) -> Self {
        other.0.iter().fold(self.clone(), |sum, &component| sum.add_component(component))
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
        other.0.iter().fold(Self::default(), |sum, &component| sum.add(&self.scale(component)))
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
    use super::*;

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
