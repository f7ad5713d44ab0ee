//! `ao4d` turns a YAML pipeline into pictures of four-dimensional scenes with ray-traced ambient occlusion.

pub mod accel;
pub mod export;
pub mod geometry;
pub mod inspect;
pub mod mesh;
pub mod occlusion;
pub mod pipeline;
pub mod progress;
pub mod render;
pub mod scene;
pub mod volume;
