//! `render`: an image of a scene, from where, how large, and darkened by which occlusion.
//!
//! A picture is made when some file of it has to be; how, is told in `picture`.

use std::collections::BTreeSet;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::camera::{self, CameraPlan, CameraSpec, ProjectionPlan};
use super::describe::{Counts, Totals, grouped};
use super::lighting::{self, DepthCueSpec, LightAsked, LightSpec, LightingKeys, LightingPlan, SkySpec};
use super::occlusion::{self, OcclusionPlan, OcclusionSource};
use super::picture::nothing_seen;
use super::piece::{self, Joined, Record};
use super::scene::ScenePlan;
use super::screen_space::{self, ScreenSpacePlan, ScreenSpaceSpec};
use super::subject::scene_and_occlusion;
use super::write::{self, Content, PictureFiles, WritePlan, write_whole};
use super::{Invalid, LeftOut, Needs, Plan, Ref, Resolver, Run, SceneRun, Stage, StageError, Told};
use crate::geometry::Dimension;
use crate::render::visibility::Method as Visibility;
use crate::render::{Accuracy, Aov, Audit, CameraError, MOST_LAYERS, MOST_SAMPLES, Shading as Shaded};
use crate::text::number;
use crate::trace::Sampling;
use crate::volume::Grid;

/// The most voxels along an axis.
pub const MAX_DIMENSION: u64 = 65_535;
/// Images that would have more samples than this are not supersampled unless that is asked for: 270^3 voxels of 27.
const MANY_SAMPLES: usize = 1 << 29;
/// The most layers of empty voxels that take over values.
const MAX_DILATION: usize = 16;
/// The standard error that a voxel may have, unless it is said otherwise.
const TOLERANCE: f64 = 0.01;
/// Voxels of fewer rays are denoised, unless it is said otherwise.
const DENOISED_BELOW: u32 = 64;

/// An image of a scene: a volume of voxels in 4D, a picture in 3D.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct RenderSpec {
    /// A name for later stages to refer to.
    pub id: Option<String>,
    /// The scene, or the occlusion (and with it its scene), by its id.
    pub input: Option<String>,
    /// The occlusion that darkens the image, by its id; `none` renders without; `screen_space` looks for it in the image
    /// itself, without rays (default: the nearest earlier one, if any).
    pub occlusion: Option<String>,
    /// With `occlusion: screen_space`: how it is looked for.
    pub screen_space: Option<ScreenSpaceSpec>,
    /// Where it is seen from; `fit` from where the scene just fits the image.
    #[serde(default, deserialize_with = "camera::fit_or_keys")]
    #[schemars(schema_with = "camera::fit_or_keys_schema")]
    pub camera: Option<CameraSpec>,
    /// Voxels along x, y and z; in 3D pixels along x and y.
    pub dimensions: Vec<u64>,
    /// Where the occlusion of a visible point comes from (default `auto` where it is computed by rays, else `smooth`).
    pub shading: Option<Shading>,
    /// Whether the occlusion of voxels is denoised by that of their neighbours; with `voxel` (default: below 64 rays) and
    /// `auto` (always).
    pub denoise: Option<bool>,
    /// With `auto`: the standard error of ambient occlusion that a voxel may have (default 0.01). Where it is larger, more
    /// rays are asked, as many as a vertex takes at most.
    pub tolerance: Option<f64>,
    /// Samples of a voxel along each axis; opacity, colour, occlusion and depth are means over those that see something
    /// (default 3; 1 with `lights`, where each sample looks for shadows of its own, and from 270^3 voxels on).
    #[schemars(range(min = 1, max = 8))]
    pub supersample: Option<u64>,
    /// Of every voxel also the surfaces behind the first that the ray through its centre passes: so many layers, front to back, in
    /// arrays whose names end in the layer's number (`layer_depth` and others of `write.arrays`).
    #[schemars(range(min = 1, max = 1000))]
    pub layers: Option<u64>,
    /// Layers of empty voxels around bodies that take over the bodies' colour and occlusion, so that contours and volume
    /// renderings mix in nothing else; opacity tells what is real (default 3 in 4D, 0 in 3D).
    #[schemars(range(min = 0, max = 16))]
    pub dilate: Option<u64>,
    /// Lights that throw shadows. With `lights`, `ambient`, `sky`, `bounce` or `depth_cue` an image is lit: all light is added up in linear
    /// numbers, `light` holds the sum, and the colours that are shown are what sRGB makes of it, white from 1 on. Without, it
    /// shows colour times occlusion.
    pub lights: Option<Vec<LightSpec>>,
    /// The light that comes from all sides, darkened by the occlusion (default 0.3 beside `lights`, 1 without).
    #[schemars(range(min = 0, max = 1_000_000))]
    pub ambient: Option<f64>,
    /// A sky that is not equally bright on all sides; lights the picture exactly, by the open directions beside the
    /// occlusion (default: equally bright).
    pub sky: Option<SkySpec>,
    /// With 1, surfaces are also lit by what other surfaces reflect of the sky, once (default 0); not of `lights`.
    #[schemars(range(min = 0, max = 1))]
    pub bounce: Option<u64>,
    /// The share of the lights that surfaces reflect in highlights (default 0); objects may say their own.
    #[schemars(range(min = 0, max = 1))]
    pub specular: Option<f64>,
    /// The exponent of highlights: the higher, the smaller they are (default 30).
    #[schemars(range(min = 1, max = 1_000_000))]
    pub shininess: Option<f64>,
    /// What is far from the eye takes on a colour.
    pub depth_cue: Option<DepthCueSpec>,
    /// How it is found out what voxels see; changes the time, never the image (default `auto`, the faster one).
    pub visibility: Option<Visibility>,
}

/// How the occlusion at the vertices becomes that of a visible point.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Shading {
    /// Interpolated over the simplex.
    #[default]
    Smooth,
    /// The mean over the simplex.
    Flat,
    /// Computed at the visible point itself: the reference for the others.
    Voxel,
    /// Interpolated, and mended by rays at each voxel: few, denoised, and more where those are not enough to keep to the
    /// tolerance.
    Auto,
}

/// An image of a scene, as understood.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RenderPlan {
    /// The scene it shows.
    pub scene: Ref<ScenePlan>,
    /// The occlusion that darkens it; none renders without, or looks for it in the image.
    pub occlusion: Option<Ref<OcclusionPlan>>,
    /// How occlusion is looked for in the image itself, if it is.
    pub screen_space: Option<ScreenSpacePlan>,
    /// Where it is seen from.
    pub camera: CameraPlan,
    /// Voxels along x, y and z; one layer in 3D.
    pub dimensions: [usize; 3],
    /// Where the occlusion of a visible point comes from.
    pub shading: Shading,
    /// Whether it is denoised.
    pub denoise: bool,
    /// With `auto`: the standard error that a voxel may have.
    pub tolerance: Option<f64>,
    /// Samples of a voxel along each axis.
    pub supersample: usize,
    /// Layers of surfaces that arrays are made of; 0 for none.
    pub layers: usize,
    /// Layers of empty voxels that take over bodies' values.
    pub dilate: usize,
    /// How it is lit; none shows colour times occlusion.
    pub lighting: Option<LightingPlan>,
    /// How it is found out what voxels see.
    pub visibility: Visibility,
    /// The arrays that its files need, in their own order, each once.
    pub arrays: Vec<Aov>,
}

impl RenderSpec {
    /// What it says of lights.
    pub(super) fn lighting_keys(&self) -> LightingKeys<'_> {
        LightingKeys {
            lights: self.lights.as_deref(),
            ambient: self.ambient,
            sky: self.sky.as_ref(),
            bounce: self.bounce,
            specular: self.specular,
            shininess: self.shininess,
            depth_cue: self.depth_cue.as_ref(),
            is_glossy: false,
        }
    }
}

impl RenderPlan {
    /// Whether anything darkens it.
    pub fn is_dark(&self) -> bool {
        self.occlusion.is_some() || self.screen_space.is_some()
    }

    /// What light from the sky and from other surfaces these arrays of it need.
    pub(super) fn light_asked(&self, arrays: &[Aov]) -> LightAsked<'_> {
        let lighting = self.lighting.as_ref();
        let is_lit = arrays.iter().any(|aov| aov.is_lit() || *aov == Aov::Irradiance);
        let is_bounce = |aov: &Aov| matches!(aov, Aov::Bounce | Aov::BounceError);
        LightAsked {
            lighting,
            directions: arrays.contains(&Aov::BentNormal) || is_lit && lighting.is_some_and(|l| l.sky.is_some()),
            bounce: lighting.is_some_and(|l| l.bounce) && (is_lit || arrays.iter().any(is_bounce)),
            at_voxels: self.shading == Shading::Voxel,
        }
    }

    /// Why nothing is known of the directions in which the sky is open, if so.
    pub(super) fn no_directions(&self, plan: &Plan) -> Option<String> {
        no_directions(plan, self.scene, self.occlusion)
    }

    /// Where its voxels are.
    pub(super) fn grid(&self, plan: &Plan) -> Result<Grid, CameraError> {
        Ok(match plan[self.scene].dimension {
            Dimension::Three => camera::camera::<3>(&self.camera)?.grid(self.dimensions),
            Dimension::Four => camera::camera::<4>(&self.camera)?.grid(self.dimensions),
        })
    }

    /// The number of voxels.
    pub fn voxels(&self) -> u64 {
        self.dimensions.iter().map(|&d| d as u64).product()
    }
}

impl Stage for RenderPlan {
    type Spec = RenderSpec;
    const KIND: &'static str = "render";
    const LIST: &'static str = "renders";
    const LEFT_OUT: &'static [LeftOut] = &[
        LeftOut::new("/scene", "the key of the scene itself takes part"),
        LeftOut::new("/occlusion", "the key of the occlusion itself takes part"),
        LeftOut::new("/visibility", "changes the time, never the image"),
        LeftOut::new("/arrays", "each file has the key of what it holds"),
    ];

    fn id(spec: &RenderSpec) -> Option<&str> {
        spec.id.as_deref()
    }

    fn resolve(spec: &RenderSpec, path: &str, resolver: &mut Resolver) -> Result<Self, Invalid> {
        let screen_space = screen_space(spec, path, resolver)?;
        let named = spec.occlusion.as_deref().map(|word| if screen_space.is_some() { "none" } else { word });
        let (scene, occlusion) = scene_and_occlusion(resolver, path, spec.input.as_deref(), named)?;
        let dimension = resolver.plan[scene].dimension;
        let blank = CameraSpec::default();
        let camera_spec = spec.camera.as_ref().unwrap_or(&blank);
        let warnings = &mut resolver.plan.warnings;
        let camera = camera::plan(camera_spec, &format!("{path}.camera"), dimension, warnings)?;
        let default = occlusion.map_or(Shading::Smooth, |o| resolver.plan[o].default_shading());
        let shading = spec.shading.filter(|_| screen_space.is_none()).unwrap_or(default);
        let refusal = match occlusion.map(|o| &resolver.plan[o].source).filter(|_| shading == Shading::Voxel) {
            Some(OcclusionSource::Load(_)) => Some(
                "`voxel` computes occlusion at the visible points, which a loaded file has no values for".to_owned(),
            ),
            Some(OcclusionSource::Compute(computation)) if computation.method.is_of_the_thesis() => {
                let method = computation.method.as_str();
                Some(format!("`{method}` has values at vertices only; take `flat`, as the thesis did"))
            }
            _ => None,
        };
        if let Some(message) = refusal {
            return Err(Invalid::new(format!("{path}.shading"), message));
        }
        if let Some(scene) = resolver.plan.get_mut(scene) {
            scene.eye.get_or_insert_with(|| camera.eye.clone());
        }
        let dimensions = dimensions(&format!("{path}.dimensions"), &spec.dimensions, dimension)?;
        let visibility = spec.visibility.unwrap_or_default();
        let tolerance = tolerance(&format!("{path}.tolerance"), spec.tolerance)?;
        let rays = occlusion.and_then(|o| rays(&resolver.plan[o], shading, dimension, tolerance));
        if spec.denoise == Some(true) && rays.is_none() {
            resolver
                .warn(format!("{path}.denoise"), "has no effect but where rays are taken at voxels: `voxel` or `auto`");
        }
        if spec.denoise == Some(false) && shading == Shading::Auto {
            let message =
                "`auto` takes so few rays at a voxel that they must be denoised; leave this out, or take `voxel`";
            return Err(Invalid::new(format!("{path}.denoise"), message));
        }
        if spec.tolerance.is_some() && (shading != Shading::Auto || rays.is_none()) {
            resolver.warn(format!("{path}.tolerance"), "has no effect but with `shading: auto`");
        }
        let few = rays.is_some_and(|rays| shading == Shading::Auto || rays.samples < DENOISED_BELOW);
        let denoise = rays.is_some() && spec.denoise.unwrap_or(few);
        let within = |key: &str, found: Option<u64>, default: usize, least: usize, most: usize| match found {
            None => Ok(default),
            Some(n) if (least as u64..=most as u64).contains(&n) => Ok(n as usize),
            Some(n) => Err(Invalid::new(format!("{path}.{key}"), format!("expected {least} to {most}, found {n}"))),
        };
        let fits = |samples: usize| dimensions.iter().all(|&d| (d * samples) as u64 <= MAX_DIMENSION);
        let axes = dimension.pick(2, 3);
        let samples = dimensions.iter().product::<usize>().saturating_mul(3usize.pow(axes));
        // With lights each sample looks for shadows of its own.
        let usual = if spec.lights.is_none() && samples <= MANY_SAMPLES && fits(3) { 3 } else { 1 };
        let supersample = within("supersample", spec.supersample, usual, 1, MOST_SAMPLES)?;
        if !fits(supersample) {
            let message =
                format!("with {supersample} samples along each axis an image has at most {MAX_DIMENSION} of them");
            return Err(Invalid::new(format!("{path}.supersample"), message));
        }
        let layers = within("layers", spec.layers, 0, 1, MOST_LAYERS)?;
        let halo = if dimension == Dimension::Four { 3 } else { 0 };
        let dilate = within("dilate", spec.dilate, halo, 0, MAX_DILATION)?;
        let keys = LightingKeys { is_glossy: resolver.plan[scene].is_glossy(), ..spec.lighting_keys() };
        let lighting = lighting::plan(keys, path, dimension, &mut resolver.plan.warnings)?;
        for (key, given) in [("sky", spec.sky.is_some()), ("bounce", lighting.as_ref().is_some_and(|l| l.bounce))] {
            let needed = "needs an occlusion, which tells how much light reaches a surface";
            let is_dark = occlusion.is_some() || screen_space.is_some();
            let lacks = || (key == "bounce" && !is_dark).then(|| needed.to_owned());
            let refusal = no_directions(&resolver.plan, scene, occlusion).or_else(lacks);
            if let Some(message) = refusal.filter(|_| given) {
                return Err(Invalid::new(format!("{path}.{key}"), message));
            }
        }
        let arrays = Vec::new();
        let tolerance = (shading == Shading::Auto && denoise).then_some(tolerance);
        Ok(Self {
            scene,
            occlusion,
            screen_space,
            camera,
            dimensions,
            shading,
            denoise,
            tolerance,
            supersample,
            layers,
            dilate,
            lighting,
            visibility,
            arrays,
        })
    }

    fn unused(me: Ref<Self>, plan: &Plan) -> Option<&'static str> {
        let written = (0..plan.stages.len()).any(|stage| plan.works_on(stage).contains(&me.index()));
        let layers = plan[me].layers == 0 || plan[me].arrays.iter().any(|aov| aov.needs_layers());
        match (written, layers) {
            (false, _) => Some("no `write` stage writes this image"),
            (true, false) => Some("no `write` stage writes its `layers`; add `layer_depth` or others to its `arrays`"),
            (true, true) => None,
        }
    }

    fn works_on(&self) -> Vec<usize> {
        std::iter::once(self.scene.index()).chain(self.occlusion.map(Ref::index)).collect()
    }

    fn scene(me: Ref<Self>, plan: &Plan) -> Option<Ref<ScenePlan>> {
        Some(plan[me].scene)
    }

    fn written(me: Ref<Self>, plan: &Plan) -> Value {
        let render = &plan[me];
        let mut written = json!({
            "camera": render.camera.written(),
            "supersample": render.supersample,
            "dilate": render.dilate,
        });
        match &render.screen_space {
            Some(screen_space) => written["screen_space"] = screen_space.written(),
            None => written["shading"] = json!(render.shading),
        }
        if let (Some(lighting), Some(written)) = (&render.lighting, written.as_object_mut()) {
            written.extend(lighting.written());
        }
        if render.layers > 0 {
            written["layers"] = render.layers.into();
        }
        // Elsewhere it has no effect, and would be warned of.
        if rays_of(plan, render).is_some() {
            written["denoise"] = render.denoise.into();
            written["tolerance"] = render.tolerance.into();
        }
        written
    }

    /// The memory of a slab of one layer: what is seen, its shade, and the arrays of the files that have to be made.
    fn needs(me: Ref<Self>, plan: &Plan, stale: &dyn Fn(&Path) -> bool) -> Needs {
        let render = &plan[me];
        let mut aovs: BTreeSet<Aov> = BTreeSet::new();
        for (_, write) in plan.all::<WritePlan>().filter(|(_, write)| write.render == me) {
            aovs.extend(write.stale(Content::Voxels, stale).into_iter().flat_map(|file| file.format.arrays(write)));
        }
        if aovs.is_empty() { Needs::default() } else { render.memory(plan, &aovs) }
    }

    fn line(me: Ref<Self>, plan: &Plan, _: &[Counts]) -> String {
        let render = &plan[me];
        let [x, y, z] = render.dimensions;
        let with = match render.occlusion {
            Some(occlusion) => format!("with {}", plan.id(occlusion)),
            None if render.screen_space.is_some() => "with occlusion in screen space".into(),
            None => "without occlusion".into(),
        };
        let shading = render.screen_space.map_or(render.shading.as_str().to_owned(), |space| space.line());
        let projection = match render.camera.projection {
            ProjectionPlan::Perspective { field_of_view } => format!("perspective {field_of_view} degrees"),
            ProjectionPlan::Parallel { height } => format!("parallel, height {height}"),
        };
        let extent = match plan[render.scene].dimension {
            Dimension::Three => format!("{x} x {y}"),
            Dimension::Four => format!("{x} x {y} x {z}"),
        };
        let (scene, voxels) = (plan.id(render.scene), grouped(render.voxels()));
        format!("{scene} {with}: {extent} = {voxels} voxels, {shading}, {projection}")
    }

    fn totals(me: Ref<Self>, plan: &Plan, _: &[Counts]) -> Totals {
        Totals { voxels: plan[me].voxels(), ..Totals::default() }
    }

    /// Makes the picture, if some file of it isn't there yet, and its files with it.
    fn run<const D: usize>(me: Ref<Self>, run: &mut Run, scene: &mut SceneRun<D>) -> Result<Told, StageError> {
        let plan = run.plan;
        if !is_stale(me, plan, &|file| run.is_stale(file)) {
            return Ok("as it was".into());
        }
        let render = &plan[me];
        if let Some(joined) = run.joined.clone() {
            return join(me, &joined, run, scene);
        }
        // There is none only if nothing is stale.
        let slab = plan.piece.and_then(|piece| piece.layers(render.dimensions[2], me.nth()));
        let first_layer = slab.as_ref().map_or(0, |slab| slab.own.start);
        if let Some(occlusion) = render.occlusion.filter(|_| render.shading != Shading::Voxel) {
            occlusion::values(occlusion, run, scene)?;
        }
        let skylight = scene.skylight(render.occlusion, render.light_asked(&render.arrays), run)?;
        let name = format!("render {}", plan.id(me));
        let made = render.picture((&name, slab), plan, scene, skylight, run.progress, |grid, hash| {
            PictureFiles::create(me, run, grid, first_layer, hash)
        })?;
        run.work.voxels += made.voxels;
        let mut notes: Vec<String> =
            made.nothing.iter().map(|why| format!("{name} shows background only: {why}")).collect();
        notes.extend(made.in_vain.iter().map(|told| format!("{name}: {told}")));
        if let Some(light) = &made.light {
            let rays = format!("{} of the {} rays", grouped(light.behind), grouped(light.hits));
            notes.extend(light.notes(&rays).iter().map(|told| format!("{name}: {told}")));
        }
        notes.extend(from_behind(plan.id(me), made.behind, made.seen));
        for (file, bytes) in made.files {
            if let Some(record) = &made.record {
                // Of the files of a picture only `.vti` tell how far off it is.
                let checked =
                    if file.extension().is_some_and(|e| e == "vti") { record.checked.clone() } else { Vec::new() };
                let (path, record) = (piece::record_of(&file), Record { checked, ..record.clone() });
                let bytes = write_whole(&plan.out.join(&path), record.to_json().as_bytes())?;
                run.made_beside(&path, bytes)?;
            }
            run.made(&file, bytes, notes.clone())?;
        }
        let rate = made.voxels as f64 / made.rendering.as_secs_f64();
        let own = made.record.map_or(render.voxels(), |record| {
            (record.layers[1] - record.layers[0]) as u64 * render.voxels() / render.dimensions[2] as u64
        });
        let how = format!("{:.2} million voxels a second", rate / 1e6);
        let mut told = seen(made.seen, own, &how, made.accuracy);
        told.numbers.insert("voxels_per_second".to_owned(), rate.into());
        Ok(told)
    }
}

/// Makes the files of a picture of the parts of all pieces.
fn join<const D: usize>(
    me: Ref<RenderPlan>,
    joined: &Joined,
    run: &mut Run,
    scene: &SceneRun<D>,
) -> Result<Told, StageError> {
    let (plan, render, name) = (run.plan, &run.plan[me], format!("render {}", run.plan.id(me)));
    let running = run.progress.stage(&name, render.voxels());
    let grid = render.grid(plan)?;
    let audit = render.audit(plan).map(Audit::<D>::new);
    let made = write::join(me, joined, run, (&grid, scene.session.mesh_hash()), audit, |audit| {
        Ok(audit.finish(&**scene.session.backend(), run.progress)?)
    })?;
    running.end();
    let mut notes: Vec<String> = from_behind(plan.id(me), made.behind, made.seen).into_iter().collect();
    if made.seen == 0 && !scene.session.mesh().simplices.is_empty() {
        let picture = scene.session.renderer(camera::camera(&render.camera)?, render.dimensions, Shaded::None);
        notes.push(format!("{name} shows background only: {}", nothing_seen(&picture)));
    }
    for (file, bytes) in made.files {
        run.made(&file, bytes, notes.clone())?;
    }
    Ok(seen(made.seen, render.voxels(), &format!("joined of {} pieces", joined.count()), made.accuracy))
}

/// What is told of voxels that see a surface from behind.
fn from_behind(id: &str, behind: u64, seen: u64) -> Option<String> {
    (behind > 0).then(|| {
        format!(
            "render {id}: {} of the {} voxels that see something see a surface from behind, with the occlusion of its front; \
             turn that object by `orientation: eye`, or take `shading: voxel`",
            grouped(behind),
            grouped(seen)
        )
    })
}

/// What is told of a picture: how many voxels see something, how it was made, and how far off it is, where that is known.
fn seen(seen: u64, voxels: u64, how: &str, accuracy: Option<Accuracy>) -> Told {
    let mut text = format!("{} of {} voxels see something, {how}", grouped(seen), grouped(voxels));
    let mut numbers = json!({ "seen": seen, "voxels": voxels });
    if let Some(Accuracy { rms, largest, voxels }) = accuracy {
        text += &format!(", off by {} ({} at most of {voxels} voxels)", short(rms), short(largest));
        numbers["off"] = json!({ "rms": rms, "largest": largest, "voxels": voxels });
    }
    Told::new(text, numbers)
}

/// Why nothing is known of the directions in which the sky is open, if so.
fn no_directions(plan: &Plan, scene: Ref<ScenePlan>, occlusion: Option<Ref<OcclusionPlan>>) -> Option<String> {
    if let Some(name) = plan[scene].translucent() {
        return Some(format!(
            "{name} lets light through, and where the sky is open is found among opaque objects only; leave out `opacity` \
             there"
        ));
    }
    occlusion.and_then(|occlusion| plan[occlusion].no_directions())
}

/// Whether some file has to be made that holds voxels of a render.
pub(super) fn is_stale(me: Ref<RenderPlan>, plan: &Plan, stale: &dyn Fn(&Path) -> bool) -> bool {
    let mut writes = plan.all::<WritePlan>().filter(|(_, write)| write.render == me);
    writes.any(|(_, write)| !write.stale(Content::Voxels, stale).is_empty())
}

/// The rays that each voxel takes with this shading; none where it takes none, or as many as it needs.
fn rays(occlusion: &OcclusionPlan, shading: Shading, dimension: Dimension, tolerance: f64) -> Option<Sampling> {
    match shading {
        Shading::Auto => occlusion.at_voxels(dimension, tolerance),
        Shading::Voxel => occlusion.instead_of_vertices(),
        Shading::Smooth | Shading::Flat => None,
    }
}

/// The rays that each voxel of a render takes.
pub(super) fn rays_of(plan: &Plan, render: &RenderPlan) -> Option<Sampling> {
    let tolerance = render.tolerance.unwrap_or(TOLERANCE);
    rays(&plan[render.occlusion?], render.shading, plan[render.scene].dimension, tolerance)
}

/// How occlusion is looked for in the image itself, if it is.
fn screen_space(spec: &RenderSpec, path: &str, resolver: &mut Resolver) -> Result<Option<ScreenSpacePlan>, Invalid> {
    let plan = screen_space::plan(spec.screen_space.as_ref(), &format!("{path}.{}", screen_space::WORD))?;
    if spec.occlusion.as_deref() != Some(screen_space::WORD) {
        if spec.screen_space.is_some() {
            resolver.warn(format!("{path}.screen_space"), "has no effect without `occlusion: screen_space`");
        }
        return Ok(None);
    }
    if spec.shading.is_some() {
        resolver.warn(format!("{path}.shading"), "has no effect with `occlusion: screen_space`");
    }
    Ok(Some(plan))
}

/// The standard error that a voxel may have.
fn tolerance(path: &str, given: Option<f64>) -> Result<f64, Invalid> {
    match given {
        None => Ok(TOLERANCE),
        Some(t) if t > 0.0 && t < 1.0 => Ok(t),
        Some(t) => Err(Invalid::new(path, format!("expected an error above 0 and below 1, found {}", number(t)))),
    }
}

/// An error to two digits, as far as there are four places.
fn short(error: f64) -> String {
    if error < 5e-5 { "less than 0.0001".to_owned() } else { format!("{error:.4}") }
}

impl Shading {
    /// As the pipeline names it.
    pub fn as_str(self) -> &'static str {
        match self {
            Shading::Smooth => "smooth",
            Shading::Flat => "flat",
            Shading::Voxel => "voxel",
            Shading::Auto => "auto",
        }
    }
}

fn dimensions(path: &str, given: &[u64], dimension: Dimension) -> Result<[usize; 3], Invalid> {
    let three = match (dimension, given) {
        (Dimension::Three, &[x, y]) | (Dimension::Three, &[x, y, 1]) => [x, y, 1],
        (Dimension::Four, &[x, y, z]) => [x, y, z],
        (Dimension::Three, _) => {
            let message = format!("expected [WIDTH, HEIGHT] for a 3D scene, found {given:?}");
            return Err(Invalid::new(path, message));
        }
        (Dimension::Four, _) => {
            let message = format!("expected [WIDTH, HEIGHT, DEPTH] for a 4D scene, found {given:?}");
            return Err(Invalid::new(path, message));
        }
    };
    for (i, &n) in three.iter().enumerate() {
        if !(1..=MAX_DIMENSION).contains(&n) {
            return Err(Invalid::new(format!("{path}[{i}]"), format!("expected 1 to {MAX_DIMENSION}, found {n}")));
        }
    }
    // 48 bits of voxels at most, 46 bytes each at most: fits 64 bits. Whether it fits memory and disk is for the run.
    let three = three.map(|n| usize::try_from(n).unwrap_or(usize::MAX));
    match three.iter().try_fold(64_usize, |bytes, &n| bytes.checked_mul(n)) {
        Some(_) => Ok(three),
        None => Err(Invalid::new(path, "more voxels than this computer can address")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::{Document, Pipeline};
    use crate::stages::paraview::FigurePlan;

    const SCENES: &str = "name: p
stages:
  - scene: {id: a, objects: []}
  - occlusion: {id: ao-a, file: a.f32}
  - scene: {id: b, dimension: 3, objects: []}
";

    fn pipeline(stages: &str) -> Result<Pipeline, String> {
        let document = Document::parse("p.yaml", &format!("{SCENES}{stages}")).unwrap();
        Pipeline::from_document(document, &[], None).map_err(|e| e.to_string())
    }

    /// The ids of what the last render shows and is darkened by, or the refusal without its place.
    fn resolved(stages: &str) -> String {
        match pipeline(stages) {
            Err(message) => message.split_once(": ").unwrap().1.to_owned(),
            Ok(Pipeline { plan, .. }) => {
                let (_, render) = plan.all::<RenderPlan>().next_back().unwrap();
                let occlusion = render.occlusion.map_or("none", |o| plan.id(o));
                format!("{} {occlusion}", plan.id(render.scene))
            }
        }
    }

    #[test]
    fn scenes_and_occlusions_find_each_other() {
        let nearest = "stages[3].render: the nearest scene is `b`, but the nearest occlusion (`ao-a`) is of scene `a`; \
             say `occlusion: none`, or which by `input`";
        let foreign = "stages[3].render.occlusion: `ao-a` is the occlusion of scene `a`, and `input` shows scene `b`";
        for (render, expected) in [
            ("{dimensions: [2, 2]}", nearest),
            ("{dimensions: [2, 2], occlusion: none}", "b none"),
            ("{dimensions: [2, 2], input: b}", "b none"),
            ("{dimensions: [2, 2, 2], input: a}", "a ao-a"),
            ("{dimensions: [2, 2, 2], input: ao-a}", "a ao-a"),
            ("{dimensions: [2, 2, 2], occlusion: ao-a}", "a ao-a"),
            ("{dimensions: [2, 2, 2], input: ao-a, occlusion: none}", "a none"),
            ("{dimensions: [2, 2], input: b, occlusion: ao-a}", foreign),
        ] {
            assert_eq!(resolved(&format!("  - render: {render}\n")), expected, "{render}");
        }
        assert_eq!(resolved("  - occlusion: {}\n  - render: {dimensions: [2, 2, 1]}\n"), "b occlusion-2");
        assert_eq!(
            resolved("  - occlusion: {id: x, input: a}\n  - render: {dimensions: [2, 2, 2], input: a}\n"),
            "a x"
        );
    }

    #[test]
    fn images_are_supersampled_unless_they_are_large_or_lit() {
        for (render, expected) in [
            ("{dimensions: [270, 270, 270], input: a}", 3),
            ("{dimensions: [271, 271, 271], input: a}", 1),
            ("{dimensions: [21845, 100], input: b}", 3),
            ("{dimensions: [21846, 100], input: b}", 1),
            ("{dimensions: [9, 9, 9], input: a, lights: [{direction: [0, -1, 0, 0]}]}", 1),
            ("{dimensions: [9, 9, 9], input: a, ambient: 1}", 3),
            ("{dimensions: [9, 9, 9], input: a, supersample: 2}", 2),
        ] {
            let plan = pipeline(&format!("  - render: {render}\n")).unwrap().plan;
            assert_eq!(plan.all::<RenderPlan>().next().unwrap().1.supersample, expected, "{render}");
        }
    }

    #[test]
    fn a_render_gathers_what_its_files_need() {
        let plan = pipeline(
            "  - render: {id: r, input: a, dimensions: [2, 3, 4], camera: {eye: [0, 0, 0, 2]}}
  - render: {input: a, dimensions: [2, 3, 4], camera: {eye: [0, 0, 0, 3]}}
  - write: {input: r, raw: r.raw, arrays: [depth]}
  - write: {input: r, vti: r.vti, arrays: [opacity, rgba, normal]}
  - paraview: {input: r, state: vti.py}
  - paraview: {input: [r, r], state: raw.py, reader: raw}
",
        )
        .unwrap();
        let warnings: Vec<String> = plan.warnings().map(|w| w.to_string()).collect();
        let plan = plan.plan;
        let (renders, figures): (Vec<_>, Vec<_>) =
            (plan.all::<RenderPlan>().collect(), plan.all::<FigurePlan>().map(|(_, figure)| figure).collect());
        let scenes: Vec<_> = plan.all::<ScenePlan>().map(|(_, scene)| scene).collect();
        // As JSON a write is its number.
        let nth = |figure: &FigurePlan| serde_json::to_value(&figure.writes).unwrap();
        let arrays: Vec<&str> = renders[0].1.arrays.iter().map(|array| array.name()).collect();
        assert_eq!(arrays, ["rgba", "opacity", "rgb", "normal"]);
        assert_eq!((nth(figures[0]), nth(figures[1])), (json!([1]), json!([0, 0])));
        assert_eq!(scenes[0].eye, Some(vec![0.0, 0.0, 0.0, 2.0]), "the first render's");
        assert_eq!(scenes[1].eye, None);
        assert_eq!(plan.all::<WritePlan>().map(|(write, _)| plan.id(write)).collect::<Vec<_>>(), ["write", "write-2"]);
        let files: Vec<_> = plan.files().iter().map(|file| file.to_str().unwrap()).collect();
        assert_eq!(files, ["a.f32", "r.raw", "r.vti", "vti.py", "raw.py"]);
        assert!(
            warnings.iter().any(|w| w == "p.yaml:7:13: stages[4].render: no `write` stage writes this image"),
            "{warnings:?}"
        );
        assert!(warnings.iter().any(|w| w.ends_with("write.arrays: has no effect without `vti`")), "{warnings:?}");
    }
}
