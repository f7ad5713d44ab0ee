//! Which slices a voxel looks into, and where along each.
//!
//! Slices are spread evenly over all directions across the line of sight: angles of a half circle in 3D, a Fibonacci
//! lattice over half a sphere in 4D. Neighbouring voxels take other ones: each block of 64 voxels shares out 64 patterns
//! among its voxels, so what a block sees is as good as 64 times as many slices, and the same wherever slabs begin.

use std::f64::consts::PI;

use crate::geometry::{Dimension, Vector};

/// How many patterns there are: 4^3 in a volume, 8^2 in a picture.
const PATTERNS: usize = 64;
/// 1/r and 1/r^2, r the real root of r^3 = r + 1: multiples of both together fill a square evenly (Roberts 2018).
const EVEN: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];
/// The fractional part of the golden ratio.
const GOLDEN: f64 = 0.618_033_988_749_894_8;

/// One slice of a pattern.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cut<const D: usize> {
    /// Its direction w in a frame whose last axis is the line of sight.
    pub across: Vector<D>,
    /// Where in its step each look is, 0 up to 1, on either side.
    pub jitter: [f32; 2],
    /// What decides whether a sector that is hidden in part counts.
    pub dither: f32,
}

/// All patterns.
#[derive(Clone, Debug)]
pub(super) struct Patterns<const D: usize> {
    cuts: Vec<Cut<D>>,
    slices: usize,
}

impl<const D: usize> Patterns<D> {
    /// Patterns of so many slices.
    pub fn new(slices: usize) -> Self {
        let cut = |n: usize| {
            let (pattern, slice) = (n / slices, n % slices);
            let [turn, shift] = EVEN.map(|step| (0.5 + step * pattern as f64).fract());
            let along = (slice as f64 + turn) / slices as f64;
            let across = match Dimension::of::<D>() {
                Dimension::Three => [libm::cos(PI * along), libm::sin(PI * along), 0.0, 0.0],
                Dimension::Four => {
                    let around = 2.0 * PI * (GOLDEN * slice as f64 + shift).fract();
                    let width = (1.0 - along * along).sqrt();
                    [width * libm::cos(around), width * libm::sin(around), along, 0.0]
                }
            };
            let number = |step: f64| ((step * n as f64).fract() as f32).min(1.0 - f32::EPSILON);
            Cut { across: Vector::from_fn(|r, _| across[r] as f32), jitter: EVEN.map(number), dither: number(GOLDEN) }
        };
        Self { cuts: (0..PATTERNS * slices).map(cut).collect(), slices }
    }

    /// The pattern of a voxel.
    pub fn of(&self, [x, y, z]: [usize; 3]) -> &[Cut<D>] {
        let pattern = match Dimension::of::<D>() {
            Dimension::Three => x % 8 + 8 * (y % 8),
            Dimension::Four => x % 4 + 4 * (y % 4) + 16 * (z % 4),
        };
        &self.cuts[pattern * self.slices..(pattern + 1) * self.slices]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spread<const D: usize>() {
        let patterns = Patterns::<D>::new(24);
        for index in [[0, 0, 0], [3, 5, 0], [7, 2, 1]] {
            let cuts = patterns.of(index);
            assert_eq!(cuts.len(), 24);
            // Of w and -w together the mean of w w^T is a multiple of the identity.
            for a in 0..D {
                for b in 0..D {
                    let mean: f32 = cuts.iter().map(|cut| cut.across[a] * cut.across[b]).sum::<f32>() / 24.0;
                    let expected = if a == b && a < D - 1 { 1.0 / (D - 1) as f32 } else { 0.0 };
                    assert!((mean - expected).abs() < 0.06, "{index:?} {a} {b}: {mean}");
                }
            }
        }
        assert!(patterns.cuts.iter().all(|cut| (cut.across.norm() - 1.0).abs() < 1e-6 && cut.dither < 1.0));
    }

    #[test]
    fn slices_are_spread_over_all_directions() {
        spread::<3>();
        spread::<4>();
    }
}
