//! The rays that pictures take themselves: at voxels, beside or instead of the vertices' values, and to be measured by.

use super::Plan;
use super::occlusion::{Method, OcclusionPlan, OcclusionSource, Samples};
use super::render::{self, RenderPlan};
use crate::geometry::Dimension;
use crate::occlusion::Estimator;
use crate::trace::{Sampler, Sampling};

/// Of the noise of one voxel's rays, the share that a fit to its neighbours leaves, about.
const LEFT_BY_FIT: [f64; 2] = [0.07, 0.1];
/// The part of the tolerance that this noise may take; the rest is for what a fit leaves out.
const FOR_NOISE: f64 = 0.75;
/// Rays that a vertex sends for directions where its values come from a file.
const LOADED_RAYS: u32 = 256;
/// Rays that a voxel is looked at again with, to measure pictures,
const AUDIT_RAYS: u32 = 256;
/// none of which are a picture's own.
const AUDIT_SEED: u64 = 0x5851_f42d_4c95_7f2d;

impl OcclusionPlan {
    /// The rays that a voxel takes beside the vertices' values, for `shading: auto`: so few that what is left of their noise
    /// among the neighbours is well below the tolerance, by the same sampler, and no more than a vertex takes. None where
    /// rays are no way to the same values: of a file nobody knows how it came about, and the thesis's methods have values
    /// at vertices only.
    pub fn at_voxels(&self, dimension: Dimension, tolerance: f64) -> Option<Sampling> {
        let most = self.most_at_voxels()?;
        let left = dimension.pick(LEFT_BY_FIT[0], LEFT_BY_FIT[1]);
        let noise = |samples: u32| Sampling { samples, ..most }.expected_variance(dimension, 0.5).sqrt();
        let enough = |samples: &u32| noise(*samples) * left <= FOR_NOISE * tolerance;
        let samples = (2..).map(|n| 1 << n).find(|n| *n >= most.samples || enough(n)).unwrap_or(most.samples);
        Some(Sampling { samples: samples.min(most.samples), ..most })
    }

    /// The most rays that a voxel takes, for `shading: auto`: as many as a vertex.
    pub fn most_at_voxels(&self) -> Option<Sampling> {
        let OcclusionSource::Compute(computation) = &self.source else { return None };
        let most = match computation.samples {
            Samples::Fixed(samples) => u32::try_from(samples).unwrap_or(u32::MAX),
            Samples::Target { .. } | Samples::Exact => 256,
        };
        let sampling = Sampling {
            sampler: if computation.method == Method::Random { Sampler::Random } else { Sampler::Sobol },
            samples: most,
            seed: computation.seed,
            max_distance: computation.max_distance.map_or(f32::INFINITY, |d| d as f32),
            target: None,
        };
        (!computation.method.is_of_the_thesis()).then_some(sampling)
    }

    /// Rays to measure pictures by: what this occlusion is meant to be, whatever its method. None for a file nobody knows
    /// how it came about.
    pub fn audit(&self) -> Option<Sampling> {
        let OcclusionSource::Compute(computation) = &self.source else { return None };
        Some(audit(computation.seed, computation.max_distance))
    }

    /// The rays that each voxel takes, if that is a fixed number of rays, for `shading: voxel`.
    pub fn instead_of_vertices(&self) -> Option<Sampling> {
        let OcclusionSource::Compute(computation) = &self.source else { return None };
        match computation.estimator() {
            Estimator::Sampled(sampling) if sampling.target.is_none() => Some(sampling),
            _ => None,
        }
    }

    /// Why nothing is known of the directions in which the sky is open, if so.
    pub fn no_directions(&self) -> Option<String> {
        match &self.source {
            OcclusionSource::Compute(computation) if computation.method.is_of_the_thesis() => Some(format!(
                "`{}` tells how much of the sky is hidden, not where it is open; take `method: sobol`",
                computation.method.as_str()
            )),
            _ => None,
        }
    }

    /// What finds those directions: what finds the values, or, of values from a file, rays.
    pub fn directional(&self, seed: u64, max_distance: f32) -> Estimator {
        match &self.source {
            OcclusionSource::Compute(computation) => computation.estimator(),
            OcclusionSource::Load(_) => {
                Estimator::Sampled(Sampling { max_distance, ..Sampling::new(LOADED_RAYS, seed) })
            }
        }
    }

    /// Where visible points have their occlusion from, unless it is said: from vertices and rays, or from vertices alone
    /// if their values are not made by rays.
    pub fn default_shading(&self) -> render::Shading {
        match &self.source {
            OcclusionSource::Compute(computation) if computation.method.is_by_rays() => render::Shading::Auto,
            _ => render::Shading::Smooth,
        }
    }
}

impl RenderPlan {
    /// Rays to measure the picture by; none if it shows no occlusion, or one that is not known.
    pub fn audit(&self, plan: &Plan) -> Option<Sampling> {
        match (&self.screen_space, self.occlusion) {
            (Some(screen_space), _) => Some(audit(plan.seed, screen_space.max_distance)),
            (None, Some(occlusion)) => plan[occlusion].audit(),
            (None, None) => None,
        }
    }
}

/// Rays to measure by what a picture with this seed shows.
fn audit(seed: u64, max_distance: Option<f64>) -> Sampling {
    let max_distance = max_distance.map_or(f32::INFINITY, |d| d as f32);
    Sampling { max_distance, ..Sampling::new(AUDIT_RAYS, seed ^ AUDIT_SEED) }
}

#[cfg(test)]
mod tests {
    use crate::pipeline::{Document, Pipeline};

    use super::*;

    fn samples(dimension: u64, occlusion: &str, tolerance: f64) -> Option<u32> {
        let text = format!(
            "name: p\nstages:\n  - scene: {{dimension: {dimension}, objects: []}}\n  - occlusion: {occlusion}\n"
        );
        let document = Document::parse("p.yaml", &text).unwrap();
        let pipeline = Pipeline::from_document(document, &[], None).unwrap();
        let (_, plan) = pipeline.plan.all::<OcclusionPlan>().next().unwrap();
        plan.at_voxels(Dimension::new(dimension).unwrap(), tolerance).map(|sampling| sampling.samples)
    }

    #[test]
    fn voxels_take_as_few_rays_as_the_tolerance_allows_and_no_more_than_vertices() {
        assert_eq!((samples(4, "{}", 0.01), samples(3, "{}", 0.01)), (Some(16), Some(8)));
        assert_eq!((samples(4, "{}", 0.1), samples(3, "{}", 0.1)), (Some(4), Some(4)));
        assert!(samples(4, "{}", 0.002) > samples(4, "{}", 0.005));
        assert_eq!(samples(4, "{}", 1e-6), Some(256));
        assert_eq!((samples(4, "{samples: 5}", 0.01), samples(4, "{samples: 1}", 0.01)), (Some(5), Some(1)));
        assert_eq!(samples(4, "{method: exact}", 0.01), Some(16));
        assert_eq!(samples(4, "{method: as_published}", 0.01), None);
    }
}
