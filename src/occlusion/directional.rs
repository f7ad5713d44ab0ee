//! Ambient occlusion with directions: beside A the vector b, and the light that other surfaces send.
//!
//! A point under a sky whose light is linear in the direction, L(w) = 1 + g . w, gets
//!
//! ```text
//! 1/c_D * integral of V (1 + g . w) (w . n) dw = A + g . b
//! ```
//!
//! of it, exactly. So A and b are found once, and each sky is a dot product. b comes with A by rays, or in closed form
//! ([`super::exact::Hemisphere::directed`]). Its direction is the bent normal of renderers; A is the first moment of what is
//! open (order 0 in w), b the second.
//!
//! What hides the sky sends light too. One bounce is the mean over the same rays of the light that leaves what they hit,
//! which is known at vertices: the reflectance times A + g . b there.

use rayon::prelude::*;

use super::error::Error;
use super::estimator::{Estimates, Estimator, PIECES, SIMPLE, name, spatial_order};
use super::exact::{self, Stopped};
use crate::accel::Tracer;
use crate::geometry::{Dimension, Vector, Vector64, narrow};
use crate::progress::Progress;
use crate::trace::{Gathered, RayBackend, Sampling, ShadingPoint, gather};

/// The rays that a point sends for the light of other surfaces where its occlusion takes none.
const RAYS: u32 = 256;

/// Ambient occlusion and the vector b at points, in their order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Directional<const D: usize> {
    /// Ambient occlusion A: what [`Estimator::estimate`] finds.
    pub estimates: Estimates,
    /// The vector b of each point; zero where there is no normal.
    pub vectors: Vec<Vector<D>>,
    /// The light of other surfaces, if it was asked for.
    pub bounced: Option<Bounced>,
}

/// The light that other surfaces send to points, in their order: one bounce.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bounced {
    /// Red, green and blue, where that of an open sky is 1.
    pub light: Vec<[f32; 3]>,
    /// The standard error of each, of the channel where it is largest.
    pub errors: Vec<f32>,
    /// How many rays hit something.
    pub hits: u64,
    /// How many of them hit a surface from behind, and were told the light of its front.
    pub behind: u64,
}

/// What b is where all is open, around this unit normal: 2/3 of it in 3D, 3 pi/16 in 4D.
pub fn open_vector<const D: usize>(normal: &Vector64<D>) -> Vector64<D> {
    normal * Dimension::of::<D>().pick(2.0 / 3.0, 3.0 * std::f64::consts::PI / 16.0)
}

impl Estimator {
    /// The values at these points, with directions; and with the `radiosity` of all vertices the light of other surfaces.
    /// Values and vectors are the same with it or without, and on any number of threads. Of the thesis's methods, which
    /// know no directions, these are those of plain rays. Each point is a step of `progress`.
    ///
    /// # Errors
    /// As [`Estimator::estimate`].
    ///
    /// # Panics
    /// If there are fewer radiosities than vertices.
    pub fn directional<const D: usize>(
        &self,
        backend: &dyn RayBackend<D>,
        points: &[ShadingPoint<D>],
        radiosity: Option<&[[f32; 3]]>,
        progress: &dyn Progress,
    ) -> Result<Directional<D>, Error> {
        let tracer = backend.tracer();
        match self {
            Self::Sampled(_) => tracer.prepare_wide(),
            _ => tracer.prepare(),
        }
        let order = spatial_order(tracer, points, None);
        let asked: Vec<ShadingPoint<D>> = order.iter().map(|&i| points[i]).collect();
        let known = self
            .in_closed_form(tracer, &asked, radiosity.is_none(), progress)
            .map_err(|e| e.numbered(|place| order[place]))?;
        let by_rays: Vec<usize> = (0..asked.len()).filter(|&i| radiosity.is_some() || known[i].is_none()).collect();
        let asked: Vec<ShadingPoint<D>> = by_rays.iter().map(|&i| asked[i]).collect();
        let gathered = gather(tracer, &asked, &self.rays(), radiosity, progress)?;
        let count = points.len();
        let mut found = Directional {
            estimates: Estimates { values: vec![1.0; count], errors: vec![0.0; count], rays: 0 },
            vectors: vec![Vector::zeros(); count],
            bounced: radiosity.map(|_| Bounced::nothing(count)),
        };
        for (&i, known) in order.iter().zip(&known) {
            if let Some((value, vector)) = known {
                (found.estimates.values[i], found.vectors[i]) = (*value as f32, narrow(vector));
            }
        }
        for (&place, gathered) in by_rays.iter().zip(&gathered) {
            let i = order[place];
            found.estimates.rays += u64::from(gathered.open.rays);
            if known[place].is_none() {
                (found.estimates.values[i], found.estimates.errors[i]) = (gathered.open.value, gathered.open.error);
                found.vectors[i] = narrow(&gathered.vector);
            }
            if let Some(bounced) = &mut found.bounced {
                let value = f64::from(found.estimates.values[i]);
                bounced.set(i, gathered, known[place].map(|_| value));
            }
        }
        Ok(found)
    }

    /// The light of other surfaces alone, of which the vertices have this `radiosity`, at points whose occlusion is known
    /// already.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if `progress` says so.
    ///
    /// # Panics
    /// If there are fewer radiosities than vertices.
    pub fn bounced<const D: usize>(
        &self,
        tracer: &Tracer<D>,
        points: &[ShadingPoint<D>],
        occlusion: &Estimates,
        radiosity: &[[f32; 3]],
        progress: &dyn Progress,
    ) -> Result<Bounced, Error> {
        tracer.prepare();
        let order = spatial_order(tracer, points, None);
        let asked: Vec<ShadingPoint<D>> = order.iter().map(|&i| points[i]).collect();
        let gathered = gather(tracer, &asked, &self.rays(), Some(radiosity), progress)?;
        let mut found = Bounced::nothing(points.len());
        for (&i, gathered) in order.iter().zip(&gathered) {
            let is_exact = occlusion.errors.get(i) == Some(&0.0);
            found.set(i, gathered, occlusion.values.get(i).filter(|_| is_exact).map(|&value| f64::from(value)));
        }
        Ok(found)
    }

    /// The rays it sends, or, where it sends none, those that other surfaces are looked for with.
    fn rays(&self) -> Sampling {
        match *self {
            Self::Sampled(sampling) | Self::Adaptive(sampling) => sampling,
            Self::Exact(_) => Sampling::new(RAYS, 0),
            Self::AsPublished(sampling, _) | Self::AsProgrammed(sampling, _) => Sampling { target: None, ..sampling },
        }
    }

    /// The values and vectors that are known in closed form; if it `counts`, each is a step of `progress`.
    #[allow(clippy::type_complexity)]
    fn in_closed_form<const D: usize>(
        &self,
        tracer: &Tracer<D>,
        points: &[ShadingPoint<D>],
        counts: bool,
        progress: &dyn Progress,
    ) -> Result<Vec<Option<(f64, Vector64<D>)>>, Error> {
        let (most, budget) = match *self {
            Self::Exact(budget) => (usize::MAX, budget),
            Self::Adaptive(sampling) if sampling.max_distance == f32::INFINITY => (SIMPLE, PIECES),
            _ => return Ok(vec![None; points.len()]),
        };
        let value =
            |(place, point): (usize, &ShadingPoint<D>)| match exact::directed(tracer, point, most, budget, progress) {
                Ok(found) => {
                    progress.advance(u64::from(counts && found.is_some()));
                    Ok(found)
                }
                Err(Stopped::Cancelled) => Err(Error::Cancelled),
                // One that is simple in number only is left to rays.
                Err(Stopped::OverBudget(_)) if most == SIMPLE => Ok(None),
                Err(Stopped::OverBudget(source)) => Err(Error::OverBudget { point: place, place: name(point), source }),
            };
        points.par_iter().enumerate().with_max_len(1).map(value).collect()
    }
}

impl Bounced {
    fn nothing(count: usize) -> Self {
        Self { light: vec![[0.0; 3]; count], errors: vec![0.0; count], hits: 0, behind: 0 }
    }

    /// Where occlusion is known exactly, the rays tell only how bright what they hit is, not how much of it there is.
    fn set<const D: usize>(&mut self, i: usize, gathered: &Gathered<D>, occlusion: Option<f64>) {
        let hidden = f64::from(gathered.hits) / f64::from(gathered.open.rays.max(1));
        let share = occlusion.filter(|_| hidden > 0.0).map_or(1.0, |open| (1.0 - open) / hidden);
        self.light[i] = gathered.bounced.map(|c| (c * share) as f32);
        self.errors[i] = (gathered.bounced_error * share) as f32;
        self.hits += u64::from(gathered.hits);
        self.behind += u64::from(gathered.behind);
    }
}
