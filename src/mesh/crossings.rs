//! Where a surface passes through itself: an edge of one triangle through another, or a body partly inside another.
//!
//! What passes by less than rounding to single precision moves points counts as touching. Two bodies that overlap with all their
//! edges in each other's faces, as boxes side by side do, have no edge that passes through anything; but of one's triangles
//! some are inside the other and some not.

use std::f64::consts::PI;

use super::UnionFind;
use crate::geometry::Vector64;

/// How far an edge must pass through a triangle to both sides, in a surface of about size 1: some steps of single precision.
const THROUGH: f64 = 4e-6;

/// The most triangles looked at to see what is inside what.
const MOST_LOOKS: usize = 100_000_000;

/// [`told`] of a surface in any dimension; none also if that isn't 3, or there are more than so many triangles.
pub fn told_if_few<const D: usize>(points: &[Vector64<D>], simplices: &[[u32; D]], most: usize) -> Option<String> {
    if D != 3 || simplices.len() > most {
        return None;
    }
    let points: Vec<Vector64<3>> = points.iter().map(|p| Vector64::from([p[0], p[1], p[2]])).collect();
    let triangles: Vec<[u32; 3]> = simplices.iter().map(|s| [s[0], s[1], s[2]]).collect();
    told(&points, &triangles)
}

/// Where a closed surface of any size passes through itself, in words; none if it doesn't.
pub fn told(points: &[Vector64<3>], triangles: &[[u32; 3]]) -> Option<String> {
    let used = || triangles.as_flattened().iter().map(|&i| points[i as usize]);
    let first = used().next()?;
    let [low, high] = used().fold([first; 2], |[low, high], p| [low.inf(&p), high.sup(&p)]);
    let (center, size) = ((low + high) / 2.0, (high - low).amax() / 2.0);
    if !size.is_normal() {
        return None;
    }
    let near: Vec<Vector64<3>> = points.iter().map(|point| (point - center) / size).collect();
    let [one, other] = crossing(&near, triangles)?;
    let place = |i: usize| {
        let middle = triangles[i].iter().map(|&corner| points[corner as usize]).sum::<Vector64<3>>() / 3.0;
        middle.iter().map(|x| format!("{x:.6}")).collect::<Vec<_>>().join(", ")
    };
    let how = match one == other {
        true => format!("the triangle at ({}) is inside a body that the rest of its own is not inside", place(one)),
        false => format!("the triangles at ({}) and at ({})", place(one), place(other)),
    };
    Some(format!("passes through itself, or has bodies that overlap: {how}"))
}

/// Two triangles of a surface of about size 1 that pass through each other, or one inside a body that is not wholly inside, twice;
/// none if there are none.
fn crossing(points: &[Vector64<3>], triangles: &[[u32; 3]]) -> Option<[usize; 2]> {
    let corners: Vec<[Vector64<3>; 3]> = triangles.iter().map(|t| t.map(|i| points[i as usize])).collect();
    let boxes: Vec<[Vector64<3>; 2]> = corners.iter().map(|[a, b, c]| [a.inf(b).inf(c), a.sup(b).sup(c)]).collect();
    pierced(&corners, &boxes).or_else(|| astride(points.len(), triangles, &corners, &boxes))
}

/// Two triangles of which one has an edge through the other.
fn pierced(corners: &[[Vector64<3>; 3]], boxes: &[[Vector64<3>; 2]]) -> Option<[usize; 2]> {
    let mut order: Vec<usize> = (0..corners.len()).collect();
    order.sort_by(|&i, &j| boxes[i][0].x.total_cmp(&boxes[j][0].x).then(i.cmp(&j)));
    // Triangles that the sweep, along x, has not left yet.
    let mut open: Vec<usize> = Vec::new();
    for &i in &order {
        let [low, high] = boxes[i];
        open.retain(|&j| boxes[j][1].x >= low.x);
        for &j in &open {
            let apart = (1..3).any(|k| boxes[j][1][k] < low[k] || high[k] < boxes[j][0][k]);
            if !apart && (passes(&corners[i], &corners[j]) || passes(&corners[j], &corners[i])) {
                return Some([i.min(j), i.max(j)]);
            }
        }
        open.push(i);
    }
    None
}

/// Whether an edge of one triangle passes through the inside of another.
fn passes(one: &[Vector64<3>; 3], other: &[Vector64<3>; 3]) -> bool {
    let [a, b, c] = other;
    let Some(normal) = (b - a).cross(&(c - a)).try_normalize(f64::MIN_POSITIVE) else { return false };
    let heights = one.map(|p| normal.dot(&(p - a)));
    (0..3).any(|i| {
        let (j, from, to) = ((i + 1) % 3, heights[i], heights[(i + 1) % 3]);
        if from.abs() < THROUGH || to.abs() < THROUGH || (from < 0.0) == (to < 0.0) {
            return false;
        }
        let at = one[i] + (one[j] - one[i]) * (from / (from - to));
        [[a, b], [b, c], [c, a]].iter().all(|[p, q]| {
            let side = normal.cross(&(*q - *p));
            side.dot(&(at - *p)) > THROUGH * side.norm()
        })
    })
}

/// A triangle inside one of several bodies, of a body that is not wholly inside.
fn astride(
    points: usize,
    triangles: &[[u32; 3]],
    corners: &[[Vector64<3>; 3]],
    boxes: &[[Vector64<3>; 2]],
) -> Option<[usize; 2]> {
    let mut sets = UnionFind::new(points);
    triangles.iter().for_each(|&[a, b, c]| [b, c].iter().for_each(|&other| sets.join(a, other)));
    let mut bodies: Vec<(u32, Vec<usize>)> = Vec::new();
    let mut numbers = std::collections::BTreeMap::new();
    for (i, triangle) in triangles.iter().enumerate() {
        let root = sets.root(triangle[0]);
        let number = *numbers.entry(root).or_insert(bodies.len());
        if number == bodies.len() {
            bodies.push((root, Vec::new()));
        }
        bodies[number].1.push(i);
    }
    let around = |body: &[usize]| {
        body.iter().skip(1).fold(boxes[body[0]], |[low, high], &i| [low.inf(&boxes[i][0]), high.sup(&boxes[i][1])])
    };
    let bounds: Vec<[Vector64<3>; 2]> = bodies.iter().map(|(_, body)| around(body)).collect();
    let mut looks = 0;
    for (i, (_, body)) in bodies.iter().enumerate() {
        for (j, (_, other)) in bodies.iter().enumerate() {
            let [low, high] = bounds[i];
            if i == j || (0..3).any(|k| bounds[j][1][k] < low[k] || high[k] < bounds[j][0][k]) {
                continue;
            }
            let (mut inside, mut outside) = (None, false);
            for &triangle in other {
                let [a, b, c] = corners[triangle];
                let middle = (a + b + c) / 3.0;
                if (0..3).any(|k| middle[k] < low[k] || middle[k] > high[k]) {
                    outside = true;
                } else {
                    looks += body.len();
                    let angles = body.iter().map(|&i| solid_angle(&corners[i], &middle));
                    let (turns, most) = angles.fold((0.0, 0.0), |(sum, most), a| (sum + a, f64::max(most, a.abs())));
                    let turns = turns / (4.0 * PI);
                    // On the surface it is between whole numbers, or one triangle fills half of the view.
                    if (turns - turns.round()).abs() < 0.01 && most < 1.98 * PI {
                        if turns.round() == 0.0 { outside = true } else { inside = Some(triangle) }
                    }
                }
                if let (Some(inside), true) = (inside, outside) {
                    return Some([inside, inside]);
                }
                if looks > MOST_LOOKS {
                    return None;
                }
            }
        }
    }
    None
}

/// How large a triangle is seen from a point, positive if from behind: by the formula of Van Oosterom and Strackee (1983).
pub fn solid_angle(corners: &[Vector64<3>; 3], from: &Vector64<3>) -> f64 {
    let [a, b, c] = corners.map(|corner| corner - from);
    let [x, y, z] = [a.norm(), b.norm(), c.norm()];
    let cosine = x * y * z + a.dot(&b) * z + b.dot(&c) * x + c.dot(&a) * y;
    2.0 * libm::atan2(a.cross(&b).dot(&c), cosine)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Boxes between opposite corners.
    fn found(boxes: &[[[f64; 3]; 2]]) -> bool {
        const SIDES: [[u32; 4]; 6] =
            [[0, 2, 6, 4], [1, 5, 7, 3], [0, 4, 5, 1], [2, 3, 7, 6], [0, 1, 3, 2], [4, 6, 7, 5]];
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        for ends in boxes {
            let first = points.len() as u32;
            points.extend((0..8usize).map(|i| Vector64::<3>::from_fn(|k, _| ends[i >> k & 1][k])));
            let quads = SIDES.iter().map(|side| side.map(|i| first + i));
            triangles.extend(quads.flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]));
        }
        crossing(&points, &triangles).is_some()
    }

    #[test]
    fn bodies_that_overlap_are_found_and_those_that_touch_are_not() {
        let cube = [[0.0; 3], [0.5; 3]];
        for (other, overlap) in [
            ([[0.2, 0.3, 0.4], [0.8, 0.7, 0.9]], true),
            ([[0.25, 0.0, 0.0], [0.75, 0.5, 0.5]], true),
            ([[0.25, 0.1, 0.1], [0.75, 0.3, 0.3]], true),
            ([[-0.5, 0.2, 0.2], [0.9, 0.3, 0.3]], true),
            ([[0.5, 0.0, 0.0], [0.9, 0.5, 0.5]], false),
            ([[0.5, 0.2, -0.1], [0.9, 0.7, 0.3]], false),
            ([[0.5 - 1e-7, 0.0, 0.0], [0.9, 0.5, 0.5]], false),
            ([[0.5, 0.5, 0.5], [0.9, 0.9, 0.9]], false),
            ([[0.1; 3], [0.4; 3]], false),
            ([[0.6; 3], [0.9; 3]], false),
        ] {
            assert_eq!(found(&[cube, other]), overlap, "{other:?}");
            assert_eq!(found(&[other, cube]), overlap, "{other:?}");
        }
        assert!(!found(&[cube]));
    }
}
