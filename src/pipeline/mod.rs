//! From YAML to work: what a user wrote is read, checked and resolved before anything runs.
//!
//! Two types stand for the two halves. [`spec`] is the pipeline as written: keys and values, nothing looked up.
//! [`Plan`] is the pipeline as understood: every stage knows by index what it works on, every default is filled in,
//! every range checked, every file named once. The way from one to the other refuses whatever can be refused without
//! running, with file, line and the nearest right word, so that `ao4d check` and `ao4d run` refuse the same things.
//!
//! ```text
//! text --yaml--> tree --overrides--> tree --serde--> spec --plan--> Plan
//!                  \________________ lines _________________/
//! ```

mod book;
mod cache;
mod compose;
mod document;
mod error;
mod guard;
mod launcher;
mod lock;
pub mod overrides;
mod pieces;
mod pool;
mod provenance;
mod report;
mod run;
mod schema;
mod settings;
mod share;
pub mod spec;
mod study;
mod yaml;

use std::path::{Path, PathBuf};

use crate::mesh::Mesh;
use crate::progress::{Progress, Silent};
use crate::stages::fit::{Fitted, Points};
use crate::stages::prepare::Prepared;
use crate::stages::write::PROGRAM;
use crate::stages::{Invalid, Piece, Plan, suggest};

pub use crate::stages::suggest::unknown as unknown_word;
pub use document::{Document, STDIN};
pub use error::{Error, Place, Refusal};
pub use launcher::Launched;
pub use pieces::PiecesError;
pub use provenance::Told;
pub use report::{FileReport, Report, StageTime};
pub use run::{RunError, merge, run, run_sharing};
pub use schema::schema;
pub use settings::{Backend, BackendError, Settings};
pub use share::Shared;
pub use study::{Study, study};

/// A plan, and the text it was made from, which later complaints cite.
#[derive(Clone, Debug)]
pub struct Pipeline {
    /// What is to be done.
    pub plan: Plan,
    /// Where it is written.
    pub document: Document,
    /// What its inputs must be, where that is written.
    pub inputs: Vec<spec::InputSpec>,
}

impl Pipeline {
    /// Reads a pipeline's file, applies overrides (`KEY=VALUE`), checks and resolves. `out` is where its files are to
    /// go, `out/NAME` by default.
    pub fn load(path: &Path, overrides: &[String], out: Option<PathBuf>) -> Result<Self, Error> {
        Self::from_document(Document::read(path)?, overrides, out)
    }

    /// The same for a document that may have a `sweep`: the pipelines that it makes, in order. With `out` those of a sweep go into
    /// folders within it.
    ///
    /// # Errors
    /// Whatever is wrong with one.
    pub fn swept(document: Document, overrides: &[String], out: Option<PathBuf>) -> Result<Vec<Self>, Error> {
        let place = |document: &Document| {
            let inner =
                |out: &PathBuf| if document.swept().is_empty() { out.clone() } else { out.join(document.swept()) };
            out.as_ref().map(inner)
        };
        let documents = Self::documents(document, overrides)?;
        documents
            .into_iter()
            .map(|document| (place(&document), document))
            .map(|(out, d)| Self::resolve(d, out))
            .collect()
    }

    /// A document with overrides, and all the pipelines that it stands for.
    fn documents(mut document: Document, overrides: &[String]) -> Result<Vec<Document>, Error> {
        for assignment in overrides {
            document.set(assignment)?;
        }
        document.expand()
    }

    /// The same, from a text that was read already.
    ///
    /// # Errors
    /// Whatever is wrong with it; a `sweep`, which makes several ([`Pipeline::swept`]).
    pub fn from_document(document: Document, overrides: &[String], out: Option<PathBuf>) -> Result<Self, Error> {
        let mut documents = Self::documents(document, overrides)?;
        match (documents.pop(), documents.len()) {
            (Some(document), 0) => Self::resolve(document, out),
            (Some(document), more) => {
                let message = format!("makes {} pipelines, and one is expected; take it out by --set sweep=", more + 1);
                Err(document.refuse(Invalid::new("sweep", message)))
            }
            (None, _) => unreachable!("a document stands for a pipeline at least"),
        }
    }

    /// A pipeline of a scene that is in memory: what the text says of its scene stands for this mesh, which cameras fit.
    ///
    /// # Errors
    /// Whatever is wrong with it.
    pub fn around<const D: usize>(document: Document, mesh: &Mesh<D>) -> Result<Self, Error> {
        Self::resolve_with(document, None, vec![Points::of_mesh(mesh)])
    }

    fn resolve(document: Document, out: Option<PathBuf>) -> Result<Self, Error> {
        Self::resolve_with(document, out, Vec::new())
    }

    /// Understands a document of whose scenes the first are `known`.
    fn resolve_with(mut document: Document, out: Option<PathBuf>, known: Vec<Points>) -> Result<Self, Error> {
        let (spec, mut plan) = Self::understood(&document, out.clone())?;
        let fitted = plan.fit(known, &Silent).map_err(|invalid| document.refuse(invalid))?;
        if !fitted.is_empty() {
            fitted.iter().for_each(|Fitted { path, camera }| document.put(path, camera));
            // What there is to say of it was said of what was written.
            let warnings = std::mem::take(&mut plan.warnings);
            plan = Plan { warnings, ..Self::understood(&document, out)?.1 };
        }
        if let Some(program) = spec.program.filter(|program| program != PROGRAM) {
            let message = format!("was written by {program}, and this is {PROGRAM}, whose files may be others");
            plan.warnings.push(Invalid::new("program", message));
        }
        Ok(Pipeline { plan, document, inputs: spec.inputs.unwrap_or_default() })
    }

    /// What a document says, and what it means.
    fn understood(document: &Document, out: Option<PathBuf>) -> Result<(spec::PipelineSpec, Plan), Error> {
        let spec: spec::PipelineSpec = document.decode()?;
        let folder = spec.folder.iter().fold(document.folder(), |base, folder| base.join(folder));
        let plan = Plan::new(&spec.name, spec.seed.unwrap_or(0), &spec.stages, folder, out);
        Ok((spec, plan.map_err(|invalid| document.refuse(invalid))?))
    }

    /// Builds the scenes for which `wanted` says so, and reads the occlusion files that are loaded into them and wanted
    /// too; both by their places in the plan.
    ///
    /// # Errors
    /// Whatever is wrong with an object or a file, with the line that asked for it.
    pub fn prepare(&self, wanted: impl Fn(usize) -> bool) -> Result<Prepared, Error> {
        self.prepare_watched(wanted, &Silent)
    }

    /// The same, and ends soon after `progress` says to stop; what it returns then is of no use.
    ///
    /// # Errors
    /// As [`Pipeline::prepare`].
    pub fn prepare_watched(&self, wanted: impl Fn(usize) -> bool, progress: &dyn Progress) -> Result<Prepared, Error> {
        guard::check(self)?;
        provenance::check(self)?;
        self.plan.prepare(wanted, progress).map_err(|invalid| self.document.refuse(invalid))
    }

    /// The same pipeline for a piece of its run, which works in a folder of its own.
    pub fn in_piece(&self, piece: Piece) -> Self {
        Self { plan: self.plan.in_piece(piece), ..self.clone() }
    }

    /// What is allowed but probably not meant, each with its place.
    pub fn warnings(&self) -> impl Iterator<Item = Error> {
        self.plan.warnings.iter().map(|warning| self.document.refuse(warning.clone()))
    }
}
