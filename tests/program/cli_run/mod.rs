//! `ao4d run` as its users see it: which files appear, what a second run does, what goes wrong and how that is told.

mod caching;
mod compose;
mod faults;
mod frames;
mod input;
mod interrupt;
mod limits;
mod mesh;
mod pictures;
mod pieces;
mod provenance;
mod shade;
mod twins;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

/// A tetrahedron that reaches beyond the picture, and a closed body before it.
const PIPELINE: &str = "name: small
seed: 1
stages:
  - scene:
      objects:
        - name: wall
          orientation: eye
          simplices:
            vertices: [[-2, -2, -1, -1.3], [2, -2, -1, -1.4], [0, 3, -1, -1.5], [0, 0, 3, -1.3]]
            cells: [[0, 1, 2, 3]]
        - name: body
          tesseract: {size: 0.5}
          transform: [{rotate: {plane: xw, degrees: 20}}, {translate: [0.2, 0.1, 0.1, -0.9]}]
  - occlusion: {id: ao, samples: 8, file: ao.f32}
  - render: {id: plain, occlusion: none, dimensions: [7, 6, 5]}
  - write: {vti: plain.vti}
  - render: {id: image, dimensions: [7, 6, 5], shading: smooth}
  - write: {id: files, vti: image.vti, raw: image.raw, vtu: scene.vtu, png: slices.png}
  - paraview: {state: figure.py, screenshot: figure.png}
";
/// What the pipeline leaves, but for the cache's own file.
const FILES: [&str; 9] = [
    "ao.error.f32",
    "ao.f32",
    "ao.f32.yaml",
    "figure.py",
    "image.raw",
    "image.vti",
    "plain.vti",
    "scene.vtu",
    "slices.png",
];

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
