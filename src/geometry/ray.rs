//! Rays.

use super::{Vector, Vector64, widen};

/// A half-line: a point and a direction, with the reciprocals that box tests use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray<const D: usize> {
    /// Where it starts; not part of it.
    pub origin: Vector<D>,
    /// Where it goes; of length about 1, or whatever the caller measures distances in.
    pub direction: Vector<D>,
    /// One over each component of the direction, infinite where that is zero.
    pub inverse: Vector<D>,
}

impl<const D: usize> Ray<D> {
    /// A ray. Components of the direction below 1e-30 become zero, so that no reciprocal overflows.
    #[inline]
    pub fn new(origin: Vector<D>, direction: Vector<D>) -> Self {
        let direction = direction.map(|x| if x.abs() < 1e-30 { 0.0 } else { x });
        Self { origin, direction, inverse: direction.map(|x| 1.0 / x) }
    }

    /// The point at distance `t`.
    #[inline]
    pub fn at(&self, t: f64) -> Vector64<D> {
        widen(&self.origin) + widen(&self.direction) * t
    }
}
