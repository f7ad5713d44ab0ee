//! The solid within a closed surface of triangles, in tetrahedra.
//!
//! A solid that some point inside sees all of, such as every convex one, is cut into one tetrahedron a triangle by joining
//! its triangles to that point ([`kernel`]). Any other is cut in two by a plane, far from corners, and the section
//! is filled with triangles that both halves share ([`complex`], [`section`]); and so on with the halves. Of several planes that
//! is taken whose halves promise the fewest pieces ([`choice`]). Cuts go through triangles of the surface too: these are divided, never moved, and its own vertices stay where
//! they are.
//!
//! Nothing here asks whether four points lie in one plane. The corners of flat faces do but for their last digit, once a body
//! is rotated and rounded; mesh generators whose tetrahedra have corners of the surface only, such as constrained Delaunay
//! ones, fill them with slivers that fold over when rounded. Here each tetrahedron has a triangle for its base and an
//! apex well above it, so it withstands rounding; and tetrahedra with the right boundary that all have positive volume
//! fill the solid, once.
//!
//! Before that the triangles of flat faces are made compact ([`slivers`], [`flat`]): a face cut by ear clipping would make needles of
//! all that is cut through it.
//!
//! Compared with this were: cutting along the planes of all triangles in whole numbers (exact, but 490 to 3,000 pieces a
//! triangle on prisms whose flat faces are off by a last digit, most of them slivers), and constrained Delaunay
//! tetrahedralisation (few pieces, but slivers between corners of a flat face, and no crate with a free licence).
//!
//! A surface that is open has no inside and is refused, and one that passes through itself, as bodies that overlap do, is told
//! ([`crate::mesh::crossings`]).

mod apex;
mod cells;
mod choice;
mod complex;
mod flat;
mod kernel;
mod polygon;
pub mod section;
mod slivers;

use std::collections::{BTreeMap, HashMap};

use nalgebra::Matrix3;

use self::apex::{Apex, apex};
use self::choice::{MOST_TRIED, best_cut};
use self::complex::{Complex, Side};
use crate::geometry::Vector64;
use crate::mesh::crossings;
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

/// What becomes of the triangles of flat faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Faces {
    /// They may be others over the same corners.
    Anew,
    /// They stay, since something else is joined to them.
    Kept,
}

/// The points and the positively oriented tetrahedra of the solid within these triangles. Points with identical coordinates
/// must be one point. Triangles that face the wrong way are turned, and flat faces divided anew unless they are `kept`. Beside them a complaint, if the surface passes through itself and is filled all the
/// same.
///
/// # Errors
/// If the surface is open, or passes through itself in a way that can't be filled, or `progress` says to stop.
pub fn fill(
    points: &[Vector64<3>],
    triangles: &[[u32; 3]],
    faces: Faces,
    progress: &dyn Progress,
) -> Result<(Solid, Option<String>), Unfilled> {
    let nothing = || "encloses nothing: all its triangles are flat or cancel".to_owned();
    let triangles = without_pairs(triangles);
    if triangles.is_empty() {
        return Err(nothing().into());
    }
    let frame = Frame::of(points, &triangles);
    let near: Vec<Vector64<3>> = points.iter().map(|point| frame.inwards(point)).collect();
    let triangles = slivers::turned(&near, outward(&near, triangles)?);
    let triangles = match faces {
        Faces::Anew => flat::compact(&near, triangles),
        Faces::Kept => triangles,
    };
    if enclosed_volume(corners(&near, &triangles)) < LEAST * LEAST {
        return Err(nothing().into());
    }
    let overlap = crossings::told(points, &triangles).map(|crossing| {
        format!(
            "{crossing}; occlusion may be wrong there: unite them in the program that made them, or write each as an object of its own"
        )
    });
    let tries = (MOST_TRIED / triangles.len()).clamp(3, 9);
    let mut best: Option<((usize, usize), Solid)> = None;
    let mut trouble = None;
    // The plain way is fast, and often enough as good.
    for tries in [0, tries] {
        match in_cells(&near, &triangles, tries, progress) {
            Err(Stopped::Cancelled) => return Err(Unfilled::Cancelled),
            Err(Stopped::At(near)) => trouble = trouble.or(Some(near)),
            Ok((inner, tetrahedra)) => {
                let (used, tetrahedra) = super::lattice::compact(tetrahedra);
                let place = |i: u32| match points.get(i as usize) {
                    Some(point) => *point,
                    None => frame.outwards(&inner[i as usize]),
                };
                let places: Vec<Vector64<3>> = used.into_iter().map(place).collect();
                let order = (folded(&places, &tetrahedra), tetrahedra.len());
                if best.as_ref().is_none_or(|(least, _)| order < *least) {
                    best = Some((order, (places, tetrahedra)));
                }
            }
        }
        if best.as_ref().is_some_and(|((folded, count), _)| *folded == 0 && *count <= FEW * triangles.len()) {
            break;
        }
    }
    match (best, trouble) {
        (Some((_, (_, tetrahedra))), _) if tetrahedra.is_empty() => Err(nothing().into()),
        (Some((_, solid)), _) => Ok((solid, overlap)),
        (None, near) => {
            let [x, y, z] = frame.outwards(&near.unwrap_or_default()).into();
            let message = format!(
                "passes through itself, or is too thin for single precision, near ({x:.6}, {y:.6}, {z:.6}); repair it, or \
                 write caps: false for walls only"
            );
            Err(message.into())
        }
    }
}

/// Points and tetrahedra.
pub type Solid = (Vec<Vector64<3>>, Vec<[u32; 4]>);

/// So many tetrahedra a triangle are few.
const FEW: usize = 4;

/// How many tetrahedra have no volume left once their corners are rounded to single precision.
fn folded(points: &[Vector64<3>], tetrahedra: &[[u32; 4]]) -> usize {
    let rounded = |i: u32| points[i as usize].map(|x| f64::from(x as f32));
    let volume = |tetrahedron: &&[u32; 4]| {
        let [a, b, c, d] = tetrahedron.map(rounded);
        (b - a).cross(&(c - a)).dot(&(d - a))
    };
    tetrahedra.iter().filter(|tetrahedron| volume(tetrahedron) <= 0.0).count()
}

/// Why there are no cells.
enum Stopped {
    Cancelled,
    /// A point near which no cut is possible.
    At(Vector64<3>),
}

/// The solid in tetrahedra, where so many cuts of a cell are tried; the points' own come first.
fn in_cells(
    points: &[Vector64<3>],
    triangles: &[[u32; 3]],
    tries: usize,
    progress: &dyn Progress,
) -> Result<Solid, Stopped> {
    let (mut complex, whole) = Complex::new(points.to_vec(), triangles);
    let own = points.len() as u32;
    let mut leaves: Vec<(Vec<Side>, Apex)> = Vec::new();
    let mut open: Vec<(Vec<Side>, u32)> = vec![(whole, 0)];
    while let Some((cell, cuts)) = open.pop() {
        let cell = complex.resolve(&cell);
        for part in cells::parts(&complex, cell) {
            if progress.cancelled() {
                return Err(Stopped::Cancelled);
            }
            let corners = complex.corners_of(&part);
            if let Some(apex) = apex(&complex, &part, &corners, own, cuts) {
                leaves.push((part, apex));
                continue;
            }
            let halves = best_cut(&mut complex, &part, &corners, own, cuts, tries, progress).map_err(Stopped::At)?;
            open.extend(halves.into_iter().rev().map(|cell| (cell, cuts + 1)));
        }
    }
    let tetrahedra = tetrahedra(&mut complex, leaves);
    Ok((complex.points, tetrahedra))
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

/// Joins the faces of each cell to its apex.
fn tetrahedra(complex: &mut Complex, leaves: Vec<(Vec<Side>, Apex)>) -> Vec<[u32; 4]> {
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
    found
}
