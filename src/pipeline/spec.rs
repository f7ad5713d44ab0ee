//! A pipeline as it is written: the shape of the YAML, and no more.
//!
//! Every optional key is an `Option` here, even where there is a default, so that the plan can tell what was said from
//! what wasn't. Numbers are whatever was typed; ranges, references between stages and lengths of vectors are checked
//! by each stage. The doc comments are what `ao4d schema` shows in an editor.

use std::collections::BTreeMap;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Deserialize;

use crate::stages::{OneOrMany, StageSpec};

/// A pipeline: named stages that turn a scene into images.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "ao4d pipeline")]
pub struct PipelineSpec {
    /// The pipeline's name; its files go into the folder `out/NAME/`.
    pub name: String,
    /// What all random numbers start from (default 0). The same seed gives the same bytes.
    pub seed: Option<u64>,
    /// What to do, in order. A stage works on the nearest earlier stage of the kind it needs, or on the one its `input` names.
    pub stages: Vec<StageSpec>,
    /// The program that this was written by, as files tell it; another version may make other files of it.
    pub program: Option<String>,
    /// Where relative paths of inputs start (default the pipeline's own folder).
    pub folder: Option<PathBuf>,
    /// Values by name: a value `$NAME` is that value, and `${NAME}` within a text its text; `$$` is a dollar sign.
    pub variables: Option<BTreeMap<String, serde_json::Value>>,
    /// Other files, by their names from here, whose stages come before those of this one; their variables hold where this
    /// one doesn't give its own. Among the stages, `- include: FILE` puts a file's stages there.
    pub include: Option<OneOrMany>,
    /// Keys as `--set` names them, each with a list of values: every combination is a pipeline of its own, NAME-KEY-VALUE.
    pub sweep: Option<BTreeMap<String, Vec<serde_json::Value>>>,
    /// Inputs that must be what they were. One that changed is refused.
    pub inputs: Option<Vec<InputSpec>>,
}

/// An input file, and what is in it.
#[derive(Clone, Debug, Deserialize, JsonSchema, PartialEq, Eq)]
#[serde(deny_unknown_fields)]
pub struct InputSpec {
    /// The file, as stages name it.
    pub file: PathBuf,
    /// The SHA-256 of its content, in hexadecimal digits.
    pub sha256: String,
}
