//! Triangles without height, as triangulations of faces with corners on straight edges have them: their longest edge is turned.
//!
//! Such a triangle covers nothing, and no point sees it from above. But it can't be left out, since its neighbours end at
//! different edges. With the neighbour at its longest edge it makes a quadrilateral, which the other diagonal cuts into two
//! triangles that cover something. The surface moves by less than what rounding to single precision moves it, and keeps all its
//! points.

use std::collections::HashMap;

use super::LEAST;
use crate::geometry::Vector64;

/// Rounds over all of them. Each takes at least one off a row of slivers.
const ROUNDS: usize = 1000;

/// The triangles of a closed surface of about size 1, with the slivers turned where that makes none.
pub fn turned(points: &[Vector64<3>], mut triangles: Vec<[u32; 3]>) -> Vec<[u32; 3]> {
    let mut slivers: Vec<usize> = (0..triangles.len()).filter(|&i| sliver(points, triangles[i]).is_some()).collect();
    if slivers.is_empty() {
        return triangles;
    }
    // Which triangle has an edge in this direction; none where several have it.
    let mut edges: HashMap<[u32; 2], Option<usize>> = HashMap::new();
    for (i, triangle) in triangles.iter().enumerate() {
        for edge in sides(*triangle) {
            edges.entry(edge).and_modify(|known| *known = None).or_insert(Some(i));
        }
    }
    for _ in 0..ROUNDS {
        let before = slivers.len();
        slivers.retain(|&i| {
            let Some([a, b, apex]) = sliver(points, triangles[i]) else { return false };
            let (Some(Some(other)), Some(Some(_))) = (edges.get(&[b, a]).copied(), edges.get(&[a, b])) else {
                return true;
            };
            let Some(&far) = triangles[other].iter().find(|&&corner| corner != a && corner != b) else { return true };
            let (one, two) = ([apex, a, far], [far, b, apex]);
            let exists = edges.contains_key(&[apex, far]) || edges.contains_key(&[far, apex]);
            if far == apex || exists || [one, two].iter().any(|&t| height(points, t) <= LEAST) {
                return true;
            }
            (triangles[i], triangles[other]) = (one, two);
            edges.remove(&[a, b]);
            edges.remove(&[b, a]);
            for (triangle, place) in [(one, i), (two, other)] {
                edges.extend(sides(triangle).map(|edge| (edge, Some(place))));
            }
            false
        });
        if slivers.len() == before {
            break;
        }
    }
    triangles
}

fn sides([a, b, c]: [u32; 3]) -> [[u32; 2]; 3] {
    [[a, b], [b, c], [c, a]]
}

/// The least height of a triangle, over its longest edge.
fn height(points: &[Vector64<3>], triangle: [u32; 3]) -> f64 {
    let [a, b, c] = triangle.map(|i| points[i as usize]);
    let longest = (b - a).norm().max((c - b).norm()).max((a - c).norm());
    if longest > 0.0 { (b - a).cross(&(c - a)).norm() / longest } else { 0.0 }
}

/// A triangle without height, its longest edge first, if its third corner lies between the others and apart from them.
fn sliver(points: &[Vector64<3>], triangle: [u32; 3]) -> Option<[u32; 3]> {
    if height(points, triangle) > LEAST {
        return None;
    }
    let length = |[a, b]: [u32; 2]| (points[b as usize] - points[a as usize]).norm();
    let lengths = sides(triangle).map(length);
    let first = (0..3).max_by(|&i, &j| lengths[i].total_cmp(&lengths[j]))?;
    let others = [lengths[(first + 1) % 3], lengths[(first + 2) % 3]];
    others.iter().all(|&length| length > LEAST).then(|| [0, 1, 2].map(|k| triangle[(first + k) % 3]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::topology::{corners, enclosed_volume, facet_pairs};

    #[test]
    fn rows_of_slivers_are_turned() {
        // A prism over a square with further corners on one side, whose ends reach them by slivers only.
        for count in [1u32, 2, 5] {
            let mut outline = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
            (1..=count).for_each(|i| outline.push([0.0, 1.0 - f64::from(i) / f64::from(count + 1)]));
            let n = outline.len() as u32;
            let points: Vec<Vector64<3>> = (0..2 * n)
                .map(|i| Vector64::from([outline[(i % n) as usize][0], outline[(i % n) as usize][1], f64::from(i / n)]))
                .collect();
            let mut triangles = Vec::new();
            // Slivers around the corner at the origin, and the two halves of the square.
            let mut end: Vec<[u32; 3]> = vec![[0, 1, 2], [0, 2, 3]];
            end.extend((3..n - 1).map(|i| [0, i, i + 1]));
            triangles.extend(end.iter().map(|t| t.map(|i| i + n)));
            triangles.extend(end.iter().map(|t| [t[0], t[2], t[1]]));
            for i in 0..n {
                let j = (i + 1) % n;
                triangles.extend([[i, j, j + n], [i, j + n, i + n]]);
            }
            let flat = |triangles: &[[u32; 3]]| triangles.iter().filter(|t| height(&points, **t) <= LEAST).count();
            assert_eq!(flat(&triangles), 2 * count as usize);
            let found = turned(&points, triangles.clone());
            assert_eq!((flat(&found), found.len()), (0, triangles.len()));
            let pairs = facet_pairs(&found);
            assert!(pairs.is_closed() && pairs.is_manifold() && pairs.misoriented == 0, "{pairs:?}");
            assert!((enclosed_volume(corners(&points, &found)) - 1.0).abs() < 1e-15);
        }
    }
}
