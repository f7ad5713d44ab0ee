//! Where the ambient occlusion of a visible point comes from.

use crate::occlusion::{Estimates, Estimator};

/// Where the ambient occlusion of a visible point comes from.
#[derive(Clone, Copy, Debug)]
pub enum Shading<'s> {
    /// Nowhere: everything is open.
    None,
    /// The mean of the simplex's vertices' values (Djami 2021, 4.6.3).
    Flat(&'s Estimates),
    /// Interpolated between the simplex's vertices' values, by barycentric coordinates.
    Smooth(&'s Estimates),
    /// Computed at the point itself, on the side that faces the ray: the reference for the other two.
    Voxel(Estimator),
}
