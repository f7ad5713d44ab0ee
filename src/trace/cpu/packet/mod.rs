//! All rays of a shading point as packets, at full speed.
//!
//! What a ray hits is defined by exact signs ([`crate::geometry::Cone`]); the slow way to ask is
//! [`super::estimate_at`], ray by ray. This engine gives the same values, bit for bit, by filters in `f32`, eight
//! lanes wide, whose rounding is bounded; what they can't decide goes to the exact cone.
//!
//! - [`level`]: the instructions that a processor may have;
//! - [`lanes`], `x86`: eight numbers side by side, for each level;
//! - [`directions`]: the rays of a shading point, 64 at a time;
//! - [`nets`]: which of the rays share a block;
//! - [`star`]: what the simplices around a vertex hide;
//! - [`traverse`]: the rays through the [`crate::accel::WideBvh`];
//! - [`boxes`]: sets of rays against the boxes of a node;
//! - [`leaves`]: sets of rays against the simplices of a leaf, and what is left in doubt;
//! - [`view`]: how a leaf lies to the origin;
//! - [`single`]: one ray against the simplices of a leaf;
//! - [`cones`]: eight simplices as cones seen from the shading point;
//! - [`tally`]: how much is visited, for measurements;
//! - [`tracer`]: all of this, point after point.

mod boxes;
mod cones;
mod directions;
mod lanes;
mod leaves;
mod level;
mod nets;
mod query;
mod single;
mod star;
mod tally;
mod tracer;
mod traverse;
mod view;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use level::Level;
pub use tally::Visits;
pub use tracer::PacketTracer;
