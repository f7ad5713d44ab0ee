//! Files that a run reads: taken if they fit, else refused before anything is written.

use std::path::Path;
use std::process::Command;

use super::{Folder, PIPELINE, contents, names, same};

#[test]
fn loaded_occlusion() {
    let folder = Folder::new();
    folder.runs(&["--out", "first"]);
    let first = folder.path("first");
    let keep = |name: &str, bytes: &[u8]| std::fs::write(folder.path(name), bytes).unwrap();
    let (values, beside) =
        (std::fs::read(first.join("ao.f32")).unwrap(), std::fs::read(first.join("ao.f32.yaml")).unwrap());
    keep("kept.f32", &values);
    keep("kept.f32.yaml", &beside);
    keep("kept.error.f32", &std::fs::read(first.join("ao.error.f32")).unwrap());
    let load = |name: &str| [format!("ao.load={name}"), "ao.samples=".to_owned()];
    let sets = load("kept.f32");
    let load_kept = ["--set", &sets[0], "--set", &sets[1], "--out", "second"];
    folder.runs(&load_kept);
    let (first, second) = (contents(&first), contents(&folder.path("second")));
    for (name, bytes) in &first {
        // What tells of the pipeline tells where its occlusion came from.
        let tells = [".vti", ".vtu", ".png", ".yaml"].iter().any(|ending| name.ends_with(ending));
        assert_eq!(tells, *bytes != second[name], "{name}");
        if name.ends_with(".vti") || name.ends_with(".vtu") {
            assert!(same(&folder, &format!("first/{name}"), &format!("second/{name}")), "{name}");
        }
    }
    assert_eq!(folder.runs(&load_kept).0, [""; 0]);

    let text = String::from_utf8(beside.clone()).unwrap();
    let one_more = [&values[..], &[0; 4]].concat();
    let other_mesh = text.replace("mesh: ", "mesh: 0");
    for (name, values, beside, words) in [
        ("truncated.f32", Some(&values[..values.len() - 1]), Some(&text), "values take"),
        ("longer.f32", Some(&one_more), Some(&text), "values take"),
        ("empty.f32", Some(&[]), Some(&text), "it holds 0 bytes"),
        ("foreign.f32", Some(&values), Some(&other_mesh), "it was computed for another mesh"),
        ("alone.f32", Some(&values), None, "alone.f32.yaml"),
        ("missing.f32", None, Some(&text), "there is no file"),
    ] {
        if let Some(values) = values {
            keep(name, values);
        }
        if let Some(text) = beside {
            keep(&format!("{name}.yaml"), text.as_bytes());
        }
        let sets = load(name);
        folder.fails(&["--set", &sets[0], "--set", &sets[1]], 2, &[name, words, "ao.load"]);
    }
    // Errors may be missing, but not wrong.
    keep("bare.f32", &values);
    keep("bare.f32.yaml", &beside);
    let sets = load("bare.f32");
    folder.runs(&["--set", &sets[0], "--set", &sets[1], "--out", "third"]);
    assert!(!names(&folder.path("third")).contains(&"ao.error.f32".to_owned()));
    keep("bare.error.f32", &values[1..]);
    folder.fails(&["--set", &sets[0], "--set", &sets[1]], 2, &["bare.error.f32", "values take", "ao.load"]);
    // A file that was good when it was loaded, and is another mesh's now, isn't taken from the cache.
    keep("kept.f32.yaml", other_mesh.as_bytes());
    let output = folder.run(&load_kept);
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn bad_input_files_are_refused_before_anything_is_written() {
    let meshes = Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines/meshes");
    let folder = Folder::with(&PIPELINE.replace("tesseract: {size: 0.5}", "extrude: {mesh: m.vtu, from: 0, to: 1}"));
    let nut = std::fs::read(meshes.join("nut.vtu")).unwrap();
    let keep = |name: &str, bytes: &[u8]| std::fs::write(folder.path(name), bytes).unwrap();
    let refused =
        |words: &[&str]| folder.fails(&[], 2, &[&["p.yaml:", "scene.objects[1].extrude.mesh"], words].concat());
    refused(&["extrude.mesh: can't read m.vtu"]);
    keep("m.vtu", &nut[..nut.len() / 2]);
    refused(&["m.vtu", "cut short"]);
    keep("m.vtu", b"");
    refused(&["m.vtu", "is empty"]);
    keep("m.vtu", &std::fs::read(meshes.join("ant.ply")).unwrap());
    refused(&["m.vtu", "not a VTK file"]);

    let pipeline = PIPELINE.replace("tesseract: {size: 0.5}", "extrude: {mesh: m.ply, from: 0, to: 1}");
    keep("p.yaml", pipeline.as_bytes());
    let ply = std::fs::read(meshes.join("ant.ply")).unwrap();
    keep("m.ply", &ply[..ply.len() - 200]);
    refused(&["m.ply"]);
    keep("p.yaml", pipeline.replace("m.ply", "m.stl").as_bytes());
    for number in ["nan", "inf"] {
        let triangle = format!(
            "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex {number} 0 0\nvertex 0 1 0\nendloop\n\
             endfacet\nendsolid x\n"
        );
        keep("m.stl", triangle.as_bytes());
        refused(&["m.stl", "finite"]);
    }
    for number in [".nan", ".inf", "-.inf"] {
        keep("p.yaml", PIPELINE.replace("[[-2, -2, -1, -1.3]", &format!("[[-2, -2, -1, {number}]")).as_bytes());
        folder.fails(&[], 2, &["scene.objects[0].simplices.vertices", "finite"]);
    }
}

#[test]
fn check_writes_nothing() {
    let folder = Folder::new();
    let output = Command::new(env!("CARGO_BIN_EXE_ao4d"))
        .current_dir(folder.0.path())
        .args(["check", "p.yaml"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(names(folder.0.path()), ["p.yaml"]);
}
