//! The two questions that are asked of rays, and whoever answers them.

use std::fmt::Debug;
use std::sync::Arc;

use super::estimate::Estimate;
use super::opencl;
use super::point::ShadingPoint;
use super::sampling::Sampling;
use crate::accel::Tracer;
use crate::geometry::Ray;
use crate::progress::{Cancelled, Progress};

/// Stands for no simplex.
pub const NOTHING: u32 = u32::MAX;

/// Why there is no answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// The work was cancelled.
    #[error("interrupted")]
    Cancelled,
    /// OpenCL fails.
    #[error(transparent)]
    OpenCl(#[from] opencl::Error),
}

impl From<Cancelled> for Error {
    fn from(_: Cancelled) -> Self {
        Self::Cancelled
    }
}

/// Traces rays through one mesh. All backends give the same bits.
pub trait RayBackend<const D: usize>: Debug + Send + Sync {
    /// The mesh with its hierarchy, for questions about single simplices.
    fn tracer(&self) -> &Arc<Tracer<D>>;

    /// Makes what [`Self::open_fractions`] needs, on all threads, unless it is there.
    ///
    /// # Errors
    /// [`Error::OpenCl`] if a device fails.
    fn prepare(&self) -> Result<(), Error>;

    /// The simplex that each ray hits first, as [`Tracer::closest_hit`] tells, or [`NOTHING`]. With `after`, one simplex a
    /// ray, the first strictly behind the place where the ray hits that one, as [`Tracer::next_hit`] tells; where it is
    /// [`NOTHING`] the first of all.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if `progress` says so, [`Error::OpenCl`] if a device fails.
    ///
    /// # Panics
    /// If `after` has another length than `rays`.
    fn first_hits(&self, rays: &[Ray<D>], after: Option<&[u32]>, progress: &dyn Progress) -> Result<Vec<u32>, Error>;

    /// Ambient occlusion at each point, in their order: the share of its cosine-weighted rays that escape. Points that lie
    /// close together should stand close together. Each is a step of `progress`.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if `progress` says so, [`Error::OpenCl`] if a device fails.
    fn open_fractions(
        &self,
        points: &[ShadingPoint<D>],
        sampling: &Sampling,
        progress: &dyn Progress,
    ) -> Result<Vec<Estimate>, Error>;
}
