//! Why there are no values of ambient occlusion.

use super::exact::OverBudget;
use crate::progress::Cancelled;
use crate::trace::{self, opencl};

/// Why there are no values.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// The work was cancelled.
    #[error("interrupted")]
    Cancelled,
    /// The closed form would have too many pieces.
    #[error("{place}: exact occlusion is too expensive here: {source}")]
    OverBudget {
        /// Which of the points that were asked for, by its place among them.
        point: usize,
        /// What the user calls that point.
        place: String,
        /// How rich its view is.
        source: OverBudget,
    },
    /// The method knows opaque objects only.
    #[error("only rays know of objects that let light through; take the method `sobol`, or make all objects opaque")]
    Translucent,
    /// OpenCL fails.
    #[error(transparent)]
    OpenCl(#[from] opencl::Error),
}

impl Error {
    /// The same error where points have other places among all.
    pub(super) fn numbered(mut self, place: impl FnOnce(usize) -> usize) -> Self {
        if let Self::OverBudget { point, .. } = &mut self {
            *point = place(*point);
        }
        self
    }

    /// The same error where a point, known by its place among those that were asked for, has another name for the user:
    /// the voxel that shows it.
    #[must_use]
    pub fn placed(mut self, name: impl FnOnce(usize) -> String) -> Self {
        if let Self::OverBudget { point, place, .. } = &mut self {
            *place = name(*point);
        }
        self
    }
}

impl From<Cancelled> for Error {
    fn from(_: Cancelled) -> Self {
        Self::Cancelled
    }
}

impl From<trace::Error> for Error {
    fn from(error: trace::Error) -> Self {
        match error {
            trace::Error::Cancelled => Self::Cancelled,
            trace::Error::OpenCl(error) => Self::OpenCl(error),
        }
    }
}
