//! Points and planes in whole numbers, so that every sign is right.
//!
//! Coordinates of a file are multiples of some power of two; in units of it they are whole numbers. A plane through three
//! of them has whole coefficients, and a point where planes meet is a quotient of whole numbers with one denominator:
//! homogeneous coordinates (X, Y, Z, W) with W > 0, kept in lowest terms. Beside each stands its value in `f64`, which
//! settles nearly all signs at once.

use num_bigint::BigInt;
use num_bigint::Sign;
use num_integer::Integer;
use num_traits::{Signed, ToPrimitive, Zero};

use crate::geometry::Vector64;

/// How far a sum of products of rounded numbers may be off, in terms of the sum of their magnitudes: generously.
const ROUNDING: f64 = 1.0 / (1u64 << 46) as f64;

/// A point (X, Y, Z) / W, with W > 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    whole: [BigInt; 4],
    near: [f64; 3],
}

/// The points p with a x + b y + c z + d = 0, in lowest terms; a normal (a, b, c) points to the positive side.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Plane {
    whole: [BigInt; 4],
    /// Bits of the coefficients in `f64`: bits, so that planes can be keys.
    near: [u64; 4],
}

/// The power of two of which all coordinates are multiples.
pub fn unit(points: &[Vector64<3>]) -> i32 {
    points.iter().flatten().filter(|x| **x != 0.0).map(|x| lowest_bit(*x)).min().unwrap_or(0)
}

/// The mantissa of a finite number, and the power of two it is to be multiplied by.
fn parts(x: f64) -> (i64, i32) {
    let bits = x.to_bits();
    let (exponent, fraction) = ((bits >> 52 & 0x7ff) as i32, (bits & ((1 << 52) - 1)) as i64);
    let (mantissa, power) = if exponent == 0 { (fraction, -1074) } else { (fraction | 1 << 52, exponent - 1075) };
    (if x < 0.0 { -mantissa } else { mantissa }, power)
}

fn lowest_bit(x: f64) -> i32 {
    let (mantissa, power) = parts(x);
    power + mantissa.trailing_zeros() as i32
}

fn whole(x: f64, unit: i32) -> BigInt {
    let (mantissa, power) = parts(x);
    let shift = power - unit;
    if shift >= 0 { BigInt::from(mantissa) << shift } else { BigInt::from(mantissa) >> -shift }
}

/// A quotient in `f64`, to the last bit or so.
fn quotient(numerator: &BigInt, denominator: &BigInt) -> f64 {
    let wanted = 66 + denominator.bits() as i64 - numerator.bits() as i64;
    let shift = wanted.max(0);
    let shifted = (numerator << shift) / denominator;
    // In two steps, as a power of two may leave the range where the product does not.
    let half = (shift / 2) as i32;
    let value = shifted.to_f64().unwrap_or(f64::NAN);
    libm::ldexp(libm::ldexp(value, -half), half - shift as i32)
}

fn sign_of(number: &BigInt) -> i32 {
    match number.sign() {
        Sign::Minus => -1,
        Sign::NoSign => 0,
        Sign::Plus => 1,
    }
}

impl Point {
    /// A point of the input, in these units. Exact if `unit` is that of all points, or else rounded towards 0.
    pub fn new(point: &Vector64<3>, unit: i32) -> Self {
        Self::of([whole(point[0], unit), whole(point[1], unit), whole(point[2], unit), BigInt::from(1)])
    }

    fn of(mut whole: [BigInt; 4]) -> Self {
        let divisor = whole.iter().fold(BigInt::zero(), |g, x| g.gcd(x));
        let divisor = if whole[3].is_negative() { -divisor } else { divisor };
        if !divisor.is_zero() && divisor != BigInt::from(1) {
            whole.iter_mut().for_each(|x| *x = &*x / &divisor);
        }
        let near = std::array::from_fn(|axis| quotient(&whole[axis], &whole[3]));
        Self { whole, near }
    }

    /// Where the segment from a to b meets a plane that has them on opposite sides.
    pub fn between(a: &Self, b: &Self, plane: &Plane) -> Self {
        let (at_a, at_b) = (plane.value(a), plane.value(b));
        Self::of(std::array::from_fn(|i| &a.whole[i] * &at_b - &b.whole[i] * &at_a))
    }

    /// The middle of three points.
    pub fn middle(points: [&Self; 3]) -> Self {
        let [a, b, c] = points.map(|p| &p.whole);
        let (bc, ca, ab) = (&b[3] * &c[3], &c[3] * &a[3], &a[3] * &b[3]);
        let weight = BigInt::from(3) * &ab * &c[3];
        let along = |i: usize| &a[i] * &bc + &b[i] * &ca + &c[i] * &ab;
        Self::of([along(0), along(1), along(2), weight])
    }

    /// Its coordinates where they came from.
    pub fn rounded(&self, unit: i32) -> Vector64<3> {
        Vector64::from(self.near.map(|x| libm::ldexp(libm::ldexp(x, unit / 2), unit - unit / 2)))
    }
}

impl Plane {
    /// Through three points of the input, which have W = 1; none if they are in line.
    pub fn through([a, b, c]: [&Point; 3]) -> Option<Self> {
        let edge = |to: &Point| -> [BigInt; 3] { std::array::from_fn(|i| &to.whole[i] - &a.whole[i]) };
        let (u, v) = (edge(b), edge(c));
        let normal: [BigInt; 3] = std::array::from_fn(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            &u[j] * &v[k] - &u[k] * &v[j]
        });
        let offset: BigInt = (0..3).map(|i| -(&normal[i] * &a.whole[i])).sum();
        let [x, y, z] = normal;
        Self::of([x, y, z, offset])
    }

    /// The plane across an axis, at a whole number.
    pub fn across(axis: usize, at: BigInt) -> Self {
        let mut whole: [BigInt; 4] = Default::default();
        whole[axis] = BigInt::from(1);
        whole[3] = -at;
        Self::of(whole).unwrap_or_else(|| unreachable!("its normal is 1 along an axis"))
    }

    fn of(mut whole: [BigInt; 4]) -> Option<Self> {
        if whole[..3].iter().all(Zero::is_zero) {
            return None;
        }
        let divisor = whole.iter().fold(BigInt::zero(), |g, x| g.gcd(x));
        whole.iter_mut().for_each(|x| *x = &*x / &divisor);
        let near = std::array::from_fn(|i| whole[i].to_f64().unwrap_or(f64::NAN).to_bits());
        Some(Self { whole, near })
    }

    /// The same plane, with its positive side such that the first coefficient of its normal that is not 0 is above 0; and
    /// whether that turned it.
    pub fn upwards(self) -> (Self, bool) {
        let turn = self.whole[..3].iter().find(|x| !x.is_zero()).is_some_and(Signed::is_negative);
        if !turn {
            return (self, false);
        }
        // Less 0 rather than turned, so that 0 stays 0 and not -0, which has other bits.
        let near = self.near.map(|bits| (0.0 - f64::from_bits(bits)).to_bits());
        (Self { whole: self.whole.map(|x| -x), near }, true)
    }

    fn value(&self, point: &Point) -> BigInt {
        (0..4).map(|i| &self.whole[i] * &point.whole[i]).sum()
    }

    /// On which side a point is: 1, -1, or 0 on the plane.
    pub fn side(&self, point: &Point) -> i32 {
        let [a, b, c, d] = self.near.map(f64::from_bits);
        let terms = [a * point.near[0], b * point.near[1], c * point.near[2], d];
        let (sum, most) = (terms.iter().sum::<f64>(), terms.iter().map(|x| x.abs()).sum::<f64>() * ROUNDING);
        if sum.abs() > most && most.is_finite() { sum.signum() as i32 } else { sign_of(&self.value(point)) }
    }

    /// The axis along which the plane is best looked at: the largest coefficient of the normal, and its sign.
    pub fn view(&self) -> (usize, i32) {
        let axis = (0..3).max_by_key(|&i| self.whole[i].abs()).unwrap_or(0);
        (axis, sign_of(&self.whole[axis]))
    }
}

/// Whether three points run counterclockwise (1), clockwise (-1) or in line (0), looked at against this axis.
pub fn turn([a, b, c]: [&Point; 3], axis: usize) -> i32 {
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    let edge = |to: &Point| [to.near[i] - a.near[i], to.near[j] - a.near[j]];
    let (u, v) = (edge(b), edge(c));
    let size = |p: &Point| p.near[i].abs().max(p.near[j].abs());
    let most = size(a).max(size(b)).max(size(c));
    let reach = u.iter().chain(&v).fold(0f64, |reach, x| reach.max(x.abs()));
    let (value, error) = (u[0] * v[1] - u[1] * v[0], (most * reach + most * most * ROUNDING) * ROUNDING * 8.0);
    if value.abs() > error && error.is_finite() {
        return value.signum() as i32;
    }
    let row = |p: &Point| [p.whole[i].clone(), p.whole[j].clone(), p.whole[3].clone()];
    let ([ax, ay, aw], [bx, by, bw], [cx, cy, cw]) = (row(a), row(b), row(c));
    sign_of(&(&ax * (&by * &cw - &bw * &cy) - &ay * (&bx * &cw - &bw * &cx) + &aw * (&bx * &cy - &by * &cx)))
}

impl Point {
    /// A point with whole coordinates.
    pub fn whole([x, y, z]: [BigInt; 3]) -> Self {
        Self::of([x, y, z, BigInt::from(1)])
    }
}
