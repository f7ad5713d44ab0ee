//! Cells that fall apart, and where to cut those that don't.

use std::collections::BTreeMap;

use super::complex::{Complex, Side};
use crate::geometry::Vector64;

/// The parts of a cell that no face connects, if all of them are solids; a cell with a cavity stays whole.
///
/// Faces are connected where they share an edge. Where more than two meet in an edge, as where two bodies touch, those two
/// are connected that have the solid between them.
pub fn parts(complex: &Complex, cell: Vec<Side>) -> Vec<Vec<Side>> {
    let loops: Vec<Vec<u32>> = cell.iter().map(|&side| complex.corners_outward(side)).collect();
    // For each edge its faces, and whether they run from the lower to the higher end.
    let mut edges: BTreeMap<[u32; 2], Vec<(usize, bool)>> = BTreeMap::new();
    for (face, corners) in loops.iter().enumerate() {
        for (i, &a) in corners.iter().enumerate() {
            let b = corners[(i + 1) % corners.len()];
            edges.entry([a.min(b), a.max(b)]).or_default().push((face, a < b));
        }
    }
    let mut parents: Vec<usize> = (0..cell.len()).collect();
    for ([a, b], mut around) in edges {
        if around.len() > 2 {
            sort_around(complex, &loops, [a, b], &mut around);
            // Counterclockwise around the edge from a to b, the solid follows a face that runs from b to a.
            let first = around.iter().position(|(_, along)| !along).unwrap_or(0);
            around.rotate_left(first);
        }
        for pair in around.chunks(2) {
            let (one, other) = (root(&mut parents, pair[0].0), root(&mut parents, pair[pair.len() - 1].0));
            parents[one.max(other)] = one.min(other);
        }
    }
    let mut numbers: BTreeMap<usize, usize> = BTreeMap::new();
    let mut found: Vec<(Vec<Side>, f64)> = Vec::new();
    let origin = complex.points[loops[0][0] as usize];
    for (face, side) in cell.iter().enumerate() {
        let number = *numbers.entry(root(&mut parents, face)).or_insert(found.len());
        if number == found.len() {
            found.push((Vec::new(), 0.0));
        }
        found[number].0.push(*side);
        let at = |i: usize| complex.points[loops[face][i] as usize] - origin;
        found[number].1 += (1..loops[face].len() - 1).map(|i| at(0).cross(&at(i)).dot(&at(i + 1))).sum::<f64>();
    }
    match found.iter().all(|(_, volume)| *volume > 0.0) {
        true => found.into_iter().map(|(sides, _)| sides).collect(),
        false => vec![cell],
    }
}

fn root(parents: &mut [usize], mut face: usize) -> usize {
    while parents[face] != face {
        parents[face] = parents[parents[face]];
        face = parents[face];
    }
    face
}

/// Half a turn, in millionths.
const HALF_TURN: i64 = 3_141_593;

/// Sorts the faces around an edge by their angle, counterclockwise as seen from where the edge points to.
fn sort_around(complex: &Complex, loops: &[Vec<u32>], edge: [u32; 2], around: &mut [(usize, bool)]) {
    let [from, to] = edge.map(|i| complex.points[i as usize]);
    let along = (to - from).normalize();
    let across = |face: usize| {
        let corners = &loops[face];
        let middle: Vector64<3> = corners.iter().map(|&c| complex.points[c as usize]).sum::<Vector64<3>>();
        let v = middle / corners.len() as f64 - from;
        v - along * along.dot(&v)
    };
    let x = across(around[0].0);
    let y = along.cross(&x);
    // In millionths, so that faces on each other, as where two bodies touch, have one angle, also where it jumps.
    let angle = |face: usize| {
        let v = across(face);
        let angle = (libm::atan2(v.dot(&y), v.dot(&x)) * 1e6).round() as i64;
        if angle < -HALF_TURN + 2 { HALF_TURN } else { angle }
    };
    // Of faces on each other, one ends the solid of its body before the other begins that of the next.
    around.sort_by_key(|&(face, along)| (angle(face), !along, face));
}

/// How many cuts are looked at more closely.
const MOST_CUTS: usize = 12;

/// A plane across an axis.
#[derive(Clone, Copy, Debug)]
pub struct Cut {
    pub axis: usize,
    pub at: f64,
    score: f64,
}

/// Where a cell may be cut, the best first: far from all its corners, so that nothing thin is cut off, near the middle, and
/// across where it is long.
pub fn cuts(complex: &Complex, cell: &[Side], corners: &[u32], narrowest: f64) -> Vec<Cut> {
    let mut found: Vec<Cut> = Vec::new();
    let mut extents = [0.0; 3];
    for axis in 0..3 {
        let mut values: Vec<f64> = corners.iter().map(|&i| complex.points[i as usize][axis]).collect();
        values.sort_unstable_by(f64::total_cmp);
        let (low, high) = (values[0], values[values.len() - 1]);
        extents[axis] = high - low;
        for (i, pair) in values.windows(2).enumerate() {
            let gap = pair[1] - pair[0];
            if gap < narrowest {
                continue;
            }
            let smaller = (i + 1).min(values.len() - i - 1) as f64 / values.len() as f64;
            let at = (pair[0] + pair[1]) / 2.0;
            let middle = (at - low).min(high - at) / (high - low);
            let score = smaller * middle.sqrt() * (gap / (high - low)).sqrt().sqrt();
            found.push(Cut { axis, at, score });
        }
    }
    let longest = extents.iter().fold(0f64, |a, &b| a.max(b));
    found.iter_mut().for_each(|cut| cut.score *= extents[cut.axis] / longest);
    found.sort_by(|a, b| b.score.total_cmp(&a.score).then(a.axis.cmp(&b.axis)).then(a.at.total_cmp(&b.at)));
    found.truncate(MOST_CUTS);
    // Corners of the section that are close to each other make thin triangles.
    let loops: Vec<Vec<u32>> = cell.iter().map(|&(face, _)| complex.corners(face)).collect();
    for cut in &mut found {
        let shortest = complex.shortest_side(&loops, cut.axis, cut.at);
        cut.score *= (shortest / longest).min(0.1).sqrt();
    }
    found.sort_by(|a, b| b.score.total_cmp(&a.score).then(a.axis.cmp(&b.axis)).then(a.at.total_cmp(&b.at)));
    found
}
