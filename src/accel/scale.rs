//! The coordinates of nodes and leaves: those of the scene, times a power of two that makes it about 1 wide.

use crate::geometry::{Aabb, Vector, Vector64, widen};

/// Where the coordinates of the nodes and leaves come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale<const D: usize> {
    /// The middle of the scene.
    pub centre: Vector64<D>,
    /// A power of two.
    pub factor: f64,
}

impl<const D: usize> Scale<D> {
    /// Of the scene with these vertices.
    pub fn of(vertices: &[Vector<D>]) -> Self {
        Self::around(&Aabb::of(vertices))
    }

    /// Of what lies within the box.
    pub fn around(bounds: &Aabb<D>) -> Self {
        if bounds.is_empty() {
            return Self { centre: Vector64::zeros(), factor: 1.0 };
        }
        let (min, max) = (widen(&bounds.min), widen(&bounds.max));
        let extent = (max - min).max();
        // A scene without extent has no simplices; any factor does.
        let exponent = if extent > 0.0 { -extent.log2().ceil() } else { 0.0 };
        Self { centre: (min + max) * 0.5, factor: exponent.exp2() }
    }

    /// The scaled coordinates: exact, unless they vanish beside the scene.
    pub fn scaled(&self, point: &Vector<D>) -> Vector<D> {
        point.map(|x| (f64::from(x) * self.factor) as f32)
    }

    /// Whether a coordinate doesn't vanish when it is scaled: a box without width is told from another place only by numbers
    /// that are exact.
    pub fn keeps(&self, x: f32) -> bool {
        x == 0.0 || f64::from(x.abs()) * self.factor >= 1e-30
    }

    /// Scaled and moved to the middle: rounded, and within 1/2 (and that rounding) for the vertices of the scene.
    pub fn centred(&self, point: &Vector<D>) -> Vector<D> {
        ((widen(point) - self.centre) * self.factor).map(|x| x as f32)
    }
}
