//! Where the ambient occlusion of a visible point comes from.

use std::sync::Arc;

use crate::occlusion::{Estimates, Estimator};

/// Where the ambient occlusion of a visible point comes from.
#[derive(Clone, Debug)]
pub enum Shading {
    /// Nowhere: everything is open.
    None,
    /// The mean of the simplex's vertices' values (Djami 2021, 4.6.3).
    Flat(Arc<Estimates>),
    /// Interpolated between the simplex's vertices' values, by barycentric coordinates.
    Smooth(Arc<Estimates>),
    /// Computed at the point itself, on the side that faces the ray: the reference for the other two.
    Voxel(Estimator),
}
