//! An id, or a list of ids.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Deserialize, Deserializer, SeqAccess, Visitor};
use serde::{Serialize, Serializer};

/// `ID` or `[ID, ID, ...]`.
#[derive(Clone, Debug, PartialEq)]
pub enum OneOrMany {
    /// One id.
    One(String),
    /// Any number of them.
    Many(Vec<String>),
}

impl OneOrMany {
    /// The ids, and the path of each below the key that holds them.
    pub fn iter(&self) -> impl Iterator<Item = (&str, String)> {
        let (ids, many) = match self {
            OneOrMany::One(id) => (std::slice::from_ref(id), false),
            OneOrMany::Many(ids) => (ids.as_slice(), true),
        };
        ids.iter().enumerate().map(move |(i, id)| (id.as_str(), if many { format!("[{i}]") } else { String::new() }))
    }
}

impl<'de> Deserialize<'de> for OneOrMany {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Ids;
        impl<'de> Visitor<'de> for Ids {
            type Value = OneOrMany;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an id or a list of ids")
            }

            fn visit_str<E>(self, id: &str) -> Result<OneOrMany, E> {
                Ok(OneOrMany::One(id.to_owned()))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<OneOrMany, A::Error> {
                let mut ids = Vec::new();
                while let Some(id) = items.next_element()? {
                    ids.push(id);
                }
                Ok(OneOrMany::Many(ids))
            }
        }
        deserializer.deserialize_any(Ids)
    }
}

impl Serialize for OneOrMany {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            OneOrMany::One(id) => id.serialize(serializer),
            OneOrMany::Many(ids) => ids.serialize(serializer),
        }
    }
}

impl JsonSchema for OneOrMany {
    fn schema_name() -> Cow<'static, str> {
        "OneOrMany".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({"oneOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]})
    }
}
