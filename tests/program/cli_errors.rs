//! What a user is told about a bad pipeline or command line: exit code 2, the place, the cause, the remedy; and that
//! nothing was written.

use std::path::Path;
use std::process::{Command, Output};

fn ao4d(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ao4d")).current_dir(folder).args(arguments).output().unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// A pipeline that is right; line numbers below refer to it.
const GOOD: &str = "name: p
seed: 1
stages:
  - scene:
      objects:
        - name: blue
          simplices:
            vertices: [[0, 0, 0, -1], [1, 0, 0, -1], [0, 1, 0, -1], [0, 0, 1, -1]]
            cells: [[0, 1, 2, 3]]
  - occlusion: {id: ao, samples: 16, file: ao.f32}
  - render:
      id: image
      dimensions: [4, 4, 4]
  - write: {id: files, vti: image.vti, raw: image.raw}
  - paraview: {state: figure.py, screenshot: figure.png}
";

/// `check` and `run` refuse this with exit code 2 and exactly this message, and write nothing.
fn refused(yaml: &[u8], sets: &[&str], message: &str) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("p.yaml"), yaml).unwrap();
    for verb in ["check", "run"] {
        let mut arguments = vec![verb, "p.yaml", "-q"];
        sets.iter().for_each(|set| arguments.extend(["--set", set]));
        let output = ao4d(folder.path(), &arguments);
        assert_eq!(stderr(&output), format!("error: {message}\n"), "{verb} {sets:?}");
        assert_eq!(output.status.code(), Some(2), "{verb}: {message}");
        assert!(output.stdout.is_empty(), "{verb}: {message}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "something was written: {message}");
}

/// The good pipeline with one text replaced. A `^` in the new text is taken out; it marks the place that the message
/// must name.
fn with(from: &str, to: &str, message: &str) {
    assert_eq!(GOOD.matches(from).count(), 1, "{from}");
    let marked = GOOD.replace(from, to);
    let message = match marked.split_once('^') {
        Some((before, _)) => {
            let column = before.split('\n').next_back().map_or(0, |line| line.chars().count()) + 1;
            format!("p.yaml:{}:{column}: {message}", before.split('\n').count())
        }
        None => message.to_owned(),
    };
    refused(marked.replace('^', "").as_bytes(), &[], &message);
}

#[test]
fn the_good_pipeline_is_good() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("p.yaml"), GOOD).unwrap();
    let output = ao4d(folder.path(), &["check", "p.yaml"]);
    assert_eq!((output.status.code(), stderr(&output).as_str()), (Some(0), ""));
    let plan = String::from_utf8(output.stdout).unwrap();
    assert!(plan.contains("64 voxels"), "{plan}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "check writes nothing");
}

#[test]
fn what_is_not_yaml() {
    let not_text = "p.yaml: is not a pipeline: byte 0 is not UTF-8 text (a binary file, or another encoding)";
    refused(b"", &[], "p.yaml:1:1: is empty; a pipeline is a mapping with `name` and `stages`");
    refused(b"\xff\xfe\x00n\x00a", &[], not_text);
    refused(b"\x7fELF\x02\x01\x00", &[], "p.yaml:1:1: the character U+007F can't stand in YAML; is this a text file?");
    refused(b"name: p\nname: q\n", &[], "p.yaml:2:1: the key `name` stands twice; it stands on line 1 already");
    refused(b"name: p\n---\nname: q\n", &[], "p.yaml:2:1: a second document begins here; a pipeline file holds one");
    refused(b"name: p\nstages:\n\t- x\n", &[], "p.yaml:3:1: is not YAML: a tab indents this line; YAML wants spaces");
    refused(
        b"just text\n",
        &[],
        "p.yaml:1:1: expected a mapping (of name, seed, stages, program, folder, variables, include, sweep, inputs), found the text \"just text\"",
    );
    with(
        "samples: 16,",
        "samples: 16, ^samples: 8,",
        "stages[1].occlusion: the key `samples` stands twice; it stands on line 10 already",
    );
}

#[test]
fn keys_and_types() {
    let occlusion_keys =
        "(known: id, input, method, samples, target_error, max_samples, max_cones, max_distance, file, load, seed)";
    for (from, to, message) in [
        ("samples:", "^sampels:", format!("stages[1].occlusion.sampels: unknown key, did you mean `samples`? {occlusion_keys}")),
        ("seed: 1", "^sed: 1", "sed: unknown key, did you mean `seed`? (known: name, seed, stages, program, folder, variables, include, sweep, inputs)".into()),
        ("- occlusion:", "- ^oclusion:", "stages[1].oclusion: unknown key, did you mean `occlusion`? (known: scene, occlusion, render, write, paraview, mesh, slice, wireframe, animate, shade, page)".into()),
        ("id: image", "shading: ^smoth", "stages[2].render.shading: unknown value `smoth`, did you mean `smooth`? (known: smooth, flat, voxel, auto)".into()),
        ("samples: 16", "samples: ^many", "stages[1].occlusion.samples: expected a whole number, 0 or above, found the text \"many\"".into()),
        ("samples: 16", "samples: ^-16", "stages[1].occlusion.samples: expected a whole number, 0 or above, found the number -16".into()),
        ("samples: 16", "samples: ^1.5", "stages[1].occlusion.samples: expected a whole number, 0 or above, found the number 1.5".into()),
        ("[4, 4, 4]", "", "p.yaml:13:17: stages[2].render.dimensions: expected a list, found nothing".into()),
        ("dimensions:", "camera:", "p.yaml:13:15: stages[2].render.camera: expected the word `fit`, or a mapping such as {eye: [0, 0, 0, 2]}, found a list".into()),
        ("      dimensions: [4, 4, 4]\n", "", "p.yaml:12:7: stages[2].render: the key `dimensions` is missing".into()),
        ("seed: 1", "seed: ^99999999999999999999", "seed: the number 1e20 is too large".into()),
        ("[[0, 0, 0, -1]", "[[^.nan, 0, 0, -1]", "stages[0].scene.objects[0].simplices.vertices[0][0]: expected a finite number, found an infinite one or not a number (NaN)".into()),
        ("[[0, 0, 0, -1]", "[[0, ^1e999, 0, -1]", "stages[0].scene.objects[0].simplices.vertices[0][1]: expected a finite number, found an infinite one or not a number (NaN)".into()),
        ("name: p", "name: ^2026", "name: expected text, found the number 2026; put it in quotes".into()),
        ("screenshot: figure.png", "cut: ^octan", "stages[4].paraview.cut: unknown value `octan`, did you mean `octant`? (known: none, octant)".into()),
        ("screenshot: figure.png", "cut: {plane: ^w}", "stages[4].paraview.cut.plane: unknown value `w` (known: x, y, z)".into()),
    ] {
        with(from, to, &message);
    }
}

#[test]
fn ranges() {
    for (from, to, message) in [
        ("[4, 4, 4]", "[^0, 50, 50]", "stages[2].render.dimensions[0]: expected 1 to 65535, found 0"),
        (
            "[4, 4, 4]",
            "^[4, 4]",
            "stages[2].render.dimensions: expected [WIDTH, HEIGHT, DEPTH] for a 4D scene, found [4, 4]",
        ),
        ("[4, 4, 4]", "[4, 4, ^65536]", "stages[2].render.dimensions[2]: expected 1 to 65535, found 65536"),
        ("samples: 16", "samples: ^0", "stages[1].occlusion.samples: expected 1 to 16777216 samples, found 0"),
        ("samples: 16", "max_distance: ^0", "stages[1].occlusion.max_distance: expected a number above 0, found 0"),
        (
            "samples: 16, file: ao.f32}\n  - render:\n      id: image",
            "method: as_published}\n  - render:\n      shading: ^voxel",
            "stages[2].render.shading: `as_published` has values at vertices only; take `flat`, as the thesis did",
        ),
        (
            "samples: 16",
            "target_error: ^0",
            "stages[1].occlusion.target_error: expected an error above 0 and below 1, found 0",
        ),
        (
            "samples: 16",
            "target_error: ^-0.01",
            "stages[1].occlusion.target_error: expected an error above 0 and below 1, found -0.01",
        ),
        (
            "samples: 16",
            "method: exact, max_distance: ^2",
            "stages[1].occlusion.max_distance: `exact` counts hits at all distances; leave this out, or use `method: sobol`",
        ),
        (
            "samples: 16",
            "method: as_published, target_error: ^0.1",
            "stages[1].occlusion.target_error: `as_published` aims at no error, which it doesn't know; give `samples`",
        ),
        (
            "samples: 16",
            "method: exact, max_cones: ^0",
            "stages[1].occlusion.max_cones: expected 1 to 1000000000 cones, found 0",
        ),
        (
            "samples: 16",
            "samples: 16, target_error: ^0.01",
            "stages[1].occlusion.target_error: stands beside `samples`; give one of the two",
        ),
        (
            "id: image",
            "camera: {field_of_view: ^180}",
            "stages[2].render.camera.field_of_view: expected 0.001 to 179.999 degrees, found 180",
        ),
        (
            "id: image",
            "camera: {eye: ^[0, 0, 1]}",
            "stages[2].render.camera.eye: expected 4 numbers (the scene is 4D), found 3",
        ),
        ("  - scene:", "  - scene:\n      dimension: ^5", "stages[0].scene.dimension: expected 3 or 4, found 5"),
        (
            "  - scene:",
            "  - scene:\n      dimension: 3",
            "p.yaml:14:19: stages[2].render.dimensions: expected [WIDTH, HEIGHT] for a 3D scene, found [4, 4, 4]",
        ),
        ("screenshot: figure.png", "size: [^0, 5]", "stages[4].paraview.size[0]: expected 16 to 16384 pixels, found 0"),
        ("raw: image.raw", "arrays: ^[]", "stages[3].write.arrays: the list is empty; name at least one array"),
        ("raw: image.raw", "arrays: [rgb, ^rgb]", "stages[3].write.arrays[1]: `rgb` stands twice"),
        (
            "raw: image.raw",
            "arrays: [rgb]",
            "p.yaml:15:15: stages[4].paraview: shows `files`, whose arrays lack rgba or opacity; add them to its `arrays`",
        ),
    ] {
        with(from, to, message);
    }
}

#[test]
fn references_between_stages() {
    for (from, to, message) in [
        (
            "id: files,",
            "id: files, input: ^imag,",
            "stages[3].write.input: no earlier render is called `imag`, did you mean `image`? (known: image)",
        ),
        (
            "id: files,",
            "id: files, input: ^ao,",
            "stages[3].write.input: `ao` is a stage of kind occlusion; expected render",
        ),
        (
            "id: ao,",
            "id: ao, input: ^image,",
            "stages[1].occlusion.input: `image` doesn't come before this stage; move it up",
        ),
        ("id: image", "id: ^ao", "stages[2].render.id: stages[1] is called `ao` already"),
        ("id: image", "id: ^none", "stages[2].render.id: `none` has a meaning of its own; choose another id"),
        (
            "id: image",
            "id: ^a.b",
            "stages[2].render.id: an id is made of letters, digits, `-` and `_`, so that `--set` can name it",
        ),
        (
            "id: image",
            "occlusion: ^a0",
            "stages[2].render.occlusion: no earlier occlusion is called `a0`, did you mean `ao`? (known: ao)",
        ),
        (
            "screenshot: figure.png",
            "input: [image, ^imge]",
            "stages[4].paraview.input[1]: no earlier render or write or animate or wireframe or slice is called `imge`, did you mean `image`? (known: files, image)",
        ),
        ("file: ao.f32", "load: ^missing.f32", "stages[1].occlusion.load: there is no file missing.f32"),
    ] {
        with(from, to, message);
    }
    refused(
        b"name: p\nstages:\n  - render: {dimensions: [1, 1, 1]}\n",
        &[],
        "p.yaml:3:13: stages[0].render: there is no earlier `scene` to work on; put one first",
    );
    refused(b"name: p\nstages: []\n", &[], "p.yaml:2:9: stages: there are no stages; begin with a `scene`");
}

#[test]
fn output_files() {
    for (from, to, message) in [
        (
            "vti: image.vti",
            "vti: ^../image.vti",
            "stages[3].write.vti: \"../image.vti\" has `.` or `..` in it; expected a file's name below the output folder",
        ),
        (
            "vti: image.vti",
            "vti: ^/tmp/image.vti",
            "stages[3].write.vti: \"/tmp/image.vti\" is an absolute path; expected a file's name below the output folder",
        ),
        (
            "vti: image.vti",
            "vti: ^image.vtk",
            "stages[3].write.vti: expected a name that ends in .vti, found \"image.vtk\"",
        ),
        (
            "screenshot: figure.png",
            "screenshot: ^FIGURE.py",
            "stages[4].paraview.screenshot: expected a name that ends in .png, found \"FIGURE.py\"",
        ),
        ("name: p\n", "name: ^a/b\n", "name: the name has a slash; the pipeline's name names its output folder"),
        ("name: p\n", "name: ^..\n", "name: \"..\" has `.` or `..` in it; the pipeline's name names its output folder"),
        (
            "vti: image.vti, raw: image.raw",
            "arrays: [rgba]",
            "p.yaml:14:12: stages[3].write: names no file; give at least one of vti, raw, vtu, png",
        ),
    ] {
        with(from, to, message);
    }
    let twice = GOOD.to_owned() + "  - write: {input: image, raw: Image.RAW}\n";
    let message = "p.yaml:16:32: stages[5].write.raw: the file \"Image.RAW\" is written by stages[3].write.raw already; give it another name";
    refused(twice.as_bytes(), &[], message);
}

#[test]
fn overrides_are_checked_as_strictly() {
    for (set, message) in [
        (
            "occlusion.sampels=64",
            "--set occlusion.sampels=64: stages[1].occlusion.sampels: unknown key, did you mean `samples`? (known: id, input, method, samples, target_error, max_samples, max_cones, max_distance, file, load, seed)",
        ),
        ("ao.samples=0", "--set ao.samples=0: stages[1].occlusion.samples: expected 1 to 16777216 samples, found 0"),
        (
            "imag.shading=flat",
            "--set imag.shading=flat: no stage and no key is called `imag`, did you mean `image`? (known: ao, image, files, scene, occlusion, render, write, paraview, name, seed, stages)",
        ),
        ("image.dimensions=[4, 4", "--set image.dimensions=[4, 4: the value is not YAML: unclosed bracket '['"),
        ("image.dimensions=", "p.yaml:12:7: stages[2].render: the key `dimensions` is missing"),
        ("seed", "--set seed: write KEY=VALUE, for instance occlusion.samples=64"),
        ("name=../x", "--set name=../x: name: the name has a slash; the pipeline's name names its output folder"),
    ] {
        refused(GOOD.as_bytes(), &[set], message);
    }
}

#[test]
fn overrides_take_effect() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("p.yaml"), GOOD).unwrap();
    let sets = ["seed=3", "ao.samples=64", "render.dimensions=[20, 20, 20]", "image.camera.field_of_view=60", "name=q"];
    let mut arguments = vec!["check", "p.yaml", "--json"];
    sets.iter().for_each(|set| arguments.extend(["--set", set]));
    let output = ao4d(folder.path(), &arguments);
    assert_eq!((output.status.code(), stderr(&output).as_str()), (Some(0), ""));
    let plan: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(plan["name"], "q");
    assert_eq!(plan["out"], "out/q");
    assert_eq!(plan["occlusions"][0]["source"]["compute"]["seed"], 3);
    assert_eq!(plan["occlusions"][0]["source"]["compute"]["samples"]["fixed"], 64);
    assert_eq!(plan["renders"][0]["dimensions"], serde_json::json!([20, 20, 20]));
    assert_eq!(plan["renders"][0]["camera"]["projection"]["perspective"]["field_of_view"], 60.0);
    assert_eq!(plan["totals"]["voxels"], 8000);
}

#[test]
fn warnings_go_to_stderr_and_quiet_silences_them() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("p.yaml"), GOOD).unwrap();
    let arguments = ["check", "p.yaml", "--set", "image.camera.height=3", "--set", "scene.objects=[]"];
    let output = ao4d(folder.path(), &arguments);
    assert_eq!(output.status.code(), Some(0));
    let expected =
        "warning: --set scene.objects=[]: stages[0].scene.objects: the scene is empty; its images show background only
warning: --set image.camera.height=3: stages[2].render.camera.height: has no use in a perspective projection
";
    assert_eq!(stderr(&output), expected);
    let quiet = ao4d(folder.path(), &[&arguments[..], &["-q"]].concat());
    assert_eq!((quiet.status.code(), stderr(&quiet).as_str()), (Some(0), ""));
    assert_eq!(quiet.stdout, output.stdout);
}

#[test]
fn bad_command_lines() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("p.yaml"), GOOD).unwrap();
    for (arguments, part) in [
        (&[][..], "Usage: ao4d"),
        (&["rum", "p.yaml"], "a similar subcommand exists: 'run'"),
        (&["run"], "PIPELINE.yaml"),
        (&["run", "p.yaml", "--treads", "2"], "--threads"),
        (&["run", "p.yaml", "--threads", "0"], "expected a whole number from 1 to 1024"),
        (&["run", "p.yaml", "--backend", "cuda"], "expected cpu, opencl or opencl:PLATFORM.DEVICE"),
        (&["check", "p.yaml", "-q", "-v"], "cannot be used with"),
        (&["compare", "a.vti"], "<B>"),
        (&["compare", "a.vti", "b.vti"], "a.vti: there is no such file"),
        (&["compare", "a.vti", "b.vti", "--atol=-1"], "expected a number, 0 or above"),
        (&["compare", "a.vti", "b.vti", "--rtol", "nan"], "expected a number, 0 or above"),
        (&["info", "."], ".: there is no such file"),
        (&["check", "missing.yaml"], "missing.yaml: cannot read the pipeline: "),
        (&["check", "."], ".: cannot read the pipeline: "),
        (&["study", "p.yaml", "p.yaml"], "expected one pipeline"),
    ] {
        let output = ao4d(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(stderr(&output).contains(part), "{arguments:?}: {}", stderr(&output));
        assert!(output.stdout.is_empty(), "{arguments:?}");
    }
}

#[test]
fn results_survive_a_closed_pipe() {
    use std::process::Stdio;
    let mut child = Command::new(env!("CARGO_BIN_EXE_ao4d"))
        .arg("schema")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), stderr(&output).as_str()), (Some(0), ""));
}
