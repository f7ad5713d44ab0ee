//! The package as users import it: its Python files beside the module that cargo has just built, in the newest Python and in
//! ParaView's.
//!
//! Maturin makes the same of them, in a wheel; `python/README.md` says how.

use std::path::{Path, PathBuf};
use std::process::Command;

const HERE: &str = env!("CARGO_MANIFEST_DIR");

/// The package in a folder of its own.
fn package(folder: &Path) {
    let deps = std::env::current_exe().unwrap().parent().unwrap().to_owned();
    let built = ["libao4d_native.so", "libao4d_native.dylib", "ao4d_native.dll"].map(|name| deps.join(name));
    let built = built.iter().find(|path| path.exists()).expect("cargo builds the module before its tests");
    let package = folder.join("ao4d");
    std::fs::create_dir(&package).unwrap();
    for entry in std::fs::read_dir(Path::new(HERE).join("ao4d")).unwrap().map(Result::unwrap) {
        if entry.file_type().unwrap().is_file() {
            std::fs::copy(entry.path(), package.join(entry.file_name())).unwrap();
        }
    }
    let name = if cfg!(windows) { "_native.pyd" } else { "_native.abi3.so" };
    std::fs::copy(built, package.join(name)).unwrap();
}

fn python() -> PathBuf {
    let own = || Path::new(HERE).join("../.venv/bin/python");
    std::env::var_os("AO4D_PYTHON").map_or_else(own, PathBuf::from)
}

#[track_caller]
fn passes(python: &Path, arguments: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    package(folder.path());
    let output = Command::new(python)
        .args(arguments)
        .current_dir(folder.path())
        .env("PYTHONPATH", folder.path())
        .env("MPLBACKEND", "Agg")
        .output()
        .unwrap_or_else(|error| panic!("{}: {error}; run tests/install", python.display()));
    let told = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
    assert!(output.status.success(), "{} {arguments:?}: {told}", python.display());
}

#[test]
#[ignore = "needs Python with numpy and PyVista: run tests/all"]
fn the_package_does_what_it_says() {
    passes(&python(), &[&format!("{HERE}/tests/test_ao4d.py")]);
}

#[test]
#[ignore = "needs Python with numpy and PyVista: run tests/all"]
fn the_notebook_runs() {
    passes(&python(), &[&format!("{HERE}/tests/run_notebook.py"), &format!("{HERE}/../examples/from_arrays.ipynb")]);
}

#[test]
#[ignore = "needs ParaView: run tests/all"]
fn the_python_of_paraview_imports_it() {
    let script = "import paraview, ao4d; m = ao4d.load_scene({'name': 't', 'stages': [{'scene': {'objects': [{'tesseract': {}}]}}]}); \
                  assert abs(ao4d.occlusion(m, samples=4).values.min() - 1) < 1e-6";
    passes(Path::new("/usr/bin/python3"), &["-c", script]);
}
