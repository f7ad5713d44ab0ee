//! `ao4d run`: run a pipeline and write its files.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use ao4d::pipeline::{Pipeline, RunError, Shared, run, run_sharing};
use ao4d::progress::Progress;
use ao4d::stages::Keys;
use ao4d::stages::occlusion::OcclusionPlan;
use clap::Args;

use super::console::Console;
use super::options::PipelineOptions;
use super::piece::PieceOptions;
use super::watch::Watch;
use super::{Failure, Outcome};

/// What `run` takes.
#[derive(Args, Debug)]
pub struct Run {
    #[command(flatten)]
    options: PipelineOptions,
    #[command(flatten)]
    piece: PieceOptions,
    /// Print the summaries as JSON: {"pipelines": [...]}
    #[arg(long)]
    json: bool,
}

impl Run {
    /// Lets pipelines that make no page make one.
    pub fn with_page(&mut self) {
        self.options.page = true;
    }

    pub fn execute(self, console: &Console) -> Result<Outcome, Failure> {
        let piece = self.piece.piece(console)?;
        let (mut pipelines, settings) = self.options.load_all(console)?;
        if let Some(piece) = piece {
            pipelines.iter_mut().for_each(|pipeline| *pipeline = pipeline.in_piece(piece));
        }
        let watch = Watch::new(console)?;
        if pipelines.len() > 1 {
            let checked = settings.pool().map_err(RunError::Threads)?.install(|| check_together(&pipelines, &watch));
            if watch.cancelled() {
                return Err(Failure::Cancelled);
            }
            checked?;
        }
        let mut reports = Vec::with_capacity(pipelines.len());
        let mut shared = Shared::default();
        for (i, pipeline) in pipelines.iter().enumerate() {
            // Those of a sweep stand together.
            let same = |other: Option<&Pipeline>| other.is_some_and(|p| p.document.file() == pipeline.document.file());
            let [before, after] = [i.checked_sub(1).and_then(|i| pipelines.get(i)), pipelines.get(i + 1)].map(same);
            if !before {
                shared = Shared::default();
            }
            let ran = match before || after {
                true => run_sharing(pipeline, &settings, &watch, &mut shared),
                false => run(pipeline, &settings, &watch),
            };
            let report = ran.map_err(|error| match error {
                // Others have left their files by now.
                RunError::Refused(error) if !reports.is_empty() => Failure::Failed(Box::new(error)),
                error => error.into(),
            })?;
            for note in &report.notes {
                console.note(note);
            }
            if !self.json {
                console.result(&report.to_string())?;
            }
            reports.push(report);
        }
        if self.json {
            console.pipelines(&reports)?;
        }
        Ok(Outcome::Done)
    }
}

/// Finds what is wrong with the last pipeline before the first is run. What reads a file that an earlier one writes can be
/// tried only once that is there.
fn check_together(pipelines: &[Pipeline], progress: &dyn Progress) -> Result<(), ao4d::pipeline::Error> {
    let _running = progress.stage("reading inputs", 0);
    let mut written = BTreeSet::new();
    let mut built = BTreeSet::new();
    for pipeline in pipelines {
        let plan = &pipeline.plan;
        let reads_those = |stage: usize| plan.input_files(stage).iter().any(|file| written.contains(&place(file)));
        let later: Vec<bool> = (0..plan.stages.len())
            .map(|stage| reads_those(stage) || plan.scene_of(stage).is_some_and(|scene| reads_those(scene.index())))
            .collect();
        // Scenes that were built are as they were. Files of values are held against them, so those build them again.
        let keys = Keys::new(plan);
        let loads = plan.all::<OcclusionPlan>().any(|(_, occlusion)| occlusion.is_loaded());
        let known = |stage: usize| match plan.scene_of(stage) {
            Some(scene) => !loads && built.contains(keys.of(scene.index())),
            None => false,
        };
        pipeline.prepare_watched(|stage| !later[stage] && !known(stage), progress)?;
        let scenes = (0..plan.stages.len()).filter(|&stage| !later[stage]).filter_map(|stage| plan.scene_of(stage));
        let scenes: Vec<String> = scenes.map(|scene| keys.of(scene.index()).to_owned()).collect();
        built.extend(scenes);
        let files = (0..plan.stages.len()).flat_map(|stage| plan.all_files_of(stage));
        written.extend(files.map(|file| place(&plan.out.join(file))));
    }
    Ok(())
}

/// A path as it can be compared with others.
fn place(path: &Path) -> PathBuf {
    path.canonicalize().or_else(|_| std::path::absolute(path)).unwrap_or_else(|_| path.to_owned())
}
