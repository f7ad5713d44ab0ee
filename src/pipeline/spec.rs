//! A pipeline as it is written: the shape of the YAML, and no more.
//!
//! Every optional key is an `Option` here, even where there is a default, so that the plan can tell what was said from
//! what wasn't. Numbers are whatever was typed; ranges, references between stages and lengths of vectors are checked
//! by each stage. The doc comments are what `ao4d schema` shows in an editor.

use schemars::JsonSchema;
use serde::Deserialize;

use crate::stages::StageSpec;

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
}
