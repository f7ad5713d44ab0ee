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
//!
//! Beside A stands a vector that tells where the open directions are (directional occlusion; Ritschel, Grosch and Seidel,
//! *Approximating Dynamic Global Illumination in Image Space*, 2009), and the light that other surfaces send ([`Directional`]):
//!
//! ```text
//! b(p, n) = 1/c_D * integral over the hemisphere around n of V(p, w) w (w . n) dw
//! ```
//!
//! There is one door: an [`Estimator`] takes shading points and gives [`Estimates`], with rays traced by any
//! [`crate::trace::RayBackend`].

mod as_published;
mod directional;
mod error;
mod estimator;
pub mod exact;
mod file;

pub use crate::progress::Cancelled;
pub use as_published::{AsProgrammed, AsPublished, Deviations, ProgramDeviations, plain_cramer};
pub use directional::{Bounced, Directional, open_vector};
pub use error::Error;
pub use estimator::{Estimates, Estimator};
pub use file::{FileError, Sidecar, decode, encode};
