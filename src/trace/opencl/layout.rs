//! The structs that host and device share, as `kernels/layout.cl` has them.

use std::mem::{offset_of, size_of};

/// Stands for no simplex.
pub(super) const NONE: u32 = u32::MAX;
/// Stands for a simplex that the host has to find.
pub(super) const UNSURE_SIMPLEX: u32 = u32::MAX - 1;
/// What is known of a ray: nothing blocks it;
pub(super) const OPEN: u8 = 0;
/// something does;
pub(super) const HIT: u8 = 1;

/// A vector of the device.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(16))]
pub(super) struct Float4(pub [f32; 4]);

/// A node of the hierarchy.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(16))]
pub(super) struct Node {
    pub low: Float4,
    pub high: Float4,
    pub first: u32,
    pub count: u32,
    pub padding: [u32; 2],
}

/// A shading point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(16))]
pub(super) struct Site {
    pub position: Float4,
    pub axis: Float4,
    pub keys: [u32; 4],
    pub factor: f32,
    pub turned: u32,
    pub ignored: u32,
    pub fold_first: u32,
    pub fold_count: u32,
    pub next: u32,
    pub padding: [u32; 2],
}

/// A cone that a simplex with a corner at the point hides.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(16))]
pub(super) struct Fold {
    pub normals: [Float4; 4],
    pub bounds: Float4,
}

/// Sizes and offsets, in the order in which the kernel `layout` tells them.
pub(super) fn sizes() -> Vec<u32> {
    [
        size_of::<Node>(),
        offset_of!(Node, first),
        size_of::<Site>(),
        offset_of!(Site, keys),
        offset_of!(Site, factor),
        offset_of!(Site, next),
        size_of::<Fold>(),
        offset_of!(Fold, bounds),
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
