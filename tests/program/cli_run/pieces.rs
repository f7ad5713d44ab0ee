//! Runs in pieces: what each leaves, and that all of them together are what one process makes, byte for byte.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use serde_json::Value;

use super::Folder;

/// Every kind of picture, of values and of files that pieces share in their own ways.
const EVERYTHING: &str = "name: all
seed: 5
stages:
  - scene:
      id: s
      objects:
        - {name: body, tesseract: {size: 0.6}, color: [0.9, 0.4, 0.2], transform: [{rotate: {plane: xw, degrees: 20}}]}
        - {name: other, box: {min: [-0.2, -0.3, -0.2, -0.1], max: [0.2, 0.3, 0.2, 0.2]}, transform: [{translate: [0.5, 0.2, 0.1, 0.3]}]}
  - occlusion: {id: ao, samples: 8}
  - render: {id: plain, occlusion: none, dimensions: [5, 6, 7], supersample: 1}
  - write: {vti: plain.vti, encoding: inline}
  - render: {id: auto, dimensions: [6, 5, 9], supersample: 2}
  - write: {vti: deep/auto.vti, raw: auto.raw, png: auto.png, arrays: [rgba, ambient_occlusion, opacity, occlusion_error], compression: zlib}
  - write: {input: auto, vti: again.vti}
  - render: {id: lit, shading: voxel, dimensions: [4, 4, 5], bounce: 1, lights: [{direction: [0, -1, 0, 0]}]}
  - write: {vti: lit.vti, vtu: lit.vtu, arrays: [rgba, light, opacity, bent_normal]}
  - render: {id: flat, shading: flat, dimensions: [4, 4, 4], layers: 2}
  - write: {vti: flat.vti}
  - render: {id: space, occlusion: screen_space, dimensions: [5, 5, 6]}
  - write: {vti: space.vti, compression: lz4}
  - mesh: {vtu: mesh.vtu}
  - slice: {at: 0.1, vtp: slice.vtp}
  - wireframe: {input: auto, vtp: wire.vtp}
  - animate: {input: flat, frames: 3, turn: {plane: xw}, vti: turn.vti, compression: lz4}
  - animate: {input: auto, frames: 2, moves: body, scan: [0, 0.2], vti: move.vti}
  - paraview: {input: auto, state: figure.py}
  - scene: {id: three, dimension: 3, objects: [{box: {min: [-0.5, -0.5, -0.5], max: [0.5, 0.5, 0.5]}}]}
  - occlusion: {id: ao3, samples: 16, file: ao3.f32}
  - render: {id: flat3, dimensions: [9, 8]}
  - write: {vti: flat3.vti, raw: flat3.raw, png: flat3.png}
";

/// The content of all files below a folder, by their paths.
fn tree(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let (mut files, mut open) = (BTreeMap::new(), vec![folder.to_owned()]);
    while let Some(next) = open.pop() {
        for entry in std::fs::read_dir(&next).into_iter().flatten() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().to_str().unwrap().to_owned();
                files.insert(name, std::fs::read(path).unwrap());
            }
        }
    }
    files
}

/// Runs a verb.
fn call(folder: &Folder, verb: &str, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ao4d"));
    command.current_dir(folder.path("")).args([verb, "p.yaml"]).args(arguments).output().unwrap()
}

/// Runs a verb that must succeed, and returns its report and what was said.
fn report(folder: &Folder, verb: &str, arguments: &[&str]) -> (Value, String) {
    let output = call(folder, verb, &[arguments, &["--json"]].concat());
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{verb} {arguments:?}: {told}");
    (serde_json::from_slice(&output.stdout).unwrap(), told)
}

/// Makes all pieces of a run into a folder, the last first.
fn pieces(folder: &Folder, out: &str, count: usize) {
    for k in (0..count).rev() {
        report(folder, "run", &["--out", out, "--piece", &format!("{k}/{count}")]);
    }
}

/// The verb refuses, with these words.
fn refused(folder: &Folder, verb: &str, arguments: &[&str], words: &[&str]) {
    let output = call(folder, verb, arguments);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{verb} {arguments:?}: {told}");
    words.iter().for_each(|word| assert!(told.contains(word), "{word}: {told}"));
}

/// The files of a folder, without its pieces.
fn whole(folder: &Folder, out: &str) -> BTreeMap<String, Vec<u8>> {
    let mut files = tree(&folder.path(out));
    files.retain(|name, _| !name.contains("pieces-") && !name.ends_with(".ao4d-cache.json"));
    files
}

#[test]
fn pieces_of_everything_together_are_what_one_process_makes() {
    let folder = Folder::with(EVERYTHING);
    report(&folder, "run", &["--out", "whole"]);
    let expected = whole(&folder, "whole");
    assert!(expected.len() > 20, "{:?}", expected.keys());
    // Also more pieces than any picture has layers.
    for count in [1, 3, 11] {
        let out = format!("of-{count}");
        pieces(&folder, &out, count);
        assert!(whole(&folder, &out).is_empty(), "pieces write into their own folders");
        report(&folder, "merge", &["--out", &out]);
        let found = whole(&folder, &out);
        assert_eq!(found.keys().collect::<Vec<_>>(), expected.keys().collect::<Vec<_>>(), "{count}");
        for (name, bytes) in &expected {
            assert!(found[name] == *bytes, "{name} of {count} pieces differs");
        }
        // Nothing is left to be done, by either verb.
        for verb in ["merge", "run"] {
            let (again, _) = report(&folder, verb, &["--out", &out]);
            let files = again["files"].as_array().unwrap();
            assert!(files.iter().all(|file| file["cached"] == Value::Bool(true)), "{verb} {count}: {again}");
            assert_eq!(again["work"]["voxels"], 0, "{verb}");
        }
    }
}

#[test]
fn a_piece_that_died_is_named_and_made_again_alone() {
    let folder = Folder::new();
    report(&folder, "run", &["--out", "whole"]);
    pieces(&folder, "out", 4);
    let before = tree(&folder.path("out"));
    for lost in ["pieces-4/1/image.vti", "pieces-4/1/.image.raw.part", "pieces-4/1/.occlusion-0.values"] {
        std::fs::remove_file(folder.path("out").join(lost)).unwrap();
        refused(&folder, "merge", &["--out", "out"], &["piece 1 of 4 is missing or unfinished", "--piece K/4"]);
        report(&folder, "run", &["--out", "out", "--piece", "1/4"]);
        let after = tree(&folder.path("out"));
        for (name, bytes) in before.iter().filter(|(name, _)| !name.ends_with(".ao4d-cache.json")) {
            assert!(after[name] == *bytes, "{name}");
        }
    }
    std::fs::remove_dir_all(folder.path("out/pieces-4/2")).unwrap();
    std::fs::remove_dir_all(folder.path("out/pieces-4/3")).unwrap();
    refused(&folder, "merge", &["--out", "out"], &["pieces 2 to 3 of 4 are missing or unfinished"]);
    let (first, _) = report(&folder, "run", &["--out", "out", "--piece", "0/4"]);
    assert_eq!(
        (&first["work"]["vertices"], &first["piece"]),
        (&0.into(), &"0/4".into()),
        "what is there is not made again"
    );
    report(&folder, "run", &["--out", "out", "--piece", "2/4"]);
    report(&folder, "run", &["--out", "out", "--piece", "3/4"]);
    report(&folder, "merge", &["--out", "out"]);
    assert!(whole(&folder, "out") == whole(&folder, "whole"));
}

#[test]
fn pieces_of_something_else_are_refused_by_what_differs() {
    let folder = Folder::new();
    refused(&folder, "merge", &[], &["there are no pieces in", "--piece K/N"]);
    pieces(&folder, "out", 2);
    refused(&folder, "merge", &["--out", "out", "--set", "seed=2"], &["pieces 0 to 1 of 2", "`seed: 1`", "`seed: 2`"]);
    report(&folder, "run", &["--out", "out", "--piece", "1/2", "--set", "ao.samples=4"]);
    refused(&folder, "merge", &["--out", "out"], &["piece 1 of 2", "samples: 4", "samples: 8"]);
    // Another version of the program.
    let told = folder.path("out/pieces-2/0/.ao4d-piece.json");
    let text = std::fs::read_to_string(&told).unwrap();
    let other = text.replacen(concat!("ao4d ", env!("CARGO_PKG_VERSION")), "ao4d 0.0.9", 1);
    std::fs::write(&told, other).unwrap();
    let cache = folder.path("out/pieces-2/0/.ao4d-cache.json");
    let keys = std::fs::read_to_string(&cache).unwrap().replace("\"key\": \"", "\"key\": \"0");
    std::fs::write(&cache, keys).unwrap();
    refused(&folder, "merge", &["--out", "out"], &["pieces 0 to 1 of 2", "it was made by ao4d 0.0.9"]);
    report(&folder, "run", &["--out", "out", "--piece", "0/3"]);
    refused(&folder, "merge", &["--out", "out"], &["pieces of several runs: of 2, of 3", "--pieces N"]);
    refused(&folder, "merge", &["--out", "out", "--pieces", "3"], &["pieces 1 to 2 of 3 are missing"]);
    refused(&folder, "merge", &["--pieces", "0"], &["1 to 1000000"]);
}

#[test]
fn pieces_that_cannot_be_are_refused() {
    let folder = Folder::new();
    for (piece, words) in [
        ("4/4", "pieces are counted from 0, so the last is 3/4"),
        ("0/0", "there are no 0 pieces"),
        ("1", "expected K/N, such as 0/4 to 3/4, or none"),
        ("-1/4", "K/N"),
        ("0/1000001", "at most 1000000"),
    ] {
        refused(&folder, "run", &[&format!("--piece={piece}")], &[words]);
    }
    assert!(!folder.path("out").exists());
}

#[test]
fn launchers_say_which_piece() {
    let folder = Folder::new();
    let run = |arguments: &[&str], variables: &[(&str, &str)]| {
        let mut command = folder.command(&[&["--json", "--set", "ao.samples=1"], arguments].concat());
        let output = command.envs(variables.iter().copied()).output().unwrap();
        let told = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(0), "{told}");
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        (report["piece"].as_str().map(str::to_owned), told)
    };
    let array = [
        ("SLURM_ARRAY_TASK_ID", "6"),
        ("SLURM_ARRAY_TASK_COUNT", "3"),
        ("SLURM_ARRAY_TASK_STEP", "2"),
        ("SLURM_ARRAY_TASK_MIN", "4"),
    ];
    let (piece, told) = run(&[], &array);
    assert_eq!(piece.as_deref(), Some("1/3"));
    assert!(told.contains("note: piece 1/3, by SLURM_ARRAY_TASK_ID"), "{told}");
    let mpi = [("OMPI_COMM_WORLD_RANK", "2"), ("OMPI_COMM_WORLD_SIZE", "4")];
    assert_eq!(run(&[], &mpi).0.as_deref(), Some("2/4"));
    assert_eq!(run(&["--piece", "0/2"], &mpi).0.as_deref(), Some("0/2"), "what is written counts");
    for whole in [
        run(&["--piece", "none"], &mpi),
        run(&[], &[("SLURM_JOB_ID", "1"), ("SLURM_PROCID", "0"), ("SLURM_NTASKS", "1")]),
    ] {
        assert_eq!(whole.0, None);
        assert!(!whole.1.contains("piece"), "{}", whole.1);
    }
}

#[test]
fn one_piece_is_made_once_at_a_time_and_different_ones_together() {
    let folder = Folder::new();
    let start = |piece: &str| {
        let mut command =
            folder.command(&["--piece", piece, "--set", "ao.samples=16384", "--set", "image.dimensions=[60, 60, 60]"]);
        command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
    };
    let (mut first, mut second) = (start("0/2"), start("1/2"));
    let lock = |k: usize| folder.path(&format!("out/small/pieces-2/{k}/.ao4d-lock"));
    let is_held = |path: &Path| std::fs::read_to_string(path).is_ok_and(|text| !text.is_empty());
    while !(is_held(&lock(0)) && is_held(&lock(1))) {
        assert!(first.try_wait().unwrap().is_none() && second.try_wait().unwrap().is_none(), "they ended too early");
        std::thread::sleep(Duration::from_millis(5));
    }
    let output = call(&folder, "run", &["--piece", "0/2"]);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(3), "{told}");
    let holder = format!("another run (process {}) is writing here", first.id());
    assert!(told.contains("pieces-2/0") && told.contains(&holder), "{told}");
    for child in [&mut first, &mut second] {
        child.kill().unwrap();
        child.wait().unwrap();
    }
}
