//! `ao4d merge`: make a pipeline's files of the pieces of its run.

use ao4d::pipeline::merge;
use ao4d::stages::piece::MOST;
use clap::Args;

use super::console::Console;
use super::options::PipelineOptions;
use super::watch::Watch;
use super::{Failure, Outcome};

/// What `merge` takes: the same as `run`, so that one word changes between the two.
#[derive(Args, Debug)]
pub struct Merge {
    #[command(flatten)]
    options: PipelineOptions,
    /// How many pieces the run had [default: as many as the folder says]
    #[arg(long, value_name = "N", value_parser = count)]
    pieces: Option<usize>,
    /// Print the summary as JSON
    #[arg(long)]
    json: bool,
}

impl Merge {
    pub fn execute(self, console: &Console) -> Result<Outcome, Failure> {
        let (pipelines, settings) = self.options.load_all(console)?;
        let watch = Watch::new(console)?;
        let mut reports = Vec::with_capacity(pipelines.len());
        for pipeline in &pipelines {
            let report = merge(pipeline, self.pieces, &settings, &watch)?;
            report.notes.iter().for_each(|note| console.note(note));
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

fn count(text: &str) -> Result<usize, String> {
    let number = text.parse().ok().filter(|n| (1..=MOST).contains(n));
    number.ok_or_else(|| format!("expected a whole number from 1 to {MOST}"))
}
