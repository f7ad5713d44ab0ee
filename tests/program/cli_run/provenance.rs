//! Files tell the pipeline that made them: `ao4d info --pipeline FILE` prints it, and running that makes them again.

use std::path::Path;
use std::process::{Command, Output};

use super::{Folder, PIPELINE, contents, names, same};

fn ao4d(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ao4d")).current_dir(folder).args(arguments).output().unwrap()
}

/// What is printed, which must go well, and what is said besides.
fn prints(folder: &Path, arguments: &[&str]) -> (String, String) {
    let output = ao4d(folder, arguments);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {told}");
    (String::from_utf8(output.stdout).unwrap(), told)
}

/// What is refused, and how.
fn refused(folder: &Path, arguments: &[&str], words: &[&str]) {
    let output = ao4d(folder, arguments);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0), "{arguments:?}: {told}");
    words.iter().for_each(|word| assert!(told.contains(word), "{word}: {told}"));
}

#[test]
fn every_file_tells_the_pipeline_that_makes_them_all_again() {
    let more = "  - render: {id: own, dimensions: [4, 4, 4], shading: voxel, camera: {projection: parallel, height: 3}}
  - write: {vti: packed.vti, compression: zlib, encoding: inline}
  - mesh: {vtu: mesh.vtu}
";
    let folder = Folder::with(&(PIPELINE.to_owned() + more));
    let sets = [
        "--set",
        "ao.samples=5",
        "--set",
        "image.camera={eye: [0, 0.1, 0, 1.5]}",
        "--set",
        "plain.dilate=1",
        "--set",
        "image.shading=",
    ];
    folder.runs(&sets);
    let out = folder.path("out/small");
    let made = contents(&out);
    let mut texts = Vec::new();
    for name in made.keys() {
        let place = format!("out/small/{name}");
        if [".py", ".raw", ".error.f32"].iter().any(|ending| name.ends_with(ending)) {
            refused(
                &folder.path(""),
                &["info", "--pipeline", &place],
                &[&place, if name.contains("error") { "no" } else { "tells of no pipeline" }],
            );
            continue;
        }
        let (text, told) = prints(&folder.path(""), &["info", "--pipeline", &place]);
        assert_eq!(told, "", "{name}");
        texts.push(text);
    }
    assert_eq!(texts.len(), 8);
    assert!(texts.iter().all(|text| *text == texts[0]));
    // Overrides are applied, and defaults that took effect are there.
    for part in [
        "samples: 5",
        "eye: [0, 0.1, 0, 1.5]",
        "field_of_view: 90.0",
        "method: sobol",
        "shading: auto",
        "tolerance: 0.01",
        "seed: 1",
    ] {
        assert!(texts[0].contains(part), "{part} is not in\n{}", texts[0]);
    }
    std::fs::write(folder.path("again.yaml"), &texts[0]).unwrap();
    prints(&folder.path(""), &["run", "again.yaml", "--out", "again"]);
    assert_eq!(contents(&folder.path("again")), made);
    // In the folder where they were made they are as they should be.
    let (said, _) = prints(&folder.path(""), &["run", "again.yaml"]);
    assert_eq!(said.matches("unchanged").count(), 9, "{said}");
    assert_eq!(contents(&out), made);
}

#[test]
fn inputs_are_found_again_and_held_against_what_they_were() {
    let folder = Folder::new();
    let root = folder.path("");
    std::fs::create_dir_all(folder.path("lair/meshes")).unwrap();
    let nut = Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines/meshes/nut.vtu");
    std::fs::copy(nut, folder.path("lair/meshes/nut.vtu")).unwrap();
    let pipeline = "name: nut
stages:
  - scene:
      objects:
        - extrude: {mesh: meshes/nut.vtu, from: -12, to: 12}
          transform: [{translate: [-81.361, 81.907, 81.361, 0]}, {scale: 0.045}, {translate: [0, 0, 0, -1.2]}]
  - occlusion: {samples: 4}
  - render: {dimensions: [6, 6, 6]}
  - write: {vti: a.vti, vtu: a.vtu, png: a.png}
";
    std::fs::write(folder.path("lair/p.yaml"), pipeline).unwrap();
    prints(&root, &["run", "lair/p.yaml"]);
    let made = contents(&folder.path("out/nut"));
    let (text, told) = prints(&root, &["info", "--pipeline", "out/nut/a.vti"]);
    assert!(text.contains("{file: meshes/nut.vtu, sha256: ") && told.is_empty(), "{text}{told}");
    // Where the pipeline was is not in the files, and the text works from anywhere.
    let place = folder.path("lair").canonicalize().unwrap();
    assert!(text.contains(place.to_str().unwrap()));
    assert!(made.values().all(|bytes| !String::from_utf8_lossy(bytes).contains("lair")));
    std::fs::write(folder.path("again.yaml"), &text).unwrap();
    prints(&root, &["run", "again.yaml", "--out", "again"]);
    assert_eq!(contents(&folder.path("again")), made);
    let (again, _) = prints(&root, &["info", "--pipeline", "again/a.png"]);
    assert_eq!(again, text);

    // A file that was taken away from its folder doesn't know where the pipeline was.
    std::fs::copy(folder.path("again/a.vtu"), folder.path("moved.vtu")).unwrap();
    let (moved, told) = prints(&root, &["info", "--pipeline", "moved.vtu"]);
    assert!(told.contains("relative to the folder that the pipeline was in") && text.ends_with(&moved), "{told}");
    std::fs::write(folder.path("moved.yaml"), &moved).unwrap();
    refused(&root, &["run", "moved.yaml"], &["meshes/nut.vtu"]);
    prints(&root, &["run", "moved.yaml", "--set", "folder=lair", "--out", "set"]);
    assert_eq!(contents(&folder.path("set")), made);

    // A mesh that changed is told and refused.
    let mesh = folder.path("lair/meshes/nut.vtu");
    let changed = std::fs::read_to_string(&mesh).unwrap() + "\n";
    std::fs::write(&mesh, changed).unwrap();
    let (_, told) = prints(&root, &["info", "--pipeline", "out/nut/a.vti"]);
    assert!(told.contains("nut.vtu changed since"), "{told}");
    for verb in ["run", "check"] {
        refused(
            &root,
            &[verb, "again.yaml"],
            &["again.yaml:", "inputs[0].sha256", "nut.vtu changed since: its SHA-256 is"],
        );
    }
    prints(&root, &["run", "again.yaml", "--set", "inputs=[]", "--out", "other"]);
    assert!(same(&folder, "other/a.vti", "out/nut/a.vti"), "compare looks at values");
    let compare = ["compare", "other/a.vti", "out/nut/a.vti", "--array", "pipeline"];
    let output = ao4d(&root, &compare);
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.code() == Some(1) && said.contains("text array `pipeline`, from line"), "{said}");
    prints(&root, &["compare", "again/a.vtu", "out/nut/a.vtu", "--array", "pipeline", "--array", "normal"]);
}

#[test]
fn shipped_pipelines_are_made_again() {
    let folder = Folder::new();
    let root = folder.path("");
    let sets = ["--set", "render.dimensions=[5, 5, 5]", "--set", "occlusion.samples=2"];
    let flat = ["--set", "render.dimensions=[6, 5]", "--set", "occlusion.samples=2"];
    for (name, sets) in [("two_tetrahedra", sets), ("nut", sets), ("thesis/fig_5_5", flat)] {
        let pipeline = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("pipelines/{name}.yaml"));
        prints(&root, &[&["run", pipeline.to_str().unwrap(), "--out", "first"], &sets[..]].concat());
        let (text, _) = prints(&root, &["info", "--pipeline", "first/with-ao.vti"]);
        std::fs::write(folder.path("again.yaml"), text).unwrap();
        prints(&root, &["run", "again.yaml", "--out", "second"]);
        assert_eq!(contents(&folder.path("second")), contents(&folder.path("first")), "{name}");
        ["first", "second"].iter().for_each(|out| std::fs::remove_dir_all(folder.path(out)).unwrap());
    }
}

#[test]
fn a_change_elsewhere_is_told_without_making_a_picture_again() {
    let folder = Folder::new();
    folder.runs(&[]);
    let out = folder.path("out/small");
    let (made, cached, _) = folder.runs(&["--set", "paraview.cut=octant"]);
    assert_eq!((made.len(), cached.len()), (1, 6), "{made:?}");
    for name in ["image.vti", "scene.vtu", "slices.png", "ao.f32"] {
        let (text, _) = prints(&out, &["info", "--pipeline", name]);
        assert!(text.contains("cut: octant"), "{name}: {text}");
    }
    // And by that they count as what was written.
    assert_eq!(folder.runs(&["--set", "paraview.cut=octant"]).0.len(), 0);
}

#[test]
fn foreign_files_tell_of_none() {
    let folder = Folder::new();
    let root = folder.path("");
    let nut = Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines/meshes/nut.vtu");
    refused(
        &root,
        &["info", "--pipeline", nut.to_str().unwrap()],
        &["nut.vtu: tells of no pipeline: it was not made by"],
    );
    let mut png = Vec::new();
    let grid = ao4d::volume::Grid { dimensions: [2, 2, 2], origin: [0.0; 3], spacing: [1.0; 3] };
    ao4d::io::png::write(&mut png, &[&ao4d::io::png::Slices::new(&grid)]).unwrap();
    std::fs::write(folder.path("a.png"), &png).unwrap();
    refused(&root, &["info", "--pipeline", "a.png"], &["a.png: tells of no pipeline: it was not made by"]);
    std::fs::write(folder.path("b.png"), &png[..png.len() / 2]).unwrap();
    refused(&root, &["info", "--pipeline", "b.png"], &["b.png: tells of no pipeline: it is damaged"]);
    std::fs::write(folder.path("a.f32"), [0; 8]).unwrap();
    refused(&root, &["info", "--pipeline", "a.f32"], &["a.f32.yaml: cannot be read"]);
    refused(&root, &["info", "--pipeline", "p.yaml"], &["p.yaml: tells of no pipeline"]);
    refused(&root, &["info", "--pipeline", "missing.vti"], &["there is no such file"]);
    // A field of that name with something else in it.
    for (name, text) in
        [("name.vtu", "small"), ("wrong.vtu", "a: b\nstages:\n  - [\n"), ("keys.vtu", "a: b\nstages: []\n")]
    {
        let mut bytes = Vec::new();
        let cells = ao4d::io::vtu::Cells::Triangles(&[]);
        ao4d::io::vtu::write_told(&mut bytes, &[], cells, &[], &[], &[("pipeline", text)]).unwrap();
        std::fs::write(folder.path(name), bytes).unwrap();
        refused(&root, &["info", "--pipeline", name], &[&format!("{name}: tells of no pipeline: ")]);
    }
    assert_eq!(names(&root).iter().filter(|name| *name == "out").count(), 0);
}
