//! Marching over a grid, layer by layer along the last axis, with two layers in memory.
//!
//! A vertex of the surface lies on an edge of the grid, and is told by the grid point where the edge starts and the edge's
//! axis. Nothing is hashed: a row of points keeps its signs as bits, so the edges that are crossed along any axis are an XOR
//! of two rows, and a vertex's number is the number of its row's first one plus the count of crossed edges before it. Cells
//! without a crossing are passed over 64 at a time in the same way.
//!
//! All loops run on all cores, over rows in a fixed order and with results joined in that order: the surface is the
//! same, bit for bit, on any number of threads. Memory beyond the surface is that of two layers.

use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use super::table::{Case, Edge, Table};
use crate::geometry::Vector64;
use crate::mesh::Surface;
use crate::progress::Progress;

/// The nearest that a vertex comes to a grid point, in edges. It keeps slivers few and no two vertices at one place.
const NEAREST: f64 = 0.02;

/// The source of runs along the last axis, after the layers below and above.
const BETWEEN: usize = 2;

/// Rows that one task handles.
const TASK: usize = 16;

/// Where the field's values come from, one layer after the other.
pub trait Layers {
    /// What can go wrong.
    type Error;

    /// Fills in the next layer, x fastest: how far inside each point is. 0 and above is inside, NaN is outside.
    fn next(&mut self, values: &mut [f32]) -> Result<(), Self::Error>;
}

/// Where the march stops early.
#[derive(Debug)]
pub enum Stop<E> {
    /// The field can't be had.
    Field(E),
    /// Whoever watches wants no more of it.
    Cancelled,
    /// There are more simplices than allowed.
    TooMany,
}

/// The surface that parts the points inside from those outside, over a grid with points at these positions. `pad` adds a
/// layer of outside around the grid, so that the surface is closed. Each axis needs two points, or one and `pad`.
///
/// # Errors
/// If the field can't be had, or there are more than `most` simplices.
pub fn march<const D: usize, L: Layers>(
    axes: [Vec<f64>; D],
    pad: bool,
    most: u64,
    field: &mut L,
    progress: &dyn Progress,
) -> Result<Surface<D>, Stop<L::Error>> {
    let given = Shape::new(axes.clone());
    let shape = if pad { Shape::new(axes.map(padded)) } else { Shape::new(axes) };
    let last = shape.axes[D - 1].len() - 1;
    let slab = Slab::new(shape);
    let mut values = vec![0f32; given.rows * given.axes[0].len()];
    let (mut below, mut above) = (Layer::new(&slab.shape), Layer::new(&slab.shape));
    let mut up = vec![Run::default(); slab.shape.rows * slab.shape.words];
    let mut surface = Surface::default();
    for index in 0..=last {
        if pad && (index == 0 || index == last) {
            above.values.fill(f32::MIN);
        } else {
            field.next(&mut values).map_err(Stop::Field)?;
            above.load(&slab.shape, &given, &values, pad);
        }
        if progress.cancelled() {
            return Err(Stop::Cancelled);
        }
        above.find_crossings(&slab.shape);
        slab.place_vertices(&mut above.runs, D - 1, most, &mut surface.vertices, |row, axis, x| {
            slab.shape.vertex((x, row, index), axis, &above.values, &above.values)
        })?;
        if index > 0 {
            up.iter_mut().zip(below.inside.iter().zip(&above.inside)).for_each(|(run, (a, b))| run.crossed = a ^ b);
            slab.place_vertices(&mut up, 1, most, &mut surface.vertices, |row, _, x| {
                slab.shape.vertex((x, row, index - 1), D - 1, &below.values, &above.values)
            })?;
            slab.fill(&below, &above, &up, most, &mut surface.simplices)?;
        }
        std::mem::swap(&mut below, &mut above);
    }
    Ok(surface)
}

/// The positions with one more at each end, as far on as the neighbour is.
fn padded(positions: Vec<f64>) -> Vec<f64> {
    let count = positions.len();
    let step = |a: usize, b: usize| if count > 1 { positions[b] - positions[a] } else { 1.0 };
    let (first, last) = (positions[0] - step(0, 1), positions[count - 1] + step(count.max(2) - 2, count - 1));
    std::iter::once(first).chain(positions).chain([last]).collect()
}

/// The sizes of a grid, and of its layers.
struct Shape<const D: usize> {
    /// Positions of the points along each axis.
    axes: [Vec<f64>; D],
    /// Words in a row of bits.
    words: usize,
    /// Rows in a layer.
    rows: usize,
    /// The step in rows along each of axes 1 to D - 2.
    strides: [usize; D],
}

impl<const D: usize> Shape<D> {
    fn new(axes: [Vec<f64>; D]) -> Self {
        let mut strides = [1; D];
        let mut rows = 1;
        for axis in 1..D - 1 {
            strides[axis] = rows;
            rows *= axes[axis].len();
        }
        Self { words: axes[0].len().div_ceil(64), axes, rows, strides }
    }

    fn along(&self, row: usize, axis: usize) -> usize {
        row / self.strides[axis] % self.axes[axis].len()
    }

    /// Whether the row has a next one along an axis of the layer.
    fn has_next(&self, row: usize, axis: usize) -> bool {
        self.along(row, axis) + 1 < self.axes[axis].len()
    }

    /// The vertex on the edge from grid point (x, row, layer) along an axis, by the values in the layers of both ends.
    fn vertex(&self, (x, row, layer): (usize, usize, usize), axis: usize, from: &[f32], to: &[f32]) -> Vector64<D> {
        let width = self.axes[0].len();
        let index = |axis: usize| match axis {
            0 => x,
            _ if axis == D - 1 => layer,
            _ => self.along(row, axis),
        };
        let mut point = Vector64::from_fn(|axis, _| self.axes[axis][index(axis)]);
        let start = x + width * row;
        let end = match axis {
            0 => start + 1,
            _ if axis == D - 1 => start,
            _ => start + width * self.strides[axis],
        };
        let (a, b) = (f64::from(from[start]), f64::from(to[end]));
        let share = (a / (a - b)).clamp(NEAREST, 1.0 - NEAREST);
        let next = self.axes[axis][index(axis) + 1];
        point[axis] += (next - point[axis]) * share;
        point
    }
}

/// Crossed edges in a word of 64 grid points, and the number of the first vertex on them.
#[derive(Clone, Copy, Debug, Default)]
struct Run {
    crossed: u64,
    first: u32,
}

/// One layer: its values, signs, and crossed edges along axes 0 to D - 2.
struct Layer {
    values: Vec<f32>,
    /// `words` a row.
    inside: Vec<u64>,
    /// `words` for each axis, axis after axis, row after row.
    runs: Vec<Run>,
}

impl Layer {
    fn new<const D: usize>(shape: &Shape<D>) -> Self {
        Self {
            values: vec![f32::MIN; shape.rows * shape.axes[0].len()],
            inside: vec![0; shape.rows * shape.words],
            runs: vec![Run::default(); shape.rows * (D - 1) * shape.words],
        }
    }

    /// Takes over values; those around them are outside.
    fn load<const D: usize>(&mut self, shape: &Shape<D>, given: &Shape<D>, values: &[f32], pad: bool) {
        let (margin, width) = (usize::from(pad), given.axes[0].len());
        self.values.par_chunks_mut(shape.axes[0].len() * TASK).enumerate().for_each(|(task, rows)| {
            for (i, row) in rows.chunks_mut(shape.axes[0].len()).enumerate() {
                let place: [usize; D] = std::array::from_fn(|axis| match axis {
                    0 => margin,
                    _ if axis == D - 1 => 0,
                    _ => shape.along(task * TASK + i, axis),
                });
                row.fill(f32::MIN);
                let within = |axis: usize| (margin..given.axes[axis].len() + margin).contains(&place[axis]);
                if (1..D - 1).all(within) {
                    let from: usize = (1..D - 1).map(|axis| (place[axis] - margin) * given.strides[axis]).sum();
                    for (slot, &value) in row[margin..].iter_mut().zip(&values[from * width..][..width]) {
                        *slot = if value.is_nan() { f32::MIN } else { value.clamp(f32::MIN, f32::MAX) };
                    }
                }
            }
        });
    }

    fn find_crossings<const D: usize>(&mut self, shape: &Shape<D>) {
        let (width, words) = (shape.axes[0].len(), shape.words);
        let Self { values, inside, runs } = self;
        inside.par_chunks_mut(words * TASK).zip(values.par_chunks(width * TASK)).for_each(|(inside, values)| {
            for (inside, values) in inside.chunks_mut(words).zip(values.chunks(width)) {
                for (word, values) in inside.iter_mut().zip(values.chunks(64)) {
                    *word = values.iter().enumerate().map(|(bit, value)| u64::from(*value >= 0.0) << bit).sum();
                }
            }
        });
        let inside = &*inside;
        runs.par_chunks_mut((D - 1) * words * TASK).enumerate().for_each(|(task, runs)| {
            for (slot, run) in runs.iter_mut().enumerate() {
                let (row, axis, word) = (task * TASK + slot / words / (D - 1), slot / words % (D - 1), slot % words);
                let here = inside[row * words + word];
                run.crossed = if axis == 0 {
                    (here ^ shifted(inside, row * words, word, words)) & edges_in_word(width, word)
                } else if shape.has_next(row, axis) {
                    here ^ inside[(row + shape.strides[axis]) * words + word]
                } else {
                    0
                };
            }
        });
    }
}

/// The signs of the points that come next along x.
#[inline]
fn shifted(inside: &[u64], row: usize, word: usize, words: usize) -> u64 {
    let next = if word + 1 < words { inside[row + word + 1] } else { 0 };
    inside[row + word] >> 1 | next << 63
}

/// The points of a word that have a next one along x.
#[inline]
fn edges_in_word(width: usize, word: usize) -> u64 {
    match (width - 1).saturating_sub(64 * word) {
        0 => 0,
        edges if edges < 64 => (1 << edges) - 1,
        _ => u64::MAX,
    }
}

/// Where the vertex of each edge of a cell is found.
#[derive(Clone, Copy)]
struct Crossing {
    /// In the layer below, in the one above, or between both.
    source: usize,
    /// Runs on from the cell's first row.
    offset: usize,
    /// 1 if the edge starts from the cell's upper end along x.
    x: usize,
}

/// What lies between two layers: the cells.
struct Slab<const D: usize> {
    shape: Shape<D>,
    table: Table<D>,
    /// For each edge of the table.
    crossings: Vec<Crossing>,
}

impl<const D: usize> Slab<D> {
    fn new(shape: Shape<D>) -> Self {
        let table = Table::new();
        let place = |edge: &Edge| {
            let (corner, axis) = (usize::from(edge.corner), usize::from(edge.axis));
            let rows: usize = (1..D - 1).map(|axis| (corner >> axis & 1) * shape.strides[axis]).sum();
            let (source, offset) = match axis {
                _ if axis == D - 1 => (BETWEEN, rows * shape.words),
                _ => (corner >> (D - 1) & 1, (rows * (D - 1) + axis) * shape.words),
            };
            Crossing { source, offset, x: corner & 1 }
        };
        Self { crossings: table.edges().iter().map(place).collect(), table, shape }
    }

    /// Numbers the vertices on crossed edges, `axes` a point, and adds them.
    fn place_vertices<E>(
        &self,
        runs: &mut [Run],
        axes: usize,
        most: u64,
        vertices: &mut Vec<Vector64<D>>,
        place: impl Fn(usize, usize, usize) -> Vector64<D> + Sync,
    ) -> Result<(), Stop<E>> {
        let words = self.shape.words;
        let mut next = vertices.len() as u64;
        for run in runs.iter_mut() {
            run.first = next as u32;
            next += u64::from(run.crossed.count_ones());
        }
        // A simplex has D vertices, and every vertex a simplex.
        if next > most.saturating_mul(D as u64).min(u64::from(u32::MAX)) {
            return Err(Stop::TooMany);
        }
        let pieces: Vec<Vec<Vector64<D>>> = runs
            .par_chunks(axes * words * TASK)
            .enumerate()
            .map(|(task, runs)| {
                let mut piece = Vec::new();
                for (slot, run) in runs.iter().enumerate().filter(|(_, run)| run.crossed != 0) {
                    let (row, axis, word) = (task * TASK + slot / words / axes, slot / words % axes, slot % words);
                    piece.extend(ones(run.crossed).map(|bit| place(row, axis, 64 * word + bit)));
                }
                piece
            })
            .collect();
        vertices.extend(pieces.iter().flatten());
        Ok(())
    }

    /// Adds the simplices of all cells.
    fn fill<E>(
        &self,
        below: &Layer,
        above: &Layer,
        between: &[Run],
        most: u64,
        simplices: &mut Vec<[u32; D]>,
    ) -> Result<(), Stop<E>> {
        let sources: [&[Run]; 3] = [&below.runs, &above.runs, between];
        let count = AtomicU64::new(simplices.len() as u64);
        let pieces: Vec<Vec<[u32; D]>> = (0..self.shape.rows.div_ceil(TASK))
            .into_par_iter()
            .map(|task| {
                let mut piece = Vec::new();
                for row in (task * TASK..self.shape.rows).take(TASK) {
                    if (1..D - 1).all(|axis| self.shape.has_next(row, axis)) {
                        self.fill_row(row, [&below.inside, &above.inside], &sources, &mut piece);
                    }
                }
                // So that noise on a large grid stops before the memory does.
                let total = count.fetch_add(piece.len() as u64, Ordering::Relaxed) + piece.len() as u64;
                if total > most { Vec::new() } else { piece }
            })
            .collect();
        if count.into_inner() > most {
            return Err(Stop::TooMany);
        }
        simplices.extend(pieces.iter().flatten());
        Ok(())
    }

    fn fill_row(&self, row: usize, inside: [&[u64]; 2], sources: &[&[Run]; 3], simplices: &mut Vec<[u32; D]>) {
        let (words, width) = (self.shape.words, self.shape.axes[0].len());
        let starts = [row * (D - 1) * words, row * (D - 1) * words, row * words];
        for word in 0..words {
            // The signs at the ends of all edges along x, in the order of the corners' bits.
            let mut ends = [[0u64; 2]; 8];
            let (mut any, mut all) = (0, u64::MAX);
            for (corner, ends) in ends.iter_mut().take(1 << (D - 1)).enumerate() {
                let rows: usize = (1..D - 1).map(|axis| (corner >> (axis - 1) & 1) * self.shape.strides[axis]).sum();
                let signs = inside[corner >> (D - 2) & 1];
                let start = (row + rows) * words;
                *ends = [signs[start + word], shifted(signs, start, word, words)];
                any |= ends[0] | ends[1];
                all &= ends[0] & ends[1];
            }
            for bit in ones(any & !all & edges_in_word(width, word)) {
                let mut case = 0;
                for (corner, [low, high]) in ends.iter().take(1 << (D - 1)).enumerate() {
                    case |= ((low >> bit & 1) | (high >> bit & 1) << 1) << (2 * corner);
                }
                let Case { edges, simplices: found } = self.table.case(case as usize);
                let mut vertices = [0u32; 32];
                for (slot, &edge) in vertices.iter_mut().zip(edges) {
                    let Crossing { source, offset, x } = self.crossings[usize::from(edge)];
                    let x = 64 * word + bit + x;
                    let run = sources[source][starts[source] + offset + x / 64];
                    *slot = run.first + (run.crossed & ((1 << (x % 64)) - 1)).count_ones();
                }
                simplices.extend(found.iter().map(|simplex| simplex.map(|place| vertices[usize::from(place)])));
            }
        }
    }
}

/// The places of the ones in a word, ascending.
#[inline]
fn ones(mut bits: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let place = bits.trailing_zeros() as usize;
        let found = (bits != 0).then_some(place);
        bits &= bits.wrapping_sub(1);
        found
    })
}
