//! What each voxel's ray passes: all surfaces, front to back, and whether it enters or leaves there.
//!
//! The two ways to find what is seen first find all the rest as well, and agree on it. Scan conversion notes down for every voxel
//! which simplices cover it, tile by tile, and sorts the notes once all simplices have been there; where a tile would have
//! too many, it is done in halves. Ray casting goes through the hierarchy to the end. Which of several simplices count where
//! a ray meets boundaries is for [`Tracer::pass`] to say.

use std::ops::Range;

use rayon::prelude::*;

use super::raster::{BATCH, Raster, each_row, tile_rows};
use crate::accel::{Candidate, Passage, Tracer, Wanted};
use crate::progress::{Cancelled, Progress};
use crate::render::camera::{Camera, Lens};
use crate::volume::Grid;

/// Notes of a tile, at most, unless it is one row: what they take of memory, a thread, is this times twenty bytes, twice.
const NOTES: usize = 1 << 20;

/// What the rays of some voxels pass.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Passages {
    /// How many surfaces each ray passes.
    counts: Vec<u32>,
    /// Where each voxel's passages end.
    ends: Vec<usize>,
    /// The first of each voxel, at most as many as were asked for.
    passages: Vec<Passage>,
}

impl Passages {
    /// How many surfaces a voxel's ray passes.
    pub fn count(&self, voxel: usize) -> u32 {
        self.counts[voxel]
    }

    /// The first of them, front to back, as many as were asked for.
    pub fn of(&self, voxel: usize) -> &[Passage] {
        &self.passages[self.range(voxel)]
    }

    /// Where these are among all.
    pub fn range(&self, voxel: usize) -> Range<usize> {
        let start = voxel.checked_sub(1).map_or(0, |before| self.ends[before]);
        start..self.ends[voxel]
    }

    /// All that are kept, voxel after voxel.
    pub fn all(&self) -> &[Passage] {
        &self.passages
    }

    /// How many voxels there are.
    pub fn voxels(&self) -> usize {
        self.counts.len()
    }

    /// Adds a voxel, whose passages are what `of_voxel` holds; keeps `most`.
    fn add(&mut self, of_voxel: &[Passage], most: usize) {
        self.counts.push(of_voxel.len() as u32);
        self.passages.extend(&of_voxel[..of_voxel.len().min(most)]);
        self.ends.push(self.passages.len());
    }

    /// Those of several pieces of an image, one after the other.
    fn joined(pieces: Vec<Self>) -> Self {
        let mut all = Self::default();
        for piece in pieces {
            let first = all.passages.len();
            all.counts.extend(piece.counts);
            all.ends.extend(piece.ends.into_iter().map(|end| first + end));
            all.passages.extend(piece.passages);
        }
        all
    }
}

/// What is looked at, and how.
pub(super) struct Search<'a, const D: usize> {
    pub tracer: &'a Tracer<D>,
    pub camera: &'a Camera<D>,
    pub grid: &'a Grid,
    /// For each simplex whether the camera sees it from behind.
    pub away: &'a [bool],
    /// Passages that are kept of a voxel.
    pub most: usize,
    pub progress: &'a dyn Progress,
}

impl<const D: usize> Search<'_, D> {
    /// By rays, through the hierarchy.
    pub fn cast(&self, layers: Range<usize>) -> Result<Passages, Cancelled> {
        self.tracer.prepare();
        let [width, height, _] = self.grid.dimensions;
        let row = |row: usize| {
            if self.progress.cancelled() {
                return Err(Cancelled);
            }
            let (mut found, mut notes, mut passages) = (Passages::default(), Vec::new(), Vec::new());
            for i in 0..width {
                let index = [i, row % height, row / height];
                let ray = self.camera.voxel_ray(self.grid, index);
                self.tracer.gather(&ray, f32::INFINITY, |_| Wanted::Yes, &mut notes);
                self.add(index, &mut notes, &mut passages, &mut found);
            }
            self.progress.advance(width as u64);
            Ok(found)
        };
        let rows = layers.start * height..layers.end * height;
        Ok(Passages::joined(rows.into_par_iter().map(row).collect::<Result<_, _>>()?))
    }

    /// By scan conversion.
    pub fn rasterize(&self, raster: &Raster, layers: Range<usize>) -> Result<Passages, Cancelled> {
        let height = self.grid.dimensions[1];
        let (lens, simplices) = (self.camera.lens(self.grid), raster.within(&layers));
        let (rows, tile) = (layers.start * height..layers.end * height, tile_rows(self.grid, &layers));
        let tiles: Vec<Range<usize>> =
            rows.clone().step_by(tile).map(|first| first..rows.end.min(first + tile)).collect();
        let found: Vec<Vec<Passages>> = tiles
            .into_par_iter()
            .map(|rows| {
                let mut found = Vec::new();
                self.tile(raster, &lens, &simplices, rows, &mut found)?;
                Ok(found)
            })
            .collect::<Result<_, Cancelled>>()?;
        Ok(Passages::joined(found.concat()))
    }

    /// Does a tile, in halves if it has too many notes.
    fn tile(
        &self,
        raster: &Raster,
        lens: &Lens<D>,
        simplices: &[u32],
        rows: Range<usize>,
        found: &mut Vec<Passages>,
    ) -> Result<(), Cancelled> {
        let mut notes = Vec::new();
        for batch in simplices.chunks(BATCH) {
            if self.progress.cancelled() {
                return Err(Cancelled);
            }
            batch.iter().for_each(|&simplex| self.note(raster, lens, simplex, &rows, &mut notes));
            if notes.len() > NOTES && rows.len() > 1 {
                drop(notes);
                let middle = rows.start + rows.len() / 2;
                self.tile(raster, lens, simplices, rows.start..middle, found)?;
                return self.tile(raster, lens, simplices, middle..rows.end, found);
            }
        }
        found.push(self.sorted(&rows, notes));
        self.progress.advance((rows.len() * self.grid.dimensions[0]) as u64);
        Ok(())
    }

    /// Notes down which voxels of some rows a simplex covers, by their places in these rows.
    fn note(
        &self,
        raster: &Raster,
        lens: &Lens<D>,
        simplex: u32,
        rows: &Range<usize>,
        notes: &mut Vec<(u32, Candidate)>,
    ) {
        let [width, height, _] = self.grid.dimensions;
        let corners = self.tracer.mesh().corners(simplex);
        each_row(&corners, raster.frame(simplex), lens, self.grid, rows, |footprint, [j, k], within| {
            let span = footprint.span(j, k, within);
            if span.outer.0 >= span.outer.1 {
                return;
            }
            let place = (k * height + j - rows.start) * width;
            let nearness = footprint.nearness(j, k);
            let mut add = |i: usize, inside: bool| {
                notes.push(((place + i) as u32, Candidate { simplex, near: nearness.at(i), inside }));
            };
            for i in (span.outer.0..span.inner.0).chain(span.inner.1..span.outer.1) {
                if self.tracer.hits(simplex, &self.camera.voxel_ray(self.grid, [i, j, k]), f32::INFINITY) {
                    add(i, false);
                }
            }
            (span.inner.0..span.inner.1).for_each(|i| add(i, true));
        });
    }

    /// The passages of some rows' voxels, of these notes.
    fn sorted(&self, rows: &Range<usize>, notes: Vec<(u32, Candidate)>) -> Passages {
        let [width, height, _] = self.grid.dimensions;
        let voxels = rows.len() * width;
        let mut starts = vec![0usize; voxels + 1];
        notes.iter().for_each(|(place, _)| starts[*place as usize + 1] += 1);
        (0..voxels).for_each(|n| starts[n + 1] += starts[n]);
        let mut next = starts.clone();
        let mut by_voxel = vec![Candidate { simplex: 0, near: (0.0, 0.0), inside: true }; notes.len()];
        for (place, candidate) in notes {
            by_voxel[next[place as usize]] = candidate;
            next[place as usize] += 1;
        }
        let (mut found, mut of_voxel, mut passages) = (Passages::default(), Vec::new(), Vec::new());
        for n in 0..voxels {
            of_voxel.clear();
            of_voxel.extend_from_slice(&by_voxel[starts[n]..starts[n + 1]]);
            let row = rows.start + n / width;
            self.add([n % width, row % height, row / height], &mut of_voxel, &mut passages, &mut found);
        }
        found
    }

    /// Adds the voxel after those that are there.
    #[inline]
    fn add(
        &self,
        index: [usize; 3],
        candidates: &mut Vec<Candidate>,
        passages: &mut Vec<Passage>,
        found: &mut Passages,
    ) {
        passages.clear();
        if !candidates.is_empty() {
            let ray = self.camera.voxel_ray(self.grid, index);
            self.tracer.pass(&ray, candidates, |simplex| self.away[simplex as usize], passages);
        }
        found.add(passages, self.most);
    }
}
