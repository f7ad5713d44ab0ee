//! Cells that fall apart, and where to cut those that don't.
//!
//! Two kinds of cuts are proposed: across the axes, through everything, which halves what is large; and through notches, the edges
//! where a solid is more than flat, along the bisector of the solid's angle and no farther than the part of the section there. So a
//! gear falls into its teeth by short radial cuts, each of which leaves the other teeth alone.

use std::collections::BTreeMap;

use super::LEAST;
use super::complex::{Complex, Side};
use super::kernel::Plane;
use crate::geometry::Vector64;
use crate::mesh::UnionFind;
use crate::mesh::crossings::solid_angle;

/// The parts of a cell that no face connects, each with its cavities; a cell with a cavity in nothing stays whole.
///
/// Faces are connected where they share an edge. Where more than two meet in an edge, as where two bodies touch, those two
/// are connected that have the solid between them.
pub fn parts(complex: &Complex, cell: Vec<Side>) -> Vec<Vec<Side>> {
    let loops: Vec<Vec<u32>> = cell.iter().map(|&side| complex.corners_outward(side)).collect();
    // For each edge its faces, and whether they run from the lower to the higher end.
    let mut edges: Vec<([u32; 2], usize, bool)> = Vec::with_capacity(3 * cell.len());
    for (face, corners) in loops.iter().enumerate() {
        for (i, &a) in corners.iter().enumerate() {
            let b = corners[(i + 1) % corners.len()];
            edges.push(([a.min(b), a.max(b)], face, a < b));
        }
    }
    edges.sort_unstable();
    let mut parents: Vec<usize> = (0..cell.len()).collect();
    for around in edges.chunk_by(|a, b| a.0 == b.0) {
        let [a, b] = around[0].0;
        let mut around: Vec<(usize, bool)> = around.iter().map(|&(_, face, along)| (face, along)).collect();
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
    let (mut solids, cavities): (Vec<_>, Vec<_>) = found.into_iter().partition(|(_, volume)| *volume > 0.0);
    if !cavities.is_empty() && solids.len() < 2 {
        return vec![cell];
    }
    // The smallest solid around a cavity is its own.
    solids.sort_by(|a, b| a.1.total_cmp(&b.1));
    let only: Vec<Vec<Side>> = solids.iter().map(|(sides, _)| sides.clone()).collect();
    for (cavity, _) in cavities {
        let inside = complex.points[complex.corners(cavity[0].0)[0] as usize];
        let Some(around) = only.iter().position(|sides| winding(complex, sides, &inside) == 1) else {
            return vec![cell];
        };
        solids[around].0.extend(cavity);
    }
    solids.into_iter().map(|(sides, _)| sides).collect()
}

/// Cuts a cell: what is below, what is above, and how close the cut comes to corners.
///
/// # Errors
/// A point near which the surface passes through itself, the plane comes too close to a corner, or the cut would leave the cell in
/// one piece. What may have been cut then is to be undone.
pub fn cut(complex: &mut Complex, cell: &[Side], cut: &Cut) -> Result<([Vec<Side>; 2], f64), Vector64<3>> {
    let halves = complex.cut(cell, &cut.plane, cut.near.as_ref())?;
    let cells = match halves.others {
        Some(others) => joined(complex, halves.cells, others).ok_or(halves.middle)?,
        None => halves.cells,
    };
    Ok((cells, halves.shortest))
}

/// What is connected with what is just below a cut, and with what is just above it: both, with the cell's other faces. None if both
/// are connected with each other, or it is not clear which has a cavity.
fn joined(complex: &Complex, both: [Vec<Side>; 2], others: Vec<Side>) -> Option<[Vec<Side>; 2]> {
    let (below, above) = (both[0].len(), both[0].len() + both[1].len());
    let faces: Vec<Side> = both.into_iter().flatten().chain(others).collect();
    let mut edges: Vec<([u32; 2], usize)> = Vec::with_capacity(3 * faces.len());
    for (i, &(face, _)) in faces.iter().enumerate() {
        let corners = complex.corners(face);
        edges.extend(corners.iter().enumerate().map(|(k, &a)| {
            let b = corners[(k + 1) % corners.len()];
            ([a.min(b), a.max(b)], i)
        }));
    }
    edges.sort_unstable();
    let mut sets = UnionFind::new(faces.len());
    (1..below).for_each(|i| sets.join(0, i as u32));
    (below..above).for_each(|i| sets.join(below as u32, i as u32));
    for around in edges.chunk_by(|a, b| a.0 == b.0) {
        // At the cut, what is below touches what is above.
        let sides = |side: std::ops::Range<usize>| around.iter().any(|(_, face)| side.contains(face));
        if sides(0..below) && sides(below..above) {
            continue;
        }
        around.windows(2).for_each(|pair| sets.join(pair[0].1 as u32, pair[1].1 as u32));
    }
    let roots: Vec<u32> = (0..faces.len()).map(|i| sets.root(i as u32)).collect();
    let ends = [0, roots[below]];
    if ends[0] == ends[1] {
        return None;
    }
    let mut found: [Vec<Side>; 2] = Default::default();
    let mut apart: BTreeMap<u32, Vec<Side>> = BTreeMap::new();
    for (&side, &root) in faces.iter().zip(&roots) {
        match ends.iter().position(|end| *end == root) {
            Some(half) => found[half].push(side),
            None => apart.entry(root).or_default().push(side),
        }
    }
    let halves = found.clone();
    for sides in apart.into_values() {
        let inside = complex.points[complex.corners(sides[0].0)[0] as usize];
        let around = halves.iter().position(|half| winding(complex, half, &inside) == 1)?;
        found[around].extend(sides);
    }
    Some(found)
}

/// How often a boundary lies around a point that is not on it.
pub fn winding(complex: &Complex, cell: &[Side], from: &Vector64<3>) -> i64 {
    let mut angle = 0.0;
    for &side in cell {
        let corners = complex.corners_outward(side).iter().map(|&i| complex.points[i as usize]).collect::<Vec<_>>();
        angle +=
            (1..corners.len() - 1).map(|i| solid_angle(&[corners[0], corners[i], corners[i + 1]], from)).sum::<f64>();
    }
    (angle / (4.0 * std::f64::consts::PI)).round() as i64
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

/// A plane, and the point next to which the cell is cut, if not everywhere.
#[derive(Clone, Copy, Debug)]
pub struct Cut {
    pub plane: Plane,
    pub near: Option<Vector64<3>>,
    score: f64,
}

/// Where a cell may be cut across the axes, the best first: far from all its corners, so that nothing thin is cut off, near the
/// middle, and across where it is long.
pub fn cuts(complex: &Complex, cell: &[Side], corners: &[u32], narrowest: f64) -> Vec<Cut> {
    let mut found: Vec<Cut> = Vec::new();
    let mut extents = [0.0; 3];
    for axis in 0..3 {
        let normal = Vector64::from_fn(|r, _| f64::from(r == axis));
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
            let offset = (pair[0] + pair[1]) / 2.0;
            let middle = (offset - low).min(high - offset) / (high - low);
            let score = smaller * middle.sqrt() * (gap / (high - low)).sqrt().sqrt();
            found.push(Cut { plane: Plane { normal, offset }, near: None, score });
        }
    }
    let longest = extents.iter().fold(0f64, |a, &b| a.max(b));
    found.iter_mut().for_each(|cut| cut.score *= extents[cut.plane.normal.imax()] / longest);
    let axis = |cut: &Cut| cut.plane.normal.imax();
    let order = |a: &Cut, b: &Cut| {
        b.score.total_cmp(&a.score).then(axis(a).cmp(&axis(b))).then(a.plane.offset.total_cmp(&b.plane.offset))
    };
    found.sort_by(order);
    found.truncate(MOST_CUTS);
    // Corners of the section that are close to each other make thin triangles.
    let loops: Vec<Vec<u32>> = cell.iter().map(|&(face, _)| complex.corners(face)).collect();
    for cut in &mut found {
        let shortest = complex.shortest_side(&loops, &cut.plane);
        cut.score *= (shortest / longest).min(0.1).sqrt();
    }
    found.sort_by(order);
    found
}

/// An edge where the solid is more than flat.
pub struct Notch {
    edge: [u32; 2],
    faces: [usize; 2],
    /// By how much, in right angles, 1 at most.
    pub weight: f64,
}

/// A cell's notches.
pub fn notches(complex: &Complex, cell: &[Side]) -> Vec<Notch> {
    let mut edges: Vec<([u32; 2], usize)> = Vec::with_capacity(3 * cell.len());
    for (i, &(face, _)) in cell.iter().enumerate() {
        let corners = complex.corners(face);
        for (k, &a) in corners.iter().enumerate() {
            let b = corners[(k + 1) % corners.len()];
            edges.push(([a.min(b), a.max(b)], i));
        }
    }
    edges.sort_unstable();
    let mut found = Vec::new();
    for around in edges.chunk_by(|a, b| a.0 == b.0) {
        let &[(edge, one), (_, other)] = around else { continue };
        let [plane, next] = [one, other].map(|i| complex.plane(cell[i]));
        let turn = plane.normal.cross(&next.normal).norm();
        let above = |corner: u32| plane.normal.dot(&complex.points[corner as usize]) - plane.offset;
        let highest = complex.corners(cell[other].0).into_iter().map(above).fold(0.0, f64::max);
        if turn > 1e-4 && highest > LEAST {
            let angle = libm::atan2(turn, plane.normal.dot(&next.normal));
            found.push(Notch { edge, faces: [one, other], weight: (angle / std::f64::consts::FRAC_PI_2).min(1.0) });
        }
    }
    found
}

/// Cuts beside so many of a cell's notches: through each face there, so far along it, straight into the solid.
pub fn notch_cuts(complex: &Complex, cell: &[Side], notches: &[Notch], count: usize, share: f64) -> Vec<Cut> {
    let sharpest = notches.iter().map(|notch| notch.weight).fold(0.0, f64::max);
    let sharp: Vec<&Notch> = notches.iter().filter(|notch| notch.weight > 0.5 * sharpest).collect();
    let count = count.min(sharp.len());
    let mut found = Vec::new();
    for i in 0..count {
        let notch = sharp[(2 * i + 1) * sharp.len() / (2 * count)];
        let [from, to] = notch.edge.map(|i| complex.points[i as usize]);
        for face in notch.faces {
            let Some(normal) = (to - from).cross(&complex.plane(cell[face]).normal).try_normalize(1e-12) else {
                continue;
            };
            let heights = || complex.corners(cell[face].0).into_iter().map(|c| normal.dot(&complex.points[c as usize]));
            let (low, high) = heights().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
            let plane = Plane { normal, offset: low + (high - low) * share };
            let near = (from + to) / 2.0;
            let near = near + normal * (plane.offset - normal.dot(&near));
            found.push(Cut { plane, near: Some(near), score: notch.weight });
        }
    }
    found
}
