//! `--set KEY=VALUE`: a change to the pipeline for one run.
//!
//! It edits the tree before anything is decoded, so an override is checked as strictly as the file, and a complaint
//! about it quotes it. KEY is a dotted path. Its first word is looked up in this order:
//!
//! 1. `name`, `seed` and `stages`, the pipeline's own keys (`stages[1].render.shading` reaches any stage); `folder`,
//!    `inputs`, `program`, `variables` and `sweep` too, where no stage is called so;
//! 2. a stage's `id`: `with-ao.dimensions` changes that stage;
//! 3. a kind of stage: `occlusion.samples` changes every stage of that kind, with an id or without.
//!
//! VALUE is YAML, so `render.dimensions=[20, 20, 20]` gives a list. Mappings on the way are made where they are
//! missing (`render.camera.projection` for a render without `camera`). An empty VALUE takes the key out, and where KEY
//! is a stage's id, a kind or `stages[1]` alone, those stages. `stages[+]` puts a stage behind the last one; other lists
//! are not made longer. Overrides apply in the order given.

use super::suggest;
use super::yaml::{self, Entry, Node, Origin, Problem, Segment, Value, shorten};
use crate::stages::KINDS;

/// The pipeline's own keys.
pub(super) const TOP_KEYS: [&str; 3] = ["name", "seed", "stages"];

/// Those of them that files tell, and nobody needs to write.
const RARE_KEYS: [&str; 5] = ["program", "folder", "inputs", "variables", "sweep"];

/// Where a stage is added.
const APPEND: &str = "stages[+]";

/// Applies one assignment to the tree. A refusal without a place is about the assignment itself.
pub(super) fn apply(root: &mut Node, assignment: &str, origin: Origin) -> Result<(), Problem> {
    let Some((key, text)) = assignment.split_once('=') else {
        return Err(Problem::new("write KEY=VALUE, for instance occlusion.samples=64"));
    };
    let value = if text.trim().is_empty() { None } else { Some(parse_value(text, origin)?) };
    if key.trim() == APPEND {
        return append(root, value);
    }
    let path = yaml::parse_path(key.trim()).map_err(Problem::new)?;
    let Some((Segment::Key(first), rest)) = path.split_first() else {
        return Err(Problem::new("the key is missing")); // parse_path gives a key first
    };
    // Ids may be called as these are, which are rarely set.
    let taken =
        |root: &Node| root.get("stages").is_some_and(|list| list.items().iter().any(|s| id_of(s) == Some(first)));
    if let ([Segment::Key(_), Segment::Index(index)], "stages", None) = (&path[..], first.as_str(), &value)
        && let Some(stages) = root_stages(root)
        && *index < stages.len()
    {
        stages.remove(*index);
        return Ok(());
    }
    if TOP_KEYS.contains(&first.as_str()) || (RARE_KEYS.contains(&first.as_str()) && !taken(root)) {
        return assign(root, &path, value.as_ref(), origin);
    }
    let Some(stages) = root_stages(root) else {
        return Err(Problem::new("the pipeline has no list of `stages` to change"));
    };
    let by_id = stages.iter().any(|stage| id_of(stage) == Some(first));
    let wanted = |stage: &Node| if by_id { id_of(stage) == Some(first) } else { kind_of(stage) == Some(first) };
    if rest.is_empty() && value.is_none() && stages.iter().any(wanted) {
        stages.retain(|stage| !wanted(stage));
        return Ok(());
    }
    let mut targets: Vec<&mut Node> = Vec::new();
    for stage in stages.iter_mut() {
        if let (true, Value::Map(entries)) = (wanted(stage), &mut stage.value) {
            targets.extend(entries.first_mut().map(|entry| &mut entry.value));
        }
    }
    if targets.is_empty() {
        return Err(unknown_target(stages, first));
    }
    if rest.is_empty() {
        return Err(Problem::new(format!("`{first}` is a stage; name one of its keys: {first}.KEY={}", shorten(text))));
    }
    targets.into_iter().try_for_each(|target| assign(target, rest, value.as_ref(), origin))
}

/// Puts a stage behind the last one.
fn append(root: &mut Node, stage: Option<Node>) -> Result<(), Problem> {
    let Some(stage) = stage else {
        return Err(Problem::new("write the stage that is to be added, for instance stages[+]={write: {png: a.png}}"));
    };
    let Some(stages) = root_stages(root) else {
        return Err(Problem::new("the pipeline has no list of `stages` to add to"));
    };
    stages.push(stage);
    Ok(())
}

fn parse_value(text: &str, origin: Origin) -> Result<Node, Problem> {
    let mut value = yaml::parse(text).map_err(|p| Problem::new(format!("the value {p}")))?;
    value.set_origin(origin);
    Ok(value)
}

fn root_stages(root: &mut Node) -> Option<&mut Vec<Node>> {
    let Value::Map(entries) = &mut root.value else { return None };
    match entries.iter_mut().find(|e| e.key == "stages").map(|e| &mut e.value.value) {
        Some(Value::List(stages)) => Some(stages),
        _ => None,
    }
}

/// The only key of a stage, and what it is given.
fn only_entry(stage: &Node) -> Option<&Entry> {
    match &stage.value {
        Value::Map(entries) if entries.len() == 1 => entries.first(),
        _ => None,
    }
}

fn kind_of(stage: &Node) -> Option<&str> {
    only_entry(stage).map(|entry| entry.key.as_str())
}

fn id_of(stage: &Node) -> Option<&str> {
    only_entry(stage)?.value.get("id")?.as_text()
}

fn unknown_target(stages: &[Node], word: &str) -> Problem {
    if KINDS.contains(&word) {
        return Problem::new(format!("the pipeline has no `{word}` stage"));
    }
    let ids = stages.iter().filter_map(id_of);
    let mut known: Vec<&str> = ids.chain(stages.iter().filter_map(kind_of)).chain(TOP_KEYS).collect();
    let mut seen = std::collections::BTreeSet::new();
    known.retain(|w| seen.insert(*w));
    Problem::new(suggest::unknown(&format!("no stage and no key is called `{}`", shorten(word)), word, known))
}

/// Puts the value at a path below `node`, or takes the key there out.
fn assign(node: &mut Node, path: &[Segment], value: Option<&Node>, origin: Origin) -> Result<(), Problem> {
    let Some((segment, rest)) = path.split_first() else {
        return match value {
            Some(value) => {
                *node = value.clone();
                Ok(())
            }
            None => Err(Problem::new("a list's item can't be taken out; give the whole list")),
        };
    };
    let found = yaml::describe(&node.value);
    match (segment, &mut node.value) {
        (Segment::Key(key), Value::Map(entries)) => {
            let position = entries.iter().position(|e| e.key == *key);
            if rest.is_empty() && value.is_none() {
                entries.retain(|e| e.key != *key);
                return Ok(());
            }
            let entry = match position.and_then(|p| entries.get_mut(p)) {
                Some(entry) => entry,
                None if value.is_none() => return Ok(()), // nothing there to take out
                None => {
                    let blank = Node { origin, value: Value::Map(Vec::new()) };
                    entries.push(Entry { key: key.clone(), origin, value: blank });
                    match entries.last_mut() {
                        Some(entry) => entry,
                        None => return Ok(()),
                    }
                }
            };
            assign(&mut entry.value, rest, value, origin).map_err(|p| p.inside(segment.clone()))
        }
        (Segment::Index(index), Value::List(items)) => {
            let length = items.len();
            match items.get_mut(*index) {
                Some(item) => assign(item, rest, value, origin).map_err(|p| p.inside(segment.clone())),
                None => Err(Problem::new(format!("the list has {length} items, so [{index}] is outside it"))),
            }
        }
        (Segment::Key(key), _) => Err(Problem::new(format!("is {found}, so it has no key `{}`", shorten(key)))),
        (Segment::Index(index), _) => Err(Problem::new(format!("is {found}, not a list, so it has no [{index}]"))),
    }
}

#[cfg(test)]
mod tests {
    use crate::pipeline::Document;

    const PIPELINE: &str = "name: a
stages:
  - occlusion: {id: ao, samples: 4}
  - occlusion: {id: second, samples: 4}
  - render: {dimensions: [1, 2, 3]}
";

    fn after(assignments: &[&str]) -> Result<String, String> {
        let mut document = Document::parse("p.yaml", PIPELINE).unwrap();
        for assignment in assignments {
            document.set(assignment).map_err(|e| e.to_string())?;
        }
        document.decode::<serde_json::Value>().map(|v| v.to_string()).map_err(|e| e.to_string())
    }

    #[test]
    fn targets() {
        for (assignment, part) in [
            ("seed=3", r#""seed":3"#),
            ("name=b", r#"{"name":"b""#),
            ("ao.samples=64", r#"[{"occlusion":{"id":"ao","samples":64}},{"occlusion":{"id":"second","samples":4}}"#),
            ("occlusion.samples=64", r#""ao","samples":64}},{"occlusion":{"id":"second","samples":64}}"#),
            ("render.camera.field_of_view=60", r#""dimensions":[1,2,3],"camera":{"field_of_view":60}"#),
            ("render.dimensions=[20, 20, 20]", r#""dimensions":[20,20,20]"#),
            ("render.dimensions[1]=7", r#""dimensions":[1,7,3]"#),
            ("stages[2].render.shading=flat", r#""dimensions":[1,2,3],"shading":"flat""#),
            ("ao.samples=", r#"[{"occlusion":{"id":"ao"}},"#),
            ("ao.file=x=y.f32", r#""file":"x=y.f32""#),
            ("ao=", r#""stages":[{"occlusion":{"id":"second","samples":4}},{"render":{"dimensions":[1,2,3]}}]"#),
            ("occlusion=", r#""stages":[{"render":{"dimensions":[1,2,3]}}]"#),
            ("stages[1]=", r#""stages":[{"occlusion":{"id":"ao","samples":4}},{"render":{"dimensions":[1,2,3]}}]"#),
            ("stages[+]={write: {png: a.png}}", r#"{"render":{"dimensions":[1,2,3]}},{"write":{"png":"a.png"}}]"#),
        ] {
            let after = after(&[assignment]).unwrap();
            assert!(after.contains(part), "{assignment}: {after}");
        }
    }

    #[test]
    fn refusals_quote_the_assignment() {
        for (assignment, message) in [
            ("samples", "write KEY=VALUE, for instance occlusion.samples=64"),
            ("=3", "a key is missing; write KEY, KEY.KEY or KEY[0].KEY"),
            (
                "oclusion.samples=3",
                "no stage and no key is called `oclusion`, did you mean `occlusion`? (known: ao, second, occlusion, render, name, seed, stages)",
            ),
            ("paraview=", "the pipeline has no `paraview` stage"),
            ("stages[+]=", "write the stage that is to be added, for instance stages[+]={write: {png: a.png}}"),
            ("stages[3]=", "stages: the list has 3 items, so [3] is outside it"),
            ("paraview.state=a.py", "the pipeline has no `paraview` stage"),
            ("ao=3", "`ao` is a stage; name one of its keys: ao.KEY=3"),
            ("render.dimensions[3]=7", "dimensions: the list has 3 items, so [3] is outside it"),
            ("ao.samples.x=7", "samples: is the number 4, so it has no key `x`"),
            ("ao.samples=[1", "the value is not YAML: unclosed bracket '['"),
            ("stages[9].render.shading=flat", "stages: the list has 3 items, so [9] is outside it"),
        ] {
            assert_eq!(after(&[assignment]).unwrap_err(), format!("--set {assignment}: {message}"));
        }
    }

    #[test]
    fn the_last_one_wins() {
        assert!(after(&["ao.samples=8", "occlusion.samples=16"]).unwrap().contains(r#""ao","samples":16"#));
    }
}
