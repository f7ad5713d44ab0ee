//! The solid within a closed surface of triangles, in tetrahedra.
//!
//! A solid that some point inside sees all of, such as every convex one, is cut into one tetrahedron a triangle by joining
//! its triangles to that point ([`kernel`]). Any other is cut in two by a plane, far from corners, and the section
//! is filled with triangles that both halves share ([`complex`], [`section`]); and so on with the halves. Of several planes that
//! is taken whose halves promise the fewest pieces ([`cells`]). Cuts go through triangles of the surface too: these are divided, never moved, and its own vertices stay where
//! they are.
//!
//! Nothing here asks whether four points lie in one plane. The corners of flat faces do but for their last digit, once a body
//! is rotated and rounded; mesh generators whose tetrahedra have corners of the surface only, such as constrained Delaunay
//! ones, fill them with slivers that fold over when rounded. Here each tetrahedron has a triangle for its base and an
//! apex well above it, so it withstands rounding; and tetrahedra with the right boundary that all have positive volume
//! fill the solid, once.
//!
//! Compared with this were: cutting along the planes of all triangles in whole numbers (exact, but 490 to 3,000 pieces a
//! triangle on prisms whose flat faces are off by a last digit, most of them slivers), and constrained Delaunay
//! tetrahedralisation (few pieces, but slivers between corners of a flat face, and no crate with a free licence).
//!
//! A surface that is open has no inside and is refused, and so is one that passes through itself, as bodies that overlap do
//! ([`crossings`]).

mod cells;
mod complex;
mod crossings;
mod kernel;
mod polygon;
pub mod section;
mod slivers;

use std::collections::{BTreeMap, HashMap};

use nalgebra::Matrix3;

use self::cells::{Cut, winding};
use self::complex::{Complex, Side};
use self::kernel::{Deepest, Plane, deepest};
use crate::geometry::Vector64;
use crate::mesh::facets::sort_with_parity;
use crate::mesh::topology::{corners, enclosed_volume, facet_pairs};
use crate::mesh::{MeshBuilder, Orientation, Surface};
use crate::progress::Progress;

/// The least height of an apex over its base, and the narrowest gap to cut in, in terms of the solid's size: some steps of
/// single precision.
const LEAST: f64 = 1e-6;

/// Why there is no solid.
#[derive(Debug)]
pub enum Unfilled {
    /// Whoever watches wants no more of it.
    Cancelled,
    /// What is wrong with the surface, and what to do about it.
    Refused(String),
}

impl From<String> for Unfilled {
    fn from(message: String) -> Self {
        Self::Refused(message)
    }
}

/// The points and the positively oriented tetrahedra of the solid within these triangles. Points with identical coordinates
/// must be one point. Triangles that face the wrong way are turned.
///
/// # Errors
/// If the surface is open or passes through itself, or `progress` says to stop.
pub fn fill(
    points: &[Vector64<3>],
    triangles: &[[u32; 3]],
    progress: &dyn Progress,
) -> Result<(Vec<Vector64<3>>, Vec<[u32; 4]>), Unfilled> {
    let nothing = || "encloses nothing: all its triangles are flat or cancel".to_owned();
    let triangles = without_pairs(triangles);
    if triangles.is_empty() {
        return Err(nothing().into());
    }
    let frame = Frame::of(points, &triangles);
    let near: Vec<Vector64<3>> = points.iter().map(|point| frame.inwards(point)).collect();
    let triangles = slivers::turned(&near, outward(&near, triangles)?);
    if enclosed_volume(corners(&near, &triangles)) < LEAST * LEAST {
        return Err(nothing().into());
    }
    if let Some([one, other]) = crossings::crossing(&near, &triangles) {
        let middle =
            |i: usize| frame.outwards(&(triangles[i].iter().map(|&p| near[p as usize]).sum::<Vector64<3>>() / 3.0));
        let place = |i: usize| middle(i).iter().map(|x| format!("{x:.6}")).collect::<Vec<_>>().join(", ");
        let how = match one == other {
            true => format!("the triangle at ({}) is inside a body that the rest of its own is not inside", place(one)),
            false => format!("the triangles at ({}) and at ({})", place(one), place(other)),
        };
        return Err(Unfilled::Refused(format!(
            "passes through itself, or has bodies that overlap: {how}; unite them in the program that made them, write each as \
             an object of its own, or write caps: false for walls only"
        )));
    }
    let (mut complex, whole) = Complex::new(near, &triangles);
    let own = points.len() as u32;
    let crossed = |point: Vector64<3>| {
        let [x, y, z] = frame.outwards(&point).into();
        format!(
            "passes through itself, or is too thin for single precision, near ({x:.6}, {y:.6}, {z:.6}); repair it, or \
             write caps: false for walls only"
        )
    };
    let tries = (MOST_TRIED / triangles.len()).clamp(3, 9);
    let mut leaves: Vec<(Vec<Side>, Apex)> = Vec::new();
    let mut open: Vec<(Vec<Side>, u32)> = vec![(whole, 0)];
    while let Some((cell, cuts)) = open.pop() {
        let cell = complex.resolve(&cell);
        for part in cells::parts(&complex, cell) {
            if progress.cancelled() {
                return Err(Unfilled::Cancelled);
            }
            let corners = corners_of(&complex, &part);
            if let Some(apex) = apex(&complex, &part, &corners, own, cuts) {
                leaves.push((part, apex));
                continue;
            }
            match best_cut(&mut complex, &part, &corners, own, cuts, tries, progress) {
                Ok(cells) => open.extend(cells.into_iter().rev().map(|cell| (cell, cuts + 1))),
                Err(trouble) => return Err(crossed(trouble).into()),
            }
        }
    }
    let tetrahedra = tetrahedra(&mut complex, leaves).map_err(crossed)?;
    if tetrahedra.is_empty() {
        return Err(nothing().into());
    }
    let (used, tetrahedra) = super::lattice::compact(tetrahedra);
    let points = used.into_iter().map(|i| match points.get(i as usize) {
        Some(point) => *point,
        None => frame.outwards(&complex.points[i as usize]),
    });
    Ok((points.collect(), tetrahedra))
}

/// The triangles without those that lie on each other and face opposite ways, as where two bodies touch.
fn without_pairs(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut sheets: BTreeMap<[u32; 3], [Vec<usize>; 2]> = BTreeMap::new();
    for (i, triangle) in triangles.iter().enumerate() {
        let mut key = *triangle;
        let odd = sort_with_parity(&mut key);
        sheets.entry(key).or_default()[usize::from(odd)].push(i);
    }
    let mut kept: Vec<usize> = Vec::with_capacity(triangles.len());
    for [one, other] in sheets.values() {
        let (many, few) = if one.len() > other.len() { (one, other) } else { (other, one) };
        kept.extend(&many[few.len()..]);
    }
    kept.sort_unstable();
    kept.into_iter().map(|i| triangles[i]).collect()
}

/// Where the solid is worked on: about its middle, in terms of half its extent, and with its largest flat faces across the axes,
/// so that cuts go along walls and across them, never aslant through what is thin.
struct Frame {
    center: Vector64<3>,
    size: f64,
    /// Rows are the axes.
    axes: Matrix3<f64>,
}

impl Frame {
    fn of(points: &[Vector64<3>], triangles: &[[u32; 3]]) -> Self {
        let used = || triangles.as_flattened().iter().map(|&i| points[i as usize]);
        let low = used().fold(Vector64::repeat(f64::INFINITY), |low: Vector64<3>, p| low.inf(&p));
        let high = used().fold(Vector64::repeat(f64::NEG_INFINITY), |high: Vector64<3>, p| high.sup(&p));
        let (center, size) = ((low + high) / 2.0, (high - low).amax() / 2.0);
        let size = if size > 0.0 && size.is_finite() { size } else { 1.0 };
        // The area that faces each direction or its opposite, where directions are as good as equal.
        let mut areas: HashMap<[i32; 3], (Vector64<3>, usize)> = HashMap::new();
        for (i, triangle) in triangles.iter().enumerate() {
            let [a, b, c] = triangle.map(|i| (points[i as usize] - center) / size);
            let normal = (b - a).cross(&(c - a));
            let normal = if normal[normal.iamax()] < 0.0 { -normal } else { normal };
            let Some(unit) = normal.try_normalize(1e-12) else { continue };
            let key = unit.map(|x| (x * 512.0).round() as i32).into();
            areas.entry(key).or_insert((Vector64::zeros(), i)).0 += normal;
        }
        let mut areas: Vec<(Vector64<3>, usize)> = areas.into_values().collect();
        areas.sort_by(|a, b| b.0.norm().total_cmp(&a.0.norm()).then(a.1.cmp(&b.1)));
        let first = areas.first().and_then(|(n, _)| n.try_normalize(0.0)).unwrap_or(Vector64::x());
        let across = areas.iter().map(|(n, _)| n.normalize()).find(|n| n.dot(&first).abs() < 0.01);
        let helper = Vector64::<3>::from_fn(|r, _| f64::from(r == first.iamin()));
        let second = across.unwrap_or(helper);
        let second = (second - first * first.dot(&second)).normalize();
        let axes = Matrix3::from_rows(&[first.transpose(), second.transpose(), first.cross(&second).transpose()]);
        Self { center, size, axes }
    }

    fn inwards(&self, point: &Vector64<3>) -> Vector64<3> {
        self.axes * ((point - self.center) / self.size)
    }

    fn outwards(&self, point: &Vector64<3>) -> Vector64<3> {
        self.axes.transpose() * point * self.size + self.center
    }
}

/// The triangles, turned to face outwards as those of a file are: neighbours alike, bodies outwards, cavities inwards.
fn outward(points: &[Vector64<3>], triangles: Vec<[u32; 3]>) -> Result<Vec<[u32; 3]>, String> {
    let surface = Surface { vertices: points.to_vec(), simplices: triangles, normals: None };
    let mut builder = MeshBuilder::<3>::new();
    builder.add("mesh", [0.0; 3], &surface, Orientation::Input).map_err(|error| error.to_string())?;
    let triangles = builder.finish().simplices;
    let pairs = facet_pairs(&triangles);
    let walls_only = "caps need a closed surface; repair it, or write caps: false for walls only";
    if pairs.open > 0 {
        return Err(format!("is open at {} edges: {walls_only}", pairs.open));
    }
    if pairs.misoriented > 0 {
        let count = pairs.misoriented;
        return Err(format!("has neighbouring triangles that face opposite ways at {count} edges: {walls_only}"));
    }
    if !pairs.is_closed() {
        return Err(format!("has {} edges where its triangles don't close: {walls_only}", pairs.unbalanced));
    }
    Ok(triangles)
}

fn corners_of(complex: &Complex, cell: &[Side]) -> Vec<u32> {
    let mut corners: Vec<u32> = cell.iter().flat_map(|&(face, _)| complex.corners(face)).collect();
    corners.sort_unstable();
    corners.dedup();
    corners
}

/// What a cell's faces are joined to.
enum Apex {
    /// A point inside.
    Inside(Vector64<3>),
    /// A corner, which sees all faces that it is not part of.
    Corner(u32),
}

/// A point that sees all of a cell from well above each face; none if the cell is better cut first.
fn apex(complex: &Complex, cell: &[Side], corners: &[u32], own: u32, cuts: u32) -> Option<Apex> {
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

/// How many faces are looked at for all cuts tried of a solid, about; of a cell, some of these.
const MOST_TRIED: usize = 100_000;
const MOST_TRIED_OF_CELL: usize = 5_000;

/// What is narrower is avoided, even at the cost of more pieces.
const NARROW: f64 = 1e-4;

/// What a notch is expected to cost, in faces.
const NOTCH: f64 = 1.0;

/// Cuts a cell where the pieces promise to become the fewest.
///
/// # Errors
/// A point near which no cut is possible.
fn best_cut(
    complex: &mut Complex,
    cell: &[Side],
    corners: &[u32],
    own: u32,
    cuts: u32,
    tries: usize,
    progress: &dyn Progress,
) -> Result<Vec<Vec<Side>>, Vector64<3>> {
    let across = cells::cuts(complex, cell, corners, 2.0 * LEAST);
    let tries = (MOST_TRIED_OF_CELL / cell.len()).clamp(3, tries);
    let notches = cells::notches(complex, cell);
    let mut tried: Vec<Cut> = cells::notch_cuts(complex, cell, &notches, tries / 3);
    tried.extend(across.iter().take(tries - 2 * (tries / 3)));
    let mut best: Option<(f64, Cut)> = None;
    let mut trouble = complex.points[corners[0] as usize];
    for cut in tried {
        if progress.cancelled() {
            break;
        }
        let mark = complex.mark();
        match complex.cut(cell, &cut.plane, cut.near.as_ref()) {
            Ok(halves) => {
                let (mut cost, mut done) = (0.0, true);
                for half in halves.cells {
                    for part in cells::parts(complex, complex.resolve(&half)) {
                        let faces = part.len() as f64;
                        let corners = corners_of(complex, &part);
                        cost += faces;
                        if apex(complex, &part, &corners, own, cuts + 1).is_none() {
                            done = false;
                            let weight: f64 = cells::notches(complex, &part).iter().map(|notch| notch.weight).sum();
                            cost += NOTCH * weight * (2.0 + weight).log2() + 10.0;
                        }
                    }
                }
                cost *= 1.0 + NARROW / halves.shortest;
                if best.is_none_or(|(least, _)| cost < least) {
                    best = Some((cost, cut));
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
    for cut in best.map(|(_, cut)| cut).into_iter().chain(across) {
        let mark = complex.mark();
        match complex.cut(cell, &cut.plane, cut.near.as_ref()) {
            Ok(halves) => return Ok(halves.cells.into()),
            Err(near) => trouble = near,
        }
        complex.undo(mark);
    }
    Err(trouble)
}

/// Joins the faces of each cell to its apex.
fn tetrahedra(complex: &mut Complex, leaves: Vec<(Vec<Side>, Apex)>) -> Result<Vec<[u32; 4]>, Vector64<3>> {
    let mut cut: HashMap<u32, Vec<[u32; 3]>> = HashMap::new();
    let mut found = Vec::new();
    for (cell, apex) in leaves {
        let apex = match apex {
            Apex::Corner(corner) => corner,
            Apex::Inside(point) => {
                complex.points.push(point);
                complex.points.len() as u32 - 1
            }
        };
        for side in complex.resolve(&cell) {
            let (face, positive) = side;
            let corners = complex.corners(face);
            if corners.contains(&apex) {
                continue;
            }
            let normal = if positive { -complex.plane(side).normal } else { complex.plane(side).normal };
            let triangles = cut.entry(face).or_insert_with(|| polygon::triangles(&corners, &complex.points, &normal));
            for &[a, b, c] in triangles.iter() {
                // Positive: the base counterclockwise as seen from outside.
                let tetrahedron = if positive { [apex, a, c, b] } else { [apex, a, b, c] };
                found.push(tetrahedron);
            }
        }
    }
    Ok(found)
}
