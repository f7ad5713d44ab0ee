//! A run in pieces by `mpirun`, one of which is killed and made again; and VTK, which reads the pieces as ParaView's servers do. Runs
//! `tests/python/check_pieces.py` with the Python of `AO4D_PYTHON`, or else of `.venv`.
#![cfg(unix)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

const PIPELINE: &str = "name: p
seed: 3
stages:
  - scene: {objects: [{hypersphere: {radius: 0.5, subdivisions: 4}}, {tesseract: {size: 0.5}, transform: [{translate: [0.4, 0.2, 0, 0.3]}]}]}
  - occlusion: {id: ao, samples: 64, file: ao.f32}
  - render: {id: image, dimensions: [24, 22, 30], supersample: 1}
  - write: {vti: image.vti, vtu: scene.vtu, raw: image.raw}
  - render: {id: flat, occlusion: none, dimensions: [8, 8, 3], supersample: 1}
  - write: {vti: deep/flat.vti, compression: zlib, arrays: [rgba, depth, object]}
  - mesh: {vtu: mesh.vtu}
";

fn ao4d(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ao4d")).current_dir(folder).args(arguments).output().unwrap()
}

fn succeeds(output: &Output) {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// Four local processes.
fn mpirun(folder: &Path) -> Command {
    let mut command = Command::new("mpirun");
    // As root in a container, and with more processes than cores; OpenMPI's own kinds of shared memory are not needed.
    command.args(["--allow-run-as-root", "--oversubscribe", "--bind-to", "none", "-n", "4"]);
    command.arg(env!("CARGO_BIN_EXE_ao4d")).args(["run", "p.yaml", "--threads", "1"]).current_dir(folder);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn start(command: &mut Command) -> Child {
    command.spawn().unwrap_or_else(|e| panic!("mpirun: {e}; tests/install installs it"))
}

/// The files that a run or a merging leaves, without pieces and what caches know.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let (mut found, mut open) = (BTreeMap::new(), vec![folder.to_owned()]);
    while let Some(next) = open.pop() {
        for entry in std::fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            match path.is_dir() {
                true if name.starts_with("pieces-") => {}
                true => open.push(path),
                false if name == ".ao4d-cache.json" => {}
                false => {
                    drop(found.insert(path.strip_prefix(folder).unwrap().to_owned(), std::fs::read(path).unwrap()))
                }
            }
        }
    }
    found
}

#[test]
#[ignore = "needs mpirun and VTK: run tests/all"]
fn four_processes_one_of_them_killed_make_what_one_makes_and_vtk_reads_their_pieces() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("p.yaml"), PIPELINE).unwrap();
    succeeds(&ao4d(folder, &["run", "p.yaml", "--out", "whole"]));

    // The third process dies as soon as it is at work; mpirun ends the others.
    let lock = folder.join("out/p/pieces-4/2/.ao4d-lock");
    let mut child = start(mpirun(folder).args(["--set", "ao.samples=65536"]));
    let began = Instant::now();
    let process = loop {
        let held = std::fs::read_to_string(&lock).unwrap_or_default();
        if let Some(id) = held.split(' ').next().filter(|id| !id.is_empty()) {
            break id.to_owned();
        }
        assert!(began.elapsed() < Duration::from_secs(100), "no third process");
        assert!(child.try_wait().unwrap().is_none(), "mpirun ended too early");
        std::thread::sleep(Duration::from_millis(5));
    };
    assert!(Command::new("kill").args(["-KILL", &process]).status().unwrap().success());
    assert!(!child.wait_with_output().unwrap().status.success());
    let refused = ao4d(folder, &["merge", "p.yaml"]);
    assert_eq!(refused.status.code(), Some(2), "{}", String::from_utf8_lossy(&refused.stderr));

    succeeds(&start(&mut mpirun(folder)).wait_with_output().unwrap());
    succeeds(&ao4d(folder, &["merge", "p.yaml"]));
    let (whole, merged) = (files(&folder.join("whole")), files(&folder.join("out/p")));
    assert!(whole.keys().eq(merged.keys()), "{:?}\n{:?}", whole.keys(), merged.keys());
    whole.iter().for_each(|(name, bytes)| assert!(merged[name] == *bytes, "{} differs", name.display()));
    for (list, whole) in [("image.pvti", "image.vti"), ("deep/flat.pvti", "deep/flat.vti")] {
        let list = format!("out/p/pieces-4/0/{list}");
        succeeds(&ao4d(folder, &["compare", &list, &format!("whole/{whole}")]));
        succeeds(&ao4d(folder, &["info", &list]));
    }

    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let python = std::env::var_os("AO4D_PYTHON").map_or_else(|| root.join(".venv/bin/python"), PathBuf::from);
    let script = root.join("tests/python/check_pieces.py");
    let run = Command::new(&python).arg(script).args([folder.join("whole"), folder.join("out/p/pieces-4/0")]).output();
    let run = run.unwrap_or_else(|e| panic!("{}: {e}; run tests/install, or set AO4D_PYTHON", python.display()));
    succeeds(&run);
    assert_eq!(String::from_utf8_lossy(&run.stdout).trim(), "4", "two images and two meshes");
}
