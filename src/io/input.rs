//! A file that a scene names, and what is said when it can't be taken in.

use std::path::{Path, PathBuf};

/// Characters of a message about a file.
const LONGEST_MESSAGE: usize = 500;

/// Why a file that something names can't be taken in.
#[derive(Debug, thiserror::Error)]
pub enum InputError {
    /// What is asked of the file can't be.
    #[error("{}{message}", if key.is_empty() { String::new() } else { format!("{key}: ") })]
    Invalid {
        /// Dotted path of the key to blame.
        key: String,
        /// What was found, and what to do about it.
        message: String,
    },
    /// The file can't be opened or read.
    #[error("{key}: can't read {}: {source}", path.display())]
    Unreadable {
        /// Dotted path of the key that names the file.
        key: String,
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file holds something else than it should.
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

impl InputError {
    /// An [`InputError::Invalid`].
    pub fn invalid(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self::Invalid { key: key.into(), message: message.into() }
    }

    /// The dotted path of the key to blame.
    pub fn key(&self) -> &str {
        match self {
            Self::Invalid { key, .. } | Self::Unreadable { key, .. } | Self::Content { key, .. } => key,
        }
    }
}

/// A file that an object names, and by which key.
#[derive(Clone, Debug)]
pub struct Input {
    pub(super) key: String,
    pub(super) path: PathBuf,
}

impl Input {
    /// The file `path`, relative to `folder`, that the key names.
    pub fn new(key: &str, folder: &Path, path: &Path) -> Self {
        Self { key: key.to_owned(), path: folder.join(path) }
    }

    /// The error that the file holds something wrong.
    pub fn wrong(&self, message: impl Into<String>) -> InputError {
        let mut message = message.into();
        // Some readers cite what is damaged at length.
        if let Some((end, _)) = message.char_indices().nth(LONGEST_MESSAGE) {
            message.truncate(end);
            message.push_str(" ...");
        }
        InputError::Content { key: self.key.clone(), path: self.path.clone(), message }
    }

    /// The error that the file can't be read.
    pub(super) fn unreadable(&self, source: std::io::Error) -> InputError {
        InputError::Unreadable { key: self.key.clone(), path: self.path.clone(), source }
    }
}
