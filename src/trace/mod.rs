//! Rays through a mesh, wherever they are traced: what each hits first, and how open the sky is over a point.
//!
//! Whoever asks does so through one trait, [`RayBackend`], and need not know what answers:
//!
//! - [`cpu`]: packets of rays with the processor's SIMD instructions, and beside them the slow twin, ray by ray, which
//!   defines every answer;
//! - [`opencl`]: any OpenCL device.
//!
//! All of them give the same bits, since what a ray hits is decided by exact signs ([`crate::accel::Tracer`]), and the
//! rays of a point depend on nothing but its number and the [`Sampling`]. What they share lies here: the
//! [`ShadingPoint`], what its own simplices hide ([`Surroundings`]), its rays ([`Sequence`]), and what is made of them
//! ([`Estimate`]). What rays hit, and where the open ones go, is [`gather`]ed on the processor, which alone traces rays of
//! ambient occlusion among objects that let light through (`translucent`).

mod backend;
pub mod cpu;
mod estimate;
mod gather;
mod groups;
mod noise;
pub mod opencl;
mod point;
mod sampling;
mod shares;
mod surroundings;
mod translucent;

pub use backend::{Error, NOTHING, RayBackend};
pub use estimate::{Estimate, Watch};
pub use gather::{Gathered, gather};
pub use point::ShadingPoint;
pub use sampling::{Sampler, Sampling, Sequence, Target, cube_to_ball, direction, square_to_disk};
pub use surroundings::Surroundings;
