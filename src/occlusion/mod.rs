//! Ambient occlusion: how much of the cosine-weighted hemisphere over a point is open.
//!
//! ```text
//! A(p, n) = 1/c_D * integral over the hemisphere around n of V(p, w) (w . n) dw       c_3 = pi, c_4 = 4 pi / 3
//! ```
//!
//! V is 1 where the ray from p in direction w escapes and 0 where it is blocked, so A = 1 is open (white) and A = 0 is
//! fully occluded (black). (Djami 2021, Eq. 2.8, with the constant of each dimension.) The value at p is the limit of
//! starting at p + e n as e goes to 0; no offset is ever added:
//!
//! - a simplex that does not contain p blocks a ray that hits it at t > 0;
//! - a simplex that has p as a corner blocks w if w lies in the cone spanned by its edges from p and -n. Flat and
//!   convex surroundings block nothing; a concave fold blocks the same, be the surface open or closed;
//! - a visible point inside a simplex ignores that simplex.

mod as_published;
mod estimate;
pub mod exact;
mod file;
mod method;
pub mod opencl;
mod sampling;
mod site;
mod stream;
mod vertices;

pub use as_published::{AsPublished, Slips, as_published, plain_cramer};
pub use estimate::{Estimate, Target};
pub use file::{FileError, Sidecar, decode, encode};
pub use method::{Method, adaptive};
pub use sampling::{Sampler, Sequence, cube_to_ball, direction, square_to_disk};
pub use site::Site;
pub use stream::{Level, Stream};
pub use vertices::{Estimates, ambient_occlusion, at_vertices, at_vertices_with, estimate_at, estimate_vertices};

/// How ambient occlusion is computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Where the rays go.
    pub sampler: Sampler,
    /// Rays a point; at least 1.
    pub samples: u32,
    /// Chooses among equally good sets of rays.
    pub seed: u64,
    /// Hits beyond this distance don't count; infinite by default.
    pub max_distance: f32,
}

/// The work was cancelled by whoever watches its progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("interrupted")]
pub struct Cancelled;

/// Why there are no values.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// The work was cancelled.
    #[error("interrupted")]
    Cancelled,
    /// The closed form would have too many pieces.
    #[error("{place}: exact occlusion is too dear here: {source}")]
    OverBudget {
        /// The vertex or voxel.
        place: String,
        /// How rich its view is.
        source: exact::OverBudget,
    },
    /// OpenCL fails.
    #[error(transparent)]
    OpenCl(#[from] opencl::Error),
}

impl From<Cancelled> for Error {
    fn from(_: Cancelled) -> Self {
        Self::Cancelled
    }
}
