//! How a leaf lies to the origin of rays: the vectors between, and bounds on them and on what rounding makes of them.

use super::lanes::Lanes;
use super::query::Query;
use crate::accel::Leaf;
use crate::geometry::Dimension;

/// More than what heights over the tangent hyperplane lose in rounding, relative to the 1-norms of what they are of: 16
/// half-ulps.
pub(super) const HEIGHT_ROUNDING: f32 = 1e-6;
/// More than what products of numbers below 4 lose by underflow.
pub(super) const UNDERFLOW: f32 = 1e-35;

/// How a leaf lies to the origin.
#[derive(Clone, Copy)]
pub(super) struct View {
    /// A bound on the 1-norms of what leads from the origin to the corners.
    pub size: f32,
    /// A bound on those of the edges.
    pub edge: f32,
    /// All corners are at least as far away.
    pub distance: f32,
}

impl View {
    #[inline(always)]
    pub fn new<const D: usize>(query: &Query<D>, leaf: &Leaf<D>) -> Self {
        let (mut sum, mut largest) = (0.0f32, 0.0f32);
        for k in 0..D {
            let away = (leaf.middle(k) - query.scaled[k]).abs();
            sum += away;
            largest = if away > largest { away } else { largest };
        }
        let distance = (largest - leaf.reach()) * (1.0 - 1e-5);
        let distance = if distance > 0.0 { distance } else { 0.0 };
        Self { size: (leaf.reach() + sum) * (1.0 + 1e-5), edge: leaf.edge(), distance }
    }

    /// The same for any origin that the hierarchy serves: within 1 of the middle of the scene, which is 1 wide.
    #[inline(always)]
    pub fn rough<const D: usize>(leaf: &Leaf<D>) -> Self {
        Self { size: 1.5 * D as f32 * (1.0 + 1e-4), edge: leaf.edge(), distance: 0.0 }
    }

    /// Bounds on the rounding of a facet value and of a determinant, given that of their parts in half-ulps.
    #[inline(always)]
    pub fn bounds<const D: usize>(&self, half_ulps: f32) -> [f32; 2] {
        let edges = Dimension::of::<D>().pick(self.edge, self.edge * self.edge);
        let facet = half_ulps / (1 << 24) as f32 * edges * (self.size + self.edge);
        [facet + UNDERFLOW, facet * self.edge + UNDERFLOW]
    }

    /// Simplices that rise no higher than this over the tangent hyperplane are below all rays.
    #[inline(always)]
    pub fn low<const D: usize>(&self, query: &Query<D>) -> f32 {
        query.rise * self.distance - HEIGHT_ROUNDING * (self.size + self.edge)
    }
}

/// What leads from the origin to corner 0, and from there to the others.
#[inline(always)]
pub(super) fn columns<L: Lanes, const D: usize>(query: &Query<D>, leaf: &Leaf<D>) -> [[L; D]; D] {
    let mut columns = [[L::splat(0.0); D]; D];
    for corner in 0..D {
        for k in 0..D {
            columns[corner][k] = L::load(leaf.edge_row(corner, k));
        }
    }
    for k in 0..D {
        columns[0][k] = columns[0][k].sub(L::splat(query.scaled[k]));
    }
    columns
}
