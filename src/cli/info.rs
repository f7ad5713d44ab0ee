//! `ao4d info`: what a file holds.

use std::path::PathBuf;

use clap::Args;

use super::console::Console;
use super::{Failure, Outcome};

/// What `info` takes.
#[derive(Args, Debug)]
pub struct Info {
    /// A volume, a mesh, an occlusion file
    file: PathBuf,
    /// Print it as JSON
    #[arg(long)]
    json: bool,
}

impl Info {
    pub fn execute(self, _console: &Console) -> Result<Outcome, Failure> {
        if !self.file.is_file() {
            return Err(Failure::refused(format!("{}: there is no such file", self.file.display())));
        }
        let _as_json = self.json;
        Err(Failure::refused("`info` is not available in this version"))
    }
}
