//! Exact ambient occlusion: a closed form in `f64`, with no samples and no noise, for D = 3 and 4.
//!
//! # The formula
//! From a point p with unit normal n the occluders are simplicial cones of directions, and what is open is the rest V
//! of the hemisphere. The divergence theorem on the cone over V, cut by the unit ball, turns the integral over V into
//! a sum over the planes that bound it,
//!
//! ```text
//! A(p, n) = 1 / c_D * integral over V of (w . n) dw = 1 / |S^(D-2)| * sum over facets f of V of A_f (N_f . n)
//! ```
//!
//! with N_f the unit normal of f towards the inside of V, A_f the solid angle of f in its own hyperplane, an angle in
//! 3D (Lambert 1760) and the area of a spherical polygon in 4D, and |S^1| = 2 pi, |S^2| = 4 pi. V need not be convex.
//!
//! So V itself, which falls into very many convex cones, is never built. Its facets are found one plane at a time:
//!
//! - the horizon, as far as no occluder covers it from above, counts with N_f . n = 1;
//! - a facet F of an occluder's cone counts, as far as it lies above the horizon and *just outside* it nothing else
//!   covers: take out the cross-sections of the cones that cross F's plane; the facets in that plane of cones on the
//!   other side; and, so that nothing counts twice, those of earlier cones on the same side.
//!
//! Two simplices that share a facet, one on each side of it, take it out of each other entirely, which their
//! generators' numbers tell without arithmetic. Of a mesh only its silhouette is left as seen from p, and the work
//! goes with the silhouette and with what overlaps it, not with the square of all simplices.
//!
//! The vector b of the open directions ([`Hemisphere::directed`]) is a sum over the same pieces (`integrals.rs`).
//!
//! # Exact signs
//! Which cones cross a plane, which touch it and on which side is read off signs of determinants, all exact: planes
//! that coincide and planes that all but coincide (moved by one ulp) are treated as what they are, consistently
//! from both sides. Within one plane convex regions are clipped in floating point, where an error of rounding moves
//! a boundary by some 1e-15 and can't do more: the error of the sum is of the order of 1e-15 times the square root of
//! the number of pieces. The tests find less than 1e-14, also for points 1e-30 away from what they look at.
//!
//! # What it takes
//! A simplex that has p as a vertex is a cone too: its other edges and -n ([`Hemisphere::add_incident`]). Where p lies
//! within a simplex, as the visible point of a voxel does, that simplex is to be left out. Simplices need not be
//! sorted, oriented, closed or disjoint; one whose hyperplane contains p occludes nothing.
//!
//! Among the simplices of a mesh [`Hemisphere::over`] finds all of these, with the hierarchy as a sieve, and
//! [`super::Estimator::Exact`] takes the values at many points.
//!
//! All simplices of a scene may be given: those below the horizon are dropped at once. Of bodies that are closed, and
//! known to be seen from outside, the simplices turned away from p may be left out, for half the time.

mod directions;
mod exposed;
mod generators;
mod hemisphere;
mod integrals;
mod plane;
mod polygon;
mod precise;
mod span;
mod trace;
mod view;

pub(super) use hemisphere::Stopped;
pub use hemisphere::{Budget, Hemisphere, OverBudget, visible_fraction};
pub(super) use view::{directed, value, value_if_simple};
