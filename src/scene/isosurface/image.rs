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
use super::{MOST_IN_LAYER, Seen, Side, check_grid};
use crate::geometry::Dimension;
use crate::io::image::{self, ByteOrder, Frame, Number, Numbers, Placement, Positions, Request, Role};
use crate::mesh::Surface;

/// The key in the pipeline.
const KEY: &str = "isosurface.field.image";

/// The widest kernel, in standard deviations of it.
const MOST_SIGMA: f64 = 100.0;

/// A grid of values from a file, or from a file for each step of time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImageSpec {
    /// The file: `.vti`, `.pvti`, `.vtk`, `.raw`, `.nii`, `.nii.gz`, `.hdr`, `.tif`, `.nc`, `.h5`, `.nrrd` or `.nhdr`, or a list of such over
    /// time, `.pvd` or `.vti.series`; relative to the pipeline's folder.
    #[serde(default)]
    pub file: Option<PathBuf>,
    /// Instead of `file`: files that follow each other in time, of one size.
    #[serde(default)]
    pub files: Vec<PathBuf>,
    /// Which array of a `.vti`, variable of a `.nc` or image of an OME-TIFF, where there are several.
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
    /// Which of several values at each point, counted from 0: a channel, a component, a band.
    #[serde(default)]
    pub channel: Option<usize>,
    /// What the stored axes are, the fastest first, where the file doesn't say so or is wrong: `[z, y, x, time]`; `ao4d info` lists
    /// them.
    #[serde(default)]
    pub axes: Option<Vec<Role>>,
    /// Where the image is put: in the `world`, by origin and direction, or as it is `stored`, from 0 on by its spacings.
    #[serde(default)]
    pub placement: Placement,
    /// Which way x, y and z are to point, where the file says its own: `RAS` (right, anterior, superior), `LPS` or the like.
    #[serde(default)]
    pub space: Option<Space>,
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

/// Directions of x, y and z: right or left, anterior or posterior, superior or inferior.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "UPPERCASE")]
#[allow(missing_docs)]
pub enum Space {
    Ras,
    Lps,
    Las,
    Rps,
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

    fn request<const D: usize>(&self) -> Result<Request, Error> {
        let wrong = |message| Error::invalid(format!("{KEY}.dimensions"), message);
        Ok(Request {
            array: self.array.clone(),
            dimensions: self.dimensions.as_ref().map(|d| four(d)).transpose().map_err(wrong)?,
            number: self.r#type,
            byte_order: self.byte_order,
            offset: self.offset,
            channel: self.channel,
            axes: self.axes.clone(),
            placement: self.placement,
            space: self.space.map(|space| format!("{space:?}").to_uppercase()),
            count_times: Dimension::of::<D>() == Dimension::Four && self.spacing.is_some(),
        })
    }

    /// Opens the image, and finds where the points are that remain of it. `notes` tell what is worth knowing.
    pub fn open<const D: usize>(
        &self,
        folder: &Path,
        isovalue: f64,
        inside: Side,
        notes: &mut Vec<String>,
    ) -> Result<Grid<D>, Error> {
        let wrong = |key: &str, message: String| Error::invalid(format!("{KEY}.{key}"), message);
        if self.file.is_some() != self.files.is_empty() {
            return Err(Error::invalid(KEY, "give one of file and files"));
        }
        let files: Vec<PathBuf> = self.files().map(Path::to_owned).collect();
        let key = format!("{KEY}.{}", if self.file.is_some() { "file" } else { "files" });
        let image = image::open(&key, folder, &files, &self.request::<D>()?)?;
        let points = image.points();
        let frame = match (Dimension::of::<D>(), self.frame, points[3]) {
            (Dimension::Three, frame, frames) if frame.unwrap_or(0) >= frames => {
                return Err(wrong("frame", format!("there are {frames}, counted from 0")));
            }
            (Dimension::Three, None, frames @ 2..) => {
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
        notes.extend(image.notes.iter().map(|note| format!("{KEY}: {note}")));
        let mut positions: [Positions; D] = std::array::from_fn(|axis| image.axes[axis].positions.clone());
        let mut placed = image.frame.as_ref().map(Placed::new).transpose()?;
        self.place(&mut positions, &mut placed)?;
        let sizes: [usize; D] = std::array::from_fn(|axis| points[axis]);
        let (from, to) = self.crop(sizes)?;
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
        let sizes: [usize; D] = std::array::from_fn(|axis| (to[axis] - from[axis]) / factors[axis]);
        if let Some(axis) = sizes.iter().position(|&size| size == 0) {
            let left = to[axis] - from[axis];
            let message = format!("{left} points along {} don't make one of {}", AXES[axis], factors[axis]);
            return Err(wrong("downsample", message));
        }
        check_grid(KEY, &sizes.map(|size| size as u128))?;
        if (sizes[0] * factors[0]) as u128 > MOST_IN_LAYER {
            let row = sizes[0] * factors[0];
            return Err(wrong(
                "crop",
                format!("a row of {row} points is more than {MOST_IN_LAYER}; take a part of it"),
            ));
        }
        let axes: [Vec<f64>; D] = std::array::from_fn(|axis| {
            let first = |i: usize| from[axis] + i * factors[axis];
            let sum = |i: usize| (first(i)..first(i + 1)).map(|k| positions[axis].at(k)).sum::<f64>();
            (0..sizes[axis]).map(|i| sum(i) / factors[axis] as f64).collect()
        });
        note_lost_precision(&axes, placed.as_ref(), notes);
        let slice = points[0] as u64 * points[1] as u64;
        let layers = ImageLayers {
            values: image.values,
            skip: slice * (frame * points[2] + from[D - 1] * slices_a_layer::<D>(&points)) as u64,
            points: std::array::from_fn(|axis| points[axis]),
            from,
            to,
            factors,
            sizes,
            kernels: sigmas.map(kernel),
            window: VecDeque::new(),
            made: 0,
            done: 0,
            isovalue,
            sign: if inside == Side::Below { -1.0 } else { 1.0 },
            blame: key,
            seen: Seen::default(),
        };
        Ok(Grid { layers, axes, placed })
    }

    /// Applies `spacing` and `origin`.
    fn place<const D: usize>(
        &self,
        positions: &mut [Positions; D],
        placed: &mut Option<Placed<D>>,
    ) -> Result<(), Error> {
        if let Some(spacing) = &self.spacing {
            let key = format!("{KEY}.spacing");
            let spacing = point::<D>(&key, spacing)?;
            if let Some(step) = spacing.iter().find(|step| **step <= 0.0) {
                return Err(Error::invalid(key, format!("{step} is not above 0")));
            }
            for (positions, step) in positions.iter_mut().zip(spacing.iter()) {
                // A distance: which way the axis runs stays.
                let step = if positions.step() < 0.0 { -step } else { *step };
                *positions = Positions::Even { start: positions.at(0), step };
            }
        }
        if let Some(origin) = &self.origin {
            let origin = point::<D>(&format!("{KEY}.origin"), origin)?;
            match placed {
                Some(placed) => {
                    let first = placed.at(&std::array::from_fn(|axis| positions[axis].at(0)));
                    (0..D).for_each(|k| placed.origin[k] += origin[k] - first[k]);
                }
                None => {
                    for (positions, origin) in positions.iter_mut().zip(origin.iter()) {
                        positions.map(1.0, origin - positions.at(0));
                    }
                }
            }
        }
        Ok(())
    }

    fn crop<const D: usize>(&self, sizes: [usize; D]) -> Result<([usize; D], [usize; D]), Error> {
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

/// An image that has been opened, with what remains of it.
pub struct Grid<const D: usize> {
    /// Its values.
    pub layers: ImageLayers<D>,
    /// Where its points are along each axis.
    pub axes: [Vec<f64>; D],
    /// How its axes lie in the world, if they aren't the world's own.
    pub placed: Option<Placed<D>>,
}

/// Axes that are not those of the world.
pub struct Placed<const D: usize> {
    directions: [[f64; D]; D],
    origin: [f64; D],
}

impl<const D: usize> Placed<D> {
    fn new(frame: &Frame) -> Result<Self, Error> {
        if (D..4).any(|k| frame.directions[..D].iter().any(|direction| direction[k] != 0.0)) {
            let message = "its axes of space lean in time, so that no single step of time is an image; take dimension: 4, or \
                           placement: stored";
            return Err(Error::invalid(KEY, message));
        }
        let directions = std::array::from_fn(|axis| std::array::from_fn(|k| frame.directions[axis][k]));
        Ok(Self { directions, origin: std::array::from_fn(|k| frame.origin[k]) })
    }

    /// Where a point is in the world.
    fn at(&self, point: &[f64; D]) -> [f64; D] {
        std::array::from_fn(|k| self.origin[k] + (0..D).map(|axis| self.directions[axis][k] * point[axis]).sum::<f64>())
    }

    /// Brings a surface into the world, with its outside outside.
    pub fn apply(&self, surface: &mut Surface<D>) {
        for vertex in &mut surface.vertices {
            let there = self.at(&std::array::from_fn(|k| vertex[k]));
            there.into_iter().enumerate().for_each(|(k, x)| vertex[k] = x);
        }
        let matrix = nalgebra::DMatrix::from_fn(D, D, |row, column| self.directions[column][row]);
        if matrix.determinant() < 0.0 {
            surface.simplices.iter_mut().for_each(|simplex| simplex.swap(D - 2, D - 1));
        }
    }
}

/// Tells of places so far from 0 that single precision, in which meshes are kept, can hardly tell neighbours apart.
fn note_lost_precision<const D: usize>(axes: &[Vec<f64>; D], placed: Option<&Placed<D>>, notes: &mut Vec<String>) {
    for (k, axis) in axes.iter().enumerate().filter(|(_, axis)| axis.len() > 1) {
        let step = axis.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(f64::INFINITY, f64::min);
        let mut reach = axis[0].abs().max(axis[axis.len() - 1].abs());
        if let Some(placed) = placed {
            reach = placed.origin.iter().fold(reach, |reach, x| reach.max(x.abs()));
        }
        let single = reach * f64::from(f32::EPSILON);
        if step < 16.0 * single {
            notes.push(format!(
                "{KEY}: its points along {} are {step} apart, up to {reach} away from 0, where single precision, in which \
                 meshes are kept, goes in steps of {single:.2}; bring it near 0 by origin, or by translate in transform",
                AXES[k]
            ));
        }
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
    values: Box<dyn Numbers>,
    /// Values to pass over first.
    skip: u64,
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
    /// The next layer, cropped and downsampled: how far inside its points are.
    fn read(&mut self) -> Result<Vec<f32>, Error> {
        let blame = self.blame.clone();
        self.layer().map_err(|message| Error::invalid(blame, message))
    }

    fn layer(&mut self) -> Result<Vec<f32>, String> {
        self.values.skip(std::mem::take(&mut self.skip))?;
        let size: usize = self.sizes[..D - 1].iter().product();
        if self.factors == [1; D] {
            return self.layer_as_it_is(size);
        }
        let (mut sums, mut counts) = (vec![0f64; size], vec![0u32; size]);
        let mut numbers = 0u64;
        let window = Window::of(self);
        let (sizes, factors, sign, isovalue) = (self.sizes, self.factors, self.sign, self.isovalue);
        for _ in 0..factors[D - 1] {
            for z in 0..slices_a_layer::<D>(&self.points) {
                let Some(z) = self.place_in_layer(z) else {
                    self.values.skip(window.all())?;
                    continue;
                };
                window.read(&mut *self.values, |first, rows| {
                    for (y, row) in rows.enumerate() {
                        let start = sizes[0] * ((first + y) / factors[1] + sizes[1] * z);
                        for (x, values) in row.chunks_exact(factors[0]).enumerate() {
                            for value in values.iter().filter(|value| !value.is_nan()) {
                                sums[start + x] += sign * (value - isovalue);
                                counts[start + x] += 1;
                                numbers += 1;
                            }
                        }
                    }
                })?;
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
    fn layer_as_it_is(&mut self, size: usize) -> Result<Vec<f32>, String> {
        let (width, area) = (self.sizes[0], self.sizes[0] * self.sizes[1]);
        let mut layer = vec![0f32; size];
        let window = Window::of(self);
        let (isovalue, sign) = (self.isovalue, self.sign);
        for z in 0..slices_a_layer::<D>(&self.points) {
            let Some(z) = self.place_in_layer(z) else {
                self.values.skip(window.all())?;
                continue;
            };
            let slots = &mut layer[z * area..][..area];
            window.read(&mut *self.values, |first, rows| {
                let count = rows.values.len() / rows.stride;
                let slots = &mut slots[first * width..][..count * width];
                slots.par_chunks_mut(width).with_min_len(64).enumerate().for_each(|(y, slots)| {
                    let row = rows.row(y);
                    slots.iter_mut().zip(row).for_each(|(slot, value)| *slot = (sign * (value - isovalue)) as f32);
                });
            })?;
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

/// Values that are read at a time.
const BLOCK: usize = 1 << 20;

/// The part of a slice over x and y that remains.
struct Window {
    points: [usize; 2],
    from: [usize; 2],
    sizes: [usize; 2],
}

/// Some rows of a window.
struct Rows<'a> {
    values: &'a [f64],
    /// From row to row.
    stride: usize,
    /// Where a row begins, and how long it is.
    from: usize,
    width: usize,
}

impl<'a> Rows<'a> {
    fn row(&self, y: usize) -> &'a [f64] {
        &self.values[y * self.stride + self.from..][..self.width]
    }

    fn enumerate(&self) -> impl Iterator<Item = (usize, &'a [f64])> {
        (0..self.values.len() / self.stride).map(|y| (y, self.row(y)))
    }
}

impl Window {
    fn of<const D: usize>(layers: &ImageLayers<D>) -> Self {
        let two = |each: &dyn Fn(usize) -> usize| std::array::from_fn(each);
        Self {
            points: two(&|k| layers.points[k]),
            from: two(&|k| layers.from[k]),
            sizes: two(&|k| layers.sizes[k] * layers.factors[k]),
        }
    }

    /// Values of the whole slice.
    fn all(&self) -> u64 {
        self.points[0] as u64 * self.points[1] as u64
    }

    /// Reads a slice, a block of rows at a time; `take` is given the index of the first row, and the rows.
    fn read(&self, values: &mut dyn Numbers, mut take: impl FnMut(usize, Rows)) -> Result<(), String> {
        let ([width, height], [x, y]) = (self.points, self.from);
        values.skip(width as u64 * y as u64)?;
        let mut buffer = Vec::new();
        let mut done = 0;
        while done < self.sizes[1] {
            // Whole rows, unless they are so long that what remains of one is read alone.
            let rows = (BLOCK / width).min(self.sizes[1] - done);
            if rows > 0 {
                buffer.resize(rows * width, 0.0);
                values.read(&mut buffer)?;
                take(done, Rows { values: &buffer, stride: width, from: x, width: self.sizes[0] });
            } else {
                values.skip(x as u64)?;
                buffer.resize(self.sizes[0], 0.0);
                values.read(&mut buffer)?;
                values.skip((width - x - self.sizes[0]) as u64)?;
                take(done, Rows { values: &buffer, stride: self.sizes[0], from: 0, width: self.sizes[0] });
            }
            done += rows.max(1);
        }
        values.skip(width as u64 * (height - y - self.sizes[1]) as u64)
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
