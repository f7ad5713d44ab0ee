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
        let (pipeline, settings) = self.options.load(console)?;
        let watch = Watch::new(console)?;
        let report = run(&pipeline, &settings, &watch).map_err(|error| match error {
            RunError::Refused(error) => Failure::Refused(Box::new(error)),
            RunError::Cancelled(_) => Failure::Cancelled,
            error => Failure::Failed(Box::new(error)),
        })?;
        for note in &report.notes {
            console.note(&format!("note: {note}"));
        }
        if self.json { console.json(&report) } else { console.result(&report.to_string()) }?;
        Ok(Outcome::Done)
    }
}
