//! The solid within a closed surface of triangles, in tetrahedra.
//!
//! A solid that some point inside sees all of, such as every convex one, is cut into one tetrahedron a triangle by joining
//! its triangles to that point ([`kernel`]). Any other is cut in two by a plane across an axis, far from all its corners,
//! and the section is filled with triangles that both halves share ([`complex`], [`section`]); and so on with the halves
//! ([`cells`]). Cuts go through triangles of the surface too: these are divided, never moved, and its own vertices stay where
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
//! A surface that is open has no inside and is refused, and so is one of which a section shows that it passes through
//! itself. Bodies that overlap, each closed, are each filled where no section has both.

mod cells;
mod complex;
mod kernel;
mod polygon;
pub mod section;
mod slivers;

use std::collections::{BTreeMap, HashMap};

use nalgebra::Matrix3;

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
    let (mut complex, whole) = Complex::new(near, &triangles);
    let own = points.len() as u32;
    let crossed = |point: Vector64<3>| {
        let [x, y, z] = frame.outwards(&point).into();
        format!(
            "passes through itself, or is too thin for single precision, near ({x:.6}, {y:.6}, {z:.6}); repair it, or \
             write caps: false for walls only"
        )
    };
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
            let mut trouble = complex.points[corners[0] as usize];
            let mut halves = None;
            for cut in cells::cuts(&complex, &part, &corners, 2.0 * LEAST) {
                match complex.cut(&part, cut.axis, cut.at) {
                    Ok(found) => {
                        halves = Some(found);
                        break;
                    }
                    Err(near) => trouble = near,
                }
            }
            let Some([below, above]) = halves else { return Err(crossed(trouble).into()) };
            open.push((above, cuts + 1));
            open.push((below, cuts + 1));
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
        if depth >= share * width && covers(complex, cell, &point) == 1 {
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

/// How often a cell's boundary, all of which faces away from a point, lies around it: more than once if it passes through
/// itself. Its solid angle, by the formula of Van Oosterom and Strackee (1983).
fn covers(complex: &Complex, cell: &[Side], from: &Vector64<3>) -> i64 {
    let mut angle = 0.0;
    for &side in cell {
        let corners = complex.corners_outward(side);
        let at = |i: usize| complex.points[corners[i] as usize] - from;
        for i in 1..corners.len() - 1 {
            let [a, b, c] = [at(0), at(i), at(i + 1)];
            let [x, y, z] = [a.norm(), b.norm(), c.norm()];
            let cosine = x * y * z + a.dot(&b) * z + b.dot(&c) * x + c.dot(&a) * y;
            angle += 2.0 * libm::atan2(a.cross(&b).dot(&c), cosine);
        }
    }
    (angle / (4.0 * std::f64::consts::PI)).round() as i64
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
