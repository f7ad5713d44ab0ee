//! YAML that remembers where everything stands.
//!
//! A pipeline is written by hand, so every complaint about it must say where: file, line, column and the dotted path of
//! the key. Decoding straight from text to structures loses that as soon as the first check is made afterwards. So
//! there are three steps. `parse` turns the text into a tree of [`Node`]s, each with its [`Origin`]. Overrides from
//! the command line edit that tree, and mark what they touched. `decode` turns the tree into `serde` structures,
//! and any later check can ask the [`Document`](super::Document) where a path such as `stages[1].render.dimensions` is.
//!
//! Parsing is left to `serde_saphyr`, which tells where each value stands. It can't do the rest: it decodes text only, so
//! there is no tree that overrides could edit; it decodes on the way, so a path and its place are gone when
//! a later check wants to cite them; and its errors carry no path.

mod decode;
mod emit;
mod parse;
mod path;
mod problem;

pub(super) use decode::decode;
pub(super) use emit::{emit, fill, from_json, map, node};
pub(super) use parse::parse;
pub(super) use path::{Segment, parse_path, show_path};
pub(super) use problem::Problem;

use crate::text::number;

/// Lists and mappings deeper than this are refused: no pipeline needs them, and the stack stays small.
pub(super) const MAX_DEPTH: usize = 64;

/// Where a node was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Origin {
    /// In the file; both count from 1, columns in characters.
    File {
        /// The line.
        line: usize,
        /// The column.
        column: usize,
    },
    /// In the command line's override of this number, counted from 0.
    Set(usize),
    /// In the included file of this number, counted from 0.
    Included {
        /// Its number.
        file: usize,
        /// The line.
        line: usize,
        /// The column.
        column: usize,
    },
}

/// A value and where it stands.
#[derive(Clone, Debug)]
pub(super) struct Node {
    /// Where the value begins.
    pub origin: Origin,
    /// What it is.
    pub value: Value,
}

/// What YAML's core schema makes of a node.
#[derive(Clone, Debug)]
pub(super) enum Value {
    /// Nothing, `~` or `null`.
    Null,
    /// `true` or `false`.
    Bool(bool),
    /// A whole number within 64 bits.
    Integer(i128),
    /// Any other number, `.inf` and `.nan` included.
    Float(f64),
    /// Everything else, and whatever is quoted.
    Text(String),
    /// A sequence.
    List(Vec<Node>),
    /// A mapping, in the order written; keys are unique.
    Map(Vec<Entry>),
}

/// One key of a mapping.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    /// The key as written, without quotes.
    pub key: String,
    /// Where the key stands.
    pub origin: Origin,
    /// What it is given.
    pub value: Node,
}

impl Node {
    /// The value of a mapping's key.
    pub fn get(&self, key: &str) -> Option<&Node> {
        match &self.value {
            Value::Map(entries) => entries.iter().find(|e| e.key == key).map(|e| &e.value),
            _ => None,
        }
    }

    /// The text, where the node is text.
    pub fn as_text(&self) -> Option<&str> {
        match &self.value {
            Value::Text(text) => Some(text),
            _ => None,
        }
    }

    /// The items, where the node is a list.
    pub fn items(&self) -> &[Node] {
        match &self.value {
            Value::List(items) => items,
            _ => &[],
        }
    }

    /// Marks the whole subtree as coming from the included file of this number.
    pub fn included(&mut self, file: usize) {
        let moved = |origin: Origin| match origin {
            Origin::File { line, column } => Origin::Included { file, line, column },
            other => other,
        };
        self.origin = moved(self.origin);
        match &mut self.value {
            Value::List(items) => items.iter_mut().for_each(|item| item.included(file)),
            Value::Map(entries) => {
                for entry in entries {
                    entry.origin = moved(entry.origin);
                    entry.value.included(file);
                }
            }
            _ => {}
        }
    }

    /// Marks the whole subtree as coming from elsewhere. Recursion is bounded by [`MAX_DEPTH`].
    pub fn set_origin(&mut self, origin: Origin) {
        self.origin = origin;
        match &mut self.value {
            Value::List(items) => items.iter_mut().for_each(|item| item.set_origin(origin)),
            Value::Map(entries) => {
                for entry in entries {
                    entry.origin = origin;
                    entry.value.set_origin(origin);
                }
            }
            _ => {}
        }
    }
}

/// How a value is called in a message.
pub(super) fn describe(value: &Value) -> String {
    match value {
        Value::Null => "nothing".into(),
        Value::Bool(b) => format!("`{b}`"),
        Value::Integer(i) => format!("the number {i}"),
        Value::Float(x) => format!("the number {}", number(*x)),
        Value::Text(text) => format!("the text \"{}\"", shorten(text)),
        Value::List(items) if items.is_empty() => "an empty list".into(),
        Value::List(items) => format!("a list of {}", items.len()),
        Value::Map(_) => "a mapping".into(),
    }
}

/// At most some forty characters of a text, made printable, for messages.
pub(super) fn shorten(text: &str) -> String {
    let mut short: String = text.chars().take(40).flat_map(char::escape_debug).collect();
    if text.chars().nth(40).is_some() {
        short.push_str("...");
    }
    short
}
