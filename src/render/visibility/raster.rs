//! Scan conversion: every simplex into the voxels it covers, the nearest one stays.
//!
//! The image is cut into tiles of neighbouring rows, which are done in parallel, and each of which is small enough for a
//! buffer of distances to stay in the cache. A tile goes through the simplices whose box in the image meets it, and
//! for each through the rows of that box; [`Footprint`] says which voxels of a row are surely covered, and which have to be
//! asked one by one. The nearest of several is exactly the nearest, of those at the same distance the one of the lowest
//! index; so neither tiles nor threads nor the order of the simplices change anything.

use std::cmp::Ordering;
use std::ops::Range;

use rayon::prelude::*;

use super::NOTHING;
use super::footprint::Footprint;
use crate::accel::Tracer;
use crate::geometry::{Dimension, Vector, widen};
use crate::mesh::Mesh;
use crate::progress::{Cancelled, Progress};
use crate::render::camera::{Camera, Lens};
use crate::volume::Grid;

/// Simplices between two looks at whether to go on.
pub(super) const BATCH: usize = 1 << 12;

/// The voxels that a simplex may cover: the first and the last along each axis. Image dimensions fit 16 bits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Box3 {
    first: [u16; 3],
    last: [u16; 3],
}

impl Box3 {
    const EMPTY: Self = Self { first: [1; 3], last: [0; 3] };

    fn is_empty(&self) -> bool {
        self.first[0] > self.last[0]
    }

    fn count(&self, axis: usize) -> f64 {
        f64::from(self.last[axis]) - f64::from(self.first[axis]) + 1.0
    }
}

/// The simplices' boxes in the image.
#[derive(Clone, Debug)]
pub(super) struct Raster {
    boxes: Vec<Box3>,
    /// Which simplices reach behind the eye, so that their images have no end.
    endless: Vec<bool>,
}

/// Finds the box of each simplex.
struct Framer<'a, const D: usize> {
    camera: &'a Camera<D>,
    grid: &'a Grid,
    /// Sum of the largest components of directions or origins.
    reach: f64,
    /// What the rounding of a ray to `f32` moves it by in the image.
    margin: f64,
    parallel: bool,
}

/// A corner as the camera sees it: its parts along the image's axes and ahead of the eye, and how far off it is by the sum over
/// the axes.
struct Corner {
    across: [f64; 3],
    ahead: f64,
    offset: f64,
}

impl<const D: usize> Framer<'_, D> {
    /// The box of a simplex, and whether the simplex reaches behind the eye.
    fn frame(&self, corners: &[Vector<D>; D]) -> (Box3, bool) {
        let whole = Box3 { first: [0; 3], last: self.grid.dimensions.map(|n| (n - 1) as u16) };
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        let (mut before, mut behind) = (0, 0);
        let mut margin = self.margin;
        for corner in corners {
            let (point, distance) = self.camera.project(corner);
            let offset = self.camera.offset(corner);
            if self.parallel {
                margin = margin.max(self.margin + 1e-12 * offset);
            } else if distance > 1e-6 * offset {
                before += 1;
            } else {
                behind += usize::from(distance < -1e-6 * offset);
                continue;
            }
            for a in 0..D - 1 {
                low[a] = low[a].min(point[a]);
                high[a] = high[a].max(point[a]);
            }
        }
        if !self.parallel {
            // So wide an angle that rounded rays may go anywhere.
            if self.reach > 1e5 {
                return (whole, true);
            }
            if behind == D {
                return (Box3::EMPTY, false);
            }
            if before == 0 {
                return (whole, true);
            }
            if before < D {
                self.extend(corners, &mut low, &mut high);
            }
        }
        (self.around(&low, &high, margin), !self.parallel && before < D)
    }

    /// Extends the box of the corners before the eye to where the edges to the others go: without end, to the sides where they
    /// pass the eye.
    fn extend(&self, corners: &[Vector<D>; D], low: &mut [f64; 3], high: &mut [f64; 3]) {
        let corner = |v: &Vector<D>| {
            let parts = self.camera.to_frame(&(widen(v) - self.camera.eye()));
            let across = std::array::from_fn(|a| if a < D - 1 { parts[a] } else { 0.0 });
            Corner { across, ahead: -parts[D - 1], offset: self.camera.offset(v) }
        };
        let corners: [Corner; D] = std::array::from_fn(|i| corner(&corners[i]));
        let is_before = |c: &&Corner| c.ahead > 1e-6 * c.offset;
        for one in corners.iter().filter(is_before) {
            for other in corners.iter().filter(|c| !is_before(c)) {
                let part = one.ahead / (one.ahead - other.ahead);
                // What is far beside the other loses its digits.
                let is_clear = other.offset < 1e3 * one.offset;
                for a in 0..D - 1 {
                    let passes = one.across[a] + part * (other.across[a] - one.across[a]);
                    let rounding = 1e-4 * (one.offset + other.offset);
                    if !(is_clear && passes > rounding) {
                        low[a] = f64::NEG_INFINITY;
                    }
                    if !(is_clear && passes < -rounding) {
                        high[a] = f64::INFINITY;
                    }
                }
            }
        }
    }

    /// The voxels between these ends, and what rounding adds to them.
    fn around(&self, low: &[f64; 3], high: &[f64; 3], margin: f64) -> Box3 {
        let whole = Box3 { first: [0; 3], last: self.grid.dimensions.map(|n| (n - 1) as u16) };
        let mut found = whole;
        for a in 0..D - 1 {
            let middle = 0.5 * (self.grid.dimensions[a] - 1) as f64;
            let place = |x: f64, side: f64| (x + side * (margin + 1e-8 * x.abs())) / self.grid.spacing[a] + middle;
            let (first, last) = ((place(low[a], -1.0) - 1e-3).ceil(), (place(high[a], 1.0) + 1e-3).floor());
            if !(last >= 0.0 && first <= f64::from(whole.last[a]) && first <= last) {
                return Box3::EMPTY;
            }
            found.first[a] = first as u16;
            found.last[a] = (last as u16).min(whole.last[a]);
        }
        found
    }
}

impl Raster {
    pub fn new<const D: usize>(mesh: &Mesh<D>, camera: &Camera<D>, grid: &Grid) -> Self {
        let lens = camera.lens(grid);
        let reach = lens.reach.sum();
        let image = (0..D - 1).map(|a| 0.5 * grid.spacing[a] * grid.dimensions[a] as f64).fold(0.0, f64::max);
        let framer = Framer {
            camera,
            grid,
            reach,
            margin: f64::from(f32::EPSILON) * reach * (1.0 + image),
            parallel: camera.is_parallel(),
        };
        let count = mesh.simplices.len() as u32;
        let frame = |s: u32| framer.frame(&mesh.corners(s));
        let (mut boxes, endless): (Vec<Box3>, Vec<bool>) =
            (0..count).into_par_iter().with_min_len(1024).map(frame).unzip();
        // What lies on an earlier one is never seen first.
        let copies = mesh.copies.iter().map(|(copy, _)| copy);
        mesh.degenerate.iter().copied().chain(copies).for_each(|s| boxes[s as usize] = Box3::EMPTY);
        Self { boxes, endless }
    }

    /// Whether it promises to be faster than a ray for each voxel, and a hierarchy if there is none yet. The costs are
    /// nanoseconds on one machine; what counts is their ratio.
    pub fn is_cheaper<const D: usize>(&self, grid: &Grid, prepared: bool) -> bool {
        let filled = 1.0 / f64::from(Dimension::of::<D>().simplices_a_cube());
        let cover = |b: &Box3| b.count(1) * b.count(2) * (15.0 + 3.0 * filled * b.count(0));
        let (mut raster, mut endless) = (0.0, 0.0);
        for (b, &is_endless) in self.boxes.iter().zip(&self.endless).filter(|(b, _)| !b.is_empty()) {
            raster += 300.0;
            if is_endless {
                // Its rows are found layer by layer.
                raster += 30.0 * b.count(2);
                endless += cover(b);
            } else {
                raster += cover(b);
            }
        }
        // Boxes without end say little: but together they cover no voxel much more often than its ray passes surfaces.
        let whole = Box3 { first: [0; 3], last: grid.dimensions.map(|n| (n - 1) as u16) };
        raster += endless.min(PASSES * cover(&whole));
        let depth = (self.boxes.len() as f64).max(2.0).log2();
        let build = if prepared { 0.0 } else { 400.0 * self.boxes.len() as f64 };
        raster < grid.len() as f64 * (50.0 + 60.0 * depth) + build
    }

    /// The simplices that some layers may show, ascending.
    pub fn within(&self, layers: &Range<usize>) -> Vec<u32> {
        let meets = |b: &Box3| usize::from(b.first[2]) < layers.end && usize::from(b.last[2]) >= layers.start;
        (self.boxes.par_iter().enumerate().with_min_len(4096))
            .filter_map(|(s, b)| (!b.is_empty() && meets(b)).then_some(s as u32))
            .collect()
    }

    /// The box of a simplex.
    pub fn frame(&self, simplex: u32) -> &Box3 {
        &self.boxes[simplex as usize]
    }

    /// The simplex that each voxel of some layers sees first.
    pub fn first_hits<const D: usize>(
        &self,
        tracer: &Tracer<D>,
        camera: &Camera<D>,
        grid: &Grid,
        layers: Range<usize>,
        progress: &dyn Progress,
    ) -> Result<Vec<u32>, Cancelled> {
        let [width, height, _] = grid.dimensions;
        let lens = camera.lens(grid);
        let simplices = self.within(&layers);
        let mut visible = vec![NOTHING; width * height * layers.len()];
        let tile = tile_rows(grid, &layers);
        visible.par_chunks_mut(width * tile).enumerate().try_for_each_init(Vec::new, |bounds, (number, found)| {
            let first = layers.start * height + number * tile;
            let rows = first..first + found.len() / width;
            bounds.clear();
            bounds.resize(found.len(), (f32::NEG_INFINITY, f32::NEG_INFINITY));
            let mut tile = Tile { tracer, camera, grid, lens: &lens, rows, found, bounds };
            for batch in simplices.chunks(BATCH) {
                if progress.cancelled() {
                    return Err(Cancelled);
                }
                batch.iter().for_each(|&simplex| tile.add(simplex, &self.boxes[simplex as usize]));
            }
            progress.advance(tile.found.len() as u64);
            Ok(())
        })?;
        Ok(visible)
    }
}

/// How often a ray passes surfaces, at most, where nothing tells.
const PASSES: f64 = 16.0;

/// Rows of a tile: some tiles for each thread, so that none waits for long; but a layer's worth, so that few simplices are in
/// several.
pub(super) fn tile_rows(grid: &Grid, layers: &Range<usize>) -> usize {
    let [width, height, _] = grid.dimensions;
    let rows = height * layers.len();
    rows.div_ceil(4 * rayon::current_num_threads()).min(TILE.div_ceil(width)).max(1)
}

/// Voxels of a tile: what they take of the cache is this times twelve bytes.
const TILE: usize = 1 << 17;

/// Rows of the image, counted through all layers, and what their voxels see so far.
struct Tile<'a, const D: usize> {
    tracer: &'a Tracer<D>,
    camera: &'a Camera<D>,
    grid: &'a Grid,
    lens: &'a Lens<D>,
    rows: Range<usize>,
    found: &'a mut [u32],
    /// How near that is, between two numbers.
    bounds: &'a mut Vec<(f32, f32)>,
}

/// Calls `row` for each of the image's `rows`, counted through all layers, that a simplex with these corners may cover,
/// given its box: with its footprint, the row (j, k), and the voxels of the row that are in the box.
#[inline(always)]
pub(super) fn each_row<const D: usize>(
    corners: &[Vector<D>; D],
    frame: &Box3,
    lens: &Lens<D>,
    grid: &Grid,
    rows: &Range<usize>,
    mut row: impl FnMut(&Footprint, [usize; 2], (usize, usize)),
) {
    let [width, height, _] = grid.dimensions;
    let [first, last] = [&frame.first, &frame.last].map(|b| [0, 1, 2].map(|a| usize::from(b[a])));
    let layers = first[2].max(rows.start / height)..=last[2].min((rows.end - 1) / height);
    // The rows of a layer that are both wanted and in the box.
    let shared = |k: usize| {
        let start = (rows.start.max(k * height) - k * height).max(first[1]);
        let end = (rows.end.min((k + 1) * height) - k * height).min(last[1] + 1);
        (start, end)
    };
    if layers.clone().all(|k| shared(k).0 >= shared(k).1) {
        return;
    }
    for footprint in Footprint::new(corners, lens).iter().flatten() {
        for k in layers.clone() {
            let (mut start, mut end) = shared(k);
            if end.saturating_sub(start) > 16 {
                (start, end) = footprint.rows(k, (start, end), width);
            }
            for j in start..end {
                row(footprint, [j, k], (first[0], last[0] + 1));
            }
        }
    }
}

impl<const D: usize> Tile<'_, D> {
    fn add(&mut self, simplex: u32, frame: &Box3) {
        let (corners, rows) = (self.tracer.mesh().corners(simplex), self.rows.clone());
        each_row(&corners, frame, self.lens, self.grid, &rows, |footprint, [j, k], within| {
            self.add_row(simplex, footprint, j, k, within);
        });
    }

    #[inline]
    fn add_row(&mut self, simplex: u32, footprint: &Footprint, j: usize, k: usize, within: (usize, usize)) {
        let span = footprint.span(j, k, within);
        if span.outer.0 >= span.outer.1 {
            return;
        }
        let [width, height, _] = self.grid.dimensions;
        let place = (k * height + j - self.rows.start) * width;
        let nearness = footprint.nearness(j, k);
        for i in (span.outer.0..span.inner.0).chain(span.inner.1..span.outer.1) {
            if self.tracer.hits(simplex, &self.camera.voxel_ray(self.grid, [i, j, k]), f32::INFINITY) {
                self.add_voxel(simplex, [i, j, k], place + i, nearness.at(i));
            }
        }
        for i in span.inner.0..span.inner.1 {
            let (low, high) = nearness.at(i);
            let bounds = &mut self.bounds[place + i];
            if low > bounds.1 {
                *bounds = (low, high);
                self.found[place + i] = simplex;
            } else if high < bounds.0 {
                continue;
            } else {
                self.add_voxel(simplex, [i, j, k], place + i, (low, high));
            }
        }
    }

    /// Compares exactly, where bounds can't tell.
    #[cold]
    fn add_voxel(&mut self, simplex: u32, index: [usize; 3], place: usize, (low, high): (f32, f32)) {
        let (found, bounds) = (&mut self.found[place], &mut self.bounds[place]);
        if high < bounds.0 || *found == simplex {
            return;
        }
        let nearer = |other: u32| {
            let ray = self.camera.voxel_ray(self.grid, index);
            self.tracer.order(&ray, simplex, other) == Ordering::Less
        };
        if *found == NOTHING || low > bounds.1 || nearer(*found) {
            (*found, *bounds) = (simplex, (low, high));
        }
    }
}
