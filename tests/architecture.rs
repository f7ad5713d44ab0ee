//! The floors of the house, as ARCHITECTURE.md lists them: a module uses those below it, never those above or beside it;
//! and within a module no files use each other in a circle.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// From the ground up; modules on one floor don't know each other.
const FLOORS: &[&[&str]] = &[
    &["geometry", "input", "progress", "text"],
    &["volume", "mesh"],
    &["io"],
    &["scene", "accel"],
    &["trace"],
    &["occlusion"],
    &["render"],
    &["session"],
    &["inspect", "stages"],
    &["pipeline"],
];

fn floor(module: &str) -> usize {
    FLOORS.iter().position(|f| f.contains(&module)).unwrap_or_else(|| panic!("`{module}` is on no floor"))
}

/// The crate's modules that a file names, with the line; what only its tests use doesn't count.
fn used(text: &str) -> Vec<(usize, String)> {
    let code = text.split("#[cfg(test)]").next().unwrap_or_default();
    let mut found = Vec::new();
    for (number, line) in code.lines().enumerate() {
        if line.trim_start().starts_with("//") {
            continue;
        }
        for rest in line.split("crate::").skip(1) {
            let name: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            if FLOORS.iter().flat_map(|f| f.iter()).any(|m| **m == *name) {
                found.push((number + 1, name));
            }
        }
    }
    found
}

#[test]
fn no_module_uses_one_above_or_beside_it() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let (mut files, mut uses) = (0, 0);
    let mut open = vec![source.clone()];
    while let Some(path) = open.pop() {
        if path.is_dir() {
            open.extend(std::fs::read_dir(path).unwrap().map(|e| e.unwrap().path()));
            continue;
        }
        let within = path.strip_prefix(&source).unwrap();
        let module = within.iter().next().unwrap().to_str().unwrap().trim_end_matches(".rs");
        if ["main", "lib", "cli"].contains(&module) {
            continue;
        }
        files += 1;
        for (line, name) in used(&std::fs::read_to_string(&path).unwrap()) {
            uses += 1;
            let allowed = name == module || floor(&name) < floor(module);
            assert!(allowed, "src/{}:{line}: `{module}` uses `{name}`, which is not below it", within.display());
        }
    }
    assert!(files > 50 && uses > 100, "{files} files, {uses} uses: the test looks in the wrong place");
}

/// Circles that are still there, each by its files; one that is gone is to be crossed out here.
const KNOWN_CIRCLES: &[&[&str]] = &[
    &["cli/console.rs", "cli/options.rs"],
    &["scene/hypersphere.rs", "scene/polytope.rs"],
    // Stages name the stages that they work on, and each plan all of them.
    &[
        "stages/occlusion.rs",
        "stages/picture.rs",
        "stages/prepare.rs",
        "stages/render.rs",
        "stages/run.rs",
        "stages/scene.rs",
        "stages/subject.rs",
        "stages/write/mod.rs",
        "stages/write/files.rs",
    ],
];

/// Source text without comments, strings and tests.
fn plain(text: &str) -> String {
    let code = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
    let lines = code.lines().map(|line| line.split("//").next().unwrap_or_default());
    lines.collect::<Vec<_>>().join("\n")
}

/// The paths that a `use` names, each as its segments, with braces expanded.
fn expand(tree: &str) -> Vec<Vec<String>> {
    let tree = tree.trim();
    if let Some(open) = tree.find('{') {
        let head: Vec<String> = segments(&tree[..open]);
        let inner = tree[open + 1..].rsplit_once('}').map_or("", |(inner, _)| inner);
        let (mut depth, mut start, mut parts) = (0, 0, Vec::new());
        for (i, c) in inner.char_indices() {
            match c {
                '{' => depth += 1,
                '}' => depth -= 1,
                ',' if depth == 0 => {
                    parts.push(&inner[start..i]);
                    start = i + 1;
                }
                _ => {}
            }
        }
        parts.push(&inner[start..]);
        let tails = parts.into_iter().filter(|part| !part.trim().is_empty()).flat_map(expand);
        return tails.map(|tail| head.iter().cloned().chain(tail).collect()).collect();
    }
    vec![segments(tree.split(" as ").next().unwrap_or_default())]
}

fn segments(path: &str) -> Vec<String> {
    path.split("::").map(|s| s.trim().to_owned()).filter(|s| !s.is_empty()).collect()
}

/// The modules of the crate, each as its path from the root, with its file and what it hands on from its children.
struct Crate {
    files: BTreeMap<Vec<String>, PathBuf>,
    texts: BTreeMap<Vec<String>, String>,
    /// Names that a module re-exports, and where they come from.
    handed_on: BTreeMap<Vec<String>, BTreeMap<String, Vec<String>>>,
}

impl Crate {
    fn read(source: &Path) -> Self {
        let mut found = Self { files: BTreeMap::new(), texts: BTreeMap::new(), handed_on: BTreeMap::new() };
        let mut open = vec![source.to_owned()];
        while let Some(path) = open.pop() {
            if path.is_dir() {
                open.extend(std::fs::read_dir(path).unwrap().map(|e| e.unwrap().path()));
                continue;
            }
            let within = path.strip_prefix(source).unwrap().with_extension("");
            let mut module: Vec<String> = within.iter().map(|s| s.to_str().unwrap().to_owned()).collect();
            if module.last().is_some_and(|last| last == "mod") || module == ["lib"] {
                module.pop();
            }
            found.texts.insert(module.clone(), plain(&std::fs::read_to_string(&path).unwrap()));
            found.files.insert(module, path.strip_prefix(source).unwrap().to_owned());
        }
        for (module, text) in &found.texts {
            let mut names = BTreeMap::new();
            for statement in uses(text).filter(|statement| statement.starts_with("pub")) {
                for path in expand(statement.split_once("use ").unwrap().1) {
                    if let Some(path) = found.absolute(module, &path) {
                        names.insert(path.last().unwrap().clone(), path);
                    }
                }
            }
            found.handed_on.insert(module.clone(), names);
        }
        found
    }

    /// A path from the root, if it is one of this crate.
    fn absolute(&self, module: &[String], path: &[String]) -> Option<Vec<String>> {
        let (first, rest) = path.split_first()?;
        let mut base = match first.as_str() {
            "crate" => Vec::new(),
            "self" => module.to_vec(),
            "super" => module[..module.len().checked_sub(1)?].to_vec(),
            child if self.files.contains_key(&[module, &[child.to_owned()]].concat()) => {
                [module, &[child.to_owned()]].concat()
            }
            _ => return None,
        };
        for segment in rest {
            if segment == "super" { drop(base.pop()) } else { base.push(segment.clone()) }
        }
        Some(base)
    }

    /// The module in whose file a path ends, through all that is handed on.
    fn owner(&self, path: &[String]) -> Vec<String> {
        let mut path = path.to_vec();
        for _ in 0..10 {
            let known = (0..=path.len()).rev().find(|&n| self.files.contains_key(&path[..n])).unwrap_or(0);
            let Some(name) = path.get(known) else { return path };
            let Some(from) = self.handed_on[&path[..known]].get(name) else { return path[..known].to_vec() };
            if from[..] == path[..=known] {
                return path[..known].to_vec();
            }
            path = [&from[..], &path[known + 1..]].concat();
        }
        path
    }

    /// The modules that a module's own code uses. What it only hands on doesn't count, and neither does what a part uses of
    /// the module that it is a part of.
    fn used_by(&self, module: &[String]) -> BTreeSet<Vec<String>> {
        let text = &self.texts[module];
        let mut paths: Vec<Vec<String>> = Vec::new();
        let mut rest = text.clone();
        for statement in uses(text) {
            rest = rest.replacen(statement, "", 1);
            if !statement.starts_with("pub") {
                paths.extend(expand(statement.split_once("use ").unwrap().1));
            }
        }
        let is_path = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
        paths.extend(rest.split(|c| !is_path(c)).filter(|word| word.contains("::")).map(segments));
        let owners = paths.iter().filter_map(|path| self.absolute(module, path)).map(|path| self.owner(&path));
        owners.filter(|owner| !module.starts_with(owner)).collect()
    }
}

/// The `use` statements of a text, without the semicolon.
fn uses(text: &str) -> impl Iterator<Item = &str> {
    text.split_inclusive(';').filter_map(|piece| {
        let at = piece.find("use ").filter(|&at| piece[..at].ends_with(['\n', ' ', ')']) || at == 0)?;
        let line = piece[..at].rfind('\n').map_or(0, |n| n + 1);
        let before = piece[line..at].trim();
        (before.is_empty() || before.starts_with("pub")).then(|| piece[line..].trim().trim_end_matches(';'))
    })
}

#[test]
fn no_files_use_each_other_in_a_circle() {
    let all = Crate::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"));
    let modules: Vec<Vec<String>> = all.files.keys().filter(|m| !m.is_empty() && *m != &["main"]).cloned().collect();
    let used: BTreeMap<_, _> = modules.iter().map(|module| (module, all.used_by(module))).collect();
    assert!(used.values().map(BTreeSet::len).sum::<usize>() > 300, "the test finds too few uses");
    let reach = |from: &Vec<String>| {
        let (mut seen, mut open) = (BTreeSet::new(), vec![from]);
        while let Some(module) = open.pop() {
            for next in used.get(module).into_iter().flatten() {
                if seen.insert(next) {
                    open.push(next);
                }
            }
        }
        seen
    };
    let reached: BTreeMap<_, _> = modules.iter().map(|module| (module, reach(module))).collect();
    let mut circles: BTreeSet<Vec<String>> = BTreeSet::new();
    for module in &modules {
        let circle = reached[module].iter().filter(|other| reached.get(*other).is_some_and(|r| r.contains(module)));
        let circle: Vec<String> = circle.map(|m| all.files[*m].display().to_string()).collect();
        if !circle.is_empty() {
            circles.insert(circle);
        }
    }
    let known: BTreeSet<Vec<String>> =
        KNOWN_CIRCLES.iter().map(|circle| circle.iter().map(|file| (*file).to_owned()).collect()).collect();
    let new: Vec<_> = circles.difference(&known).collect();
    let gone: Vec<_> = known.difference(&circles).collect();
    assert!(new.is_empty(), "these files use each other in a circle: {new:#?}");
    assert!(gone.is_empty(), "these are no circles any more, cross them out: {gone:#?}");
}
