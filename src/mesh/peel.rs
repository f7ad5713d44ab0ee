//! Peels of a hypersphere: the tori of Hopf (Banchoff, *Beyond the Third Dimension*, 1990).
//!
//! With u = x + iy and v = z + iw, Hopf's map leads a point of R^4 to h = (2 Re(u v*), 2 Im(u v*), |u|^2 - |v|^2), a point of
//! R^3 at the square of its distance. It takes the hypersphere to a sphere, and each point of that is where a whole circle,
//! a fibre, comes to. A circle on the sphere that lies all the way round at the angle 2a from an axis is where a torus
//! comes to: one peel. At a = 0 and a = 90 degrees the torus shrinks to a circle; between them, at 45, it is Clifford's, flat
//! and square, which cuts the hypersphere into two equal halves. About the third axis a is the angle with tan a = |v| / |u|.
//!
//! The peel of a mesh is where f(x) = cos 2a |x|^2 - n.h(x) is zero, for the axis n. That is a quadratic form, so where it
//! changes its sign along an edge it has one root there, which is found exactly but for rounding.

use super::section::Level;
use crate::geometry::Vector64;

/// The points whose image by Hopf's map is at a given angle from an axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Hopf {
    center: Vector64<4>,
    /// The symmetric matrix of the quadratic form.
    form: [[f64; 4]; 4],
}

impl Hopf {
    /// The peel at `degrees` about the axis, an end of a diameter of Hopf's sphere of any length but zero; about the third
    /// axis 0 degrees is the circle in the plane xy, and 90 that in zw. None if the axis is zero or not finite.
    pub fn new(center: Vector64<4>, axis: [f64; 3], degrees: f64) -> Option<Self> {
        let largest = axis.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        if !(largest > 0.0 && largest.is_finite() && axis.iter().all(|x| x.is_finite())) {
            return None;
        }
        let [p, q, r] = {
            let scaled = axis.map(|x| x / largest);
            let length = scaled.iter().map(|x| x * x).sum::<f64>().sqrt();
            scaled.map(|x| x / length)
        };
        // Exactly zero for Clifford's torus.
        let c = if degrees == 45.0 { 0.0 } else { libm::cos(2.0 * degrees.to_radians()) };
        let form = [[c - r, 0.0, -p, q], [0.0, c - r, -q, -p], [-p, -q, c + r, 0.0], [q, -p, 0.0, c + r]];
        Some(Self { center, form })
    }

    /// The form of two vectors.
    fn product(&self, a: &Vector64<4>, b: &Vector64<4>) -> f64 {
        (0..4).map(|i| (0..4).map(|j| a[i] * self.form[i][j] * b[j]).sum::<f64>()).sum()
    }
}

impl<const D: usize> Level<D> for Hopf {
    /// Above zero where the angle is larger than the peel's.
    fn value(&self, point: &Vector64<D>) -> f64 {
        let offset = four(point) - self.center;
        self.product(&offset, &offset)
    }

    fn share(&self, ends: [Vector64<D>; 2], heights: [f64; 2]) -> f64 {
        let [from, to] = ends.map(|end| four(&end));
        let (offset, along) = (from - self.center, to - from);
        // f = c + 2 b t + a t^2, by the two forms of its roots that lose no digits.
        let (a, b, c) = (self.product(&along, &along), self.product(&offset, &along), heights[0]);
        let q = -(b + b.signum() * (b * b - a * c).max(0.0).sqrt());
        let linear = heights[0] / (heights[0] - heights[1]);
        let within = |t: &f64| (-1e-9..=1.0 + 1e-9).contains(t);
        [q / a, c / q].into_iter().find(within).unwrap_or(linear).clamp(0.0, 1.0)
    }
}

/// The vector with four components; there are no others where this is used.
fn four<const D: usize>(v: &Vector64<D>) -> Vector64<4> {
    Vector64::from_fn(|r, _| v.get(r).copied().unwrap_or(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Hopf's map, as written above.
    fn image(p: [f64; 4]) -> [f64; 3] {
        let [x, y, z, w] = p;
        [2.0 * (x * z + y * w), 2.0 * (y * z - x * w), x * x + y * y - z * z - w * w]
    }

    #[test]
    fn the_form_is_the_angle_from_the_axis() {
        let center = Vector64::from([0.5, -1.0, 0.25, 2.0]);
        for axis in [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 3.0, 0.0], [-1.0, 2.0, 0.5]] {
            for p in [[1.0, 0.0, 0.0, 0.0], [0.3, -0.4, 0.5, 0.2], [0.0, 2.0, -1.0, 1.0], [0.1, 0.2, 0.3, -0.9]] {
                let (h, square) = (image(p), p.iter().map(|x| x * x).sum::<f64>());
                let length = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
                let cosine = axis.iter().zip(h).map(|(n, h)| n * h).sum::<f64>() / length / square;
                let angle = cosine.clamp(-1.0, 1.0).acos().to_degrees() / 2.0;
                let at = |degrees| Hopf::new(center, axis, degrees).unwrap();
                let at = |degrees| Level::<4>::value(&at(degrees), &(Vector64::from(p) + center));
                assert!(at(angle).abs() < 1e-12 * square.max(1.0), "{axis:?} {p:?}");
                assert!(at(angle - 5.0) > 0.0 || angle < 5.0, "{axis:?} {p:?}");
                assert!(at(angle + 5.0) < 0.0 || angle > 85.0, "{axis:?} {p:?}");
            }
        }
        for axis in [[0.0; 3], [f64::NAN, 0.0, 1.0], [f64::INFINITY, 0.0, 0.0]] {
            assert_eq!(Hopf::new(center, axis, 45.0), None);
        }
    }

    #[test]
    fn roots_lie_on_the_peel() {
        let peel = Hopf::new(Vector64::zeros(), [0.2, -0.3, 1.0], 30.0).unwrap();
        let mut found = 0;
        for k in 0..1000u32 {
            let digit = |i: u32| f64::from((k * 7919 + i * 104_729) % 997) / 997.0 - 0.5;
            let ends = [0, 4].map(|first| Vector64::<4>::from_fn(|r, _| digit(first + r as u32)));
            let heights = ends.map(|end| peel.value(&end));
            if heights[0] * heights[1] < 0.0 {
                let t = Level::<4>::share(&peel, ends, heights);
                let value = peel.value(&(ends[0] + (ends[1] - ends[0]) * t));
                assert!((0.0..=1.0).contains(&t) && value.abs() < 1e-12, "{t} {value}");
                found += 1;
            }
        }
        assert!(found > 200, "{found}");
    }
}
