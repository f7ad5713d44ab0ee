//! From an occlusion's plan to its values: which engine computes them, with which settings.

use super::plan::{Computation, Samples};
use super::spec::Method;
use crate::accel::Tracer;
use crate::occlusion::exact::{self, Budget};
use crate::occlusion::{self, Sampler};
use crate::progress::Progress;
use crate::render::Shading;

/// The values at all vertices.
///
/// # Errors
/// [`occlusion::Error`]: cancelled, or too dear for the closed form.
pub(super) fn values<const D: usize>(
    tracer: &Tracer<D>,
    computation: &Computation,
    progress: &dyn Progress,
) -> Result<Vec<f32>, occlusion::Error> {
    match computation.method {
        Method::Exact => {
            let values = exact::at_vertices(tracer, budget(computation), progress)?;
            Ok(values.into_iter().map(|value| value as f32).collect())
        }
        _ => Ok(occlusion::at_vertices(tracer, &sampling(computation), progress)?),
    }
}

/// The shading that computes each visible point's value itself.
pub(super) fn voxel_shading(computation: &Computation) -> Shading<'static> {
    match computation.method {
        Method::Exact => Shading::Exact(budget(computation)),
        _ => Shading::Voxel(sampling(computation)),
    }
}

fn budget(computation: &Computation) -> Budget {
    Budget { cones: usize::try_from(computation.max_cones).unwrap_or(usize::MAX) }
}

/// The settings that a computation stands for.
fn sampling(computation: &Computation) -> occlusion::Settings {
    let samples = match computation.samples {
        Samples::Fixed(n) | Samples::Target { max_samples: n, .. } => n,
        Samples::Exact => 1,
    };
    occlusion::Settings {
        sampler: if computation.method == Method::Random { Sampler::Random } else { Sampler::Sobol },
        samples: u32::try_from(samples).unwrap_or(u32::MAX),
        seed: computation.seed,
        max_distance: computation.max_distance.map_or(f32::INFINITY, |d| d as f32),
    }
}
