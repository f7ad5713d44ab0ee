//! Signs, sides and distances against exact arithmetic by a library. Every `f32` is a whole multiple of 2^-149, so
//! determinants of differences are determinants of integers.

use ao4d::geometry::{Column, Cone, Vector, Vector64, determinant_sign, is_degenerate, narrow, plane_side, widen};
use num_bigint::{BigInt, Sign};
use num_rational::BigRational;
use rand::{RngExt, rngs::ChaCha8Rng};

use crate::bodies::random;
use crate::many;

/// The number times 2^149.
fn integer(x: f32) -> BigInt {
    let bits = x.to_bits();
    let exponent = bits >> 23 & 0xff;
    let mantissa = if exponent == 0 { bits & 0x7f_ffff } else { bits & 0x7f_ffff | 1 << 23 };
    let size = BigInt::from(mantissa) << exponent.saturating_sub(1);
    if x.is_sign_negative() { -size } else { size }
}

fn entries<const D: usize>(column: &Column<D>) -> Vec<BigInt> {
    (0..D).map(|r| integer(column.head[r]) - integer(column.tail[r])).collect()
}

fn determinant(columns: &[Vec<BigInt>]) -> BigInt {
    let Some((first, rest)) = columns.split_first() else { return BigInt::from(1) };
    let mut sum = BigInt::from(0);
    for (row, entry) in first.iter().enumerate() {
        let minor: Vec<Vec<BigInt>> = (rest.iter())
            .map(|c| c.iter().enumerate().filter(|(r, _)| *r != row).map(|(_, x)| x.clone()).collect())
            .collect();
        let term = entry * determinant(&minor);
        if row % 2 == 0 { sum += term } else { sum -= term }
    }
    sum
}

fn sign(x: &BigInt) -> i32 {
    match x.sign() {
        Sign::Minus => -1,
        Sign::NoSign => 0,
        Sign::Plus => 1,
    }
}

/// Points whose determinants are zero, all but zero, or anything, of all sizes.
struct Adversary(ChaCha8Rng);

impl Adversary {
    fn coordinate(&mut self, kind: usize) -> f32 {
        let random = &mut self.0;
        let unit = random.random::<f32>() * 2.0 - 1.0;
        match kind {
            0 => f32::from(random.random_range(-2i8..3)),
            1 => unit,
            2 => 1e5 + f32::from(random.random_range(0u8..7)) / 128.0,
            3 => unit * 2f32.powi(random.random_range(-60..60)),
            4 => 1.0f32 + f32::EPSILON * f32::from(random.random_range(-2i8..3)),
            5 => [1e30, -1e30, 1e-45, -1e-40, 1.0, 0.0, unit][random.random_range(0..7)],
            6 => (unit * 1000.0).round() * 1e-6,
            _ => (unit * 1000.0).round() * 1e6,
        }
    }

    fn points<const D: usize, const N: usize>(&mut self, kind: usize) -> [Vector<D>; N] {
        let mut points: [Vector<D>; N] = std::array::from_fn(|_| Vector::from_fn(|_, _| self.coordinate(kind)));
        // Often the last of the D vertices in the span of others and the first point, all but for rounding or an ulp.
        let weights: [f64; N] = std::array::from_fn(|_| f64::from(self.0.random_range(-2i8..3)) * 0.5);
        let mode = self.0.random_range(0..4);
        if mode > 0 && kind != 5 {
            let base = widen(&points[0]);
            let combination: Vector64<D> = (1..D).fold(base, |sum, i| sum + (widen(&points[i]) - base) * weights[i]);
            points[D] = narrow(&combination);
            if mode == 2 {
                let axis = self.0.random_range(0..D);
                points[D][axis] = points[D][axis].next_up();
            }
            if mode == 3 {
                points[D] = points[1 + self.0.random_range(0..D - 1)];
            }
        }
        points
    }
}

#[derive(Default, Debug, PartialEq)]
struct Wrong {
    determinant: usize,
    cone: usize,
    interior: usize,
    distance: usize,
    order: usize,
    side: usize,
    degenerate: usize,
}

/// What exact arithmetic says of a cone and a direction: orientation, facet signs, numerator and denominator of t.
struct Exact {
    orientation: i32,
    facets: Vec<i32>,
    numerator: BigInt,
    denominator: BigInt,
}

impl Exact {
    fn new<const D: usize>(columns: &[Column<D>; D], direction: &Vector<D>) -> Self {
        let edges: Vec<Vec<BigInt>> = columns.iter().map(entries).collect();
        let numerator = determinant(&edges);
        let orientation = sign(&numerator);
        let weights: Vec<BigInt> = (0..D)
            .map(|i| {
                let mut replaced = edges.clone();
                replaced[i] = entries(&Column::vector(*direction));
                determinant(&replaced) * orientation
            })
            .collect();
        let denominator = weights.iter().sum();
        Self {
            orientation,
            facets: weights.iter().map(sign).collect(),
            numerator: numerator * orientation,
            denominator,
        }
    }

    fn contains(&self) -> bool {
        self.orientation != 0 && self.facets.iter().all(|&s| s >= 0)
    }
}

fn check<const D: usize>() {
    let mut adversary = Adversary(random(31));
    let mut wrong = Wrong::default();
    let count = many(60_000);
    let (mut zeros, mut held, mut compared) = (0, 0, 0);
    for k in 0..count {
        // The origin, D vertices, and more to make directions and a second simplex of.
        let points: [Vector<D>; 8] = adversary.points(k % 8);
        let origin = points[0];
        let simplex: [Vector<D>; D] = std::array::from_fn(|i| points[i + 1]);
        let columns = simplex.map(|v| Column::edge(v, origin));
        let direction = match k / 8 % 4 {
            0 => simplex[0] - origin,
            1 => simplex[0] - origin + (simplex[1] - origin) * 0.5,
            2 => simplex.iter().fold(Vector::zeros(), |sum: Vector<D>, v| sum + (v - origin) * 0.25),
            _ => points[6] - points[7],
        };
        let direction = direction.map(|x| if x.is_finite() { x } else { 1.0 });
        let exact = Exact::new(&columns, &direction);
        zeros += usize::from(exact.orientation == 0);
        wrong.determinant += usize::from(determinant_sign(&columns) != exact.orientation);
        wrong.side += usize::from(plane_side(&simplex, &origin) != -exact.orientation);
        let cone = Cone::new(columns);
        let same = cone.orientation() == exact.orientation && cone.contains(&direction) == exact.contains();
        wrong.cone += usize::from(!same);
        let interior = (exact.orientation != 0 && !exact.facets.contains(&0)).then(|| exact.contains());
        wrong.interior += usize::from(cone.strictly_contains(&direction) != interior);
        wrong.degenerate += usize::from(is_degenerate(&simplex) != flat(&simplex));
        if !exact.contains() || direction.amax() == 0.0 {
            continue;
        }
        held += 1;
        let t = BigRational::new(exact.numerator.clone(), exact.denominator.clone());
        // Directions stand for themselves times 2^149, as edges do.
        let crossing = cone.crossing(&direction);
        if crossing.error.is_finite() {
            let rational = |x: f64| BigRational::from_float(x).expect("finite");
            let off = rational(crossing.t) - &t;
            let outside = off > rational(crossing.error) || -off > rational(crossing.error);
            let sum: f64 = crossing.barycentric.iter().sum();
            let sound = (sum - 1.0).abs() < 1e-12 && crossing.barycentric.iter().all(|&b| b >= 0.0);
            wrong.distance += usize::from(outside || !sound);
        }
        // Against another simplex that shares all vertices but one.
        let mut other = simplex;
        other[k % D] = if k % 2 == 0 { points[6] } else { simplex[k % D] + (simplex[0] - simplex[1]) };
        if other.iter().any(|v| v.iter().any(|x| !x.is_finite())) {
            continue;
        }
        let columns = other.map(|v| Column::edge(v, origin));
        let exact_other = Exact::new(&columns, &direction);
        if exact_other.contains() {
            compared += 1;
            let (a, b) = cone.exact_distance(&direction);
            let (c, d) = Cone::new(columns).exact_distance(&direction);
            let order = a.multiply(&d).add(&c.multiply(&b).negate()).sign();
            let expected =
                sign(&(&exact.numerator * &exact_other.denominator - &exact_other.numerator * &exact.denominator));
            wrong.order += usize::from(order != expected);
        }
    }
    println!("{D}D: {count} cones, {zeros} of them flat, {held} with a hit, {compared} pairs of hits: {wrong:?}");
    assert!(zeros > count / 20 && held > count / 20 && compared > 0, "too few hard cases");
    assert_eq!(wrong, Wrong::default());
}

/// Whether all minors of the edges vanish.
fn flat<const D: usize>(simplex: &[Vector<D>; D]) -> bool {
    let edges: Vec<Vec<BigInt>> = (1..D).map(|i| entries(&Column::edge(simplex[i], simplex[0]))).collect();
    (0..D).all(|skip| {
        let minor: Vec<Vec<BigInt>> = (edges.iter())
            .map(|c| c.iter().enumerate().filter(|(r, _)| *r != skip).map(|(_, x)| x.clone()).collect())
            .collect();
        sign(&determinant(&minor)) == 0
    })
}

#[test]
fn signs_are_those_of_exact_arithmetic() {
    check::<3>();
    check::<4>();
}
