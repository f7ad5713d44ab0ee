//! What a run did: files, times, and what the user should know.

use std::fmt;
use std::path::PathBuf;
use std::time::Duration;

use serde::Serialize;
use serde_json::{Map, Value};

use crate::stages::describe::size;
use crate::stages::{Told, Work};

/// A finished run.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Report {
    /// The folder that the files are in.
    pub out: PathBuf,
    /// How long each stage took, in the order of the pipeline.
    pub stages: Vec<StageTime>,
    /// The files, in the order they were made.
    pub files: Vec<FileReport>,
    /// What is not wrong, but not what one would expect either.
    pub notes: Vec<String>,
    /// Seconds in all.
    pub seconds: f64,
    /// What was computed.
    pub work: Work,
    /// The piece of the run that this was, K/N, if it wasn't all of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub piece: Option<String>,
}

/// A stage's time.
#[derive(Clone, Debug, Serialize)]
pub struct StageTime {
    /// Its kind and id.
    pub stage: String,
    /// Seconds; zero where nothing had to be done.
    pub seconds: f64,
    /// More about the work: rays a second, say.
    pub detail: String,
    /// The numbers in it, by their names.
    pub numbers: Map<String, Value>,
}

/// A file in the output folder.
#[derive(Clone, Debug, Serialize)]
pub struct FileReport {
    /// Its path within that folder.
    pub path: PathBuf,
    /// Its length.
    pub bytes: u64,
    /// Whether it was there already, from the same inputs.
    pub cached: bool,
}

impl Report {
    /// Adds a stage.
    pub fn stage(&mut self, stage: String, time: Duration, told: Told) {
        let Told { text: detail, numbers } = told;
        self.stages.push(StageTime { stage, seconds: time.as_secs_f64(), detail, numbers });
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = self.stages.iter().map(|s| s.stage.chars().count()).max().unwrap_or(0);
        for StageTime { stage, seconds, detail, .. } in &self.stages {
            writeln!(f, "{}", format!("{stage:width$}  {seconds:7.3} s  {detail}").trim_end())?;
        }
        writeln!(f, "{:width$}  {:7.3} s", "in all", self.seconds)?;
        let width = self.files.iter().map(|f| f.path.display().to_string().chars().count()).max().unwrap_or(0);
        writeln!(f, "{}:", self.out.display())?;
        for FileReport { path, bytes, cached } in &self.files {
            let unchanged = if *cached { "  unchanged" } else { "" };
            writeln!(f, "  {:width$}  {:>9}{unchanged}", path.display().to_string(), size(*bytes))?;
        }
        Ok(())
    }
}
