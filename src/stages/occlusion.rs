//! `occlusion`: ambient occlusion at the vertices of a scene, computed or read from a file.
//!
//! Values are computed when some file that has to be made needs them, and then only at vertices that some image shows,
//! unless a file wants them all. `NAME.f32` has the values, `NAME.f32.yaml` says what they are, and `NAME.error.f32` has
//! their standard errors, where the method has any.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use super::describe::{Counts, Totals, grouped};
use super::key::without;
use super::picture::mark_seen;
use super::piece::{self, Piece, Values};
use super::prepare::{Loaded, errors_path, kept, sidecar_path};
use super::range::positive;
use super::render::{self, RenderPlan};
use super::scene::{MISSING, ScenePlan};
use super::write::{self, PROGRAM, WritePlan, write_whole};
use super::{Invalid, Keys, LeftOut, Output, Plan, Ref, Resolver, Run, SceneRun, Stage, StageError, Told};
use crate::io;
use crate::occlusion::exact::{self, Budget};
use crate::occlusion::{self, Deviations, Estimates, Estimator, ProgramDeviations, Sidecar};
use crate::text::number;
use crate::trace::{Sampler, Sampling, Target};

/// The most samples a vertex.
pub const MAX_SAMPLES: u64 = 1 << 24;
/// The most pieces that a vertex's view may be cut into.
pub const MAX_CONES: u64 = 1_000_000_000;

/// Ambient occlusion at the vertices of a scene: 1 is open, 0 fully occluded.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct OcclusionSpec {
    /// A name for later stages to refer to.
    pub id: Option<String>,
    /// The scene, by its id.
    pub input: Option<String>,
    /// How it is computed (default `sobol`).
    pub method: Option<Method>,
    /// Rays a vertex (default 256); powers of two suit `sobol` best.
    #[schemars(range(min = 1, max = 16777216))]
    pub samples: Option<u64>,
    /// Instead of `samples`: take rays until the estimated error is below this.
    pub target_error: Option<f64>,
    /// With `target_error`: at most so many rays a vertex (default 65536).
    #[schemars(range(min = 1, max = 16777216))]
    pub max_samples: Option<u64>,
    /// With `exact`: at most so many convex pieces a vertex, of a microsecond each (default 10000000).
    #[schemars(range(min = 1, max = 1000000000))]
    pub max_cones: Option<u64>,
    /// Occluders further away than this don't count (default: all count); not with `exact`.
    pub max_distance: Option<f64>,
    /// Writes the values into this file, `NAME.f32`.
    pub file: Option<String>,
    /// Takes the values from this file, relative to the pipeline's folder, instead of computing them.
    pub load: Option<String>,
    /// Instead of the pipeline's seed.
    pub seed: Option<u64>,
}

/// How ambient occlusion is computed.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Owen-scrambled Sobol points, cosine-weighted.
    #[default]
    Sobol,
    /// Independent random rays, cosine-weighted.
    Random,
    /// In closed form where few simplices are to be seen, by Sobol points elsewhere.
    Adaptive,
    /// In closed form, without sampling noise.
    Exact,
    /// As the thesis published it, with its deviations from the definition, for its figures.
    AsPublished,
    /// As the thesis's program did it, which is not what its text says, for its figures.
    AsProgrammed,
}

/// Ambient occlusion at a scene's vertices, as understood.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OcclusionPlan {
    /// The scene it is of.
    pub scene: Ref<ScenePlan>,
    /// Where the values come from.
    pub source: OcclusionSource,
    /// The file they are written to, below `out`.
    pub file: Option<PathBuf>,
}

/// Where occlusion comes from.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum OcclusionSource {
    /// It is computed.
    Compute(Computation),
    /// It is read from a file, which existed when the plan was made.
    Load(#[serde(serialize_with = "super::describe::path")] PathBuf),
}

/// How occlusion is computed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Computation {
    /// By which method.
    pub method: Method,
    /// With how many rays.
    pub samples: Samples,
    /// For `exact`: the most convex pieces a vertex.
    pub max_cones: u64,
    /// Occluders further away don't count.
    pub max_distance: Option<f64>,
    /// What its random numbers start from.
    pub seed: u64,
}

/// How many rays a vertex sends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Samples {
    /// None: the method is exact.
    Exact,
    /// So many.
    Fixed(u64),
    /// As many as bring the estimated error below a bound.
    Target {
        /// The bound.
        error: f64,
        /// At most so many.
        max_samples: u64,
    },
}

impl Stage for OcclusionPlan {
    type Spec = OcclusionSpec;
    const KIND: &'static str = "occlusion";
    const LIST: &'static str = "occlusions";
    const LEFT_OUT: &'static [LeftOut] = &[
        LeftOut::new("/scene", "the key of the scene itself takes part"),
        LeftOut::new("/file", "values don't depend on where they are kept"),
        LeftOut::new("/source/load", "the content of the file takes part"),
        LeftOut::new("/source/compute/max_cones", "a bound on the work: within it values don't depend on it"),
    ];

    fn id(spec: &OcclusionSpec) -> Option<&str> {
        spec.id.as_deref()
    }

    fn resolve(spec: &OcclusionSpec, path: &str, resolver: &mut Resolver) -> Result<Self, Invalid> {
        let scene: Ref<ScenePlan> = resolver.input(path, spec.input.as_deref(), MISSING)?;
        // Checked also beside `load`, so that taking `load` out reveals no new mistakes.
        let computation = computation(path, spec, resolver)?;
        let method = computation.method;
        if let Some(object) = resolver.plan[scene].translucent().filter(|_| !method.knows_opacity()) {
            let message = format!(
                "`{}` knows opaque objects only, and light passes {object}; use `method: sobol`, or leave out its `opacity`",
                method.as_str()
            );
            return Err(Invalid::new(format!("{path}.method"), message));
        }
        let source = match &spec.load {
            None => OcclusionSource::Compute(computation),
            Some(name) => {
                let key = format!("{path}.load");
                let file = resolver.plan.folder.join(name);
                match crate::input::length(&file) {
                    Ok(_) if !name.is_empty() => {}
                    Err(cause) if file.exists() => {
                        return Err(Invalid::new(key, format!("can't read {}: {cause}", file.display())));
                    }
                    _ => return Err(Invalid::new(key, format!("there is no file {}", file.display()))),
                }
                let unused: Vec<&str> = written(spec).collect();
                if !unused.is_empty() {
                    resolver
                        .warn(&key, format!("the values come from the file, so {} has no effect", unused.join(", ")));
                }
                OcclusionSource::Load(file)
            }
        };
        let file = match &spec.file {
            None => None,
            Some(name) => {
                let key = format!("{path}.file");
                let file = resolver.outputs.claim(&key, name, Some("f32"))?;
                for beside in [sidecar_path(&file), errors_path(&file)] {
                    resolver.outputs.claim(&key, &beside.to_string_lossy(), None)?;
                }
                Some(file)
            }
        };
        Ok(Self { scene, source, file })
    }

    fn unused(me: Ref<Self>, plan: &Plan) -> Option<&'static str> {
        let shown = plan.all::<RenderPlan>().any(|(_, render)| render.occlusion == Some(me));
        let used = shown || (0..plan.stages.len()).any(|stage| plan.wants_values(stage, me.index()));
        (!used && plan[me].file.is_none()).then_some("no render uses this occlusion and no `file` keeps it")
    }

    fn works_on(&self) -> Vec<usize> {
        vec![self.scene.index()]
    }

    fn scene(me: Ref<Self>, plan: &Plan) -> Option<Ref<ScenePlan>> {
        Some(plan[me].scene)
    }

    fn input_files(&self, _: &Plan) -> Vec<PathBuf> {
        match &self.source {
            OcclusionSource::Load(file) => vec![file.clone(), sidecar_path(file), errors_path(file)],
            OcclusionSource::Compute(_) => Vec::new(),
        }
    }

    fn files(&self) -> Vec<&Path> {
        self.file.iter().map(PathBuf::as_path).collect()
    }

    fn files_beside(&self) -> Vec<PathBuf> {
        self.file.iter().flat_map(|file| [sidecar_path(file), errors_path(file)]).collect()
    }

    fn outputs(me: Ref<Self>, plan: &Plan, keys: &Keys) -> Vec<Output> {
        let Some(file) = &plan[me].file else { return Vec::new() };
        let beside = std::iter::once(sidecar_path(file)).chain(plan[me].errors_file()).collect();
        let (key, tells) = (keys.of(me.index()).to_owned(), Some(sidecar_path(file)));
        vec![Output { file: file.clone(), beside, key, tells }]
    }

    /// The values of a share of the vertices, if some file wants all of them.
    fn parts(me: Ref<Self>, plan: &Plan, keys: &Keys, _: Piece) -> Vec<Output> {
        let key = keys.hash(&(keys.of(me.index()), wants_directions(me, plan)));
        let part = || Output { file: piece::values_of(me.nth()), beside: Vec::new(), key, tells: None };
        wants_all(me, plan).then(part).into_iter().collect()
    }

    fn retell(_: Ref<Self>, plan: &Plan, output: &Path, text: &str) -> Result<u64, io::Error> {
        let path = plan.out.join(sidecar_path(output));
        let failed = |cause| io::Error::File { path: path.clone(), action: "be read", cause };
        let known = crate::input::read_text(&path).map_err(failed)?;
        let sidecar = Sidecar::from_yaml(&known).map_err(|e| failed(std::io::Error::other(e.to_string())))?;
        write_whole(&path, Sidecar { pipeline: Some(text.to_owned()), ..sidecar }.to_yaml().as_bytes())
    }

    fn written(me: Ref<Self>, plan: &Plan) -> Value {
        let OcclusionSource::Compute(computation) = &plan[me].source else { return Value::Null };
        let method = computation.method;
        match computation.samples {
            Samples::Exact => json!({ "method": method, "max_cones": computation.max_cones }),
            Samples::Fixed(samples) => json!({ "method": method, "samples": samples }),
            Samples::Target { max_samples, .. } => json!({ "method": method, "max_samples": max_samples }),
        }
    }

    fn line(me: Ref<Self>, plan: &Plan, counts: &[Counts]) -> String {
        let how = match &plan[me].source {
            OcclusionSource::Load(file) => format!("from {}", file.display()),
            OcclusionSource::Compute(computation) => {
                let method = computation.method.as_str();
                match computation.samples {
                    Samples::Exact => method.to_owned(),
                    Samples::Fixed(n) => format!("{method}, {} samples a vertex", grouped(n)),
                    Samples::Target { error, max_samples } => {
                        format!("{method}, error below {error}, at most {} samples a vertex", grouped(max_samples))
                    }
                }
            }
        };
        let rays = rays(me, plan, counts).filter(|&n| n > 0).map(|n| format!(", {} rays", grouped(n)));
        let file = plan[me].file.as_ref().map(|file| format!(" -> {}", file.display()));
        format!("of {}: {how}{}{}", plan.id(plan[me].scene), rays.unwrap_or_default(), file.unwrap_or_default())
    }

    fn totals(me: Ref<Self>, plan: &Plan, counts: &[Counts]) -> Totals {
        Totals { occlusion_rays: rays(me, plan, counts), ..Totals::default() }
    }

    fn show(fields: &mut Map<String, Value>) {
        if let Some(Value::Object(computation)) = fields["source"].get_mut("compute") {
            computation.shift_remove("max_cones");
        }
    }

    fn run<const D: usize>(me: Ref<Self>, run: &mut Run, scene: &mut SceneRun<D>) -> Result<Told, StageError> {
        let plan = run.plan;
        if plan.piece.is_some() {
            if run.is_stale(&piece::values_of(me.nth())) {
                values(me, run, scene)?;
            }
            return Ok(Told::default());
        }
        let Some(file) = plan[me].file.as_deref() else { return Ok(Told::default()) };
        if !run.is_stale(file) {
            return Ok("as it was".into());
        }
        let start = Instant::now();
        values(me, run, scene)?;
        let found = Arc::clone(&scene.values[&me]);
        let detail = rate(&found, start.elapsed());
        let sidecar = match (&plan[me].source, run.loaded.get(&me)) {
            (OcclusionSource::Compute(computation), _) => sidecar(&found, computation, scene.session.mesh_hash()),
            (OcclusionSource::Load(_), Some(loaded)) => loaded.sidecar.clone(),
            (OcclusionSource::Load(_), None) => return Ok(Told::default()),
        };
        let sidecar = Sidecar { pipeline: Some(run.told.to_owned()), ..sidecar };
        // The values last: they are what others look for.
        let _together = io::together();
        match plan[me].errors_file() {
            Some(errors) => {
                let bytes = write_whole(&plan.out.join(&errors), &occlusion::encode(&found.errors))?;
                run.made_beside(&errors, bytes)?;
            }
            None => remove(run, &errors_path(file))?,
        }
        let beside = sidecar_path(file);
        let bytes = write_whole(&plan.out.join(&beside), sidecar.to_yaml().as_bytes())?;
        run.made_beside(&beside, bytes)?;
        let bytes = write_whole(&plan.out.join(file), &occlusion::encode(&found.values))?;
        run.made(file, bytes, Vec::new())?;
        Ok(detail)
    }
}

/// Takes away what an earlier run left and this one has none of, such as the errors of another method.
fn remove(run: &mut Run, file: &Path) -> Result<(), StageError> {
    let path = run.plan.out.join(file);
    match std::fs::remove_file(&path) {
        Ok(()) => Ok(run.ledger.forget(file)?),
        Err(cause) if cause.kind() == std::io::ErrorKind::NotFound => Ok(()),
        Err(cause) => Err(io::Error::File { path, action: "be removed", cause }.into()),
    }
}

impl OcclusionPlan {
    /// Whether its values are read from a file.
    pub fn is_loaded(&self) -> bool {
        matches!(self.source, OcclusionSource::Load(_))
    }

    /// Where the standard errors of the values are kept: in `NAME.error.f32` beside `NAME.f32`. None if there is no file,
    /// or no error.
    fn errors_file(&self) -> Option<PathBuf> {
        let known = match &self.source {
            OcclusionSource::Compute(computation) => computation.samples != Samples::Exact,
            OcclusionSource::Load(file) => errors_path(file).is_file(),
        };
        self.file.as_ref().filter(|_| known).map(|file| errors_path(file))
    }
}

/// Rays of an occlusion, where they are known: at most so many for a target error.
pub(super) fn rays(me: Ref<OcclusionPlan>, plan: &Plan, counts: &[Counts]) -> Option<u64> {
    let vertices = counts.get(plan[me].scene.nth())?.vertices;
    let each = match &plan[me].source {
        OcclusionSource::Load(_) => 0,
        OcclusionSource::Compute(computation) => match computation.samples {
            Samples::Exact => 0,
            Samples::Fixed(n) | Samples::Target { max_samples: n, .. } => n,
        },
    };
    Some(vertices.saturating_mul(each))
}

/// Makes sure that an occlusion's values are known.
///
/// # Errors
/// If they can't be computed, or Ctrl-C was pressed.
pub fn values<const D: usize>(
    me: Ref<OcclusionPlan>,
    run: &mut Run,
    scene: &mut SceneRun<D>,
) -> Result<(), StageError> {
    if scene.values.contains_key(&me) {
        return Ok(());
    }
    let plan = run.plan;
    let values = match &plan[me].source {
        OcclusionSource::Load(_) => {
            let take = |l: &mut Loaded| (std::mem::take(&mut l.values), std::mem::take(&mut l.errors));
            let (values, errors) = run.loaded.get_mut(&me).map(take).unwrap_or_default();
            Estimates { values, errors, rays: 0 }
        }
        OcclusionSource::Compute(computation) if plan.piece.is_some() => {
            let start = Instant::now();
            let found = in_piece(me, computation, run, scene)?;
            run.tell_early(me.index(), start.elapsed(), |took| rate(&found, took));
            found
        }
        OcclusionSource::Compute(computation) => {
            // A file that is still fresh holds the values already.
            let file = plan[me].file.as_deref().filter(|file| !run.is_stale(file));
            match file.and_then(|file| {
                kept(&plan.out.join(file), scene.session.mesh_hash(), scene.session.mesh().vertices.len())
            }) {
                Some(found) => found,
                None if run.joined.is_some() => {
                    let joined = run.joined.as_ref().map(|j| j.values(me.nth(), scene.session.mesh().vertices.len()));
                    let Values { values, errors, rays, .. } = joined.transpose()?.unwrap_or_default();
                    Estimates { values, errors, rays }
                }
                None => {
                    let start = Instant::now();
                    let found = compute(me, computation, run, scene)?;
                    run.tell_early(me.index(), start.elapsed(), |took| rate(&found, took));
                    found
                }
            }
        }
    };
    scene.values.insert(me, Arc::new(values));
    Ok(())
}

/// The values of another scene than the plan's, of which only this picture is made.
///
/// # Errors
/// If they can't be computed, or Ctrl-C was pressed.
pub(super) fn values_for<const D: usize>(
    picture: (&str, &RenderPlan),
    computation: &Computation,
    run: &mut Run,
    scene: &SceneRun<D>,
) -> Result<Estimates, StageError> {
    let count = scene.session.mesh().vertices.len();
    let mut left = computation.most_rays().saturating_mul(count as u64) / 4;
    let mut mask = vec![false; count];
    let mask = mark_seen(picture, run, scene, None, &mut left, &mut mask)?.then_some(mask);
    let asked = mask.as_ref().map_or(count, |mask| mask.iter().filter(|&&m| m).count());
    run.work.vertices += asked as u64;
    let _running = run.progress.stage(&format!("occlusion of {}", picture.0), asked as u64);
    Ok(scene.session.occlusion(computation.estimator(), mask.as_deref(), run.progress)?)
}

fn compute<const D: usize>(
    me: Ref<OcclusionPlan>,
    computation: &Computation,
    run: &mut Run,
    scene: &SceneRun<D>,
) -> Result<Estimates, StageError> {
    let mask = mask(me, computation, run, scene)?;
    let count = scene.session.mesh().vertices.len();
    let asked = mask.as_ref().map_or(count, |mask| mask.iter().filter(|&&m| m).count());
    run.work.vertices += asked as u64;
    let _running = run.progress.stage(&format!("occlusion {}", run.plan.id(me)), asked as u64);
    Ok(scene.session.occlusion(computation.estimator(), mask.as_deref(), run.progress)?)
}

/// Whether some file wants the values of all vertices, when all pieces of a run are joined if not before.
fn wants_all(me: Ref<OcclusionPlan>, plan: &Plan) -> bool {
    // Pictures need to know what they show, no more.
    let pictures = |stage| Piece::all(1).any(|all| plan.pictures(stage, all).is_some());
    let stages = || (0..plan.stages.len()).any(|stage| plan.wants_values(stage, me.index()) && !pictures(stage));
    let shown = |write: &WritePlan| plan[write.render].occlusion == Some(me) && write.has_mesh();
    let computed = matches!(plan[me].source, OcclusionSource::Compute(_));
    computed && (plan[me].file.is_some() || plan.all::<WritePlan>().any(|(_, write)| shown(write)) || stages())
}

/// Whether some file wants directions at all vertices.
fn wants_directions(me: Ref<OcclusionPlan>, plan: &Plan) -> bool {
    let shown =
        |write: &WritePlan| plan[write.render].occlusion == Some(me) && write.has_mesh() && write.has_directions();
    plan.all::<WritePlan>().any(|(_, write)| shown(write))
}

/// What a piece of a run needs to know: its share of the vertices, if some file wants all of them, which it keeps; those
/// that its parts of pictures show, and its parts of meshes.
fn in_piece<const D: usize>(
    me: Ref<OcclusionPlan>,
    computation: &Computation,
    run: &mut Run,
    scene: &SceneRun<D>,
) -> Result<Estimates, StageError> {
    let (plan, count) = (run.plan, scene.session.mesh().vertices.len());
    let mut found = Estimates { values: vec![1.0; count], errors: vec![f32::NAN; count], rays: 0 };
    let Some(piece) = plan.piece else { return Ok(found) };
    let mut share = 0..0;
    if wants_all(me, plan) {
        share = piece.share(count);
        let file = piece::values_of(me.nth());
        let path = plan.out.join(&file);
        let kept = Values::read(&path).ok().filter(|kept| !run.is_stale(&file) && kept.range() == share);
        let own = match kept {
            Some(kept) => kept,
            None => {
                let asked: Vec<bool> = (0..count).map(|v| share.contains(&v)).collect();
                let Estimates { values, errors, rays } = only(me, computation, &asked, run, scene)?;
                let vectors = match wants_directions(me, plan) {
                    true => scene.vectors_at(me, share.clone().collect(), run)?.iter().flatten().copied().collect(),
                    false => Vec::new(),
                };
                let (values, errors) = (values[share.clone()].to_vec(), errors[share.clone()].to_vec());
                let own = Values { first: share.start, values, errors, rays, vectors };
                let bytes = write_whole(&path, &own.to_bytes())?;
                run.made_beside(&file, bytes)?;
                own
            }
        };
        found.rays = own.rays;
        found.values[share.clone()].copy_from_slice(&own.values);
        found.errors[share.clone()].copy_from_slice(&own.errors);
    }
    let mut more = shown_in_piece(me, piece, computation, run, scene)?;
    more[share].fill(false);
    if more.contains(&true) {
        let Estimates { values, errors, rays } = only(me, computation, &more, run, scene)?;
        found.rays += rays;
        for v in (0..count).filter(|&v| more[v]) {
            (found.values[v], found.errors[v]) = (values[v], errors[v]);
        }
    }
    Ok(found)
}

/// The values where the mask says so.
fn only<const D: usize>(
    me: Ref<OcclusionPlan>,
    computation: &Computation,
    mask: &[bool],
    run: &mut Run,
    scene: &SceneRun<D>,
) -> Result<Estimates, StageError> {
    let asked = mask.iter().filter(|&&m| m).count() as u64;
    run.work.vertices += asked;
    let _running = run.progress.stage(&format!("occlusion {}", run.plan.id(me)), asked);
    Ok(scene.session.occlusion(computation.estimator(), Some(mask), run.progress)?)
}

/// The vertices that a piece's parts of pictures and meshes show, of those that have to be made.
fn shown_in_piece<const D: usize>(
    me: Ref<OcclusionPlan>,
    piece: Piece,
    computation: &Computation,
    run: &Run,
    scene: &SceneRun<D>,
) -> Result<Vec<bool>, StageError> {
    let (plan, mesh) = (run.plan, scene.session.mesh());
    let mut mask = vec![false; mesh.vertices.len()];
    let is_stale = |stage: usize| plan.files_of(stage).into_iter().any(|file| run.is_stale(file));
    let of_write = |write: &WritePlan| {
        plan[write.render].occlusion == Some(me) && !write.stale(write::Content::Mesh, &|f| run.is_stale(f)).is_empty()
    };
    let wants = |stage: usize| plan.wants_values(stage, me.index()) && is_stale(stage);
    let frames = |stage: usize| plan.pictures(stage, piece);
    if plan.all::<WritePlan>().any(|(_, write)| of_write(write))
        || (0..plan.stages.len()).any(|stage| wants(stage) && frames(stage).is_none())
    {
        let own = piece.share(mesh.vertices.len());
        mesh.simplices.iter().filter(|s| write::has_first(&own, s)).flatten().for_each(|&v| mask[v as usize] = true);
    }
    let mut left = computation.most_rays().saturating_mul(mesh.vertices.len() as u64) / 4;
    let mut pictures = Vec::new();
    for (stage, render) in plan.all::<RenderPlan>() {
        let values = render.occlusion == Some(me) && render.shading != render::Shading::Voxel;
        if values && render::is_stale(stage, plan, &|file| run.is_stale(file)) {
            pictures.push((plan.id(stage).to_owned(), render.clone(), piece.layers(render.dimensions[2], stage.nth())));
        }
    }
    for stage in (0..plan.stages.len()).filter(|&stage| plan.wants_values(stage, me.index())) {
        let frames = frames(stage).unwrap_or_default().into_iter().filter(|(file, _)| run.is_stale(file));
        pictures.extend(frames.map(|(file, render)| (file.display().to_string(), render, None)));
    }
    for (name, render, slab) in pictures {
        if !mark_seen((&name, &render), run, scene, slab.as_ref(), &mut left, &mut mask)? {
            return Ok(vec![true; mesh.vertices.len()]);
        }
    }
    Ok(mask)
}

/// The vertices of the simplices that some voxel shows, of the pictures that have to be made; none if all values are
/// wanted for some file, or if looking costs more than it may save.
fn mask<const D: usize>(
    me: Ref<OcclusionPlan>,
    computation: &Computation,
    run: &Run,
    scene: &SceneRun<D>,
) -> Result<Option<Vec<bool>>, StageError> {
    let plan = run.plan;
    let shown = plan.all::<WritePlan>().any(|(_, write)| {
        plan[write.render].occlusion == Some(me) && !write.stale(write::Content::Mesh, &|f| run.is_stale(f)).is_empty()
    });
    let stale = |stage: usize| plan.files_of(stage).into_iter().any(|file| run.is_stale(file));
    let whole = (0..plan.stages.len()).any(|stage| plan.wants_values(stage, me.index()) && stale(stage));
    if shown || whole || plan[me].file.is_some() {
        return Ok(None);
    }
    let mut left = computation.most_rays().saturating_mul(scene.session.mesh().vertices.len() as u64) / 4;
    let mut mask = vec![false; scene.session.mesh().vertices.len()];
    for (stage, render) in plan.all::<RenderPlan>() {
        let values = render.occlusion == Some(me) && render.shading != render::Shading::Voxel;
        if values && render::is_stale(stage, plan, &|file| run.is_stale(file)) {
            let seen = mark_seen((plan.id(stage), render), run, scene, None, &mut left, &mut mask)?;
            if !seen {
                return Ok(None);
            }
        }
    }
    Ok(Some(mask))
}

/// How fast values were found since then.
fn rate(found: &Estimates, took: Duration) -> Told {
    let (mut text, mut numbers) = (String::new(), json!({ "rays": found.rays }));
    if found.rays > 0 {
        let speed = found.rays as f64 / took.as_secs_f64();
        text = format!("{} rays, {:.2} million a second, ", grouped(found.rays), speed / 1e6);
        numbers["rays_per_second"] = speed.into();
    }
    if !found.errors.is_empty() {
        text += &format!("error {:.1e}", found.error());
        numbers["error"] = found.error().into();
    }
    Told::new(text, numbers)
}

/// The keys about computing that are written.
fn written(spec: &OcclusionSpec) -> impl Iterator<Item = &'static str> {
    [
        ("method", spec.method.is_some()),
        ("samples", spec.samples.is_some()),
        ("target_error", spec.target_error.is_some()),
        ("max_samples", spec.max_samples.is_some()),
        ("max_cones", spec.max_cones.is_some()),
        ("max_distance", spec.max_distance.is_some()),
        ("seed", spec.seed.is_some()),
    ]
    .into_iter()
    .filter_map(|(key, given)| given.then_some(key))
}

fn computation(path: &str, spec: &OcclusionSpec, resolver: &mut Resolver) -> Result<Computation, Invalid> {
    let refuse = |key: &str, message: String| Err(Invalid::new(format!("{path}.{key}"), message));
    let method = spec.method.unwrap_or_default();
    let count = |key: &str, n: u64| match n {
        1..=MAX_SAMPLES => Ok(n),
        _ => refuse(key, format!("expected 1 to {MAX_SAMPLES} samples, found {n}")).map(|_: Computation| 0),
    };
    let samples = match (spec.samples, spec.target_error) {
        (Some(_), Some(_)) => return refuse("target_error", "stands beside `samples`; give one of the two".into()),
        (Some(n), None) => Samples::Fixed(count("samples", n)?),
        (None, None) => Samples::Fixed(256),
        (None, Some(error)) => {
            if !(error > 0.0 && error < 1.0) {
                let error = number(error);
                return refuse("target_error", format!("expected an error above 0 and below 1, found {error}"));
            }
            Samples::Target { error, max_samples: count("max_samples", spec.max_samples.unwrap_or(65_536))? }
        }
    };
    if let (Some(n), Samples::Fixed(_)) = (spec.max_samples, samples) {
        count("max_samples", n)?;
        resolver.warn(format!("{path}.max_samples"), "has no effect without `target_error`");
    }
    let samples = if method == Method::Exact {
        if spec.samples.is_some() || spec.target_error.is_some() {
            resolver.warn(path, "`exact` takes no samples, so `samples` and `target_error` have no effect");
        }
        Samples::Exact
    } else {
        samples
    };
    if method.is_of_the_thesis() && spec.target_error.is_some() {
        let method = method.as_str();
        return refuse("target_error", format!("`{method}` aims at no error, which it doesn't know; give `samples`"));
    }
    let max_cones = match spec.max_cones {
        None => exact::Budget::default().cones as u64,
        Some(n @ 1..=MAX_CONES) => n,
        Some(n) => return refuse("max_cones", format!("expected 1 to {MAX_CONES} cones, found {n}")),
    };
    if spec.max_cones.is_some() && method != Method::Exact {
        resolver.warn(format!("{path}.max_cones"), "has no effect without `method: exact`");
    }
    if spec.max_distance.is_some() && matches!(method, Method::Exact | Method::Adaptive | Method::AsProgrammed) {
        let method = method.as_str();
        return refuse(
            "max_distance",
            format!("`{method}` counts hits at all distances; leave this out, or use `method: sobol`"),
        );
    }
    let distance = spec.max_distance.map(|d| positive(&format!("{path}.max_distance"), d));
    let seed = spec.seed.unwrap_or(resolver.plan.seed);
    Ok(Computation { method, samples, max_cones, max_distance: distance.transpose()?, seed })
}

impl Method {
    /// As the pipeline names it.
    pub fn as_str(self) -> &'static str {
        match self {
            Method::Sobol => "sobol",
            Method::Random => "random",
            Method::Adaptive => "adaptive",
            Method::Exact => "exact",
            Method::AsPublished => "as_published",
            Method::AsProgrammed => "as_programmed",
        }
    }

    /// Whether its values are those of rays, and nothing else.
    pub fn is_by_rays(self) -> bool {
        matches!(self, Method::Sobol | Method::Random | Method::Adaptive)
    }

    /// Whether it knows that light passes some objects.
    fn knows_opacity(self) -> bool {
        matches!(self, Method::Sobol | Method::Random | Method::Adaptive)
    }

    /// Whether it is there for the thesis's figures alone.
    pub fn is_of_the_thesis(self) -> bool {
        matches!(self, Method::AsPublished | Method::AsProgrammed)
    }
}

impl Computation {
    /// What computes the values.
    pub fn estimator(&self) -> Estimator {
        let (samples, target) = match self.samples {
            Samples::Fixed(n) => (n, None),
            Samples::Target { error, max_samples } => (max_samples, Some(Target { error: error as f32 })),
            Samples::Exact => return Estimator::Exact(Budget { cones: self.max_cones as usize }),
        };
        let sampling = Sampling {
            sampler: if self.method == Method::Random { Sampler::Random } else { Sampler::Sobol },
            samples: u32::try_from(samples).unwrap_or(u32::MAX),
            seed: self.seed,
            max_distance: self.max_distance.map_or(f32::INFINITY, |d| d as f32),
            target,
        };
        match self.method {
            Method::Adaptive => Estimator::Adaptive(sampling),
            Method::AsPublished => Estimator::AsPublished(sampling, Deviations::PUBLISHED),
            Method::AsProgrammed => Estimator::AsProgrammed(sampling, ProgramDeviations::PROGRAMMED),
            _ => Estimator::Sampled(sampling),
        }
    }

    /// The most rays that a vertex takes; the closed form counts as a few thousand, which is what it takes as long as.
    fn most_rays(&self) -> u64 {
        match self.samples {
            Samples::Fixed(n) | Samples::Target { max_samples: n, .. } => n,
            Samples::Exact => 1 << 12,
        }
    }

    /// What images tell of it.
    pub fn told(&self) -> Value {
        without(json!(self), &[LeftOut::new("/max_cones", "no value depends on it")])
    }
}

/// What is known about values that were computed.
fn sidecar(found: &Estimates, computation: &Computation, mesh_hash: &str) -> Sidecar {
    let Computation { method, samples, max_distance, seed, .. } = computation;
    let (most, target_error) = match *samples {
        Samples::Fixed(n) => (Some(n), None),
        Samples::Target { error, max_samples } => (Some(max_samples), Some(error)),
        Samples::Exact => (None, None),
    };
    let count = found.values.len();
    Sidecar {
        count,
        method: method.as_str().to_owned(),
        samples: most.and_then(|n| u32::try_from(n).ok()),
        target_error,
        mean_samples: most.map(|_| found.rays as f64 / count.max(1) as f64),
        seed: *seed,
        max_distance: max_distance.map_or(f32::INFINITY, |d| d as f32),
        error_estimate: found.error(),
        mesh: mesh_hash.to_owned(),
        program: PROGRAM.to_owned(),
        pipeline: None,
    }
}
