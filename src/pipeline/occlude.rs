//! From an occlusion's plan to its values: which method computes them, and which files keep them.

use std::path::{Path, PathBuf};

use super::plan::{Computation, OcclusionPlan, OcclusionSource, Samples};
use super::prepare::{Loaded, errors_path, read_values};
use super::spec;
use crate::occlusion::exact::Budget;
use crate::occlusion::{Deviations, Estimates, Estimator};
use crate::trace::{Sampler, Sampling, Target};

/// What computes a computation's values.
pub(super) fn estimator(computation: &Computation) -> Estimator {
    let (samples, target) = match computation.samples {
        Samples::Fixed(n) => (n, None),
        Samples::Target { error, max_samples } => (max_samples, Some(Target { error: error as f32 })),
        Samples::Exact => return Estimator::Exact(Budget { cones: computation.max_cones as usize }),
    };
    let sampling = Sampling {
        sampler: if computation.method == spec::Method::Random { Sampler::Random } else { Sampler::Sobol },
        samples: u32::try_from(samples).unwrap_or(u32::MAX),
        seed: computation.seed,
        max_distance: computation.max_distance.map_or(f32::INFINITY, |d| d as f32),
        target,
    };
    match computation.method {
        spec::Method::Adaptive => Estimator::Adaptive(sampling),
        spec::Method::AsPublished => Estimator::AsPublished(sampling, Deviations::PUBLISHED),
        _ => Estimator::Sampled(sampling),
    }
}

/// The most rays that a vertex takes; the closed form counts as a few thousand, which is what it takes as long as.
pub(super) fn most_rays(computation: &Computation) -> u64 {
    match computation.samples {
        Samples::Fixed(n) | Samples::Target { max_samples: n, .. } => n,
        Samples::Exact => 1 << 12,
    }
}

/// Where the standard errors of an occlusion's values are kept: in `NAME.error.f32` beside `NAME.f32`. None if there is no
/// file, or no error.
pub(super) fn errors_file(occlusion: &OcclusionPlan) -> Option<PathBuf> {
    let known = match &occlusion.source {
        OcclusionSource::Compute(computation) => computation.samples != Samples::Exact,
        OcclusionSource::Load(file) => errors_path(file).is_file(),
    };
    occlusion.file.as_ref().filter(|_| known).map(|file| errors_path(file))
}

/// Reads what an earlier run has left of an occlusion; nothing if it can't be used.
pub(super) fn kept(out: &Path, occlusion: &OcclusionPlan, hash: &str, vertices: usize) -> Option<Estimates> {
    let Loaded { values, errors, .. } = read_values(&out.join(occlusion.file.as_deref()?), hash, vertices).ok()?;
    (errors.len() == values.len()).then_some(Estimates { values, errors, rays: 0 })
}
