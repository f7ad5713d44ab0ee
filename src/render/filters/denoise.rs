//! Denoising of ambient occlusion: a weighted local linear fit over the image.
//!
//! Around each voxel that shows something, `a + b . (offset in the image)` is fitted to the occlusion of its neighbours by
//! weighted least squares, and the voxel takes `a` (local linear regression; Cleveland, *Robust Locally Weighted
//! Regression*, 1979). A mean would pull values towards the inside at every edge of a body and across every gradient; a
//! linear fit does not. Neighbours count by
//!
//! - the object they show: only the same one;
//! - their normals: `(n . n')^32`;
//! - their distance d from the voxel's tangent plane in footprints of a voxel: about `exp(-d^2)`;
//! - their place in the window: half at its ends along each axis.
//!
//! A value that stands out from its fit by more than noise can is no noise: where a body touches another, occlusion jumps
//! from voxel to voxel. Beyond three standard deviations of a value by so many rays, `sqrt(p (1 - p) / n)` times what even
//! points leave of it, about `n^(-1/4)`, more and more of the value itself is kept.
//!
//! Where an interpolated value is known beside each voxel's own, a second line is fitted to their differences: what the
//! vertices' values show already need not be found again, and is not smoothed away. Of the two fits that counts about
//! which the values scatter less.
//!
//! An image of three axes has many neighbours close by: a window 7 voxels wide holds 343, where one of two axes has to be
//! 17 wide for 289. The fit's own scatter and the weights tell the standard error of the result.
//!
//! Sums are taken for whole rows of voxels at once, neighbour by neighbour, which compilers turn into SIMD code. What a
//! voxel gets depends on its window alone, so neither slabs nor threads change a bit.

use nalgebra::{Matrix4, Vector4};
use rayon::prelude::*;

use super::ImageFilter;
use crate::occlusion::Error;
use crate::progress::Progress;
use crate::render::gbuffer::{Columns, GBuffer};
use crate::render::{Camera, NOTHING};
use crate::volume::Grid;

/// How much slopes are held back, relative to what the window's width gives them: enough to solve for few neighbours.
const RIDGE: f64 = 0.005;

/// The filter.
#[derive(Clone, Debug)]
pub struct Denoise<const D: usize> {
    camera: Camera<D>,
    /// The smallest side of a voxel in the image.
    spacing: f64,
    /// How far the window reaches along each axis of the image.
    radius: [usize; 3],
    /// Rays of a voxel.
    rays: u32,
}

impl<const D: usize> Denoise<D> {
    /// For images of this grid whose occlusion comes from so many rays a voxel.
    pub fn new(camera: &Camera<D>, grid: &Grid, rays: u32) -> Self {
        let axes = D - 1;
        let wide = if axes == 3 { 3 } else { 8 };
        let spacing = grid.spacing[..axes].iter().copied().fold(f64::INFINITY, f64::min);
        let radius = std::array::from_fn(|a| if a < axes { wide } else { 0 });
        Self { camera: camera.clone(), spacing, radius, rays }
    }
}

/// Columns as plain numbers, component by component, of all voxels of the input.
struct Planes<const D: usize> {
    position: [Vec<f32>; D],
    normal: [Vec<f32>; D],
    /// Zero where nothing is seen.
    object: Vec<f32>,
    /// The occlusion less what is interpolated, where that is known; else empty.
    difference: Vec<f32>,
    /// Whether a row shows anything.
    rows: Vec<bool>,
}

impl<const D: usize> Planes<D> {
    fn new(input: &GBuffer<D>) -> Self {
        let width = input.dimensions()[0];
        let component = |of: &Vec<crate::geometry::Vector<D>>, d: usize| of.par_iter().map(|v| v[d]).collect();
        Self {
            position: std::array::from_fn(|d| component(&input.position, d)),
            normal: std::array::from_fn(|d| component(&input.normal, d)),
            object: input.object.par_iter().map(|&o| f32::from(o)).collect(),
            difference: input.occlusion.par_iter().zip(&input.interpolated).map(|(a, b)| a - b).collect(),
            rows: input.simplex.par_chunks(width).map(|row| row.iter().any(|&s| s != NOTHING)).collect(),
        }
    }
}

/// Sums of weights w and values y over one row of neighbours, for each voxel of a row: powers of the offset i along x.
#[derive(Default)]
struct RowSums {
    /// w, w i, w i^2
    weight: [Vec<f32>; 3],
    /// w^2, w^2 i, w^2 i^2
    square: [Vec<f32>; 3],
    /// w y, w i y, w y^2, of the values and of the differences.
    value: [[Vec<f32>; 3]; 2],
}

/// Sums over the whole window, for each voxel of a row: the upper triangles of sums of w f f^T and w^2 f f^T with f =
/// (1, i, j, k), the sums of w f y, and that of w y^2.
struct Sums {
    moments: [Vec<f32>; 10],
    squares: [Vec<f32>; 10],
    values: [Values; 2],
}

/// The sums of w f y and of w y^2, of the values or of the differences.
struct Values {
    moments: [Vec<f32>; 4],
    squares: Vec<f32>,
}

/// A fit at one voxel.
struct Fit {
    value: f64,
    /// The variance of one value about it.
    variance: f64,
}

/// Working memory of one thread.
struct Scratch {
    cosine: Vec<f32>,
    distance: Vec<f32>,
    /// One over the footprint of each voxel of the row.
    per_footprint: Vec<f32>,
    row: RowSums,
    sums: Sums,
}

impl Scratch {
    fn new(width: usize) -> Self {
        let zeros = || vec![0.0; width];
        let row = RowSums {
            weight: std::array::from_fn(|_| zeros()),
            square: std::array::from_fn(|_| zeros()),
            value: std::array::from_fn(|_| std::array::from_fn(|_| zeros())),
        };
        let sums = Sums {
            moments: std::array::from_fn(|_| zeros()),
            squares: std::array::from_fn(|_| zeros()),
            values: std::array::from_fn(|_| Values { moments: std::array::from_fn(|_| zeros()), squares: zeros() }),
        };
        Self { cosine: zeros(), distance: zeros(), per_footprint: zeros(), row, sums }
    }
}

impl RowSums {
    fn clear(&mut self) {
        let values = self.value.iter_mut().flatten();
        self.weight.iter_mut().chain(&mut self.square).chain(values).for_each(|sums| sums.fill(0.0));
    }

    /// Adds the weights of neighbours at offset `i`, of which voxel `first` has the first.
    fn add(&mut self, first: usize, i: f32, weights: &[f32]) {
        let range = first..first + weights.len();
        let [w0, w1, w2] = self.weight.each_mut().map(|sums| &mut sums[range.clone()]);
        for (((w0, w1), w2), &w) in w0.iter_mut().zip(w1).zip(w2).zip(weights) {
            *w0 += w;
            *w1 += w * i;
            *w2 += w * i * i;
        }
        let [s0, s1, s2] = self.square.each_mut().map(|sums| &mut sums[range.clone()]);
        for (((s0, s1), s2), &w) in s0.iter_mut().zip(s1).zip(s2).zip(weights) {
            *s0 += w * w;
            *s1 += w * w * i;
            *s2 += w * w * i * i;
        }
    }

    /// Adds the values of the same neighbours, or their differences.
    fn add_values(&mut self, which: usize, first: usize, i: f32, weights: &[f32], values: &[f32]) {
        let range = first..first + weights.len();
        let [v0, v1, v2] = self.value[which].each_mut().map(|sums| &mut sums[range.clone()]);
        for ((((v0, v1), v2), &w), &y) in v0.iter_mut().zip(v1).zip(v2).zip(weights).zip(values) {
            *v0 += w * y;
            *v1 += w * y * i;
            *v2 += w * y * y;
        }
    }
}

impl Sums {
    fn clear(&mut self) {
        let values = self.values.iter_mut().flat_map(|values| values.moments.iter_mut().chain([&mut values.squares]));
        self.moments.iter_mut().chain(&mut self.squares).chain(values).for_each(|sums| sums.fill(0.0));
    }

    /// Adds a row of neighbours at offsets `j` and `k`.
    fn add(&mut self, row: &RowSums, j: f32, k: f32) {
        for (all, [r0, r1, r2]) in [(&mut self.moments, &row.weight), (&mut self.squares, &row.square)] {
            // The pairs of (1, i, j, k) in the order 11 1i 1j 1k ii ij ik jj jk kk.
            let terms = [
                (r0, 1.0),
                (r1, 1.0),
                (r0, j),
                (r0, k),
                (r2, 1.0),
                (r1, j),
                (r1, k),
                (r0, j * j),
                (r0, j * k),
                (r0, k * k),
            ];
            for (sums, (row, factor)) in all.iter_mut().zip(terms) {
                sums.iter_mut().zip(row).for_each(|(sum, &r)| *sum += r * factor);
            }
        }
        for (values, [v0, v1, v2]) in self.values.iter_mut().zip(&row.value) {
            for (sums, (row, factor)) in values.moments.iter_mut().zip([(v0, 1.0), (v1, 1.0), (v0, j), (v0, k)]) {
                sums.iter_mut().zip(row).for_each(|(sum, &r)| *sum += r * factor);
            }
            values.squares.iter_mut().zip(v2).for_each(|(sum, &r)| *sum += r);
        }
    }

    /// The occlusion at voxel `x`, whose own is `raw`, and its standard error; by the fit that values scatter less about:
    /// that to the values, or that to their differences from what is `interpolated`.
    fn fit(&self, x: usize, raw: f32, interpolated: Option<f32>, radius: &[usize; 3], rays: u32) -> Option<(f32, f32)> {
        let symmetric = |of: &[Vec<f32>; 10]| {
            let [a, b, c, d, e, f, g, h, i, j] = of.each_ref().map(|sums| f64::from(sums[x]));
            Matrix4::new(a, b, c, d, b, e, f, g, c, f, h, i, d, g, i, j)
        };
        let (mut moments, squares) = (symmetric(&self.moments), symmetric(&self.squares));
        let weight = moments[(0, 0)];
        for (a, &radius) in radius.iter().enumerate() {
            // An axis that the image lacks has no slope.
            moments[(a + 1, a + 1)] += match radius {
                0 => 1.0,
                r => RIDGE * weight * (r * (r + 1)) as f64 / 3.0,
            };
        }
        let inverse = moments.try_inverse()?;
        // The result is the sum of s y with s = w (c . f), c the first row of the inverse.
        let c = inverse.column(0).into_owned();
        let spread = (c.transpose() * squares * c)[0];
        let freedom = weight - (inverse * squares).trace();
        let fit = |values: &Values, base: f32| {
            let moments = Vector4::from_fn(|f, _| f64::from(values.moments[f][x]));
            let coefficients = inverse * moments;
            let scatter = f64::from(values.squares[x]) - coefficients.dot(&moments);
            let variance = if freedom > 1e-3 * weight { scatter.max(0.0) / freedom } else { 0.25 };
            Fit { value: (f64::from(base) + coefficients[0]).clamp(0.0, 1.0), variance }
        };
        let [values, differences] = &self.values;
        let plain = fit(values, 0.0);
        let mended = interpolated.map(|base| fit(differences, base)).filter(|mended| mended.variance < plain.variance);
        let Fit { value, variance } = mended.unwrap_or(plain);
        // Neighbours that all agree are not certain either: the rule of three, as for the rays of one point.
        let rays = f64::from(rays.max(1));
        let fitted = (variance * spread).max((1.5 * spread / rays).powi(2));
        let noise = ((value * (1.0 - value)).max(0.25 / rays) / rays / rays.sqrt()).sqrt();
        let kept = kept(f64::from(raw) - value, 3.0 * noise);
        let error = (fitted * (1.0 - kept) + (kept * noise).powi(2)).sqrt().min(1.0);
        let value = value + kept * (f64::from(raw) - value);
        value.is_finite().then_some((value as f32, error as f32))
    }
}

/// The part of a difference that is kept: none up to the threshold, nearly all far beyond it.
fn kept(difference: f64, threshold: f64) -> f64 {
    if difference.abs() > threshold { 1.0 - (threshold / difference).powi(2) } else { 0.0 }
}

/// The weight of a neighbour by the cosine of the normals and the distance from the tangent plane in footprints.
#[inline(always)]
fn weight(cosine: f32, distance: f32) -> f32 {
    let c = cosine.max(0.0);
    let (c2, d2) = (c * c, distance * distance);
    let (c4, near) = (c2 * c2, (1.0 - d2 * 0.25).max(0.0));
    let (c8, near2) = (c4 * c4, near * near);
    let c16 = c8 * c8;
    c16 * c16 * near2 * near2
}

impl<const D: usize> Denoise<D> {
    /// Sums over the window of each voxel of a row of the input, counted in its layers.
    fn sum(&self, input: &GBuffer<D>, planes: &Planes<D>, [j, k]: [usize; 2], scratch: &mut Scratch) {
        let [width, height, _] = input.dimensions();
        let layers = input.layers().len();
        let here = (k * height + j) * width;
        let Scratch { cosine, distance, per_footprint, row, sums } = scratch;
        for (x, footprint) in per_footprint.iter_mut().enumerate() {
            let distance = match self.camera.is_parallel() {
                true => 1.0,
                false => self.camera.project(&input.position[here + x]).1,
            };
            *footprint = if planes.object[here + x] > 0.0 { (1.0 / (self.spacing * distance)) as f32 } else { 0.0 };
        }
        sums.clear();
        let [rx, ry, rz] = self.radius.map(|r| r as isize);
        for dk in -rz..=rz {
            for dj in -ry..=ry {
                let (Some(nk), Some(nj)) = (k.checked_add_signed(dk), j.checked_add_signed(dj)) else { continue };
                if nk >= layers || nj >= height || !planes.rows[nk * height + nj] {
                    continue;
                }
                let there = (nk * height + nj) * width;
                let across = end_weight(dk, rz) * end_weight(dj, ry);
                row.clear();
                for di in -rx..=rx {
                    let first = (-di).max(0) as usize;
                    let len = width.saturating_sub(di.unsigned_abs());
                    if len == 0 {
                        continue;
                    }
                    let a = here + first..here + first + len;
                    let b = (there + first).wrapping_add_signed(di);
                    let b = b..b + len;
                    let (cosine, distance) = (&mut cosine[..len], &mut distance[..len]);
                    cosine.fill(0.0);
                    distance.fill(0.0);
                    for d in 0..D {
                        let (na, nb) = (&planes.normal[d][a.clone()], &planes.normal[d][b.clone()]);
                        let (pa, pb) = (&planes.position[d][a.clone()], &planes.position[d][b.clone()]);
                        cosine.iter_mut().zip(na).zip(nb).for_each(|((c, na), nb)| *c += na * nb);
                        for (((q, na), pa), pb) in distance.iter_mut().zip(na).zip(pa).zip(pb) {
                            *q += na * (pb - pa);
                        }
                    }
                    let kernel = across * end_weight(di, rx);
                    let (oa, ob) = (&planes.object[a], &planes.object[b.clone()]);
                    let footprints = &per_footprint[first..first + len];
                    // The cosine becomes the weight.
                    for ((((c, q), f), oa), ob) in cosine.iter_mut().zip(&*distance).zip(footprints).zip(oa).zip(ob) {
                        let w = kernel * weight(*c, q * f);
                        *c = if oa == ob { w } else { 0.0 };
                    }
                    row.add(first, di as f32, cosine);
                    row.add_values(0, first, di as f32, cosine, &input.occlusion[b.clone()]);
                    if !planes.difference.is_empty() {
                        row.add_values(1, first, di as f32, cosine, &planes.difference[b]);
                    }
                }
                sums.add(row, dj as f32, dk as f32);
            }
        }
    }
}

/// Half at the ends of the window.
fn end_weight(offset: isize, radius: isize) -> f32 {
    if radius > 0 && offset.abs() == radius { 0.5 } else { 1.0 }
}

impl<const D: usize> ImageFilter<D> for Denoise<D> {
    fn columns(&self) -> Columns {
        Columns::SIMPLEX | Columns::POSITION | Columns::NORMAL | Columns::OBJECT | Columns::OCCLUSION | Columns::ERROR
    }

    fn halo(&self) -> usize {
        self.radius[2]
    }

    fn apply(&self, input: &GBuffer<D>, out: &mut GBuffer<D>, progress: &dyn Progress) -> Result<(), Error> {
        let [width, height, _] = input.dimensions();
        let planes = Planes::new(input);
        let before = out.layers().start - input.layers().start;
        let rows = out.rows_mut().into_par_iter().enumerate();
        rows.try_for_each_init(
            || Scratch::new(width),
            |scratch, (row, out)| {
                let (j, k) = (row % height, row / height + before);
                if !planes.rows[k * height + j] {
                    return Ok(());
                }
                if progress.cancelled() {
                    return Err(Error::Cancelled);
                }
                self.sum(input, &planes, [j, k], scratch);
                for x in (0..width).filter(|&x| out.simplex[x] != NOTHING) {
                    let (own, interpolated) = (out.occlusion[x], out.interpolated.get(x).copied());
                    if let Some((value, error)) = scratch.sums.fit(x, own, interpolated, &self.radius, self.rays) {
                        (out.occlusion[x], out.error[x]) = (value, error);
                    }
                }
                Ok(())
            },
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vector;
    use crate::progress::Silent;
    use crate::render::{Projection, View};

    const COLUMNS: Columns = Columns::SIMPLEX
        .union(Columns::POSITION)
        .union(Columns::NORMAL)
        .union(Columns::OBJECT)
        .union(Columns::OCCLUSION)
        .union(Columns::ERROR);

    /// Numbers from 0 to 1, evenly spread, the same each time.
    fn noise(n: usize) -> f64 {
        let mut x = (n as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        x = (x ^ (x >> 31)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        (x >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A flat wall across the line of sight that fills the image, of occlusion `truth` and so much noise on it; and the
    /// filter. Objects are told by `object`.
    fn wall(
        truth: impl Fn([usize; 3]) -> f64,
        object: impl Fn([usize; 3]) -> u16,
        amplitude: f64,
    ) -> (GBuffer<4>, Denoise<4>) {
        let view = View { projection: Projection::Parallel { height: 2.0 }, ..View::<4>::default() };
        let camera = Camera::new(&view).unwrap();
        let grid = camera.grid([20, 20, 20]);
        let mut buffer = GBuffer::new(grid.dimensions, 0..20, COLUMNS);
        for n in 0..buffer.len() {
            let index = grid.index(n);
            let [x, y, z] = grid.point(index).map(|c| c as f32);
            buffer.simplex[n] = 0;
            buffer.object[n] = object(index);
            buffer.position[n] = Vector::from([x, y, z, 0.0]);
            buffer.normal[n] = Vector::from([0.0, 0.0, 0.0, 1.0]);
            buffer.occlusion[n] = (truth(index) + amplitude * (2.0 * noise(n) - 1.0)) as f32;
        }
        (buffer, Denoise::new(&camera, &grid, 16))
    }

    fn filtered(buffer: &GBuffer<4>, filter: &Denoise<4>) -> GBuffer<4> {
        let mut out = buffer.clone();
        filter.apply(buffer, &mut out, &Silent).unwrap();
        out
    }

    #[test]
    fn noise_on_a_gradient_goes_and_the_gradient_stays() {
        // Noise of standard deviation 0.046, less than what 16 rays have.
        let truth = |[i, j, k]: [usize; 3]| 0.3 + 0.01 * i as f64 + 0.005 * j as f64 + 0.004 * k as f64;
        let (buffer, filter) = wall(truth, |_| 1, 0.08);
        let out = filtered(&buffer, &filter);
        let (mut squares, mut said, mut sum) = (0.0, 0.0, 0.0);
        for n in 0..out.len() {
            let index = [n % 20, n / 20 % 20, n / 400];
            let error = f64::from(out.occlusion[n]) - truth(index);
            squares += error * error;
            said += f64::from(out.error[n]).powi(2);
            sum += error;
        }
        let count = out.len() as f64;
        let (real, said) = ((squares / count).sqrt(), (said / count).sqrt());
        assert!(real < 0.005, "{real}: some 340 neighbours, fewer at the image's border");
        assert!((0.8..1.6).contains(&(said / real)), "said {said}, real {real}");
        assert!((sum / count).abs() < 5e-4, "biased by {}", sum / count);
    }

    #[test]
    fn rods_one_voxel_thick_are_kept() {
        let rod = |[i, j, _]: [usize; 3]| i % 5 == 2 && j % 5 == 2;
        let truth = |index| if rod(index) { 0.2 } else { 0.9 };
        // Of another object: only its own voxels count.
        let (buffer, filter) = wall(truth, |index| 1 + u16::from(rod(index)), 0.0);
        let out = filtered(&buffer, &filter);
        for n in 0..out.len() {
            let index = [n % 20, n / 20 % 20, n / 400];
            assert!((f64::from(out.occlusion[n]) - truth(index)).abs() < 1e-3, "{index:?}");
        }
        // Of the same object and flush with it: no noise stands out so far.
        let (buffer, filter) = wall(truth, |_| 1, 0.0);
        let out = filtered(&buffer, &filter);
        for n in (0..out.len()).filter(|n| rod([n % 20, n / 20 % 20, n / 400])) {
            assert!((out.occlusion[n] - 0.2).abs() < 0.1, "{}", out.occlusion[n]);
        }
    }

    #[test]
    fn what_is_interpolated_right_stays() {
        // A ripple too fine for any window, which the vertices know of.
        let truth = |[i, j, k]: [usize; 3]| 0.5 + 0.1 * f64::from((i + j + k) as u32 % 2);
        let (mut buffer, filter) = wall(truth, |_| 1, 0.08);
        buffer.interpolated = (0..buffer.len()).map(|n| truth([n % 20, n / 20 % 20, n / 400]) as f32).collect();
        let out = filtered(&buffer, &filter);
        let worst = |of: &[f32]| of.iter().zip(&buffer.interpolated).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(worst(&out.occlusion) < 0.03 && worst(&buffer.occlusion) > 0.07, "{}", worst(&out.occlusion));
    }
}
