//! Every way to shade an image: its error against the time it takes.
//!
//! `flat` and `smooth` spread the vertices' values over each simplex; `voxel` takes rays at each visible point, and
//! `voxel+denoise` filters what few rays found there; `auto` interpolates and mends; `screen_space` looks at the image
//! alone. The truth is the value at each visible point itself, exact or by many rays. The image is the pipeline's first of the scene, with fewer voxels.

use std::sync::Arc;
use std::time::Instant;

use super::{Errors, Unheard};
use crate::accel::Tracer;
use crate::occlusion::exact::Budget;
use crate::occlusion::{Error, Estimator};
use crate::pipeline::RunError;
use crate::progress::Progress;
use crate::render::filters::denoise;
use crate::render::filters::denoise::Refine;
use crate::render::{Aov, Renderer, ScreenSpace, Shading};
use crate::stages::camera::camera;
use crate::stages::render::RenderPlan;
use crate::trace::cpu::CpuBackend;
use crate::trace::{RayBackend, Sampling, ShadingPoint};
use crate::volume::{Array, Values};

/// At most about so many voxels.
const VOXELS: usize = 12_000;
/// Rays a point of the reference, where it isn't exact.
const REFERENCE: u32 = 1024;
/// Scenes with at most so many simplices have an exact reference.
const EXACT_UP_TO: usize = 100;
const BUDGET: Budget = Budget { cones: 20_000 };
/// What is compared, each with so many rays a vertex or, by `voxel`, a voxel; in screen space with so many slices.
const SHADINGS: &[(&str, &[u32])] = &[
    ("flat", &[16, 64, 256, 1024]),
    ("smooth", &[16, 64, 256, 1024]),
    ("voxel", &[4, 16, 64, 256]),
    ("voxel+denoise", &[1, 4, 16, 64]),
    ("auto", &[64, 256, 1024]),
    ("screen_space", &[8, 32]),
];

/// The standard error to which `auto` keeps, as a render does where nothing else is said.
const TOLERANCE: f64 = 0.01;

/// The rays that `auto` takes at a voxel at first, beside so many at a vertex.
fn rays_beside(samples: u32) -> u32 {
    (samples / 16).clamp(4, 16)
}

/// Errors in an image.
#[derive(Clone, Debug)]
pub struct Pictures {
    pub render: String,
    pub dimensions: [usize; 3],
    /// Voxels that see something.
    pub seen: usize,
    /// How the reference was made.
    pub reference: String,
    pub rows: Vec<PictureRow>,
}

/// One way to shade.
#[derive(Clone, Debug)]
pub struct PictureRow {
    pub shading: &'static str,
    /// Rays a vertex, or a voxel; slices in screen space.
    pub samples: u32,
    pub errors: Errors,
    /// All of it, values and image, on all threads.
    pub seconds: f64,
}

/// Fewer voxels in the same proportions, at least one each way.
fn reduced(dimensions: [usize; 3]) -> [usize; 3] {
    let axes = dimensions.iter().filter(|&&d| d > 1).count().max(1) as f64;
    let voxels: f64 = dimensions.iter().map(|&d| d as f64).product();
    let share = (VOXELS as f64 / voxels).powf(1.0 / axes).min(1.0);
    dimensions.map(|d| ((d as f64 * share) as usize).max(1))
}

/// Measures; none if no voxel sees anything.
pub fn measure<const D: usize>(
    tracer: &Arc<Tracer<D>>,
    id: &str,
    render: &RenderPlan,
    seed: u64,
    progress: &dyn Progress,
) -> Result<Option<Pictures>, RunError> {
    let dimensions = reduced(render.dimensions);
    let camera = camera::<D>(&render.camera)?;
    // Each is cancelled by the outer progress, and told as one step of it.
    let watch = Unheard(progress);
    let backend: Arc<dyn RayBackend<D>> = Arc::new(CpuBackend::new(Arc::clone(tracer)));
    let points = ShadingPoint::vertices(tracer.mesh());
    // Denoised, where it is said with how many rays a voxel, and refined by at most so many.
    let filtered = |shading: Shading, rays: Option<u32>, most: Option<u32>| -> Result<Vec<Array>, Error> {
        let mut renderer = Renderer::new(Arc::clone(&backend), camera.clone(), dimensions, shading);
        if let Some(rays) = rays {
            renderer.filters.extend(denoise(&renderer.camera, &renderer.grid, Sampling::new(rays, seed)));
        }
        if let Some(most) = most {
            renderer.filters.push(Box::new(Refine::new(Arc::clone(&backend), Sampling::new(most, seed), TOLERANCE)));
        }
        Ok(renderer.volume(&[Aov::AmbientOcclusion, Aov::Opacity], &watch)?.arrays)
    };
    let image = |shading: Shading| filtered(shading, None, None);
    let by_rays = |samples| Estimator::Sampled(Sampling::new(samples, seed));
    let steps = SHADINGS.iter().map(|(_, samples)| samples.len()).sum::<usize>() + 1;
    let _running = progress.stage("study: pictures", steps as u64);
    let small = tracer.mesh().simplices.len() <= EXACT_UP_TO;
    let (reference, name) = match small.then(|| image(Shading::Voxel(Estimator::Exact(BUDGET)))) {
        Some(Ok(arrays)) => (arrays, "exact at each visible point".to_owned()),
        Some(Err(Error::Cancelled)) => return Err(Error::Cancelled.into()),
        // Too large, or too rich a view.
        _ => {
            let sampled = Estimator::Sampled(Sampling::new(REFERENCE, !seed));
            (image(Shading::Voxel(sampled))?, format!("`voxel` shading by `sobol` with {REFERENCE} rays"))
        }
    };
    progress.advance(1);
    let (Some(Values::F32(truth)), Some(Values::F32(opacity))) =
        (reference.first().map(|a| &a.values), reference.get(1).map(|a| &a.values))
    else {
        return Ok(None);
    };
    let seen: Vec<usize> = (0..truth.len()).filter(|&i| opacity[i] > 0.0).collect();
    let mut rows = Vec::new();
    let mut add = |shading: &'static str, samples: u32, seconds: f64, arrays: &[Array]| {
        if let Some(Values::F32(values)) = arrays.first().map(|a| &a.values) {
            let errors = Errors::of(seen.iter().map(|&i| f64::from(values[i]) - f64::from(truth[i])));
            rows.push(PictureRow { shading, samples, errors, seconds });
        }
        progress.advance(1);
    };
    for (shading, samples) in SHADINGS {
        for &samples in *samples {
            let (arrays, seconds) = timed(|| {
                let at_vertices = || by_rays(samples).estimate(&*backend, &points, None, &watch).map(Arc::new);
                match *shading {
                    "flat" => image(Shading::Flat(at_vertices()?)),
                    "smooth" => image(Shading::Smooth(at_vertices()?)),
                    "voxel" => image(Shading::Voxel(by_rays(samples))),
                    "screen_space" => {
                        let slices = samples as usize;
                        image(Shading::ScreenSpace(ScreenSpace { slices, ..ScreenSpace::default() }))
                    }
                    "voxel+denoise" => filtered(Shading::Voxel(by_rays(samples)), Some(samples), None),
                    _ => {
                        let own = rays_beside(samples);
                        filtered(Shading::Auto(at_vertices()?, by_rays(own)), Some(own), Some(samples))
                    }
                }
            })?;
            add(shading, samples, seconds, &arrays);
        }
    }
    let pictures = Pictures { render: id.to_owned(), dimensions, seen: seen.len(), reference: name, rows };
    Ok((pictures.seen > 0).then_some(pictures))
}

/// What comes out of it, and the least seconds it takes; what is over soon is done again, as the first time is slow.
fn timed<T>(work: impl Fn() -> Result<T, Error>) -> Result<(T, f64), Error> {
    let began = Instant::now();
    let mut least = f64::INFINITY;
    loop {
        let start = Instant::now();
        let result = work()?;
        least = least.min(start.elapsed().as_secs_f64());
        if began.elapsed().as_secs_f64() > 0.1 {
            return Ok((result, least));
        }
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn images_shrink_in_proportion() {
        assert_eq!(super::reduced([100, 100, 100]), [22, 22, 22]);
        assert_eq!(super::reduced([480, 360, 1]), [126, 94, 1]);
        assert_eq!(super::reduced([8, 8, 8]), [8, 8, 8]);
    }
}
