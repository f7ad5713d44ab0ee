//! Running a plan: scene by scene, in the order of its stages, as lazily as its files allow.
//!
//! A value is computed when some file that has to be made needs it, and not before: the hierarchy over a scene when
//! something is traced, an occlusion when it is written or a picture is shaded by it. What that takes is each stage's own
//! affair ([`crate::stages`]); here is the order of things: the folder is locked, keys say which files have to be made,
//! inputs are read, scenes are worked on one by one, and figures come last.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde_json::json;

use super::book::Book;
use super::cache::MadeBy;
use super::lock::{Busy, Lock};
use super::pieces::{self, PiecesError};
use super::report::Report;
use super::settings::Backend;
use super::share::{Kept, Scenes, Shared};
use super::{Error, Pipeline, Settings, provenance};
use crate::geometry::Dimension;
use crate::io;
use crate::mesh::Mesh;
use crate::occlusion::Cancelled;
use crate::progress::Progress;
use crate::session::Session;
use crate::stages::describe::grouped;
use crate::stages::occlusion::OcclusionPlan;
use crate::stages::piece::Joined;
use crate::stages::prepare::{Loaded, Prepared};
use crate::stages::scene::{AnyMesh, ScenePlan};
use crate::stages::{Keys, Ledger, Needs, Ref, Run, SceneRun, StageError, Told, Work};
use crate::trace::opencl::OpenCl;
use crate::volume::available_memory;

/// A run that didn't succeed.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// Something is wrong with the pipeline or a file it names; nothing was written.
    #[error(transparent)]
    Refused(#[from] Error),
    /// Ctrl-C.
    #[error(transparent)]
    Cancelled(Cancelled),
    /// A stage fails.
    #[error(transparent)]
    Stage(StageError),
    /// A picture doesn't fit in memory.
    #[error(
        "{stage}: {holds} takes {needed} bytes of memory, and {available} are free; lower its dimensions, or write fewer arrays or layers"
    )]
    Memory {
        /// The stage, by its kind and id.
        stage: String,
        /// What needs them.
        holds: &'static str,
        /// Bytes that are needed at once.
        needed: u64,
        /// Bytes that are there.
        available: u64,
    },
    /// Another run writes into the same folder.
    #[error(transparent)]
    Busy(#[from] Busy),
    /// The pieces of a run can't be joined; nothing was written.
    #[error(transparent)]
    Pieces(#[from] PiecesError),
    /// An input was replaced or written to while it was read.
    #[error("{}: the file changed while it was read; nothing was written, so run again", .0.display())]
    InputChanged(PathBuf),
    /// Threads can't be started.
    #[error("can't start the threads; use fewer, by --threads")]
    Threads(#[source] std::io::Error),
}

impl<E: Into<StageError>> From<E> for RunError {
    fn from(error: E) -> Self {
        match error.into() {
            StageError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            error => Self::Stage(error),
        }
    }
}

/// Runs a pipeline and writes its files. The files are the same bytes on any number of threads.
///
/// # Errors
/// [`RunError`]; files that were finished before stay, none is left half-written.
pub fn run(pipeline: &Pipeline, settings: &Settings, progress: &dyn Progress) -> Result<Report, RunError> {
    settings.pool().map_err(RunError::Threads)?.install(|| run_here(pipeline, settings, progress, None, None))
}

/// The same, and takes over what earlier runs made of the same scenes with the same settings. The files are the same bytes.
///
/// # Errors
/// As [`run`].
pub fn run_sharing(
    pipeline: &Pipeline,
    settings: &Settings,
    progress: &dyn Progress,
    shared: &mut Shared,
) -> Result<Report, RunError> {
    settings.pool().map_err(RunError::Threads)?.install(|| run_here(pipeline, settings, progress, None, Some(shared)))
}

/// Makes a pipeline's files of the parts that the pieces of a run left: the same bytes as [`run`] makes. `count` says of how
/// many pieces, where folders of several such runs are there.
///
/// # Errors
/// [`RunError::Pieces`] if a piece is missing, or of something else; else as [`run`].
pub fn merge(
    pipeline: &Pipeline,
    count: Option<usize>,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Report, RunError> {
    let joined = pieces::find(pipeline, count)?;
    settings.pool().map_err(RunError::Threads)?.install(|| run_here(pipeline, settings, progress, Some(joined), None))
}

fn run_here(
    pipeline: &Pipeline,
    settings: &Settings,
    progress: &dyn Progress,
    joined: Option<Joined>,
    shared: Option<&mut Shared>,
) -> Result<Report, RunError> {
    let began = Instant::now();
    let plan = &pipeline.plan;
    let opencl = match &settings.backend {
        Backend::Cpu => None,
        Backend::OpenCl(places) => Some(Arc::new(OpenCl::open(places)?)),
    };
    let _lock = Lock::take(&plan.out)?;
    let keys = Keys::new(plan);
    let text = provenance::text(pipeline, &keys);
    let made_by = MadeBy { told: keys.hash(&text), folder: folder(pipeline) };
    if let Some(joined) = &joined {
        pieces::check(pipeline, &keys, &text, joined)?;
    }
    let mut book = Book::open(plan, &keys, made_by, settings.force);
    check_resources(pipeline, &book)?;
    let running = progress.stage("scene", 0);
    let blank = &mut Shared::default();
    // A piece knows a part of the values only.
    let sharing = shared.is_some() && plan.piece.is_none();
    let shared = shared.filter(|_| sharing).unwrap_or(blank);
    // A file of values is held against the scene as it is built.
    let loads = |scene| plan.all::<OcclusionPlan>().any(|(_, o)| o.scene == scene && o.is_loaded());
    let known = |scene: Ref<ScenePlan>| shared.has(keys.of(scene.index())) && !loads(scene);
    let wanted = |stage| match plan.scene_of(stage) {
        Some(scene) => book.needs(plan, scene) && !known(scene),
        None => book.needs_stage(stage),
    };
    let takes: Vec<bool> = plan.all::<ScenePlan>().map(|(s, _)| book.needs(plan, s) && known(s)).collect();
    let prepared = pipeline.prepare_watched(wanted, progress);
    running.end();
    if progress.cancelled() {
        return Err(Cancelled.into());
    }
    let Prepared { meshes, loaded, notes } = prepared?;
    if let Some(file) = keys.inputs().changed() {
        return Err(RunError::InputChanged(file.to_owned()));
    }
    if book.anything() {
        io::check_writable(&plan.out)?;
    }
    if plan.piece.is_some() {
        pieces::tell(plan, &text)?;
    }
    book.retell(plan, &text)?;
    let building = began.elapsed();
    let loaded = plan.all::<OcclusionPlan>().zip(loaded).filter_map(|((stage, _), found)| Some((stage, found?)));
    let loaded = loaded.collect();
    let force = settings.force;
    let (told, times) = (&*text, BTreeMap::new());
    let work = Work::default();
    let share = Share { keys: &keys, shared, sharing };
    let mut run =
        Schedule { pipeline, told, opencl, progress, book: &mut book, loaded, force, joined, work, times, share };
    for ((((scene, of), mesh), notes), takes) in plan.all::<ScenePlan>().zip(meshes).zip(notes).zip(takes) {
        match (mesh, of.dimension) {
            (Some(AnyMesh::Three(mesh)), _) => run.scene::<3>(scene, Some((mesh, notes)), building)?,
            (Some(AnyMesh::Four(mesh)), _) => run.scene::<4>(scene, Some((mesh, notes)), building)?,
            (None, Dimension::Three) if takes => run.scene::<3>(scene, None, building)?,
            (None, Dimension::Four) if takes => run.scene::<4>(scene, None, building)?,
            (None, _) => (0..plan.stages.len())
                .filter(|&stage| plan.scene_of(stage) == Some(scene))
                .for_each(|stage| run.book.tell_unchanged(plan, stage)),
        }
    }
    run.last()?;
    let (mut times, work) = (run.times, run.work);
    let mut report = book.report();
    (report.work, report.piece) = (work, plan.piece.map(|piece| piece.to_string()));
    for (index, stage) in plan.stages.iter().enumerate() {
        let (time, told) = times.remove(&index).unwrap_or_default();
        report.stage(format!("{} {}", plan.kind(index), stage.id), time, told);
    }
    report.seconds = began.elapsed().as_secs_f64();
    Ok(report)
}

/// Where the paths of a pipeline's inputs start, as it is found from anywhere.
fn folder(pipeline: &Pipeline) -> Option<String> {
    let folder = &pipeline.plan.folder;
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    folder.canonicalize().ok()?.into_os_string().into_string().ok()
}

/// Refuses a run whose files don't fit on the disk, or one layer of whose pictures doesn't fit in memory.
fn check_resources(pipeline: &Pipeline, book: &Book) -> Result<(), RunError> {
    let plan = &pipeline.plan;
    let needs = (0..plan.stages.len()).map(|stage| (plan.needs(stage, &|file| book.is_stale(file)), stage));
    let needs: Vec<_> = needs.collect();
    let most = needs.iter().max_by_key(|(needs, stage)| (needs.memory, *stage));
    if let (Some((Needs { memory, holds, .. }, stage)), Some(available)) = (most, available_memory())
        && *memory > available
    {
        let name = format!("{} {}", plan.kind(*stage), plan.stages[*stage].id);
        return Err(RunError::Memory { stage: name, holds, needed: *memory, available });
    }
    let disk = needs.iter().fold(0, |sum: u64, (needs, _)| sum.saturating_add(needs.disk));
    // About its share.
    let disk = disk / plan.piece.map_or(1, |piece| piece.count() as u64);
    Ok(io::check_free_space(&plan.out, disk)?)
}

/// A run in progress.
struct Schedule<'p> {
    pipeline: &'p Pipeline,
    told: &'p str,
    opencl: Option<Arc<OpenCl>>,
    progress: &'p dyn Progress,
    book: &'p mut Book,
    loaded: BTreeMap<Ref<OcclusionPlan>, Loaded>,
    force: bool,
    joined: Option<Joined>,
    work: Work,
    times: BTreeMap<usize, (Duration, Told)>,
    share: Share<'p>,
}

/// What is taken over from other runs, and left for them.
struct Share<'p> {
    keys: &'p Keys,
    shared: &'p mut Shared,
    /// Whether anything is left for others.
    sharing: bool,
}

impl Schedule<'_> {
    /// Runs the stages that are about one scene, in order. Without a mesh it is one that another run has left.
    fn scene<const D: usize>(
        &mut self,
        scene: Ref<ScenePlan>,
        built: Option<(Mesh<D>, Vec<String>)>,
        building: Duration,
    ) -> Result<(), RunError>
    where
        Shared: Scenes<D>,
    {
        let plan = &self.pipeline.plan;
        let keys = self.share.keys;
        let (mut at_work, notes) = match built {
            Some((mesh, notes)) => {
                let session = match &self.opencl {
                    Some(opencl) => Session::on(mesh, Arc::clone(opencl)),
                    None => Session::new(mesh),
                };
                (SceneRun::new(session), notes)
            }
            None => match self.share.shared.scenes().get(keys.of(scene.index())) {
                Some(kept) => (kept.at_work(plan, keys, scene.index()), kept.notes.clone()),
                None => return Ok(()),
            },
        };
        let mesh = Arc::clone(at_work.session.mesh());
        let (vertices, simplices) = (mesh.vertices.len() as u64, mesh.simplices.len() as u64);
        let detail = format!("{} vertices, {} simplices", grouped(vertices), grouped(simplices));
        let told = Told::new(detail, json!({ "vertices": vertices, "simplices": simplices }));
        self.times.insert(scene.index(), (building, told));
        self.book.begin_scene(notes.clone());
        let is_shaded = plan.all::<OcclusionPlan>().any(|(_, occlusion)| occlusion.scene == scene);
        if self.opencl.is_some() && mesh.is_translucent() && is_shaded {
            let id = plan.id(scene);
            self.book.tell(&[format!(
                "scene {id}: light passes some objects, so its ambient occlusion is computed by the processor, not by OpenCL"
            )]);
        }
        for stage in (0..plan.stages.len()).filter(|&stage| plan.scene_of(stage) == Some(scene)) {
            if stage != scene.index() {
                self.stage(stage, |run| plan.run(stage, run, &mut at_work))?;
            }
            self.book.tell_unchanged(plan, stage);
        }
        self.book.begin_scene(Vec::new());
        if self.share.sharing {
            Kept::keep(self.share.shared.scenes(), (plan, keys, scene.index()), &at_work, notes);
        }
        Ok(())
    }

    /// Runs the stages that are about no scene.
    fn last(&mut self) -> Result<(), RunError> {
        let plan = &self.pipeline.plan;
        for stage in (0..plan.stages.len()).filter(|&stage| plan.scene_of(stage).is_none()) {
            self.stage(stage, |run| plan.run_last(stage, run))?;
            self.book.tell_unchanged(plan, stage);
        }
        Ok(())
    }

    fn stage(&mut self, stage: usize, work: impl FnOnce(&mut Run) -> Result<Told, StageError>) -> Result<(), RunError> {
        let start = Instant::now();
        let mut run = Run {
            plan: &self.pipeline.plan,
            told: self.told,
            progress: self.progress,
            ledger: self.book,
            loaded: std::mem::take(&mut self.loaded),
            force: self.force,
            joined: self.joined.clone(),
            work: self.work,
            early: BTreeMap::new(),
        };
        let told = work(&mut run)?;
        let mut own = start.elapsed();
        (self.loaded, self.work) = (run.loaded, run.work);
        // Values that a picture needed are told at the occlusion they are of, and so is the time that they took.
        for (index, (took, told)) in run.early {
            own = own.saturating_sub(took);
            let known = self.times.entry(index).or_default();
            known.0 += took;
            known.1 = told;
        }
        let known = self.times.entry(stage).or_default();
        known.0 += own;
        if !told.text.is_empty() {
            known.1 = told;
        }
        Ok(())
    }
}
