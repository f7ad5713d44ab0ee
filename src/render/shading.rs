//! Where the ambient occlusion of a visible point comes from.

use std::sync::Arc;

use super::ScreenSpace;
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
    /// Computed at the point itself, on the side that faces the ray: the reference for the others.
    Voxel(Estimator),
    /// Interpolated, and mended by how far that is off: by few rays at the point itself, whose difference from the
    /// interpolated value is denoised.
    Auto(Arc<Estimates>, Estimator),
    /// Guessed from the depth and the normals of the image itself, without rays.
    ScreenSpace(ScreenSpace),
}

impl Shading {
    /// Whether it shows values at vertices, which are those of one side of the surface.
    pub fn is_interpolated(&self) -> bool {
        matches!(self, Self::Flat(_) | Self::Smooth(_) | Self::Auto(..))
    }
}
