//! What must never happen: a wrong file called unchanged, an input lost, two runs in one folder.

use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

use super::{Folder, contents, names};

const BOXES: &str = "name: e
stages:
  - scene: {dimension: 3, objects: [{box: {min: [-1,-1,-1], max: [1,1,1], subdivisions: 3}}, {box: {min: [1.2,-1,-1], max: [1.5,1,1], subdivisions: 3}}]}
  - occlusion: {id: ao, method: sobol, samples: 8, file: ao.f32}
  - render: {dimensions: [8, 8]}
  - write: {vtu: m.vtu}
";

fn ao4d(folder: &Folder, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ao4d")).current_dir(folder.0.path()).args(arguments).output().unwrap()
}

fn told(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn errors_of_another_method_are_not_those_of_exact_values() {
    let folder = Folder::with(BOXES);
    folder.runs(&[]);
    let out = folder.path("out/e");
    assert!(out.join("ao.error.f32").is_file());
    let exact = ["--set", "ao.method=exact", "--set", "ao.samples="];
    folder.runs(&exact);
    assert!(!out.join("ao.error.f32").exists());
    let whole = contents(&out);
    // Also where they come back by themselves, they are not believed.
    std::fs::write(out.join("ao.error.f32"), std::fs::read(out.join("ao.f32")).unwrap()).unwrap();
    std::fs::remove_file(out.join("m.vtu")).unwrap();
    assert_eq!(folder.runs(&exact).0, ["m.vtu"]);
    assert!(std::fs::read(out.join("m.vtu")).unwrap() == whole["m.vtu"]);
}

#[test]
fn errors_that_belong_to_other_values_are_refused() {
    let folder = Folder::with(BOXES);
    folder.runs(&["--out", "other"]);
    let length = std::fs::metadata(folder.path("other/ao.f32")).unwrap().len() as usize;
    std::fs::write(folder.path("other/ao.error.f32"), vec![0; length]).unwrap();
    folder.fails(
        &["--set", "ao.load=other/ao.f32", "--set", "ao.method=", "--set", "ao.samples="],
        2,
        &["other/ao.error.f32", "the errors of other values", "delete it"],
    );
}

#[test]
fn the_file_that_a_header_names_is_an_input() {
    let folder = Folder::with(
        "name: f
stages:
  - scene: {dimension: 3, objects: [{isosurface: {field: {image: {file: d.nhdr}}, isovalue: 100}}]}
  - render: {occlusion: none, dimensions: [4, 4]}
  - write: {vti: a.vti}
",
    );
    std::fs::write(
        folder.path("d.nhdr"),
        "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 8 8 9\nencoding: raw\ndata file: d.raw\n\n",
    )
    .unwrap();
    let layer = |at: usize| -> Vec<u8> { (0..9 * 64).map(|i| if i / 64 == at { 200 } else { 0 }).collect() };
    std::fs::write(folder.path("d.raw"), layer(4)).unwrap();
    folder.runs(&[]);
    std::fs::write(folder.path("d.raw"), layer(1)).unwrap();
    assert_eq!(folder.runs(&[]).0, ["a.vti"]);
    assert!(folder.runs(&[]).0.is_empty());
}

#[test]
fn notes_are_told_again_with_what_is_unchanged() {
    // A mesh partly behind the eye, a simplex of measure zero, and a picture that shows nothing.
    let folder = Folder::with(
        "name: n
stages:
  - scene:
      objects:
        - simplices:
            vertices: [[0, 0, 0, -1], [1, 0, 0, -1], [0, 1, 0, -1], [0, 0, 1, 3], [2, 0, 0, -1]]
            cells: [[0, 1, 2, 3], [0, 1, 4, 2]]
  - render: {occlusion: none, dimensions: [4, 4, 4], camera: {eye: [0, 0, 0, 1], target: [0, 0, 0, 2]}}
  - write: {raw: a.raw, vtu: m.vtu}
",
    );
    let notes = |output: Output| -> Vec<String> {
        assert_eq!(output.status.code(), Some(0), "{}", told(&output));
        let mut lines: Vec<String> = told(&output).lines().map(str::to_owned).collect();
        lines.sort();
        lines
    };
    let first = notes(folder.run(&[]));
    assert!(first.len() >= 2, "{first:?}");
    assert_eq!(notes(folder.run(&[])), first, "all is unchanged");
    std::fs::remove_file(folder.path("out/n/m.vtu")).unwrap();
    assert_eq!(notes(folder.run(&[])), first, "one file is made again");
}

#[test]
fn an_output_never_replaces_an_input() {
    let folder = Folder::with(
        "name: q
stages:
  - scene: {dimension: 3, objects: [{file: nut.vtu}]}
  - render: {occlusion: none, dimensions: [2, 2]}
  - write: {vtu: nut.vtu}
",
    );
    let one = Folder::with(BOXES);
    one.runs(&[]);
    std::fs::copy(one.path("out/e/m.vtu"), folder.path("nut.vtu")).unwrap();
    let before = std::fs::read(folder.path("nut.vtu")).unwrap();
    for verb in ["check", "run"] {
        let output = ao4d(&folder, &[verb, "p.yaml", "--out", "."]);
        assert_eq!(output.status.code(), Some(2), "{verb}");
        assert!(
            told(&output).contains("\"nut.vtu\" in . would replace an input of stages[0].scene"),
            "{}",
            told(&output)
        );
    }
    assert!(std::fs::read(folder.path("nut.vtu")).unwrap() == before);
    assert_eq!(names(folder.0.path()), ["nut.vtu", "p.yaml"]);
    // Elsewhere the name is free.
    assert_eq!(folder.runs(&[]).0, ["nut.vtu"]);
}

#[test]
fn folders_and_links_in_the_way_are_refused() {
    let folder = Folder::with(&BOXES.replace("m.vtu", "images/m.vtu"));
    std::fs::create_dir_all(folder.path("out/e/images/m.vtu")).unwrap();
    let output = folder.run(&[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(told(&output).contains("\"images/m.vtu\" is a folder in out/e"), "{}", told(&output));
    assert_eq!(names(&folder.path("out/e")), ["images"], "nothing was written");
    #[cfg(unix)]
    {
        std::fs::remove_dir_all(folder.path("out/e/images")).unwrap();
        std::fs::create_dir(folder.path("elsewhere")).unwrap();
        std::os::unix::fs::symlink(folder.path("elsewhere"), folder.path("out/e/images")).unwrap();
        let output = folder.run(&[]);
        assert_eq!(output.status.code(), Some(2));
        assert!(told(&output).contains("through the link \"images\""), "{}", told(&output));
        assert!(names(&folder.path("elsewhere")).is_empty());
    }
}

#[test]
fn pipelines_are_checked_together() {
    let folder = Folder::new();
    let pipeline = |name: &str, cells: usize, occlusion: &str| {
        let text = format!(
            "name: {name}\nstages:\n  - scene: {{dimension: 3, objects: [{{box: {{min: [-1,-1,-1], max: [1,1,1], subdivisions: {cells}}}}}]}}\n  - occlusion: {{{occlusion}}}\n  - render: {{dimensions: [4, 4]}}\n  - write: {{vti: a.vti}}\n"
        );
        std::fs::write(folder.path(&format!("{name}.yaml")), text).unwrap();
    };
    pipeline("a", 2, "samples: 4, file: ao.f32");
    pipeline("b", 2, "load: out/a/ao.f32");
    assert_eq!(ao4d(&folder, &["run", "a.yaml", "-q"]).status.code(), Some(0));
    // Both change together, which fits.
    pipeline("a", 3, "samples: 4, file: ao.f32");
    pipeline("b", 3, "load: out/a/ao.f32");
    let output = ao4d(&folder, &["run", "a.yaml", "b.yaml", "-q"]);
    assert_eq!(output.status.code(), Some(0), "{}", told(&output));
    // One changes alone: the other can't be run, and something was written by then.
    pipeline("a", 4, "samples: 4, file: ao.f32");
    assert_eq!(ao4d(&folder, &["run", "a.yaml", "b.yaml", "-q"]).status.code(), Some(3));
    // What needs nothing of another is refused before anything is written.
    pipeline("b", 3, "samples: 4");
    let broken = std::fs::read_to_string(folder.path("b.yaml")).unwrap().replace("max: [1,1,1]", "max: [-1,1,1]");
    std::fs::write(folder.path("b.yaml"), broken).unwrap();
    std::fs::remove_dir_all(folder.path("out")).unwrap();
    assert_eq!(ao4d(&folder, &["run", "a.yaml", "b.yaml", "-q"]).status.code(), Some(2));
    assert!(!folder.path("out").exists());
}

#[test]
fn one_run_at_a_time() {
    let folder =
        Folder::with(&BOXES.replace("samples: 8", "samples: 4000").replace("subdivisions: 3", "subdivisions: 12"));
    let mut first = folder.command(&["-q", "--threads", "1"]).spawn().unwrap();
    let since = Instant::now();
    while !folder.path("out/e/.ao4d-lock").exists() {
        assert!(since.elapsed() < Duration::from_secs(60), "no lock appears");
        std::thread::sleep(Duration::from_millis(2));
    }
    let mut refused = false;
    while first.try_wait().unwrap().is_none() {
        let output = folder.run(&["-q"]);
        match output.status.code() {
            Some(3) => {
                let expected = format!("out/e: another run (process {}) is writing here", first.id());
                // Between the lock and its owner's number there is a moment.
                refused |= told(&output).contains(&expected);
                assert!(told(&output).contains("is writing here; wait for it"), "{}", told(&output));
                if refused {
                    break;
                }
            }
            code => assert_eq!(code, Some(0), "{}", told(&output)),
        }
    }
    assert!(refused, "the second run never met the first");
    // However it ends, the folder is free again.
    first.kill().unwrap();
    first.wait().unwrap();
    let output = folder.run(&["-q", "--set", "ao.samples=4"]);
    assert_eq!(output.status.code(), Some(0), "{}", told(&output));
    assert!(!folder.path("out/e/.ao4d-lock").exists());
}

#[test]
fn what_a_killed_run_left_is_swept() {
    let folder = Folder::new();
    folder.runs(&[]);
    let out = folder.path("out/small");
    for name in [".image.vti.Ab3dE9.partial", ".ao.error.f32.xyz123.partial", "..ao4d-cache.json.a1b2c3.partial"] {
        std::fs::write(out.join(name), "half").unwrap();
    }
    std::fs::write(out.join(".mine.partial"), "not ours").unwrap();
    folder.runs(&[]);
    let left: Vec<String> = names(&out).into_iter().filter(|name| name.ends_with(".partial")).collect();
    assert_eq!(left, [".mine.partial"]);
}

#[cfg(unix)]
#[test]
fn what_is_no_file_is_not_opened() {
    let folder = Folder::with(BOXES);
    folder.runs(&[]);
    let whole = contents(&folder.path("out/e"));
    for name in [".ao4d-cache.json", "ao.error.f32", "ao.f32.yaml", "m.vtu"] {
        let path = folder.path("out/e").join(name);
        std::fs::remove_file(&path).unwrap();
        assert!(Command::new("mkfifo").arg(&path).status().unwrap().success());
        let mut run = folder.command(&["-q"]).spawn().unwrap();
        let since = Instant::now();
        let status = loop {
            if let Some(status) = run.try_wait().unwrap() {
                break status;
            }
            if since.elapsed() > Duration::from_secs(60) {
                run.kill().unwrap();
                panic!("{name}: hangs");
            }
            std::thread::sleep(Duration::from_millis(10));
        };
        assert_eq!(status.code(), Some(0), "{name}");
        assert!(contents(&folder.path("out/e")) == whole, "{name}");
    }
}

#[test]
fn an_input_that_changes_while_it_is_read_is_never_called_unchanged() {
    use ao4d::pipeline::Pipeline;
    use ao4d::stages::Keys;
    let folder = Folder::with(BOXES);
    let mesh = |x: f32| format!("v 0 0 0\nv {x} 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
    let text = "name: r\nstages:\n  - scene: {dimension: 3, objects: [{file: m.obj}]}\n  - render: {occlusion: none, dimensions: [2, 2]}\n  - write: {vti: a.vti}\n";
    std::fs::write(folder.path("p.yaml"), text).unwrap();
    let file = folder.path("m.obj");
    let plan = |path: &Path| Pipeline::load(path, &[], None).unwrap().plan;
    std::fs::write(&file, mesh(1.0)).unwrap();
    let keys = Keys::new(&plan(&folder.path("p.yaml")));
    assert_eq!(keys.inputs().changed(), None);
    // The same length, at once, and with the old time.
    let time = std::fs::metadata(&file).unwrap().modified().unwrap();
    std::fs::write(&file, mesh(2.0)).unwrap();
    std::fs::File::options().write(true).open(&file).unwrap().set_modified(time).unwrap();
    assert_eq!(keys.inputs().changed(), Some(file.as_path()));
    std::fs::remove_file(&file).unwrap();
    assert_eq!(keys.inputs().changed(), Some(file.as_path()));
    // What can't be read has no key that anything could have.
    std::fs::create_dir(&file).unwrap();
    let key = || Keys::new(&plan(&folder.path("p.yaml"))).of(0).to_owned();
    assert_ne!(key(), key());
}

#[cfg(target_os = "linux")]
#[test]
fn threads_are_those_that_were_asked_for() {
    let folder = Folder::with(BOXES);
    let program = env!("CARGO_BIN_EXE_ao4d");
    // Little memory for stacks: a thousand threads can't be started, one can.
    for (variable, arguments, code) in [
        ("2000", "check --threads 1 p.yaml", 0),
        ("2000", "run -q --threads 1 p.yaml", 0),
        ("2000", "check p.yaml", 3),
        ("2000", "run -q p.yaml", 3),
        ("1", "check --threads 1000 p.yaml", 3),
        ("1", "run -q --threads 1000 p.yaml", 3),
    ] {
        let script = format!("ulimit -v 1048576; exec '{program}' {arguments}");
        let mut command = Command::new("sh");
        let output =
            command.args(["-c", &script]).current_dir(folder.0.path()).env("RAYON_NUM_THREADS", variable).output();
        let output = output.unwrap();
        assert_eq!(output.status.code(), Some(code), "{variable} {arguments}: {}", told(&output));
        if code == 3 {
            assert!(told(&output).starts_with("error: can't start the threads"), "{}", told(&output));
        }
    }
    let start = Instant::now();
    let output = folder.command(&["-q"]).env("RAYON_NUM_THREADS", "100000").output().unwrap();
    assert!(start.elapsed() < Duration::from_secs(120));
    assert!(matches!(output.status.code(), Some(0 | 3)), "{}", told(&output));
}
