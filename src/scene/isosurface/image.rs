//! A field that is a grid of values from a file: cropped, downsampled and smoothed on the way, layer by layer.
//!
//! Each step needs a few layers only: downsampling adds up those that become one, smoothing along the last axis keeps as
//! many as its kernel is wide. Values that are no numbers have no weight in a mean, and stay none where they are in the
//! middle of a kernel: they are outside of whatever there is.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::Error;
use super::super::numbers::{AXES, OneOrEach, point, subdivisions};
use super::march::Layers;
use super::{Seen, Side};
use crate::geometry::Dimension;
use crate::io::image::{self, ByteOrder, Image, Number, Request, Slices};

/// The key in the pipeline.
const KEY: &str = "isosurface.field.image";

/// The widest kernel, in standard deviations of it.
const MOST_SIGMA: f64 = 100.0;

/// A grid of values from a file, or from a file for each step of time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImageSpec {
    /// The file: `.vti`, `.raw`, `.nii`, `.nii.gz`, `.tif`, `.nc` or `.nrrd`, relative to the pipeline's folder.
    #[serde(default)]
    pub file: Option<PathBuf>,
    /// Instead of `file`: files that follow each other in time, of one size.
    #[serde(default)]
    pub files: Vec<PathBuf>,
    /// Which array of a `.vti`, or which variable of a `.nc`, where there are several.
    #[serde(default)]
    pub array: Option<String>,
    /// Points along x, y, z and time: of a raw file, or where a TIFF doesn't say which pages are z and which time.
    #[serde(default)]
    pub dimensions: Option<Vec<usize>>,
    /// The type of a raw file's numbers.
    #[serde(default)]
    pub r#type: Option<Number>,
    /// The order of a raw file's bytes; little if left out.
    #[serde(default)]
    pub byte_order: ByteOrder,
    /// Bytes before the first number of a raw file.
    #[serde(default)]
    pub offset: u64,
    /// Which channel of a TIFF, counted from 0.
    #[serde(default)]
    pub channel: usize,
    /// In a scene of dimension 3: which step of time, counted from 0.
    #[serde(default)]
    pub frame: Option<usize>,
    /// The distance between points along each axis, instead of what the file says; the last one scales time to a length.
    #[serde(default)]
    pub spacing: Option<Vec<f64>>,
    /// Where the first point is, instead of what the file says.
    #[serde(default)]
    pub origin: Option<Vec<f64>>,
    /// Takes a part of the grid.
    #[serde(default)]
    pub crop: Option<CropSpec>,
    /// Takes the mean of so many points along each axis, or along all, as one.
    #[serde(default)]
    pub downsample: Option<OneOrEach<u32>>,
    /// Smooths with a Gaussian of this standard deviation, in points (after downsampling), along all axes or each.
    #[serde(default)]
    pub smooth: Option<OneOrEach<f64>>,
}

/// A part of a grid, by indices counted from 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CropSpec {
    /// The first index along each axis.
    pub from: Vec<usize>,
    /// The index after the last along each axis.
    pub to: Vec<usize>,
}

impl ImageSpec {
    /// The files it reads, as the pipeline names them.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.file.iter().chain(&self.files).map(PathBuf::as_path)
    }

    /// All files it reads, those among them that other files name; `folder` is the pipeline's.
    pub fn input_files(&self, folder: &Path) -> Vec<PathBuf> {
        let files = self.files().map(|file| folder.join(file));
        files.flat_map(|file| [image::data_files(&file), vec![file]].concat()).collect()
    }

    /// Opens the image, and finds where the points are that remain of it.
    pub fn open<const D: usize>(
        &self,
        folder: &Path,
        isovalue: f64,
        inside: Side,
    ) -> Result<(ImageLayers<D>, [Vec<f64>; D]), Error> {
        let wrong = |key: &str, message: String| Error::invalid(format!("{KEY}.{key}"), message);
        if self.file.is_some() != self.files.is_empty() {
            return Err(Error::invalid(KEY, "give one of file and files"));
        }
        let request = Request {
            array: self.array.clone(),
            dimensions: self.dimensions.as_ref().map(|d| four(d)).transpose().map_err(|m| wrong("dimensions", m))?,
            number: self.r#type,
            byte_order: self.byte_order,
            offset: self.offset,
            channel: self.channel,
        };
        let files: Vec<PathBuf> = self.files().map(Path::to_owned).collect();
        let key = format!("{KEY}.{}", if self.file.is_some() { "file" } else { "files" });
        let Image { header, slices } = image::open(&key, folder, &files, &request)?;
        let mut positions: [Vec<f64>; D] = std::array::from_fn(|axis| header.positions[axis].clone());
        let frame = match (Dimension::of::<D>(), self.frame, header.points[3]) {
            (Dimension::Three, frame, frames) if frame.unwrap_or(0) >= frames => {
                return Err(wrong("frame", format!("there are {frames}, counted from 0")));
            }
            (Dimension::Three, None, 2..) => {
                let frames = header.points[3];
                return Err(wrong("frame", format!("the image has {frames} steps of time; say which one, from 0")));
            }
            (Dimension::Three, frame, _) => frame.unwrap_or(0),
            (Dimension::Four, Some(_), _) => {
                return Err(wrong("frame", "only a scene of dimension 3 takes a single frame".into()));
            }
            (Dimension::Four, None, 1) => {
                let message = "the image has one step of time only; take dimension: 3, files, or dimensions";
                return Err(Error::invalid(KEY, message));
            }
            (Dimension::Four, None, _) => 0,
        };
        self.place(&mut positions)?;
        let (from, to) = self.crop(&positions)?;
        let factors = match &self.downsample {
            Some(factors) => subdivisions::<D>(&format!("{KEY}.downsample"), factors)?.map(|n| n as usize),
            None => [1; D],
        };
        let sigmas = match &self.smooth {
            Some(sigmas) => sigmas.each::<D>(&format!("{KEY}.smooth"))?,
            None => [0.0; D],
        };
        if let Some(sigma) = sigmas.iter().find(|sigma| !(0.0..=MOST_SIGMA).contains(*sigma)) {
            return Err(wrong("smooth", format!("{sigma} is not from 0 to {MOST_SIGMA}")));
        }
        let mut axes: [Vec<f64>; D] = std::array::from_fn(|_| Vec::new());
        for axis in 0..D {
            let block = |block: &[f64]| block.iter().sum::<f64>() / block.len() as f64;
            axes[axis] = positions[axis][from[axis]..to[axis]].chunks_exact(factors[axis]).map(block).collect();
            if axes[axis].is_empty() {
                let left = to[axis] - from[axis];
                let message = format!("{} points along {} don't make one of {}", left, AXES[axis], factors[axis]);
                return Err(wrong("downsample", message));
            }
        }
        let layers = ImageLayers {
            slices,
            skip: frame * header.points[2] + from[D - 1] * slices_a_layer::<D>(&header.points),
            points: std::array::from_fn(|axis| positions[axis].len()),
            from,
            to,
            factors,
            sizes: std::array::from_fn(|axis| axes[axis].len()),
            kernels: sigmas.map(kernel),
            window: VecDeque::new(),
            made: 0,
            done: 0,
            isovalue,
            sign: if inside == Side::Below { -1.0 } else { 1.0 },
            blame: key,
            seen: Seen::default(),
        };
        Ok((layers, axes))
    }

    /// Applies `spacing` and `origin`.
    fn place<const D: usize>(&self, positions: &mut [Vec<f64>; D]) -> Result<(), Error> {
        if let Some(spacing) = &self.spacing {
            let key = format!("{KEY}.spacing");
            let spacing = point::<D>(&key, spacing)?;
            if let Some(step) = spacing.iter().find(|step| **step <= 0.0) {
                return Err(Error::invalid(key, format!("{step} is not above 0")));
            }
            for (positions, step) in positions.iter_mut().zip(spacing.iter()) {
                let start = positions[0];
                positions.iter_mut().enumerate().for_each(|(i, at)| *at = start + i as f64 * step);
            }
        }
        if let Some(origin) = &self.origin {
            let origin = point::<D>(&format!("{KEY}.origin"), origin)?;
            for (positions, origin) in positions.iter_mut().zip(origin.iter()) {
                let shift = origin - positions[0];
                positions.iter_mut().for_each(|at| *at += shift);
            }
        }
        Ok(())
    }

    fn crop<const D: usize>(&self, positions: &[Vec<f64>; D]) -> Result<([usize; D], [usize; D]), Error> {
        let sizes: [usize; D] = std::array::from_fn(|axis| positions[axis].len());
        let Some(crop) = &self.crop else { return Ok(([0; D], sizes)) };
        let each = |key: &str, list: &[usize]| OneOrEach::Each(list.to_vec()).each::<D>(&format!("{KEY}.crop.{key}"));
        let (from, to) = (each("from", &crop.from)?, each("to", &crop.to)?);
        for axis in 0..D {
            if from[axis] >= to[axis] || to[axis] > sizes[axis] {
                let message = format!(
                    "{} goes from {} to {}; there are {} points, and to must be above from",
                    AXES[axis], from[axis], to[axis], sizes[axis]
                );
                return Err(Error::invalid(format!("{KEY}.crop"), message));
            }
        }
        Ok((from, to))
    }
}

/// Sizes along x, y, z and time; those left out are 1.
fn four(dimensions: &[usize]) -> Result<[usize; 4], String> {
    if !(2..=4).contains(&dimensions.len()) || dimensions.contains(&0) {
        return Err(format!("expected the points along x, y, z and time, found {dimensions:?}"));
    }
    Ok(std::array::from_fn(|axis| dimensions.get(axis).copied().unwrap_or(1)))
}

/// Half a Gaussian: the weights of the middle and of those next to it; the middle alone without smoothing.
fn kernel(sigma: f64) -> Vec<f64> {
    let reach = (3.0 * sigma).ceil() as i32;
    (0..=reach).map(|i| if i == 0 { 1.0 } else { libm::exp(-0.5 * (f64::from(i) / sigma).powi(2)) }).collect()
}

/// How many slices of an image one layer of the grid is: one in 3D, in 4D a whole step of time.
fn slices_a_layer<const D: usize>(points: &[usize]) -> usize {
    match Dimension::of::<D>() {
        Dimension::Three => 1,
        Dimension::Four => points[2],
    }
}

/// An image, layer by layer.
pub struct ImageLayers<const D: usize> {
    slices: Box<dyn Slices>,
    /// Slices to pass over first.
    skip: usize,
    /// The whole grid's points.
    points: [usize; D],
    from: [usize; D],
    to: [usize; D],
    factors: [usize; D],
    /// What remains.
    sizes: [usize; D],
    kernels: [Vec<f64>; D],
    /// Layers smoothed within themselves, the last of those made.
    window: VecDeque<Vec<f32>>,
    made: usize,
    done: usize,
    isovalue: f64,
    sign: f64,
    blame: String,
    /// What was met.
    pub(super) seen: Seen,
}

impl<const D: usize> ImageLayers<D> {
    fn slice(&mut self) -> Result<Vec<f64>, Error> {
        self.slices.next().map_err(|message| Error::invalid(&self.blame, message))
    }

    /// The next layer, cropped and downsampled: how far inside its points are.
    fn read(&mut self) -> Result<Vec<f32>, Error> {
        for _ in 0..std::mem::take(&mut self.skip) {
            self.slice()?;
        }
        let size: usize = self.sizes[..D - 1].iter().product();
        if self.factors == [1; D] {
            return self.read_as_it_is(size);
        }
        let (mut sums, mut counts) = (vec![0f64; size], vec![0u32; size]);
        let mut numbers = 0u64;
        let slices = slices_a_layer::<D>(&self.points);
        for _ in 0..self.factors[D - 1] {
            for z in 0..slices {
                let slice = self.slice()?;
                let Some(z) = self.place_in_layer(z) else { continue };
                for (y, row) in slice.chunks_exact(self.points[0]).enumerate() {
                    let Some(y) = self.place(1, y) else { continue };
                    let start = self.sizes[0] * (y + self.sizes[1] * z);
                    let row = &row[self.from[0]..self.from[0] + self.sizes[0] * self.factors[0]];
                    for (x, values) in row.chunks_exact(self.factors[0]).enumerate() {
                        for value in values.iter().filter(|value| !value.is_nan()) {
                            sums[start + x] += self.sign * (value - self.isovalue);
                            counts[start + x] += 1;
                            numbers += 1;
                        }
                    }
                }
            }
        }
        let looked_at = size as u64 * self.factors.iter().product::<usize>() as u64;
        self.seen.looked_at += looked_at;
        self.seen.missing += looked_at - numbers;
        // Of what downsampling leaves over at the end nobody asks any more.
        Ok(sums
            .into_iter()
            .zip(counts)
            .map(|(sum, n)| if n == 0 { f32::NAN } else { (sum / f64::from(n)) as f32 })
            .collect())
    }

    /// The same without downsampling: nothing to add up.
    fn read_as_it_is(&mut self, size: usize) -> Result<Vec<f32>, Error> {
        let (width, area) = (self.sizes[0], self.sizes[0] * self.sizes[1]);
        let mut layer = vec![0f32; size];
        for z in 0..slices_a_layer::<D>(&self.points) {
            let slice = self.slice()?;
            let Some(z) = self.place_in_layer(z) else { continue };
            let (isovalue, sign, from, points) = (self.isovalue, self.sign, self.from, self.points);
            let rows = &mut layer[z * area..][..area];
            rows.par_chunks_mut(width).with_min_len(64).enumerate().for_each(|(y, row)| {
                let start = (y + from[1]) * points[0] + from[0];
                row.iter_mut()
                    .zip(&slice[start..])
                    .for_each(|(slot, value)| *slot = (sign * (value - isovalue)) as f32);
            });
        }
        self.seen.looked_at += size as u64;
        self.seen.missing += layer.par_iter().with_min_len(4096).filter(|depth| depth.is_nan()).count() as u64;
        Ok(layer)
    }

    /// Where an index of the whole grid goes, if it remains.
    fn place(&self, axis: usize, index: usize) -> Option<usize> {
        let place = index.checked_sub(self.from[axis])? / self.factors[axis];
        (index < self.to[axis] && place < self.sizes[axis]).then_some(place)
    }

    /// The same for a slice within a layer. In 3D a layer is one slice.
    fn place_in_layer(&self, z: usize) -> Option<usize> {
        match Dimension::of::<D>() {
            Dimension::Three => Some(z),
            Dimension::Four => self.place(2, z),
        }
    }

    /// The next layer, smoothed within itself.
    fn smoothed(&mut self) -> Result<Vec<f32>, Error> {
        let mut layer = self.read()?;
        let mut stride = 1;
        for axis in 0..D - 1 {
            if self.kernels[axis].len() > 1 {
                layer = smooth_along(&layer, stride, self.sizes[axis], &self.kernels[axis]);
            }
            stride *= self.sizes[axis];
        }
        Ok(layer)
    }
}

/// Smooths along one axis of a layer.
fn smooth_along(layer: &[f32], stride: usize, size: usize, kernel: &[f64]) -> Vec<f32> {
    let smooth = |i: usize| {
        let place = i / stride % size;
        let at = |j: usize| layer[i - place * stride + j * stride];
        mean(at, place, size, kernel)
    };
    (0..layer.len()).into_par_iter().with_min_len(4096).map(smooth).collect()
}

/// The weighted mean around a place, by the numbers that are there.
fn mean(at: impl Fn(usize) -> f32, place: usize, size: usize, kernel: &[f64]) -> f32 {
    if at(place).is_nan() {
        return f32::NAN;
    }
    let (mut sum, mut weights) = (0.0, 0.0);
    let reach = kernel.len() - 1;
    for other in place.saturating_sub(reach)..=(place + reach).min(size - 1) {
        let value = at(other);
        if !value.is_nan() {
            let weight = kernel[other.abs_diff(place)];
            sum += weight * f64::from(value);
            weights += weight;
        }
    }
    (sum / weights) as f32
}

impl<const D: usize> Layers for ImageLayers<D> {
    type Error = Error;

    fn next(&mut self, values: &mut [f32]) -> Result<(), Error> {
        let (reach, size) = (self.kernels[D - 1].len() - 1, self.sizes[D - 1]);
        while self.made < size.min(self.done + reach + 1) {
            let layer = self.smoothed()?;
            self.window.push_back(layer);
            self.made += 1;
            if self.window.len() > 2 * reach + 1 {
                self.window.pop_front();
            }
        }
        let first = self.made - self.window.len();
        let (place, window, kernel) = (self.done - first, &self.window, &self.kernels[D - 1]);
        let count = window.len();
        let (isovalue, sign) = (self.isovalue, self.sign);
        let look = |(i, slot): (usize, &mut f32)| {
            *slot = if reach == 0 { window[place][i] } else { mean(|j| window[j][i], place, count, kernel) };
            let mut seen = Seen::default();
            seen.look_at_depth(*slot, isovalue, sign);
            seen
        };
        let all = values.par_iter_mut().enumerate().with_min_len(4096);
        self.seen = self.seen.and(all.map(look).reduce(Seen::default, Seen::and));
        self.done += 1;
        Ok(())
    }
}
