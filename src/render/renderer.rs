//! The renderer: all that decides what a picture shows, and the picture slab by slab.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::audit::Audit;
use super::filters::{self, Chain, ImageFilter};
use super::gbuffer::{Columns, GBuffer};
use super::layers::LayerPass;
use super::samples::Sampling;
use super::skylight::shine;
use super::surface::SurfacePass;
use super::{
    Accuracy, Aov, Camera, DepthImage, Lighting, NOTHING, ScreenSpace, Shading, Skylight, Visibility, behind, occlude,
    screen_space, visibility,
};
use crate::accel::Tracer;
use crate::geometry::Vector64;
use crate::occlusion::Error;
use crate::progress::{Progress, Uncounted};
use crate::trace::cpu::CpuBackend;
use crate::trace::{self, RayBackend};
use crate::volume::{Array, Grid, Volume};

/// The working set of a slab: so little that memory is used again for the next, not asked for anew.
const SLAB_BYTES: usize = 16 << 20;

/// Everything that decides what a picture shows.
#[derive(Debug)]
pub struct Renderer<const D: usize> {
    /// What traces rays through the scene.
    pub backend: Arc<dyn RayBackend<D>>,
    /// Who looks.
    pub camera: Camera<D>,
    /// The voxels.
    pub grid: Grid,
    /// Where their ambient occlusion comes from.
    pub shading: Shading,
    /// How it is lit; none shows colour times ambient occlusion.
    pub lighting: Option<Lighting<D>>,
    /// The sky, and the light of other surfaces; none is a sky that shines on all sides alike. Of a picture that is not lit
    /// only the arrays show it.
    pub skylight: Option<Arc<Skylight<D>>>,
    /// How it is found out what voxels see; changes the time only.
    pub visibility: visibility::Method,
    /// Samples of a voxel along each axis, at least 1: what is seen is looked at so finely.
    pub supersample: usize,
    /// How many layers arrays are made of, at most [`super::MOST_LAYERS`].
    pub layers: usize,
    /// What looks at neighbouring voxels, in this order.
    pub filters: Vec<Box<dyn ImageFilter<D>>>,
    /// The rays that some voxels are looked at again with, to measure how far off the picture is; others than its own.
    pub audit: Option<trace::Sampling>,
}

/// Some layers of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Slab {
    /// Which layers.
    pub layers: Range<usize>,
    /// The arrays that were asked for, in that order; those of layers one after the other.
    pub arrays: Vec<Array>,
    /// How many of their voxels see something.
    pub seen: u64,
    /// How many of those see a surface from behind.
    pub behind: u64,
}

/// What is known of a picture, or of some of its layers, when they are made.
#[derive(Debug)]
pub struct Rendered<const D: usize> {
    /// The voxels at which it is to be looked at again, if that was asked for.
    pub audit: Option<Audit<D>>,
    /// Voxels whose shade was found, with those beyond the layers that were asked for, which filters look at.
    pub voxels: u64,
}

impl<const D: usize> Renderer<D> {
    /// A picture with one sample a voxel and no filter.
    pub fn new(backend: Arc<dyn RayBackend<D>>, camera: Camera<D>, dimensions: [usize; 3], shading: Shading) -> Self {
        let grid = camera.grid(dimensions);
        let visibility = visibility::Method::Auto;
        Self {
            backend,
            camera,
            grid,
            shading,
            lighting: None,
            skylight: None,
            visibility,
            supersample: 1,
            layers: 0,
            filters: Vec::new(),
            audit: None,
        }
    }

    /// The scene.
    pub fn tracer(&self) -> &Arc<Tracer<D>> {
        self.backend.tracer()
    }

    /// Makes the picture from the first layer to the last, and hands over slab after slab with these arrays. `thickness`
    /// is how many layers a slab has; by default as many as need little memory. No value depends on it. Returns how far off
    /// the occlusion is, if it was asked for and any voxel sees something.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if `progress` says so, [`Error::OverBudget`] where a closed form is too expensive, and those of
    /// `sink`.
    pub fn render<E: From<Error>>(
        &self,
        aovs: &[Aov],
        thickness: Option<usize>,
        progress: &dyn Progress,
        sink: impl FnMut(Slab) -> Result<(), E>,
    ) -> Result<Option<Accuracy>, E> {
        let made = self.render_layers(0..self.grid.dimensions[2], None, aovs, thickness, progress, sink)?;
        Ok(made.audit.map(|audit| audit.finish(&*self.backend, progress)).transpose()?.flatten())
    }

    /// The same for some layers of the picture. No slab reaches from before the layer `border` to behind it; audited is
    /// what lies before it.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn render_layers<E: From<Error>>(
        &self,
        wanted: Range<usize>,
        border: Option<usize>,
        aovs: &[Aov],
        thickness: Option<usize>,
        progress: &dyn Progress,
        mut sink: impl FnMut(Slab) -> Result<(), E>,
    ) -> Result<Rendered<D>, E> {
        let border = border.unwrap_or(wanted.end).clamp(wanted.start, wanted.end);
        let thickness = thickness.unwrap_or_else(|| self.layers_within(SLAB_BYTES, aovs)).max(1);
        let sampling = Sampling::new(&self.camera, &self.grid, self.supersample);
        let visibility = Visibility::new(Arc::clone(&self.backend), &self.camera, &sampling.fine, self.visibility);
        let columns = self.columns(aovs);
        let depth_image = match self.shading {
            Shading::ScreenSpace(settings) => Some(self.depth_image(settings, columns, progress)?),
            _ => None,
        };
        // Where only the audit asks for points, it does so of few voxels.
        let limit = AtomicU64::new(u64::MAX);
        let points = Columns::POSITION | Columns::NORMAL | Columns::SHADING_NORMAL | Columns::BARYCENTRIC;
        let pass = SurfacePass {
            tracer: self.tracer(),
            camera: &self.camera,
            sampling: &sampling,
            visibility: &visibility,
            shading: &self.shading,
            lighting: self.lighting.as_ref(),
            skylight: self.skylight.as_deref(),
            points: (!self.columns_shown(aovs).intersects(points)).then_some(&limit),
        };
        if columns.contains(Columns::DIRECT) {
            self.tracer().prepare();
        }
        // Of the voxels' centres, and by the processor.
        let layered = aovs.iter().any(|aov| aov.needs_layers()).then(|| {
            let backend: Arc<dyn RayBackend<D>> = Arc::new(CpuBackend::new(Arc::clone(self.tracer())));
            Visibility::new(backend, &self.camera, &self.grid, self.visibility)
        });
        let layered = layered.as_ref().map(|visibility| LayerPass {
            backend: &*self.backend,
            camera: &self.camera,
            grid: &self.grid,
            visibility,
            shading: &self.shading,
            most: self.layers,
            occluded: aovs.contains(&Aov::LayerAmbientOcclusion),
        });
        let mut voxels = 0;
        let mut source = |layers: Range<usize>| -> Result<GBuffer<D>, Error> {
            voxels += (layers.len() * self.grid.layer_len()) as u64;
            let mut buffer = pass.layers(layers, columns, progress)?;
            if columns.intersects(behind::COLUMNS) {
                behind::add(&pass, &*self.backend, &mut buffer, progress)?;
            }
            match self.shading {
                Shading::Voxel(estimator) => {
                    let skylight = self.skylight.as_deref();
                    occlude::occlude_and_light(&*self.backend, estimator, &mut buffer, skylight, progress)?;
                }
                Shading::Auto(_, estimator) => {
                    buffer.interpolated.copy_from_slice(&buffer.occlusion);
                    occlude::occlude(&*self.backend, estimator, &mut buffer, progress)?;
                }
                Shading::None | Shading::Flat(_) | Shading::Smooth(_) | Shading::ScreenSpace(_) => {}
            }
            if let Some(image) = &depth_image {
                screen_space::occlude(image, &mut buffer, progress)?;
            }
            Ok(buffer)
        };
        let mut audit = self.audit.map(Audit::new);
        let mut chain = Chain::new(self.grid.dimensions, wanted.start, columns, &self.filters);
        let mut first = wanted.start;
        while first < wanted.end {
            let end = if first < border { border } else { wanted.end };
            let mut buffer = chain.next(end.min(first + thickness), &mut source, progress)?;
            first = buffer.layers().end;
            shine(self.skylight.as_deref(), &mut buffer);
            let layers = layered.as_ref().map(|pass| pass.layers(buffer.layers(), progress)).transpose()?;
            let layers = layers.unwrap_or_default();
            buffer.passages.iter_mut().enumerate().for_each(|(i, count)| *count = layers.count(i));
            let seen = buffer.simplex.iter().filter(|&&simplex| simplex != NOTHING).count() as u64;
            if let Some(audit) = audit.as_mut().filter(|_| first <= border) {
                audit.add(&buffer);
                limit.store(audit.limit(), Ordering::Relaxed);
            }
            let arrays = aovs.iter().flat_map(|aov| aov.arrays(&buffer, &layers)).collect();
            let is_behind = |simplex: u32| simplex != NOTHING && visibility.is_away(simplex);
            let behind = buffer.simplex.iter().filter(|&&simplex| is_behind(simplex)).count() as u64;
            sink(Slab { layers: buffer.layers(), arrays, seen, behind })?;
        }
        Ok(Rendered { audit, voxels })
    }

    /// The whole picture in memory.
    ///
    /// # Errors
    /// Those of [`Renderer::render`].
    pub fn volume(&self, aovs: &[Aov], progress: &dyn Progress) -> Result<Volume, Error> {
        let mut arrays: Vec<Array> = Vec::new();
        self.render(aovs, Some(self.grid.dimensions[2]), progress, |slab| {
            arrays = slab.arrays;
            Ok::<(), Error>(())
        })?;
        Ok(Volume { grid: self.grid, arrays, field_data: Vec::new() })
    }

    /// What the voxels' centres see, as far as screen space looks at it for these columns; made slab by slab too.
    fn depth_image(
        &self,
        settings: ScreenSpace,
        columns: Columns,
        progress: &dyn Progress,
    ) -> Result<DepthImage<D>, Error> {
        let mut distances = Vec::with_capacity(self.grid.len());
        self.centres(Columns::SIMPLEX | Columns::DEPTH, progress, |slab| {
            distances.extend(slab.depth);
            Ok(())
        })?;
        let mut image = DepthImage::new(&self.camera, &self.grid, distances, settings);
        let is_lit = columns.contains(Columns::HIDDEN);
        if is_lit || columns.contains(Columns::DIRECTION) {
            image = image.directed();
        }
        if !is_lit {
            return Ok(image);
        }
        // Light goes from what is seen to what is seen, so where it comes from is found for all voxels first.
        let gradient = self.skylight.as_deref().map_or_else(Vector64::zeros, |skylight| skylight.gradient);
        let mut light = Vec::with_capacity(self.grid.len());
        self.centres(screen_space::COLUMNS | Columns::DIRECTION, progress, |mut slab| {
            screen_space::occlude(&image, &mut slab, progress)?;
            light.extend(screen_space::radiosity(self.tracer().mesh(), &slab, &gradient));
            Ok(())
        })?;
        Ok(image.lit(light))
    }

    /// What the voxels' centres see, without occlusion, slab by slab.
    fn centres(
        &self,
        columns: Columns,
        progress: &dyn Progress,
        mut sink: impl FnMut(GBuffer<D>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let sampling = Sampling::new(&self.camera, &self.grid, 1);
        let visibility = Visibility::new(Arc::clone(&self.backend), &self.camera, &sampling.fine, self.visibility);
        let pass = SurfacePass {
            tracer: self.tracer(),
            camera: &self.camera,
            sampling: &sampling,
            visibility: &visibility,
            shading: &Shading::None,
            lighting: None,
            skylight: None,
            points: None,
        };
        let [_, _, layers] = self.grid.dimensions;
        let voxel = columns.bytes::<D>() + size_of::<u32>();
        let thickness = (SLAB_BYTES / voxel / self.grid.layer_len().max(1)).clamp(1, layers);
        for first in (0..layers).step_by(thickness) {
            sink(pass.layers(first..layers.min(first + thickness), columns, &Uncounted(progress))?)?;
        }
        Ok(())
    }

    /// The columns that the picture needs.
    fn columns(&self, aovs: &[Aov]) -> Columns {
        self.columns_shown(aovs) | self.audit.map_or(Columns::empty(), |_| Audit::<D>::COLUMNS)
    }

    /// The columns that arrays and filters need.
    fn columns_shown(&self, aovs: &[Aov]) -> Columns {
        let mut columns = columns(&self.shading, aovs)
            | self.filters.iter().fold(Columns::empty(), |all, filter| all | filter.columns());
        if self.lighting.is_some() && columns.contains(Columns::ALBEDO) {
            columns |= Columns::DIRECT;
            if self.skylight.is_some() {
                columns |= Columns::IRRADIANCE;
            }
        }
        if columns.contains(Columns::IRRADIANCE) {
            columns |= Columns::OCCLUSION | self.skylight.as_deref().map_or(Columns::empty(), Skylight::columns);
        }
        if self.tracer().mesh().is_translucent() && columns.intersects(Columns::ALBEDO | Columns::COVERAGE) {
            columns |= behind::COLUMNS;
        }
        columns
    }

    /// Layers of a slab whose working set stays below `bytes`; at least one.
    fn layers_within(&self, bytes: usize, aovs: &[Aov]) -> usize {
        let voxel = self.bytes_per_voxel(aovs);
        let halo = filters::halo(&self.filters);
        (bytes / voxel / self.grid.layer_len().max(1)).saturating_sub(halo).clamp(1, self.grid.dimensions[2])
    }

    /// Bytes that a voxel takes while its slab is made.
    fn bytes_per_voxel(&self, aovs: &[Aov]) -> usize {
        bytes_per_voxel::<D>(self.columns(aovs), self.supersample, self.layers, aovs)
    }
}

/// The columns that arrays need, with this shading.
fn columns(shading: &Shading, aovs: &[Aov]) -> Columns {
    let point = match shading {
        Shading::Voxel(_) => occlude::COLUMNS,
        Shading::Auto(..) => occlude::COLUMNS | Columns::OCCLUSION | Columns::INTERPOLATED,
        Shading::ScreenSpace(_) => screen_space::COLUMNS,
        Shading::None | Shading::Flat(_) | Shading::Smooth(_) => Columns::SIMPLEX,
    };
    aovs.iter().fold(point, |all, aov| all | aov.columns())
}

/// Bytes that a voxel takes in the G-buffer, in arrays, and while its samples are looked at.
fn bytes_per_voxel<const D: usize>(columns: Columns, supersample: usize, layers: usize, aovs: &[Aov]) -> usize {
    let samples = supersample.pow(D as u32 - 1) * size_of::<u32>();
    samples + columns.bytes::<D>() + aovs.iter().map(|aov| aov.bytes::<D>() * aov.count(layers)).sum::<usize>()
}
