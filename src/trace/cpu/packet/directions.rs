//! The rays of one shading point, 64 at a time.
//!
//! These are the directions of [`Sequence::next_direction`], bit for bit: the same operations in the same order, without
//! branches, so that the compiler works on several directions at once. A nested scrambling keeps an aligned run of 2^n indices together, and their
//! Sobol' points are the first 2^n, from a table, with one constant added. So those of one or several blocks can be taken in
//! another order ([`super::nets`]).

use super::lanes::Lanes;
use super::nets::{BLOCK, Net};
use crate::accel::WIDTH;
use crate::geometry::{Dimension, Frame, Vector};
use crate::trace::sampling::{LOWEST_SQUARED_COSINE, Sequence, Source, scramble, scramble_reversed, sobol};

/// The first Sobol' points, each coordinate with its bits reversed.
static SOBOL_BLOCK: [[u32; BLOCK]; 3] = sobol_block();

const fn sobol_block() -> [[u32; BLOCK]; 3] {
    let mut table = [[0; BLOCK]; 3];
    let mut dimension = 0;
    while dimension < 3 {
        let mut index = 0;
        while index < BLOCK {
            table[dimension][index] = sobol(index as u32, dimension).reverse_bits();
            index += 1;
        }
        dimension += 1;
    }
    table
}

/// A block of rays from one point, each number of a ray in an array of its own.
#[derive(Debug)]
#[repr(C, align(64))]
pub(super) struct Rays<const D: usize> {
    /// Directions in the coordinates of the scene, as [`crate::geometry::Ray`] keeps them.
    pub direction: [[f32; BLOCK]; D],
    /// One over each component; 0 is taken for 1e-30: over the extent of a scene that moves a ray by less than boxes are grown
    /// by.
    pub inverse: [[f32; BLOCK]; D],
    /// The size of `inverse`.
    pub absolute: [[f32; BLOCK]; D],
    /// The cosine to the normal.
    pub height: [f32; BLOCK],
}

impl<const D: usize> Rays<D> {
    pub fn new() -> Self {
        Self {
            direction: [[0.0; BLOCK]; D],
            inverse: [[0.0; BLOCK]; D],
            absolute: [[0.0; BLOCK]; D],
            height: [0.0; BLOCK],
        }
    }

    /// Takes the next `count` directions of the sequence, which must have given whole blocks so far.
    #[inline(always)]
    pub fn take(&mut self, sequence: &mut Sequence, frame: &Frame<D>, count: usize) {
        let mut points = [[0.0f32; BLOCK]; 3];
        match &mut sequence.source {
            Source::Random(_) => {
                for i in 0..count {
                    let point: [f32; 3] = match Dimension::of::<D>() {
                        Dimension::Three => {
                            let [a, b] = sequence.next_point();
                            [a, b, 0.0]
                        }
                        Dimension::Four => sequence.next_point(),
                    };
                    (0..3).for_each(|d| points[d][i] = point[d]);
                }
            }
            Source::Sobol(keys) => {
                let base = scramble(sequence.next, keys[3]) & !(BLOCK as u32 - 1);
                for d in 0..D - 1 {
                    let constant = sobol(base, d).reverse_bits();
                    for i in 0..count {
                        let place = scramble(sequence.next.wrapping_add(i as u32), keys[3]) as usize % BLOCK;
                        let bits = scramble_reversed(SOBOL_BLOCK[d][place] ^ constant, keys[d]).reverse_bits();
                        points[d][i] = unit(bits);
                    }
                }
                sequence.next = sequence.next.wrapping_add(count as u32);
            }
        }
        self.lift(&points, frame);
    }

    /// Takes those of the next directions of Sobol' points that a block of the net has. The sequence stays where it is.
    #[inline(always)]
    pub fn take_of(&mut self, net: &Net, block: usize, sequence: &Sequence, frame: &Frame<D>) {
        let Source::Sobol(keys) = &sequence.source else { unreachable!("random points are no nets") };
        let mut points = [[0.0f32; BLOCK]; 3];
        let base = scramble(sequence.next, keys[3]) & !(net.rays() as u32 - 1);
        for d in 0..D - 1 {
            let constant = sobol(base, d).reverse_bits();
            for i in 0..BLOCK {
                points[d][i] = unit(scramble_reversed(net.points(block)[d][i] ^ constant, keys[d]).reverse_bits());
            }
        }
        self.lift(&points, frame);
    }

    /// Points of the cube onto the ball, onto the hemisphere, into the frame.
    #[inline(always)]
    fn lift(&mut self, points: &[[f32; BLOCK]; 3], frame: &Frame<D>) {
        let (axis, factor, turned) = frame.parts();
        let sign = if turned { -1.0f32 } else { 1.0 };
        for i in 0..BLOCK {
            let mut local = [0.0f32; D];
            let (a, b, c) = (points[0][i], points[1][i], points[2][i]);
            let [x, y] = square_to_disk(a, b);
            match Dimension::of::<D>() {
                Dimension::Three => (local[0], local[1]) = (x, y),
                Dimension::Four => local[..3].copy_from_slice(&disk_to_ball(a, b, c, x, y)),
            }
            let mut square = 0.0f32;
            for l in &local[..D - 1] {
                square += l * l;
            }
            let rest = 1.0 - square;
            local[D - 1] = (if rest > LOWEST_SQUARED_COSINE { rest } else { LOWEST_SQUARED_COSINE }).sqrt();
            self.height[i] = local[D - 1];
            let mut product = 0.0f32;
            for k in 0..D {
                product += axis[k] * local[k];
            }
            let scale = factor * product;
            for k in 0..D {
                self.direction[k][i] = (local[k] - scale * axis[k]) * sign;
            }
        }
    }

    /// Uses these directions, none longer than 1: bounds on rounding rely on that. Heights are over the hyperplane of this
    /// normal.
    pub fn set(&mut self, directions: &[Vector<D>], normal: &Vector<D>) {
        debug_assert!(directions.iter().all(|d| d.norm_squared() < 1.0 + 1e-5));
        for (i, direction) in directions.iter().enumerate().take(BLOCK) {
            let mut height = 0.0;
            for k in 0..D {
                self.direction[k][i] = direction[k];
                height += direction[k] * normal[k];
            }
            self.height[i] = height;
        }
    }

    /// Tells the first `count` rays, in the sequence's order, to `watch`: where each goes, and whether it is in the set.
    pub fn tell(&self, set: u64, count: usize, watch: &mut dyn FnMut(Vector<D>, bool)) {
        for i in 0..count {
            watch(Vector::from_fn(|k, _| self.direction[k][i]), set >> i & 1 == 1);
        }
    }

    /// Completes the directions by what box tests need.
    #[inline(always)]
    pub fn complete(&mut self) {
        for k in 0..D {
            for i in 0..BLOCK {
                let x = self.direction[k][i];
                let x = if x.abs() < 1e-30 { 0.0 } else { x };
                let size = if x.abs() > 1e-30 { x.abs() } else { 1e-30 };
                let inverse = 1.0 / size.copysign(x);
                self.direction[k][i] = x;
                self.inverse[k][i] = inverse;
                self.absolute[k][i] = inverse.abs();
            }
        }
    }

    /// The lowest cosine of the first `count` rays to the normal.
    #[inline(always)]
    pub fn lowest<L: Lanes>(&self, count: usize) -> f32 {
        let (rows, rest) = self.height[..count].as_chunks::<WIDTH>();
        let mut lowest = L::splat(f32::INFINITY);
        for row in rows {
            lowest = lowest.min(L::load(row));
        }
        let mut last = [f32::INFINITY; WIDTH];
        lowest.store(&mut last);
        last.into_iter().chain(rest.iter().copied()).fold(f32::INFINITY, |a, b| if b < a { b } else { a })
    }

    /// The rays whose cosine to the normal is at most this.
    #[inline(always)]
    pub fn up_to_height<L: Lanes>(&self, height: f32) -> u64 {
        let mut mask = 0;
        for (n, row) in self.height.as_chunks::<WIDTH>().0.iter().enumerate() {
            mask |= u64::from(L::load(row).less_or_equal(L::splat(height))) << (n * WIDTH);
        }
        mask
    }

    /// The axis that a ray mostly follows.
    #[inline(always)]
    pub fn main_axis(&self, i: usize) -> usize {
        let (mut axis, mut size) = (0, self.absolute[0][i]);
        for k in 1..D {
            let x = self.absolute[k][i];
            (axis, size) = if x < size { (k, x) } else { (axis, size) };
        }
        axis
    }

    /// The direction of a ray, in all lanes.
    #[inline(always)]
    pub fn splat<L: Lanes>(&self, i: usize) -> [L; D] {
        let mut direction = [L::splat(0.0); D];
        for k in 0..D {
            direction[k] = L::splat(self.direction[k][i]);
        }
        direction
    }
}

/// As [`Sequence::next_point`] makes a coordinate of bits; 24 of them fit a signed number.
#[inline(always)]
fn unit(bits: u32) -> f32 {
    ((bits >> 8) as i32 as f32 + 0.5) * (1.0 / (1 << 23) as f32) - 1.0
}

/// [`crate::trace::square_to_disk`] without branches.
#[inline(always)]
fn square_to_disk(a: f32, b: f32) -> [f32; 2] {
    let first = a.abs() > b.abs();
    let (large, small) = if first { (a, b) } else { (b, a) };
    // 0 / 0 at the centre.
    let ratio = if large == 0.0 { 0.0 } else { small / large };
    let y = ratio * std::f32::consts::FRAC_PI_4;
    let z = y * y;
    let sin = y * (1.0 + z * (-1.0 / 6.0 + z * (1.0 / 120.0 + z * (-1.0 / 5040.0 + z * (1.0 / 362_880.0)))));
    let cos = 1.0 + z * (-0.5 + z * (1.0 / 24.0 + z * (-1.0 / 720.0 + z * (1.0 / 40_320.0))));
    let (u, v) = (large * cos, large * sin);
    if first { [u, v] } else { [v, u] }
}

/// The rest of [`crate::trace::cube_to_ball`], without branches: (x, y) is where the disk's map takes (a, b).
#[inline(always)]
fn disk_to_ball(a: f32, b: f32, c: f32, x: f32, y: f32) -> [f32; 3] {
    let larger = |p: f32, q: f32| if p > q { p } else { q };
    let radius = larger(a.abs(), b.abs());
    let shell = larger(radius, c.abs());
    let divisor = if shell == 0.0 { 1.0 } else { shell };
    let r = radius / divisor;
    let cap = (1.0 - r * r * (1.0 / 3.0)).copysign(c);
    let wall = c / divisor * (2.0 / 3.0);
    let cos = if c.abs() >= radius { cap } else { wall };
    let square = larger(1.0 - cos * cos, 0.0);
    let across = shell * square.sqrt() / if radius == 0.0 { 1.0 } else { radius };
    let across = if radius == 0.0 { 0.0 } else { across };
    [x * across, y * across, shell * cos]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Ray;
    use crate::trace::Sampler;

    fn same_bits<const D: usize>() {
        for (point, sampler) in (0..300).flat_map(|point| [(point, Sampler::Sobol), (point, Sampler::Random)]) {
            let normal = Vector::<D>::from_fn(|r, _| ((point * 7 + r as u64 * 13) % 11) as f32 - 4.9).normalize();
            let frame = Frame::new(&normal);
            let (mut slow, mut fast) = (Sequence::new(sampler, 9, point), Sequence::new(sampler, 9, point));
            let mut rays = Rays::<D>::new();
            for count in [64, 64, 64, (point % 64) as usize + 1] {
                let key = |d: &Vector<D>| d.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
                let expected = (0..count).map(|_| Ray::new(Vector::zeros(), slow.next_direction(&frame)).direction);
                let mut expected: Vec<_> = expected.map(|d| key(&d)).collect();
                rays.take(&mut fast, &frame, count);
                rays.complete();
                let mut found: Vec<_> =
                    (0..count).map(|i| key(&Vector::from_fn(|k, _| rays.direction[k][i]))).collect();
                expected.sort();
                found.sort();
                assert_eq!(found, expected, "{sampler:?} {point}");
            }
        }
    }

    #[test]
    fn directions_are_those_of_the_sequence() {
        same_bits::<3>();
        same_bits::<4>();
    }

    #[test]
    fn maps_without_branches_are_the_maps() {
        let values = [-1.0 + 1e-7, -0.7, -0.5, -1e-7, 0.0, 6e-8, 0.3, 0.5, 0.7, 0.999];
        for (a, b, c) in values.iter().flat_map(|&a| values.iter().flat_map(move |&b| values.map(|c| (a, b, c)))) {
            let [x, y] = square_to_disk(a, b);
            assert_eq!([x, y], crate::trace::square_to_disk(a, b));
            assert_eq!(disk_to_ball(a, b, c, x, y), crate::trace::cube_to_ball(a, b, c));
        }
    }
}
