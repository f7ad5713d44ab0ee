//! From a tree back to text: YAML that reads well and is parsed to the same tree again.
//!
//! What fits on a line stands on one, `{scale: 0.5}` and `[1, 2, 3]`; everything else takes a line an entry. A text stands
//! without quotes only where nobody, YAML 1.1 included, could take it for something else.

use serde_json::Value as Json;

use super::{Entry, Node, Origin, Value};
use crate::text::is_command;

/// A line is not made longer than this to hold a whole list or mapping.
const WIDTH: usize = 120;
/// Words that some YAML takes for something other than text.
const WORDS: &[&str] = &["true", "false", "yes", "no", "on", "off", "y", "n", "null", "nan", "inf", "infinity"];

/// The text of a tree, with a newline at its end.
pub fn emit(root: &Node) -> String {
    let mut text = String::new();
    match &root.value {
        Value::Map(entries) if !entries.is_empty() => block_map(entries, 0, &mut text),
        _ => text = flow(root) + "\n",
    }
    text
}

/// A node that no text stands behind.
pub fn node(value: Value) -> Node {
    Node { origin: Origin::File { line: 1, column: 1 }, value }
}

/// A mapping of these entries.
pub fn map(entries: impl IntoIterator<Item = (&'static str, Value)>) -> Value {
    let entry = |(key, value): (&str, Value)| Entry {
        key: key.to_owned(),
        origin: node(Value::Null).origin,
        value: node(value),
    };
    Value::Map(entries.into_iter().map(entry).collect())
}

/// Adds what a tree lacks: the entries of mappings that are in the JSON and not in the tree. What is written stays as it
/// is written. Recursion is bounded by the JSON, which plans make.
pub fn fill(tree: &mut Node, json: &Json) {
    match (&mut tree.value, json) {
        (Value::Map(entries), Json::Object(object)) => {
            for (key, json) in object.iter().filter(|(_, json)| !json.is_null()) {
                match entries.iter_mut().find(|entry| entry.key == *key) {
                    Some(entry) => fill(&mut entry.value, json),
                    None => {
                        entries.push(Entry { key: key.clone(), origin: tree.origin, value: node(from_json(json)) });
                    }
                }
            }
        }
        (Value::List(items), Json::Array(array)) if items.len() == array.len() => {
            items.iter_mut().zip(array).for_each(|(item, json)| fill(item, json));
        }
        _ => {}
    }
}

/// JSON as a tree, without the keys that have no value.
pub fn from_json(json: &Json) -> Value {
    match json {
        Json::Null => Value::Null,
        Json::Bool(b) => Value::Bool(*b),
        Json::Number(n) => match (n.as_i64(), n.as_u64()) {
            (Some(i), _) => Value::Integer(i.into()),
            (None, Some(i)) => Value::Integer(i.into()),
            (None, None) => Value::Float(n.as_f64().unwrap_or(f64::NAN)),
        },
        Json::String(text) => Value::Text(text.clone()),
        Json::Array(items) => Value::List(items.iter().map(|item| node(from_json(item))).collect()),
        Json::Object(object) => {
            let given = object.iter().filter(|(_, value)| !value.is_null());
            let entry = |(key, value): (&String, &Json)| Entry {
                key: key.clone(),
                origin: node(Value::Null).origin,
                value: node(from_json(value)),
            };
            Value::Map(given.map(entry).collect())
        }
    }
}

/// The entries, each on lines of its own, behind `indent` spaces.
fn block_map(entries: &[Entry], indent: usize, text: &mut String) {
    for (i, entry) in entries.iter().enumerate() {
        if i > 0 || text.is_empty() || text.ends_with('\n') {
            text.extend(std::iter::repeat_n(' ', indent));
        }
        text.push_str(&scalar(&entry.key));
        text.push(':');
        below(&entry.value, indent, text);
    }
}

/// A value behind its key or dash: on the same line, or on the lines that follow.
fn below(value: &Node, indent: usize, text: &mut String) {
    let line = flow(value);
    let column = text.len() - text.rfind('\n').map_or(0, |at| at + 1);
    match &value.value {
        Value::Map(entries) if column + line.len() >= WIDTH && !entries.is_empty() => {
            text.push('\n');
            block_map(entries, indent + 2, text);
        }
        Value::List(items) if column + line.len() >= WIDTH && !items.is_empty() => {
            text.push('\n');
            for item in items {
                block_item(item, indent + 2, text);
            }
        }
        _ => {
            text.push(' ');
            text.push_str(&line);
            text.push('\n');
        }
    }
}

/// An item of a list, on lines of its own.
fn block_item(item: &Node, indent: usize, text: &mut String) {
    text.extend(std::iter::repeat_n(' ', indent));
    let line = flow(item);
    match &item.value {
        // A stage, a step, a shape: its only key needs no braces.
        Value::Map(entries) if entries.len() == 1 || indent + line.len() >= WIDTH && !entries.is_empty() => {
            text.push_str("- ");
            block_map(entries, indent + 2, text);
        }
        _ => {
            text.push('-');
            below(item, indent, text);
        }
    }
}

/// A value on one line.
fn flow(node: &Node) -> String {
    match &node.value {
        Value::Null => "null".to_owned(),
        Value::Bool(b) => b.to_string(),
        Value::Integer(i) => i.to_string(),
        Value::Float(x) if x.is_nan() => ".nan".to_owned(),
        Value::Float(x) if x.is_infinite() => if *x > 0.0 { ".inf" } else { "-.inf" }.to_owned(),
        // The shortest text that reads back as the same f64, and never as an integer.
        Value::Float(x) => format!("{x:?}"),
        Value::Text(text) => scalar(text),
        Value::List(items) => format!("[{}]", items.iter().map(flow).collect::<Vec<_>>().join(", ")),
        Value::Map(entries) => {
            let entry = |entry: &Entry| format!("{}: {}", scalar(&entry.key), flow(&entry.value));
            format!("{{{}}}", entries.iter().map(entry).collect::<Vec<_>>().join(", "))
        }
    }
}

/// A text, in quotes where it needs them.
fn scalar(text: &str) -> String {
    let first = text.chars().next().is_some_and(|c| c.is_ascii_alphabetic() || c == '_');
    let plain = text.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.' | '/' | ' '));
    let word = WORDS.iter().any(|word| text.eq_ignore_ascii_case(word));
    if first && plain && !word && !text.ends_with(' ') {
        return text.to_owned();
    }
    let mut quoted = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            '\n' => quoted.push_str("\\n"),
            '\t' => quoted.push_str("\\t"),
            c if (c.is_control() || is_command(c)) && u32::from(c) < 0x10000 => {
                quoted.push_str(&format!("\\u{:04x}", u32::from(c)));
            }
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}

#[cfg(test)]
mod tests {
    use super::super::parse;
    use super::*;

    /// The tree without its places.
    fn bare(node: &Node) -> String {
        let inner = |nodes: Vec<String>| nodes.join(", ");
        match &node.value {
            Value::List(items) => format!("[{}]", inner(items.iter().map(bare).collect())),
            Value::Map(entries) => {
                format!("{{{}}}", inner(entries.iter().map(|e| format!("{:?}: {}", e.key, bare(&e.value))).collect()))
            }
            value => format!("{value:?}"),
        }
    }

    #[test]
    fn what_is_emitted_is_parsed_to_the_same_tree() {
        let long = "[".to_owned() + &"0.125, ".repeat(40) + "1]";
        for text in [
            "name: x\n",
            "{a: {b: {c: [1, -2, 1e300, 1.0, -0.0, 1e-7, 18446744073709551615, .inf, -.inf, .nan]}}}",
            "a: [~, true, 'true', 'yes', 'No', 'null', '~', '', ' x', 'x ', '1', '0x1f', '1e5', '.5', '-', 'a: b', '#c', '12:30']",
            "a: \"tab\\t, line\\nbreak, \\\"quotes\\\", back\\\\slash, \\u0007, \\u2028, \\ufeff, \\u007f, \\u0085, ä, \u{1f600}\"",
            "'': 1\n'a b': 2\n'3': 4\n'- x': 5\n? [1]\n: 6\n",
            "a: []\nb: {}\nc: [[], {}, [[]]]\n",
            &format!(
                "stages:\n  - scene: {{v: {long}, w: [{long}, {long}]}}\n  - {long}\n  - x: {{y: {{z: {long}}}}}\n"
            ),
            "list: [[[1, 2], [3, 4]], {a: 1, b: [{c: d}]}]\n",
        ] {
            let Ok(tree) = parse(text) else { continue };
            let emitted = emit(&tree);
            let again = parse(&emitted).unwrap_or_else(|e| panic!("{text}\n{emitted}\n{e}"));
            assert_eq!(bare(&again), bare(&tree), "{emitted}");
            assert_eq!(emit(&again), emitted);
        }
    }

    #[test]
    fn lines_hold_what_fits() {
        let tree = parse("{name: p, stages: [{scene: {objects: [{box: {min: [0, 0], max: [1, 1]}, name: 'a long name of an object'}, {x: 'and another one that makes the line long'}]}}]}").unwrap();
        let expected = "name: p
stages:
  - scene:
      objects:
        - {box: {min: [0, 0], max: [1, 1]}, name: a long name of an object}
        - x: and another one that makes the line long
";
        assert_eq!(emit(&tree), expected);
    }

    #[test]
    fn what_is_lacking_is_filled_in() {
        let mut tree = parse("{a: {b: 1}, c: [{d: 2}, 3], e: word}").unwrap();
        let json = serde_json::json!({
            "a": {"b": 5, "f": null, "g": {"h": 0.5, "i": null}}, "c": [{"d": 1, "j": "x"}, 7], "e": {"k": 1}
        });
        fill(&mut tree, &json);
        assert_eq!(emit(&tree), "a: {b: 1, g: {h: 0.5}}\nc: [{d: 2, j: x}, 3]\ne: word\n");
    }
}
