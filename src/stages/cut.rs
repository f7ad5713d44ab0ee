//! How a figure cuts a volume open: `none`, `octant`, or `{plane: x, at: 0.0}`.
//!
//! The image of a closed body is a filled solid of voxels; only a cut shows what occlusion does inside.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{self, Deserialize, Deserializer, MapAccess, Visitor};
use serde::{Serialize, Serializer};

/// What is taken away from a volume.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Cut {
    /// Nothing.
    #[default]
    None,
    /// The octant that faces the viewer.
    Octant,
    /// One side of a plane.
    Plane(Plane),
}

/// A plane across the image.
#[derive(Clone, Copy, Debug, serde::Deserialize, JsonSchema, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Plane {
    /// The axis it is perpendicular to.
    pub plane: Axis,
    /// Where it meets that axis, in the image's coordinates (default 0).
    #[serde(default)]
    pub at: f64,
}

/// An axis of the image.
#[derive(Clone, Copy, Debug, serde::Deserialize, JsonSchema, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    /// To the right.
    X,
    /// Up.
    Y,
    /// Over.
    Z,
}

const WORDS: [&str; 2] = ["none", "octant"];

impl<'de> Deserialize<'de> for Cut {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct CutVisitor;
        impl<'de> Visitor<'de> for CutVisitor {
            type Value = Cut;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("none, octant or {plane: x, at: 0.0}")
            }

            fn visit_str<E: de::Error>(self, word: &str) -> Result<Cut, E> {
                match word {
                    "none" => Ok(Cut::None),
                    "octant" => Ok(Cut::Octant),
                    _ => Err(E::unknown_variant(word, &WORDS)),
                }
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Cut, A::Error> {
                Plane::deserialize(MapAccessDeserializer::new(map)).map(Cut::Plane)
            }
        }
        deserializer.deserialize_any(CutVisitor)
    }
}

impl Serialize for Cut {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Cut::None => "none".serialize(serializer),
            Cut::Octant => "octant".serialize(serializer),
            Cut::Plane(plane) => plane.serialize(serializer),
        }
    }
}

impl JsonSchema for Cut {
    fn schema_name() -> Cow<'static, str> {
        "Cut".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let plane = generator.subschema_for::<Plane>();
        json_schema!({"oneOf": [{"type": "string", "enum": WORDS}, plane]})
    }
}
