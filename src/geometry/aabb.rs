//! Axis-aligned boxes, and the measure of their surface that the surface area heuristic needs.

use super::{Ray, Vector};

/// An axis-aligned box; empty when `min > max` on any axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb<const D: usize> {
    /// Lowest corner.
    pub min: Vector<D>,
    /// Highest corner.
    pub max: Vector<D>,
}

impl<const D: usize> Aabb<D> {
    /// The box that holds nothing, and grows to whatever is added.
    pub fn empty() -> Self {
        Self { min: Vector::from_element(f32::INFINITY), max: Vector::from_element(f32::NEG_INFINITY) }
    }

    /// The smallest box around the points.
    pub fn of<'a>(points: impl IntoIterator<Item = &'a Vector<D>>) -> Self {
        points.into_iter().fold(Self::empty(), |b, p| b.with(p))
    }

    /// The smallest box around this one and the point.
    #[inline]
    pub fn with(&self, point: &Vector<D>) -> Self {
        Self { min: self.min.inf(point), max: self.max.sup(point) }
    }

    /// The smallest box around both.
    #[inline]
    pub fn union(&self, other: &Self) -> Self {
        Self { min: self.min.inf(&other.min), max: self.max.sup(&other.max) }
    }

    /// Whether the box holds no point at all.
    pub fn is_empty(&self) -> bool {
        (0..D).any(|i| self.min[i] > self.max[i])
    }

    /// Whether the other box lies within this one, boundaries included.
    pub fn contains(&self, other: &Self) -> bool {
        (0..D).all(|i| self.min[i] <= other.min[i] && other.max[i] <= self.max[i])
    }

    /// Twice the centre: enough to sort by, and without rounding for moderate coordinates.
    #[inline]
    pub fn doubled_centre(&self) -> Vector<D> {
        self.min + self.max
    }

    /// Half the (D-1)-measure of the boundary: the sum over the axes of the product of the other edges. The
    /// probability that a random line which meets a box meets one inside it is the ratio of these (Cauchy-Crofton).
    #[inline]
    pub fn half_surface(&self) -> f32 {
        let edges = self.max - self.min;
        (0..D).map(|i| (0..D).filter(|&j| j != i).map(|j| edges[j]).product::<f32>()).sum()
    }

    /// The length of the diagonal.
    pub fn diagonal(&self) -> f64 {
        if self.is_empty() { 0.0 } else { (self.max - self.min).map(f64::from).norm() }
    }

    /// The distance along the ray at which it enters the box, or `None` where it surely misses it within
    /// `[0, limit]`. Conservative: a ray that meets the box is never told to miss it. Each slab's distances carry
    /// at most three roundings, which the factors below outweigh (Ize, *Robust BVH Ray Traversal*, 2013); a
    /// direction parallel to a slab whose plane holds the origin gives NaN there, which `max` and `min` pass over.
    #[inline]
    pub fn enter(&self, ray: &Ray<D>, limit: f32) -> Option<f32> {
        let (mut enter, mut exit) = (0.0f32, limit);
        for i in 0..D {
            let inverse = ray.inverse[i];
            let (near, far) =
                if inverse.is_sign_negative() { (self.max[i], self.min[i]) } else { (self.min[i], self.max[i]) };
            enter = enter.max((near - ray.origin[i]) * inverse);
            exit = exit.min((far - ray.origin[i]) * inverse);
        }
        (enter * (1.0 - 4.0 * f32::EPSILON) <= exit * (1.0 + 4.0 * f32::EPSILON)).then_some(enter)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_surface_of_bricks() {
        let brick = Aabb::<3> { min: Vector::from([0.0, 0.0, 0.0]), max: Vector::from([1.0, 2.0, 5.0]) };
        assert_eq!(brick.half_surface(), 2.0 + 5.0 + 10.0);
        let brick = Aabb::<4> { min: Vector::from([1.0; 4]), max: Vector::from([2.0, 3.0, 6.0, 4.0]) };
        assert_eq!(brick.half_surface(), 2.0 * 5.0 * 3.0 + 5.0 * 3.0 + 2.0 * 3.0 + 2.0 * 5.0);
    }

    fn flat_boxes<const D: usize>() {
        // The box is a facet in the plane x = 0; rays within that plane, along it and across it.
        let mut b = Aabb::<D> { min: Vector::from_element(-1.0), max: Vector::from_element(1.0) };
        b.min[0] = 0.0;
        b.max[0] = 0.0;
        let mut origin = Vector::<D>::zeros();
        origin[1] = -3.0;
        for sign in [1.0f32, -1.0] {
            let mut along = Vector::<D>::zeros();
            along[0] *= sign;
            along[1] = 1.0;
            assert_eq!(b.enter(&Ray::new(origin, along), f32::INFINITY), Some(2.0));
            assert_eq!(b.enter(&Ray::new(origin, along), 1.0), None);
            assert_eq!(b.enter(&Ray::new(origin, -along), f32::INFINITY), None);
        }
        origin[0] = 1.0;
        let mut across = Vector::<D>::zeros();
        across[0] = -0.5;
        across[1] = 1.0;
        assert_eq!(b.enter(&Ray::new(origin, across), f32::INFINITY), Some(2.0));
    }

    #[test]
    fn rays_within_the_plane_of_a_flat_box_meet_it() {
        flat_boxes::<3>();
        flat_boxes::<4>();
    }
}
