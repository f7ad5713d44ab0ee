//! Methods against the truth, with more and more rays.

use std::sync::Arc;
use std::time::Instant;

use rayon::prelude::*;

use super::Errors;
use super::Unheard;
use crate::accel::Tracer;
use crate::occlusion::exact::{Budget, Hemisphere};
use crate::occlusion::{AsPublished, Cancelled, Deviations, Estimates, Estimator};
use crate::pipeline::RunError;
use crate::progress::Progress;
use crate::trace::cpu::{CpuBackend, PacketTracer};
use crate::trace::{Sampler, Sampling, ShadingPoint};

/// At most so many vertices are looked at.
const VERTICES: usize = 200;
/// A level is repeated until so many rays were traced, but not more often than [`REPETITIONS`].
pub const RAYS: usize = 1 << 19;
const REPETITIONS: usize = 128;
/// Where exact values would take more than this, about a tenth of a second, a long run stands for them.
const BUDGET: Budget = Budget { cones: 100_000 };
/// Rays of a long run.
const LONG_RUN: u32 = 1 << 20;
/// Tells the seeds of repetitions from those of neighbouring studies.
const SEED_STEP: u64 = 0x9e37_79b9_7f4a_7c15;

/// A method that is compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// As the pipeline calls it.
    pub name: &'static str,
    kind: Kind,
    /// The most rays a vertex.
    most: u32,
}

/// What computes a config's values.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// Cosine-weighted rays.
    Rays(Sampler),
    /// The closed form where it is cheap, Sobol points elsewhere.
    Adaptive,
    /// The published algorithm.
    Published,
}

/// In the order of the tables.
pub const CONFIGS: [Config; 4] = [
    Config { name: "as_published", kind: Kind::Published, most: 1 << 12 },
    Config { name: "random", kind: Kind::Rays(Sampler::Random), most: 1 << 16 },
    Config { name: "sobol", kind: Kind::Rays(Sampler::Sobol), most: 1 << 16 },
    Config { name: "adaptive", kind: Kind::Adaptive, most: 1 << 16 },
];

/// What is taken for true.
#[derive(Clone, Debug)]
pub struct Truth {
    /// Of each vertex that is looked at.
    pub values: Vec<f64>,
    /// How many of them are those of a long run.
    pub long_runs: usize,
    /// The largest standard error of those, 0 if there are none.
    pub error: f64,
    /// Seconds a vertex and thread, of the exact ones; none if there are none.
    pub seconds: Option<f64>,
}

/// A vertex's true value.
struct Found {
    value: f64,
    /// Its standard error, if it is that of a long run.
    error: f64,
    /// What it took, if it is exact.
    seconds: Option<f64>,
}

/// A method with so many rays.
#[derive(Clone, Debug)]
pub struct Level {
    pub method: &'static str,
    pub samples: u32,
    /// With how many seeds.
    pub repetitions: usize,
    pub errors: Errors,
    /// Seconds a vertex and thread.
    pub seconds: f64,
    pub rays_per_second: f64,
}

/// A scene, and the vertices that are looked at.
#[derive(Debug)]
pub struct Bench<const D: usize> {
    pub tracer: Arc<Tracer<D>>,
    pub vertices: Vec<u32>,
    pub seed: u64,
}

impl<const D: usize> Bench<D> {
    /// Takes vertices that belong to something, evenly spread over their list. None if there are none.
    pub fn new(tracer: Arc<Tracer<D>>, seed: u64) -> Option<Self> {
        let (mesh, incidence) = (tracer.mesh(), tracer.incidence());
        let mut vertices: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
        vertices.retain(|&v| !incidence.around(mesh.identity[v as usize]).is_empty());
        let (count, all) = (vertices.len().min(VERTICES), vertices.len());
        let vertices: Vec<u32> = (0..count).map(|i| vertices[(2 * i + 1) * all / (2 * count)]).collect();
        (!vertices.is_empty()).then_some(Self { tracer, vertices, seed })
    }

    /// The true values.
    pub fn truth(&self, progress: &dyn Progress) -> Result<Truth, RunError> {
        let _running = progress.stage("study: exact", self.vertices.len() as u64);
        let found: Result<Vec<Found>, RunError> = self
            .vertices
            .par_iter()
            .with_max_len(1)
            .map_init(PacketTracer::default, |packets, &vertex| {
                if progress.cancelled() {
                    return Err(Cancelled.into());
                }
                let start = Instant::now();
                let point = ShadingPoint::Vertex(vertex);
                let view = Hemisphere::over(&self.tracer, &point);
                let exact = view.map_or(Ok(1.0), |view| view.visible_fraction(BUDGET));
                let seconds = start.elapsed().as_secs_f64();
                progress.advance(1);
                match exact {
                    Ok(value) => Ok(Found { value: value.clamp(0.0, 1.0), error: 0.0, seconds: Some(seconds) }),
                    Err(_) => {
                        let sampling = self.sampling(Sampler::Sobol, LONG_RUN, usize::MAX);
                        let long = packets.estimate(&self.tracer, &point, &sampling, progress)?;
                        Ok(Found { value: long.value.into(), error: long.error.into(), seconds: None })
                    }
                }
            })
            .collect();
        let found = found?;
        let exact: Vec<f64> = found.iter().filter_map(|f| f.seconds).collect();
        Ok(Truth {
            values: found.iter().map(|f| f.value).collect(),
            long_runs: found.len() - exact.len(),
            error: found.iter().map(|f| f.error).fold(0.0, f64::max),
            seconds: (!exact.is_empty()).then(|| exact.iter().sum::<f64>() / exact.len() as f64),
        })
    }

    fn sampling(&self, sampler: Sampler, samples: u32, repetition: usize) -> Sampling {
        let seed = self.seed.wrapping_add((repetition as u64).wrapping_mul(SEED_STEP));
        Sampling { sampler, ..Sampling::new(samples, seed) }
    }

    /// A method on all its levels: 16 rays, 64, and so on.
    pub fn converge(&self, config: Config, truth: &Truth, progress: &dyn Progress) -> Result<Vec<Level>, RunError> {
        let levels: Vec<u32> = (2..).map(|k| 1 << (2 * k)).take_while(|&samples| samples <= config.most).collect();
        let _running = progress.stage(&format!("study: {}", config.name), levels.len() as u64);
        let measured = levels.into_iter().map(|samples| {
            if progress.cancelled() {
                return Err(Cancelled.into());
            }
            let repetitions = match config.kind {
                // The same again, mostly, and expensive.
                Kind::Adaptive => 1,
                _ => (RAYS / samples as usize / self.vertices.len()).clamp(1, REPETITIONS),
            };
            let (found, seconds) = self.values(config, samples, repetitions, progress)?;
            progress.advance(1);
            let pairs = found.values.iter().zip(truth.values.iter().cycle());
            Ok(Level {
                method: config.name,
                samples,
                repetitions,
                errors: Errors::of(pairs.map(|(value, truth)| f64::from(*value) - truth)),
                seconds,
                rays_per_second: found.rays as f64 / found.values.len() as f64 / seconds
                    * rayon::current_num_threads() as f64,
            })
        });
        measured.collect()
    }

    /// All vertices' values, repetition after repetition, and the rays asked in all; and the seconds a vertex and thread.
    fn values(
        &self,
        config: Config,
        samples: u32,
        repetitions: usize,
        progress: &dyn Progress,
    ) -> Result<(Estimates, f64), RunError> {
        let tasks: Vec<(usize, u32)> =
            (0..repetitions).flat_map(|r| self.vertices.iter().map(move |&vertex| (r, vertex))).collect();
        let all = |values: Vec<f32>| {
            let rays = u64::from(samples) * values.len() as u64;
            Estimates { values, errors: Vec::new(), rays }
        };
        let backend = CpuBackend::new(Arc::clone(&self.tracer));
        let points: Vec<ShadingPoint<D>> = tasks.iter().map(|task| ShadingPoint::Vertex(task.1)).collect();
        let start = Instant::now();
        let found: Result<Estimates, RunError> = match config.kind {
            Kind::Rays(sampler) => {
                let value = |packets: &mut PacketTracer<D>, (&(repetition, _), point): (&(usize, u32), _)| {
                    let sampling = self.sampling(sampler, samples, repetition);
                    Ok(packets.estimate(&self.tracer, point, &sampling, progress)?.value)
                };
                tasks.par_iter().zip(&points).map_init(PacketTracer::default, value).collect::<Result<_, _>>().map(all)
            }
            Kind::Adaptive => {
                let estimator = Estimator::Adaptive(self.sampling(Sampler::Sobol, samples, 0));
                Ok(estimator.estimate(&backend, &points, None, &Unheard(progress))?)
            }
            Kind::Published => {
                let published = AsPublished::new(&self.tracer, Deviations::PUBLISHED);
                let value = |&(repetition, vertex): &(usize, u32)| {
                    Ok(published.at_vertex(vertex, &self.sampling(Sampler::Random, samples, repetition), progress)?)
                };
                tasks.par_iter().map(value).collect::<Result<_, _>>().map(all)
            }
        };
        let threads = rayon::current_num_threads().min(tasks.len()) as f64;
        Ok((found?, start.elapsed().as_secs_f64() * threads / tasks.len() as f64))
    }

    /// The values of the published algorithm with other deviations.
    pub fn with_deviations(
        &self,
        deviations: Deviations,
        samples: u32,
        progress: &dyn Progress,
    ) -> Result<Vec<f32>, Cancelled> {
        let published = AsPublished::new(&self.tracer, deviations);
        let sampling = self.sampling(Sampler::Random, samples, 0);
        self.vertices.par_iter().map(|&vertex| published.at_vertex(vertex, &sampling, progress)).collect()
    }
}
