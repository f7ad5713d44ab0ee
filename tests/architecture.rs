//! The floors of the house, as ARCHITECTURE.md lists them: a module uses those below it, never those above or beside it.

use std::path::Path;

/// From the ground up; modules on one floor don't know each other.
const FLOORS: &[&[&str]] = &[
    &["geometry", "progress"],
    &["volume", "mesh"],
    &["io"],
    &["scene", "accel"],
    &["occlusion"],
    &["render"],
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
