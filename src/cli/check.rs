//! `ao4d check`: everything short of running.

use ao4d::pipeline::{Backend, RunError};
use ao4d::progress::Progress;
use ao4d::trace::opencl::OpenCl;
use clap::Args;

use super::console::Console;
use super::options::PipelineOptions;
use super::watch::Watch;
use super::{Failure, Outcome};

/// What `check` takes: the same as `run`, so that one word changes between the two.
#[derive(Args, Debug)]
pub struct Check {
    #[command(flatten)]
    options: PipelineOptions,
    /// Print the plan as JSON
    #[arg(long)]
    json: bool,
}

impl Check {
    pub fn execute(self, console: &Console) -> Result<Outcome, Failure> {
        let (pipelines, settings) = self.options.load_all(console)?;
        if let Backend::OpenCl(places) = &settings.backend {
            OpenCl::open(places).map_err(|error| Failure::Failed(Box::new(error)))?;
        }
        let watch = Watch::new(console)?;
        let progress: &dyn Progress = &watch;
        let pool = settings.pool().map_err(RunError::Threads)?;
        for pipeline in &pipelines {
            let running = progress.stage("reading inputs", 0);
            let prepared = pool.install(|| pipeline.prepare_watched(|_| true, progress));
            running.end();
            if watch.cancelled() {
                return Err(Failure::Cancelled);
            }
            let prepared = prepared?;
            prepared.notes.iter().flatten().for_each(|note| console.note(&format!("note: {note}")));
            let counts = prepared.counts();
            let description = pipeline.plan.describe(&counts);
            if self.json { console.json(&description) } else { console.result(&description.to_string()) }?;
        }
        Ok(Outcome::Done)
    }
}
