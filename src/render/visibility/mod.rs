//! What each voxel sees: the simplex that the ray through its centre hits first, or all that it passes ([`Passages`]).
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
mod passages;
mod raster;

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::passages::Search;
use self::raster::Raster;
use super::Camera;
use crate::progress::Progress;
use crate::trace::{Error, RayBackend};
use crate::volume::Grid;

pub use self::passages::Passages;
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
    /// For each simplex whether the camera sees it from behind.
    away: Vec<bool>,
}

impl<const D: usize> Visibility<D> {
    /// Chooses the way, and prepares it.
    pub fn new(backend: Arc<dyn RayBackend<D>>, camera: &Camera<D>, grid: &Grid, method: Method) -> Self {
        let tracer = backend.tracer();
        let raster = (method != Method::RayCast).then(|| Raster::new(tracer.mesh(), camera, grid));
        let raster = raster.filter(|r| method == Method::Rasterize || r.is_cheaper::<D>(grid, tracer.is_prepared()));
        if raster.is_none() {
            tracer.prepare();
        }
        let mesh = backend.tracer().mesh();
        let viewpoint = camera.viewpoint();
        let away = |s: u32| viewpoint.is_behind(&mesh.corners(s));
        let away = (0..mesh.simplices.len() as u32).into_par_iter().with_min_len(1024).map(away).collect();
        Self { backend, camera: camera.clone(), grid: *grid, raster, away }
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

    /// Whether the camera sees a simplex from behind.
    #[inline]
    pub fn is_away(&self, simplex: u32) -> bool {
        self.away[simplex as usize]
    }

    /// The simplex that the ray through each voxel of some layers hits first, x fastest, or [`NOTHING`]. Of several at
    /// exactly the same distance, those that face the eye come before those that don't.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if `progress` says so, [`Error::OpenCl`] if a device fails.
    pub fn first_hits(&self, layers: Range<usize>, progress: &dyn Progress) -> Result<Vec<u32>, Error> {
        let mut found = match &self.raster {
            Some(raster) => {
                raster.first_hits(self.backend.tracer(), &self.camera, &self.grid, layers.clone(), progress)?
            }
            None => self.ray_cast(layers.clone(), progress)?,
        };
        self.turn_to_eye(layers, &mut found, progress)?;
        Ok(found)
    }

    /// All surfaces that the ray through each voxel of some layers passes, x fastest, front to back; of each voxel the first
    /// `most` are kept. The first is what [`Visibility::first_hits`] tells. The processor finds them, whatever the backend.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if `progress` says so.
    pub fn passages(&self, layers: Range<usize>, most: usize, progress: &dyn Progress) -> Result<Passages, Error> {
        let Self { camera, grid, away, .. } = self;
        let search = Search { tracer: self.backend.tracer(), camera, grid, away, most, progress };
        Ok(match &self.raster {
            Some(raster) => search.rasterize(raster, layers)?,
            None => search.cast(layers)?,
        })
    }

    /// Where a voxel sees a simplex from behind, looks for one in the same place that faces the eye: the other side of a
    /// sheet.
    fn turn_to_eye(&self, layers: Range<usize>, found: &mut [u32], progress: &dyn Progress) -> Result<(), Error> {
        let is_away = |simplex: u32| simplex != NOTHING && self.is_away(simplex);
        if !found.par_iter().any(|&simplex| is_away(simplex)) {
            return Ok(());
        }
        let tracer = self.backend.tracer();
        tracer.prepare();
        let [width, height, _] = self.grid.dimensions;
        found.par_chunks_mut(width).enumerate().try_for_each(|(row, found)| {
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            for (i, simplex) in found.iter_mut().enumerate().filter(|(_, simplex)| is_away(**simplex)) {
                let ray = self.camera.voxel_ray(&self.grid, [i, row % height, layers.start + row / height]);
                *simplex = tracer.facing_there(&ray, *simplex).unwrap_or(*simplex);
            }
            Ok(())
        })
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
