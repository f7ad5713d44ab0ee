//! From YAML to work: what a user wrote is read, checked and resolved before anything runs.
//!
//! Two types stand for the two halves. [`spec`] is the pipeline as written: keys and values, nothing looked up.
//! [`plan`] is the pipeline as understood: every stage knows by index what it works on, every default is filled in,
//! every range checked, every file named once. The way from one to the other refuses whatever can be refused without
//! running, with file, line and the nearest right word, so that `ao4d check` and `ao4d run` refuse the same things.
//!
//! ```text
//! text --yaml--> tree --overrides--> tree --serde--> spec --plan--> Plan
//!                  \________________ lines _________________/
//! ```

mod build;
mod cache;
mod cut;
mod document;
mod error;
mod figure;
mod files;
mod limits;
mod occlude;
mod one_or_many;
pub mod overrides;
pub mod plan;
mod prepare;
mod report;
mod run;
mod schema;
mod settings;
pub mod spec;
mod study;
mod suggest;
mod work;
mod yaml;

use std::path::{Path, PathBuf};

pub use build::{AnyMesh, camera};
pub use cut::{Axis, Cut, Plane};
pub use document::Document;
pub use error::{Error, Invalid, Place, Refusal};
pub use one_or_many::OneOrMany;
pub use plan::Plan;
pub use prepare::{Loaded, Prepared};
pub use report::{FileReport, Report, StageTime};
pub use run::{RunError, run};
pub use schema::schema;
pub use settings::{Backend, BackendError, Settings};
pub use study::{Study, study};

/// A plan, and the text it was made from, which later complaints cite.
#[derive(Clone, Debug)]
pub struct Pipeline {
    /// What is to be done.
    pub plan: Plan,
    /// Where it is written.
    pub document: Document,
}

impl Pipeline {
    /// Reads a pipeline's file, applies overrides (`KEY=VALUE`), checks and resolves. `out` is where its files are to
    /// go, `out/NAME` by default.
    pub fn load(path: &Path, overrides: &[String], out: Option<PathBuf>) -> Result<Self, Error> {
        Self::from_document(Document::read(path)?, overrides, out)
    }

    /// The same, from a text that was read already.
    pub fn from_document(mut document: Document, overrides: &[String], out: Option<PathBuf>) -> Result<Self, Error> {
        for assignment in overrides {
            document.set(assignment)?;
        }
        let spec: spec::PipelineSpec = document.decode()?;
        let plan = Plan::new(&spec, document.folder(), out).map_err(|invalid| document.refuse(invalid))?;
        Ok(Pipeline { plan, document })
    }

    /// What is allowed but probably not meant, each with its place.
    pub fn warnings(&self) -> impl Iterator<Item = Error> {
        self.plan.warnings.iter().map(|warning| self.document.refuse(warning.clone()))
    }
}
