//! Pipelines, names and files made to harm: each is refused within a second or two, with exit code 2 and the limit named, or
//! comes out harmless.

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Runs the program, which must end in time.
fn ao4d(folder: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ao4d"));
    let command = command.current_dir(folder).args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped());
    let (mut child, start) = (command.spawn().unwrap(), Instant::now());
    while child.try_wait().unwrap().is_none() {
        if start.elapsed() > Duration::from_secs(20) {
            child.kill().unwrap();
            panic!("{arguments:?} hangs");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let Output { status, stdout, stderr } = child.wait_with_output().unwrap();
    (status.code(), String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap())
}

fn refused(folder: &Path, arguments: &[&str], message: &str) {
    let (code, stdout, stderr) = ao4d(folder, arguments);
    assert_eq!((code, stdout.as_str()), (Some(2), ""), "{stderr}");
    assert!(stderr.len() < 1000, "{} bytes of message", stderr.len());
    assert!(stderr.contains(message), "{message:?} is not in {stderr:?}");
}

/// A pipeline around one object of a scene.
fn pipeline(object: &str) -> String {
    format!(
        "name: p\nstages:\n  - scene: {{dimension: 3, objects: [{object}]}}\n  - render: {{dimensions: [4, 4], occlusion: none}}\n  - \
         write: {{vti: a.vti}}\n"
    )
}

const BOX: &str = "{box: {min: [-1, -1, -1], max: [1, 1, 1]}}";

fn formula(formula: &str) -> String {
    let grid = "{min: [-1, -1, -1], max: [1, 1, 1], cells: 4}";
    pipeline(&format!("{{isosurface: {{field: {{formula: \"{formula}\"}}, grid: {grid}}}}}"))
}

#[test]
fn what_is_deep_or_long_meets_a_limit() {
    let folder = tempfile::tempdir().unwrap();
    let nested =
        |open: &str, inner: &str, close: &str| format!("{}{inner}{}", open.repeat(20_000), close.repeat(20_000));
    for (yaml, message) in [
        (nested("[", "", "]"), "more than 64 deep"),
        (nested("{a: ", "1", "}"), "more than 64 deep"),
        (format!("name: {}", nested("[", "1", "]")), "more than 64 deep"),
        (nested("- ", "1", ""), "more than 64 deep"),
        (formula(&format!("min({}x)", "x,".repeat(100_000))), "min takes at most 1000 arguments"),
        (formula(&format!("max({}x)", "x,".repeat(1000))), "max takes at most 1000 arguments"),
        (formula(&nested("(", "x", ")")), "nests deeper than 64 levels"),
        (formula(&nested("-", "x", "")), "nests deeper than 64 levels"),
        (formula(&nested("min(x,", "x", ")")), "nests deeper than 64 levels"),
        (formula(&nested("x^", "x", "")), "nests deeper than 64 levels"),
        (formula(&nested("x*", "x", "")), "nests deeper than 64 levels"),
    ] {
        std::fs::write(folder.path().join("p.yaml"), yaml).unwrap();
        refused(folder.path(), &["check", "p.yaml"], message);
    }
    std::fs::write(folder.path().join("p.yaml"), formula(&format!("min({}x)", "x,".repeat(999)))).unwrap();
    let (code, _, stderr) = ao4d(folder.path(), &["check", "p.yaml"]);
    assert_eq!((code, stderr.as_str()), (Some(0), ""));
}

#[test]
fn overrides_meet_the_same_limits() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("p.yaml"), pipeline(BOX)).unwrap();
    for (set, message) in [
        (format!("seed{}=1", ".a".repeat(20_000)), "the key is more than 64 levels deep"),
        (format!("seed{}=1", "[0]".repeat(20_000)), "the key is more than 64 levels deep"),
        (format!("seed={}1{}", "[".repeat(20_000), "]".repeat(20_000)), "more than 64 deep"),
        (format!("seed={}1{}", "{a: ".repeat(20_000), "}".repeat(20_000)), "more than 64 deep"),
    ] {
        refused(folder.path(), &["check", "p.yaml", "--set", &set], message);
    }
}

#[test]
fn deep_and_wide_xml_is_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let spaces: String = (0..20_000).map(|i| format!("<a xmlns:n{i}='u{i}'>")).collect();
    let attributes: String = (0..100_000).map(|i| format!(" a{i}='1'")).collect();
    for (content, message) in [
        (format!("<VTKFile>{spaces}"), "more than 32 deep"),
        (format!("<VTKFile{attributes}/>"), "more than 64 attributes"),
    ] {
        for name in ["x.vti", "x.vtu"] {
            std::fs::write(folder.path().join(name), &content).unwrap();
            refused(folder.path(), &["info", name], message);
        }
        std::fs::write(folder.path().join("p.yaml"), pipeline("{file: x.vtu}")).unwrap();
        refused(folder.path(), &["check", "p.yaml"], message);
    }
}

#[cfg(unix)]
#[test]
fn only_regular_files_are_inputs() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let fifo = |name: &str| assert!(Command::new("mkfifo").arg(path(name)).status().unwrap().success(), "mkfifo");
    let image = |file: &str| {
        let numbers = if file.ends_with("raw") { ", dimensions: [4, 4, 4], type: uint8" } else { "" };
        pipeline(&format!("{{isosurface: {{field: {{image: {{file: {file}{numbers}}}}}, isovalue: 0.5}}}}"))
    };
    let load =
        |file: &str| pipeline(BOX).replace("  - render", &format!("  - occlusion: {{load: {file}}}\n  - render"));
    let detached = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 4 4 4\nencoding: raw\ndata file: FILE\n";
    fifo("fifo.yaml");
    std::fs::write(path("values.f32"), [0; 4]).unwrap();
    fifo("values.f32.yaml");
    let meshes = ["stl", "obj", "ply", "msh", "vtk", "vtu", "vtp", "pvtu", "pvtp", "pvd", "vtu.series"];
    let images = ["raw", "nii", "nii.gz", "hdr", "tif", "nc", "h5", "nrrd", "nhdr", "vti", "pvti", "vti.series", "f32"];
    let endings = || meshes.into_iter().chain(images);
    for ending in endings() {
        fifo(&format!("fifo.{ending}"));
        std::os::unix::fs::symlink("/dev/zero", path(&format!("zero.{ending}"))).unwrap();
    }
    for (name, kind) in [("fifo", "not a regular file but a FIFO"), ("zero", "not a regular file but a device")] {
        for ending in endings() {
            let file = format!("{name}.{ending}");
            let yaml = match ending {
                "f32" => load(&file),
                _ if meshes.contains(&ending) => pipeline(&format!("{{file: {file}}}")),
                _ => image(&file),
            };
            std::fs::write(path("p.yaml"), yaml).unwrap();
            for verb in ["check", "run"] {
                refused(folder.path(), &[verb, "p.yaml"], kind);
            }
            refused(folder.path(), &["info", &file], kind);
        }
        // What others name.
        let part = format!(
            "<VTKFile type='PUnstructuredGrid'><PUnstructuredGrid><Piece Source='{name}.vtu'/></PUnstructuredGrid></VTKFile>"
        );
        let step = format!(
            "<VTKFile type='Collection'><Collection><DataSet timestep='0' file='{name}.vtu'/></Collection></VTKFile>"
        );
        for (list, text) in [("list.pvtu", part), ("list.pvd", step)] {
            std::fs::write(path(list), text).unwrap();
            std::fs::write(path("p.yaml"), pipeline(&format!("{{file: {list}}}"))).unwrap();
            refused(folder.path(), &["check", "p.yaml"], kind);
            refused(folder.path(), &["info", list], kind);
        }
        std::fs::write(path("d.nhdr"), detached.replace("FILE", &format!("{name}.raw"))).unwrap();
        std::fs::write(path("p.yaml"), image("d.nhdr")).unwrap();
        refused(folder.path(), &["check", "p.yaml"], kind);
    }
    std::fs::write(path("p.yaml"), load("values.f32")).unwrap();
    for (arguments, file) in [
        (["check", "fifo.yaml"], "fifo.yaml"),
        (["run", "/dev/zero"], "/dev/zero"),
        (["check", "p.yaml"], "values.f32.yaml"),
    ] {
        refused(folder.path(), &arguments, "not a regular file");
        refused(folder.path(), &arguments, file);
    }
}

#[test]
fn a_cache_that_is_no_file_is_no_cache() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("p.yaml"), pipeline(BOX)).unwrap();
    let (code, _, stderr) = ao4d(folder.path(), &["run", "p.yaml", "-q", "--out", "o"]);
    assert_eq!((code, stderr.as_str()), (Some(0), ""));
    let cache = std::fs::read_dir(folder.path().join("o")).unwrap().map(|e| e.unwrap().path());
    let cache = cache.into_iter().find(|path| path.extension().is_some_and(|e| e == "json")).expect("a cache");
    std::fs::remove_file(&cache).unwrap();
    assert!(Command::new("mkfifo").arg(&cache).status().unwrap().success(), "mkfifo");
    let (code, ..) = ao4d(folder.path(), &["run", "p.yaml", "-q", "--out", "o"]);
    assert_eq!(code, Some(0));
}

#[test]
fn lengths_that_round_to_nothing_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let camera = |height: &str| {
        pipeline(BOX)
            .replace("occlusion: none", &format!("occlusion: none, camera: {{projection: parallel, height: {height}}}"))
    };
    for height in ["5e-324", "1e-300", "9e-13"] {
        std::fs::write(folder.path().join("p.yaml"), camera(height)).unwrap();
        let message = format!("camera.height: expected a number from 1e-12 on, found {height}\n");
        for verb in ["check", "run"] {
            refused(folder.path(), &[verb, "p.yaml"], &message);
        }
    }
    for (height, code) in [("1e-12", 0), ("1e12", 0), ("1e300", 2), ("-1e300", 2)] {
        std::fs::write(folder.path().join("p.yaml"), camera(height)).unwrap();
        let (found, _, stderr) = ao4d(folder.path(), &["run", "p.yaml", "-q"]);
        assert_eq!(found, Some(code), "{stderr}");
        assert!(stderr.len() < 200, "{stderr}");
    }
}

#[test]
fn a_terminal_is_given_no_commands() {
    let folder = tempfile::tempdir().unwrap();
    let commands = |text: &str| text.chars().any(|c| c.is_control() && c != '\n');
    let name = "a\\e]0;pwn\\a\\e[31m\\u009b";
    let grid = "{min: [-1, -1, -1], max: [1, 1, 1], cells: 2}";
    let empty = format!("{{name: \"{name}\", isosurface: {{field: {{formula: \"x+9\"}}, grid: {grid}}}}}");
    std::fs::write(folder.path().join("p.yaml"), pipeline(&empty)).unwrap();
    let (code, stdout, stderr) = ao4d(folder.path(), &["check", "p.yaml"]);
    assert!(code == Some(0) && !commands(&stdout) && !commands(&stderr), "{stdout:?} {stderr:?}");
    assert!(stderr.contains("a\\u001b]0;pwn\\u0007\\u001b[31m\\u009b"), "{stderr}");

    let field = "<FieldData><Array type=\"String\" Name=\"s\" format=\"ascii\">27 93 48 59 112 119 110 7 194 155 0</Array></FieldData>";
    let image = "<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\"><ImageData WholeExtent=\"0 1 0 0 0 0\">";
    let file = format!("{image}{field}<Piece><PointData/></Piece></ImageData></VTKFile>");
    std::fs::write(folder.path().join("x.vti"), file).unwrap();
    let (code, stdout, _) = ao4d(folder.path(), &["info", "x.vti"]);
    assert!(code == Some(0) && !commands(&stdout) && stdout.contains("\\u001b]0;pwn"), "{stdout:?}");
    let json = ao4d(folder.path(), &["info", "x.vti", "--json"]).1;
    assert!(!commands(&json) && json.contains("\\u009b"), "{json:?}");
    assert!(serde_json::from_str::<serde_json::Value>(&json).unwrap().to_string().contains("\u{9b}"));

    for arguments in [["check", "\x1b[31m.yaml"], ["info", "\x1b[31m.vti"], ["check", "--\x1b[31m"], ["\x1b[31m", "x"]]
    {
        let (code, stdout, stderr) = ao4d(folder.path(), &arguments);
        assert_eq!((code, stdout.as_str()), (Some(2), ""), "{arguments:?}");
        assert!(!commands(&stderr), "{stderr:?}");
        assert!(arguments[1].starts_with('-') || arguments[1] == "x" || stderr.contains("\\u001b[31m"), "{stderr:?}");
    }
    std::fs::write(folder.path().join("p.yaml"), pipeline(BOX)).unwrap();
    let set = "render.shading=\x1b[31m";
    let (code, _, stderr) = ao4d(folder.path(), &["check", "p.yaml", "--set", set]);
    assert!(code == Some(2) && !commands(&stderr), "{stderr:?}");
}

#[test]
fn a_study_is_xml_and_markdown_whatever_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let name = "a]]>b <img src=x onerror=alert(1)> \\uFFFE & [c](d)";
    let corner = "{vertices: [[0, 0, 0], [1, 0, 0], [0, 1, 0]], cells: [[0, 1, 2]]}";
    let yaml = pipeline(&format!("{{simplices: {corner}}}"))
        .replace("name: p", &format!("name: \"{name}\""))
        .replace(", occlusion: none", "")
        .replace("  - render", "  - occlusion: {samples: 4}\n  - render");
    std::fs::write(folder.path().join("p.yaml"), yaml).unwrap();
    let (code, _, stderr) = ao4d(folder.path(), &["study", "p.yaml", "-q", "--out", "o"]);
    assert_eq!((code, stderr.as_str()), (Some(0), ""));
    let read = |name: &str| std::fs::read_to_string(folder.path().join("o").join(name)).unwrap();
    let svg = read("study.svg");
    let xml = roxmltree::Document::parse(&svg).unwrap();
    assert!(
        xml.descendants()
            .any(|n| n.text().is_some_and(|t| t.starts_with("a]]>b <img src=x onerror=alert(1)> \u{fffd} &")))
    );
    let heading = read("study.md").lines().next().unwrap().to_owned();
    assert!(heading.starts_with("# Error against time: a\\]\\]&gt;b &lt;img src=x onerror=alert(1)&gt;"), "{heading}");
    assert!(heading.ends_with("&amp; \\[c\\](d)"), "{heading}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_folder_need_not_be_utf_8() {
    use std::os::unix::ffi::OsStrExt;
    let folder = tempfile::tempdir().unwrap();
    let odd = folder.path().join(std::ffi::OsStr::from_bytes(b"d\xff"));
    std::fs::create_dir(&odd).unwrap();
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    std::fs::write(odd.join("m.obj"), obj).unwrap();
    std::fs::write(odd.join("p.yaml"), pipeline("{file: m.obj}")).unwrap();
    let run = |folder: &Path, arguments: &[&std::ffi::OsStr]| {
        let output = Command::new(env!("CARGO_BIN_EXE_ao4d")).current_dir(folder).args(arguments).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    };
    let (file, out) = (odd.join("p.yaml"), odd.join("o"));
    run(folder.path(), &["check".as_ref(), file.as_os_str()]);
    run(&odd, &["check".as_ref(), "p.yaml".as_ref()]);
    for _ in 0..2 {
        run(folder.path(), &["run".as_ref(), file.as_os_str(), "--out".as_ref(), out.as_os_str()]);
    }
    assert!(out.join("a.vti").is_file());
}
