//! The node of the binary hierarchy, which `build` makes and `bvh` walks through.

use crate::geometry::Aabb;

/// A node: a box, and either a range of boxes (a leaf) or a pair of children.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node<const D: usize> {
    /// Holds everything below.
    pub bounds: Aabb<D>,
    /// The first item of a leaf in [`super::Bvh::order`], or the left one of two neighbouring children.
    pub first: u32,
    /// The number of items of a leaf; 0 for an inner node.
    pub count: u32,
}
