//! The ways to ambient occlusion behind one door: at all vertices, or at a visible point.
//!
//! - Rays, a fixed number or until a target is met ([`Method::Sampled`]);
//! - the closed form ([`Method::Exact`]);
//! - the closed form where the view is simple, rays where it isn't ([`Method::Adaptive`]). Which of the two is decided by
//!   the scene alone, never by a ray, so the values have no bias. Where few simplices are to be seen there is the most
//!   to gain, as their silhouettes are long for what they cover, and points sent elsewhere say little about them;
//! - the algorithm as it was published ([`Method::AsPublished`]), whose errors are those of its rays, not of its slips.

use super::exact::{self, Budget};
use super::opencl::{self, Point};
use super::vertices::{estimate_wanted, everywhere, spatial_order};
use super::{Error, Estimate, Estimates, Level, Settings, Site, Slips, Stream, Target, as_published, estimate_at};
use rayon::prelude::*;

use crate::accel::Tracer;
use crate::geometry::Vector;
use crate::mesh::Incidence;
use crate::progress::Progress;

/// A view is simple if at most so many simplices rise above the horizon,
const SIMPLE: usize = 64;

/// and cut each other into at most so many pieces: some milliseconds.
const PIECES: Budget = Budget { cones: 8192 };

/// Vertices between two looks at whether to go on, where some may take milliseconds.
const BATCH: usize = 4;

/// A way to ambient occlusion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// By `settings.samples` rays, or fewer if they meet the target.
    Sampled(Settings, Option<Target>),
    /// In closed form where that is cheap, else by rays; always by rays if distances are limited.
    Adaptive(Settings, Option<Target>),
    /// In closed form.
    Exact(Budget),
    /// The thesis's algorithm with these slips, by `settings.samples` rays.
    AsPublished(Settings, Slips),
}

impl Method {
    /// The value at every vertex.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if `progress` says so; [`Error::OverBudget`] if the closed form is too dear.
    pub fn at_vertices<const D: usize>(&self, tracer: &Tracer<D>, progress: &dyn Progress) -> Result<Estimates, Error> {
        self.at_wanted(tracer, None, progress)
    }

    /// [`Method::at_vertices`], but only at those that are wanted, if it is said which, one `bool` a vertex. There the
    /// values are the same bits; elsewhere they are 1, with errors of NaN where rays are used.
    ///
    /// # Errors
    /// Those of [`Method::at_vertices`].
    pub fn at_wanted<const D: usize>(
        &self,
        tracer: &Tracer<D>,
        wanted: Option<&[bool]>,
        progress: &dyn Progress,
    ) -> Result<Estimates, Error> {
        tracer.prepare();
        match *self {
            Self::Sampled(settings, target) => {
                Ok(estimate_wanted(Level::best(), tracer, &settings, target, wanted, progress)?)
            }
            Self::Adaptive(settings, target) => {
                let incidence = Incidence::new(tracer.mesh());
                let estimate =
                    |stream: &mut Stream<D>, vertex| adaptive(stream, tracer, &incidence, &settings, target, vertex);
                Ok(everywhere(tracer, BATCH, wanted, progress, Stream::default, estimate)?)
            }
            Self::Exact(budget) => {
                let values = exact::at_wanted(tracer, budget, wanted, progress)?;
                let errors = vec![0.0; values.len()];
                Ok(Estimates { values: values.into_iter().map(|v| v as f32).collect(), errors, rays: 0 })
            }
            Self::AsPublished(settings, slips) => {
                let values = as_published::at_wanted(tracer, slips, &settings, wanted, progress)?;
                let error = |(vertex, &value): (usize, &f32)| match wanted {
                    Some(wanted) if !wanted[vertex] => f32::NAN,
                    _ => Estimate::independent(value, settings.samples).error,
                };
                let errors = values.iter().enumerate().map(error).collect();
                let asked = wanted.map_or(values.len(), |wanted| wanted.iter().filter(|&&w| w).count());
                let rays = asked as u64 * u64::from(settings.samples);
                Ok(Estimates { values, errors, rays })
            }
        }
    }

    /// [`Method::at_wanted`] with the rays on an OpenCL device: the same bits. What takes no rays, or the published ones,
    /// stays on the processor.
    ///
    /// # Errors
    /// Those of [`Method::at_vertices`], and [`Error::OpenCl`].
    pub fn at_wanted_on<const D: usize>(
        &self,
        scene: &opencl::Scene<D>,
        wanted: Option<&[bool]>,
        progress: &dyn Progress,
    ) -> Result<Estimates, Error> {
        if matches!(self, Self::Exact(_) | Self::AsPublished(..)) {
            return self.at_wanted(scene.tracer(), wanted, progress);
        }
        let mut order = spatial_order(scene.tracer());
        let count = order.len();
        order.retain(|&vertex| wanted.is_none_or(|wanted| wanted[vertex as usize]));
        let points: Vec<Point<D>> = order.iter().map(|&vertex| Point::Vertex(vertex)).collect();
        let found = self.at_points_on(scene, &points, progress)?;
        let mut estimates = Estimates { values: vec![1.0; count], errors: vec![f32::NAN; count], rays: 0 };
        for (&vertex, estimate) in order.iter().zip(found) {
            estimates.values[vertex as usize] = estimate.value;
            estimates.errors[vertex as usize] = estimate.error;
            estimates.rays += u64::from(estimate.rays);
        }
        Ok(estimates)
    }

    /// Whether it asks rays at visible points, which an OpenCL device may trace.
    pub fn is_traced(&self) -> bool {
        !matches!(self, Self::Exact(_))
    }

    /// The values at points, with the rays on an OpenCL device; in closed form only where [`Method::Adaptive`] takes it. None of
    /// [`Method::Exact`], which asks no rays.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if `progress` says so, [`Error::OpenCl`] if a call fails.
    pub fn at_points_on<const D: usize>(
        &self,
        scene: &opencl::Scene<D>,
        points: &[Point<D>],
        progress: &dyn Progress,
    ) -> Result<Vec<Estimate>, Error> {
        let (settings, target, closed) = match *self {
            Self::Sampled(settings, target) => (settings, target, false),
            Self::Adaptive(settings, target) => (settings, target, settings.max_distance == f32::INFINITY),
            Self::AsPublished(settings, _) => (settings, None, false),
            Self::Exact(_) => return Ok(Vec::new()),
        };
        if !closed {
            return scene.estimate(points, &settings, target, progress);
        }
        let tracer = scene.tracer();
        let incidence = Incidence::new(tracer.mesh());
        let simple = |point: &Point<D>| {
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            Ok(match point {
                Point::Vertex(vertex) => exact::at_vertex_if_simple(tracer, &incidence, *vertex, SIMPLE, PIECES),
                Point::Inside { position, normal, simplex, .. } => {
                    exact::at_point_if_simple(tracer, position, normal, *simplex, SIMPLE, PIECES)
                }
            })
        };
        let known: Vec<Option<f64>> = points.par_iter().with_max_len(BATCH).map(simple).collect::<Result<_, _>>()?;
        progress.advance(known.iter().flatten().count() as u64);
        let rest: Vec<Point<D>> = points.iter().zip(&known).filter(|(_, k)| k.is_none()).map(|(p, _)| *p).collect();
        let mut rest = scene.estimate(&rest, &settings, target, progress)?.into_iter();
        Ok(known.into_iter().filter_map(|k| k.map(Estimate::known).or_else(|| rest.next())).collect())
    }

    /// The value at a visible point inside a simplex, on the side that its normal points to. `number` tells points
    /// apart, `place` names this one in errors. The thesis has no such values; plain rays stand in for its own.
    ///
    /// # Errors
    /// [`Error::OverBudget`] if the closed form is too dear.
    pub fn at_point<const D: usize>(
        &self,
        tracer: &Tracer<D>,
        position: &Vector<D>,
        normal: &Vector<D>,
        simplex: u32,
        number: u64,
        place: impl FnOnce() -> String,
    ) -> Result<Estimate, Error> {
        let sampled = |settings: &Settings, target| {
            let site = Site::inside_simplex(*position, *normal, simplex);
            estimate_at(tracer, &site, settings, target, number)
        };
        Ok(match self {
            Self::Sampled(settings, target) => sampled(settings, *target),
            Self::AsPublished(settings, _) => sampled(settings, None),
            Self::Adaptive(settings, target) => {
                let closed = || exact::at_point_if_simple(tracer, position, normal, simplex, SIMPLE, PIECES);
                let known = if settings.max_distance == f32::INFINITY { closed() } else { None };
                known.map_or_else(|| sampled(settings, *target), Estimate::known)
            }
            Self::Exact(budget) => Estimate::known(exact::at_point(tracer, position, normal, simplex, *budget, place)?),
        })
    }
}

/// The value at a vertex in closed form where that is cheap, else by rays.
pub fn adaptive<const D: usize>(
    stream: &mut Stream<D>,
    tracer: &Tracer<D>,
    incidence: &Incidence,
    settings: &Settings,
    target: Option<Target>,
    vertex: u32,
) -> Estimate {
    let unlimited = settings.max_distance == f32::INFINITY;
    let known = unlimited.then(|| exact::at_vertex_if_simple(tracer, incidence, vertex, SIMPLE, PIECES)).flatten();
    known.map_or_else(|| stream.estimate_at_vertex(tracer, incidence, settings, target, vertex), Estimate::known)
}

impl From<Settings> for Method {
    fn from(settings: Settings) -> Self {
        Self::Sampled(settings, None)
    }
}
