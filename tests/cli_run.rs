//! `ao4d run` as its users see it: which files appear, what a second run does, what goes wrong and how that is told.
//! The same pipeline gives the same bytes, whatever the number of threads.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant, SystemTime};

use serde_json::Value;

/// A tetrahedron that reaches beyond the picture, and a closed body before it.
const PIPELINE: &str = "name: small
seed: 1
stages:
  - scene:
      objects:
        - name: wall
          simplices:
            vertices: [[-2, -2, -1, -1.3], [2, -2, -1, -1.4], [0, 3, -1, -1.5], [0, 0, 3, -1.3]]
            cells: [[0, 1, 2, 3]]
        - name: body
          tesseract: {size: 0.5}
          transform: [{rotate: {plane: xw, degrees: 20}}, {translate: [0.2, 0.1, 0.1, -0.9]}]
  - occlusion: {id: ao, samples: 8, file: ao.f32}
  - render: {id: plain, occlusion: none, dimensions: [7, 6, 5]}
  - write: {vti: plain.vti}
  - render: {id: image, dimensions: [7, 6, 5]}
  - write: {id: files, vti: image.vti, raw: image.raw, vtu: scene.vtu, png: slices.png}
  - paraview: {state: figure.py, screenshot: figure.png}
";

/// What the pipeline leaves, but for the cache's own file.
const FILES: [&str; 8] =
    ["ao.f32", "ao.f32.yaml", "figure.py", "image.raw", "image.vti", "plain.vti", "scene.vtu", "slices.png"];

/// A folder with the pipeline in it, gone after the test.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self::with(PIPELINE)
    }

    fn with(pipeline: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("p.yaml"), pipeline).unwrap();
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_ao4d"));
        command.current_dir(self.0.path()).args(["run", "p.yaml"]).args(arguments);
        command
    }

    fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    /// Runs, and returns the files that were made anew and those that were left alone, and what was said besides.
    fn runs(&self, arguments: &[&str]) -> (Vec<String>, Vec<String>, String) {
        let output = self.run(&[&["--json"], arguments].concat());
        let told = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {told}");
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        let files = report["files"].as_array().unwrap();
        let of = |cached: bool| -> Vec<String> {
            let mut names: Vec<String> = (files.iter().filter(|f| f["cached"] == Value::Bool(cached)))
                .map(|f| f["path"].as_str().unwrap().to_owned())
                .collect();
            names.sort();
            names
        };
        (of(false), of(true), told)
    }

    /// The run ends with this code and a message that contains these words; there is no output folder then.
    fn fails(&self, arguments: &[&str], code: i32, words: &[&str]) {
        let output = self.run(arguments);
        let told = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {told}");
        assert!(output.stdout.is_empty());
        let errors: Vec<&str> = told.lines().filter(|line| line.starts_with("error: ")).collect();
        assert_eq!(errors.len(), 1, "{told}");
        words.iter().for_each(|word| assert!(errors[0].contains(word), "{word}: {told}"));
        assert!(!self.path("out").exists(), "{arguments:?}: something was written");
    }
}

/// The names of all files in a folder, but for the cache.
fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = entries.filter(|name| name != ".ao4d-cache.json").collect();
    names.sort();
    names
}

/// The content of all files in a folder, but for the cache.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    names(folder).into_iter().map(|name| (name.clone(), std::fs::read(folder.join(name)).unwrap())).collect()
}

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
    for name in FILES.iter().filter(|name| !name.ends_with(".yaml")) {
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
        std::fs::remove_file(out.join(name)).unwrap();
        let (made, _, _) = folder.runs(&[]);
        assert_eq!(made, [*name]);
        std::fs::write(out.join(name), "edited").unwrap();
        let (made, _, _) = folder.runs(&[]);
        assert_eq!(made, [*name]);
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

/// Every kind of file, and everything that could make an order of work show.
#[test]
fn the_number_of_threads_changes_no_byte() {
    let pipeline = PIPELINE.to_owned()
        + "  - occlusion: {id: noise, method: random, samples: 7, max_distance: 0.7, file: noise.f32}
  - render: {id: voxel, dimensions: [10, 8, 6], shading: voxel}
  - write: {vti: voxel.vti, arrays: [rgba, ambient_occlusion, opacity, rgb, depth, object, normal]}
  - render: {id: flat, dimensions: [9, 8, 7], shading: flat, camera: {projection: parallel, height: 2}}
  - write: {vti: zlib.vti, compression: zlib}
  - write: {vti: lz4.vti, compression: lz4}
  - write: {vti: inline.vti, encoding: inline}
  - write: {vti: inline-zlib.vti, encoding: inline, compression: zlib, raw: flat.raw, png: flat.png, vtu: flat.vtu}
";
    let folder = Folder::with(&pipeline);
    for threads in ["1", "2", "5"] {
        folder.runs(&["--threads", threads, "--out", threads]);
    }
    folder.runs(&["--out", "all"]);
    let one = contents(&folder.path("1"));
    assert_eq!(one.len(), FILES.len() + 10);
    for other in ["2", "5", "all"] {
        let other = contents(&folder.path(other));
        assert!(one.keys().eq(other.keys()));
        one.iter().for_each(|(name, bytes)| assert!(*bytes == other[name], "{name} differs"));
    }
    // The voxel picture has what it was asked for, and something to see.
    let text = info(&folder, "1/voxel.vti");
    for array in ["rgb, 3 x Float32", "depth, 1 x Float32", "object, 1 x UInt16: 0 to 2", "normal, 4 x Float32"] {
        assert!(text.contains(array), "{array}: {text}");
    }
    for name in ["zlib", "lz4", "inline", "inline-zlib"] {
        assert!(same(&folder, "1/zlib.vti", &format!("1/{name}.vti")), "{name}");
    }
}

/// Whether `ao4d compare` finds no difference.
fn same(folder: &Folder, a: &str, b: &str) -> bool {
    let mut compare = Command::new(env!("CARGO_BIN_EXE_ao4d"));
    let output = compare.arg("compare").args([folder.path(a), folder.path(b)]).output().unwrap();
    assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    output.status.success()
}

fn info(folder: &Folder, file: &str) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_ao4d")).arg("info").arg(folder.path(file)).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{file}");
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn a_3d_scene_gives_one_layer() {
    let folder = Folder::with(
        "name: flat
stages:
  - scene:
      dimension: 3
      objects:
        - box: {min: [-1, -0.5, -2], max: [1, 0.5, -1]}
        - {name: lid, box: {min: [-2, 0.6, -3], max: [2, 0.7, 0]}}
  - occlusion: {samples: 16}
  - render: {dimensions: [12, 9]}
  - write: {vti: image.vti, raw: image.raw, png: image.png, vtu: scene.vtu, arrays: [rgba, opacity, normal]}
",
    );
    folder.runs(&[]);
    assert_eq!(names(&folder.path("out/flat")), ["image.png", "image.raw", "image.vti", "scene.vtu"]);
    let text = info(&folder, "out/flat/image.vti");
    assert!(text.contains("an image of 12 x 9 x 1 points") && text.contains("normal, 3 x Float32"), "{text}");
    let text = info(&folder, "out/flat/scene.vtu");
    assert!(text.contains("a surface in 3D: closed, 2 pieces") && text.contains("ambient_occlusion"), "{text}");
    let png = std::fs::read(folder.path("out/flat/image.png")).unwrap();
    assert!(png.starts_with(b"\x89PNG"));
}

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
    let load = |name: &str| [format!("ao.load={name}"), "ao.samples=".to_owned()];
    let sets = load("kept.f32");
    let load_kept = ["--set", &sets[0], "--set", &sets[1], "--out", "second"];
    folder.runs(&load_kept);
    let (first, second) = (contents(&first), contents(&folder.path("second")));
    for (name, bytes) in &first {
        // An image tells where its occlusion came from, so its head differs.
        assert!(name == "image.vti" || *bytes == second[name], "{name}");
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
    // A file that was good when it was loaded, and is another mesh's now, isn't taken from the cache.
    keep("kept.f32.yaml", other_mesh.as_bytes());
    let output = folder.run(&load_kept);
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn scenes_that_show_nothing() {
    let folder = Folder::new();
    let (made, _, told) = folder.runs(&["--set", "scene.objects=[]", "--out", "empty"]);
    assert_eq!((made.len(), told.matches("warning: ").count()), (7, 1));
    assert!(told.contains("the scene is empty; its images show background only"), "{told}");
    let text = info(&folder, "empty/image.vti");
    assert!(text.contains("opacity, 1 x Float32: 0 to 0") && text.contains("rgba, 4 x UInt8: 255 to 255"), "{text}");
    assert!(info(&folder, "empty/scene.vtu").contains("a mesh of 0 points; cells: none"));

    let camera = "image.camera={eye: [0, 0, 0, -9], target: [0, 0, 0, -10]}";
    let (made, _, told) = folder.runs(&["--set", camera, "--out", "behind"]);
    assert_eq!((made.len(), told.matches("note: ").count()), (7, 2));
    assert!(told.contains("image shows background only: the scene lies wholly behind the camera"), "{told}");
    assert!(told.contains("scene.vtu: 49 of 49 simplices are not wholly before the eye"), "{told}");
    let aside = "image.camera={eye: [50, 0, 0, 1], target: [50, 0, 0, 0]}";
    let (_, _, told) = folder.runs(&["--set", aside, "--out", "aside"]);
    assert!(told.contains("no voxel's centre sees any of the scene"), "{told}");
}

#[test]
fn simplices_of_measure_zero_are_told() {
    // The fifth point lies where the third does.
    let vertices = "[0, 0, 3, -1.3], [0, 3, -1, -1.5]]\n            cells: [[0, 1, 2, 3], [0, 1, 2, 4], [2, 4, 3, 1]]";
    let from = "[0, 0, 3, -1.3]]\n            cells: [[0, 1, 2, 3]]";
    assert_eq!(PIPELINE.matches(from).count(), 1);
    let folder = Folder::with(&PIPELINE.replace(from, vertices));
    let (_, _, told) = folder.runs(&[]);
    assert_eq!(
        told,
        "note: scene scene: 2 of 51 simplices have measure zero and are left out (the first is number 1, of wall)\n"
    );
    // They change no picture.
    std::fs::write(folder.path("p.yaml"), PIPELINE).unwrap();
    folder.runs(&["--out", "without"]);
    assert!(same(&folder, "out/small/plain.vti", "without/plain.vti"));
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

#[test]
fn what_cannot_fit_is_told_before_anything_is_computed() {
    let folder = Folder::new();
    let began = Instant::now();
    // 64,000,000,000 voxels of 12 bytes in two arrays files, and of 12 bytes raw.
    let large = ["--set", "image.dimensions=[4000, 4000, 4000]", "--set", "ao.samples=16777216"];
    folder.fails(&large, 3, &["out/small: 1536000002520 bytes are to be written, and the disk has ", "elsewhere"]);
    // One layer: a simplex's number, its shade, rgba, opacity, ambient occlusion and rgb for each voxel.
    let deep = ["--set", "image.dimensions=[65535, 65535, 1]", "--set", "ao.samples=16777216"];
    let bytes = 65_535u64 * 65_535 * (4 + 12 + 4 + 4 + 4 + 12);
    let told = format!("render image: one layer of its picture takes {bytes} bytes of memory, and ");
    folder.fails(&deep, 3, &[&told]);
    assert!(began.elapsed() < Duration::from_secs(10), "{:?}", began.elapsed());
}

#[cfg(unix)]
#[test]
fn folders_that_cannot_be_written_to() {
    let folder = Folder::new();
    std::fs::write(folder.path("file"), "").unwrap();
    // Told before 16 million rays a vertex are traced.
    for (out, place) in [("file", "file"), ("file/inside", "file/inside")] {
        folder.fails(&["--out", out, "--set", "ao.samples=16777216"], 3, &[place, "cannot make the folder"]);
    }
    assert_eq!(names(folder.0.path()), ["file", "p.yaml"]);
    // A folder where a file should be.
    std::fs::create_dir_all(folder.path("taken/image.vti")).unwrap();
    folder.fails(&["--out", "taken"], 3, &["taken/image.vti", "cannot be written"]);
    assert!(!names(&folder.path("taken")).iter().any(|name| name.ends_with(".partial")));
}

/// A disk of a few kilobytes, where one can be had.
#[cfg(target_os = "linux")]
struct TinyDisk(PathBuf);

#[cfg(target_os = "linux")]
impl TinyDisk {
    fn mount(at: PathBuf, kilobytes: u32) -> Option<Self> {
        std::fs::create_dir(&at).unwrap();
        let size = format!("size={kilobytes}k");
        let mut mount = Command::new("mount");
        let mounted = mount.args(["-t", "tmpfs", "-o", &size, "tmpfs"]).arg(&at).stderr(Stdio::null()).status();
        mounted.is_ok_and(|status| status.success()).then_some(Self(at))
    }
}

#[cfg(target_os = "linux")]
impl Drop for TinyDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(&self.0).status();
    }
}

/// Needs the right to mount; without it, `/dev/full` tells the same story of the files' writer in its own tests.
#[cfg(target_os = "linux")]
#[test]
fn a_disk_that_fills_up() {
    let folder = Folder::new();
    let mut whole = Vec::new();
    folder.runs(&["--out", "reference"]);
    let reference = contents(&folder.path("reference"));
    // The compressed file is not counted beforehand, so the disk itself has to refuse, at one place or another.
    for kilobytes in (4..72).step_by(8) {
        let Some(disk) = TinyDisk::mount(folder.path(&format!("disk{kilobytes}")), kilobytes) else {
            eprintln!("this user can't mount; nothing tested");
            return;
        };
        let out = disk.0.join("out");
        let output = folder.run(&["--out", out.to_str().unwrap()]);
        let told = String::from_utf8(output.stderr).unwrap();
        let found = if out.exists() { contents(&out) } else { BTreeMap::new() };
        whole.push(found.len());
        for (name, bytes) in &found {
            assert!(!name.ends_with(".partial"), "{kilobytes} kB: {name} is left");
            assert!(*bytes == reference[name], "{kilobytes} kB: {name} is not whole");
        }
        if found.len() < FILES.len() {
            assert_eq!(output.status.code(), Some(3), "{kilobytes} kB: {told}");
            assert_eq!(told.matches("error: ").count(), 1, "{told}");
            assert!(told.contains("free some") && told.contains(&*out.to_string_lossy()), "{told}");
        }
    }
    assert!(whole[0] < FILES.len() && whole.last() == Some(&FILES.len()), "{whole:?}");
    assert!(whole.windows(2).all(|pair| pair[0] <= pair[1]), "{whole:?}");
}

/// Waits until a run has ended; it is stopped after a while, so that no test waits for ever.
#[cfg(unix)]
fn wait(child: &mut Child, limit: Duration) -> Option<i32> {
    let began = Instant::now();
    while began.elapsed() < limit {
        if let Some(status) = child.try_wait().unwrap() {
            return status.code();
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    None
}

/// Ctrl-C in the middle of each kind of work. A debug build looks for it as often, but works slowly in between.
#[cfg(unix)]
#[test]
fn interrupted_runs_leave_nothing_behind() {
    let limit = Duration::from_secs(if cfg!(debug_assertions) { 60 } else { 2 });
    let sphere = "hypersphere: {radius: 0.5, subdivisions: 12}";
    let body = "tesseract: {size: 0.5}";
    for (what, shape, sets) in [
        ("occlusion", sphere, &["ao.samples=16384"][..]),
        ("picture", body, &["image.dimensions=[400, 400, 400]", "plain.dimensions=[400, 400, 400]", "ao.samples=1"]),
        ("voxel", body, &["image.shading=voxel", "image.dimensions=[400, 8, 8]", "ao.samples=10000"]),
    ] {
        let folder = Folder::with(&PIPELINE.replace(body, shape));
        let arguments: Vec<&str> = sets.iter().flat_map(|set| ["--set", set]).collect();
        let mut child = folder.command(&arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        std::thread::sleep(Duration::from_secs(1));
        assert!(child.try_wait().unwrap().is_none(), "{what}: ended too early to be interrupted");
        let signal = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        assert!(signal.success());
        let sent = Instant::now();
        assert_eq!(wait(&mut child, Duration::from_secs(120)), Some(130), "{what}");
        assert!(sent.elapsed() < limit, "{what}: {:?}", sent.elapsed());
        let output = child.wait_with_output().unwrap();
        let told = String::from_utf8(output.stderr).unwrap();
        assert_eq!((told.as_str(), output.stdout.len()), ("interrupted\n", 0), "{what}");
        let out = folder.path("out/small");
        let left = if out.exists() { names(&out) } else { Vec::new() };
        assert!(left.iter().all(|name| FILES.contains(&name.as_str())), "{what}: {left:?}");
        assert!(!left.contains(&"image.vti".to_owned()), "{what}: {left:?}");
        assert_eq!(left.contains(&"ao.f32".to_owned()), left.contains(&"ao.f32.yaml".to_owned()), "{what}: {left:?}");
    }
}
