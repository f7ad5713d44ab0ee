//! What can be wrong with a stage, and what can go wrong when it runs.

use crate::io;
use crate::occlusion::{self, Cancelled};
use crate::render::CameraError;
use crate::trace::{self, opencl};

/// A complaint about the value at a path, raised by a check that knows no lines; whoever holds the text finds the line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{path}: {message}")]
pub struct Invalid {
    /// The dotted path, such as `stages[1].render.dimensions[0]`.
    pub path: String,
    /// What is wrong, what was expected, what to do.
    pub message: String,
}

impl Invalid {
    /// About the value at `path`.
    pub fn new(path: impl Into<String>, message: impl Into<String>) -> Self {
        Invalid { path: path.into(), message: message.into() }
    }
}

/// A stage that didn't succeed.
#[derive(Debug, thiserror::Error)]
pub enum StageError {
    /// Ctrl-C.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// There are no values of ambient occlusion.
    #[error("ambient occlusion: {0}")]
    Occlusion(occlusion::Error),
    /// The OpenCL device fails, or there is none.
    #[error(transparent)]
    OpenCl(#[from] opencl::Error),
    /// A file can't be written.
    #[error(transparent)]
    Write(#[from] io::Error),
    /// An object can't be where a motion leads it, or an input that was right when it was read first is so no longer.
    #[error(transparent)]
    Invalid(#[from] Invalid),
    /// Rounding left a camera without a frame.
    #[error("a camera can't be placed")]
    Camera(#[from] CameraError),
}

impl From<occlusion::Error> for StageError {
    fn from(error: occlusion::Error) -> Self {
        match error {
            occlusion::Error::Cancelled => Self::Cancelled(Cancelled),
            occlusion::Error::OpenCl(error) => Self::OpenCl(error),
            error => Self::Occlusion(error),
        }
    }
}

impl From<trace::Error> for StageError {
    fn from(error: trace::Error) -> Self {
        occlusion::Error::from(error).into()
    }
}
