//! The JSON Schema of a pipeline, from which editors complete and check as one types.
//!
//! It is derived from the very types that decode a pipeline, so it can't know other keys than they do.

use super::spec::PipelineSpec;

/// The schema, as JSON Schema draft 2020-12.
pub fn schema() -> serde_json::Value {
    schemars::schema_for!(PipelineSpec).to_value()
}
