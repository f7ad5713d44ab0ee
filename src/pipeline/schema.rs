//! The JSON Schema of a pipeline, from which editors complete and check as one types.
//!
//! It is derived from the very types that decode a pipeline, so it can't know other keys than they do.

use serde_json::{Value, json};

use super::spec::PipelineSpec;

/// What the schema is called, wherever it lies.
const ID: &str = "urn:ao4d:schema:pipeline";

/// The schema, as JSON Schema draft 2020-12.
pub fn schema() -> Value {
    let mut schema = schemars::schema_for!(PipelineSpec).to_value();
    if let Some(items) = schema.pointer_mut("/properties/stages/items") {
        let file = json!({ "type": "string", "description": "A file whose stages stand here." });
        let include = json!({
            "type": "object", "description": "The stages of another file.", "properties": { "include": file },
            "required": ["include"], "additionalProperties": false
        });
        *items = json!({ "anyOf": [items.take(), include] });
    }
    allow_own_keys(&mut schema);
    if let Value::Object(map) = &mut schema {
        map.insert("$id".to_owned(), ID.into());
    }
    schema
}

/// Keys that begin with `x-` are the user's own, wherever keys are.
fn allow_own_keys(schema: &mut Value) {
    match schema {
        Value::Object(map) => {
            if map.contains_key("properties") {
                map.insert("patternProperties".to_owned(), json!({ "^x-": true }));
            }
            map.values_mut().for_each(allow_own_keys);
        }
        Value::Array(items) => items.iter_mut().for_each(allow_own_keys),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use serde::de::DeserializeOwned;

    use super::*;
    use crate::pipeline::spec::InputSpec;
    use crate::pipeline::yaml;
    use crate::render::Aov;
    use crate::scene::ObjectSpec;
    use crate::stages::StageSpec;
    use crate::stages::animate::{AnimateSpec, MoveSpec, TurnSpec};
    use crate::stages::camera::{CameraSpec, Projection};
    use crate::stages::cut::{Axis, Plane};
    use crate::stages::mesh::MeshSpec;
    use crate::stages::occlusion::{Method, OcclusionSpec};
    use crate::stages::page::PageSpec;
    use crate::stages::paraview::{ColorBy, ParaviewSpec, Reader, Style};
    use crate::stages::render::{RenderSpec, Shading};
    use crate::stages::scene::SceneSpec;
    use crate::stages::screen_space::ScreenSpaceSpec;
    use crate::stages::shade::ShadeSpec;
    use crate::stages::write::{Compression, Encoding, WriteSpec};

    /// The words that the decoder proposes where it meets one that nobody would use.
    fn decoder_knows<T: DeserializeOwned>(text: &str) -> BTreeSet<String> {
        let tree = yaml::parse(text).unwrap();
        match yaml::decode::<T>(&tree) {
            Ok(_) => panic!("{text} was accepted"),
            Err(problem) => problem.known().iter().map(|&word| word.to_owned()).collect(),
        }
    }

    /// The keys or words that a definition allows.
    fn schema_knows(definition: &Value) -> BTreeSet<String> {
        if let Some(properties) = definition.get("properties") {
            assert_eq!(definition["additionalProperties"], Value::Bool(false), "{definition}");
            return properties.as_object().unwrap().keys().cloned().collect();
        }
        if let Some(words) = definition.get("enum") {
            return words.as_array().unwrap().iter().map(|w| w.as_str().unwrap().to_owned()).collect();
        }
        let choices = definition["oneOf"].as_array().unwrap_or_else(|| panic!("neither keys nor words: {definition}"));
        choices
            .iter()
            .flat_map(|choice| match choice.get("const") {
                Some(word) => BTreeSet::from([word.as_str().unwrap().to_owned()]),
                None => schema_knows(choice),
            })
            .collect()
    }

    #[test]
    fn decoder_and_schema_know_the_same_words() {
        let schema = schema();
        assert_eq!(decoder_knows::<PipelineSpec>("{zzz: 1}"), schema_knows(&schema));
        let definitions = schema["$defs"].as_object().unwrap();
        for (name, known) in [
            ("StageSpec", decoder_knows::<StageSpec>("{zzz: 1}")),
            ("SceneSpec", decoder_knows::<SceneSpec>("{zzz: 1}")),
            ("ObjectSpec", decoder_knows::<ObjectSpec>("{zzz: 1}")),
            ("OcclusionSpec", decoder_knows::<OcclusionSpec>("{zzz: 1}")),
            ("RenderSpec", decoder_knows::<RenderSpec>("{zzz: 1}")),
            ("CameraSpec", decoder_knows::<CameraSpec>("{zzz: 1}")),
            ("WriteSpec", decoder_knows::<WriteSpec>("{zzz: 1}")),
            ("AnimateSpec", decoder_knows::<AnimateSpec>("{zzz: 1}")),
            ("TurnSpec", decoder_knows::<TurnSpec>("{zzz: 1}")),
            ("MoveSpec", decoder_knows::<MoveSpec>("{zzz: 1}")),
            ("MeshSpec", decoder_knows::<MeshSpec>("{zzz: 1}")),
            ("ScreenSpaceSpec", decoder_knows::<ScreenSpaceSpec>("{zzz: 1}")),
            ("ShadeSpec", decoder_knows::<ShadeSpec>("{zzz: 1}")),
            ("InputSpec", decoder_knows::<InputSpec>("{zzz: 1}")),
            ("PageSpec", decoder_knows::<PageSpec>("{zzz: 1}")),
            ("ParaviewSpec", decoder_knows::<ParaviewSpec>("{zzz: 1}")),
            ("Plane", decoder_knows::<Plane>("{zzz: 1}")),
            ("Method", decoder_knows::<Method>("zzz")),
            ("Projection", decoder_knows::<Projection>("zzz")),
            ("Shading", decoder_knows::<Shading>("zzz")),
            ("Aov", decoder_knows::<Aov>("zzz")),
            ("Encoding", decoder_knows::<Encoding>("zzz")),
            ("Compression", decoder_knows::<Compression>("zzz")),
            ("Reader", decoder_knows::<Reader>("zzz")),
            ("Style", decoder_knows::<Style>("zzz")),
            ("ColorBy", decoder_knows::<ColorBy>("zzz")),
            ("Axis", decoder_knows::<Axis>("zzz")),
        ] {
            assert!(!known.is_empty(), "{name}");
            assert_eq!(known, schema_knows(&definitions[name]), "{name}");
        }
    }

    #[test]
    fn every_key_is_explained() {
        fn check(path: &str, value: &Value) {
            if let Some(properties) = value.get("properties").and_then(Value::as_object) {
                for (key, property) in properties {
                    // The key of a stage is explained at the stage's own definition.
                    let itself = property.get("description").is_some() || property.get("$ref").is_some();
                    // One of several things that a value may be is explained as a whole.
                    let explained = itself || properties.len() == 1 && value.get("description").is_some();
                    assert!(explained, "{path}.{key} has no description");
                }
            }
            match value {
                Value::Object(map) => map.iter().for_each(|(key, inner)| check(&format!("{path}.{key}"), inner)),
                Value::Array(items) => items.iter().for_each(|inner| check(path, inner)),
                _ => {}
            }
        }
        check("", &schema());
    }
}
