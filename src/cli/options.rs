//! Options that several verbs share.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use ao4d::pipeline::{Backend, Pipeline, Settings};
use clap::Args;

use super::Failure;
use super::console::Console;

/// How much is said on stderr.
#[derive(Args, Clone, Copy, Debug)]
pub struct Messages {
    /// Say results and errors only
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Say more
    #[arg(short, long, global = true)]
    pub verbose: bool,
}

/// A pipeline, and how it is run.
#[derive(Args, Debug)]
pub struct PipelineOptions {
    /// The pipeline's file, or several
    #[arg(value_name = "PIPELINE.yaml", required = true)]
    pub pipelines: Vec<PathBuf>,
    /// Change a value for this run: occlusion.samples=64, ID.key=..., seed=3; an empty VALUE takes the key out
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Write into this folder instead of out/NAME
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// What traces rays: cpu, opencl, or opencl:PLATFORM.DEVICE, several joined by +
    #[arg(long, value_name = "BACKEND", default_value = "cpu")]
    pub backend: Backend,
    /// How many threads to use [default: all]
    #[arg(long, value_name = "N", value_parser = threads)]
    pub threads: Option<NonZeroUsize>,
    /// Compute again what is cached
    #[arg(long)]
    pub force: bool,
}

impl PipelineOptions {
    /// Reads and checks the pipelines, and prints their warnings. One that is refused refuses them all.
    pub fn load_all(&self, console: &Console) -> Result<(Vec<Pipeline>, Settings), Failure> {
        let settings = Settings { backend: self.backend.clone(), threads: self.threads, force: self.force };
        if self.pipelines.len() > 1 && self.out.is_some() {
            return Err(Failure::refused(
                "--out names one folder, and there are several pipelines; run them one by one",
            ));
        }
        let load = |path: &PathBuf| Pipeline::load(path, &self.set, self.out.clone());
        let pipelines = self.pipelines.iter().map(load).collect::<Result<Vec<_>, _>>()?;
        for (i, pipeline) in pipelines.iter().enumerate() {
            if let Some(other) = pipelines[..i].iter().find(|p| p.plan.out == pipeline.plan.out) {
                let (a, b) = (other.document.file(), pipeline.document.file());
                return Err(Failure::refused(format!(
                    "{a} and {b} have the same name, so one would overwrite the other"
                )));
            }
            pipeline.warnings().for_each(|warning| console.warn(&warning));
        }
        Ok((pipelines, settings))
    }

    /// The same for a verb that takes one pipeline.
    pub fn load(&self, console: &Console) -> Result<(Pipeline, Settings), Failure> {
        if self.pipelines.len() > 1 {
            return Err(Failure::refused("expected one pipeline"));
        }
        let (mut pipelines, settings) = self.load_all(console)?;
        let pipeline = pipelines.pop().ok_or_else(|| Failure::refused("expected a pipeline"))?;
        Ok((pipeline, settings))
    }
}

/// A sensible number of threads: more than this only costs memory.
fn threads(text: &str) -> Result<NonZeroUsize, String> {
    let number = text.parse::<NonZeroUsize>().ok().filter(|n| n.get() <= 1024);
    number.ok_or_else(|| "expected a whole number from 1 to 1024".into())
}
