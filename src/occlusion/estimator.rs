//! The one door to ambient occlusion: points in, values with their errors out.
//!
//! - Rays, a fixed number or until a target is met ([`Estimator::Sampled`]);
//! - the closed form ([`Estimator::Exact`]);
//! - the closed form where the view is simple and all is opaque, rays where it isn't ([`Estimator::Adaptive`]). Which of the two is decided
//!   by the scene alone, never by a ray, so the values have no bias. Where few simplices are to be seen there is the most
//!   to gain, as their silhouettes are long for what they cover, and points sent elsewhere say little about them;
//! - the algorithm as it was published ([`Estimator::AsPublished`]), whose errors are those of its rays, not of its
//!   deviations;
//! - the program as it was written ([`Estimator::AsProgrammed`]), for comparison.
//!
//! A new method is one more variant here, and one more arm in [`Estimator::estimate`].

use rayon::prelude::*;

use super::as_published::{AsProgrammed, AsPublished, Deviations, ProgramDeviations};
use super::error::Error;
use super::exact::{self, Budget};
use crate::accel::Tracer;
use crate::progress::{Cancelled, Progress};
use crate::trace::{Estimate, RayBackend, Sampling, ShadingPoint};

/// A view is simple if at most so many simplices rise above the horizon,
pub(super) const SIMPLE: usize = 64;

/// and cut each other into at most so many pieces: some milliseconds.
pub(super) const PIECES: Budget = Budget { cones: 8192 };

/// Points that a thread takes at once, where each may take milliseconds.
const BATCH: usize = 4;

/// How ambient occlusion is computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Estimator {
    /// By rays.
    Sampled(Sampling),
    /// In closed form where that is cheap, else by rays; always by rays if distances are limited, or light passes objects.
    Adaptive(Sampling),
    /// In closed form.
    Exact(Budget),
    /// The thesis's algorithm with these deviations from the truth, by random rays; the target isn't asked. The thesis has
    /// no values inside simplices; there plain rays stand in for its own.
    AsPublished(Sampling, Deviations),
    /// The thesis's program as it was written, with these deviations, by `samples` rays.
    AsProgrammed(Sampling, ProgramDeviations),
}

/// Values at points, in their order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Estimates {
    /// Ambient occlusion.
    pub values: Vec<f32>,
    /// The standard error of each, 0 where it is known, NaN where nobody asked for it.
    pub errors: Vec<f32>,
    /// Rays asked in all.
    pub rays: u64,
}

impl Estimates {
    /// The root mean square of the errors, of those values that were asked for.
    pub fn error(&self) -> f64 {
        let (mut squares, mut count) = (0.0, 0usize);
        for error in self.errors.iter().filter(|e| !e.is_nan()) {
            squares += f64::from(*error).powi(2);
            count += 1;
        }
        (squares / count.max(1) as f64).sqrt()
    }
}

impl Estimator {
    /// The values at these points, or at those where the mask is true. There they are the same bits with or without a
    /// mask; elsewhere the value is 1 and the error NaN. A vertex that belongs to no simplex has the value 1. The result
    /// is the same on any backend and any number of threads. Each point that is asked for is a step of `progress`.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if `progress` says so, soon, be it in the middle of a point; [`Error::OverBudget`] if the
    /// closed form is too expensive at some point; [`Error::Translucent`] if objects let light through and the method knows
    /// opaque ones only; [`Error::OpenCl`] if a device fails.
    ///
    /// # Panics
    /// If the mask has another length than the points.
    pub fn estimate<const D: usize>(
        &self,
        backend: &dyn RayBackend<D>,
        points: &[ShadingPoint<D>],
        mask: Option<&[bool]>,
        progress: &dyn Progress,
    ) -> Result<Estimates, Error> {
        assert!(
            mask.is_none_or(|mask| mask.len() == points.len()),
            "a mask says of each point whether it is asked for"
        );
        if backend.tracer().mesh().is_translucent() && !matches!(self, Self::Sampled(_) | Self::Adaptive(_)) {
            return Err(Error::Translucent);
        }
        // Rays of a device need the binary tree, closed forms do, and what the thesis did; those of the processor don't.
        match self {
            Self::Sampled(_) => backend.prepare()?,
            _ => backend.tracer().prepare(),
        }
        let order = spatial_order(backend.tracer(), points, mask);
        let asked: Vec<ShadingPoint<D>> = order.iter().map(|&i| points[i]).collect();
        let found = match *self {
            Self::Sampled(sampling) => backend.open_fractions(&asked, &sampling, progress)?,
            Self::Adaptive(sampling) => adaptive(backend, &asked, &sampling, progress)?,
            Self::Exact(budget) => in_closed_form(backend.tracer(), &asked, budget, progress)
                .map_err(|error| error.numbered(|place| order[place]))?,
            Self::AsPublished(sampling, deviations) => {
                let published = AsPublished::new(backend.tracer(), deviations);
                of_the_thesis(backend, &asked, &sampling, progress, |v| published.at_vertex(v, &sampling, progress))?
            }
            Self::AsProgrammed(sampling, deviations) => {
                let programmed = AsProgrammed::new(backend.tracer(), deviations);
                of_the_thesis(backend, &asked, &sampling, progress, |v| programmed.at_vertex(v, &sampling, progress))?
            }
        };
        let count = points.len();
        let mut estimates = Estimates { values: vec![1.0; count], errors: vec![f32::NAN; count], rays: 0 };
        for (&i, estimate) in order.iter().zip(found) {
            estimates.values[i] = estimate.value;
            estimates.errors[i] = estimate.error;
            estimates.rays += u64::from(estimate.rays);
        }
        Ok(estimates)
    }
}

/// The places of the points that are asked for, those that are close in the hierarchy close to each other: then the nodes
/// that one of them needs are still in the cache for the next.
pub(super) fn spatial_order<const D: usize>(
    tracer: &Tracer<D>,
    points: &[ShadingPoint<D>],
    mask: Option<&[bool]>,
) -> Vec<usize> {
    let places = tracer.places();
    let place = |i: usize| match points[i] {
        ShadingPoint::Vertex(vertex) => places.of_vertex(vertex),
        ShadingPoint::Inside { simplex, .. } => places.of_simplex(simplex),
    };
    let asked = (0..points.len()).into_par_iter().filter(|&i| mask.is_none_or(|mask| mask[i]));
    let mut order: Vec<(u32, usize)> = asked.map(|i| (place(i), i)).collect();
    order.par_sort_unstable();
    order.into_iter().map(|(_, i)| i).collect()
}

/// In closed form where that is cheap, the rest by rays.
fn adaptive<const D: usize>(
    backend: &dyn RayBackend<D>,
    points: &[ShadingPoint<D>],
    sampling: &Sampling,
    progress: &dyn Progress,
) -> Result<Vec<Estimate>, Error> {
    if sampling.max_distance != f32::INFINITY || backend.tracer().mesh().is_translucent() {
        return Ok(backend.open_fractions(points, sampling, progress)?);
    }
    let closed = |point: &ShadingPoint<D>| {
        let known = exact::value_if_simple(backend.tracer(), point, SIMPLE, PIECES, progress)?;
        progress.advance(u64::from(known.is_some()));
        Ok(known)
    };
    let known: Vec<Option<f64>> = points.par_iter().with_max_len(BATCH).map(closed).collect::<Result<_, Error>>()?;
    let rest: Vec<ShadingPoint<D>> =
        points.iter().zip(&known).filter(|(_, known)| known.is_none()).map(|(point, _)| *point).collect();
    let mut rest = backend.open_fractions(&rest, sampling, progress)?.into_iter();
    Ok(known.into_iter().filter_map(|known| known.map(Estimate::known).or_else(|| rest.next())).collect())
}

/// All in closed form.
fn in_closed_form<const D: usize>(
    tracer: &Tracer<D>,
    points: &[ShadingPoint<D>],
    budget: Budget,
    progress: &dyn Progress,
) -> Result<Vec<Estimate>, Error> {
    let value = |(place, point): (usize, &ShadingPoint<D>)| {
        let value = exact::value(tracer, point, budget, progress).map_err(|stopped| match stopped {
            exact::Stopped::Cancelled => Error::Cancelled,
            exact::Stopped::OverBudget(source) => Error::OverBudget { point: place, place: name(point), source },
        })?;
        progress.advance(1);
        Ok(Estimate::known(value))
    };
    points.par_iter().enumerate().with_max_len(1).map(value).collect()
}

/// What a point is called if whoever asks has no better name.
pub(super) fn name<const D: usize>(point: &ShadingPoint<D>) -> String {
    match point {
        ShadingPoint::Vertex(vertex) => format!("vertex {vertex}"),
        ShadingPoint::Inside { simplex, .. } => format!("a point of simplex {simplex}"),
    }
}

/// What the thesis has at vertices, plain rays inside simplices.
fn of_the_thesis<const D: usize>(
    backend: &dyn RayBackend<D>,
    points: &[ShadingPoint<D>],
    sampling: &Sampling,
    progress: &dyn Progress,
    at_vertex: impl Fn(u32) -> Result<f32, Cancelled> + Sync,
) -> Result<Vec<Estimate>, Error> {
    let is_vertex = |point: &ShadingPoint<D>| matches!(point, ShadingPoint::Vertex(_));
    let inside: Vec<ShadingPoint<D>> = points.iter().filter(|point| !is_vertex(point)).copied().collect();
    let inside = backend.open_fractions(&inside, &Sampling { target: None, ..*sampling }, progress)?;
    let value = |point: &ShadingPoint<D>| match *point {
        ShadingPoint::Inside { .. } => Ok(None),
        ShadingPoint::Vertex(vertex) => {
            let value = at_vertex(vertex)?;
            progress.advance(1);
            Ok(Some(Estimate::independent(value, sampling.samples)))
        }
    };
    let found: Vec<Option<Estimate>> = points.par_iter().map(value).collect::<Result<_, Error>>()?;
    let mut inside = inside.into_iter();
    Ok(found.into_iter().filter_map(|found| found.or_else(|| inside.next())).collect())
}
