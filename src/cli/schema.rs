//! `ao4d schema`: the JSON Schema of a pipeline.

use clap::Args;

use super::console::Console;
use super::{Failure, Outcome};

/// What `schema` takes: nothing.
#[derive(Args, Debug)]
pub struct Schema {
    /// Print it as JSON (it always is)
    #[arg(long)]
    json: bool,
}

impl Schema {
    pub fn execute(self, console: &Console) -> Result<Outcome, Failure> {
        let _always = self.json;
        console.json(&ao4d::pipeline::schema())?;
        Ok(Outcome::Done)
    }
}
