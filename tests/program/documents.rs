//! What the documents show runs: each of their pipelines, and each part of one within a small pipeline, is checked.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What parts of pipelines stand in.
const AROUND: &str = "
name: around
seed: 1
stages:
  - scene: {objects: [{polytope: {cells: 5}}]}
  - occlusion: {samples: 16}
  - render: {id: with-ao, dimensions: [8, 8, 8]}
  - wireframe: {id: edges, vtp: all-edges.vtp}
  - write: {id: written, vti: other.vti, arrays: [rgba, opacity, depth, normal]}
";

/// The blocks of YAML of a document, each with its first line's number.
fn blocks(text: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    let mut lines = text.lines().enumerate();
    while let Some((at, line)) = lines.next() {
        if line == "```yaml" {
            let block: Vec<&str> = lines.by_ref().map(|(_, l)| l).take_while(|l| *l != "```").collect();
            found.push((at + 2, block.join("\n") + "\n"));
        }
    }
    found
}

/// As a whole pipeline; nothing if it is something else.
fn pipeline(block: &str) -> Option<String> {
    let begins = |with: &str| block.lines().any(|line| line.starts_with(with));
    if begins("stages:") {
        Some(block.to_owned())
    } else if begins("  - ") {
        Some(format!("{AROUND}{block}"))
    } else if begins("  objects:") {
        let inner: String = block.lines().map(|line| format!("    {line}\n")).collect();
        Some(format!("name: scene\nseed: 1\nstages:\n  - scene:\n{inner}"))
    } else {
        None
    }
}

/// What a heading is called in links, as hosts of repositories and mdBook call it.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().chars().filter(|c| c.is_alphanumeric() || matches!(c, '-' | '_' | ' '));
    kept.collect::<String>().to_lowercase().replace(' ', "-")
}

/// A document without its blocks of code.
fn prose(text: &str) -> String {
    text.split("```").step_by(2).collect()
}

/// Where a document's links lead.
fn links(text: &str) -> Vec<String> {
    let after = text.split("](").skip(1).filter_map(|rest| rest.split_once(')'));
    after.map(|(to, _)| to.to_owned()).filter(|to| !to.contains("://") && !to.contains(' ')).collect()
}

/// All documents of the repository, but those of what is built.
fn documents(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap()) {
        let (path, name) = (entry.path(), entry.file_name().into_string().unwrap());
        if entry.file_type().unwrap().is_dir() {
            if !name.starts_with('.') && name != "target" && name != "out" {
                documents(&path, found);
            }
        } else if name.ends_with(".md") {
            found.push(path);
        }
    }
}

#[test]
fn every_link_of_the_documents_leads_somewhere() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut all = Vec::new();
    documents(root, &mut all);
    let (mut followed, mut wrong) = (0, Vec::new());
    for document in &all {
        let text = prose(&fs::read_to_string(document).unwrap());
        for to in links(&text) {
            let (path, part) = to.split_once('#').unwrap_or((&to, ""));
            let target = if path.is_empty() { document.clone() } else { document.parent().unwrap().join(path) };
            followed += 1;
            let known = || {
                let text = prose(&fs::read_to_string(&target).unwrap());
                let mut headings = text.lines().filter(|line| line.starts_with('#'));
                headings.any(|line| anchor(line.trim_start_matches('#')) == part)
                    || text.contains(&format!("id=\"{part}\""))
            };
            if !target.exists() || !part.is_empty() && !known() {
                wrong.push(format!("{}: {to}", document.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(followed > 100, "only {followed} links");
}

/// Every page of docs/ is one of the book.
#[test]
fn the_book_has_every_page() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    let listed = links(&fs::read_to_string(docs.join("SUMMARY.md")).unwrap());
    let mut pages = Vec::new();
    documents(&docs, &mut pages);
    for page in pages {
        let name = page.file_name().unwrap().to_str().unwrap().to_owned();
        assert!(name == "SUMMARY.md" || listed.contains(&name), "{name} is not in SUMMARY.md");
    }
}

fn ao4d(folder: &Path, arguments: &[&str]) -> (bool, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_ao4d")).current_dir(folder).args(arguments).output().unwrap();
    (output.status.success(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn every_pipeline_in_the_documents_is_right() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // What they read, under the names that they have there.
    fs::create_dir_all(folder.join("pipelines/meshes")).unwrap();
    fs::copy(root.join("pipelines/meshes/ant.ply"), folder.join("pipelines/meshes/ant.ply")).unwrap();
    let corners = ["0 0 0", "1 0 0", "0 1 0", "0 0 1"];
    let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    let loops = faces.map(|f| f.map(|v| format!("vertex {}\n", corners[v])).concat());
    let facets = loops.map(|l| format!("facet normal 0 0 0\nouter loop\n{l}endloop\nendfacet\n")).concat();
    fs::write(folder.join("part.stl"), format!("solid part\n{facets}endsolid part\n")).unwrap();
    fs::create_dir_all(folder.join("scenes")).unwrap();
    fs::create_dir_all(folder.join("parts")).unwrap();
    fs::write(
        folder.join("scenes/two_cubes.yaml"),
        "stages:\n  - scene: {objects: [{box: {min: [0, 0, 0, 0], max: [1, 1, 1, 1]}}]}\n",
    )
    .unwrap();
    fs::write(folder.join("parts/floor.yaml"), "stages:\n  - mesh: {vtu: floor.vtu}\n").unwrap();
    fs::write(folder.join("around.yaml"), AROUND).unwrap();
    let (ran, told) = ao4d(folder, &["run", "around.yaml", "--out", "."]);
    assert!(ran, "{told}");

    let mut documents = vec![root.join("README.md"), root.join("python/README.md")];
    documents.extend(fs::read_dir(root.join("docs")).unwrap().map(|entry| entry.unwrap().path()));
    let (mut checked, mut wrong) = (0, Vec::new());
    for document in documents.iter().filter(|d| d.extension().is_some_and(|e| e == "md")) {
        for (line, block) in blocks(&fs::read_to_string(document).unwrap()) {
            let Some(text) = pipeline(&block) else { continue };
            fs::write(folder.join("block.yaml"), text).unwrap();
            let (right, told) = ao4d(folder, &["check", "block.yaml"]);
            checked += 1;
            if !right {
                wrong.push(format!("{}:{line}: {told}", document.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(checked >= 15, "only {checked} pipelines were found in the documents");
}
