//! Polygons cut into triangles that cover what the polygon covers, concave or not.
//!
//! A convex polygon becomes a fan around its first point; any other is laid flat along its normal and cut by ear
//! clipping (the crate `earcut`). That leaves out corners on straight edges, which neighbours may need: they are put back,
//! so that every edge of the polygon is an edge of its triangles and a closed surface stays closed.

use earcut::Earcut;

use crate::geometry::Vector64;

/// The triangles of a polygon whose corners are `corners` among `points`, in its orientation.
///
/// Corners that follow themselves count once; fewer than three are no polygon and make no triangle. Where a polygon
/// crosses itself there is no right answer, and it becomes a fan.
pub fn triangles(corners: &[u32], points: &[[f64; 3]]) -> Vec<[u32; 3]> {
    let mut corners = corners.to_vec();
    corners.dedup();
    while corners.len() > 1 && corners.first() == corners.last() {
        corners.pop();
    }
    if corners.len() <= 3 {
        return corners.try_into().map_or_else(|_| Vec::new(), |triangle| vec![triangle]);
    }
    let flat = flatten(&corners, points);
    if flat.as_deref().is_none_or(is_fan) {
        return fan(&corners);
    }
    let flat = flat.unwrap_or_default();
    let cut = clip(&flat).unwrap_or_else(|| fan(&(0..flat.len() as u32).collect::<Vec<_>>()));
    cut.into_iter().map(|triangle| triangle.map(|i| corners[i as usize])).collect()
}

/// Triangles around the first corner.
fn fan(corners: &[u32]) -> Vec<[u32; 3]> {
    corners.windows(2).skip(1).map(|edge| [corners[0], edge[0], edge[1]]).collect()
}

/// The corners in the plane that the polygon lies in, counter-clockwise; nothing if it has no area or no place.
fn flatten(corners: &[u32], points: &[[f64; 3]]) -> Option<Vec<[f64; 2]>> {
    let first = Vector64::from(*points.get(*corners.first()? as usize)?);
    let mut places = Vec::with_capacity(corners.len());
    for &corner in corners {
        places.push(Vector64::from(*points.get(corner as usize)?) - first);
    }
    // Newell's normal: the sum over the edges, whatever the shape.
    let next = places.iter().cycle().skip(1);
    let normal = places.iter().zip(next).fold(Vector64::<3>::zeros(), |sum, (a, b)| sum + a.cross(b));
    // Without its largest axis the polygon is sheared, but not folded.
    let drop = (0..3).max_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs()))?;
    if !(normal[drop].abs() > 0.0 && normal[drop].is_finite()) {
        return None;
    }
    let (u, v) = ((drop + 1) % 3, (drop + 2) % 3);
    let (u, v) = if normal[drop] > 0.0 { (u, v) } else { (v, u) };
    Some(places.iter().map(|p| [p[u], p[v]]).collect())
}

/// Twice the signed area of a triangle.
fn area(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Whether a fan covers the polygon without folds or slivers: it turns left at every corner, once round in all.
fn is_fan(flat: &[[f64; 2]]) -> bool {
    let n = flat.len();
    (0..n).all(|i| area(flat[i], flat[(i + 1) % n], flat[(i + 2) % n]) > 0.0)
        && (1..n - 1).all(|i| area(flat[0], flat[i], flat[i + 1]) > 0.0)
}

/// The polygon by ear clipping, with every one of its edges; nothing if it crosses itself.
fn clip(flat: &[[f64; 2]]) -> Option<Vec<[u32; 3]>> {
    let n = flat.len() as u32;
    let mut cut: Vec<u32> = Vec::new();
    Earcut::new().earcut_slice(flat, &[], &mut cut);
    let place = |i: u32| flat[i as usize];
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for t in cut.chunks_exact(3) {
        triangles.push(if area(place(t[0]), place(t[1]), place(t[2])) < 0.0 {
            [t[0], t[2], t[1]]
        } else {
            [t[0], t[1], t[2]]
        });
    }
    let mut kept = vec![false; flat.len()];
    triangles.iter().flatten().for_each(|&i| kept[i as usize] = true);
    let start = kept.iter().position(|&k| k)? as u32;
    let mut from = start;
    loop {
        let chain: Vec<u32> = (1..=n).map(|k| (from + k) % n).take_while(|&i| !kept[i as usize]).collect();
        let to = (from + chain.len() as u32 + 1) % n;
        // The triangle left of this edge, turned so that the edge comes first.
        let at = triangles.iter().position(|t| (0..3).any(|i| t[i] == from && t[(i + 1) % 3] == to))?;
        if !chain.is_empty() {
            let apex = triangles[at].into_iter().find(|&i| i != from && i != to)?;
            let path: Vec<u32> = [from].into_iter().chain(chain).chain([to]).collect();
            triangles[at] = [path[0], path[1], apex];
            triangles.extend(path.windows(2).skip(1).map(|edge| [edge[0], edge[1], apex]));
        }
        from = to;
        if from == start {
            break;
        }
    }
    let (whole, sum) =
        ((1..n - 1).map(|i| area(flat[0], place(i), place(i + 1))).sum::<f64>(), |all: &[[u32; 3]]| {
            all.iter().map(|t| area(place(t[0]), place(t[1]), place(t[2])).abs()).sum::<f64>()
        });
    (triangles.len() == flat.len() - 2 && (sum(&triangles) - whole).abs() <= 1e-9 * whole.abs()).then_some(triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn areas(polygon: &[[f64; 2]]) -> (Vec<[u32; 3]>, f64) {
        let points: Vec<[f64; 3]> = polygon.iter().map(|p| [p[0], p[1], p[0] - 2.0 * p[1]]).collect();
        let corners: Vec<u32> = (0..polygon.len() as u32).collect();
        let cut = triangles(&corners, &points);
        let place = |i: u32| polygon[i as usize];
        let sum = cut.iter().map(|t| area(place(t[0]), place(t[1]), place(t[2])).abs() / 2.0).sum();
        (cut, sum)
    }

    /// Each edge of the polygon once, in its direction.
    fn keeps_edges(cut: &[[u32; 3]], n: u32) -> bool {
        (0..n).all(|i| {
            let edge = |t: &&[u32; 3]| (0..3).any(|k| t[k] == i && t[(k + 1) % 3] == (i + 1) % n);
            cut.iter().filter(edge).count() == 1
        })
    }

    #[test]
    fn concave_polygons_cover_their_area() {
        let l = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
        for turn in 0..6 {
            let mut polygon = l;
            polygon.rotate_left(turn);
            let (cut, sum) = areas(&polygon);
            assert!((sum - 3.0).abs() < 1e-12 && cut.len() == 4 && keeps_edges(&cut, 6), "{turn}: {sum} {cut:?}");
            polygon.reverse();
            let (cut, sum) = areas(&polygon);
            assert!((sum - 3.0).abs() < 1e-12 && keeps_edges(&cut, 6), "{turn}, reversed: {sum} {cut:?}");
        }
    }

    #[test]
    fn corners_on_straight_edges_stay() {
        let square = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 1.0], [2.0, 2.0], [1.0, 2.0], [0.5, 2.0], [0.0, 2.0]];
        for turn in 0..8 {
            let mut polygon = square;
            polygon.rotate_left(turn);
            let (cut, sum) = areas(&polygon);
            assert!((sum - 4.0).abs() < 1e-12 && cut.len() == 6 && keeps_edges(&cut, 8), "{turn}: {sum} {cut:?}");
        }
    }

    #[test]
    fn combs_and_stars() {
        for teeth in 2..40u32 {
            let comb: Vec<[f64; 2]> = (0..=2 * teeth)
                .map(|i| [f64::from(i), if i % 2 == 0 { 3.0 } else { 0.5 }])
                .chain([[f64::from(2 * teeth), 0.0], [0.0, 0.0]])
                .rev()
                .collect();
            let (cut, sum) = areas(&comb);
            let right = f64::from(2 * teeth) * 1.75;
            assert!((sum - right).abs() < 1e-9 && keeps_edges(&cut, comb.len() as u32), "{teeth}: {sum}, not {right}");
        }
    }

    #[test]
    fn what_is_no_polygon_makes_no_fuss() {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [f64::NAN; 3], [0.0; 3]];
        assert!(triangles(&[], &points).is_empty());
        assert!(triangles(&[0, 1, 1, 0], &points).is_empty());
        assert_eq!(triangles(&[0, 0, 1, 2, 0], &points), [[0, 1, 2]]);
        assert_eq!(triangles(&[0, 1, 2, 4], &points).len(), 2);
        assert_eq!(triangles(&[0, 1, 2, 99], &points).len(), 2);
        assert_eq!(triangles(&[0, 2, 1, 3], &points).len(), 2);
        assert_eq!(triangles(&[0, 1, 0, 1], &points).len(), 2);
    }
}
