//! What can be wrong with a pipeline before it runs, each complaint with its place.

use crate::text::shortened;
use std::fmt;
use std::path::PathBuf;

/// Why a pipeline was refused. Whatever is in here can be found without running anything.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The file can't be opened or read.
    #[error("{}: cannot read the pipeline", path.display())]
    Read {
        /// The file as it was named.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file holds no text, or too much.
    #[error("{}: {message}", path.display())]
    NotText {
        /// The file as it was named.
        path: PathBuf,
        /// What it holds instead.
        message: String,
    },
    /// Something in it, or in an override, is wrong.
    #[error("{0}")]
    Refused(Box<Refusal>),
}

/// One complaint: where, about which key, and what.
#[derive(Clone, Debug, PartialEq)]
pub struct Refusal {
    /// Where it is written.
    pub place: Place,
    /// The dotted path, empty where the whole pipeline is meant.
    pub path: String,
    /// What is wrong, what was expected, what to do.
    pub message: String,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.place)?;
        if !self.path.is_empty() {
            write!(f, "{}: ", shortened(&self.path, LONGEST_QUOTE))?;
        }
        f.write_str(&shortened(&self.message, LONGEST_MESSAGE))
    }
}

/// Characters of an override, or of a path, that a message quotes.
const LONGEST_QUOTE: usize = 200;
/// Characters of what is wrong, which may quote what was written.
const LONGEST_MESSAGE: usize = 1000;

/// Where a value was written.
#[derive(Clone, Debug, PartialEq)]
pub enum Place {
    /// In the pipeline's file.
    File {
        /// The file as it was named.
        file: String,
        /// From 1.
        line: usize,
        /// In characters, from 1.
        column: usize,
    },
    /// In an override on the command line, quoted.
    Set(String),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::File { file, line, column } => write!(f, "{file}:{line}:{column}"),
            Place::Set(assignment) => match assignment.char_indices().nth(LONGEST_QUOTE) {
                Some((end, _)) => write!(f, "--set {}...", &assignment[..end]),
                None => write!(f, "--set {assignment}"),
            },
        }
    }
}
