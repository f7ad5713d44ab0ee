//! Regression: what small pipelines gave once is what they give now, to the last bit.
//!
//! `tests/reference/` holds the pipelines and, beside each, its volume and its occlusion values. `ao4d compare` holds
//! new ones against them without tolerance. After a change that is meant, `AO4D_BLESS=1 cargo test --release --test
//! reference` writes them anew.

use std::path::{Path, PathBuf};
use std::process::Command;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference")
}

/// Runs the program, and returns its exit code and all it said.
fn ao4d(arguments: &[&Path]) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_ao4d")).args(arguments).output().unwrap();
    let said = [output.stdout, output.stderr].concat();
    (output.status.code(), String::from_utf8(said).unwrap())
}

fn check(name: &str) {
    let out = tempfile::tempdir().unwrap();
    let pipeline = folder().join(format!("{name}.yaml"));
    let (code, said) = ao4d(&["run".as_ref(), &pipeline, "--out".as_ref(), out.path()]);
    assert_eq!(code, Some(0), "{name}: {said}");
    for file in [format!("{name}.vti"), format!("{name}.f32")] {
        let (made, kept) = (out.path().join(&file), folder().join(&file));
        if std::env::var_os("AO4D_BLESS").is_some() {
            std::fs::copy(&made, &kept).unwrap();
        }
        let (code, said) = ao4d(&["compare".as_ref(), &made, &kept]);
        assert_eq!(code, Some(0), "{file} is not as it was; if that is meant, run with AO4D_BLESS=1\n{said}");
        assert!(std::fs::metadata(&kept).unwrap().len() < 100_000, "{file}: references are to be small");
    }
}

#[test]
fn two_tetrahedra() {
    check("two_tetrahedra");
}

#[test]
fn cut_cubes() {
    check("cut_cubes");
}

#[test]
fn floor_3d() {
    check("floor_3d");
}

#[test]
fn nut() {
    check("nut");
}

/// The references show something, and are more than one colour; so a difference could be seen.
#[test]
fn references_are_worth_comparing_with() {
    let mut volumes = 0;
    for entry in std::fs::read_dir(folder()).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "vti") {
            volumes += 1;
            let volume = ao4d::io::vtk::read_volume(&path).unwrap();
            let opacity = volume.array("opacity").unwrap().values.to_f64();
            let seen = opacity.iter().filter(|&&o| o > 0.0).count();
            assert!(seen > 300 && seen < opacity.len(), "{}: {seen} of {}", path.display(), opacity.len());
            let occlusion = volume.array("ambient_occlusion").unwrap().values.to_f64();
            let mut dark: Vec<u64> = occlusion.iter().filter(|&&a| a < 0.9).map(|a| a.to_bits()).collect();
            dark.sort_unstable();
            dark.dedup();
            assert!(dark.len() > 20, "{}: {} values below 0.9", path.display(), dark.len());
        }
    }
    assert_eq!(volumes, 4);
}
