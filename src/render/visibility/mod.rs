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

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::raster::Raster;
use super::Camera;
use crate::accel::Tracer;
use crate::occlusion::{Cancelled, Error, opencl};
use crate::progress::Progress;
use crate::volume::Grid;

/// Stands for a simplex where a voxel sees none.
pub const NOTHING: u32 = u32::MAX;

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

/// Finds what voxels see, slab after slab.
#[derive(Clone, Debug)]
pub struct Visibility<'s, const D: usize> {
    tracer: &'s Tracer<'s, D>,
    camera: Camera<D>,
    grid: Grid,
    raster: Option<Raster>,
    method: Method,
    device: Option<&'s opencl::Scene<'s, D>>,
}

impl<'s, const D: usize> Visibility<'s, D> {
    /// Chooses the way, and prepares it.
    pub fn new(tracer: &'s Tracer<'s, D>, camera: &Camera<D>, grid: &Grid, method: Method) -> Self {
        let raster = (method != Method::RayCast).then(|| Raster::new(tracer.mesh(), camera, grid));
        let raster = raster.filter(|r| method == Method::Rasterize || r.is_cheaper::<D>(grid, tracer.is_prepared()));
        if raster.is_none() {
            tracer.prepare();
        }
        Self { tracer, camera: camera.clone(), grid: *grid, raster, method, device: None }
    }

    /// Has rays cast by this device, if one is given. One apart from the processor casts rays rather than the
    /// processor scan-converts, unless that was asked for.
    pub fn on(mut self, device: Option<&'s opencl::Scene<'s, D>>) -> Self {
        self.device = device;
        if self.method == Method::Auto && device.is_some_and(opencl::Scene::is_apart) {
            self.raster = None;
        }
        self
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
        match (&self.raster, self.device) {
            (Some(raster), _) => Ok(raster.first_hits(self.tracer, &self.camera, &self.grid, layers, progress)?),
            (None, None) => Ok(self.ray_cast(layers, progress)?),
            (None, Some(device)) => self.ray_cast_on(device, layers, progress),
        }
    }

    fn ray_cast_on(
        &self,
        device: &opencl::Scene<D>,
        layers: Range<usize>,
        progress: &dyn Progress,
    ) -> Result<Vec<u32>, Error> {
        let [width, height, _] = self.grid.dimensions;
        let mut visible = Vec::with_capacity(self.grid.layer_len() * layers.len());
        for k in layers {
            let ray = |n: usize| self.camera.voxel_ray(&self.grid, [n % width, n / width, k]);
            let rays: Vec<_> = (0..width * height).into_par_iter().map(ray).collect();
            visible.extend(device.first_hits(&rays, progress)?);
            progress.advance(rays.len() as u64);
        }
        Ok(visible)
    }

    fn ray_cast(&self, layers: Range<usize>, progress: &dyn Progress) -> Result<Vec<u32>, Cancelled> {
        let [width, height, _] = self.grid.dimensions;
        let mut visible = vec![NOTHING; self.grid.layer_len() * layers.len()];
        visible.par_chunks_mut(width).enumerate().try_for_each(|(row, voxels)| {
            if progress.cancelled() {
                return Err(Cancelled);
            }
            let (j, k) = (row % height, layers.start + row / height);
            for (i, voxel) in voxels.iter_mut().enumerate() {
                if let Some(hit) = self.tracer.closest_hit(&self.camera.voxel_ray(&self.grid, [i, j, k])) {
                    *voxel = hit.simplex;
                }
            }
            progress.advance(width as u64);
            Ok(())
        })?;
        Ok(visible)
    }
}
