//! Images and meshes written by other libraries are read as these libraries read them, value for value and place for place:
//! nibabel, pynrrd, tifffile, netCDF4, VTK, SimpleITK, meshio and gmsh. Runs `tests/python/check_images.py` and `check_meshes.py`
//! with the Python of `AO4D_PYTHON`, or else of `.venv`.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Runs a script, which prints how many files it held against their libraries.
fn files_of(script: &str) -> usize {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let python = std::env::var_os("AO4D_PYTHON").map_or_else(|| root.join(".venv/bin/python"), PathBuf::from);
    let folder = tempfile::tempdir().unwrap();
    let run = Command::new(&python)
        .arg(root.join("tests/python").join(script))
        .arg(env!("CARGO_BIN_EXE_ao4d"))
        .arg(folder.path())
        .output()
        .unwrap_or_else(|e| panic!("{}: {e}; run tests/install, or set AO4D_PYTHON", python.display()));
    let said = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{said}\nA package that is missing is installed by tests/install.");
    String::from_utf8_lossy(&run.stdout).split_whitespace().last().unwrap().parse().unwrap()
}

#[test]
fn other_libraries_read_the_same_images() {
    let count = files_of("check_images.py");
    assert!(count > 450, "only {count} files");
}

#[test]
fn other_libraries_read_the_same_meshes() {
    let count = files_of("check_meshes.py");
    assert!(count > 110, "only {count} files");
}
