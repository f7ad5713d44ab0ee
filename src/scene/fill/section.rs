//! A plane's section through a cell, in triangles: a region bounded by directed edges, with the region on their left.
//!
//! The region may have holes and several parts. Its triangles are those of the constrained Delaunay triangulation of the
//! edges (`spade`, whose predicates are exact) that the edges wind around once. No point is added, so the section meets the
//! cut faces edge by edge. Edges that cross, or wind around something twice, belong to a surface that passes through itself.

use std::collections::{BTreeMap, HashMap, VecDeque};

use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};

/// The triangles, counterclockwise, as indices into `points`.
///
/// # Errors
/// The index of a point near which the edges cross, touch, or enclose something twice.
pub fn triangles(points: &[[f64; 2]], edges: &[[u32; 2]]) -> Result<Vec<[u32; 3]>, u32> {
    // How often each edge runs from its lower to its higher end, less how often the other way.
    let mut net: BTreeMap<[u32; 2], i32> = BTreeMap::new();
    for &[a, b] in edges {
        *net.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
    }
    net.retain(|_, count| *count != 0);
    let mut triangulation = ConstrainedDelaunayTriangulation::<Point2<f64>>::new();
    let mut handles = Vec::with_capacity(points.len());
    for (i, &[x, y]) in points.iter().enumerate() {
        let handle = triangulation.insert(Point2::new(x, y)).map_err(|_| i as u32)?;
        if handle.index() != i {
            return Err(i as u32);
        }
        handles.push(handle);
    }
    for &[a, b] in net.keys() {
        let (from, to) = (handles[a as usize], handles[b as usize]);
        if !triangulation.can_add_constraint(from, to) {
            return Err(a);
        }
        triangulation.add_constraint(from, to);
        // An edge that passes through another point would be divided there.
        if triangulation.get_edge_from_neighbors(from, to).is_none() {
            return Err(a);
        }
    }
    let mut winding: HashMap<usize, i32> = HashMap::new();
    let mut open = VecDeque::new();
    // From outside inwards. All edges of the hull border on the outer face.
    for edge in triangulation.directed_edges().filter(|edge| edge.is_outer_edge()) {
        open.push_back((edge.rev(), 0));
    }
    let mut found = Vec::new();
    while let Some((edge, before)) = open.pop_front() {
        // What is to the left of `edge`, coming from its right.
        let Some(face) = edge.face().as_inner() else { continue };
        let (a, b) = (edge.from().fix().index() as u32, edge.to().fix().index() as u32);
        let count = net.get(&[a.min(b), a.max(b)]).copied().unwrap_or(0);
        let here = before + if a < b { count } else { -count };
        match winding.insert(face.fix().index(), here) {
            Some(known) if known != here => return Err(a),
            Some(_) => continue,
            None => {}
        }
        match here {
            0 => {}
            1 => found.push(face.vertices().map(|vertex| vertex.fix().index() as u32)),
            _ => return Err(a),
        }
        for side in face.adjacent_edges() {
            open.push_back((side.rev(), here));
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ring(points: &mut Vec<[f64; 2]>, low: f64, high: f64, turned: bool) -> Vec<[u32; 2]> {
        let first = points.len() as u32;
        points.extend([[low, low], [high, low], [high, high], [low, high]]);
        (0..4).map(|i| [first + i, first + (i + 1) % 4]).map(|[a, b]| if turned { [b, a] } else { [a, b] }).collect()
    }

    #[test]
    fn holes_stay_open_and_crossings_are_found() {
        let mut points = Vec::new();
        let mut edges = ring(&mut points, 0.0, 3.0, false);
        edges.extend(ring(&mut points, 1.0, 2.0, true));
        let found = triangles(&points, &edges).unwrap();
        let area: f64 = (found.iter())
            .map(|t| t.map(|i| points[i as usize]))
            .map(|[a, b, c]| ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2.0)
            .sum();
        assert!((area - 8.0).abs() < 1e-12);
        assert_eq!(found.len(), 8);
        let mut twice = ring(&mut Vec::new(), 0.0, 3.0, false);
        twice.extend(ring(&mut points[..4].to_vec(), 1.0, 2.0, false));
        assert!(triangles(&points, &twice).is_err(), "wound around twice");
        let mut points = Vec::new();
        let mut crossing = ring(&mut points, 0.0, 2.0, false);
        crossing.extend(ring(&mut points, 1.0, 3.0, false));
        assert!(triangles(&points, &crossing).is_err());
    }
}
