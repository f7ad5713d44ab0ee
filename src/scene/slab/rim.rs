//! Dividing the simplices at a rim where the cap divides the rim's triangles.
//!
//! What fills a cap may put points on the edges of the rim's triangles and inside them. Each small triangle belongs to the one
//! that it lies in. A tetrahedron of the body with such a triangle for a facet, or only such an edge, is joined anew from
//! its middle to its divided facets; a facet with divided edges is a fan from the corner across, which both of its tetrahedra
//! find alike.

use std::collections::{BTreeMap, BTreeSet};

use crate::geometry::Vector64;
use crate::mesh::facets::{facets_of, sort_with_parity};

/// Divides the tetrahedra among these simplices that have triangles or edges of the rim which the cap has divided.
pub fn divide<const D: usize>(
    vertices: &mut Vec<Vector64<D>>,
    simplices: &mut Vec<[u32; D]>,
    rim: &[[u32; 3]],
    cap: &[[u32; D]],
) {
    let whole: BTreeSet<[u32; 3]> = rim.iter().map(sorted).collect();
    let mut small: Vec<[u32; 3]> = outside(cap);
    small.retain(|triangle| !whole.contains(triangle));
    if small.is_empty() {
        return;
    }
    let kept: BTreeSet<[u32; 3]> = outside(cap).into_iter().collect();
    let divided: Vec<[u32; 3]> = whole.iter().filter(|triangle| !kept.contains(*triangle)).copied().collect();
    // The small triangles of each large one, and the points on its edges, in their order.
    let mut parts: BTreeMap<[u32; 3], Vec<[u32; 3]>> = BTreeMap::new();
    for triangle in small {
        let middle = triangle.iter().fold(Vector64::zeros(), |sum, &v| sum + vertices[v as usize]) / 3.0;
        let distance = |large: &[u32; 3]| away(&large.map(|v| vertices[v as usize]), &middle);
        if let Some(large) = divided.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))) {
            parts.entry(*large).or_default().push(triangle);
        }
    }
    let mut edges: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
    for (large, small) in &parts {
        let mut sides: Vec<[u32; 2]> = small.iter().flat_map(|&[a, b, c]| [[a, b], [a, c], [b, c]]).collect();
        sides.sort_unstable();
        let rim = sides.chunk_by(|a, b| a == b).filter(|equal| equal.len() == 1).flat_map(|equal| equal[0]);
        let points: BTreeSet<u32> = rim.filter(|v| !large.contains(v)).collect();
        let [a, b, c] = *large;
        for point in points {
            let place = vertices[point as usize];
            let distance = |edge: &[u32; 2]| along(&edge.map(|v| vertices[v as usize]), &place).1;
            if let Some(edge) = [[a, b], [a, c], [b, c]].into_iter().min_by(|e, f| distance(e).total_cmp(&distance(f)))
            {
                edges.entry(edge).or_default().push(point);
            }
        }
    }
    for (edge, points) in &mut edges {
        let ends = edge.map(|v| vertices[v as usize]);
        let share = |point: &u32| along(&ends, &vertices[*point as usize]).0;
        points.sort_by(|p, q| share(p).total_cmp(&share(q)).then(p.cmp(q)));
        points.dedup();
    }
    let old = std::mem::take(simplices);
    for simplex in old {
        let facets: Vec<([u32; 3], bool)> = facets_of(&simplex).collect();
        let pieces: Vec<Vec<[u32; 3]>> = facets.iter().map(|(facet, _)| pieces(facet, &parts, &edges)).collect();
        if pieces.iter().all(|pieces| pieces.len() == 1) {
            simplices.push(simplex);
            continue;
        }
        let middle = vertices.len() as u32;
        vertices.push(simplex.iter().fold(Vector64::zeros(), |sum, &v| sum + vertices[v as usize]) / D as f64);
        // A simplex is its first corner joined to the facet across, if that isn't turned.
        for ((facet, turned), pieces) in facets.iter().zip(pieces) {
            for mut piece in pieces {
                if runs_against(&piece, facet, vertices) != *turned {
                    piece.swap(0, 1);
                }
                simplices.push(std::array::from_fn(|i| if i == 0 { middle } else { piece[i - 1] }));
            }
        }
    }
}

/// The corners in ascending order.
fn sorted(triangle: &[u32; 3]) -> [u32; 3] {
    let mut corners = *triangle;
    sort_with_parity(&mut corners);
    corners
}

/// What a facet is divided into.
fn pieces(
    facet: &[u32; 3],
    parts: &BTreeMap<[u32; 3], Vec<[u32; 3]>>,
    edges: &BTreeMap<[u32; 2], Vec<u32>>,
) -> Vec<[u32; 3]> {
    if let Some(parts) = parts.get(facet) {
        return parts.clone();
    }
    let [a, b, c] = *facet;
    // A facet with two edges in the hyperplane would lie in it.
    for ([from, to], apex) in [([a, b], c), ([a, c], b), ([b, c], a)] {
        if let Some(points) = edges.get(&[from, to]) {
            let line: Vec<u32> = std::iter::once(from).chain(points.iter().copied()).chain([to]).collect();
            return line.windows(2).map(|pair| [apex, pair[0], pair[1]]).collect();
        }
    }
    vec![*facet]
}

/// Whether a triangle runs against another in the same plane.
fn runs_against<const D: usize>(triangle: &[u32; 3], other: &[u32; 3], vertices: &[Vector64<D>]) -> bool {
    let sides = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| vertices[v as usize]);
        (b - a, c - a)
    };
    let ((u, v), (p, q)) = (sides(triangle), sides(other));
    // The product of the two bivectors.
    u.dot(&p) * v.dot(&q) - u.dot(&q) * v.dot(&p) < 0.0
}

/// How far along an edge the foot of a point is, and its distance from the edge.
fn along<const D: usize>(ends: &[Vector64<D>; 2], point: &Vector64<D>) -> (f64, f64) {
    let (way, offset) = (ends[1] - ends[0], point - ends[0]);
    let share = (offset.dot(&way) / way.norm_squared()).clamp(0.0, 1.0);
    (share, (offset - way * share).norm())
}

/// The distance of a point from a triangle.
fn away<const D: usize>(corners: &[Vector64<D>; 3], point: &Vector64<D>) -> f64 {
    let (u, v, offset) = (corners[1] - corners[0], corners[2] - corners[0], point - corners[0]);
    let (uu, uv, vv, up, vp) = (u.dot(&u), u.dot(&v), v.dot(&v), u.dot(&offset), v.dot(&offset));
    let det = uu * vv - uv * uv;
    let (s, t) = ((up * vv - vp * uv) / det, (vp * uu - up * uv) / det);
    if s >= 0.0 && t >= 0.0 && s + t <= 1.0 {
        return (offset - u * s - v * t).norm();
    }
    let [a, b, c] = *corners;
    [[a, b], [a, c], [b, c]].iter().map(|edge| along(edge, point).1).fold(f64::INFINITY, f64::min)
}

/// The facets of simplices that only one of them has.
fn outside<const D: usize>(simplices: &[[u32; D]]) -> Vec<[u32; 3]> {
    let mut facets: Vec<[u32; 3]> = simplices.iter().flat_map(|s| facets_of(s).map(|(corners, _)| corners)).collect();
    facets.sort_unstable();
    facets.chunk_by(|a, b| a == b).filter(|equal| equal.len() == 1).map(|equal| equal[0]).collect()
}
