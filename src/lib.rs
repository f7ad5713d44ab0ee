
pub mod accel;
pub mod export;
pub mod geometry;
pub mod mesh;
pub mod occlusion;
pub mod pipeline;
pub mod progress;
pub mod render;
pub mod volume;
