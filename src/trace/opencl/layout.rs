//! The structs that host and device share, as `kernels/layout.cl` has them.

use std::mem::{offset_of, size_of};

use bytemuck::{Pod, Zeroable};

use crate::geometry::Vector;

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

/// A vector as devices know it.
pub(super) fn float4<const D: usize>(v: &Vector<D>) -> Float4 {
    let mut all = [0.0; 4];
    all[..D].copy_from_slice(v.as_slice());
    Float4(all)
}

/// What is in the up to eight boxes of a node: children that are nodes, and then leaves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C, align(8))]
pub(super) struct Node {
    /// The first child that is a node; the others follow it.
    pub children: u32,
    /// The first simplex of the leaves.
    pub simplices: u32,
    /// Of a leaf, eight times its first simplex, counted from `simplices`, and how many it has.
    pub leaves: [u8; 8],
    /// How many children are nodes.
    pub inner: u32,
    pub padding: u32,
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
    pub star: u32,
    pub next: u32,
    pub vertex: u32,
    pub padding: [u32; 2],
}

/// A cone that a simplex with a corner at the point hides, or what comes before those of a point: [`StarCone::head`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C, align(16))]
pub(super) struct StarCone {
    pub normals: [Float4; 4],
    pub bounds: Float4,
}

impl StarCone {
    /// That so many cones follow, which hide nothing above this height over the tangent hyperplane.
    pub fn head(count: u32, height: f32) -> Self {
        let mut head = Self::default();
        head.normals[0].0[..2].copy_from_slice(&[f32::from_bits(count), height]);
        head
    }
}

/// A vertex whose cones the device makes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C, align(16))]
pub(super) struct Apex {
    pub position: Float4,
    pub normal: Float4,
    pub vertex: u32,
    pub star: u32,
    pub padding: [u32; 2],
}

/// Sizes and offsets, in the order in which the kernel `layout` tells them.
pub(super) fn sizes() -> Vec<u32> {
    [
        size_of::<Node>(),
        offset_of!(Node, leaves),
        offset_of!(Node, inner),
        size_of::<Point>(),
        offset_of!(Point, keys),
        offset_of!(Point, factor),
        offset_of!(Point, next),
        size_of::<StarCone>(),
        offset_of!(StarCone, bounds),
        size_of::<Apex>(),
        offset_of!(Apex, vertex),
    ]
    .map(|bytes| bytes as u32)
    .to_vec()
}

#[cfg(test)]
mod tests {
    #[test]
    fn layouts_are_those_of_opencl() {
        assert_eq!(super::sizes(), [24, 8, 16, 80, 32, 48, 64, 80, 64, 48, 32]);
    }
}
