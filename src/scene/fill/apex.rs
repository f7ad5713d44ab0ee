//! What a cell is coned from, if it can be.

use super::LEAST;
use super::cells::winding;
use super::complex::{Complex, Side};
use super::kernel::{Deepest, Plane, deepest};
use crate::geometry::Vector64;

/// What a cell's faces are joined to.
pub enum Apex {
    /// A point inside.
    Inside(Vector64<3>),
    /// A corner, which sees all faces that it is not part of.
    Corner(u32),
}

/// A point that sees all of a cell from well above each face; none if the cell is better cut first.
pub fn apex(complex: &Complex, cell: &[Side], corners: &[u32], own: u32, cuts: u32) -> Option<Apex> {
    let planes: Vec<Plane> =
        cell.iter().map(|&side| complex.plane(side)).filter(|plane| plane.normal.amax() > 0.0).collect();
    let points = || corners.iter().map(|&i| complex.points[i as usize]);
    let low = points().fold(Vector64::repeat(f64::INFINITY), |low: Vector64<3>, p| low.inf(&p));
    let high = points().fold(Vector64::repeat(f64::NEG_INFINITY), |high: Vector64<3>, p| high.sup(&p));
    let (center, radius) = ((low + high) / 2.0, (high - low).norm() / 2.0);
    // What is thin has no deep point. The wider a cell is than its kernel is deep, the more a cut may better it; after many
    // cuts it is as good as it gets.
    let share = 0.05 * 0.5f64.powi(cuts.saturating_sub(30).min(60) as i32);
    if let Some(Deepest { point, depth, limits }) = deepest(&planes, &center, radius, LEAST) {
        let width = |n: &Vector64<3>| {
            let heights = points().map(|p| n.dot(&p));
            let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
            high - low
        };
        let width = limits.iter().map(width).fold(f64::INFINITY, f64::min);
        if depth >= share * width && winding(complex, cell, &point) == 1 {
            return Some(Apex::Inside(point));
        }
    }
    if cell.len() > 60 {
        return None;
    }
    let sees = |&corner: &u32| {
        let point = complex.points[corner as usize];
        let height = |&side: &Side| match complex.corners(side.0).contains(&corner) {
            true => f64::INFINITY,
            false => complex.plane(side).offset - complex.plane(side).normal.dot(&point),
        };
        cell.iter().map(height).fold(f64::INFINITY, f64::min) >= (share * radius).max(LEAST)
    };
    corners.iter().copied().filter(|&corner| corner < own).find(sees).map(Apex::Corner)
}
