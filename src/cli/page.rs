//! `ao4d page`: run a pipeline, and put what it shows into one HTML file.

use clap::Args;

use super::console::Console;
use super::run::Run;
use super::{Failure, Outcome};

/// What `page` takes: what `run` takes.
#[derive(Args, Debug)]
pub struct Page {
    #[command(flatten)]
    run: Run,
}

impl Page {
    pub fn execute(mut self, console: &Console) -> Result<Outcome, Failure> {
        self.run.with_page();
        self.run.execute(console)
    }
}
