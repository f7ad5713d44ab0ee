//! The structs that host and device share, as `kernels/layout.cl` has them.

use std::mem::{offset_of, size_of};

use bytemuck::{Pod, Zeroable};

/// Stands for a simplex that the host has to find.
pub(super) const UNSURE_SIMPLEX: u32 = u32::MAX - 1;
/// What is known of a ray: nothing blocks it;
pub(super) const OPEN: u8 = 0;
/// something does;
pub(super) const HIT: u8 = 1;

/// A vector of the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C, align(16))]
pub(super) struct Float4(pub [f32; 4]);

/// A node of the hierarchy.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C, align(16))]
pub(super) struct Node {
    pub low: Float4,
    pub high: Float4,
    pub first: u32,
    pub count: u32,
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
    pub padding: [u32; 2],
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
        offset_of!(Node, first),
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
        assert_eq!(super::sizes(), [48, 32, 80, 32, 48, 68, 80, 64]);
    }
}
