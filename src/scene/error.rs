//! What can be wrong with an object of a scene.

use crate::io::InputError;

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
    /// Whoever watches wants no more of it.
    #[error("stopped")]
    Cancelled,
    /// A file that the object names can't be taken in.
    #[error(transparent)]
    Input(#[from] InputError),
}

impl Error {
    /// An [`Error::Invalid`].
    pub fn invalid(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self::Invalid { key: key.into(), message: message.into() }
    }

    /// The dotted path within the object of the key to blame; empty for the object itself.
    pub fn key(&self) -> &str {
        match self {
            Self::Invalid { key, .. } => key,
            Self::Cancelled => "",
            Self::Input(error) => error.key(),
        }
    }
}
