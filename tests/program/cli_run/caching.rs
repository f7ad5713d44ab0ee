//! A second run makes again what depends on a change, and nothing else.

use std::path::Path;
use std::time::SystemTime;

use super::{FILES, Folder, PIPELINE, contents, names};

fn times(folder: &Path) -> Vec<SystemTime> {
    names(folder).iter().map(|name| std::fs::metadata(folder.join(name)).unwrap().modified().unwrap()).collect()
}

#[test]
fn a_run_leaves_what_it_promises_and_the_next_one_nothing_new() {
    let folder = Folder::new();
    let output = folder.run(&[]);
    assert_eq!((output.status.code(), output.stderr.len()), (Some(0), 0));
    let said = String::from_utf8(output.stdout).unwrap();
    let out = folder.path("out/small");
    assert_eq!(names(&out), FILES);
    assert_eq!(names(&folder.path("out")), ["small"]);
    for name in FILES.iter().filter(|name| !name.ends_with(".yaml") && !name.contains(".error.")) {
        assert!(said.contains(&format!("\n  {name}")), "{said}");
    }
    assert!(!said.contains("unchanged"));
    assert_eq!(std::fs::metadata(out.join("image.raw")).unwrap().len(), 7 * 6 * 5 * 12);

    let (before, written) = (contents(&out), times(&out));
    let said = String::from_utf8(folder.run(&[]).stdout).unwrap();
    assert_eq!(said.matches("unchanged").count(), 7, "{said}");
    assert_eq!(times(&out), written);
    // All anew, and to the same bytes.
    let (made, cached, _) = folder.runs(&["--force"]);
    assert_eq!((made.len(), cached.len()), (7, 0));
    assert!(times(&out).iter().zip(&written).all(|(now, then)| now > then));
    assert_eq!(contents(&out), before);
}

#[test]
fn only_what_depends_on_a_change_is_made_again() {
    let folder = Folder::new();
    folder.run(&[]);
    let out = folder.path("out/small");
    let mut sets: Vec<String> = Vec::new();
    let mut change = |set: &str, expected: &[&str]| {
        sets.push(set.to_owned());
        let arguments: Vec<&str> = sets.iter().flat_map(|set| ["--set", set]).collect();
        let (made, cached, _) = folder.runs(&arguments);
        assert_eq!(made, expected, "{set}");
        assert_eq!(made.len() + cached.len(), 7, "{set}");
        // As a run from nothing would have it.
        let fresh = folder.path("fresh");
        folder.runs(&[&arguments[..], &["--out", "fresh"]].concat());
        assert!(contents(&fresh) == contents(&out), "{set}: not what a fresh run makes");
        std::fs::remove_dir_all(fresh).unwrap();
    };
    change("image.shading=flat", &["image.raw", "image.vti", "slices.png"]);
    change("files.arrays=[rgba, opacity]", &["image.vti"]);
    change("files.compression=zlib", &["image.vti"]);
    change("paraview.cut=octant", &["figure.py"]);
    change("plain.dimensions=[4, 4, 4]", &["plain.vti"]);
    change("image.dimensions=[4, 4, 4]", &["figure.py", "image.raw", "image.vti", "slices.png"]);
    // The mesh in scene.vtu is as its camera sees it.
    change("image.camera={field_of_view: 80}", &["figure.py", "image.raw", "image.vti", "scene.vtu", "slices.png"]);
    change("ao.samples=4", &["ao.f32", "image.raw", "image.vti", "scene.vtu", "slices.png"]);
    // Images without occlusion tell of the seed all the same.
    let all_but_the_figure = ["ao.f32", "image.raw", "image.vti", "plain.vti", "scene.vtu", "slices.png"];
    change("seed=2", &all_but_the_figure);
    std::fs::write(folder.path("p.yaml"), PIPELINE.replace("size: 0.5", "size: 0.6")).unwrap();
    change("plain.shading=smooth", &all_but_the_figure);
}

#[test]
fn outputs_that_were_touched_are_made_again() {
    let folder = Folder::new();
    folder.run(&[]);
    let out = folder.path("out/small");
    let before = contents(&out);
    for name in FILES.iter().filter(|name| **name != "ao.f32.yaml") {
        // Values and their errors are made together, and told as one.
        let told = if name.starts_with("ao.") { "ao.f32" } else { name };
        std::fs::remove_file(out.join(name)).unwrap();
        let (made, _, _) = folder.runs(&[]);
        assert_eq!(made, [told]);
        std::fs::write(out.join(name), "edited").unwrap();
        let (made, _, _) = folder.runs(&[]);
        assert_eq!(made, [told]);
        assert_eq!(contents(&out), before, "{name}");
    }
    // The values are of no use without what stands beside them.
    std::fs::remove_file(out.join("ao.f32.yaml")).unwrap();
    assert_eq!(folder.runs(&[]).0, ["ao.f32"]);
    assert_eq!(contents(&out), before);
    std::fs::write(out.join(".ao4d-cache.json"), "{").unwrap();
    assert_eq!(folder.runs(&[]).0.len(), 6, "all but the figure, which is compared");
    assert_eq!(contents(&out), before);
}
