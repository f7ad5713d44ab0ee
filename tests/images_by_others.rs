//! Images written by nibabel, pynrrd, tifffile and netCDF4 are read as these libraries read them, value for value and place for
//! place. Runs `tests/python/check_images.py` with the Python of `AO4D_PYTHON`, or else of `.venv`.

use std::path::{Path, PathBuf};
use std::process::Command;

#[test]
fn other_libraries_read_the_same() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let python = std::env::var_os("AO4D_PYTHON").map_or_else(|| root.join(".venv/bin/python"), PathBuf::from);
    let folder = tempfile::tempdir().unwrap();
    let run = Command::new(&python)
        .arg(root.join("tests/python/check_images.py"))
        .arg(env!("CARGO_BIN_EXE_ao4d"))
        .arg(folder.path())
        .output()
        .unwrap_or_else(|e| panic!("{}: {e}; run tests/install, or set AO4D_PYTHON", python.display()));
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let count: usize = String::from_utf8_lossy(&run.stdout).trim().parse().unwrap();
    assert!(count > 250, "only {count} files");
}
