//! What can be wrong with an object of a scene.

use std::path::PathBuf;

/// An object that can't be built.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A key of the object holds something that can't be.
    #[error("{}{message}", if key.is_empty() { String::new() } else { format!("{key}: ") })]
    Invalid {
        /// Dotted path within the object, `extrude.from` or `transform.2.rotate.plane`; empty for the object itself.
        key: String,
        /// What was found, and what to do about it.
        message: String,
    },
    /// A file that the object names can't be opened or read.
    #[error("{key}: can't read {}: {source}", path.display())]
    Unreadable {
        /// Dotted path of the key that names the file.
        key: String,
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file that the object names holds something else than it should.
    #[error("{key}: {}: {message}", path.display())]
    Content {
        /// Dotted path of the key that names the file.
        key: String,
        /// The file.
        path: PathBuf,
        /// What was found, and what to do about it.
        message: String,
    },
}

impl Error {
    /// An [`Error::Invalid`].
    pub fn invalid(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self::Invalid { key: key.into(), message: message.into() }
    }

    /// The dotted path within the object of the key to blame; empty for the object itself.
    pub fn key(&self) -> &str {
        match self {
            Self::Invalid { key, .. } | Self::Unreadable { key, .. } | Self::Content { key, .. } => key,
        }
    }
}
