//! Between a voxel's own value and what its surroundings suggest.
//!
//! The own value has noise, whose variance n is known; what is fitted has little, but leaves out what no line shows: where
//! a body touches another, occlusion jumps from voxel to voxel. What it leaves out has a variance b that is not known,
//! and three signs of it:
//!
//! - the interpolated values, as the fit found; or, without them, fitted values that curve: they differ from their own mean
//!   over the nearest voxels;
//! - own values that the fit misses all in the same way: the mean of their differences over the nearest voxels is
//!   larger than noise makes it;
//! - an own value beyond four standard deviations of its noise, and beyond a ray and a half.
//!
//! The share k = b / (b + n) of the own value makes the error of the sum least: its variance is k^2 n and (1 - k)^2 times b
//! and the fit's own.

use rayon::prelude::*;

use super::window::{LANES, Planes, Window, lanes};
use crate::geometry::Dimension;
use crate::occlusion::Error;
use crate::progress::Progress;
use crate::render::filters::ImageFilter;
use crate::render::gbuffer::{Columns, GBuffer};
use crate::render::{Camera, NOTHING};
use crate::trace::Sampling;
use crate::volume::Grid;

/// How many times the variance of noise the square of a mean difference must have to tell of a misfit.
const CLEAR: f64 = 3.0;
/// How many standard deviations no noise is off,
const OUTLIER: f64 = 4.0;
/// and how many rays.
const OUTLIER_RAYS: f64 = 1.5;

/// Fits that curve leave out about so many times what is sure: told with the error, but not taken as a reason to trust the
/// noise of an own value instead.
const CURVES: f64 = 2.0;

/// The filter.
#[derive(Clone, Debug)]
pub struct Settle<const D: usize> {
    camera: Camera<D>,
    spacing: f64,
    window: Window,
    sampling: Sampling,
    /// From the square of what curved fits differ from their mean to that of what they leave out, at least.
    curvature: f64,
}

/// Means over the nearest voxels.
struct Near {
    mean: f64,
    /// How many voxels of equal weight have as much noise.
    count: f64,
}

impl<const D: usize> Settle<D> {
    /// For images of this grid whose occlusion comes from these rays a voxel.
    pub fn new(camera: &Camera<D>, grid: &Grid, sampling: Sampling) -> Self {
        // Gaussian windows of some 15 to 20 voxels of a surface.
        let (wide, deviation) = Dimension::of::<D>().pick((2, 1.4f64), (1, 0.8));
        let by_offset =
            (0..=wide).map(|i| libm::exp(-0.5 * f64::from(i * i) / (deviation * deviation)) as f32).collect();
        let curvature = Dimension::of::<D>().pick(2.0, 0.5);
        let spacing = super::spacing::<D>(grid);
        Self { camera: camera.clone(), spacing, window: Window::new(D - 1, by_offset), sampling, curvature }
    }

    /// The mean of a plane's values near a voxel.
    fn near(&self, planes: &Planes<D>, plane: &[f32], voxel: [usize; 3]) -> Near {
        let own = plane[planes.place(voxel)];
        let (mut sum, mut total, mut squares) = ([0.0f32; LANES], [0.0f32; LANES], [0.0f32; LANES]);
        self.window.visit(planes, voxel, |_, _, at, weights| {
            let values = lanes(plane, at);
            for l in 0..LANES {
                sum[l] += weights[l] * (values[l] - own);
                total[l] += weights[l];
                squares[l] += weights[l] * weights[l];
            }
        });
        let [sum, total, squares] = [sum, total, squares].map(|lanes| lanes.iter().map(|&x| f64::from(x)).sum::<f64>());
        Near { mean: f64::from(own) + sum / total, count: total * total / squares }
    }
}

impl<const D: usize> ImageFilter<D> for Settle<D> {
    fn columns(&self) -> Columns {
        super::COLUMNS
    }

    /// Means of means.
    fn halo(&self) -> usize {
        2 * self.window.radius[2]
    }

    fn apply(&self, input: &GBuffer<D>, out: &mut GBuffer<D>, progress: &dyn Progress) -> Result<(), Error> {
        let [width, height, _] = input.dimensions();
        let planes = Planes::new(input, &self.camera, self.spacing, self.window.radius[0]);
        let differences = planes.plane(|n| input.occlusion[n] - input.fitted[n]);
        let fitted = planes.plane(|n| input.fitted[n]);
        // The squares of mean differences, of those layers that the means of the output's look at.
        let reach = self.window.radius[2];
        let layers = out.layers().start.saturating_sub(reach).max(input.layers().start)
            ..(out.layers().end + reach).min(input.layers().end);
        let start = input.layers().start;
        let mut squares = vec![0.0f32; input.len()];
        let range = input.range(&layers);
        squares[range].par_chunks_mut(width).enumerate().try_for_each(|(row, out)| {
            let (j, k) = (row % height, row / height + layers.start - start);
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            let seen = |x: &usize| input.simplex[(k * height + j) * width + x] != NOTHING;
            (0..width)
                .filter(seen)
                .for_each(|x| out[x] = self.near(&planes, &differences, [x, j, k]).mean.powi(2) as f32);
            Ok(())
        })?;
        let squares = planes.plane(|n| squares[n]);
        let before = out.layers().start - start;
        let dimension = Dimension::of::<D>();
        let jump = OUTLIER_RAYS / f64::from(self.sampling.samples.max(1));
        out.rows_mut().into_par_iter().enumerate().try_for_each(|(row, out)| {
            let (j, k) = (row % height, row / height + before);
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            for x in (0..width).filter(|&x| out.simplex[x] != NOTHING) {
                let (own, fit) = (f64::from(out.occlusion[x]), f64::from(out.fitted[x]));
                let noise = self.sampling.expected_variance(dimension, fit);
                let (of_line, unsure) = match out.interpolated.is_empty() {
                    false => (f64::from(out.misfit[x]), 0.0),
                    true => {
                        let curves = (self.near(&planes, &fitted, [x, j, k]).mean - fit).powi(2);
                        (self.curvature * curves, (CURVES - 1.0) * self.curvature * curves)
                    }
                };
                let Near { mean: square, count } = self.near(&planes, &squares, [x, j, k]);
                let of_all = (square - CLEAR * noise / count).max(0.0);
                let difference = own - fit;
                let of_own = (difference.powi(2) - (OUTLIER.powi(2) * noise).max(jump * jump)).max(0.0);
                let misfit = of_line + of_all + of_own;
                let kept = misfit / (misfit + noise);
                let of_fit = f64::from(out.error[x]).powi(2) + misfit + unsure;
                let error = kept.powi(2) * noise + (1.0 - kept).powi(2) * of_fit;
                out.occlusion[x] = (fit + kept * difference).clamp(0.0, 1.0) as f32;
                out.error[x] = error.sqrt().min(1.0) as f32;
            }
            Ok(())
        })
    }
}
