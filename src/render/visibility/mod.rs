//! What each voxel sees: the simplex that the ray through its centre hits first.
//!
//! There are two ways to find out, and both give the same simplex in every voxel, ties included:
//!
//! - *ray casting* takes voxel by voxel and asks the hierarchy, a time that grows with the logarithm of the number of
//!   simplices;
//! - *scan conversion* (`raster.rs`) takes simplex by simplex and goes through the voxels it covers, rows at a time
//!   (Steiner and Burton, *Hidden Volumes: The 4th Dimension*, 1987, scan-convert tetrahedra into voxels likewise). Most
//!   voxels then cost a few additions. It needs no hierarchy.
//!
//! [`Method::Auto`] takes what the numbers of simplices, rows and voxels promise to be the cheaper.

mod footprint;
mod raster;

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::raster::Raster;
use super::Camera;
use crate::progress::Progress;
use crate::trace::{Error, RayBackend};
use crate::volume::Grid;

/// Stands for a simplex where a voxel sees none.
pub use crate::trace::NOTHING;

/// How it is found out what voxels see. No picture depends on it, only the time it takes.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// The cheaper of the two.
    #[default]
    Auto,
    /// Voxel by voxel, a ray each.
    RayCast,
    /// Simplex by simplex, each into the voxels it covers.
    Rasterize,
}

/// Rays that are cast together.
const RAYS: usize = 1 << 17;

/// Finds what voxels see, slab after slab.
#[derive(Clone, Debug)]
pub struct Visibility<const D: usize> {
    backend: Arc<dyn RayBackend<D>>,
    camera: Camera<D>,
    grid: Grid,
    raster: Option<Raster>,
}

impl<const D: usize> Visibility<D> {
    /// Chooses the way, and prepares it. A backend apart from the processor casts rays rather than the processor
    /// scan-converts, unless that was asked for.
    pub fn new(backend: Arc<dyn RayBackend<D>>, camera: &Camera<D>, grid: &Grid, method: Method) -> Self {
        let tracer = backend.tracer();
        let cast = method == Method::RayCast || method == Method::Auto && backend.is_apart();
        let raster = (!cast).then(|| Raster::new(tracer.mesh(), camera, grid));
        let raster = raster.filter(|r| method == Method::Rasterize || r.is_cheaper::<D>(grid, tracer.is_prepared()));
        if raster.is_none() {
            tracer.prepare();
        }
        Self { backend, camera: camera.clone(), grid: *grid, raster }
    }

    /// The way that was chosen; never [`Method::Auto`].
    pub fn method(&self) -> Method {
        if self.raster.is_some() { Method::Rasterize } else { Method::RayCast }
    }

    /// What it costs to look at every voxel, in rays, about: to weigh against what is saved by knowing what is seen.
    pub fn cost(&self) -> u64 {
        let voxels = self.grid.len() as u64;
        if self.raster.is_some() { voxels / 16 } else { voxels }
    }

    /// The simplex that the ray through each voxel of some layers hits first, x fastest, or [`NOTHING`].
    ///
    /// # Errors
    /// [`Error::Cancelled`] if `progress` says so, [`Error::OpenCl`] if a device fails.
    pub fn first_hits(&self, layers: Range<usize>, progress: &dyn Progress) -> Result<Vec<u32>, Error> {
        match &self.raster {
            Some(raster) => Ok(raster.first_hits(self.backend.tracer(), &self.camera, &self.grid, layers, progress)?),
            None => self.ray_cast(layers, progress),
        }
    }

    fn ray_cast(&self, layers: Range<usize>, progress: &dyn Progress) -> Result<Vec<u32>, Error> {
        let [width, height, _] = self.grid.dimensions;
        let layer = self.grid.layer_len();
        let voxels = layers.start * layer..layers.end * layer;
        let mut visible = Vec::with_capacity(voxels.len());
        for first in voxels.clone().step_by(RAYS) {
            let ray = |n: usize| self.camera.voxel_ray(&self.grid, [n % width, n / width % height, n / layer]);
            let rays: Vec<_> = (first..voxels.end.min(first + RAYS)).into_par_iter().map(ray).collect();
            visible.extend(self.backend.first_hits(&rays, None, progress)?);
            progress.advance(rays.len() as u64);
        }
        Ok(visible)
    }
}
