//! OpenCL beside the processor: the same bits, whatever the scene. Needs a device, such as PoCL's, which `tests/all`
//! installs; what happens without one is tested too.

#[path = "../support/on_rays.rs"]
mod on_rays;
mod parity;
#[path = "../support/smaller.rs"]
mod smaller;
mod without;

use std::path::Path;
use std::process::{Command, Output};

/// Runs the program in a folder.
fn ao4d(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ao4d")).current_dir(folder).args(arguments).output().unwrap()
}
