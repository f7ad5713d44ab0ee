//! Points with identical coordinates are one point.
//!
//! Rounding to `f32` turned `-0` into `+0`, so identical coordinates have identical bits, and an order on the bits
//! finds them. No tolerance: two points one ulp apart are two points.

use rayon::prelude::*;

use crate::geometry::Vector;

/// For each point the lowest index of a point with the same coordinates.
pub fn identities<const D: usize>(points: &[Vector<D>]) -> Vec<u32> {
    let bits = |i: u32| points[i as usize].map(f32::to_bits).into();
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    order.par_sort_unstable_by_key(|&i| -> ([u32; D], u32) { (bits(i), i) });
    let mut identity = vec![0; points.len()];
    let mut representative = 0;
    let mut previous: Option<[u32; D]> = None;
    for &i in &order {
        let here: [u32; D] = bits(i);
        if previous != Some(here) {
            representative = i;
            previous = Some(here);
        }
        identity[i as usize] = representative;
    }
    identity
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_points_share_the_lowest_index() {
        let p = |x: f32| Vector::<4>::from([x, 0.0, 1.0, 2.0]);
        let up = 1.0f32.next_up();
        assert_eq!(identities(&[p(1.0), p(0.0), p(1.0), p(up), p(0.0), p(1.0)]), [0, 1, 0, 3, 1, 0]);
    }
}
