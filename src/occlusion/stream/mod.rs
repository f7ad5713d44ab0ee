//! Ambient occlusion at full speed: all rays of a shading point as one stream.
//!
//! What a ray hits is defined by exact signs ([`crate::geometry::Cone`]); the slow way to ask is
//! [`super::ambient_occlusion`], ray by ray. This engine gives the same values, bit for bit, by filters in `f32`, eight
//! lanes wide, whose rounding is bounded; what they can't decide goes to the exact cone.
//!
//! - [`lanes`]: eight numbers side by side, for each [`Level`] of instructions;
//! - [`directions`]: the rays of a shading point, 64 at a time;
//! - [`fold`]: what the simplices around a vertex hide;
//! - [`traverse`]: the rays through the [`crate::accel::WideBvh`];
//! - [`leaves`]: the rays against the simplices of a leaf;
//! - [`cones`]: eight simplices as cones seen from the shading point.

mod cones;
mod directions;
mod fold;
mod lanes;
mod leaves;
mod question;
mod traverse;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use lanes::Level;

use directions::{BLOCK, Rays};
use fold::Fold;
use lanes::{Lanes, Portable};
use question::Question;
use traverse::Traversal;

use super::estimate::Tally;
use super::{Estimate, Sampler, Sequence, Settings, Site, Target, estimate_at};
use crate::accel::Tracer;
use crate::geometry::{Frame, Vector};
use crate::mesh::{Incidence, approach};

/// The working memory of one thread: 0.2 MB, to be used for many points.
#[derive(Debug)]
pub struct Stream<const D: usize> {
    level: Level,
    rays: Box<Rays<D>>,
    fold: Fold<D>,
    traversal: Traversal<D>,
}

/// Rays to be traced from one point.
enum Source<'a, const D: usize> {
    Sequence { sequence: Sequence, frame: Frame<D>, samples: u32, target: Option<Target> },
    Directions(&'a [Vector<D>]),
}

impl<const D: usize> Default for Stream<D> {
    fn default() -> Self {
        Self::new(Level::best())
    }
}

impl<const D: usize> Stream<D> {
    /// Working memory for the instructions of a level.
    ///
    /// # Panics
    /// If this processor lacks them.
    pub fn new(level: Level) -> Self {
        assert!(Level::available().contains(&level), "this processor lacks {level:?}");
        Self { level, rays: Box::new(Rays::new()), fold: Fold::new(), traversal: Traversal::new() }
    }

    /// The value at a vertex, as [`super::ambient_occlusion`] gives it for [`Site::at_vertex`].
    pub fn at_vertex(&mut self, tracer: &Tracer<D>, incidence: &Incidence, settings: &Settings, vertex: u32) -> f32 {
        self.estimate_at_vertex(tracer, incidence, settings, None, vertex).value
    }

    /// The value at a vertex and its error, as [`super::estimate_at`] gives them for [`Site::at_vertex`].
    pub fn estimate_at_vertex(
        &mut self,
        tracer: &Tracer<D>,
        incidence: &Incidence,
        settings: &Settings,
        target: Option<Target>,
        vertex: u32,
    ) -> Estimate {
        let mesh = tracer.mesh();
        let (position, normal) = (mesh.vertices[vertex as usize], mesh.normals[vertex as usize]);
        if normal.amax() == 0.0 {
            return Estimate::known(1.0);
        }
        if !tracer.wide().serves(&position) {
            let site = Site::at_vertex(tracer, incidence, vertex);
            return estimate_at(tracer, &site, settings, target, u64::from(vertex));
        }
        let question = Question::new(tracer, position, normal, settings.max_distance, None);
        let source = Source::Sequence {
            sequence: Sequence::new(settings.sampler, settings.seed, u64::from(vertex)),
            frame: Frame::new(&normal),
            samples: settings.samples,
            target,
        };
        let identity = mesh.identity[vertex as usize];
        let around = incidence.around(identity);
        let ways = [normal, approach(mesh, around, vertex)];
        self.traced(&question, Some((ways, identity)), around, source).estimate()
    }

    /// How many of the rays from a point in these directions, none longer than 1, hit a simplex other than `ignored`
    /// within `limit`; as [`Tracer::occluded`] tells ray by ray. If the directions are those of a hemisphere, its
    /// middle as `normal` saves work; else it may be zero.
    pub fn count_occluded(
        &mut self,
        tracer: &Tracer<D>,
        origin: &Vector<D>,
        normal: Vector<D>,
        directions: &[Vector<D>],
        limit: f32,
        ignored: Option<u32>,
    ) -> u32 {
        if !tracer.wide().serves(origin) {
            let rays = directions.iter().map(|d| crate::geometry::Ray::new(*origin, *d));
            return rays.filter(|ray| tracer.occluded(ray, limit, ignored)).count() as u32;
        }
        // Left out only if all rays surely are on its side.
        let on_side = directions.iter().all(|d| d.dot(&normal) > 1e-5);
        let normal = if on_side { normal } else { Vector::zeros() };
        let question = Question::new(tracer, *origin, normal, limit, ignored);
        let tally = self.traced(&question, None, &[], Source::Directions(directions));
        tally.rays() - tally.escaped()
    }

    /// Chooses the code compiled for the level.
    fn traced(
        &mut self,
        question: &Question<D>,
        vertex: Option<([Vector<D>; 2], u32)>,
        around: &[u32],
        source: Source<D>,
    ) -> Tally {
        match self.level {
            Level::Portable => traced::<Portable, D>(self, question, vertex, around, source),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `new` has checked that the processor has these instructions.
            Level::Avx2 => unsafe { traced_avx2(self, question, vertex, around, source) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            Level::Avx512 => unsafe { traced_avx512(self, question, vertex, around, source) },
            #[cfg(not(target_arch = "x86_64"))]
            _ => traced::<Portable, D>(self, question, vertex, around, source),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn traced_avx2<const D: usize>(
    stream: &mut Stream<D>,
    question: &Question<D>,
    vertex: Option<([Vector<D>; 2], u32)>,
    around: &[u32],
    source: Source<D>,
) -> Tally {
    traced::<x86::Avx2, D>(stream, question, vertex, around, source)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq,avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn traced_avx512<const D: usize>(
    stream: &mut Stream<D>,
    question: &Question<D>,
    vertex: Option<([Vector<D>; 2], u32)>,
    around: &[u32],
    source: Source<D>,
) -> Tally {
    traced::<x86::Avx512, D>(stream, question, vertex, around, source)
}

/// Counts the rays that escape. `vertex` is the normal, the approach and the identity of the vertex that the rays start
/// from, if it is one, and `around` the simplices that have it as a corner.
#[inline(always)]
fn traced<L: Lanes, const D: usize>(
    stream: &mut Stream<D>,
    question: &Question<D>,
    vertex: Option<([Vector<D>; 2], u32)>,
    around: &[u32],
    mut source: Source<D>,
) -> Tally {
    match vertex {
        Some((ways, identity)) => stream.fold.set::<L>(question, ways, identity, around),
        None => stream.fold.clear(),
    }
    let (total, sampler) = match &source {
        Source::Sequence { samples, sequence, .. } => (*samples as usize, sequence.sampler()),
        Source::Directions(directions) => (directions.len(), Sampler::Random),
    };
    let mut tally = Tally::new(sampler);
    for first in (0..total).step_by(BLOCK) {
        let count = BLOCK.min(total - first);
        match &mut source {
            Source::Sequence { sequence, frame, .. } => stream.rays.take(sequence, frame, count),
            Source::Directions(directions) => stream.rays.set(&directions[first..first + count]),
        }
        stream.rays.start_from(&question.centred);
        let alive = u64::MAX >> (BLOCK - count);
        let hidden = stream.fold.hidden::<L>(question, &stream.rays, around, alive);
        let hit = stream.traversal.blocked::<L>(question, &stream.rays, alive & !hidden);
        let open = alive & !(hidden | hit);
        tally.add(if tally.is_fine() { stream.rays.in_sequence(open) } else { open }, count as u32);
        if let Source::Sequence { target: Some(target), .. } = &source
            && target.is_met(&tally)
        {
            break;
        }
    }
    tally
}
