//! `ao4d` turns a YAML pipeline into pictures of four-dimensional scenes with ray-traced ambient occlusion.

pub mod geometry;
pub mod mesh;
pub mod occlusion;
pub mod volume;
