//! Pictures of a mesh: a camera in R^D, what each voxel sees, and the colours.
//!
//! A 4D camera looks onto a 3D image of voxels, a 3D camera onto one layer of pixels, through the same lines. A
//! picture is made slab by slab (some layers of z), in three steps:
//!
//! 1. [`visibility`]: the simplex that the ray through each voxel's centre hits first;
//! 2. [`shading`]: the ambient occlusion and distance there;
//! 3. [`Channel`]: those as the numbers of an array, for each array that somebody asked for.

mod camera;
mod channel;
pub mod shading;
pub mod visibility;

pub use camera::{Camera, CameraError, Projection, View};
pub use channel::Channel;
pub use shading::{Fragment, Shading};
pub use visibility::{NOTHING, Visibility};

use std::ops::Range;

use crate::accel::Tracer;
use crate::occlusion::{Error, opencl};
use crate::progress::Progress;
use crate::volume::{Array, Grid};

/// Everything that decides what a picture shows.
#[derive(Clone, Debug)]
pub struct Picture<'s, const D: usize> {
    /// The scene.
    pub tracer: &'s Tracer<'s, D>,
    /// Who looks.
    pub camera: Camera<D>,
    /// The voxels.
    pub grid: Grid,
    /// Where their ambient occlusion comes from.
    pub shading: Shading<'s>,
    /// The device that traces rays, if not the processor.
    pub device: Option<&'s opencl::Scene<'s, D>>,
}

impl<const D: usize> Picture<'_, D> {
    /// The arrays of some layers, in the order of `channels`.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if `progress` says so, [`Error::OverBudget`] where a closed form is too dear.
    pub fn slab(
        &self,
        layers: Range<usize>,
        channels: &[Channel],
        progress: &dyn Progress,
    ) -> Result<Vec<Array>, Error> {
        self.slab_of(&self.visibility(visibility::Method::Auto), layers, channels, progress)
    }

    /// What finds what its voxels see; made once for all slabs.
    pub fn visibility(&self, method: visibility::Method) -> Visibility<'_, D> {
        Visibility::new(self.tracer, &self.camera, &self.grid, method).on(self.device)
    }

    /// [`Picture::slab`] with what [`Picture::visibility`] made.
    ///
    /// # Errors
    /// Those of [`Picture::slab`].
    pub fn slab_of(
        &self,
        visibility: &Visibility<D>,
        layers: Range<usize>,
        channels: &[Channel],
        progress: &dyn Progress,
    ) -> Result<Vec<Array>, Error> {
        if !matches!(self.shading, Shading::None | Shading::Flat(_) | Shading::Smooth(_)) {
            self.tracer.prepare();
        }
        let visible = visibility.first_hits(layers.clone(), progress)?;
        let fragments = shading::shade(self, layers.clone(), &visible, progress)?;
        Ok(channels.iter().map(|c| c.array(self, layers.clone(), &fragments)).collect())
    }

    /// Layers of a slab whose working set stays below `bytes`; at least one.
    pub fn layers_within(&self, bytes: usize, channels: &[Channel]) -> usize {
        let voxel = size_of::<u32>() + size_of::<Fragment>() + channels.iter().map(|c| c.bytes::<D>()).sum::<usize>();
        (bytes / voxel / self.grid.layer_len().max(1)).clamp(1, self.grid.dimensions[2])
    }
}
