//! Convex polygons in triangles that are as high as can be.

use crate::geometry::Vector64;

/// A convex polygon's triangles, in the order of its corners, such that the lowest height of all is as large as can be:
/// corners in line along a side make no flat triangle unless there is no other way. By dynamic programming over the
/// pieces between two corners (Klincsek 1980).
pub fn triangles(corners: &[u32], points: &[Vector64<3>], normal: &Vector64<3>) -> Vec<[u32; 3]> {
    let count = corners.len();
    if count == 3 {
        return vec![[corners[0], corners[1], corners[2]]];
    }
    let height = |i: usize, j: usize, k: usize| {
        let [a, b, c] = [i, j, k].map(|i| points[corners[i] as usize]);
        let longest = (b - a).norm().max((c - b).norm()).max((a - c).norm());
        (b - a).cross(&(c - a)).dot(normal) / longest
    };
    let mut best = vec![(f64::INFINITY, 0usize); count * count];
    for length in 2..count {
        for i in 0..count - length {
            let k = i + length;
            let of = |j: usize| height(i, j, k).min(best[i * count + j].0).min(best[j * count + k].0);
            let found =
                (i + 1..k).map(|j| (of(j), j)).fold((f64::NEG_INFINITY, i + 1), |a, b| if b.0 > a.0 { b } else { a });
            best[i * count + k] = found;
        }
    }
    let mut found = Vec::with_capacity(count - 2);
    let mut open = vec![(0, count - 1)];
    while let Some((i, k)) = open.pop() {
        if k - i > 1 {
            let j = best[i * count + k].1;
            found.push([corners[i], corners[j], corners[k]]);
            open.extend([(i, j), (j, k)]);
        }
    }
    found
}
