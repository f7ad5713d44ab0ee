//! What a run did: files, times, and what the user should know.

use std::path::PathBuf;
use std::time::Duration;

use serde::Serialize;

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
    pub fn stage(&mut self, stage: String, time: Duration, detail: String) {
        self.stages.push(StageTime { stage, seconds: time.as_secs_f64(), detail });
    }
}
