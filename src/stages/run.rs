//! What a stage has at hand when it runs: the scene, what earlier stages found, and the book of files.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use serde::Serialize;
use serde_json::{Map, Value};

use super::occlusion::OcclusionPlan;
use super::piece::Joined;
use super::prepare::Loaded;
use super::{Plan, Ref, StageError};
use crate::io;
use crate::occlusion::{Directional, Estimates};
use crate::progress::Progress;
use crate::session::Session;

/// Who knows which files have to be made, and remembers those that were.
pub trait Ledger {
    /// Whether this file, below the output folder, has to be made.
    fn is_stale(&self, file: &Path) -> bool;

    /// Remembers a file that was just written, on disk, so that the next run trusts it.
    ///
    /// # Errors
    /// If that can't be written down.
    fn record(&mut self, made: Made) -> Result<(), io::Error>;

    /// Forgets a file that was taken away.
    ///
    /// # Errors
    /// If that can't be written down.
    fn forget(&mut self, file: &Path) -> Result<(), io::Error>;
}

/// A file that was just written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Made<'a> {
    /// Its path below the output folder.
    pub file: &'a Path,
    /// Its length.
    pub bytes: u64,
    /// What the user should know of it, now and whenever it is found unchanged.
    pub notes: Vec<String>,
    /// Whether the user is told of it, as of something the pipeline names.
    pub named: bool,
    /// Whether it was there already. No key is needed then.
    pub unchanged: bool,
}

/// What a run has computed: to be held against that of others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Work {
    /// Vertices at which ambient occlusion was found.
    pub vertices: u64,
    /// Voxels whose shade was found, with those beyond a piece's own layers.
    pub voxels: u64,
}

/// A run in progress.
pub struct Run<'p> {
    /// What is to be done.
    pub plan: &'p Plan,
    /// The pipeline as a text, which files tell.
    pub told: &'p str,
    /// Who watches.
    pub progress: &'p dyn Progress,
    /// The book of files.
    pub ledger: &'p mut dyn Ledger,
    /// The values that were read from files.
    pub loaded: BTreeMap<Ref<OcclusionPlan>, Loaded>,
    /// Whether all is made again.
    pub force: bool,
    /// The pieces that were made before, if their parts are to be joined.
    pub joined: Option<Joined>,
    /// What was computed so far.
    pub work: Work,
    /// Of stages whose work was done for the sake of a later one: how long it took, and what is worth telling.
    pub early: BTreeMap<usize, (Duration, Told)>,
}

/// What is worth telling of a stage's work.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Told {
    /// For people: `8,192 rays, 2.09 million a second`.
    pub text: String,
    /// For programs: the same numbers by their names.
    pub numbers: Map<String, Value>,
}

impl Told {
    /// A text, and the object that has its numbers.
    pub fn new(text: String, numbers: Value) -> Self {
        let numbers = match numbers {
            Value::Object(numbers) => numbers,
            _ => Map::new(),
        };
        Self { text, numbers }
    }
}

impl From<&str> for Told {
    fn from(text: &str) -> Self {
        Self { text: text.to_owned(), numbers: Map::new() }
    }
}

impl Run<'_> {
    /// Remembers work that was done for the sake of a later stage.
    pub fn tell_early(&mut self, stage: usize, took: Duration, told: impl FnOnce(Duration) -> Told) {
        self.early.insert(stage, (took, told(took)));
    }

    /// The files of a stage that have to be made.
    pub fn is_stale(&self, file: &Path) -> bool {
        self.ledger.is_stale(file)
    }

    /// Remembers a file that the pipeline names.
    ///
    /// # Errors
    /// If that can't be written down.
    pub fn made(&mut self, file: &Path, bytes: u64, notes: Vec<String>) -> Result<(), StageError> {
        Ok(self.ledger.record(Made { file, bytes, notes, named: true, unchanged: false })?)
    }

    /// Remembers a file that goes with another.
    ///
    /// # Errors
    /// If that can't be written down.
    pub fn made_beside(&mut self, file: &Path, bytes: u64) -> Result<(), StageError> {
        Ok(self.ledger.record(Made { file, bytes, notes: Vec::new(), named: false, unchanged: false })?)
    }
}

/// What has been made of a scene so far.
#[derive(Debug)]
pub struct SceneRun<const D: usize> {
    /// The scene, and what traces rays in it.
    pub session: Session<D>,
    /// The values that are known.
    pub values: BTreeMap<Ref<OcclusionPlan>, Arc<Estimates>>,
    /// Values with directions, of all vertices.
    pub directions: BTreeMap<Ref<OcclusionPlan>, Arc<Directional<D>>>,
}

impl<const D: usize> SceneRun<D> {
    /// A scene of which nothing is known yet.
    pub fn new(session: Session<D>) -> Self {
        Self { session, values: BTreeMap::new(), directions: BTreeMap::new() }
    }
}
