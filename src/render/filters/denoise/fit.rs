//! What a voxel's surroundings suggest: a weighted local linear fit over the image.
//!
//! Around each voxel that shows something, `a + b . (offset in the image)` is fitted to the occlusion of its neighbours by
//! weighted least squares, and the voxel is told `a` (local linear regression; Cleveland, *Robust Locally Weighted
//! Regression*, 1979). A mean would pull values towards the inside at every edge of a body and across every gradient; a
//! linear fit does not. An image of three axes has many neighbours close by: a window 7 voxels wide holds 343, where one
//! of two axes has to be 17 wide for 289.
//!
//! Where a value interpolated between vertices is known beside each voxel's own, a second line is fitted to their
//! differences: what the vertices' values show already need not be found again, and is not smoothed away. Of the two
//! fits that counts about which the values scatter less. And the interpolated values tell how far off a line may be:
//! what they vary about their own line, which is no noise, is a measure of what any line leaves out.
//!
//! Sums are taken lane by lane for whole rows of neighbours; the offsets along the row come in at the end.

use nalgebra::{Matrix4, Vector4};
use rayon::prelude::*;

use super::window::{LANES, Lanes, Planes, Window, lanes};
use crate::geometry::Dimension;
use crate::occlusion::Error;
use crate::progress::Progress;
use crate::render::filters::ImageFilter;
use crate::render::gbuffer::{Columns, GBuffer};
use crate::render::{Camera, NOTHING};
use crate::trace::Sampling;
use crate::volume::Grid;

/// How much slopes are held back, relative to what the window's width gives them: enough to solve for few neighbours.
const RIDGE: f64 = 0.005;

/// The filter.
#[derive(Clone, Debug)]
pub struct Fit<const D: usize> {
    camera: Camera<D>,
    spacing: f64,
    window: Window,
    sampling: Sampling,
    /// The share of the interpolated values' variance that fits leave out, measured: a third in 4D, a seventh in 3D.
    left_out: f64,
}

/// Sums over a window, lane by lane.
struct Sums {
    groups: Vec<Group>,
}

/// Sums over the groups of neighbours that begin at the same offset along x: of weights w and of squared weights times
/// (1, j, k, jj, jk, kk), of w y and w q times (1, j, k), and of w y^2, w y q and w q^2. y is occlusion and q what is
/// interpolated, both less those of the voxel itself.
#[derive(Clone, Default)]
struct Group {
    weight: [Lanes; 6],
    square: [Lanes; 6],
    value: [[Lanes; 3]; 2],
    scatter: [Lanes; 3],
}

/// What the surroundings of a voxel say.
struct Fitted {
    value: f64,
    /// The variance of the fit, as a share of that of one value.
    spread: f64,
    /// The variance of what lines leave out.
    misfit: f64,
}

impl<const D: usize> Fit<D> {
    /// For images of this grid whose occlusion comes from these rays a voxel.
    pub fn new(camera: &Camera<D>, grid: &Grid, sampling: Sampling) -> Self {
        let dimension = Dimension::of::<D>();
        let wide = dimension.pick(8, 3);
        // Half at the ends.
        let by_offset = (0..=wide).map(|i| if i == wide { 0.5 } else { 1.0 }).collect();
        let spacing = super::spacing::<D>(grid);
        let left_out = dimension.pick(0.15, 0.35);
        Self { camera: camera.clone(), spacing, window: Window::new(D - 1, by_offset), sampling, left_out }
    }

    /// Adds up the window of a voxel.
    fn sum(&self, planes: &Planes<D>, occlusion: &[f32], interpolated: &[f32], voxel: [usize; 3], sums: &mut Sums) {
        sums.groups.iter_mut().for_each(|group| *group = Group::default());
        let here = planes.place(voxel);
        let own = occlusion[here];
        let mended = interpolated.get(here).copied();
        self.window.visit(planes, voxel, |group, [j, k], at, weights| {
            let Group { weight, square, value, scatter } = &mut sums.groups[group];
            let y = lanes(occlusion, at).map(|y| y - own);
            let squares: Lanes = std::array::from_fn(|l| weights[l] * weights[l]);
            for (sum, factor) in weight.iter_mut().zip([1.0, j, k, j * j, j * k, k * k]) {
                (0..LANES).for_each(|l| sum[l] += weights[l] * factor);
            }
            for (sum, factor) in square.iter_mut().zip([1.0, j, k, j * j, j * k, k * k]) {
                (0..LANES).for_each(|l| sum[l] += squares[l] * factor);
            }
            let wy: Lanes = std::array::from_fn(|l| weights[l] * y[l]);
            for (sum, factor) in value[0].iter_mut().zip([1.0, j, k]) {
                (0..LANES).for_each(|l| sum[l] += wy[l] * factor);
            }
            (0..LANES).for_each(|l| scatter[0][l] += wy[l] * y[l]);
            if let Some(own) = mended {
                let q = lanes(interpolated, at).map(|q| q - own);
                let wq: Lanes = std::array::from_fn(|l| weights[l] * q[l]);
                for (sum, factor) in value[1].iter_mut().zip([1.0, j, k]) {
                    (0..LANES).for_each(|l| sum[l] += wq[l] * factor);
                }
                (0..LANES).for_each(|l| scatter[1][l] += wy[l] * q[l]);
                (0..LANES).for_each(|l| scatter[2][l] += wq[l] * q[l]);
            }
        });
    }

    /// What the sums say of a voxel with this occlusion of its own, and whether differences are known.
    fn solve(&self, sums: &Sums, own: f32, mended: bool) -> Option<Fitted> {
        let mut moments = self.moments(sums, |group| &group.weight);
        let squares = self.moments(sums, |group| &group.square);
        let weight = moments[(0, 0)];
        for (a, &radius) in self.window.radius.iter().enumerate() {
            // An axis that the image lacks has no slope.
            moments[(a + 1, a + 1)] += match radius {
                0 => 1.0,
                r => RIDGE * weight * (r * (r + 1)) as f64 / 3.0,
            };
        }
        let inverse = moments.try_inverse()?;
        // The result is the sum of s y with s = w (c . f), c the first row of the inverse, f = (1, i, j, k).
        let c = inverse.column(0).into_owned();
        let spread = (c.transpose() * squares * c)[0];
        let freedom = weight - (inverse * squares).trace();
        let values = self.values(sums, 0);
        let [yy, yq, qq] = [0, 1, 2].map(|n| total(sums.groups.iter().map(|group| &group.scatter[n])));
        let scatter = |values: &Vector4<f64>, square: f64| -> f64 {
            let left = square - values.dot(&(inverse * values));
            if freedom > 1e-3 * weight { left.max(0.0) / freedom } else { 0.25 }
        };
        let plain = f64::from(own) + c.dot(&values);
        if !mended {
            return Some(Fitted { value: plain.clamp(0.0, 1.0), spread, misfit: 0.0 });
        }
        let smooth = self.values(sums, 1);
        let differences = values - smooth;
        let better = scatter(&differences, yy - 2.0 * yq + qq) < scatter(&values, yy);
        // To the voxel's own difference the fit of the others' adds; its interpolated value comes on top of both.
        let value = if better { f64::from(own) + c.dot(&differences) } else { plain };
        Some(Fitted { value: value.clamp(0.0, 1.0), spread, misfit: self.left_out * scatter(&smooth, qq) })
    }

    /// The sums of w f f^T.
    fn moments(&self, sums: &Sums, of: impl Fn(&Group) -> &[Lanes; 6]) -> Matrix4<f64> {
        let [mut m0, mut m1, mut m2] = [[0.0; 6]; 3];
        for (g, group) in sums.groups.iter().enumerate() {
            for (n, by_lane) in of(group).iter().enumerate() {
                for (l, &sum) in by_lane.iter().enumerate() {
                    let (sum, i) = (f64::from(sum), self.window.offset(g, l));
                    m0[n] += sum;
                    m1[n] += sum * i;
                    m2[n] += sum * i * i;
                }
            }
        }
        let [w, j, k, jj, jk, kk] = m0;
        let [i, ij, ik, ..] = m1;
        let ii = m2[0];
        Matrix4::new(w, i, j, k, i, ii, ij, ik, j, ij, jj, jk, k, ik, jk, kk)
    }

    /// The sums of w f y, of occlusion (0) or of what is interpolated (1).
    fn values(&self, sums: &Sums, which: usize) -> Vector4<f64> {
        let mut found = Vector4::zeros();
        for (g, group) in sums.groups.iter().enumerate() {
            let [one, j, k] = &group.value[which];
            for l in 0..LANES {
                let sum = f64::from(one[l]);
                found += Vector4::new(sum, sum * self.window.offset(g, l), f64::from(j[l]), f64::from(k[l]));
            }
        }
        found
    }
}

fn total<'l>(groups: impl Iterator<Item = &'l Lanes>) -> f64 {
    groups.flatten().map(|&x| f64::from(x)).sum()
}

impl<const D: usize> ImageFilter<D> for Fit<D> {
    fn columns(&self) -> Columns {
        super::COLUMNS
    }

    fn halo(&self) -> usize {
        self.window.radius[2]
    }

    fn apply(&self, input: &GBuffer<D>, out: &mut GBuffer<D>, progress: &dyn Progress) -> Result<(), Error> {
        let [width, height, _] = input.dimensions();
        let planes = Planes::new(input, &self.camera, self.spacing, self.window.radius[0]);
        let occlusion = planes.plane(|n| input.occlusion[n]);
        let interpolated = match input.interpolated.is_empty() {
            true => Vec::new(),
            false => planes.plane(|n| input.interpolated[n]),
        };
        let before = out.layers().start - input.layers().start;
        let dimension = Dimension::of::<D>();
        out.rows_mut().into_par_iter().enumerate().try_for_each_init(
            || Sums { groups: vec![Group::default(); self.window.groups()] },
            |sums, (row, out)| {
                let (j, k) = (row % height, row / height + before);
                if !planes.shows([j, k]) {
                    return Ok(());
                }
                if progress.cancelled() {
                    return Err(Error::Cancelled);
                }
                for x in (0..width).filter(|&x| out.simplex[x] != NOTHING) {
                    self.sum(&planes, &occlusion, &interpolated, [x, j, k], sums);
                    let (own, mended) = (out.occlusion[x], !interpolated.is_empty());
                    // A voxel that can't be fitted keeps its own.
                    let alone = Fitted { value: f64::from(own), spread: 1.0, misfit: 0.0 };
                    let Fitted { value, spread, misfit } = self.solve(sums, own, mended).unwrap_or(alone);
                    let noise = self.sampling.expected_variance(dimension, value);
                    out.fitted[x] = value as f32;
                    out.error[x] = (noise * spread).sqrt() as f32;
                    out.misfit[x] = misfit as f32;
                }
                Ok(())
            },
        )
    }
}
