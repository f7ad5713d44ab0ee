//! What is summed over the exposed pieces of the facets: the fraction A, and beside it the vector b.
//!
//! With V the open part of the hemisphere and c = (D - 1) / |S^(D-2)|,
//!
//! ```text
//! A = c * integral over V of (w . n) dw            b = c * integral over V of w (w . n) dw
//! ```
//!
//! The divergence theorem takes both to the facets f of the cone over V (cut by the unit ball), N_f the unit normal of f
//! towards the inside:
//!
//! ```text
//! A     = c * sum of (N_f . n) A_f / (D - 1)       A_f the solid angle of f
//! b . t = c * sum of (N_f . n) (m_f . t) / D       for t at a right angle to n; m_f the integral over f of u du
//! b . n = c * sum of (N_f . n) H_f                 H_f the integral over f of h(u . n) du
//! ```
//!
//! The second line is that theorem for the function x . t. In the third the function is that of the angle a to n alone
//! whose field along the meridians has the divergence cos^2 a on the sphere:
//!
//! ```text
//! h(cos a) = 1/sin^(D-1) a * integral from 0 to a of cos^2 sin^(D-2)
//!          = (cos a + 1 / (1 + cos a)) / 3         in 3D
//!          = (4 a - sin 4a) / (32 sin^3 a)         in 4D
//! ```
//!
//! In 4D f is a spherical polygon, and the same step leads to its edges e. Let q be the projection of n to the plane of f,
//! s its length, M_e the unit normal of e within the plane towards the inside, and K' = -h:
//!
//! ```text
//! H_f = sum of (M_e . q) * integral over e of (K(u . q) - K(s)) / (s^2 - (u . q)^2) dl
//! K(cos a) = (sin^2 a - a cot a) / 8
//! ```
//!
//! What is left are integrals of analytic functions over arcs below 105 degrees. In 4D they are no elementary functions
//! (the volumes of spherical polyhedra are dilogarithms; Schläfli 1858), but twelve nodes of Gauss and Legendre give all
//! their digits. The tests find less than 1e-11 for b.

use super::plane::{Chart, Flat, Plane};
use super::polygon::Region;
use crate::geometry::{Dimension, Vector64};

/// Half of the nodes of Gauss and Legendre on [-1, 1], and their weights; the others mirror them.
const NODES: [(f64, f64); 6] = [
    (0.125_233_408_511_468_9, 0.249_147_045_813_402_8),
    (0.367_831_498_998_180_2, 0.233_492_536_538_354_8),
    (0.587_317_954_286_617_5, 0.203_167_426_723_065_92),
    (0.769_902_674_194_304_7, 0.160_078_328_543_346_23),
    (0.904_117_256_370_474_9, 0.106_939_325_995_318_43),
    (0.981_560_634_246_719_3, 0.047_175_336_386_511_83),
];

/// Below this length of q all of a facet is seen at a right angle to n: what that leaves out goes with its square.
const LEVEL: f64 = 1e-7;

/// Something that is summed over pieces.
pub(super) trait Integral<const D: usize> {
    /// The pieces that follow are of a facet in this plane, and count so much.
    fn begin(&mut self, plane: &Plane<D>, weight: f64);
    /// A piece of it.
    fn add(&mut self, piece: &Region<D>);
}

/// The fraction A.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Fraction {
    sum: f64,
    weight: f64,
    part: f64,
}

impl Fraction {
    fn close(&mut self) {
        self.sum += self.weight * self.part;
        (self.weight, self.part) = (0.0, 0.0);
    }

    /// What there is in all.
    pub fn finish<const D: usize>(mut self) -> f64 {
        self.close();
        self.sum / Dimension::of::<D>().horizon_measure()
    }
}

impl<const D: usize> Integral<D> for Fraction {
    fn begin(&mut self, _: &Plane<D>, weight: f64) {
        self.close();
        self.weight = weight;
    }

    fn add(&mut self, piece: &Region<D>) {
        self.part += piece.measure();
    }
}

/// The fraction A and the vector b.
pub(super) struct Directed<const D: usize> {
    fraction: Fraction,
    normal: Vector64<D>,
    sum: Vector64<D>,
    facet: Option<Facet<D>>,
}

/// The pieces of one facet.
struct Facet<const D: usize> {
    weight: f64,
    chart: Chart<D>,
    /// The normal's projection to the plane, and its length.
    q: Flat,
    s: f64,
    /// The sums over the pieces of u, and of h.
    mean: Flat,
    height: f64,
}

impl<const D: usize> Directed<D> {
    /// Nothing yet, of the hemisphere around this unit normal.
    pub fn new(normal: &Vector64<D>) -> Self {
        Self { fraction: Fraction::default(), normal: *normal, sum: Vector64::zeros(), facet: None }
    }

    fn close(&mut self) {
        if let Some(facet) = self.facet.take() {
            let mean = facet.chart.unflatten(&facet.mean);
            let across = (mean - self.normal * mean.dot(&self.normal)) / D as f64;
            self.sum += (across + self.normal * facet.height) * facet.weight;
        }
    }

    /// What there is in all: A and b.
    pub fn finish(mut self) -> (f64, Vector64<D>) {
        self.close();
        let c = (D - 1) as f64 / Dimension::of::<D>().horizon_measure();
        (self.fraction.finish::<D>(), self.sum * c)
    }
}

impl<const D: usize> Integral<D> for Directed<D> {
    fn begin(&mut self, plane: &Plane<D>, weight: f64) {
        self.close();
        self.fraction.begin(plane, weight);
        let q = plane.chart().project(&self.normal);
        self.facet = Some(Facet {
            weight,
            chart: plane.chart().clone(),
            q,
            s: q.norm().min(1.0),
            mean: Flat::zeros(),
            height: 0.0,
        });
    }

    fn add(&mut self, piece: &Region<D>) {
        self.fraction.add(piece);
        // What is at a right angle to the horizon counts nothing, wherever it is.
        let Some(facet) = self.facet.as_mut().filter(|facet| facet.weight != 0.0) else { return };
        match Dimension::of::<D>() {
            Dimension::Three => {
                for (a, b) in piece.edges() {
                    facet.mean += Flat::new(b.y - a.y, a.x - b.x, 0.0);
                    facet.height += along(&a, &b, |u| {
                        let c = facet.q.dot(u);
                        (c + 1.0 / (1.0 + c)) / 3.0
                    });
                }
            }
            Dimension::Four => {
                let is_level = facet.s < LEVEL;
                for (a, b) in piece.edges() {
                    let across = a.cross(&b);
                    let (sine, cosine) = (across.norm(), a.dot(&b));
                    if sine == 0.0 {
                        continue;
                    }
                    let inward = across / sine;
                    facet.mean += inward * (0.5 * sine.atan2(cosine));
                    if !is_level {
                        let (s, q) = (facet.s, facet.q);
                        facet.height += inward.dot(&q)
                            * along(&a, &b, |u| {
                                let c = q.dot(u).clamp(-s, s);
                                mean_of_h(c, s) / (s + c)
                            });
                    }
                }
                if is_level {
                    facet.height += piece.measure() * h(0.0);
                }
            }
        }
    }
}

/// The integral along the arc from a to b.
fn along(a: &Flat, b: &Flat, value: impl Fn(&Flat) -> f64) -> f64 {
    let across = a.cross(b);
    let sine = across.norm();
    if sine == 0.0 {
        return 0.0;
    }
    let (length, ahead) = (sine.atan2(a.dot(b)), across.cross(a) / sine);
    let at = |x: f64| {
        let (sin, cos) = libm::sincos(0.5 * length * (1.0 + x));
        value(&(a * cos + ahead * sin))
    };
    0.5 * length * NODES.iter().map(|&(x, weight)| weight * (at(x) + at(-x))).sum::<f64>()
}

/// h in 4D, by the cosine.
fn h(c: f64) -> f64 {
    let square = (1.0 - c) * (1.0 + c);
    if c > 0.0 && square < 1e-3 {
        // a = asin(sin a): the first digits of both terms are the same.
        return 1.0 / 3.0 - square * (0.1 + square * (1.0 / 56.0 + square / 144.0));
    }
    let sine = square.sqrt();
    (libm::acos(c) / sine - c * (2.0 * c * c - 1.0)) / (8.0 * square)
}

/// K in 4D, by the cosine.
fn antiderivative(c: f64) -> f64 {
    let square = (1.0 - c) * (1.0 + c);
    let cotangent = if square == 0.0 { 1.0 } else { libm::acos(c) * c / square.sqrt() };
    (square - cotangent) / 8.0
}

/// The mean of h from c to s, (K(c) - K(s)) / (s - c).
fn mean_of_h(c: f64, s: f64) -> f64 {
    if (s - c).abs() > 1e-3 {
        (antiderivative(c) - antiderivative(s)) / (s - c)
    } else {
        (h(c) + 4.0 * h(0.5 * (c + s)) + h(s)) / 6.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Riemann's middle sum.
    fn by_steps(from: f64, to: f64, value: impl Fn(f64) -> f64) -> f64 {
        let steps = 20_000;
        let step = (to - from) / f64::from(steps);
        (0..steps).map(|i| value(from + (f64::from(i) + 0.5) * step)).sum::<f64>() * step
    }

    #[test]
    fn h_is_the_field_that_has_this_divergence() {
        for angle in [1e-3, 0.01, 0.03, 0.0316, 0.032, 0.3, 1.0, 1.5, std::f64::consts::FRAC_PI_2] {
            let integral = by_steps(0.0, angle, |a| (a.cos() * a.sin()).powi(2));
            let found = h(angle.cos());
            assert!((found - integral / angle.sin().powi(3)).abs() < 1e-8, "{angle}: {found}");
        }
        assert!((h(1.0) - 1.0 / 3.0).abs() < 1e-15 && (h(0.0) - std::f64::consts::PI / 16.0).abs() < 1e-15);
        // Both formulas give the same where they meet.
        let meet = (1.0f64 - 1e-3).sqrt();
        assert!((h(meet - 1e-9) - h(meet + 1e-9)).abs() < 1e-9 * 0.5);
    }

    #[test]
    fn means_of_h_are_those_of_its_antiderivative() {
        for (c, s) in [(0.0, 1.0), (0.2, 0.9), (0.5, 0.502), (0.5, 0.5005), (0.99, 1.0), (0.9995, 1.0), (0.0, 1e-6)] {
            let expected = by_steps(c, s, h) / (s - c);
            assert!((mean_of_h(c, s) - expected).abs() < 1e-9, "{c} {s}");
        }
    }

    #[test]
    fn twelve_nodes_integrate_a_quarter_circle() {
        let (a, b) = (Flat::x(), Flat::y());
        let found = along(&a, &b, |u| (7.0 * u.x).cos() + u.y);
        let expected = by_steps(0.0, std::f64::consts::FRAC_PI_2, |t| (7.0 * t.cos()).cos() + t.sin());
        assert!((found - expected).abs() < 1e-8, "{found} {expected}");
        assert!((NODES.iter().map(|(_, weight)| 2.0 * weight).sum::<f64>() - 2.0).abs() < 1e-15);
    }
}
