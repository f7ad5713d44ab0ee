//! What nodes and leaves look like in memory: rows of eight numbers, one for each child or each simplex.
//!
//! A box is kept as middle and half width, and the half width is a little too large, in *proportion* to itself ([`GROWTH`]). All
//! rounding of a box test is in proportion too: to the half width, or to the distance of the middle from the origin of a ray,
//! whose difference is rounded but never has the wrong sign. So a ray that meets a simplex is never told to miss a box around
//! it, and yet a box without width stays so: rays that start in the flat face of a body don't go into the boxes of that face
//! at all.
//!
//! A leaf keeps corner 0 of each simplex and the edges from there, whose rounding is in proportion to the simplex, wherever it is.

use super::lines::{Row, WIDTH};
use super::scale::Scale;
use crate::geometry::{Aabb, Vector};
use crate::mesh::Mesh;

/// What half widths of boxes grow by, in proportion. All rounding of a box, of the origin's distance from its middle and in
/// the box test is less: a few numbers relative to 2^-24.
const GROWTH: f64 = 1.0 / (1 << 20) as f64;
/// The least half width of a box that has any: so that rays along an axis, which are taken to rise by 1e-30, stay in it.
const LEAST: f32 = 1e-25;

/// A reference to a node or a leaf: the cache line where it begins, times four, and what it is.
pub type Reference = u32;
/// The lowest bits of a reference to a node.
pub const NODE: Reference = 0;
/// The lowest bits of a reference to a leaf.
pub const LEAF: Reference = 1;
/// Refers to nothing: the bottom of a stack.
pub const BOTTOM: Reference = 2;
/// Bits of a reference that tell what it refers to.
pub(super) const KIND_BITS: u32 = 2;

/// The row where what it refers to begins.
#[inline(always)]
pub fn place(reference: Reference) -> usize {
    2 * (reference >> KIND_BITS) as usize
}

/// Eight boxes and where their contents are. Unused places have boxes that no ray meets.
#[derive(Clone, Copy, Debug)]
pub struct WideNode<'a, const D: usize> {
    rows: &'a [Row],
}

impl<'a, const D: usize> WideNode<'a, D> {
    /// For each axis the middles of the boxes, then half their widths; at last the references. A multiple of two rows makes
    /// whole cache lines.
    pub(super) const ROWS: usize = (2 * D + 1).next_multiple_of(2);

    /// The node that it refers to.
    #[inline(always)]
    pub fn at(rows: &'a [Row], reference: Reference) -> Self {
        let place = place(reference);
        Self { rows: &rows[place..place + Self::ROWS] }
    }

    /// The middles of the boxes along an axis.
    #[inline(always)]
    pub fn middle(&self, axis: usize) -> &'a [f32; WIDTH] {
        &self.rows[2 * axis].0
    }

    /// Half the widths of the boxes along an axis.
    #[inline(always)]
    pub fn half(&self, axis: usize) -> &'a [f32; WIDTH] {
        &self.rows[2 * axis + 1].0
    }

    /// References to nodes, then to leaves; of either, larger boxes come last.
    #[inline(always)]
    pub fn children(&self) -> &'a [Reference; WIDTH] {
        bytemuck::cast_ref(&self.rows[2 * D].0)
    }
}

/// Up to eight simplices: corner 0 of each, and the edges from there to the others. Unused lanes repeat the last simplex, so
/// that what is found of them is true.
#[derive(Clone, Copy, Debug)]
pub struct Leaf<'a, const D: usize> {
    rows: &'a [Row],
}

impl<'a, const D: usize> Leaf<'a, D> {
    /// A row that holds [`Self::middle`], `reach`, `edge` and where `range` begins and ends; then one for each corner and axis.
    pub(super) const ROWS: usize = (D * D + 1).next_multiple_of(2);

    /// The leaf that it refers to.
    #[inline(always)]
    pub fn at(rows: &'a [Row], reference: Reference) -> Self {
        let place = place(reference);
        Self { rows: &rows[place..place + Self::ROWS] }
    }

    /// The scaled coordinates of corner 0 along an axis; for other corners how far they are from there.
    #[inline(always)]
    pub fn edge_row(&self, corner: usize, axis: usize) -> &'a [f32; WIDTH] {
        &self.rows[1 + corner * D + axis].0
    }

    /// The middle of the corners, scaled.
    #[inline(always)]
    pub fn middle(&self, axis: usize) -> f32 {
        self.rows[0].0[axis]
    }

    /// A bound on the 1-norm of what leads from the middle to a corner.
    #[inline(always)]
    pub fn reach(&self) -> f32 {
        self.rows[0].0[4]
    }

    /// A bound on the 1-norms of the edges.
    #[inline(always)]
    pub fn edge(&self) -> f32 {
        self.rows[0].0[5]
    }

    /// Which of [`super::WideBvh::order`] these are.
    #[inline(always)]
    pub fn range(&self) -> std::ops::Range<usize> {
        let [first, count] = [6, 7].map(|i| self.rows[0].0[i].to_bits() as usize);
        first..first + count
    }
}

/// Writes the rows of a node.
pub(super) fn write_node<'a, const D: usize>(
    rows: &mut [Row],
    boxes: impl Iterator<Item = &'a Aabb<D>>,
    references: &[Reference; WIDTH],
    scale: &Scale<D>,
) {
    for axis in 0..D {
        // Of negative width: the near plane is never before the far one.
        rows[2 * axis + 1] = Row([-1e30; WIDTH]);
    }
    for (lane, bounds) in boxes.enumerate() {
        let (low, high) = (scale.scaled(&bounds.min), scale.scaled(&bounds.max));
        for axis in 0..D {
            let [low, high] = [low, high].map(|corner| f64::from(corner[axis]));
            let middle = (0.5 * (low + high)) as f32;
            let half = (high - f64::from(middle)).max(f64::from(middle) - low);
            let is_flat = bounds.min[axis] == bounds.max[axis] && scale.keeps(bounds.min[axis]);
            rows[2 * axis].0[lane] = middle;
            rows[2 * axis + 1].0[lane] = if is_flat { 0.0 } else { ((half * (1.0 + GROWTH)) as f32).max(LEAST) };
        }
    }
    rows[2 * D].0 = bytemuck::cast(*references);
}

/// Writes the rows of a leaf with these simplices of the order.
pub(super) fn write_leaf<const D: usize>(
    rows: &mut [Row],
    (first, end): (u32, u32),
    order: &[u32],
    mesh: &Mesh<D>,
    scale: &Scale<D>,
) {
    let (mut low, mut high): (Vector<D>, Vector<D>) =
        (Vector::from_element(f32::INFINITY), Vector::from_element(f32::NEG_INFINITY));
    let mut longest = 0.0f32;
    for lane in 0..WIDTH {
        let corners = mesh.corners(order[(first + lane as u32).min(end - 1) as usize]).map(|v| scale.scaled(&v));
        for (corner, position) in corners.iter().enumerate() {
            (low, high) = (low.inf(position), high.sup(position));
            let edge = if corner == 0 { *position } else { position - corners[0] };
            (0..D).for_each(|axis| rows[1 + corner * D + axis].0[lane] = edge[axis]);
            if corner > 0 {
                longest = longest.max(edge.iter().map(|x| x.abs()).sum());
            }
        }
    }
    let middle = (low + high) * 0.5;
    let reach = (0..D).map(|k| (middle[k] - low[k]).max(high[k] - middle[k])).sum::<f32>();
    let about = &mut rows[0].0;
    (0..D).for_each(|axis| about[axis] = middle[axis]);
    (about[4], about[5]) = (reach * (1.0 + 1e-5), longest * (1.0 + 1e-5));
    (about[6], about[7]) = (f32::from_bits(first), f32::from_bits(end - first));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check<const D: usize>() {
        let scale = Scale::of(&[Vector::<D>::from_element(-3.0), Vector::from_element(5.0)]);
        let corner = |n: usize, by: f32| Vector::<D>::from_fn(|k, _| ((n * 7 + k * 5) % 13) as f32 / 3.0 - 2.0 + by);
        // Flat along the first axis, a step of the coordinates wide along the second, wide along the last.
        let boxes: Vec<Aabb<D>> = (0..5)
            .map(|n| {
                let (min, mut max) = (corner(n, 0.0), corner(n, 0.7));
                (max[0], max[1]) = (min[0], min[1].next_up());
                Aabb { min, max }
            })
            .collect();
        let mut rows = vec![Row([0.0; WIDTH]); WideNode::<D>::ROWS];
        let references = std::array::from_fn(|i| i as Reference * 4);
        write_node(&mut rows, boxes.iter(), &references, &scale);
        let node = WideNode::<D>::at(&rows, NODE);
        assert_eq!(node.children(), &references);
        for (lane, bounds) in boxes.iter().enumerate() {
            let (low, high) = (scale.scaled(&bounds.min), scale.scaled(&bounds.max));
            for axis in 0..D {
                let [middle, half] = [node.middle(axis), node.half(axis)].map(|row| f64::from(row[lane]));
                assert!(middle - half <= f64::from(low[axis]) && f64::from(high[axis]) <= middle + half);
                assert_eq!(half == 0.0, axis == 0);
                assert!(half <= 1.01 * f64::from(high[axis] - low[axis]) + f64::from(LEAST));
            }
        }
        assert!((boxes.len()..WIDTH).all(|lane| node.half(0)[lane] < 0.0));
    }

    #[test]
    fn boxes_hold_what_they_were_made_of_and_flat_ones_stay_flat() {
        check::<3>();
        check::<4>();
    }
}
