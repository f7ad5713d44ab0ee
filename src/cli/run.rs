//! `ao4d run`: run a pipeline and write its files.

use ao4d::pipeline::{RunError, run};
use clap::Args;

use super::console::Console;
use super::options::PipelineOptions;
use super::watch::Watch;
use super::{Failure, Outcome};

/// What `run` takes.
#[derive(Args, Debug)]
pub struct Run {
    #[command(flatten)]
    options: PipelineOptions,
    /// Print the summary as JSON
    #[arg(long)]
    json: bool,
}

impl Run {
    pub fn execute(self, console: &Console) -> Result<Outcome, Failure> {
        let (pipelines, settings) = self.options.load_all(console)?;
        let watch = Watch::new(console)?;
        if pipelines.len() > 1 {
            // What is wrong with the last is found before the first is run.
            for pipeline in &pipelines {
                pipeline.prepare(|_| true)?;
            }
        }
        let mut reports = Vec::with_capacity(pipelines.len());
        for pipeline in &pipelines {
            let report = run(pipeline, &settings, &watch).map_err(|error| match error {
                RunError::Refused(error) => Failure::Refused(Box::new(error)),
                RunError::Cancelled(_) => Failure::Cancelled,
                error => Failure::Failed(Box::new(error)),
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
