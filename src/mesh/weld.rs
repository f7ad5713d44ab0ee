//! Welding: points with identical coordinates become one, and points that nothing uses go.

use std::collections::HashMap;

use super::UnionFind;
use crate::geometry::Vector64;

/// Gives points with identical coordinates one index, the first, and leaves out points that no simplex uses and
/// simplices that name a point twice afterwards (they have no measure). The order of both is kept.
pub fn weld<const D: usize, const N: usize>(
    points: &[Vector64<D>],
    simplices: Vec<[u32; N]>,
) -> (Vec<Vector64<D>>, Vec<[u32; N]>) {
    // Adding 0 turns -0 into 0.
    let bits = |point: &Vector64<D>| -> [u64; D] { std::array::from_fn(|i| (point[i] + 0.0).to_bits()) };
    let mut first: HashMap<[u64; D], u32> = HashMap::with_capacity(points.len());
    let representative: Vec<u32> =
        points.iter().zip(0u32..).map(|(point, i)| *first.entry(bits(point)).or_insert(i)).collect();

    let welded = simplices
        .into_iter()
        .map(|simplex| simplex.map(|i| representative[i as usize]))
        .filter(|simplex| (1..N).all(|i| !simplex[..i].contains(&simplex[i])))
        .collect();
    let (used, simplices) = compact(welded);
    (used.into_iter().map(|i| points[i as usize]).collect(), simplices)
}

/// The same, where points within `tolerance` of each other are one, and so are all in a chain of such. The first stands for them.
/// Returns which points remain, by their former indices.
pub fn weld_within<const D: usize, const N: usize>(
    points: &[Vector64<D>],
    simplices: Vec<[u32; N]>,
    tolerance: f64,
) -> (Vec<u32>, Vec<[u32; N]>) {
    let representative = together(points, tolerance);
    let welded = simplices
        .into_iter()
        .map(|simplex| simplex.map(|i| representative[i as usize]))
        .filter(|simplex| (1..N).all(|i| !simplex[..i].contains(&simplex[i])))
        .collect();
    compact(welded)
}

/// For each point the first of those that it is one with.
fn together<const D: usize>(points: &[Vector64<D>], tolerance: f64) -> Vec<u32> {
    // By cells as wide as the tolerance, so that who is near is in a cell next to one's own.
    let cell = |point: &Vector64<D>| -> [i64; D] { std::array::from_fn(|i| (point[i] / tolerance).floor() as i64) };
    let mut cells: HashMap<[i64; D], Vec<u32>> = HashMap::with_capacity(points.len());
    let mut sets = UnionFind::new(points.len());
    for (i, point) in (0..).zip(points) {
        let at = cell(point);
        for neighbour in 0..3usize.pow(D as u32) {
            let offset = |axis: usize| (neighbour / 3usize.pow(axis as u32) % 3) as i64 - 1;
            let next: [i64; D] = std::array::from_fn(|axis| at[axis].saturating_add(offset(axis)));
            for &other in cells.get(&next).map_or(&[][..], |there| there) {
                if (points[other as usize] - point).norm() <= tolerance {
                    sets.join(other, i);
                }
            }
        }
        cells.entry(at).or_default().push(i);
    }
    (0..points.len() as u32).map(|i| sets.root(i)).collect()
}

/// Renumbers the vertices so that only those in use remain, in their order; returns their former indices.
pub fn compact<const D: usize>(mut simplices: Vec<[u32; D]>) -> (Vec<u32>, Vec<[u32; D]>) {
    let mut used: Vec<u32> = simplices.as_flattened().to_vec();
    used.sort_unstable();
    used.dedup();
    let renumbered: HashMap<u32, u32> = used.iter().zip(0..).map(|(&old, new)| (old, new)).collect();
    simplices.as_flattened_mut().iter_mut().for_each(|vertex| *vertex = renumbered[vertex]);
    (used, simplices)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_near_becomes_one_and_nothing_else() {
        // On both sides of a cell's boundary, in a chain, and just too far.
        let points = [0.0, 1.0 - 1e-9, 1.0 + 1e-9, 2.0, 2.0008, 2.0016, 2.0027].map(|x| Vector64::from([x, -x, 0.5]));
        let simplices = vec![[0, 1, 3], [1, 2, 3], [4, 0, 2], [3, 5, 0], [6, 0, 1]];
        let (kept, welded) = weld_within(&points, simplices, 1.5e-3);
        assert_eq!(kept, [0, 1, 3, 6]);
        assert_eq!(welded, [[0, 1, 2], [2, 0, 1], [3, 0, 1]]);
    }
}
