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

    /// Occlusion and its standard error at a point inside a simplex by the values at its vertices; open where there are none.
    #[inline]
    pub(super) fn at_vertices<const D: usize>(&self, vertices: [u32; D], barycentric: &[f64; D]) -> (f32, f32) {
        let corner = |values: &[f32], i: usize| values.get(vertices[i] as usize).map_or(f64::NAN, |&v| f64::from(v));
        let equal = [1.0 / D as f64; D];
        let (estimates, weights) = match self {
            Self::Flat(estimates) => (estimates, &equal),
            Self::Smooth(estimates) | Self::Auto(estimates, _) => (estimates, barycentric),
            Self::None | Self::Voxel(_) | Self::ScreenSpace(_) => return (1.0, 0.0),
        };
        let value = match self {
            Self::Flat(_) => (0..D).map(|i| corner(&estimates.values, i)).sum::<f64>() / D as f64,
            _ => (0..D).map(|i| corner(&estimates.values, i) * weights[i]).sum::<f64>(),
        };
        // The vertices' errors are independent.
        let variance: f64 = (0..D).map(|i| (corner(&estimates.errors, i) * weights[i]).powi(2)).sum();
        ((value as f32).clamp(0.0, 1.0), variance.sqrt() as f32)
    }
}
