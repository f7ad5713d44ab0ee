//! Pictures of a mesh: a camera in R^D, what each voxel sees, and the colours.
//!
//! A 4D camera looks onto a 3D image of voxels, a 3D camera onto one layer of pixels, through the same lines. A
//! picture is made slab by slab (some layers of z), in five steps:
//!
//! 1. [`visibility`]: the simplex that the ray through each voxel's centre, or through each of its samples, hits first;
//! 2. `surface`: the point that a voxel shows, and how [`Lighting`] lights it, into the columns of the [`GBuffer`] that
//!    somebody asked for;
//! 3. `occlude`: ambient occlusion at those points, where it does not come from the vertices; or [`screen_space`], which
//!    looks for it in the image alone;
//! 4. [`filters`]: what looks at neighbouring voxels; then the light of the sky and of other surfaces ([`Skylight`]);
//! 5. [`Aov`]: the columns as the numbers of an array, for each array that somebody asked for.
//!
//! Where light passes objects, `behind` adds what is seen through them. Beside all this stand [`Layers`]: all surfaces that a voxel's ray passes, as arrays of their own.

pub mod aov;
mod audit;
mod behind;
mod camera;
pub mod filters;
pub mod gbuffer;
mod inside;
mod layers;
mod light;
mod occlude;
mod renderer;
mod samples;
pub mod screen_space;
mod shading;
mod skylight;
mod surface;
pub mod tone;
pub mod visibility;

pub use aov::Aov;
pub use audit::{Accuracy, Audit, Checked};
pub use camera::{Camera, CameraError, Projection, View};
pub use gbuffer::{Columns, GBuffer};
pub use layers::{LayerPoint, Layers, MOST as MOST_LAYERS};
pub use light::{DepthCue, Light, Lighting, Source, reflectance};
pub use renderer::{Rendered, Renderer, Slab};
pub use samples::MOST as MOST_SAMPLES;
pub use screen_space::{DepthImage, ScreenSpace, Seen, Thickness};
pub use shading::Shading;
pub use skylight::{Skylight, radiosity, relight};
pub use visibility::{NOTHING, Passages, Visibility};
