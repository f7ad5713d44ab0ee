//! Flat faces in well-shaped triangles: diagonals are turned until each face's triangulation is Delaunay (Lawson 1977).
//!
//! Programs cut flat faces by ear clipping, which leaves triangles as long as the face and as narrow as its shortest edges, all
//! across each other's way. Each cut through the solid then goes through hundreds of them, and the pieces become
//! needles. A face's triangles may be any that cover it, so they become compact ones. Points stay where they are; where
//! rounding has moved corners of a face out of its plane, the surface moves by as little.

use std::collections::HashMap;

use super::LEAST;
use crate::geometry::Vector64;

/// How far apart the diagonals of four points in one plane are at most, in a body of about size 1: some steps of single precision.
const FLAT: f64 = 3e-7;

/// Turns a triangle at most. Some ten are the rule.
const MOST_TURNS: usize = 200;

/// The triangles of a closed surface of about size 1, with those of flat faces as compact as can be.
pub fn compact(points: &[Vector64<3>], mut triangles: Vec<[u32; 3]>) -> Vec<[u32; 3]> {
    // Which triangle has an edge in this direction; none where several have it.
    let mut edges: HashMap<[u32; 2], Option<usize>> = HashMap::with_capacity(3 * triangles.len());
    let mut open: Vec<[u32; 2]> = Vec::with_capacity(3 * triangles.len() / 2);
    for (i, &[a, b, c]) in triangles.iter().enumerate() {
        for edge in [[a, b], [b, c], [c, a]] {
            edges.entry(edge).and_modify(|known| *known = None).or_insert(Some(i));
            if edge[0] < edge[1] {
                open.push(edge);
            }
        }
    }
    let mut turns = MOST_TURNS * triangles.len();
    while let (Some([a, b]), 1..) = (open.pop(), turns) {
        let (Some(&Some(one)), Some(&Some(other))) = (edges.get(&[a, b]), edges.get(&[b, a])) else { continue };
        let third = |i: usize| triangles[i].into_iter().find(|&corner| corner != a && corner != b);
        let (Some(c), Some(d)) = (third(one), third(other)) else { continue };
        let exists = edges.contains_key(&[c, d]) || edges.contains_key(&[d, c]);
        if c == d || exists || !better([a, b, c, d].map(|i| &points[i as usize])) {
            continue;
        }
        turns -= 1;
        (triangles[one], triangles[other]) = ([c, a, d], [d, b, c]);
        edges.remove(&[a, b]);
        edges.remove(&[b, a]);
        for (edge, place) in
            [([c, a], one), ([a, d], one), ([d, c], one), ([d, b], other), ([b, c], other), ([c, d], other)]
        {
            edges.insert(edge, Some(place));
        }
        open.extend([[c, a], [a, d], [d, b], [b, c]]);
    }
    triangles
}

/// Whether the triangles a, b, c and b, a, d lie in one plane, and are better as c, a, d and d, b, c.
fn better([a, b, c, d]: [&Vector64<3>; 4]) -> bool {
    let normals = [(b - a).cross(&(c - a)), (a - b).cross(&(d - b))];
    let across = (b - a).cross(&(d - c));
    if normals[0].dot(&normals[1]) <= 0.0 || (c - a).dot(&across).abs() > FLAT * across.norm() {
        return false;
    }
    let normal = normals[0] + normals[1];
    let least = LEAST * (d - c).norm() * normal.norm();
    if [(d - a).cross(&(c - a)), (c - b).cross(&(d - b))].iter().any(|turned| turned.dot(&normal) <= least) {
        return false;
    }
    // Delaunay where the two angles across add up to half a turn at most.
    let cotangent = |tip: &Vector64<3>| (a - tip).dot(&(b - tip)) / (a - tip).cross(&(b - tip)).norm();
    cotangent(c) + cotangent(d) < -1e-9
}
