//! The structs that host and device share, as `kernels/layout.cl` has them.

use std::mem::{offset_of, size_of};

use bytemuck::{Pod, Zeroable};

/// Stands for a simplex that the host has to find.
pub(super) const UNSURE_SIMPLEX: u32 = u32::MAX - 1;
/// What is known of a ray: nothing blocks it.
pub(super) const OPEN: u8 = 0;
/// It is not known.
pub(super) const UNSURE: u8 = 2;

/// A vector of the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C, align(16))]
pub(super) struct Float4(pub [f32; 4]);

/// Up to eight boxes, one byte for each side of them: those of children that are nodes, then of leaves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C, align(16))]
pub(super) struct Node {
    pub origin: Float4,
    /// Of the axes: a step of a box's sides is 2 to the power of this, less 127.
    pub exponents: [u8; 4],
    /// The first child that is a node; the others follow it.
    pub children: u32,
    /// The first simplex of the leaves.
    pub simplices: u32,
    /// How many children are nodes, which come first, and how many there are.
    pub counts: [u8; 4],
    /// For each axis and child: in how many steps from the origin its box begins, and then, in how many it ends.
    pub sides: [[[u8; 8]; 2]; 4],
    /// Of a leaf, eight times its first simplex, counted from `simplices`, and how many it has.
    pub leaves: [u8; 8],
    pub padding: [u32; 2],
}

/// A shading point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C, align(16))]
pub(super) struct Point {
    pub position: Float4,
    pub axis: Float4,
    pub keys: [u32; 4],
    pub factor: f32,
    pub turned: u32,
    pub ignored: u32,
    pub star_first: u32,
    pub star_count: u32,
    pub next: u32,
    pub vertex: u32,
    pub star_height: f32,
}

/// A cone that a simplex with a corner at the point hides.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C, align(16))]
pub(super) struct StarCone {
    pub normals: [Float4; 4],
    pub bounds: Float4,
}

/// Sizes and offsets, in the order in which the kernel `layout` tells them.
pub(super) fn sizes() -> Vec<u32> {
    [
        size_of::<Node>(),
        offset_of!(Node, leaves),
        offset_of!(Node, sides),
        size_of::<Point>(),
        offset_of!(Point, keys),
        offset_of!(Point, factor),
        offset_of!(Point, next),
        size_of::<StarCone>(),
        offset_of!(StarCone, bounds),
    ]
    .map(|bytes| bytes as u32)
    .to_vec()
}

#[cfg(test)]
mod tests {
    #[test]
    fn layouts_are_those_of_opencl() {
        assert_eq!(super::sizes(), [112, 96, 32, 80, 32, 48, 68, 80, 64]);
    }
}
