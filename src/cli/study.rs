//! `ao4d study`: error against time of the occlusion methods on a pipeline's scene.

use ao4d::pipeline::{Backend, study};
use clap::Args;

use super::console::Console;
use super::options::PipelineOptions;
use super::watch::Watch;
use super::{Failure, Outcome};

/// What `study` takes.
#[derive(Args, Debug)]
pub struct Study {
    #[command(flatten)]
    options: PipelineOptions,
}

impl Study {
    pub fn execute(self, console: &Console) -> Result<Outcome, Failure> {
        let (pipeline, settings) = self.options.load(console)?;
        if settings.backend != Backend::Cpu {
            return Err(Failure::refused("a study compares methods on the processor; use --backend cpu"));
        }
        let watch = Watch::new(console)?;
        let study = study(&pipeline, &settings, &watch)?;
        console.result(&study.markdown())?;
        for file in &study.files {
            console.tell(&format!("written: {}", file.display()));
        }
        Ok(Outcome::Done)
    }
}
