//! Pictures: what a render needs of memory, what it shows, and how it is made, slab by slab, into all its files at once.
//!
//! `render` makes one picture, `animate` one a frame; both by [`RenderPlan::picture`].

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::camera;
use super::lighting::{self, LightFound, LightingPlan};
use super::occlusion::OcclusionSource;
use super::piece::{Bits, Record, Slab};
use super::render::{RenderPlan, Shading, rays_of};
use super::write::PictureFiles;
use super::{Needs, Plan, Run, SceneRun, StageError};
use crate::geometry::Dimension;
use crate::io;
use crate::occlusion::Estimator;
use crate::progress::Progress;
use crate::render::filters::denoise::Refine;
use crate::render::filters::{self, Dilate, ImageFilter, denoise};
use crate::render::{self, Accuracy, Aov, Columns, NOTHING, Renderer, Skylight};
use crate::volume::Grid;

/// The working set of a slab: so little that memory is used again for the next, not asked for anew.
const SLAB_BYTES: usize = 16 << 20;

impl RenderPlan {
    /// The memory of a slab of one layer with these arrays.
    pub(super) fn memory(&self, plan: &Plan, aovs: &BTreeSet<Aov>) -> Needs {
        let render = self;
        let dimension = plan[render.scene].dimension;
        let arrays: u64 = aovs.iter().map(|&aov| array_bytes(aov, dimension, render.layers)).sum();
        let mut columns = aovs.iter().fold(Columns::SIMPLEX, |all, aov| all | aov.columns());
        if let Some(lighting) = &render.lighting {
            columns |= Columns::DIRECT;
            if lighting.sky.is_some() || lighting.bounce {
                columns |= Columns::IRRADIANCE | Columns::DIRECTION | Columns::HIDDEN;
            }
        }
        if plan[render.scene].is_translucent() {
            columns |= Columns::BEHIND | Columns::THROUGH;
        }
        let (mut halo, axes) = (2 * render.dilate as u64, dimension.get() as u32 - 1);
        let (mut whole, mut holds) = (0, "one layer of its picture");
        if render.screen_space.is_some() {
            columns |= Columns::POSITION | Columns::NORMAL | Columns::OCCLUSION;
            (whole, holds) = (size_of::<f32>() as u64, "one layer of its picture and the depth of all of it");
            if render.lighting.as_ref().is_some_and(|lighting| lighting.bounce) {
                (whole, holds) = (8 * whole, "one layer of its picture, and of all of it the depth and the light");
            }
        }
        if render.denoise {
            columns |= Columns::POSITION | Columns::NORMAL | Columns::OBJECT | Columns::INTERPOLATED;
            columns |= Columns::FITTED | Columns::MISFIT | Columns::ERROR;
            halo += 10;
        }
        let samples = (render.supersample.pow(axes) * size_of::<u32>()) as u64;
        // Filters keep the layers that they look at.
        let layers = if axes == 3 { (1 + halo).min(render.dimensions[2] as u64) } else { 1 };
        let voxel = samples + layers * columns.bytes::<4>() as u64 + arrays;
        let memory = (render.voxels() / render.dimensions[2] as u64).saturating_mul(voxel);
        Needs { memory: memory.saturating_add(render.voxels().saturating_mul(whole)), disk: 0, holds }
    }

    /// Makes the picture, or some layers of it, and the files that `open` opens for what is made; `name` is what it is called where progress is told.
    /// Values at vertices must be known where they are shown, and the light of the sky and of other surfaces found.
    pub(super) fn picture<const D: usize>(
        &self,
        (name, part): (&str, Option<Slab>),
        plan: &Plan,
        scene: &SceneRun<D>,
        skylight: Option<Arc<Skylight<D>>>,
        progress: &dyn Progress,
        open: impl FnOnce(&Grid, &str) -> Result<PictureFiles, io::Error>,
    ) -> Result<Picture, StageError> {
        let render = self;
        let shading = shading(plan, render, scene);
        let mut picture = scene.session.renderer(camera::camera(&render.camera)?, render.dimensions, shading);
        (picture.visibility, picture.supersample) = (render.visibility, render.supersample);
        picture.layers = render.layers;
        picture.lighting = render.lighting.as_ref().map(LightingPlan::lighting);
        picture.skylight = skylight;
        picture.filters = filters_of(plan, render, &picture);
        picture.audit = render.audit(plan);
        let start = Instant::now();
        let hash = scene.session.mesh_hash();
        let all = picture.grid.dimensions[2];
        let layers = part.as_ref().map_or(0..all, Slab::layers);
        let border = part.as_ref().map_or(all, |slab| slab.own.end);
        let [width, height, _] = picture.grid.dimensions;
        let mut files = open(&Grid { dimensions: [width, height, layers.len()], ..picture.grid }, hash)?;
        let aovs = files.aovs().to_vec();
        let (mut seen, mut behind) = (0, 0);
        // Two passes over the voxels: what is seen, and its shade; and, where that takes longest, another in the image.
        let follows_light = picture.skylight.as_ref().is_some_and(|light| light.in_image == Some(true));
        let passes = 2 + u64::from(render.screen_space.is_some()) + u64::from(follows_light);
        let looked_at = part.as_ref().map_or(0..all, |slab| slab.looked_at(filters::reach(&picture.filters), all));
        let running = progress.stage(name, passes * (looked_at.len() * picture.grid.layer_len()) as u64);
        let first = layers.start;
        let made =
            picture.render_layers(layers, Some(border), &aovs, None, progress, |slab| -> Result<(), StageError> {
                // The layer that is the next part's too is counted there.
                if slab.layers.start < border {
                    seen += slab.seen;
                    behind += slab.behind;
                }
                Ok(files.add_slab(slab.layers.start - first, &slab.arrays)?)
            })?;
        let mut accuracy = None;
        let mut checked = Vec::new();
        match (made.audit, &part) {
            (Some(audit), None) => accuracy = audit.finish(&*picture.backend, progress)?,
            (Some(audit), Some(_)) => checked.extend(audit.candidates().map(Bits::new)),
            (None, _) => {}
        }
        running.end();
        if let Some(accuracy) = &accuracy {
            files.tell(accuracy);
        }
        let rendering = start.elapsed();
        let behind = if picture.shading.is_interpolated() { behind } else { 0 };
        // Of a part that is no news.
        let nothing = part.is_none() && seen == 0 && !scene.session.mesh().simplices.is_empty();
        let lit = picture.lighting.as_ref().filter(|_| seen > 0 && aovs.iter().any(|aov| aov.is_lit()));
        Ok(Picture {
            voxels: made.voxels,
            seen,
            behind,
            record: part.map(|slab| Record { layers: [slab.own.start, slab.own.end], seen, behind, checked }),
            accuracy,
            nothing: nothing.then(|| nothing_seen(&picture)),
            in_vain: lit.map_or_else(Vec::new, lighting::in_vain),
            light: picture.skylight.as_deref().map(|light| LightFound::new(light, &scene.session)),
            rendering,
            files: files.finish()?,
        })
    }
}

/// What came of a picture.
pub(super) struct Picture {
    /// How many voxels were made.
    pub voxels: u64,
    /// How many voxels see something.
    pub seen: u64,
    /// How many of them see a surface from behind, with the occlusion of its front.
    pub behind: u64,
    /// Of a part what is known of it beside its voxels.
    pub record: Option<Record>,
    /// How far off it is.
    pub accuracy: Option<Accuracy>,
    /// Why it shows nothing, if it does though there is something.
    pub nothing: Option<String>,
    /// What its lights do in vain.
    pub in_vain: Vec<String>,
    /// What was found of the light of the sky and of other surfaces, if it has any.
    pub light: Option<LightFound>,
    /// How long it took.
    pub rendering: Duration,
    /// Its files, with their lengths.
    pub files: Vec<(PathBuf, u64)>,
}

/// Bytes that a voxel takes in this array, or in those of so many layers.
pub(super) fn array_bytes(aov: Aov, dimension: Dimension, layers: usize) -> u64 {
    let bytes = match dimension {
        Dimension::Three => aov.bytes::<3>(),
        Dimension::Four => aov.bytes::<4>(),
    };
    (bytes * aov.count(layers)) as u64
}

/// Marks the vertices of the simplices that a render shows, or some layers of it and those around that filters look at, unless that costs more than is `left` to spend on it.
/// Returns whether it did.
pub(super) fn mark_seen<const D: usize>(
    (name, render): (&str, &RenderPlan),
    run: &Run,
    scene: &SceneRun<D>,
    part: Option<&Slab>,
    left: &mut u64,
    mask: &mut [bool],
) -> Result<bool, StageError> {
    // What is behind the first surfaces needs values too.
    if run.plan[render.scene].is_translucent() || render.arrays.contains(&Aov::LayerAmbientOcclusion) {
        return Ok(false);
    }
    let camera = camera::camera::<D>(&render.camera)?;
    // All samples, not the voxels' centres alone.
    let samples = |a: usize| if a < D - 1 { render.dimensions[a] * render.supersample } else { 1 };
    let grid = camera.grid(std::array::from_fn(samples));
    let backend = Arc::clone(scene.session.backend());
    let visibility = render::Visibility::new(backend, &camera, &grid, render.visibility);
    let all = grid.dimensions[2];
    let layers = match part {
        None => 0..all,
        Some(slab) => {
            let picture = scene.session.renderer(camera, render.dimensions, render::Shading::None);
            let reach = filters::reach(&filters_of(run.plan, render, &picture));
            let looked_at = slab.looked_at(reach, render.dimensions[2]);
            let fine = all / render.dimensions[2];
            looked_at.start * fine..looked_at.end * fine
        }
    };
    *left = left.saturating_sub((u128::from(visibility.cost()) * layers.len() as u128 / all as u128) as u64);
    if *left == 0 {
        return Ok(false);
    }
    let _running = run.progress.stage(&format!("what {name} shows"), (grid.layer_len() * layers.len()) as u64);
    let thick = (SLAB_BYTES / size_of::<u32>() / grid.layer_len()).clamp(1, all);
    for first in layers.clone().step_by(thick) {
        let layers = first..layers.end.min(first + thick);
        let mut last = NOTHING;
        for simplex in visibility.first_hits(layers, run.progress)? {
            if simplex != NOTHING && simplex != last {
                scene.session.mesh().simplices[simplex as usize].iter().for_each(|&v| mask[v as usize] = true);
                last = simplex;
            }
        }
    }
    Ok(true)
}

fn shading<const D: usize>(plan: &Plan, render: &RenderPlan, scene: &SceneRun<D>) -> render::Shading {
    if let Some(screen_space) = &render.screen_space {
        return render::Shading::ScreenSpace(screen_space.settings());
    }
    let Some(occlusion) = render.occlusion else { return render::Shading::None };
    match (render.shading, &plan[occlusion].source) {
        (Shading::Voxel, OcclusionSource::Compute(computation)) => render::Shading::Voxel(computation.estimator()),
        (Shading::Flat, _) => render::Shading::Flat(Arc::clone(&scene.values[&occlusion])),
        (Shading::Auto, _) if render.denoise => {
            let values = Arc::clone(&scene.values[&occlusion]);
            match rays_of(plan, render) {
                Some(sampling) => render::Shading::Auto(values, Estimator::Sampled(sampling)),
                None => render::Shading::Smooth(values),
            }
        }
        _ => render::Shading::Smooth(Arc::clone(&scene.values[&occlusion])),
    }
}

/// What looks at neighbouring voxels, in this order.
fn filters_of<const D: usize>(plan: &Plan, render: &RenderPlan, picture: &Renderer<D>) -> Vec<Box<dyn ImageFilter<D>>> {
    let mut filters: Vec<Box<dyn ImageFilter<D>>> = Vec::new();
    if let Some(sampling) = rays_of(plan, render).filter(|_| render.denoise) {
        filters.extend(denoise(&picture.camera, &picture.grid, sampling));
    }
    let most = render.occlusion.and_then(|occlusion| plan[occlusion].most_at_voxels());
    if let (Some(tolerance), Some(most)) = (render.tolerance, most) {
        filters.push(Box::new(Refine::new(Arc::clone(&picture.backend), most, tolerance)));
    }
    if render.dilate > 0 {
        filters.push(Box::new(Dilate { layers: render.dilate }));
    }
    filters
}

/// Why a picture shows nothing.
pub(super) fn nothing_seen<const D: usize>(picture: &Renderer<D>) -> String {
    let behind = |v: &u32| picture.camera.project(&picture.tracer().mesh().vertices[*v as usize]).1 <= 0.0;
    if picture.tracer().mesh().simplices.iter().flatten().all(behind) {
        "the scene lies wholly behind the camera; let `camera: fit` place it, or turn it, or move it back"
    } else {
        "no voxel's centre sees any of the scene; let `camera: fit` place the camera, look at the scene's place and size, or \
         use more voxels"
    }
    .to_owned()
}
