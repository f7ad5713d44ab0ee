//! Welding: points with identical coordinates become one, and points that nothing uses go.

use std::collections::HashMap;

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

/// Renumbers the vertices so that only those in use remain, in their order; returns their former indices.
pub fn compact<const D: usize>(mut simplices: Vec<[u32; D]>) -> (Vec<u32>, Vec<[u32; D]>) {
    let mut used: Vec<u32> = simplices.as_flattened().to_vec();
    used.sort_unstable();
    used.dedup();
    let renumbered: HashMap<u32, u32> = used.iter().zip(0..).map(|(&old, new)| (old, new)).collect();
    simplices.as_flattened_mut().iter_mut().for_each(|vertex| *vertex = renumbered[vertex]);
    (used, simplices)
}
