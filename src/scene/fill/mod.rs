//! The solid within a closed surface of triangles, in tetrahedra.
//!
//! The surface is met exactly: the triangles' planes cut the space around into convex cells, each wholly inside or wholly
//! outside ([`tree`], [`inside`]), and those inside are cut into tetrahedra ([`tetrahedra`]). The points where planes meet are
//! added, on the surface too; its own vertices stay where they are, and its triangles are divided, never moved. All
//! decisions are made in whole numbers ([`exact`]), so no input is too flat or too close to itself; only the added points'
//! coordinates are rounded, at the very end. A surface that is open, or passes through itself, has no inside and is
//! refused.

mod complex;
mod exact;
mod inside;
mod tetrahedra;
mod tree;

use std::collections::HashMap;

use num_bigint::BigInt;

use self::complex::Complex;
use self::exact::{Plane, Point, unit};
use self::inside::Flush;
use crate::geometry::Vector64;
use crate::mesh::topology::{corners, enclosed_volume, facet_pairs};

/// The most triangles: the time grows faster than their number.
const MOST_TRIANGLES: usize = 50_000;

/// The points and the positively oriented tetrahedra of the solid within these triangles. Points with identical coordinates
/// must be one point. If all triangles face inwards they are turned.
///
/// # Errors
/// If the surface is open, passes through itself, or is too large.
pub fn fill(points: &[Vector64<3>], triangles: &[[u32; 3]]) -> Result<(Vec<Vector64<3>>, Vec<[u32; 4]>), String> {
    let pairs = facet_pairs(triangles);
    let walls_only = "caps need a closed surface; repair it, or write caps: false for walls only";
    if pairs.open > 0 {
        return Err(format!("is open at {} edges: {walls_only}", pairs.open));
    }
    if pairs.misoriented > 0 {
        return Err(format!(
            "has neighbouring triangles that face opposite ways at {} edges: {walls_only}",
            pairs.misoriented
        ));
    }
    if !pairs.is_closed() {
        return Err(format!("has {} edges where its triangles don't close: {walls_only}", pairs.unbalanced));
    }
    if triangles.len() > MOST_TRIANGLES {
        let count = triangles.len();
        return Err(format!(
            "has {count} triangles; caps are made for {MOST_TRIANGLES} at most: simplify it, or mesh it in tetrahedra"
        ));
    }
    let inwards = enclosed_volume(corners(points, triangles)) < 0.0;
    // Finer than the coordinates need it, so that there are whole numbers between close points too.
    let edges = triangles.iter().flat_map(|t| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])]);
    let length = |(a, b): (u32, u32)| (points[a as usize] - points[b as usize]).norm();
    let shortest = edges.map(length).filter(|l| *l > 0.0).fold(f64::INFINITY, f64::min);
    let unit = unit(points).min(if shortest.is_finite() { libm::ilogb(shortest) - 12 } else { 0 });
    let exact: Vec<Point> = points.iter().map(|point| Point::new(point, unit)).collect();
    let mut planes: Vec<Plane> = Vec::new();
    let mut polygons: Vec<([u32; 3], usize)> = Vec::new();
    let mut flush: HashMap<Plane, Flush> = HashMap::new();
    for &[a, b, c] in triangles {
        let triangle = if inwards { [a, c, b] } else { [a, b, c] };
        // Triangles without area bound nothing.
        let Some(plane) = Plane::through(triangle.map(|i| &exact[i as usize])) else { continue };
        let (plane, turned) = plane.upwards();
        let known = flush.entry(plane.clone()).or_insert(Flush { triangles: Vec::new() });
        known.triangles.push((triangle, !turned));
        polygons.push((triangle, planes.len()));
        planes.push(plane);
    }
    let mut complex = Complex::new(around(points, unit)?);
    for index in shuffled(polygons.len()) {
        let (triangle, plane) = &polygons[index];
        let polygon = triangle.iter().map(|&i| exact[i as usize].clone()).collect();
        tree::insert(&mut complex, polygon, &planes[*plane])?;
    }
    for polygon in fins(points, &exact, &polygons, &planes, unit) {
        if let Some(plane) = Plane::through([&polygon[0], &polygon[1], &polygon[2]]) {
            tree::insert(&mut complex, polygon, &plane.upwards().0)?;
        }
    }
    let cells = inside::inside(&complex, &exact, &flush, unit)?;
    if cells.is_empty() {
        return Err("encloses nothing: all its triangles are flat or cancel".into());
    }
    let (points, tetrahedra) = tetrahedra::tetrahedra(&complex, &cells, unit);
    let (used, tetrahedra) = super::lattice::compact(tetrahedra);
    Ok((used.into_iter().map(|i| points[i as usize]).collect(), tetrahedra))
}

/// A box around all points, with room, in whole numbers.
fn around(points: &[Vector64<3>], unit: i32) -> Result<[[BigInt; 3]; 2], String> {
    let size = points.iter().flatten().fold(0f64, |size, x| size.max(x.abs()));
    // Beyond the largest coordinate, to the next power of two.
    let exponent = libm::ilogb(size) + 2 - unit;
    if size == 0.0 || exponent > 1000 {
        return Err("has coordinates of too different sizes to be filled; leave out what is tiny".into());
    }
    let high = BigInt::from(1) << exponent;
    Ok([std::array::from_fn(|_| -high.clone()), std::array::from_fn(|_| high.clone())])
}

/// Small triangles that stand on the edges between triangles of one plane, into the solid: they keep vertices within flat
/// parts of the surface, which no other plane would mark.
fn fins(
    points: &[Vector64<3>],
    exact: &[Point],
    polygons: &[([u32; 3], usize)],
    planes: &[Plane],
    unit: i32,
) -> Vec<Vec<Point>> {
    let mut edges: HashMap<(u32, u32), Vec<usize>> = HashMap::new();
    for (i, (triangle, _)) in polygons.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
            edges.entry((a.min(b), a.max(b))).or_default().push(i);
        }
    }
    let mut flat: Vec<((u32, u32), usize)> = edges
        .into_iter()
        .filter(|(_, sides)| sides.len() == 2 && planes[polygons[sides[0]].1] == planes[polygons[sides[1]].1])
        .map(|(edge, sides)| (edge, sides[0]))
        .collect();
    flat.sort_unstable();
    let fin = |((a, b), side): ((u32, u32), usize)| {
        let [p, q, r] = polygons[side].0.map(|i| points[i as usize]);
        let normal = (q - p).cross(&(r - p));
        let (from, to) = (points[a as usize], points[b as usize]);
        // Low enough to stay within the box.
        let height = 0.25 * (to - from).norm() / normal.norm();
        let tip = (from + to) / 2.0 - normal * height;
        tip.iter()
            .all(|x| x.is_finite())
            .then(|| vec![exact[a as usize].clone(), exact[b as usize].clone(), Point::new(&tip, unit)])
    };
    flat.into_iter().filter_map(fin).collect()
}

/// The numbers below `count` in an order without order: triangles in a row would make long, thin cells.
fn shuffled(count: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    let mut state = 1u64;
    for i in (1..count).rev() {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        order.swap(i, ((state >> 33) % (i as u64 + 1)) as usize);
    }
    order
}
