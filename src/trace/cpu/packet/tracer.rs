//! The tracer itself: point after point, 64 rays at a time.

use super::directions::Rays;
use super::lanes::{Lanes, Portable};
use super::level::Level;
#[cfg(target_arch = "x86_64")]
use super::level::{with_avx2, with_avx512};
use super::nets::{BLOCK, Net};
use super::query::Query;
use super::star::VertexStar;
use super::tally::{Tally, Visits};
use super::traverse::Traversal;
#[cfg(target_arch = "x86_64")]
use super::x86::{Avx2, Avx512};
use crate::accel::Tracer;
use crate::geometry::{Dimension, Frame, Ray, Vector};
use crate::mesh::approach;
use crate::progress::{Cancelled, Progress, Silent};
use crate::trace::cpu::scalar::{estimate_at, watched_at};
use crate::trace::estimate::{Accumulator, Estimate, Watch};
use crate::trace::groups::LEAST;
use crate::trace::sampling::LOWEST_SQUARED_COSINE;
use crate::trace::{Sampler, Sampling, Sequence, ShadingPoint, Target};

/// Blocks of rays between two looks at whether to go on: a few milliseconds.
const BLOCKS_BETWEEN_LOOKS: usize = 64;

/// What the rays of a hemisphere rise at least, as a share of their length: a little less than the lowest cosine.
const RISE: f32 = 9e-4;
const _: () = assert!(RISE * RISE < 0.9 * LOWEST_SQUARED_COSINE);

/// The working memory of one thread: 0.1 MB, to be used for many points.
#[derive(Debug)]
pub struct PacketTracer<const D: usize> {
    level: Level,
    rays: Box<Rays<D>>,
    star: VertexStar<D>,
    traversal: Traversal<D>,
}

/// Rays to be traced from one point.
enum Source<'a, const D: usize> {
    Sequence { sequence: Sequence, frame: Frame<D>, samples: u32, target: Option<Target> },
    Directions(&'a [Vector<D>]),
}

/// The vertex that the rays start from, if they do.
struct AtVertex<'a, const D: usize> {
    /// Its normal, and from where it is approached.
    ways: [Vector<D>; 2],
    identity: u32,
    /// The simplices that have it as a corner.
    around: &'a [u32],
}

/// All that is asked at once.
struct Job<'a, 'w, T, const D: usize> {
    query: Query<'a, D>,
    vertex: Option<AtVertex<'a, D>>,
    source: Source<'a, D>,
    watch: Option<&'a mut Watch<'w, D>>,
    progress: &'a dyn Progress,
    tally: &'a mut T,
}

impl<const D: usize> Default for PacketTracer<D> {
    fn default() -> Self {
        Self::new(Level::best())
    }
}

impl<const D: usize> PacketTracer<D> {
    /// Working memory for the instructions of a level.
    ///
    /// # Panics
    /// If this processor lacks them.
    pub fn new(level: Level) -> Self {
        assert!(Level::available().contains(&level), "this processor lacks {level:?}");
        Self { level, rays: Box::new(Rays::new()), star: VertexStar::new(), traversal: Traversal::new() }
    }

    /// The value at a point and its error, as [`estimate_at`] gives them.
    ///
    /// # Errors
    /// [`Cancelled`] if `progress` says so.
    pub fn estimate(
        &mut self,
        tracer: &Tracer<D>,
        point: &ShadingPoint<D>,
        sampling: &Sampling,
        progress: &dyn Progress,
    ) -> Result<Estimate, Cancelled> {
        if tracer.mesh().is_translucent() {
            return estimate_at(tracer, point, sampling, progress);
        }
        self.at(tracer, point, sampling, None, progress, &mut ())
    }

    /// The same, and tells each ray to `watch`, in the order of the [`Sequence`]. Objects that let light through count as
    /// opaque.
    ///
    /// # Errors
    /// [`Cancelled`] if `progress` says so.
    pub fn watched(
        &mut self,
        tracer: &Tracer<D>,
        point: &ShadingPoint<D>,
        sampling: &Sampling,
        watch: &mut Watch<D>,
        progress: &dyn Progress,
    ) -> Result<Estimate, Cancelled> {
        self.at(tracer, point, sampling, Some(watch), progress, &mut ())
    }

    /// The same without `watch`, and adds to `visits` what the rays went through.
    ///
    /// # Errors
    /// [`Cancelled`] if `progress` says so.
    pub fn counted(
        &mut self,
        tracer: &Tracer<D>,
        point: &ShadingPoint<D>,
        sampling: &Sampling,
        visits: &mut Visits,
        progress: &dyn Progress,
    ) -> Result<Estimate, Cancelled> {
        self.at(tracer, point, sampling, None, progress, visits)
    }

    fn at<T: Tally>(
        &mut self,
        tracer: &Tracer<D>,
        point: &ShadingPoint<D>,
        sampling: &Sampling,
        watch: Option<&mut Watch<D>>,
        progress: &dyn Progress,
        tally: &mut T,
    ) -> Result<Estimate, Cancelled> {
        let mesh = tracer.mesh();
        let (position, normal) = (point.position(mesh), point.normal(mesh));
        if normal.amax() == 0.0 {
            return Ok(Estimate::known(1.0));
        }
        let around = match *point {
            ShadingPoint::Vertex(vertex) => tracer.incidence().around(mesh.identity[vertex as usize]),
            ShadingPoint::Inside { .. } => &[],
        };
        if !(tracer.wide().serves(&position) && tracer.wide().holds(around, mesh)) {
            return watched_at(tracer, point, sampling, watch, progress);
        }
        let vertex = match *point {
            ShadingPoint::Vertex(vertex) => {
                let identity = mesh.identity[vertex as usize];
                Some(AtVertex { ways: [normal, approach(mesh, around, vertex)], identity, around })
            }
            ShadingPoint::Inside { .. } => None,
        };
        let ignored = point.ignored(tracer);
        let identity = vertex.as_ref().map(|at| at.identity);
        let query = Query::new(tracer, position, (normal, RISE), sampling.max_distance, &ignored, identity);
        let source = Source::Sequence {
            sequence: Sequence::new(sampling.sampler, sampling.seed, point.number()),
            frame: Frame::new(&normal),
            samples: sampling.samples,
            target: sampling.target,
        };
        Ok(self.traced(Job { query, vertex, source, watch, progress, tally })?.estimate())
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
            let rays = directions.iter().map(|d| Ray::new(*origin, *d));
            return rays.filter(|ray| tracer.occluded(ray, limit, ignored)).count() as u32;
        }
        let query = Query::new(tracer, *origin, (normal, 0.0), limit, ignored.as_slice(), None);
        let source = Source::Directions(directions);
        // Nobody cancels.
        let found = self.traced(Job { query, vertex: None, source, watch: None, progress: &Silent, tally: &mut () });
        found.map_or(0, |found| found.rays() - found.escaped())
    }

    /// Chooses the code compiled for the level.
    fn traced<T: Tally>(&mut self, job: Job<T, D>) -> Result<Accumulator, Cancelled> {
        match self.level {
            Level::Portable => traced::<Portable, T, D>(self, job),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `new` has checked that the processor has all features of the level, which are the very list that
            // the function is compiled for.
            Level::Avx2 => unsafe { traced_avx2(self, job) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            Level::Avx512 => unsafe { traced_avx512(self, job) },
            #[cfg(not(target_arch = "x86_64"))]
            _ => traced::<Portable, T, D>(self, job),
        }
    }
}

impl<const D: usize> PacketTracer<D> {
    /// Which of the rays `alive` escape.
    #[inline(always)]
    fn open<L: Lanes, T: Tally>(&mut self, query: &Query<D>, around: &[u32], alive: u64, tally: &mut T) -> u64 {
        self.rays.complete();
        let hidden = self.star.hidden::<L>(query, &self.rays, around, alive);
        let hit = self.traversal.blocked::<L, T>(query, &self.rays, alive & !hidden, tally);
        let open = alive & !(hidden | hit);
        if query.wide.far.nodes.is_empty() { open } else { open & !query.hits_far(&self.rays, open) }
    }
}

/// [`traced`] compiled for AVX2.
#[cfg(target_arch = "x86_64")]
macro_rules! compiled_for_avx2 {
    ($($feature:tt)+) => {
        #[target_feature($(enable = $feature),+)]
        fn traced_avx2<T: Tally, const D: usize>(packets: &mut PacketTracer<D>, job: Job<T, D>) -> Result<Accumulator, Cancelled> {
            traced::<Avx2, T, D>(packets, job)
        }
    };
}

/// [`traced`] compiled for AVX-512.
#[cfg(target_arch = "x86_64")]
macro_rules! compiled_for_avx512 {
    ($($feature:tt)+) => {
        #[target_feature($(enable = $feature),+)]
        fn traced_avx512<T: Tally, const D: usize>(packets: &mut PacketTracer<D>, job: Job<T, D>) -> Result<Accumulator, Cancelled> {
            traced::<Avx512, T, D>(packets, job)
        }
    };
}

#[cfg(target_arch = "x86_64")]
with_avx2!(compiled_for_avx2);
#[cfg(target_arch = "x86_64")]
with_avx512!(compiled_for_avx512);

/// Counts the rays that escape.
#[inline(always)]
fn traced<L: Lanes, T: Tally, const D: usize>(
    packets: &mut PacketTracer<D>,
    job: Job<T, D>,
) -> Result<Accumulator, Cancelled> {
    let Job { mut query, vertex, mut source, mut watch, progress, tally } = job;
    let side = query.normal;
    let around = match &vertex {
        Some(at) => {
            packets.star.set::<L>(&query, at.ways, at.identity, at.around);
            at.around
        }
        None => {
            packets.star.clear();
            &[]
        }
    };
    let (total, sampler, target) = match &source {
        Source::Sequence { samples, sequence, target, .. } => (*samples as usize, sequence.sampler(), *target),
        Source::Directions(directions) => (directions.len(), Sampler::Random, None),
    };
    let mut accumulator = Accumulator::new(sampler, Dimension::of::<D>());
    // The net whose blocks have their turn, which of them is next, and what has escaped of its runs.
    let (mut net, mut turn, mut escaped) = (None, 0, [0; LEAST]);
    let mut first = 0;
    for block in 0.. {
        if first == total || (turn == 0 && target.is_some_and(|target| target.is_met(&accumulator))) {
            break;
        }
        if block % BLOCKS_BETWEEN_LOOKS == 0 && progress.cancelled() {
            return Err(Cancelled);
        }
        if turn == 0 && sampler == Sampler::Sobol && watch.is_none() {
            // No further than to where the target is looked at next.
            let end = if target.is_some() { Target::next_look(first) } else { total };
            net = Net::after(first, end.min(total) - first, Dimension::of::<D>());
        }
        let count = BLOCK.min(total - first);
        match (&mut source, net) {
            (Source::Sequence { sequence, frame, .. }, Some(net)) => packets.rays.take_of(net, turn, sequence, frame),
            (Source::Sequence { sequence, frame, .. }, None) => packets.rays.take(sequence, frame, count),
            (Source::Directions(directions), _) => {
                packets.rays.set(&directions[first..first + count], &side);
                // Left out only if all rays surely are on its side.
                query.normal = if packets.rays.lowest::<L>(count) > 1e-5 { side } else { Vector::zeros() };
            }
        }
        let open = packets.open::<L, T>(&query, around, u64::MAX >> (BLOCK - count), tally);
        first += count;
        let Some(of) = net else {
            if let Some(watch) = &mut watch {
                packets.rays.tell(open, count, watch);
            }
            accumulator.add(open, count as u32);
            continue;
        };
        of.count(turn, open, &mut escaped);
        turn += 1;
        if turn == of.blocks()
            && let Source::Sequence { sequence, .. } = &mut source
        {
            sequence.skip(of.rays() as u32);
            accumulator.add_runs((of.rays() / LEAST) as u32, escaped);
            (turn, escaped) = (0, [0; LEAST]);
        }
    }
    Ok(accumulator)
}
