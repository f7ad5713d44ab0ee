//! `ao4d info`: what a file holds.

use std::path::PathBuf;

use ao4d::inspect;
use ao4d::pipeline::Told;
use ao4d::progress::Progress;
use clap::Args;

use super::console::Console;
use super::watch::Watch;
use super::{Failure, Outcome};

/// What `info` takes.
#[derive(Args, Debug)]
pub struct Info {
    /// A volume, a mesh, an occlusion file
    file: PathBuf,
    /// Of a file with several arrays, variables or images: which one
    #[arg(long, value_name = "NAME")]
    array: Option<String>,
    /// Also write an image's values there, as little-endian float64, x fastest, then y, z, time
    #[arg(long, value_name = "FILE")]
    values: Option<PathBuf>,
    /// Print the pipeline that made the file, as YAML that makes it again
    #[arg(long, conflicts_with_all = ["array", "values", "json"])]
    pipeline: bool,
    /// Print it as JSON
    #[arg(long)]
    json: bool,
}

impl Info {
    pub fn execute(self, console: &Console) -> Result<Outcome, Failure> {
        super::existing(&self.file)?;
        if self.pipeline {
            let told = Told::read(&self.file)?;
            told.notes.iter().for_each(|note| console.warn(&format!("{}: {note}", self.file.display())));
            console.result(&told.text)?;
            return Ok(Outcome::Done);
        }
        let watch = Watch::new(console)?;
        let running = (&watch as &dyn Progress).stage(&format!("reading {}", self.file.display()), 0);
        let array = self.array.as_deref();
        let info = inspect::Info::read_array(&self.file, array)?;
        if let Some(values) = &self.values {
            inspect::image::write_values(&self.file, array, values)?;
        }
        running.end();
        if self.json { console.json(&info) } else { console.result(&info.to_string()) }?;
        Ok(Outcome::Done)
    }
}
