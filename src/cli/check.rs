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
    /// Print the plans as JSON: {"pipelines": [...]}
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
        let mut described = Vec::new();
        for pipeline in &pipelines {
            let running = progress.stage("reading inputs", 0);
            let prepared = pool.install(|| pipeline.prepare_watched(|_| true, progress));
            running.end();
            if watch.cancelled() {
                return Err(Failure::Cancelled);
            }
            let prepared = prepared?;
            prepared.notes.iter().flatten().for_each(|note| console.note(note));
            let counts = prepared.counts();
            let description = pipeline.plan.describe(&counts);
            if self.json {
                described.push(serde_json::to_value(&description).map_err(|e| Failure::Failed(Box::new(e)))?);
            } else {
                console.result(&description.to_string())?;
            }
        }
        if self.json {
            console.pipelines(&described)?;
        }
        Ok(Outcome::Done)
    }
}
