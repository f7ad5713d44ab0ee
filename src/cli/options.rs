//! Options that several verbs share.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use ao4d::pipeline::{Backend, Document, Pipeline, STDIN, Settings};
use clap::{Args, ValueEnum};

use super::Failure;
use super::console::Console;

/// How much is said on stderr, and in what form.
#[derive(Args, Clone, Copy, Debug)]
pub struct Messages {
    /// Say results and errors only; the same as --log-level error
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Say more; the same as --log-level debug
    #[arg(short, long, global = true)]
    pub verbose: bool,
    /// What is said on stderr: error, warn, info, or debug [default: info]
    #[arg(long, value_name = "LEVEL", global = true, conflicts_with_all = ["quiet", "verbose"], hide_possible_values = true)]
    pub log_level: Option<Level>,
    /// How work is told on stderr: bar, json (a line for each event and message), or none [default: bar]
    #[arg(long, value_name = "FORM", global = true, hide_possible_values = true)]
    pub progress: Option<Form>,
}

/// How important a message is; the last says most.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub enum Level {
    /// What ended the work.
    Error,
    /// What is probably not meant, too.
    Warn,
    /// Notes, too.
    #[default]
    Info,
    /// The time of each step, too.
    Debug,
}

/// How the course of work is told.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Form {
    /// A bar on a terminal, nothing elsewhere.
    #[default]
    Bar,
    /// A line of JSON an event.
    Json,
    /// Not at all.
    None,
}

impl Messages {
    /// What is said.
    pub fn level(self) -> Level {
        match (self.quiet, self.verbose) {
            (true, _) => Level::Error,
            (_, true) => Level::Debug,
            _ => self.log_level.unwrap_or_default(),
        }
    }
}

/// A pipeline, and how it is run.
#[derive(Args, Debug)]
pub struct PipelineOptions {
    /// The pipeline's file, several, or patterns such as 'lessons/*.yaml'; - reads standard input
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
    /// Whether pipelines that make no page are to make one.
    #[arg(skip)]
    pub page: bool,
}

impl PipelineOptions {
    /// Reads and checks the pipelines, and prints their warnings. One that is refused refuses them all.
    pub fn load_all(&self, console: &Console) -> Result<(Vec<Pipeline>, Settings), Failure> {
        let settings = Settings { backend: self.backend.clone(), threads: self.threads, force: self.force };
        let files = files(&self.pipelines)?;
        if files.len() > 1 && self.out.is_some() {
            return Err(Failure::refused(
                "--out names one folder, and there are several pipelines; run them one by one",
            ));
        }
        let mut pipelines = Vec::new();
        for file in &files {
            let mut document = Document::read(file)?;
            if self.page {
                document.add_page();
            }
            pipelines.extend(Pipeline::swept(document, &self.set, self.out.clone())?);
        }
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
        if pipelines.len() > 1 {
            return Err(Failure::refused("expected one pipeline; take its sweep out by --set sweep="));
        }
        let pipeline = pipelines.pop().ok_or_else(|| Failure::refused("expected a pipeline"))?;
        Ok((pipeline, settings))
    }
}

/// The files that are named: patterns that are no file's name stand for the files that fit them, in order.
fn files(named: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let mut files: Vec<PathBuf> = Vec::new();
    for path in named {
        let pattern = path.to_str().filter(|text| text.contains(['*', '?', '[']) && !path.exists());
        let Some(pattern) = pattern else {
            files.push(path.clone());
            continue;
        };
        let refuse = |message: String| Failure::refused(format!("{pattern}: {message}"));
        let found = glob::glob(pattern).map_err(|e| refuse(format!("is no pattern: {}", e.msg)))?;
        let found = found.collect::<Result<Vec<_>, _>>().map_err(|e| refuse(e.to_string()))?;
        if found.is_empty() {
            return Err(refuse("no file fits this pattern".to_owned()));
        }
        files.extend(found);
    }
    if files.iter().filter(|path| path.as_os_str() == STDIN).count() > 1 {
        return Err(Failure::refused("standard input can be read once; give `-` once"));
    }
    Ok(files)
}

/// A sensible number of threads: more than this only costs memory.
fn threads(text: &str) -> Result<NonZeroUsize, String> {
    let number = text.parse::<NonZeroUsize>().ok().filter(|n| n.get() <= 1024);
    number.ok_or_else(|| "expected a whole number from 1 to 1024".into())
}
