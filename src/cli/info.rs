//! `ao4d info`: what a file holds.

use std::path::PathBuf;

use ao4d::inspect;
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
    pub fn execute(self, console: &Console) -> Result<Outcome, Failure> {
        super::existing(&self.file)?;
        let info = inspect::Info::read(&self.file)?;
        if self.json { console.json(&info) } else { console.result(&info.to_string()) }?;
        Ok(Outcome::Done)
    }
}
