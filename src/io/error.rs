//! What goes wrong when files are written.

use std::io;
use std::path::PathBuf;

/// A file could not be written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The operating system refuses, and for which file.
    #[error("{}: cannot {action}: {}", path.display(), explain(cause))]
    File {
        /// The file or folder.
        path: PathBuf,
        /// What was tried.
        action: &'static str,
        /// The system's reason.
        cause: io::Error,
    },
    /// Writing fails.
    #[error("writing failed: {}", explain(.0))]
    Write(io::Error),
    /// More bytes than the disk has left.
    #[error("{}: {needed} bytes are to be written, and the disk has {free} left; free some, or write elsewhere", path.display())]
    NoSpace {
        /// Where they were to go.
        path: PathBuf,
        /// How many there are.
        needed: u64,
        /// How many fit.
        free: u64,
    },
    /// What is written does not fit what was announced.
    #[error("array `{array}`: {found} where {expected} was expected")]
    Shape {
        /// The array.
        array: String,
        /// What was handed over.
        found: String,
        /// What should have been.
        expected: String,
    },
    /// A name that cannot stand in a file.
    #[error("{what} {name:?} cannot be written to an XML file; use letters, digits and `_`")]
    Name {
        /// What has the name.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// The PNG encoder refuses.
    #[error("writing the picture failed: {0}")]
    Png(::png::EncodingError),
}

impl From<io::Error> for Error {
    // Not thiserror's `from`: the message has the reason already, and who prints causes as well would say it twice.
    fn from(cause: io::Error) -> Self {
        Error::Write(cause)
    }
}

impl From<::png::EncodingError> for Error {
    fn from(error: ::png::EncodingError) -> Self {
        match error {
            ::png::EncodingError::IoError(cause) => Error::Write(cause),
            error => Error::Png(error),
        }
    }
}

/// A system's reason, with a remedy where there is a plain one.
fn explain(cause: &io::Error) -> String {
    // Temporary files put their own names into the reason, of which nobody has heard; the kind says it in other words.
    let wrapped = cause.get_ref().is_some() && cause.kind() != io::ErrorKind::Other;
    let plain = io::Error::from(cause.kind());
    let cause = if wrapped { &plain } else { cause };
    match cause.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            format!("{cause}; free some space, or write elsewhere")
        }
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
            format!("{cause}; write to another folder, or change its permissions")
        }
        io::ErrorKind::NotADirectory | io::ErrorKind::AlreadyExists => {
            format!("{cause}; a file is in the way, so write to another folder")
        }
        _ => cause.to_string(),
    }
}
