//! Which rays of a point go side by side: neighbours, as they meet the same nodes and take about as long.

use crate::geometry::Dimension;
use crate::trace::sampling::along_curve;

/// The most rays that are put in order together.
pub(super) const MOST: u32 = 1024;

/// How many rays are put in order together, of points that have so many and begin with these of their sequences: the most, up to
/// [`MOST`], whose indices always are an aligned run.
pub(super) fn run(rays: u32, first: impl Iterator<Item = u32>) -> u32 {
    let bits = first.fold(rays | MOST, |bits, first| bits | first);
    1 << bits.trailing_zeros()
}

/// Of each run of 1, 2, 4 and up to [`MOST`] rays, one after the other, the place of each index.
pub(super) fn places(dimension: Dimension) -> Vec<u16> {
    let mut all = Vec::with_capacity(2 * MOST as usize);
    let mut count = 1u32;
    while count <= MOST {
        let run = all.len();
        all.resize(run + count as usize, 0);
        for (index, place) in along_curve(count, dimension).into_iter().zip(0..) {
            all[run + index as usize] = place;
        }
        count *= 2;
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_ray_has_a_place() {
        for dimension in [Dimension::Three, Dimension::Four] {
            let all = places(dimension);
            assert_eq!(all.len(), 2047);
            for count in [1usize, 2, 64, 1024] {
                let mut run = all[count - 1..2 * count - 1].to_vec();
                run.sort_unstable();
                assert!(run.into_iter().eq(0..count as u16));
            }
        }
    }

    #[test]
    fn runs_are_aligned() {
        let of = |rays, first: &[u32]| run(rays, first.iter().copied());
        assert_eq!([of(256, &[0]), of(4096, &[0, 0]), of(100, &[0]), of(7, &[0])], [256, 1024, 4, 1]);
        assert_eq!([of(64, &[64]), of(128, &[64]), of(64, &[0, 3])], [64, 64, 1]);
    }
}
