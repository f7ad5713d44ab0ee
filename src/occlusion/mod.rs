//! Ambient occlusion: how much of the hemisphere over a point is open.

pub mod exact;
