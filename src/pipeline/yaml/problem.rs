//! What goes wrong in decoding, and how it is said.
//!
//! `serde` makes an error deep inside a structure, knowing neither the path nor the line. The decoder adds both while
//! the error travels outwards: the innermost node it passes gives the line, each mapping and list a step of the path.
//! `serde`'s words are Rust's (`u64`, `sequence`, `struct RenderSpec`), so they are put into YAML's here.

use std::fmt;

use serde::de::{self, Expected, Unexpected};

use super::{Origin, Segment, shorten, show_path};
use crate::pipeline::suggest;
use crate::text::number;

/// A refusal on its way out.
#[derive(Debug)]
pub struct Problem {
    /// Where it happened, once known.
    pub origin: Option<Origin>,
    /// Steps of the path, the innermost first.
    path: Vec<Segment>,
    /// What is wrong.
    what: What,
}

#[derive(Debug)]
enum What {
    Message(String),
    Unknown { noun: &'static str, word: String, known: &'static [&'static str] },
}

impl Problem {
    /// A refusal with this message.
    pub fn new(message: impl Into<String>) -> Self {
        Problem { origin: None, path: Vec::new(), what: What::Message(message.into()) }
    }

    /// With a place, unless an inner one is known.
    pub fn or_at(mut self, origin: Origin) -> Self {
        self.origin.get_or_insert(origin);
        self
    }

    /// With this place, whatever was known.
    pub fn at(mut self, origin: Origin) -> Self {
        self.origin = Some(origin);
        self
    }

    /// As it looks one step further out.
    pub fn inside(mut self, segment: Segment) -> Self {
        self.path.push(segment);
        self
    }

    /// Calls an unknown word this.
    pub fn about(mut self, name: &'static str) -> Self {
        if let What::Unknown { noun, .. } = &mut self.what {
            *noun = name;
        }
        self
    }

    /// The dotted path, empty at the top.
    pub fn path(&self) -> String {
        let outwards: Vec<Segment> = self.path.iter().rev().cloned().collect();
        show_path(&outwards)
    }

    /// The words that would have been accepted where an unknown one stood.
    #[cfg(test)]
    pub fn known(&self) -> &'static [&'static str] {
        match &self.what {
            What::Unknown { known, .. } => known,
            What::Message(_) => &[],
        }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.what {
            What::Message(message) => f.write_str(message),
            What::Unknown { noun, word, known } => {
                // A key is seen at the path's end already.
                let word_shown = if *noun == "key" { String::new() } else { format!(" `{}`", shorten(word)) };
                f.write_str(&suggest::unknown(&format!("unknown {noun}{word_shown}"), word, known.iter().copied()))
            }
        }
    }
}

impl std::error::Error for Problem {}

impl de::Error for Problem {
    fn custom<T: fmt::Display>(message: T) -> Self {
        Problem::new(message.to_string())
    }

    fn invalid_type(found: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Problem::new(format!("expected {}, found {}", in_words(&expected.to_string()), found_in_words(found)))
    }

    fn invalid_value(found: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Self::invalid_type(found, expected)
    }

    fn invalid_length(length: usize, expected: &dyn Expected) -> Self {
        Problem::new(format!("expected {}, found {length}", in_words(&expected.to_string())))
    }

    fn unknown_variant(word: &str, known: &'static [&'static str]) -> Self {
        Problem { what: What::Unknown { noun: "value", word: word.to_owned(), known }, ..Problem::new("") }
    }

    fn unknown_field(word: &str, known: &'static [&'static str]) -> Self {
        Problem { what: What::Unknown { noun: "key", word: word.to_owned(), known }, ..Problem::new("") }
    }

    fn missing_field(key: &'static str) -> Self {
        Problem::new(format!("the key `{key}` is missing"))
    }

    fn duplicate_field(key: &'static str) -> Self {
        Problem::new(format!("the key `{key}` stands twice"))
    }
}

/// What `serde` expected, for people.
fn in_words(expected: &str) -> String {
    match expected {
        "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number, 0 or above".into(),
        "i8" | "i16" | "i32" | "i64" | "isize" => "a whole number".into(),
        "f32" | "f64" => "a number".into(),
        "a string" | "str" => "text".into(),
        "a boolean" => "true or false".into(),
        "a sequence" => "a list".into(),
        "a map" => "a mapping".into(),
        "variant identifier" | "field identifier" => "a word".into(),
        other if other.starts_with("struct ") => "a mapping".into(),
        other => match other.strip_prefix("an array of length ") {
            Some(n) => format!("a list of {n}"),
            None => other.to_owned(),
        },
    }
}

/// What `serde` met, for people.
fn found_in_words(found: Unexpected<'_>) -> String {
    match found {
        Unexpected::Bool(b) => format!("`{b}`"),
        Unexpected::Unsigned(n) => format!("the number {n}"),
        Unexpected::Signed(n) => format!("the number {n}"),
        Unexpected::Float(x) => format!("the number {}", number(x)),
        Unexpected::Str(text) => format!("the text \"{}\"", shorten(text)),
        Unexpected::Unit | Unexpected::Option => "nothing".into(),
        Unexpected::Seq => "a list".into(),
        Unexpected::Map => "a mapping".into(),
        other => other.to_string(),
    }
}
