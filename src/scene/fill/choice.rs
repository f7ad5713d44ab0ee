//! Which cut of a cell promises the fewest pieces: some are tried, looked at, and taken back.
//!
//! What a half will cost is guessed from its faces, and from its notches if it can't be coned yet. A cut that comes close to a
//! corner makes slivers, so it counts as more expensive than it is.

use super::LEAST;
use super::apex::apex;
use super::cells::{self, Cut};
use super::complex::{Complex, Side};
use crate::geometry::Vector64;
use crate::progress::Progress;

/// How many faces are looked at for all cuts tried of a solid, about; of a cell, some of these.
pub const MOST_TRIED: usize = 100_000;
const MOST_TRIED_OF_CELL: usize = 5_000;

/// What is narrower is avoided, even at the cost of more pieces.
const NARROW: f64 = 1e-4;

/// Where along a face beside a notch to cut: at the middle, and elsewhere if nothing wide enough is found.
const SHARES: [f64; 4] = [0.5, 0.36, 0.67, 0.2];
const WIDE_ENOUGH: f64 = 3e-5;

/// What a notch is expected to cost, in faces.
const NOTCH: f64 = 1.0;

/// Cuts a cell where the pieces promise to become the fewest.
///
/// # Errors
/// A point near which no cut is possible.
pub fn best_cut(
    complex: &mut Complex,
    cell: &[Side],
    corners: &[u32],
    own: u32,
    cuts: u32,
    tries: usize,
    progress: &dyn Progress,
) -> Result<Vec<Vec<Side>>, Vector64<3>> {
    let across = cells::cuts(complex, cell, corners, 2.0 * LEAST);
    let tries = (MOST_TRIED_OF_CELL / cell.len()).max(3).min(tries);
    let notches = if tries > 0 { cells::notches(complex, cell) } else { Vec::new() };
    let (beside, through) = (tries / 3, tries - 2 * (tries / 3));
    let mut best: Option<(f64, Cut)> = None;
    let mut widest = 0.0;
    let mut trouble = complex.points[corners[0] as usize];
    for (round, share) in SHARES.into_iter().enumerate() {
        let mut tried: Vec<Cut> = cells::notch_cuts(complex, cell, &notches, beside, share);
        tried.extend(across.iter().skip(round * through).take(through));
        for cut in tried {
            if progress.cancelled() {
                break;
            }
            let mark = complex.mark();
            match cells::cut(complex, cell, &cut) {
                Ok((halves, shortest)) => {
                    let (cost, done) = cost(complex, halves, own, cuts + 1);
                    let cost = cost * (1.0 + NARROW / shortest);
                    if best.is_none_or(|(least, _)| cost < least) {
                        best = Some((cost, cut));
                        widest = shortest;
                    }
                    if done && cost < 2.0 * cell.len() as f64 {
                        complex.undo(mark);
                        break;
                    }
                }
                Err(near) => trouble = near,
            }
            complex.undo(mark);
        }
        if tries == 0 || widest > WIDE_ENOUGH {
            break;
        }
    }
    for cut in best.map(|(_, cut)| cut).into_iter().chain(across) {
        let mark = complex.mark();
        match cells::cut(complex, cell, &cut) {
            Ok((halves, _)) => return Ok(halves.into()),
            Err(near) => trouble = near,
        }
        complex.undo(mark);
    }
    Err(trouble)
}

/// What cells are expected to cost, in pieces, and whether none of them is to be cut again.
fn cost(complex: &Complex, cells: [Vec<Side>; 2], own: u32, cuts: u32) -> (f64, bool) {
    let (mut cost, mut done) = (0.0, true);
    for part in cells.iter().flat_map(|cell| cells::parts(complex, complex.resolve(cell))) {
        let corners = complex.corners_of(&part);
        cost += part.len() as f64;
        if apex(complex, &part, &corners, own, cuts).is_none() {
            done = false;
            let weight: f64 = cells::notches(complex, &part).iter().map(|notch| notch.weight).sum();
            cost += NOTCH * weight * (2.0 + weight).log2() + 10.0;
        }
    }
    (cost, done)
}
