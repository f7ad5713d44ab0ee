//! Simplicial hypersurfaces: the surface a generator or a reader makes, and the mesh a scene is traced as.
//!
//! A [`Surface`] is what one object is made of, in `f64` and in its own coordinates. Placing it into a [`Mesh`] rounds
//! it to `f32` once. From then on the mesh is the geometry, for every method; its vertices are never renumbered.

mod surface;
pub mod topology;

pub use surface::Surface;
