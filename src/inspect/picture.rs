//! A picture of the difference of two images: three slices through the middle of the first, below them the second's, below
//! them how far they are apart.
//!
//! Differences are shown from white, none, by red to black, the largest; those within the tolerance are blue. Where the
//! largest lies outside the slices, the numbers still tell where.

use std::path::Path;

use super::compare::Tolerance;
use super::{Contents, Error};
use crate::io::png::{self, Slices};
use crate::io::vtk::Image;
use crate::io::{self, AtomicFile};
use crate::volume::{Array, Grid, Values};

/// What may go wrong.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// A file can't be read.
    #[error(transparent)]
    Read(#[from] Error),
    /// The picture can't be written.
    #[error(transparent)]
    Write(#[from] io::Error),
}

/// Draws the difference of two images of the same grid into a `.png`; returns whether there was something to draw: two images,
/// of the same grid, one of whose arrays differs.
///
/// # Errors
/// If a file can't be read, or the picture not be written.
pub fn write(a: &Path, b: &Path, tolerance: &Tolerance, into: &Path) -> Result<bool, PictureError> {
    if !matches!(super::ending(a).as_str(), "vti" | "pvti") {
        return Ok(false);
    }
    let (Contents::Image(a), Contents::Image(b)) = (Contents::read(a)?, Contents::read(b)?) else { return Ok(false) };
    if a.grid.dimensions != b.grid.dimensions {
        return Ok(false);
    }
    let Some((x, y)) = most_different(&a, &b, tolerance) else { return Ok(false) };
    let range = range(x).into_iter().chain(range(y));
    let (low, high) = range.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let rows = [slices(&a.grid, |i| shown(x, i, low, high))?, slices(&a.grid, |i| shown(y, i, low, high))?, {
        let limits = tolerance.of(&x.name);
        let largest = (0..a.grid.len()).map(|i| difference(x, y, i).0).filter(|d| d.is_finite()).fold(0.0, f64::max);
        slices(&a.grid, |i| {
            let (d, reference) = difference(x, y, i);
            let within = d <= limits.atol + limits.rtol * reference.abs();
            heat(d, largest, within)
        })?
    }];
    let mut file = AtomicFile::create(into)?;
    png::write(&mut file, &[&rows[0], &rows[1], &rows[2]]).map_err(AtomicFile::name_in(into))?;
    file.commit()?;
    Ok(true)
}

/// The arrays of one name with the most numbers beyond tolerance.
fn most_different<'i>(a: &'i Image, b: &'i Image, tolerance: &Tolerance) -> Option<(&'i Array, &'i Array)> {
    let both = a.point_arrays.iter().filter_map(|x| Some((x, b.point_arrays.iter().find(|y| y.name == x.name)?)));
    let fits = |(x, y): &(&Array, &Array)| x.components == y.components && x.values.len() == y.values.len();
    let takes = |(x, _): &(&Array, &Array)| tolerance.takes(&x.name) && x.values.len() == a.grid.len() * x.components;
    let count = |(x, y): &(&Array, &Array)| {
        let limits = tolerance.of(&x.name);
        (0..x.values.len())
            .filter(|&i| !limits.agree((x.values.get(i) - y.values.get(i)).abs(), y.values.get(i)))
            .count()
    };
    let counted = both.filter(fits).filter(takes).map(|pair| (count(&pair), pair)).filter(|(count, _)| *count > 0);
    counted.max_by_key(|(count, _)| *count).map(|(_, pair)| pair)
}

fn range(array: &Array) -> Vec<f64> {
    (0..array.values.len()).map(|i| array.values.get(i)).filter(|x| x.is_finite()).collect()
}

/// The largest difference of a tuple's numbers, and the reference there.
fn difference(x: &Array, y: &Array, tuple: usize) -> (f64, f64) {
    let numbers = (0..x.components).map(|c| tuple * x.components + c).map(|i| (x.values.get(i), y.values.get(i)));
    let apart = numbers.map(|(x, y)| (if x == y || x.is_nan() && y.is_nan() { 0.0 } else { (x - y).abs() }, y));
    apart.fold((0.0, 0.0), |most, this| if this.0 > most.0 || this.0.is_nan() { this } else { most })
}

/// A tuple as a colour: itself if it is one, else grey.
fn shown(array: &Array, tuple: usize, low: f64, high: f64) -> [u8; 3] {
    let byte = |x: f64| (255.0 * ((x - low) / (high - low).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0)) as u8;
    let at = |c: usize| array.values.get(tuple * array.components + c);
    match (&array.values, array.components) {
        (Values::U8(bytes), 3 | 4) => [0, 1, 2].map(|c| bytes[tuple * array.components + c]),
        (_, 3) => [0, 1, 2].map(|c| byte(at(c))),
        _ => [byte(at(0)); 3],
    }
}

fn heat(difference: f64, largest: f64, within: bool) -> [u8; 3] {
    if difference == 0.0 {
        return [255; 3];
    }
    let share = if difference.is_finite() { difference / largest.max(f64::MIN_POSITIVE) } else { 1.0 };
    let fade = |from: f64, to: f64, share: f64| (from + (to - from) * share.clamp(0.0, 1.0)) as u8;
    match (within, share) {
        (true, share) => [fade(210.0, 60.0, share), fade(225.0, 110.0, share), 255],
        (false, share) if share < 0.5 => [255, fade(200.0, 0.0, 2.0 * share), fade(190.0, 0.0, 2.0 * share)],
        (false, share) => [fade(255.0, 40.0, 2.0 * share - 1.0), 0, 0],
    }
}

fn slices(grid: &Grid, color: impl Fn(usize) -> [u8; 3]) -> Result<Slices, io::Error> {
    let mut slices = Slices::new(grid);
    let layer = grid.dimensions[0] * grid.dimensions[1];
    let mut rgba = vec![255; 4 * layer];
    for k in 0..grid.dimensions[2] {
        for i in 0..layer {
            rgba[4 * i..4 * i + 3].copy_from_slice(&color(k * layer + i));
        }
        slices.add_slab(k, &rgba)?;
    }
    Ok(slices)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_of_differences() {
        assert_eq!(heat(0.0, 1.0, true), [255; 3]);
        assert_eq!(heat(1.0, 1.0, false), [40, 0, 0]);
        assert_eq!(heat(0.5, 1.0, false), [255, 0, 0]);
        assert_eq!(heat(f64::NAN, 1.0, false), [40, 0, 0]);
        assert_eq!(heat(1.0, 1.0, true), [60, 110, 255]);
    }
}
