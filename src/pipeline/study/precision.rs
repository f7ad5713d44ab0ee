//! Where rounding decides: the deviations of the published algorithm, and plain Cramer's rule on rays that are hard to tell.

use rayon::prelude::*;

use super::Errors;
use super::convergence::{Bench, Truth};
use crate::accel::Tracer;
use crate::geometry::{Aabb, Dimension, Ray, Vector, Vector64, narrow, widen};
use crate::occlusion::{Cancelled, Deviations, plain_cramer};
use crate::pipeline::RunError;
use crate::progress::Progress;
use crate::trace::{Sampler, Sequence};

/// Rays a vertex for the deviations.
const SAMPLES: u32 = 1024;
/// Rays of each kind that are held against exact signs.
pub const RAYS: usize = 50_000;

/// What the published algorithm gives with some of its deviations.
#[derive(Clone, Debug)]
pub struct DeviationEffect {
    pub what: &'static str,
    /// Least, mean and largest occlusion: 1 - A.
    pub least: f64,
    pub mean: f64,
    pub most: f64,
    pub errors: Errors,
}

/// The deviations one by one.
pub fn deviations<const D: usize>(
    bench: &Bench<D>,
    truth: &Truth,
    progress: &dyn Progress,
) -> Result<Vec<DeviationEffect>, RunError> {
    let published = Deviations::PUBLISHED;
    let variants = [
        ("as published", published),
        ("as published, products fused into sums", Deviations { contracted: true, ..published }),
        ("only t > 0 counts", Deviations { hits_at_zero: false, ..published }),
        ("own simplices count by their star", Deviations { own_simplices: false, ..published }),
        ("exact signs", Deviations { single_precision: false, ..published }),
        ("cosine-weighted directions", Deviations { uniform_angles: false, ..published }),
        ("all of these", Deviations::NONE),
        ("equations as printed", Deviations { printed_equations: true, ..published }),
    ];
    let _running = progress.stage("study: deviations", variants.len() as u64);
    let found = variants.into_iter().map(|(what, deviations)| {
        if progress.cancelled() {
            return Err(Cancelled.into());
        }
        let values: Vec<f64> =
            bench.with_deviations(deviations, SAMPLES, progress)?.into_iter().map(f64::from).collect();
        progress.advance(1);
        Ok(DeviationEffect {
            what,
            least: 1.0 - values.iter().copied().fold(0.0, f64::max),
            mean: 1.0 - values.iter().sum::<f64>() / values.len() as f64,
            most: 1.0 - values.iter().copied().fold(1.0, f64::min),
            errors: Errors::of(values.iter().zip(&truth.values).map(|(value, truth)| value - truth)),
        })
    });
    found.collect()
}

/// Rays of one kind, and on how many of them plain arithmetic says hit where nothing is hit, or the other way round.
#[derive(Clone, Debug)]
pub struct Differing {
    pub aim: &'static str,
    /// How many hit something, by exact signs.
    pub hit: usize,
    pub single: usize,
    pub double: usize,
}

/// Rays through the scene, aimed at its simplices: at points inside, on their facets, edges and vertices.
pub fn differing<const D: usize>(
    tracer: &Tracer<D>,
    seed: u64,
    progress: &dyn Progress,
) -> Result<Vec<Differing>, RunError> {
    let aims: &[(&str, usize)] = match Dimension::of::<D>() {
        Dimension::Three => &[("inside triangles", 0), ("on edges", 2), ("at vertices", 1)],
        Dimension::Four => &[("inside tetrahedra", 0), ("on triangles", 3), ("on edges", 2), ("at vertices", 1)],
    };
    let bounds = tracer.mesh().bounds();
    let _running = progress.stage("study: precision", (aims.len() * RAYS) as u64);
    let found = aims.iter().enumerate().map(|(number, &(aim, corners))| {
        if progress.cancelled() {
            return Err(Cancelled.into());
        }
        let verdicts =
            (0..RAYS as u64).into_par_iter().map(|i| verdicts(tracer, &bounds, seed, i * 8 + number as u64, corners));
        let [hit, single, double] =
            verdicts.map(|v| v.map(usize::from)).reduce(|| [0; 3], |a, b| std::array::from_fn(|i| a[i] + b[i]));
        progress.advance(RAYS as u64);
        Ok(Differing { aim, hit, single, double })
    });
    found.collect()
}

/// Whether a ray hits, by exact signs, and whether `f32` and `f64` say otherwise. It is aimed at the middle of a simplex's
/// first `corners` corners, or at any point of it.
fn verdicts<const D: usize>(tracer: &Tracer<D>, bounds: &Aabb<D>, seed: u64, number: u64, corners: usize) -> [bool; 3] {
    let mesh = tracer.mesh();
    let mut sequence = Sequence::new(Sampler::Random, seed, number);
    let [a, b, c, d] = sequence.next_point::<4>();
    let origin = Vector::<D>::from_fn(|i, _| {
        let middle = (bounds.min[i] + bounds.max[i]) * 0.5;
        middle + (bounds.max[i] - bounds.min[i]) * [a, b, c, d][i]
    });
    let [pick, rest @ ..] = sequence.next_point::<5>();
    let order = &tracer.bvh().order;
    if order.is_empty() {
        return [false; 3];
    }
    let simplex = order[((f64::from(pick) + 1.0) * 0.5 * order.len() as f64) as usize];
    let weights: [f64; D] = std::array::from_fn(|i| match corners {
        0 => f64::from(rest[i]) + 1.0,
        n => f64::from(u8::from(i < n)),
    });
    let total: f64 = weights.iter().sum();
    let places = mesh.corners(simplex);
    let target: Vector64<D> = places.iter().zip(weights).map(|(v, w)| widen(v) * (w / total)).sum();
    let towards = target - widen(&origin);
    if towards.amax() == 0.0 {
        return [false; 3];
    }
    let ray = Ray::new(origin, narrow(&towards.normalize()));
    let hit = tracer.occluded(&ray, f32::INFINITY, None);
    let [mut single, mut double] = [false; 2];
    tracer.bvh().any(&ray, f32::INFINITY, |simplex| {
        let [s, d] = plain_cramer(&mesh.corners(simplex), &ray);
        (single, double) = (single | s, double | d);
        single && double
    });
    [hit, single != hit, double != hit]
}
