//! `animate`: a render again and again while something moves: the eye, the whole scene, or some of its objects.
//!
//! Each frame is a `.vti` such as a `write` leaves, of the picture that a render with that frame's camera, or of a scene
//! whose objects stand where they are by then, would make: the same bits. A `.pvd` lists them with their times, so that
//! ParaView plays them; a `paraview` stage shows them.
//!
//! Occlusion belongs to the scene, not to who looks at it. Where only the eye moves, or all objects together, the values
//! at vertices are computed once for all frames; where objects move among others, once a frame.

mod path;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use self::path::PathKeys;
use super::describe::{Counts, Totals, grouped, size};
use super::occlusion::{self, OcclusionPlan, OcclusionSource};
use super::picture::Picture;
use super::piece::Piece;
use super::render::{RenderPlan, Shading};
use super::scene::{Bodies, ScenePlan};
use super::write::{self, Compression, Encoding, Files, Format, PictureFiles, WritePlan};
use super::{
    Invalid, Keys, LeftOut, Needs, OneOrMany, Output, Plan, Ref, Resolver, Run, SceneRun, Stage, StageError, Told,
};
use super::{names, suggest};
use crate::io::{self, AtomicFile, pvd};
use crate::occlusion::Cancelled;
use crate::progress::Progress;
use crate::render::{Aov, Skylight};
use crate::text::number;

pub use path::{Motion, MoveSpec, PathPlan, TurnSpec};

/// The most frames: their numbers have four digits.
const MOST: u64 = 10_000;
/// The most frames that are made at once.
const MOST_AT_ONCE: usize = 4;
/// Frames a second where nothing else is said.
const RATE: f64 = 24.0;
/// Said where it lacks a render.
const MISSING: &str = "there is no earlier `render` to animate; put one first";

/// A render again and again while something moves.
#[derive(Clone, Debug, Deserialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct AnimateSpec {
    /// A name for later stages to refer to.
    pub id: Option<String>,
    /// The render, by its id (default: the nearest earlier one).
    pub input: Option<String>,
    /// How many frames.
    #[schemars(range(min = 1, max = 10_000))]
    pub frames: u64,
    /// What moves: `eye` (default), which takes its target with it; `scene`, all of it; or the names of objects.
    pub moves: Option<OneOrMany>,
    /// A turn in a plane.
    pub turn: Option<TurnSpec>,
    /// A motion along a line, after the turn.
    pub r#move: Option<MoveSpec>,
    /// How far it is moved along the last axis, w in 4D, at the first frame and at the last.
    pub scan: Option<[f64; 2]>,
    /// Frames a second, of which the times in the `.pvd` are made (default 24).
    pub rate: Option<f64>,
    /// The files: `NAME.vti` makes `NAME_0000.vti`, `NAME_0001.vti`, ... and `NAME.pvd`.
    pub vti: String,
    /// What each `.vti` holds (default `[rgba, ambient_occlusion, opacity]`).
    pub arrays: Option<Vec<Aov>>,
    /// How each `.vti` stores numbers (default `appended`).
    pub encoding: Option<Encoding>,
    /// How each `.vti` packs them (default `none`).
    pub compression: Option<Compression>,
}

/// What moves.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Moves {
    /// The eye, and its target with it.
    Eye,
    /// All objects.
    Scene,
    /// These objects, but not all, by their number in the scene.
    Objects(Vec<usize>),
}

/// An animation, as understood.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AnimatePlan {
    /// The picture.
    pub render: Ref<RenderPlan>,
    /// The scene it shows.
    pub scene: Ref<ScenePlan>,
    /// The occlusion that darkens it.
    pub occlusion: Option<Ref<OcclusionPlan>>,
    /// What moves.
    pub moves: Moves,
    /// How.
    pub path: PathPlan,
    /// Frames a second.
    pub rate: f64,
    /// The file of each frame, below `out`.
    pub files: Vec<PathBuf>,
    /// The list of them.
    #[serde(serialize_with = "super::describe::path")]
    pub list: PathBuf,
    /// What each file holds, in this order.
    pub arrays: Vec<Aov>,
    /// Whether the pipeline says which; else figures may add what they need.
    pub arrays_given: bool,
    /// How it stores numbers.
    pub encoding: Encoding,
    /// How it packs them.
    pub compression: Compression,
}

impl AnimatePlan {
    /// Where the path is at a frame.
    pub fn motion(&self, frame: usize) -> Motion {
        self.path.at(frame, self.files.len())
    }

    /// The render of a frame, as far as it isn't the scene that moves among itself.
    pub fn render(&self, frame: usize, plan: &Plan) -> RenderPlan {
        let render = &plan[self.render];
        let motion = self.motion(frame);
        match self.moves {
            Moves::Eye => RenderPlan { camera: motion.camera(&render.camera), ..render.clone() },
            Moves::Scene => RenderPlan {
                camera: motion.undone(&render.camera),
                lighting: render.lighting.as_ref().map(|lighting| motion.undone_lights(lighting)),
                ..render.clone()
            },
            Moves::Objects(_) => render.clone(),
        }
    }

    /// What a `write` with the same keys would be.
    fn write(&self) -> WritePlan {
        let (render, arrays, arrays_given) = (self.render, self.arrays.clone(), self.arrays_given);
        let (encoding, compression) = (self.encoding, self.compression);
        WritePlan { render, files: Files::default(), arrays, arrays_given, encoding, compression }
    }

    /// The times of the frames, in seconds.
    fn times(&self) -> impl Iterator<Item = f64> {
        (0..self.files.len()).map(|i| i as f64 / self.rate)
    }

    /// Whether its pictures show the values at vertices.
    fn shows_values(&self, plan: &Plan) -> bool {
        self.occlusion.is_some() && plan[self.render].shading != Shading::Voxel
    }

    /// Bytes of all files' numbers before compression.
    fn bytes(&self, plan: &Plan) -> u64 {
        let voxel = Format::Vti.voxel_bytes(&self.write(), write::Image::of(plan, &plan[self.render]));
        plan[self.render].voxels().saturating_mul(voxel).saturating_mul(self.files.len() as u64)
    }
}

impl Stage for AnimatePlan {
    type Spec = AnimateSpec;
    const KIND: &'static str = "animate";
    const LIST: &'static str = "animations";
    const LEFT_OUT: &'static [LeftOut] = &[
        LeftOut::new("/render", "the key of the render itself takes part"),
        LeftOut::new("/scene", "the key of the render has that of the scene"),
        LeftOut::new("/occlusion", "the key of the render has that of the occlusion"),
        LeftOut::new("/path", "each frame's key has where the path is by then"),
        LeftOut::new("/rate", "the times stand in the list, whose key has them"),
        LeftOut::new("/files", "a frame doesn't depend on its file's name; the list of them has its own key"),
        LeftOut::new("/list", "a file doesn't depend on its name"),
        LeftOut::new("/arrays_given", "decides what figures add to the arrays; what they are in the end takes part"),
    ];

    fn id(spec: &AnimateSpec) -> Option<&str> {
        spec.id.as_deref()
    }

    fn resolve(spec: &AnimateSpec, path: &str, resolver: &mut Resolver) -> Result<Self, Invalid> {
        let render: Ref<RenderPlan> = resolver.input(path, spec.input.as_deref(), MISSING)?;
        let RenderPlan { scene, occlusion, camera, .. } = resolver.plan[render].clone();
        if !(1..=MOST).contains(&spec.frames) {
            let message = format!("expected 1 to {MOST} frames, found {}", spec.frames);
            return Err(Invalid::new(format!("{path}.frames"), message));
        }
        let moves = moves(spec.moves.as_ref(), &format!("{path}.moves"), &resolver.plan[scene])?;
        if let (Moves::Objects(_), Some(occlusion)) = (&moves, occlusion)
            && let OcclusionSource::Load(_) = resolver.plan[occlusion].source
        {
            let message = format!(
                "where objects move among others their occlusion changes, and `{}` is loaded from a file; let it be computed",
                resolver.plan.id(occlusion)
            );
            return Err(Invalid::new(format!("{path}.moves"), message));
        }
        let keys = PathKeys { turn: spec.turn.as_ref(), r#move: spec.r#move.as_ref(), scan: spec.scan };
        let dimension = resolver.plan[scene].dimension;
        let along = PathPlan::new(&keys, path, dimension, &camera.target, &mut resolver.plan.warnings)?;
        let rate = spec.rate.unwrap_or(RATE);
        if !(0.001..=1000.0).contains(&rate) {
            let message = format!("expected 0.001 to 1000 frames a second, found {}", number(rate));
            return Err(Invalid::new(format!("{path}.rate"), message));
        }
        let arrays = write::arrays(spec.arrays.as_deref(), path, render, resolver)?;
        let key = format!("{path}.vti");
        let whole = resolver.outputs.claim(&key, &spec.vti, Some("vti"))?;
        let stem = whole.with_extension("").to_string_lossy().into_owned();
        let mut claim = |name: String| resolver.outputs.claim(&key, &name, None);
        let files: Result<_, _> = (0..spec.frames).map(|i| claim(format!("{stem}_{i:04}.vti"))).collect();
        let list = claim(format!("{stem}.pvd"))?;
        Ok(Self {
            render,
            scene,
            occlusion,
            moves,
            path: along,
            rate,
            files: files?,
            list,
            arrays,
            arrays_given: spec.arrays.is_some(),
            encoding: spec.encoding.unwrap_or_default(),
            compression: spec.compression.unwrap_or_default(),
        })
    }

    fn works_on(&self) -> Vec<usize> {
        vec![self.render.index()]
    }

    fn scene(me: Ref<Self>, plan: &Plan) -> Option<Ref<ScenePlan>> {
        Some(plan[me].scene)
    }

    /// All vertices may come into sight.
    fn wants_values(&self, occlusion: usize) -> bool {
        !matches!(self.moves, Moves::Objects(_)) && self.occlusion.is_some_and(|own| own.index() == occlusion)
    }

    fn files(&self) -> Vec<&Path> {
        self.files.iter().chain([&self.list]).map(PathBuf::as_path).collect()
    }

    fn outputs(me: Ref<Self>, plan: &Plan, keys: &Keys) -> Vec<Output> {
        let animation = &plan[me];
        let key = keys.of(me.index());
        let frame = |(i, file): (usize, &PathBuf)| {
            let key = keys.hash(&(key, animation.motion(i), keys.provenance()));
            Output::alone(file, key)
        };
        let mut outputs: Vec<Output> = animation.files.iter().enumerate().map(frame).collect();
        let times: Vec<f64> = animation.times().collect();
        let key = keys.hash(&(key, names::file_names(&animation.files), times));
        outputs.push(Output { beside: Vec::new(), key, tells: None, file: animation.list.clone() });
        outputs
    }

    /// A share of the frames, each whole. The list is made when all are there.
    fn parts(me: Ref<Self>, plan: &Plan, keys: &Keys, piece: Piece) -> Vec<Output> {
        let own = piece.share(plan[me].files.len());
        Self::outputs(me, plan, keys).into_iter().skip(own.start).take(own.len()).collect()
    }

    fn pictures(me: Ref<Self>, plan: &Plan, piece: Piece) -> Option<Vec<(PathBuf, RenderPlan)>> {
        let animation = &plan[me];
        let frame = |i: usize| (animation.files[i].clone(), animation.render(i, plan));
        Some(piece.share(animation.files.len()).map(frame).collect())
    }

    fn retell(me: Ref<Self>, plan: &Plan, output: &Path, text: &str) -> Result<u64, io::Error> {
        match Format::Vti.retell() {
            Some(retell) => retell(&plan.out.join(output), &plan[me].write(), text),
            None => Ok(0),
        }
    }

    fn written(me: Ref<Self>, plan: &Plan) -> Value {
        let Self { rate, encoding, compression, arrays, arrays_given, .. } = &plan[me];
        let mut written = json!({ "rate": rate, "encoding": encoding, "compression": compression });
        // Else figures add to them, and do so again.
        if *arrays_given {
            written["arrays"] = json!(arrays);
        }
        written
    }

    fn needs(me: Ref<Self>, plan: &Plan, stale: &dyn Fn(&Path) -> bool) -> Needs {
        let animation = &plan[me];
        let (render, write) = (&plan[animation.render], animation.write());
        let frames = animation.files.iter().filter(|file| stale(file)).count() as u64;
        if frames == 0 {
            return Needs::default();
        }
        let aovs: BTreeSet<Aov> = animation.arrays.iter().copied().collect();
        let frame = render.voxels().saturating_mul(Format::Vti.disk_bytes(&write, write::Image::of(plan, render)));
        let needs = render.memory(plan, &aovs);
        let alone = render.screen_space.is_some() || matches!(animation.moves, Moves::Objects(_));
        let at_once = if alone { 1 } else { frames.min(MOST_AT_ONCE as u64) };
        let memory = needs.memory.saturating_mul(at_once);
        Needs { memory, disk: frame.saturating_mul(frames), ..needs }
    }

    fn line(me: Ref<Self>, plan: &Plan, _: &[Counts]) -> String {
        let animation = &plan[me];
        let Self { render, scene, moves, path, files, list, compression, .. } = animation;
        let what = match moves {
            Moves::Eye => "the eye".to_owned(),
            Moves::Scene => "the scene".to_owned(),
            Moves::Objects(objects) => {
                let name = |&i: &usize| plan[*scene].objects[i].name.clone().unwrap_or_default();
                objects.iter().map(name).collect::<Vec<_>>().join(", ")
            }
        };
        let packed = if *compression == Compression::None { "" } else { " before compression" };
        let (frames, bytes) = (grouped(files.len() as u64), size(animation.bytes(plan)));
        let noun = if files.len() == 1 { "frame" } else { "frames" };
        let list = list.display();
        format!("{}, {what} {}, {frames} {noun} -> {list} ({bytes}{packed})", plan.id(*render), path.line())
    }

    fn totals(me: Ref<Self>, plan: &Plan, counts: &[Counts]) -> Totals {
        let animation = &plan[me];
        let Self { render, occlusion, moves, files, .. } = animation;
        let frames = files.len() as u64;
        // Where objects move, each frame has rays of its own.
        let again = occlusion.filter(|_| matches!(moves, Moves::Objects(_)) && animation.shows_values(plan));
        let rays = again.map_or(Some(0), |occlusion| occlusion::rays(occlusion, plan, counts));
        Totals {
            occlusion_rays: rays.map(|rays| rays.saturating_mul(frames)),
            voxels: plan[*render].voxels().saturating_mul(frames),
            bytes: animation.bytes(plan),
        }
    }

    fn run<const D: usize>(me: Ref<Self>, run: &mut Run, scene: &mut SceneRun<D>) -> Result<Told, StageError> {
        let plan = run.plan;
        let animation = &plan[me];
        let stale: Vec<usize> = (0..animation.files.len()).filter(|&i| run.is_stale(&animation.files[i])).collect();
        let mut made = Sum::default();
        if let Some(joined) = run.joined.clone() {
            for &i in &stale {
                let file = &animation.files[i];
                let Some(part) = joined.whole(file, i, animation.files.len()) else { continue };
                let bytes = write::vti::take(&part, &plan.out.join(file), animation.encoding, run.told)?;
                run.made(file, bytes, Vec::new())?;
            }
        } else if !stale.is_empty() {
            match &animation.moves {
                Moves::Objects(objects) => move_objects(me, objects, &stale, run, scene, &mut made)?,
                _ => {
                    if let Some(occlusion) = animation.occlusion.filter(|_| animation.shows_values(plan)) {
                        occlusion::values(occlusion, run, scene)?;
                    }
                    let mut light = None;
                    for together in stale.chunks(at_once(&plan[animation.render], scene)) {
                        let mut asked = Vec::new();
                        for &i in together {
                            let render = animation.render(i, plan);
                            // The light of other surfaces is another where the scene turns below its sky.
                            let sky = render.lighting.as_ref().and_then(|lighting| lighting.sky.clone());
                            let skylight = match light.take() {
                                Some((known, skylight)) if known == sky => skylight,
                                _ => scene.skylight(render.occlusion, render.light_asked(&animation.arrays), run)?,
                            };
                            light = Some((sky, skylight.clone()));
                            asked.push((i, render, skylight));
                        }
                        frames(me, asked, run, scene, &mut made)?;
                    }
                }
            }
        }
        if run.is_stale(&animation.list) {
            let path = plan.out.join(&animation.list);
            let mut file = AtomicFile::create(&path)?;
            let names = names::file_names(&animation.files);
            pvd::write(&mut file, animation.times().zip(names.iter().map(String::as_str)))
                .map_err(AtomicFile::name_in(&path))?;
            let bytes = file.commit()?;
            run.made(&animation.list, bytes, Vec::new())?;
        }
        if stale.is_empty() {
            return Ok("as it was".into());
        }
        if let Some(joined) = &run.joined {
            let text = format!("{} of {} frames, of {} pieces", stale.len(), animation.files.len(), joined.count());
            return Ok(Told::new(text, json!({ "made": stale.len(), "frames": animation.files.len() })));
        }
        let rate = made.voxels as f64 / made.rendering.as_secs_f64();
        let rays = match made.rays {
            0 => String::new(),
            rays => format!(", {} rays for occlusion at vertices, anew in each frame", grouped(rays)),
        };
        let (new, frames) = (stale.len(), animation.files.len());
        let text = format!("{new} of {frames} frames, {:.2} million voxels a second{rays}", rate / 1e6);
        let numbers = json!({ "made": new, "frames": frames, "voxels_per_second": rate, "rays": made.rays });
        Ok(Told::new(text, numbers))
    }
}

/// What was done for the frames so far.
#[derive(Default)]
struct Sum {
    voxels: u64,
    rendering: Duration,
    /// Rays for values at vertices.
    rays: u64,
}

impl Sum {
    /// Counts a frame, and remembers its file. The notes are worded alike for all frames, so that each is told once.
    fn add(&mut self, picture: Picture, name: &str, run: &mut Run) -> Result<(), StageError> {
        self.voxels += picture.voxels;
        run.work.voxels += picture.voxels;
        let mut notes = Vec::new();
        if let Some(why) = picture.nothing {
            notes.push(format!("{name}: some frames show background only: {why}"));
        }
        notes.extend(picture.in_vain.iter().map(|told| format!("{name}: in some frames {told}")));
        if let Some(light) = &picture.light {
            let told = light.notes("some of the rays");
            notes.extend(told.iter().map(|told| format!("{name}: in some frames {told}")));
        }
        if picture.behind > 0 {
            notes.push(format!(
                "{name}: in some frames voxels see a surface from behind, with the occlusion of its front; turn that object \
                 by `orientation: eye`, or let the render have `shading: voxel`"
            ));
        }
        for (file, bytes) in picture.files {
            run.made(&file, bytes, notes.clone())?;
        }
        Ok(())
    }
}

/// How many frames are made at once: as many as there are threads, since parts of a picture are made by one alone; but one where
/// it takes much memory, or a device is asked, which does one thing at a time.
fn at_once<const D: usize>(render: &RenderPlan, scene: &SceneRun<D>) -> usize {
    let alone = render.screen_space.is_some() || scene.session.is_on_opencl();
    if alone { 1 } else { rayon::current_num_threads().clamp(1, MOST_AT_ONCE) }
}

/// Makes some frames at once, each given with its render and its light.
fn frames<const D: usize>(
    me: Ref<AnimatePlan>,
    asked: Vec<(usize, RenderPlan, Option<Arc<Skylight<D>>>)>,
    run: &mut Run,
    scene: &SceneRun<D>,
    made: &mut Sum,
) -> Result<(), StageError> {
    let (plan, animation) = (run.plan, &run.plan[me]);
    let [first, last] = [asked.first(), asked.last()].map(|frame| frame.map_or(0, |frame| frame.0 + 1));
    let count = animation.files.len();
    let which = if first == last { format!("frame {first}") } else { format!("frames {first} to {last}") };
    let name = format!("animate {}, {which} of {count}", plan.id(me));
    let voxels: u64 = asked.iter().map(|(_, render, _)| 2 * render.voxels()).sum();
    let running = run.progress.stage(&name, voxels);
    let (write, within, told) = (animation.write(), Within(run.progress), run.told);
    let scene = &scene;
    let picture = |(i, render, skylight): (usize, RenderPlan, Option<Arc<Skylight<D>>>)| {
        render.picture((&name, None), plan, scene, skylight, &within, |grid, hash| {
            PictureFiles::frame(&animation.files[i], &write, &render, plan, told, grid, hash)
        })
    };
    let pictures: Vec<Result<Picture, StageError>> = asked.into_par_iter().with_max_len(1).map(picture).collect();
    made.rendering += running.end();
    let name = format!("animate {}", plan.id(me));
    // Those that are whole are remembered, also where another failed.
    let mut failed = None;
    for picture in pictures {
        match picture {
            Ok(picture) => made.add(picture, &name, run)?,
            Err(error) => failed = failed.or(Some(error)),
        }
    }
    failed.map_or(Ok(()), Err)
}

/// Counts the steps of frames that are made at once as those of the stage that is running.
struct Within<'p>(&'p dyn Progress);

impl Progress for Within<'_> {
    fn begin(&self, _stage: &str, _total: u64) {}

    fn advance(&self, steps: u64) {
        self.0.advance(steps);
    }

    fn end(&self) {}

    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

/// Makes frames in which these objects move among others: each has a scene of its own.
fn move_objects<const D: usize>(
    me: Ref<AnimatePlan>,
    objects: &[usize],
    stale: &[usize],
    run: &mut Run,
    scene: &SceneRun<D>,
    made: &mut Sum,
) -> Result<(), StageError> {
    let (plan, animation) = (run.plan, &run.plan[me]);
    let render = &plan[animation.render];
    let occlusion = animation.occlusion.filter(|_| animation.shows_values(plan));
    // None are loaded from files: that was refused.
    let computation = occlusion.and_then(|occlusion| match &plan[occlusion].source {
        OcclusionSource::Compute(computation) => Some((occlusion, computation)),
        OcclusionSource::Load(_) => None,
    });
    let progress = run.progress;
    let stopped = |invalid: Invalid| match progress.cancelled() {
        true => StageError::Cancelled(Cancelled),
        false => StageError::Invalid(invalid),
    };
    let bodies = Bodies::<D>::build(plan, animation.scene, progress).map_err(stopped)?;
    for &i in stale {
        let steps = animation.motion(i).steps();
        let mesh = bodies.moved(plan, objects, &steps, progress).map_err(stopped)?;
        let mut moved = SceneRun::new(scene.session.with_mesh(mesh));
        if let Some((occlusion, computation)) = computation {
            let name = format!("animate {}, frame {}", plan.id(me), i + 1);
            let found = occlusion::values_for((&name, render), computation, run, &moved)?;
            made.rays += found.rays;
            moved.values.insert(occlusion, Arc::new(found));
        }
        let skylight = moved.skylight(render.occlusion, render.light_asked(&animation.arrays), run)?;
        frames(me, vec![(i, render.clone(), skylight)], run, &moved, made)?;
    }
    Ok(())
}

/// What moves, checked against the scene.
fn moves(given: Option<&OneOrMany>, path: &str, scene: &ScenePlan) -> Result<Moves, Invalid> {
    let names = match given {
        None => return Ok(Moves::Eye),
        Some(OneOrMany::One(word)) if word == "eye" => return Ok(Moves::Eye),
        Some(OneOrMany::One(word)) if word == "scene" => return Ok(Moves::Scene),
        Some(names) => names,
    };
    let mut objects = Vec::new();
    for (name, index) in names.iter() {
        let Some(found) = scene.objects.iter().position(|object| object.name.as_deref() == Some(name)) else {
            let known = scene.objects.iter().filter_map(|object| object.name.as_deref());
            let message = format!("no object of the scene is called `{name}`, and it is neither `eye` nor `scene`");
            let message = suggest::unknown(&message, name, known.chain(["eye", "scene"]));
            return Err(Invalid::new(format!("{path}{index}"), message));
        };
        objects.push(found);
    }
    objects.sort_unstable();
    objects.dedup();
    match objects.len() {
        0 => Err(Invalid::new(path, "the list is empty; name an object, or say `eye` or `scene`")),
        // Among themselves nothing moves.
        n if n == scene.objects.len() => Ok(Moves::Scene),
        _ => Ok(Moves::Objects(objects)),
    }
}
