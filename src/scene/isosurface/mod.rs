//! Isosurfaces: where a field, given by a formula or as a grid of values, passes a value.
//!
//! [`table`] says what the surface is within one cell of a grid, [`march`] goes over all cells, [`field`] and `expression`
//! make fields of formulas, [`image`] of files. For D = 4 that is marching hypercubes, for D = 3 marching cubes. The surface
//! is piecewise linear and converges with the square of the cells' size. Around the grid is nothing, if `pad` is not
//! switched off, so that a body that reaches beyond the grid is cut off flat there, a fiftieth of a cell outside of it, and
//! the surface is closed in any case.

mod components;
mod expression;
pub mod field;
pub mod image;
pub mod march;
pub mod table;

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::expression::{Expression, Rows};
use self::field::Field;
use self::image::{Grid, ImageSpec};
use self::march::{Layers, Stop};
use super::Error;
use super::lattice::divide;
use super::numbers::{AXES, MAX_SIMPLICES, OneOrEach, bounds, finite};
use crate::geometry::Dimension;
use crate::mesh::Surface;
use crate::progress::Progress;
use crate::volume::available_memory;

/// The most points a layer of a grid may have: a few layers are held in memory.
const MOST_IN_LAYER: u128 = 1 << 27;

/// Bytes that a point of a layer takes while the grid is gone over: as it is read, cropped, smoothed and marched on.
const BYTES_IN_LAYER: u128 = 40;

/// The most points of a grid: more would take minutes only to look at.
const MOST_POINTS: u128 = 1 << 33;

/// The surface where a field passes a value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct IsosurfaceSpec {
    /// The field.
    pub field: Field,
    /// Where a formula is looked at. An image brings its own grid.
    #[serde(default)]
    pub grid: Option<GridSpec>,
    /// The value that the surface is at; 0 if left out. An image needs one.
    #[serde(default)]
    pub isovalue: Option<f64>,
    /// Which side of the isovalue is solid; if left out `below` for formulas and `above` for images.
    #[serde(default)]
    pub inside: Option<Side>,
    /// Whether to close the surface where it leaves the grid; yes if left out.
    #[serde(default = "yes")]
    pub pad: bool,
    /// Leaves out what is connected and has fewer simplices than this.
    #[serde(default)]
    pub smallest_component: Option<u64>,
}

fn yes() -> bool {
    true
}

/// Which side of the isovalue is solid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Where the field is less, as with distances.
    Below,
    /// Where the field is more, as with densities.
    Above,
}

/// A grid of points at which a formula is looked at.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GridSpec {
    /// The lowest corner, one number an axis. A named body that has an end needs neither corner.
    #[serde(default)]
    pub min: Option<Vec<f64>>,
    /// The highest corner, one number an axis.
    #[serde(default)]
    pub max: Option<Vec<f64>>,
    /// Cells along every axis, or a list with one number an axis.
    pub cells: OneOrEach<u32>,
}

impl IsosurfaceSpec {
    /// The files it is read from, those among them that only a header names; paths are relative to `folder`.
    pub fn input_files(&self, folder: &Path) -> Vec<PathBuf> {
        match &self.field {
            Field::Image(image) => image.input_files(folder),
            _ => Vec::new(),
        }
    }

    /// The surface. Files are relative to `folder`. Where the field never passes the isovalue there is none, or only the
    /// grid's own border; `notes` say so, and how many values are no numbers.
    pub fn build<const D: usize>(
        &self,
        folder: &Path,
        notes: &mut Vec<String>,
        progress: &dyn Progress,
    ) -> Result<Surface<D>, Error> {
        match &self.field {
            Field::Image(image) => self.of_image(image, folder, notes, progress),
            _ => self.of_formula(notes, progress),
        }
    }

    fn of_image<const D: usize>(
        &self,
        image: &ImageSpec,
        folder: &Path,
        notes: &mut Vec<String>,
        progress: &dyn Progress,
    ) -> Result<Surface<D>, Error> {
        if self.grid.is_some() {
            let message = "an image has a grid of its own; place it by spacing and origin, or take a part by crop";
            return Err(Error::invalid("isosurface.grid", message));
        }
        let Some(isovalue) = self.isovalue else {
            return Err(Error::invalid("isosurface", "an image needs an isovalue: the value that the surface is at"));
        };
        let isovalue = finite("isosurface.isovalue", isovalue)?;
        let inside = self.inside.unwrap_or(Side::Above);
        let Grid { mut layers, axes, placed } = image.open::<D>(folder, isovalue, inside, notes)?;
        if let Some(axis) = axes.iter().position(|axis| axis.len() < 2).filter(|_| !self.pad) {
            let message = format!("the image has one point along {}; it needs two, or pad: true", AXES[axis]);
            return Err(Error::invalid("isosurface.pad", message));
        }
        let backwards = axes.iter().filter(|axis| axis.len() > 1 && axis[1] < axis[0]).count();
        let mut surface = march::march(axes, self.pad, MAX_SIMPLICES, &mut layers, progress);
        if let (Ok(surface), 1) = (&mut surface, backwards % 2) {
            surface.simplices.iter_mut().for_each(|simplex| simplex.swap(D - 2, D - 1));
        }
        if let (Ok(surface), Some(placed)) = (&mut surface, placed) {
            placed.apply(surface);
        }
        finish(surface, &layers.seen, isovalue, self.smallest_component, notes)
    }

    fn of_formula<const D: usize>(
        &self,
        notes: &mut Vec<String>,
        progress: &dyn Progress,
    ) -> Result<Surface<D>, Error> {
        let isovalue = finite("isosurface.isovalue", self.isovalue.unwrap_or(0.0))?;
        let inside = self.inside.unwrap_or(Side::Below);
        let definition = self.field.define(Dimension::of::<D>())?;
        let formula_key = format!("isosurface.field.{}", self.field.key());
        let expression = Expression::parse(&definition.formula, &AXES[..D])
            .map_err(|message| Error::invalid(&formula_key, message))?;
        let Some(grid) = &self.grid else {
            return Err(Error::invalid("isosurface", "a formula needs a grid to be looked at on: give grid"));
        };
        // A body grows by the isovalue, as its field is a distance.
        let reach = definition.extent.map(|extent| extent.map(|x| x + isovalue.max(0.0)));
        let axes = grid.axes::<D>(reach)?;
        let mut sampled = Sampled {
            rows: expression.along(&axes[0]),
            axes: axes.clone(),
            layer: 0,
            isovalue,
            sign: if inside == Side::Below { -1.0 } else { 1.0 },
            seen: Seen::default(),
            progress,
        };
        let surface = march::march(axes, self.pad, MAX_SIMPLICES, &mut sampled, progress);
        finish(surface, &sampled.seen, isovalue, self.smallest_component, notes)
    }
}

/// What all isosurfaces end with: is there anything, and what is large enough to stay.
fn finish<const D: usize>(
    surface: Result<Surface<D>, Stop<Error>>,
    seen: &Seen,
    isovalue: f64,
    smallest: Option<u64>,
    notes: &mut Vec<String>,
) -> Result<Surface<D>, Error> {
    let surface = match surface {
        Ok(surface) => surface,
        Err(Stop::Field(error)) => return Err(error),
        Err(Stop::Cancelled) => return Err(Error::Cancelled),
        Err(Stop::TooMany) => {
            let message = format!(
                "the surface has more than {MAX_SIMPLICES} simplices, the most that one object may have; \
                 take fewer cells, or another isovalue if the field is noise there"
            );
            return Err(Error::invalid("isosurface", message));
        }
    };
    if seen.missing > 0 {
        let (missing, all) = (seen.missing, seen.looked_at);
        notes.push(format!("isosurface.field: {missing} of {all} values are no numbers; they count as outside"));
    }
    if seen.inside == 0 || seen.outside == 0 {
        let range = match seen.lowest <= seen.highest {
            true => format!("its values go from {} to {}", seen.lowest, seen.highest),
            false => "none of its values is a number".to_owned(),
        };
        let (all, rest) = match (seen.inside, surface.simplices.is_empty()) {
            (0, _) => ("out", "there is no surface"),
            (_, true) => ("in", "there is no surface"),
            (_, false) => ("in", "the surface is that of the grid"),
        };
        notes.push(format!(
            "isosurface.isovalue: the field is {all}side everywhere: {range}, and the isovalue is {isovalue}; {rest}"
        ));
        if surface.simplices.is_empty() {
            return Ok(surface);
        }
    }
    let surface = match smallest {
        None => surface,
        Some(smallest) => components::at_least(surface, smallest),
    };
    if surface.simplices.is_empty() && smallest.is_some() {
        let message = "no component of the surface has that many simplices";
        return Err(Error::invalid("isosurface.smallest_component", message));
    }
    Ok(surface)
}

impl GridSpec {
    /// The positions of the points along each axis.
    fn axes<const D: usize>(&self, reach: Option<[f64; 4]>) -> Result<[Vec<f64>; D], Error> {
        let cells = self.cells.each::<D>("isosurface.grid.cells")?;
        if cells.contains(&0) {
            return Err(Error::invalid("isosurface.grid.cells", "0 cells; the least is 1"));
        }
        check_grid("isosurface.grid.cells", &cells.map(|n| u128::from(n) + 1))?;
        let (min, max) = match (&self.min, &self.max, reach) {
            (Some(min), Some(max), _) => bounds("isosurface.grid", ("min", min), ("max", max))?,
            (None, None, Some(reach)) => {
                // One cell of room on each side, or a tenth of the body where that is less.
                let room = |axis: usize| reach[axis] * (1.0 + (2.0 / f64::from(cells[axis])).min(0.1));
                let max = crate::geometry::Vector64::<D>::from_fn(|axis, _| room(axis));
                (-max, max)
            }
            (None, None, None) => {
                return Err(Error::invalid("isosurface.grid", "needs min and max: the field has no end of its own"));
            }
            _ => return Err(Error::invalid("isosurface.grid", "has only one of min and max; give both or neither")),
        };
        Ok(std::array::from_fn(|axis| divide(min[axis], max[axis], cells[axis]).chain([max[axis]]).collect()))
    }
}

/// Refuses a grid that is too large to march over.
fn check_grid<const D: usize>(key: &str, points: &[u128; D]) -> Result<(), Error> {
    let layer: u128 = points[..D - 1].iter().product();
    let total = layer * points[D - 1];
    if layer > MOST_IN_LAYER || total > MOST_POINTS {
        let message = format!(
            "the grid has {total} points, {layer} in a layer; the most is {MOST_POINTS}, and {MOST_IN_LAYER} in a layer"
        );
        return Err(Error::invalid(key, message));
    }
    if let Some(available) = available_memory().filter(|&n| layer * BYTES_IN_LAYER > u128::from(n)) {
        let message = format!(
            "a layer of the grid has {layer} points, which take {} bytes of memory, and {available} are free; \
             take a part of it, or fewer points",
            layer * BYTES_IN_LAYER
        );
        return Err(Error::invalid(key, message));
    }
    Ok(())
}

/// What was met of a field.
#[derive(Clone, Copy, Debug)]
struct Seen {
    lowest: f64,
    highest: f64,
    inside: u64,
    outside: u64,
    /// Values that are no numbers, of how many that were looked at.
    missing: u64,
    looked_at: u64,
}

impl Default for Seen {
    fn default() -> Self {
        Self { lowest: f64::INFINITY, highest: f64::NEG_INFINITY, inside: 0, outside: 0, missing: 0, looked_at: 0 }
    }
}

impl Seen {
    fn and(self, other: Self) -> Self {
        Self {
            lowest: self.lowest.min(other.lowest),
            highest: self.highest.max(other.highest),
            inside: self.inside + other.inside,
            outside: self.outside + other.outside,
            missing: self.missing + other.missing,
            looked_at: self.looked_at + other.looked_at,
        }
    }

    /// Notes a value, and returns how far it is inside.
    #[inline]
    fn look(&mut self, value: f64, isovalue: f64, sign: f64) -> f32 {
        self.looked_at += 1;
        self.missing += u64::from(value.is_nan());
        self.lowest = self.lowest.min(value);
        self.highest = self.highest.max(value);
        let depth = (sign * (value - isovalue)) as f32;
        self.count(depth);
        depth
    }

    /// Notes how far a value is inside.
    fn look_at_depth(&mut self, depth: f32, isovalue: f64, sign: f64) {
        let value = isovalue + sign * f64::from(depth);
        self.lowest = self.lowest.min(value);
        self.highest = self.highest.max(value);
        self.count(depth);
    }

    #[inline]
    fn count(&mut self, depth: f32) {
        let inside = depth >= 0.0;
        self.inside += u64::from(inside);
        self.outside += u64::from(!inside);
    }
}

/// A formula, looked at layer by layer.
struct Sampled<'p, const D: usize> {
    rows: Rows,
    axes: [Vec<f64>; D],
    layer: usize,
    isovalue: f64,
    sign: f64,
    seen: Seen,
    progress: &'p dyn Progress,
}

impl<const D: usize> Layers for Sampled<'_, D> {
    type Error = Error;

    fn next(&mut self, values: &mut [f32]) -> Result<(), Error> {
        let Self { rows, axes, layer, isovalue, sign, seen, progress } = self;
        let width = axes[0].len();
        let row_of = |mut row: usize, at: &mut [f64; 3]| {
            for axis in 1..D - 1 {
                at[axis - 1] = axes[axis][row % axes[axis].len()];
                row /= axes[axis].len();
            }
            at[D - 2] = axes[D - 1][*layer];
        };
        let look = |buffers: &mut Vec<Vec<f64>>, (row, values): (usize, &mut [f32])| {
            let (mut at, mut seen) = ([0.0; 3], Seen::default());
            // The march hears of it after this layer, which is then left unfinished.
            if progress.cancelled() {
                return seen;
            }
            row_of(row, &mut at);
            rows.evaluate(&at[..D - 1], buffers, |x, value| values[x] = seen.look(value, *isovalue, *sign));
            seen
        };
        let all = values.par_chunks_mut(width).enumerate().with_min_len(16);
        *seen = seen.and(all.map_init(Vec::new, look).reduce(Seen::default, Seen::and));
        *layer += 1;
        Ok(())
    }
}
