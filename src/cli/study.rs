//! `ao4d study`: error against time of the occlusion methods on a pipeline's scene.

use clap::Args;

use super::console::Console;
use super::options::PipelineOptions;
use super::{Failure, Outcome};

/// What `study` takes.
#[derive(Args, Debug)]
pub struct Study {
    #[command(flatten)]
    options: PipelineOptions,
}

impl Study {
    pub fn execute(self, console: &Console) -> Result<Outcome, Failure> {
        let _checked_first = self.options.load(console)?;
        Err(Failure::refused("`study` is not available in this version"))
    }
}
