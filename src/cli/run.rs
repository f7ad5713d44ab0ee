//! `ao4d run`: run a pipeline and write its files.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use ao4d::pipeline::{Pipeline, RunError, run};
use ao4d::progress::Progress;
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
    /// Print the summary as JSON
    #[arg(long)]
    json: bool,
}

impl Run {
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
        for pipeline in &pipelines {
            let report = run(pipeline, &settings, &watch).map_err(|error| match error {
                // Others have left their files by now.
                RunError::Refused(error) if !reports.is_empty() => Failure::Failed(Box::new(error)),
                error => error.into(),
            })?;
            for note in &report.notes {
                console.note(&format!("note: {note}"));
            }
            if !self.json {
                console.result(&report.to_string())?;
            }
            reports.push(report);
        }
        match &reports[..] {
            [one] if self.json => console.json(one)?,
            _ if self.json => console.json(&reports)?,
            _ => {}
        }
        Ok(Outcome::Done)
    }
}

/// Finds what is wrong with the last pipeline before the first is run. What reads a file that an earlier one writes can be
/// tried only once that is there.
fn check_together(pipelines: &[Pipeline], progress: &dyn Progress) -> Result<(), ao4d::pipeline::Error> {
    let _running = progress.stage("reading inputs", 0);
    let mut written = BTreeSet::new();
    for pipeline in pipelines {
        let plan = &pipeline.plan;
        let reads_those = |stage: usize| plan.input_files(stage).iter().any(|file| written.contains(&place(file)));
        let later: Vec<bool> = (0..plan.stages.len())
            .map(|stage| reads_those(stage) || plan.scene_of(stage).is_some_and(|scene| reads_those(scene.index())))
            .collect();
        pipeline.prepare_watched(|stage| !later[stage], progress)?;
        let files = (0..plan.stages.len()).flat_map(|stage| plan.all_files_of(stage));
        written.extend(files.map(|file| place(&plan.out.join(file))));
    }
    Ok(())
}

/// A path as it can be compared with others.
fn place(path: &Path) -> PathBuf {
    path.canonicalize().or_else(|_| std::path::absolute(path)).unwrap_or_else(|_| path.to_owned())
}
