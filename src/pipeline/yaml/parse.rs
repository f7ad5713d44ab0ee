//! From text to a tree of located nodes, by the `serde_saphyr` crate.
//!
//! It parses, tells numbers from text, follows aliases, keeps limits, and says where each value stands
//! ([`Spanned`]). What is decided here: which of its limits hold, that keys stand once (with both lines
//! told), and how its complaints are worded.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_saphyr::budget::BudgetBreach;
use serde_saphyr::options::{DuplicateKeyPolicy, MergeKeyPolicy, NonFiniteFloatPolicy};
use serde_saphyr::{DefaultMessageFormatter, Error, Location, MessageFormatter, Spanned};

use super::{Entry, MAX_DEPTH, Node, Origin, Problem, Segment, Value, shorten};

/// All aliases of a file together may copy this many values.
const MAX_COPIED: usize = 200_000;

/// The tree of a text's only document.
pub fn parse(text: &str) -> Result<Node, Problem> {
    if let Some((place, c)) = position_of(text, |c| c.is_control() && !matches!(c, '\n' | '\r' | '\t' | '\u{85}')) {
        let message = format!("the character U+{:04X} can't stand in YAML; is this a text file?", u32::from(c));
        return Err(Problem::new(message).or_at(place));
    }
    let options = serde_saphyr::options! {
        // The size of a file is bounded before, and its tree is in proportion to it, but for aliases.
        budget: serde_saphyr::budget! {
            max_depth: MAX_DEPTH,
            flow_nesting_limit: MAX_DEPTH,
            max_events: usize::MAX,
            max_nodes: usize::MAX,
            max_total_scalar_bytes: usize::MAX,
            max_recorded_anchor_events: MAX_COPIED,
            enforce_alias_anchor_ratio: false,
        },
        alias_limits: serde_saphyr::alias_limits! { max_total_replayed_events: MAX_COPIED },
        // The tree keeps both, so that the complaint can name both lines.
        duplicate_keys: DuplicateKeyPolicy::PassThrough,
        // They are merged in the tree, where what stands twice is known.
        merge_keys: MergeKeyPolicy::AsOrdinary,
        // Whoever wants a number refuses those that are not finite.
        non_finite_float_policy: NonFiniteFloatPolicy::PassThrough,
        null_as_string: true,
        strict_booleans: true,
        reject_unsupported_tags: true,
        underscored_numbers_as_strings: true,
        with_snippet: false,
    };
    let mut root: Node = serde_saphyr::from_str_with_options(text, options).map_err(|e| refusal(text, &e))?;
    keys_stand_once(&root)?;
    take_over(&mut root)?;
    Ok(root)
}

fn origin(location: Location) -> Origin {
    Origin::File { line: counted(location.line()), column: counted(location.column()) }
}

fn counted(n: u64) -> usize {
    usize::try_from(n).unwrap_or(usize::MAX).max(1)
}

impl<'de> Deserialize<'de> for Node {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        // Of an alias, what it names: that is where a wrong value must be mended.
        let Spanned { value, defined, .. } = Spanned::deserialize(deserializer)?;
        Ok(Node { origin: origin(defined), value })
    }
}

impl<'de> Deserialize<'de> for Value {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(AnyValue)
    }
}

struct AnyValue;

impl<'de> Visitor<'de> for AnyValue {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value")
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E>(self, b: bool) -> Result<Value, E> {
        Ok(Value::Bool(b))
    }

    fn visit_i64<E>(self, i: i64) -> Result<Value, E> {
        Ok(Value::Integer(i.into()))
    }

    fn visit_u64<E>(self, i: u64) -> Result<Value, E> {
        Ok(Value::Integer(i.into()))
    }

    fn visit_f64<E>(self, x: f64) -> Result<Value, E> {
        Ok(Value::Float(x))
    }

    fn visit_str<E>(self, text: &str) -> Result<Value, E> {
        Ok(Value::Text(text.to_owned()))
    }

    fn visit_string<E>(self, text: String) -> Result<Value, E> {
        Ok(Value::Text(text))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut access: A) -> Result<Value, A::Error> {
        let mut items = Vec::new();
        while let Some(item) = access.next_element()? {
            items.push(item);
        }
        Ok(Value::List(items))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut access: A) -> Result<Value, A::Error> {
        let mut entries = Vec::new();
        while let Some((key, value)) = access.next_entry::<Spanned<String>, Node>()? {
            entries.push(Entry { key: key.value, origin: origin(key.defined), value });
        }
        Ok(Value::Map(entries))
    }
}

/// Refuses a mapping in which a key stands twice. Recursion is bounded by [`MAX_DEPTH`].
fn keys_stand_once(node: &Node) -> Result<(), Problem> {
    let Value::Map(entries) = &node.value else {
        let items = node.items().iter().enumerate();
        return items
            .into_iter()
            .try_for_each(|(i, item)| keys_stand_once(item).map_err(|problem| problem.inside(Segment::Index(i))));
    };
    let mut seen = BTreeMap::new();
    for Entry { key, origin, value } in entries {
        if let Some(Origin::File { line, .. }) = seen.insert(key, *origin) {
            let message = format!("the key `{}` stands twice; it stands on line {line} already", shorten(key));
            return Err(Problem::new(message).or_at(*origin));
        }
        keys_stand_once(value).map_err(|problem| problem.inside(Segment::Key(key.clone())))?;
    }
    Ok(())
}

/// The key that takes over the entries of other mappings, as in `<<: *shared`.
const TAKES_OVER: &str = "<<";

/// Gives each mapping the entries of those that its `<<` names: one, or a list of them. What it has itself wins, then what
/// comes first. Recursion is bounded by [`MAX_DEPTH`], and what aliases copy by [`MAX_COPIED`].
fn take_over(node: &mut Node) -> Result<(), Problem> {
    match &mut node.value {
        Value::List(items) => items
            .iter_mut()
            .enumerate()
            .try_for_each(|(i, item)| take_over(item).map_err(|problem| problem.inside(Segment::Index(i)))),
        Value::Map(entries) => {
            for Entry { key, value, .. } in entries.iter_mut() {
                take_over(value).map_err(|problem| problem.inside(Segment::Key(key.clone())))?;
            }
            let Some(at) = entries.iter().position(|entry| entry.key == TAKES_OVER) else { return Ok(()) };
            let Entry { value: named, .. } = entries.remove(at);
            let origin = named.origin;
            let named = if let Value::List(items) = named.value { items } else { vec![named] };
            for one in named {
                let Value::Map(theirs) = one.value else {
                    let message = "takes over the keys of a mapping, `<<: *name`, or of a list of mappings";
                    return Err(Problem::new(message).or_at(origin).inside(Segment::Key(TAKES_OVER.to_owned())));
                };
                let known: BTreeSet<String> = entries.iter().map(|entry| entry.key.clone()).collect();
                entries.extend(theirs.into_iter().filter(|entry| !known.contains(&entry.key)));
            }
            Ok(())
        }
        _ => Ok(()),
    }
}

/// The first character that fits, and where it is.
fn position_of(text: &str, fits: impl Fn(char) -> bool) -> Option<(Origin, char)> {
    let at = text.find(&fits)?;
    let line_start = text[..at].rfind('\n').map_or(0, |n| n + 1);
    let line = text[..at].matches('\n').count() + 1;
    let place = Origin::File { line, column: text[line_start..at].chars().count() + 1 };
    text[at..].chars().next().map(|c| (place, c))
}

/// The crate's complaint, in our words where its own would puzzle.
fn refusal(text: &str, error: &Error) -> Problem {
    let error = match error {
        Error::AliasError { error, .. } => error,
        error => error,
    };
    let (line, column) = error.location().map_or((1, 1), |place| (counted(place.line()), counted(place.column())));
    let at = |line, column, message: String| Problem::new(message).or_at(Origin::File { line, column });
    let indent_with_tab = |l: &str| l.trim_start_matches(' ').starts_with('\t') && !l.trim().is_empty();
    let tab = text.lines().enumerate().skip(line.saturating_sub(2)).take(2).find(|(_, l)| indent_with_tab(l));
    if let Some((n, l)) = tab {
        let column = l.find('\t').map_or(1, |spaces| spaces + 1);
        return at(n + 1, column, "is not YAML: a tab indents this line; YAML wants spaces".into());
    }
    let message = match error {
        Error::MultipleDocuments { .. } => {
            let marks = text.lines().take(line).enumerate().filter(|(_, l)| l.starts_with("---"));
            let line = marks.last().map_or(line, |(n, _)| n + 1);
            return at(line, 1, "a second document begins here; a pipeline file holds one".into());
        }
        Error::Budget { breach: BudgetBreach::Depth { .. }, .. } => too_deep(),
        Error::Budget { .. } | Error::AliasReplayLimitExceeded { .. } | Error::AliasReplayStackDepthExceeded { .. } => {
            format!("anchors and aliases copy more than {MAX_COPIED} values; write the pipeline without them")
        }
        Error::RecursiveReferencesRequireWeakTypes { .. } => "this alias stands inside what it names".into(),
        Error::UnsupportedTag { tag, .. } => {
            format!("the tag `{}` has no meaning here; take it out", shorten(tag))
        }
        Error::InvalidScalar { .. } | Error::InvalidBooleanStrict { .. } => "is not what its tag says".into(),
        // Only keys are asked to be text.
        Error::Unexpected { expected: "string scalar", .. } => "a key must be a word, not a list or a mapping".into(),
        other => match DefaultMessageFormatter.format_message(other) {
            words if words == "recursion limit exceeded" => too_deep(),
            words => format!("is not YAML: {words}"),
        },
    };
    at(line, column, message)
}

fn too_deep() -> String {
    format!("lists and mappings are more than {MAX_DEPTH} deep")
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
            ("a: 1\na: 2\n", 2, "`a` stands twice; it stands on line 1"),
            ("a: 1\n---\nb: 1\n", 2, "second document"),
            ("a:\n\tb: 1\n", 2, "a tab indents"),
            ("a: \u{1}\n", 1, "U+0001"),
            ("a: !colour 3\n", 1, "the tag `!colour`"),
            ("a: !!int x\n", 1, "is not what its tag"),
            ("[1]: 2\n", 1, "a key must be a word"),
            ("a: &x [*x]\n", 1, "inside what it names"),
            ("a: *x\n", 1, "is not YAML"),
            ("a: [1, 2\n", 1, "is not YAML"),
            ("a: 'x\n", 1, "is not YAML"),
            ("a: 1\nb: {c: 1, c: 2}\n", 2, "`c` stands twice; it stands on line 2"),
            ("a: !!timestamp 2001-01-01\n", 1, "tag"),
        ] {
            let refusal = refusal(text);
            assert!(refusal.contains(part), "{text:?}: {refusal}");
            assert!(refusal.contains(&format!("line: {line},")), "{text:?}: {refusal}");
        }
    }

    #[test]
    fn mappings_take_over_what_others_have() {
        let text = "x-a: &a {p: 1, q: 1, r: {s: 1}}\nx-b: &b {<<: *a, q: 2}\none: {<<: *a, p: 3}\nmany: {q: 4, <<: [{t: 5}, *b]}\n";
        let root = parse(text).unwrap();
        let of = |key: &str| -> Vec<String> {
            let Value::Map(entries) = &root.get(key).unwrap().value else { panic!("{key}") };
            entries.iter().map(|entry| format!("{}={:?}", entry.key, entry.value.value)).collect()
        };
        let same = |text: &str| {
            let root = parse(text).unwrap();
            let Value::Map(entries) = root.value else { panic!("{text}") };
            entries.iter().map(|entry| format!("{}={:?}", entry.key, entry.value.value)).collect::<Vec<_>>()
        };
        // Places are those of the values themselves; what is compared here has none but in `r`.
        assert_eq!(of("one")[..2], same("{p: 3, q: 1}"));
        assert_eq!(of("many")[..3], same("{q: 4, t: 5, p: 1}"));
        assert!(of("one").len() == 3 && of("many").len() == 4 && of("x-b").len() == 3);
        let taken = root.get("one").unwrap().get("q").unwrap();
        assert_eq!(taken.origin, Origin::File { line: 1, column: 19 }, "where it must be mended");
        for text in ["a: {<<: 3}\n", "a: {<<: [{b: 1}, 2]}\n", "a: {<<: }\n"] {
            assert!(refusal(text).contains("takes over the keys of a mapping"), "{text}");
        }
        assert!(refusal("a: &a {}\nb: {<<: *a, <<: *a}\n").contains("`<<` stands twice"));
    }

    #[test]
    fn depth_is_bounded() {
        for (open, close) in [("[", "]"), ("{a: ", "}"), ("- ", "")] {
            let nested = |n: usize| format!("{}1{}", open.repeat(n), close.repeat(n));
            assert!(parse(&nested(64)).is_ok(), "{open}");
            for n in [65, 100, 20_000] {
                assert!(refusal(&nested(n)).contains("lists and mappings are more than 64 deep"), "{open} {n}");
            }
        }
        assert!(parse(&"? ".repeat(100_000)).is_err());
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

    fn shown(text: &str) -> String {
        let root = parse(&format!("- {text}")).unwrap_or_else(|e| panic!("{text}: {e}"));
        format!("{:?}", root.items()[0].value)
    }

    #[test]
    fn values_are_those_of_the_core_schema() {
        for (text, value) in [
            ("~", "Null"),
            ("True", "Bool(true)"),
            ("12", "Integer(12)"),
            ("-3", "Integer(-3)"),
            ("+7", "Integer(7)"),
            ("0x1F", "Integer(31)"),
            ("0o17", "Integer(15)"),
            ("18446744073709551615", "Integer(18446744073709551615)"),
            ("1.", "Float(1.0)"),
            (".5", "Float(0.5)"),
            ("-1e-3", "Float(-0.001)"),
            ("-.inf", "Float(-inf)"),
            (".NaN", "Float(NaN)"),
            ("99999999999999999999", "Float(1e20)"),
        ] {
            assert_eq!(shown(text), value, "{text}");
        }
        let texts = "inf nan yes 1:30 1_000 e5 . + 0x 0x-1 --1 1e infinity 1.2.3";
        texts.split(' ').chain(["'1'", "\"~\"", "!!str 1"]).for_each(|text| {
            let plain = text.trim_start_matches("!!str ").trim_matches(['\'', '"']);
            assert_eq!(shown(text), format!("Text({plain:?})"));
        });
    }
}
