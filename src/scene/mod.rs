//! Objects of a scene: from what a pipeline says to a placed surface.
//!
//! Each shape is one file, which holds the keys it takes in YAML and makes a [`crate::mesh::Surface`] of them, for D = 3
//! and 4 alike; nothing else knows the shapes. All compute in `f64`; the mesh that is traced rounds once, later. Closed
//! shapes come out closed, with shared vertices, facing outwards:
//!
//! | key | what | made by |
//! | --- | --- | --- |
//! | `simplices` | vertices and simplices as listed | - |
//! | `file` | a surface from a file | [`crate::io::mesh`] |
//! | `box`, `tesseract` | boundary of a product of intervals | [`product`] |
//! | `extrude` | a 3D mesh swept along w | [`crate::io::mesh`], [`product`], `fill` |
//! | `cut_cube` | a box minus boxes | [`lattice`] |
//! | `hypersphere`, `sphere` | the cross-polytope's boundary, divided and projected | - |
//! | `spin` | a 3D mesh turned round in a plane with w | [`crate::io::mesh`], [`product`] |
//! | `polytope` | one of the six regular polytopes, in 3D polyhedra | `polyhedron` |
//! | `duoprism`, `duocylinder`, `spherinder`, `cubinder` | boundary of a product of two solids | [`product`] |
//! | `isosurface` | where a formula or a grid of values passes a value | [`isosurface`] |
//!
//! [`build_object`] checks everything that can be wrong with an object, so whoever checks a pipeline builds its scene.

mod color;
mod cuboid;
mod cut_cube;
mod disc;
mod error;
mod extrude;
mod file;
mod fill;
mod hypersphere;
pub mod isosurface;
pub mod lattice;
mod numbers;
mod object;
mod polyhedron;
pub mod polytope;
pub mod product;
mod products;
mod simplices;
mod slab;
mod spin;
mod transform;
mod twin;
mod welding;

pub use color::Color;
pub use cuboid::{BoxSpec, TesseractSpec};
pub use cut_cube::{CutCubeSpec, CutSpec};
pub use error::Error;
pub use extrude::ExtrudeSpec;
pub use hypersphere::{Base, SphereSpec};
pub use isosurface::IsosurfaceSpec;
pub use numbers::{MAX_SIMPLICES, OneOrEach};
pub use object::{
    CreaseAngle, ObjectSpec, Orientation, Shape, build_object, build_object_watched, build_object_with_notes, moved,
};
pub use polytope::PolytopeSpec;
pub use products::{CubinderSpec, DuocylinderSpec, DuoprismSpec, SpherinderSpec};
pub use simplices::SimplicesSpec;
pub use slab::SlabSpec;
pub use spin::SpinSpec;
pub use transform::{RotateSpec, TransformStep, plane_of, sine_cosine};
pub use twin::{place, plane, twin};
