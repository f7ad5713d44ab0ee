//! From text to a tree of located nodes.
//!
//! The parser sends events (a mapping starts, a scalar, ...); a stack of open collections turns them into nodes. The
//! limits are here, because text can be small and its tree vast: depth is bounded, aliases (`*name`) copy what they
//! name only up to a total (ten lines of nested aliases could ask for 10^9 nodes), one file holds one document, and
//! keys are plain words that stand once.

use std::collections::{BTreeMap, BTreeSet};

use saphyr_parser::{Event, Parser, ScalarStyle, ScanError, Span, Tag};

use super::{Entry, MAX_DEPTH, Node, Origin, Segment, Value, describe, resolve_plain, shorten};
use crate::pipeline::yaml::problem::Problem;

/// All aliases of a file together may copy this many nodes.
const MAX_COPIED: usize = 1_000_000;

/// The tree of a text's only document.
pub fn parse(text: &str) -> Result<Node, Problem> {
    // The mark that some editors put first is no part of the text.
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if let Some((place, c)) = position_of(text, |c| c.is_control() && !matches!(c, '\n' | '\r' | '\t' | '\u{85}')) {
        let message = format!("the character U+{:04X} can't stand in YAML; is this a text file?", u32::from(c));
        return Err(Problem::new(message).or_at(place));
    }
    let mut builder = Builder::default();
    for step in Parser::new_from_str(text) {
        let (event, span) = step.map_err(|e| syntax(text, &e))?;
        builder.take(event, origin(&span))?;
    }
    builder.root.ok_or_else(|| Problem::new("is empty; a pipeline is a mapping with `name` and `stages`").or_at(START))
}

const START: Origin = Origin::File { line: 1, column: 1 };

fn origin(span: &Span) -> Origin {
    Origin::File { line: span.start.line().max(1), column: span.start.col() + 1 }
}

/// The first character that fits, and where it is.
fn position_of(text: &str, fits: impl Fn(char) -> bool) -> Option<(Origin, char)> {
    let at = text.find(&fits)?;
    let line_start = text[..at].rfind('\n').map_or(0, |n| n + 1);
    let line = text[..at].matches('\n').count() + 1;
    let place = Origin::File { line, column: text[line_start..at].chars().count() + 1 };
    text[at..].chars().next().map(|c| (place, c))
}

/// The parser's refusal, with a hint where its words would puzzle.
fn syntax(text: &str, error: &ScanError) -> Problem {
    let (line, column) = (error.marker().line().max(1), error.marker().col() + 1);
    let indent_with_tab = |l: &str| l.trim_start_matches(' ').starts_with('\t') && !l.trim().is_empty();
    let tab = text.lines().enumerate().skip(line.saturating_sub(2)).take(2).find(|(_, l)| indent_with_tab(l));
    if let Some((n, l)) = tab {
        let column = l.find('\t').map_or(1, |spaces| spaces + 1);
        let message = "is not YAML: a tab indents this line; YAML wants spaces";
        return Problem::new(message).or_at(Origin::File { line: n + 1, column });
    }
    Problem::new(format!("is not YAML: {}", error.info())).or_at(Origin::File { line, column })
}

/// A collection whose end hasn't come yet.
struct Open {
    origin: Origin,
    anchor: usize,
    content: Content,
}

enum Content {
    List(Vec<Node>),
    Map { entries: Vec<Entry>, seen: BTreeSet<String>, key: Option<(String, Origin)> },
}

#[derive(Default)]
struct Builder {
    root: Option<Node>,
    open: Vec<Open>,
    /// What anchors (`&name`) stand for. Number 0 means none.
    anchors: BTreeMap<usize, Node>,
    copied: usize,
}

impl Builder {
    fn take(&mut self, event: Event<'_>, origin: Origin) -> Result<(), Problem> {
        match event {
            Event::Nothing | Event::StreamStart | Event::StreamEnd | Event::DocumentEnd => Ok(()),
            Event::DocumentStart(_) if self.root.is_some() => {
                Err(Problem::new("a second document begins here; a pipeline file holds one").or_at(origin))
            }
            Event::DocumentStart(_) => Ok(()),
            Event::Scalar(text, style, anchor, tag) => {
                if self.wants_key() {
                    return self.key(text.into_owned(), origin);
                }
                let value = scalar(&text, style, tag.as_deref()).map_err(|p| p.or_at(origin))?;
                self.finish(Node { origin, value }, anchor)
            }
            Event::SequenceStart(anchor, tag) => {
                self.begin(origin, anchor, tag.as_deref(), "seq", Content::List(Vec::new()))
            }
            Event::MappingStart(anchor, tag) => {
                let map = Content::Map { entries: Vec::new(), seen: BTreeSet::new(), key: None };
                self.begin(origin, anchor, tag.as_deref(), "map", map)
            }
            Event::SequenceEnd | Event::MappingEnd => match self.open.pop() {
                Some(Open { origin, anchor, content }) => {
                    let value = match content {
                        Content::List(items) => Value::List(items),
                        Content::Map { entries, .. } => Value::Map(entries),
                    };
                    self.finish(Node { origin, value }, anchor)
                }
                None => Ok(()),
            },
            Event::Alias(anchor) => self.alias(anchor, origin),
        }
    }

    /// Whether the next node is a mapping's key.
    fn wants_key(&self) -> bool {
        matches!(self.open.last(), Some(Open { content: Content::Map { key: None, .. }, .. }))
    }

    fn key(&mut self, word: String, origin: Origin) -> Result<(), Problem> {
        if let Some(Open { content: Content::Map { seen, key, entries }, .. }) = self.open.last_mut() {
            if !seen.insert(word.clone()) {
                let first = entries.iter().find(|e| e.key == word).map(|e| e.origin);
                let where_first = match first {
                    Some(Origin::File { line, .. }) => format!("; it stands on line {line} already"),
                    _ => String::new(),
                };
                let path = self.path();
                let twice = Problem::new(format!("the key `{}` stands twice{where_first}", shorten(&word)));
                return Err(path.into_iter().rev().fold(twice, Problem::inside).or_at(origin));
            }
            *key = Some((word, origin));
        }
        Ok(())
    }

    /// The path to the innermost open collection.
    fn path(&self) -> Vec<Segment> {
        let inner = self.open.len().saturating_sub(1);
        self.open[..inner]
            .iter()
            .filter_map(|open| match &open.content {
                Content::List(items) => Some(Segment::Index(items.len())),
                Content::Map { key, .. } => key.as_ref().map(|(word, _)| Segment::Key(word.clone())),
            })
            .collect()
    }

    fn begin(
        &mut self,
        origin: Origin,
        anchor: usize,
        tag: Option<&Tag>,
        kind: &str,
        content: Content,
    ) -> Result<(), Problem> {
        if self.wants_key() {
            return Err(Problem::new("a key must be a word, not a list or a mapping").or_at(origin));
        }
        if self.open.len() >= MAX_DEPTH {
            return Err(too_deep().or_at(origin));
        }
        if let Some(tag) = tag.filter(|t| !(t.is_yaml_core_schema() && t.suffix == kind)) {
            return Err(unknown_tag(tag).or_at(origin));
        }
        self.open.push(Open { origin, anchor, content });
        Ok(())
    }

    /// Puts a whole node where it belongs.
    fn finish(&mut self, node: Node, anchor: usize) -> Result<(), Problem> {
        if anchor != 0 {
            self.copied = self.copied.saturating_add(node.size().0);
            self.check_copied(node.origin)?;
            self.anchors.insert(anchor, node.clone());
        }
        match self.open.last_mut() {
            None => self.root = Some(node),
            Some(Open { content: Content::List(items), .. }) => items.push(node),
            Some(Open { content: Content::Map { entries, key, .. }, .. }) => {
                if let Some((key, origin)) = key.take() {
                    entries.push(Entry { key, origin, value: node });
                }
            }
        }
        Ok(())
    }

    fn alias(&mut self, anchor: usize, origin: Origin) -> Result<(), Problem> {
        if self.wants_key() {
            return Err(Problem::new("a key must be a word, not an alias").or_at(origin));
        }
        let Some(node) = self.anchors.get(&anchor) else {
            return Err(Problem::new("this alias stands inside what it names").or_at(origin));
        };
        let (count, depth) = node.size();
        if self.open.len() + depth > MAX_DEPTH {
            return Err(too_deep().or_at(origin));
        }
        self.copied = self.copied.saturating_add(count);
        let copy = if self.copied > MAX_COPIED { None } else { Some(node.clone()) };
        self.check_copied(origin)?;
        copy.map_or(Ok(()), |node| self.finish(node, 0))
    }

    fn check_copied(&self, origin: Origin) -> Result<(), Problem> {
        if self.copied > MAX_COPIED {
            let message =
                format!("anchors and aliases copy more than {MAX_COPIED} values; write the pipeline without them");
            return Err(Problem::new(message).or_at(origin));
        }
        Ok(())
    }
}

fn too_deep() -> Problem {
    Problem::new(format!("lists and mappings are more than {MAX_DEPTH} deep"))
}

fn unknown_tag(tag: &Tag) -> Problem {
    Problem::new(format!("the tag `{}` has no meaning here; take it out", shorten(&tag.to_string())))
}

/// The value of a scalar: quoted and block text is text, the rest follows the core schema, and a core tag
/// (`!!str`) insists on one kind.
fn scalar(text: &str, style: ScalarStyle, tag: Option<&Tag>) -> Result<Value, Problem> {
    let as_text = || Value::Text(text.to_owned());
    let Some(tag) = tag else {
        return Ok(if style == ScalarStyle::Plain { resolve_plain(text) } else { as_text() });
    };
    if !tag.is_yaml_core_schema() {
        return Err(unknown_tag(tag));
    }
    let value = resolve_plain(text);
    let fits = match (tag.suffix.as_str(), &value) {
        ("str", _) => return Ok(as_text()),
        ("float", Value::Integer(i)) => return Ok(Value::Float(*i as f64)),
        ("null", Value::Null) | ("bool", Value::Bool(_)) | ("int", Value::Integer(_)) | ("float", Value::Float(_)) => {
            true
        }
        ("null" | "bool" | "int" | "float", _) => false,
        _ => return Err(unknown_tag(tag)),
    };
    if fits {
        Ok(value)
    } else {
        Err(Problem::new(format!("{} is not what its tag `!!{}` says", describe(&value), tag.suffix)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(text: &str) -> String {
        let problem = parse(text).expect_err(text);
        format!("{:?} {problem}", problem.origin.expect("every refusal has a place"))
    }

    #[test]
    fn nodes_know_their_place() {
        let root = parse("name: x\nstages:\n  - scene: {dimension: 3}\n").unwrap();
        assert_eq!(root.get("name").unwrap().origin, Origin::File { line: 1, column: 7 });
        let scene = root.get("stages").unwrap().items()[0].get("scene").unwrap();
        assert_eq!(scene.get("dimension").unwrap().origin, Origin::File { line: 3, column: 24 });
    }

    #[test]
    fn refusals() {
        for (text, line, part) in [
            ("", 1, "is empty"),
            ("# nothing\n", 1, "is empty"),
            ("a: 1\na: 2\n", 2, "`a` stands twice; it stands on line 1"),
            ("a: 1\n---\nb: 1\n", 2, "second document"),
            ("a:\n\tb: 1\n", 2, "a tab indents"),
            ("a: \u{1}\n", 1, "U+0001"),
            ("a: !colour 3\n", 1, "the tag `!colour`"),
            ("a: !!int x\n", 1, "is not what its tag"),
            ("[1]: 2\n", 1, "a key must be a word"),
            ("a: &x [*x]\n", 1, "inside what it names"),
            ("a: *x\n", 1, "is not YAML"),
            ("a: [1, 2\n", 2, "is not YAML"),
            ("a: 'x\n", 1, "is not YAML"),
        ] {
            let refusal = refusal(text);
            assert!(refusal.contains(part), "{text:?}: {refusal}");
            assert!(refusal.contains(&format!("line: {line},")), "{text:?}: {refusal}");
        }
    }

    #[test]
    fn depth_is_bounded() {
        assert!(parse(&("[".repeat(64) + &"]".repeat(64))).is_ok());
        for open in ["[", "{a: ", "- ", "? "] {
            assert!(parse(&open.repeat(100_000)).is_err(), "{open}");
        }
    }

    #[test]
    fn alias_bombs_are_refused_quickly() {
        let mut text = String::from("a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n");
        for i in 1..20 {
            let copies = vec![format!("*a{}", i - 1); 10].join(", ");
            text += &format!("a{i}: &a{i} [{copies}]\n");
        }
        assert!(refusal(&text).contains("copy more than"));
    }

    #[test]
    fn aliases_copy() {
        let root = parse("a: &eye [1, 2]\nb: *eye\n").unwrap();
        assert_eq!(root.get("b").unwrap().items().len(), 2);
    }
}
