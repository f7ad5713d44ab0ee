//! What a pipeline's text is put together from before anything of it is understood: included files, variables, notes of
//! the user's own, and sweeps.
//!
//! - `include: FILE` (or a list) at the top puts the stages of other files before its own, and takes over their variables; an
//!   entry `- include: FILE` among the stages puts them there. A file is found from the folder of the one that includes it; paths in
//!   it are relative to the pipeline's folder, as all are.
//! - `variables: {rays: 64}` gives names to values: a value `$rays` is that value, of any kind, and `${rays}` within a text
//!   its text. `$$` is a dollar sign. `--set variables.rays=16` changes it for one run.
//! - Keys that begin with `x-` are the user's own, anywhere: places for anchors and notes.
//! - `sweep: {occlusion.samples: [16, 64]}` makes a pipeline of each combination of the values, by overrides like those of
//!   `--set`.
//!
//! All of it works on the tree, so what is left is a pipeline like any other, and complaints still have their lines.

use std::path::{Path, PathBuf};

use super::yaml::{self, Entry, MAX_DEPTH, Node, Origin, Problem, Segment, Value, shorten};
use crate::stages::suggest;

/// Files within files within files: more than this is a mistake.
const MAX_INCLUDES: usize = 16;
/// The most pipelines that a sweep makes.
const MAX_SWEPT: usize = 10_000;
/// Values that a pipeline's text may grow to by its variables.
const MAX_VALUES: usize = 200_000;

/// Reads an included file: its path, and where it is asked for.
pub(super) type Read<'r> = dyn FnMut(&Path) -> Result<Node, String> + 'r;

/// Puts the files that a tree includes in their places. `folder` is where their names start; `above` are the files within
/// which it stands.
pub(super) fn include(
    root: &mut Node,
    folder: &Path,
    above: &mut Vec<PathBuf>,
    read: &mut Read,
) -> Result<(), Problem> {
    let Value::Map(entries) = &mut root.value else { return Ok(()) };
    let Some(at) = entries.iter().position(|e| e.key == "include") else {
        return match entries.iter_mut().find(|e| e.key == "stages") {
            Some(Entry { value, .. }) => {
                include_stages(value, folder, above, read).map_err(|p| p.inside(key("stages")))
            }
            None => Ok(()),
        };
    };
    let asked = entries.remove(at).value;
    let single = std::slice::from_ref(&asked);
    let names = if let Value::List(items) = &asked.value { items.as_slice() } else { single };
    let mut first = Vec::new();
    for (i, name) in names.iter().enumerate() {
        let place = |p: Problem| match &asked.value {
            // Within that file it has a path of its own.
            _ if !p.path().is_empty() => p,
            Value::List(_) => p.inside(Segment::Index(i)).inside(key("include")),
            _ => p.inside(key("include")),
        };
        let other = open(name, folder, above, read).map_err(place)?;
        let Value::Map(theirs) = other.value else {
            return Err(place(Problem::new("holds no mapping, so it is no part of a pipeline").or_at(name.origin)));
        };
        for mut entry in theirs {
            match (entry.key.as_str(), &mut entry.value.value) {
                ("stages", Value::List(stages)) => first.append(stages),
                // What the pipeline says itself wins.
                _ => merge(entries, entry),
            }
        }
    }
    if let Some(Entry { value, .. }) = entries.iter_mut().find(|e| e.key == "stages") {
        include_stages(value, folder, above, read).map_err(|p| p.inside(key("stages")))?;
        if let Value::List(own) = &mut value.value {
            first.append(own);
            *own = first;
        }
    } else if !first.is_empty() {
        let (origin, value) = (asked.origin, Node { origin: asked.origin, value: Value::List(first) });
        entries.push(Entry { key: "stages".into(), origin, value });
    }
    Ok(())
}

/// Adds an entry where there is none of its key; of variables, those that there are none of.
fn merge(entries: &mut Vec<Entry>, other: Entry) {
    match entries.iter_mut().find(|entry| entry.key == other.key) {
        None => entries.push(other),
        Some(own) if own.key == "variables" => {
            if let (Value::Map(own), Value::Map(theirs)) = (&mut own.value.value, other.value.value) {
                theirs.into_iter().for_each(|entry| merge(own, entry));
            }
        }
        Some(_) => {}
    }
}

fn include_stages(stages: &mut Node, folder: &Path, above: &mut Vec<PathBuf>, read: &mut Read) -> Result<(), Problem> {
    let Value::List(items) = &mut stages.value else { return Ok(()) };
    let mut all = Vec::with_capacity(items.len());
    for (i, item) in std::mem::take(items).into_iter().enumerate() {
        let asked = match &item.value {
            Value::Map(entries) => entries.first().filter(|e| entries.len() == 1 && e.key == "include"),
            _ => None,
        };
        let Some(Entry { value: name, .. }) = asked else {
            all.push(item);
            continue;
        };
        let place = |p: Problem| match p.path().is_empty() {
            true => p.inside(key("include")).inside(Segment::Index(i)),
            false => p,
        };
        let other = open(name, folder, above, read).map_err(place)?;
        let theirs = match other.value {
            Value::List(stages) => Some(stages),
            Value::Map(entries) => entries.into_iter().find(|e| e.key == "stages").and_then(|e| match e.value.value {
                Value::List(stages) => Some(stages),
                _ => None,
            }),
            _ => None,
        };
        let Some(theirs) = theirs else {
            return Err(place(Problem::new("holds no `stages`, and no list of them").or_at(name.origin)));
        };
        all.extend(theirs);
    }
    *items = all;
    Ok(())
}

/// An included file's tree, with what it includes itself.
fn open(name: &Node, folder: &Path, above: &mut Vec<PathBuf>, read: &mut Read) -> Result<Node, Problem> {
    let refuse = |message: String| Problem::new(message).or_at(name.origin);
    let Some(text) = name.as_text() else {
        return Err(refuse(format!("expected the name of a file, found {}", yaml::describe(&name.value))));
    };
    let path = folder.join(text);
    let whole = path.canonicalize().unwrap_or_else(|_| path.clone());
    if above.contains(&whole) {
        return Err(refuse(format!("\"{}\" would include itself", shorten(text))));
    }
    if above.len() >= MAX_INCLUDES {
        return Err(refuse(format!("files are included more than {MAX_INCLUDES} deep")));
    }
    let mut tree = read(&path).map_err(refuse)?;
    above.push(whole);
    let inner = path.parent().map(Path::to_owned).unwrap_or_default();
    include(&mut tree, &inner, above, read)?;
    if let Value::List(_) = &tree.value {
        include_stages(&mut tree, &inner, above, read)?;
    }
    above.pop();
    Ok(tree)
}

fn key(word: &str) -> Segment {
    Segment::Key(word.to_owned())
}

/// Takes out the keys that begin with `x-`.
pub(super) fn strip(node: &mut Node) {
    match &mut node.value {
        Value::Map(entries) => {
            entries.retain(|entry| !entry.key.starts_with("x-"));
            entries.iter_mut().for_each(|entry| strip(&mut entry.value));
        }
        Value::List(items) => items.iter_mut().for_each(strip),
        _ => {}
    }
}

/// Puts the values of variables in the place of their names, and takes `variables` out.
pub(super) fn substitute(root: &mut Node) -> Result<(), Problem> {
    let Value::Map(entries) = &mut root.value else { return Ok(()) };
    let Some(at) = entries.iter().position(|entry| entry.key == "variables") else { return Ok(()) };
    let Entry { value: given, .. } = entries.remove(at);
    let mut left = MAX_VALUES;
    let known = variables(given, &mut left)?;
    replace(root, &known, &mut left)?;
    check_depth(root, MAX_DEPTH + 2)
}

/// Refuses what became deeper than a text may be, by lists of variables in lists of variables.
fn check_depth(node: &Node, left: usize) -> Result<(), Problem> {
    let Some(left) = left.checked_sub(1) else {
        let message = format!("lists and mappings are more than {MAX_DEPTH} deep, with variables in their places");
        return Err(Problem::new(message).or_at(node.origin));
    };
    match &node.value {
        Value::List(items) => items.iter().try_for_each(|item| check_depth(item, left)),
        Value::Map(entries) => entries.iter().try_for_each(|entry| check_depth(&entry.value, left)),
        _ => Ok(()),
    }
}

/// The variables of a pipeline, each with those before it in its value.
fn variables(given: Node, left: &mut usize) -> Result<Vec<Entry>, Problem> {
    let Value::Map(given) = given.value else {
        let message = format!("expected a mapping such as {{rays: 64}}, found {}", yaml::describe(&given.value));
        return Err(Problem::new(message).or_at(given.origin).inside(key("variables")));
    };
    let mut known: Vec<Entry> = Vec::new();
    // Each may use those before it.
    for mut entry in given {
        let plain = |c: char| c.is_alphanumeric() || c == '_' || c == '-';
        if entry.key.is_empty() || !entry.key.chars().all(plain) {
            let message = "a variable's name is made of letters, digits, `-` and `_`";
            return Err(Problem::new(message).or_at(entry.origin).inside(key(&entry.key)).inside(key("variables")));
        }
        let placed = |p: Problem| p.inside(key(&entry.key)).inside(key("variables"));
        replace(&mut entry.value, &known, left).map_err(placed)?;
        check_depth(&entry.value, MAX_DEPTH).map_err(placed)?;
        known.push(entry);
    }
    Ok(known)
}

/// Recursion is bounded by the depth of trees.
fn replace(node: &mut Node, known: &[Entry], left: &mut usize) -> Result<(), Problem> {
    *left = left.checked_sub(1).ok_or_else(|| {
        Problem::new(format!("variables make more than {MAX_VALUES} values of the pipeline")).or_at(node.origin)
    })?;
    match &mut node.value {
        Value::Text(text) if text.contains('$') => {
            let value = in_text(text, known).map_err(|message| Problem::new(message).or_at(node.origin))?;
            if let Value::List(_) | Value::Map(_) = &value {
                *left = left.saturating_sub(size(&value));
            }
            node.value = value;
            Ok(())
        }
        Value::List(items) => items
            .iter_mut()
            .enumerate()
            .try_for_each(|(i, item)| replace(item, known, left).map_err(|p| p.inside(Segment::Index(i)))),
        Value::Map(entries) => entries.iter_mut().try_for_each(|entry| {
            replace(&mut entry.value, known, left).map_err(|p| p.inside(Segment::Key(entry.key.clone())))
        }),
        _ => Ok(()),
    }
}

fn size(value: &Value) -> usize {
    match value {
        Value::List(items) => items.iter().map(|item| 1 + size(&item.value)).sum(),
        Value::Map(entries) => entries.iter().map(|entry| 1 + size(&entry.value.value)).sum(),
        _ => 0,
    }
}

/// What a text with dollar signs stands for.
fn in_text(text: &str, known: &[Entry]) -> Result<Value, String> {
    let plain = |c: char| c.is_alphanumeric() || c == '_' || c == '-';
    let whole =
        text.strip_prefix('$').map(|name| name.strip_prefix('{').map_or(name, |n| n.strip_suffix('}').unwrap_or(n)));
    if let Some(name) = whole.filter(|name| !name.is_empty() && name.chars().all(plain)) {
        return Ok(find(name, known)?.value.clone());
    }
    let (mut out, mut rest) = (String::new(), text);
    while let Some((before, after)) = rest.split_once('$') {
        out += before;
        if let Some(after) = after.strip_prefix('$') {
            out.push('$');
            rest = after;
        } else if let Some((name, after)) = after.strip_prefix('{').and_then(|inner| inner.split_once('}')) {
            match &find(name, known)?.value {
                Value::Text(text) => out += text,
                Value::Integer(i) => out += &i.to_string(),
                Value::Float(x) => out += &crate::text::number(*x),
                Value::Bool(b) => out += &b.to_string(),
                other => return Err(format!("`{name}` is {}, which can't stand within a text", yaml::describe(other))),
            }
            rest = after;
        } else {
            out.push('$');
            rest = after;
        }
    }
    Ok(Value::Text(out + rest))
}

fn find<'k>(name: &str, known: &'k [Entry]) -> Result<&'k Node, String> {
    known.iter().find(|entry| entry.key == name).map(|entry| &entry.value).ok_or_else(|| {
        let message = format!("no variable is called `{}` (write `$$` for a dollar sign)", shorten(name));
        suggest::unknown(&message, name, known.iter().map(|entry| entry.key.as_str()))
    })
}

/// One pipeline of a sweep: the overrides that make it, and what is appended to its name.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Swept {
    pub sets: Vec<String>,
    pub suffix: String,
}

/// Takes `sweep` out of a tree; the pipelines that it makes, in order, the last key's values changing fastest. None if there is no
/// sweep.
pub(super) fn sweep(root: &mut Node) -> Result<Option<Vec<Swept>>, Problem> {
    let Value::Map(entries) = &mut root.value else { return Ok(None) };
    let Some(at) = entries.iter().position(|entry| entry.key == "sweep") else { return Ok(None) };
    let Entry { value: mut asked, origin, .. } = entries.remove(at);
    if let Some(Entry { value: given, .. }) = entries.iter().find(|entry| entry.key == "variables") {
        let mut left = MAX_VALUES;
        let known = variables(given.clone(), &mut left)?;
        replace(&mut asked, &known, &mut left).map_err(|p| p.inside(key("sweep")))?;
    }
    let refuse = |message: String, origin: Origin| Problem::new(message).or_at(origin).inside(key("sweep"));
    let keys = match asked.value {
        Value::Map(keys) if !keys.is_empty() => keys,
        other => {
            let found = yaml::describe(&other);
            return Err(refuse(
                format!("expected keys with lists such as {{occlusion.samples: [16, 64]}}, found {found}"),
                origin,
            ));
        }
    };
    let mut all = vec![Swept::default()];
    for Entry { key: name, value, origin } in &keys {
        let Value::List(values) = &value.value else {
            let found = yaml::describe(&value.value);
            return Err(refuse(format!("`{}`: expected a list of values, found {found}", shorten(name)), *origin));
        };
        if values.is_empty() || all.len().saturating_mul(values.len()) > MAX_SWEPT {
            let found = all.len().saturating_mul(values.len());
            return Err(refuse(format!("expected 1 to {MAX_SWEPT} pipelines, found {found}"), *origin));
        }
        let more = all.iter().flat_map(|swept| {
            values.iter().enumerate().map(move |(i, value)| {
                let (mut sets, last) = (swept.sets.clone(), name.rsplit('.').next().unwrap_or(name));
                sets.push(format!("{name}={}", yaml::emit(value).trim_end()));
                let suffix = format!("{}-{}-{}", swept.suffix, fit(last), label(value, i));
                Swept { sets, suffix }
            })
        });
        all = more.collect();
    }
    let mut seen = std::collections::BTreeSet::new();
    if let Some(twice) = all.iter().find(|swept| !seen.insert(swept.suffix.clone())) {
        return Err(refuse(
            format!("two pipelines of it would be called NAME{}; give different values", twice.suffix),
            origin,
        ));
    }
    Ok(Some(all))
}

/// A value as a part of a name: itself where it is short, else its place in the list.
fn label(value: &Node, i: usize) -> String {
    let text = match &value.value {
        Value::Text(text) => fit(text),
        Value::Integer(n) => n.to_string(),
        Value::Float(x) => crate::text::number(*x),
        Value::Bool(b) => b.to_string(),
        _ => String::new(),
    };
    if text.is_empty() || text.len() > 30 { (i + 1).to_string() } else { text }
}

/// What of a text may stand in a folder's name.
fn fit(text: &str) -> String {
    text.chars().map(|c| if c.is_alphanumeric() || ".-_".contains(c) { c } else { '-' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tree(text: &str) -> Node {
        yaml::parse(text).unwrap()
    }

    fn shown(node: &Node) -> String {
        yaml::decode::<serde_json::Value>(node).unwrap().to_string()
    }

    fn composed(text: &str, files: &[(&str, &str)]) -> Result<String, String> {
        let mut root = tree(text);
        let mut read = |path: &Path| {
            let found = files.iter().find(|(name, _)| Path::new(name) == path);
            found.map(|(_, text)| tree(text)).ok_or_else(|| format!("{} isn't there", path.display()))
        };
        let all = include(&mut root, Path::new(""), &mut Vec::new(), &mut read).and_then(|()| substitute(&mut root));
        all.map_err(|p| format!("{}: {p}", p.path()))?;
        strip(&mut root);
        Ok(shown(&root))
    }

    #[test]
    fn files_variables_and_own_keys() {
        let files = [
            ("lib/scene.yaml", "variables: {n: 1, m: 2}\nname: theirs\nstages: [{scene: $n}, {include: more.yaml}]"),
            ("lib/more.yaml", "[{occlusion: 5}]"),
        ];
        for (text, expected) in [
            (
                "include: lib/scene.yaml\nname: a\nvariables: {n: 7}\nstages: [{render: $m}]\n",
                r#"{"name":"a","stages":[{"scene":7},{"occlusion":5},{"render":2}]}"#,
            ),
            (
                "name: a\nstages: [{x: 1}, {include: lib/more.yaml}, {y: 2}]",
                r#"{"name":"a","stages":[{"x":1},{"occlusion":5},{"y":2}]}"#,
            ),
            (
                "x-note: hi\nvariables: {a: [1, 2], b: \"q${c}\"}\n",
                "variables.b: no variable is called `c` (write `$$` for a dollar sign) (known: a)",
            ),
            (
                "x-note: hi\nvariables: {a: [1, 2], c: 3, b: \"q${c}\"}\nl: $a\nt: \"${b}-$$-$5\"\nm: {x-own: 1, k: true}\n",
                r#"{"l":[1,2],"t":"q3-$-$5","m":{"k":true}}"#,
            ),
            ("variables: {a: [1]}\nt: \"s${a}\"\n", "t: `a` is a list of 1, which can't stand within a text"),
            ("include: lib/none.yaml\n", "include: lib/none.yaml isn't there"),
            ("include: [3]\n", "include[0]: expected the name of a file, found the number 3"),
            ("price: $5\n", r#"{"price":"$5"}"#),
        ] {
            assert_eq!(composed(text, &files).unwrap_or_else(|e| e), expected, "{text}");
        }
        let loops = [("a.yaml", "include: b.yaml\n"), ("b.yaml", "include: a.yaml\n")];
        assert_eq!(composed("include: a.yaml\n", &loops).unwrap_err(), "include: \"a.yaml\" would include itself");
    }

    #[test]
    fn variables_do_not_grow_without_bound() {
        let mut text = String::from("variables:\n  v0: [x, x, x, x, x, x, x, x, x, x]\n");
        for i in 1..9 {
            text += &format!("  v{i}: [{}]\n", vec![format!("$v{}", i - 1); 10].join(", "));
        }
        assert!(composed(&(text + "a: $v8\n"), &[]).unwrap_err().contains("more than 200000 values"));
    }

    #[test]
    fn sweeps_are_all_combinations() {
        let mut root = tree("sweep: {occlusion.samples: [16, 64], r.camera.eye: [[0, 0, 0, 1], [1, 0, 0, 1]]}\n");
        let all = sweep(&mut root).unwrap().unwrap();
        let suffixes: Vec<&str> = all.iter().map(|swept| swept.suffix.as_str()).collect();
        assert_eq!(suffixes, ["-samples-16-eye-1", "-samples-16-eye-2", "-samples-64-eye-1", "-samples-64-eye-2"]);
        assert_eq!(all[3].sets, ["occlusion.samples=64", "r.camera.eye=[1, 0, 0, 1]"]);
        assert_eq!(shown(&root), "{}");
        for (text, message) in [
            ("sweep: 3\n", "found the number 3"),
            ("sweep: {a.b: 3}\n", "expected a list of values, found the number 3"),
            ("sweep: {a.b: []}\n", "expected 1 to 10000 pipelines, found 0"),
            ("sweep: {a.b: [1, 1]}\n", "two pipelines of it would be called NAME-b-1"),
        ] {
            let problem = sweep(&mut tree(text)).unwrap_err();
            assert!(problem.to_string().contains(message), "{text}: {problem}");
        }
    }
}
