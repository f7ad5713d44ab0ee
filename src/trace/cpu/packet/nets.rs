//! The Sobol' points of several blocks, shared out so that each block gets neighbours.
//!
//! Rays that go about the same way meet the same nodes and leaves, so they stay together as a set for longer. The first 2^n Sobol'
//! points, and those of any aligned run of 2^n indices, lie one by one in the cells of grids of 2^n cells. Here they are in the order of a Z curve
//! through such cells, cut into blocks of 64. Owen's scrambling moves cells as wholes, and those that share a larger cell
//! stay together, so the same order serves every point and every run.
//!
//! What is counted must not depend on it: an estimate needs the counts of aligned runs of indices ([`crate::trace::Estimate`]), an eighth of the points each.
//! For each block there are masks of the rays that belong to each run.

use std::sync::LazyLock;

use crate::geometry::Dimension;
use crate::trace::groups::LEAST;
use crate::trace::sampling::{along_curve, sobol};

/// Rays of a block; the bits of a `u64` name them.
pub(super) const BLOCK: usize = 64;
/// How many blocks the nets have, most first.
const BLOCKS: [usize; 3] = [16, 4, 1];

/// Points of some blocks.
#[derive(Debug)]
pub(super) struct Net {
    /// The coordinates of the points of each block, their bits reversed.
    points: Vec<[[u32; BLOCK]; 3]>,
    /// Which points of each block have indices in which eighth.
    runs: Vec<[u64; LEAST]>,
}

static NETS: LazyLock<[[Net; 3]; 2]> =
    LazyLock::new(|| [Dimension::Three, Dimension::Four].map(|dimension| BLOCKS.map(|n| Net::new(n, dimension))));

impl Net {
    fn new(blocks: usize, dimension: Dimension) -> Self {
        let count = blocks * BLOCK;
        let (mut points, mut runs) = (vec![[[0; BLOCK]; 3]; blocks], vec![[0; LEAST]; blocks]);
        for (n, index) in along_curve(count as u32, dimension).into_iter().enumerate() {
            let (block, i) = (n / BLOCK, n % BLOCK);
            (0..3).for_each(|d| points[block][d][i] = sobol(index, d).reverse_bits());
            runs[block][index as usize / (count / LEAST)] |= 1 << i;
        }
        Self { points, runs }
    }

    /// The largest that goes on after `first` rays, with no more than `most`; none if there is none.
    pub fn after(first: usize, most: usize, dimension: Dimension) -> Option<&'static Self> {
        let nets = &NETS[dimension.pick(0, 1)];
        nets.iter().find(|net| net.rays() <= most && first.is_multiple_of(net.rays()))
    }

    /// How many blocks it has.
    pub fn blocks(&self) -> usize {
        self.points.len()
    }

    /// How many rays it has.
    pub fn rays(&self) -> usize {
        self.blocks() * BLOCK
    }

    /// The points of a block: each coordinate with its bits reversed, less what the run of indices adds.
    pub fn points(&self, block: usize) -> &[[u32; BLOCK]; 3] {
        &self.points[block]
    }

    /// Adds the rays of a block to the counts of their runs.
    #[inline(always)]
    pub fn count(&self, block: usize, rays: u64, counts: &mut [u32; LEAST]) {
        for (count, run) in counts.iter_mut().zip(&self.runs[block]) {
            *count += (rays & run).count_ones();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::sampling::scramble_reversed;

    #[test]
    fn each_index_is_in_one_block_and_in_its_run() {
        for (net, dimension) in NETS.iter().flatten().zip([2, 2, 2, 3, 3, 3]) {
            let mut found = vec![];
            for block in 0..net.blocks() {
                assert_eq!(net.runs[block].iter().fold(0, |all, run| all ^ run), u64::MAX);
                for i in 0..BLOCK {
                    // The first coordinate is the index, reversed.
                    let index = net.points(block)[0][i];
                    (0..dimension).for_each(|d| assert_eq!(net.points(block)[d][i], sobol(index, d).reverse_bits()));
                    let run = index as usize * LEAST / net.rays();
                    assert!(net.runs[block][run] >> i & 1 == 1);
                    found.push(index as usize);
                }
            }
            found.sort_unstable();
            assert_eq!(found, (0..net.rays()).collect::<Vec<_>>());
        }
    }

    #[test]
    fn the_largest_net_that_fits_comes_next() {
        let blocks = |first, most| Net::after(first, most, Dimension::Four).map(Net::blocks);
        assert_eq!([blocks(0, 5000), blocks(0, 1024), blocks(0, 1023)], [Some(16), Some(16), Some(4)]);
        assert_eq!([blocks(256, 5000), blocks(64, 5000), blocks(1024, 256)], [Some(4), Some(1), Some(4)]);
        assert_eq!([blocks(0, 63), blocks(64, 64)], [None, Some(1)]);
    }

    #[test]
    fn blocks_hold_neighbours_whatever_the_scrambling() {
        for (net, coordinates) in NETS.iter().flatten().zip([2, 2, 2, 3, 3, 3]) {
            for key in 0..50u32 {
                let key = key.wrapping_mul(0x9e37_79b9);
                let keys = [key, key ^ 0x5555_1234, key.rotate_left(9)];
                // In 3D the blocks of four are quarters of the square, those of sixteen sixteenths, and each eight points are
                // neighbours within an eighth of them; in 4D the cells are boxes of twice the volume.
                for block in 0..net.blocks() {
                    let points = net.points(block);
                    let at = |d: usize, i: usize| scramble_reversed(points[d][i], keys[d]).reverse_bits();
                    let volume = |range: std::ops::Range<usize>| {
                        let side = |d| {
                            let all = range.clone().map(|i| f64::from(at(d, i)) / 2f64.powi(32));
                            let (low, high) = all.fold((1f64, 0f64), |(l, h), x| (l.min(x), h.max(x)));
                            high - low
                        };
                        (0..coordinates).map(side).product::<f64>()
                    };
                    let slack = if coordinates == 2 { 1.0 } else { 2.0 };
                    assert!(volume(0..BLOCK) <= slack / net.blocks() as f64);
                    for group in 0..8 {
                        assert!(volume(8 * group..8 * group + 8) <= slack / (8 * net.blocks()) as f64);
                    }
                }
            }
        }
    }
}
