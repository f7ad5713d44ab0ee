//! Error against time of the occlusion methods on a pipeline's scene: `study.csv`, `study.md`, `study.svg`.
//!
//! What is measured, each in a file of its own:
//!
//! - [`convergence`]: every method with 16, 64, 256, ... rays a vertex against the exact values. A level is repeated with other
//!   seeds until it has traced [`convergence::RAYS`] rays, so that a scene of eight vertices gives smooth curves too;
//! - [`pictures`]: every way to shade an image, `flat`, `smooth`, `voxel`, `voxel` denoised, `auto`, and
//!   `screen_space`, against the value of each visible point itself;
//! - [`precision`]: on how many rays plain Cramer's rule, in `f32` and in `f64`, says something else than exact signs; and
//!   what each deviation of the published algorithm does to its values.
//!
//! All is about the vertices or voxels of one scene: that of the pipeline's first `occlusion`. Of a large one some are
//! taken, evenly spread. How much is computed is bounded by counts, never by the clock, so that the same pipeline gives the
//! same errors everywhere; only times differ.

mod convergence;
mod pictures;
mod plot;
mod precision;
mod tables;

use std::path::PathBuf;
use std::sync::Arc;

use super::lock::Lock;
use super::{Pipeline, RunError, Settings};
use crate::accel::Tracer;
use crate::mesh::Mesh;
use crate::progress::Progress;
use crate::stages::Invalid;
use crate::stages::Ref;
use crate::stages::describe::grouped;
use crate::stages::occlusion::{OcclusionPlan, OcclusionSource};
use crate::stages::render::RenderPlan;
use crate::stages::scene::{AnyMesh, ScenePlan};
use crate::stages::write::write_whole;
use convergence::{Bench, Level, Truth};
use pictures::Pictures;
use precision::{DeviationEffect, Differing};

/// What a study found.
#[derive(Clone, Debug)]
pub struct Study {
    /// The pipeline's name.
    name: String,
    /// 3 or 4.
    dimension: usize,
    vertices: usize,
    simplices: usize,
    threads: usize,
    seed: u64,
    truth: Truth,
    levels: Vec<Level>,
    deviations: Vec<DeviationEffect>,
    differing: Vec<Differing>,
    pictures: Option<Pictures>,
    notes: Vec<String>,
    /// The files it wrote.
    pub files: Vec<PathBuf>,
}

impl Study {
    /// The report, as `study.md` has it.
    pub fn markdown(&self) -> String {
        tables::markdown(self)
    }
}

/// Studies the scene of a pipeline's first occlusion, and writes `study.csv`, `study.md` and `study.svg`.
///
/// # Errors
/// [`RunError::Refused`] if there is no occlusion, or nothing in its scene; else as [`super::run`].
pub fn study(pipeline: &Pipeline, settings: &Settings, progress: &dyn Progress) -> Result<Study, RunError> {
    settings.pool().map_err(RunError::Threads)?.install(|| study_here(pipeline, progress))
}

fn study_here(pipeline: &Pipeline, progress: &dyn Progress) -> Result<Study, RunError> {
    let plan = &pipeline.plan;
    let refuse = |path: &str, message: &str| RunError::Refused(pipeline.document.refuse(Invalid::new(path, message)));
    let Some((stage, occlusion)) = plan.all::<OcclusionPlan>().find(|(stage, _)| !plan.is_twin(stage.index())) else {
        return Err(refuse("stages", "there is no `occlusion` to study; add one after the scene"));
    };
    if plan[occlusion.scene].is_translucent() {
        let message = "light passes some of its objects, and the truth that methods are held against knows opaque ones only; \
                       leave out their `opacity`";
        return Err(refuse(plan.path(occlusion.scene), message));
    }
    let _lock = Lock::take(&plan.out)?;
    let running = progress.stage("scene", 0);
    let prepared = pipeline.prepare(|stage| stage == occlusion.scene.index());
    running.end();
    let mut notes = Vec::new();
    let mut seed = plan.seed;
    if let OcclusionSource::Compute(computation) = &occlusion.source {
        seed = computation.seed;
        if computation.max_distance.is_some() {
            notes.push("`max_distance` is left out: all methods count occluders at any distance.".to_owned());
        }
    }
    if plan.all::<OcclusionPlan>().filter(|(stage, _)| !plan.is_twin(stage.index())).count() > 1 {
        notes.push(format!(
            "The pipeline has several occlusions; this is the scene of the first, `{}`.",
            plan.id(stage)
        ));
    }
    let empty = || refuse(plan.path(occlusion.scene), "the scene is empty: there is no occlusion to study");
    let mut study = match prepared?.meshes.swap_remove(occlusion.scene.nth()) {
        Some(AnyMesh::Three(mesh)) => of_mesh(pipeline, mesh, occlusion.scene, seed, progress)?,
        Some(AnyMesh::Four(mesh)) => of_mesh(pipeline, mesh, occlusion.scene, seed, progress)?,
        None => None,
    }
    .ok_or_else(empty)?;
    study.notes = notes;
    let texts =
        [("study.csv", tables::csv(&study)), ("study.svg", plot::svg(&study)), ("study.md", tables::markdown(&study))];
    for (name, text) in texts {
        write_whole(&plan.out.join(name), text.as_bytes())?;
        study.files.push(plan.out.join(name));
    }
    Ok(study)
}

/// All measurements on one scene; none if nothing is in it.
fn of_mesh<const D: usize>(
    pipeline: &Pipeline,
    mesh: Mesh<D>,
    scene: Ref<ScenePlan>,
    seed: u64,
    progress: &dyn Progress,
) -> Result<Option<Study>, RunError> {
    let tracer = Arc::new(Tracer::new(mesh));
    tracer.prepare();
    tracer.prepare_wide();
    let mesh = tracer.mesh();
    let Some(bench) = Bench::new(Arc::clone(&tracer), seed) else { return Ok(None) };
    let truth = bench.truth(progress)?;
    let mut levels = Vec::new();
    for config in convergence::CONFIGS {
        levels.extend(bench.converge(config, &truth, progress)?);
    }
    let deviations = precision::deviations(&bench, &truth, progress)?;
    let differing = precision::differing(&tracer, seed, progress)?;
    let renders = || pipeline.plan.all::<RenderPlan>().filter(|(_, r)| r.scene == scene);
    // Its camera is what counts, so one without occlusion does if there is no other.
    let render = renders().find(|(_, r)| r.occlusion.is_some()).or_else(|| renders().next());
    let pictures = render
        .map(|(stage, render)| pictures::measure(&tracer, pipeline.plan.id(stage), render, seed, progress))
        .transpose()?
        .flatten();
    Ok(Some(Study {
        name: pipeline.plan.name.clone(),
        dimension: D,
        vertices: mesh.vertices.len(),
        simplices: mesh.simplices.len(),
        threads: rayon::current_num_threads(),
        seed,
        truth,
        levels,
        deviations,
        differing,
        pictures,
        notes: Vec::new(),
        files: Vec::new(),
    }))
}

/// Hears the wish to stop, and keeps inner steps to itself.
struct Unheard<'p>(&'p dyn Progress);

impl Progress for Unheard<'_> {
    fn begin(&self, _stage: &str, _total: u64) {}

    fn advance(&self, _steps: u64) {}

    fn end(&self) {}

    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

/// How values differ from the true ones.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Errors {
    /// Root mean square.
    rms: f64,
    /// Largest magnitude.
    maximum: f64,
    /// Mean, with its sign.
    bias: f64,
}

impl Errors {
    fn of(differences: impl Iterator<Item = f64>) -> Self {
        let (mut count, mut squares, mut sum, mut maximum) = (0usize, 0.0, 0.0, 0.0f64);
        for difference in differences {
            count += 1;
            squares += difference * difference;
            sum += difference;
            maximum = maximum.max(difference.abs());
        }
        let count = count.max(1) as f64;
        Self { rms: (squares / count).sqrt(), maximum, bias: sum / count }
    }
}

/// `12,345 vertices`.
fn counted(count: usize, what: &str) -> String {
    format!("{} {what}", grouped(count as u64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_a_few_differences() {
        let errors = Errors::of([3.0, -4.0, 0.0, 0.0].into_iter());
        assert_eq!(errors, Errors { rms: 2.5, maximum: 4.0, bias: -0.25 });
        assert_eq!(Errors::of(std::iter::empty()), Errors::default());
    }
}
