//! Directions over a hemisphere, with a density proportional to the cosine to its normal.
//!
//! In R^D the cosine-weighted hemisphere projects onto the unit (D-1)-ball with constant density (Nusselt's analogue).
//! So a direction is a uniform point of that ball, lifted: no rejection, and no angle drawn from a wrong density.
//!
//! - [`Sequence`]: points of the unit cube of dimension D - 1, `random` or Sobol' points with Owen's nested uniform
//!   scrambling (Burley, *Practical Hash-based Owen Scrambling*, 2020), keyed on the seed and the shading point;
//! - [`cube_to_ball`]: the cube onto the ball. For the disk Shirley and Chiu's concentric map (1997); for the 3-ball
//!   first onto a cylinder, then shell by shell onto spheres (Rosca and Plonka, 2011). Both are continuous and keep
//!   measure, so even points stay even;
//! - [`direction`]: lifted, and turned into the frame of the normal.
//!
//! Only additions, multiplications, divisions and square roots in a fixed order are used, on `f32`; the same point
//! gives the same bits everywhere.

use rand::{Rng, SeedableRng, rngs::ChaCha8Rng};

use crate::geometry::{Dimension, Frame, Vector};

/// Lowest squared cosine that a direction gets. A direction closer to the horizon is raised to it, so that rounding
/// can't put it below; this touches 1.5 rays in a million, and moves each by less than 0.06 degrees.
pub(crate) const LOWEST_SQUARED_COSINE: f32 = 1e-6;

/// Which rays are asked at a shading point, and which hits count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Where the rays go.
    pub sampler: Sampler,
    /// Rays a point, the most if there is a target; at least 1.
    pub samples: u32,
    /// Chooses among equally good sets of rays.
    pub seed: u64,
    /// Hits beyond this distance don't count; infinite by default.
    pub max_distance: f32,
    /// The largest standard error that is good enough, if fewer rays may do: looked at after [`Target::FEWEST`] rays and
    /// whenever their number has doubled.
    pub target: Option<Target>,
}

impl Sampling {
    /// So many rays a point, Sobol' points, hits at any distance.
    pub fn new(samples: u32, seed: u64) -> Self {
        Self { sampler: Sampler::Sobol, samples, seed, max_distance: f32::INFINITY, target: None }
    }

    /// The same rays, by independent random points.
    pub fn random(samples: u32, seed: u64) -> Self {
        Self { sampler: Sampler::Random, ..Self::new(samples, seed) }
    }
}

/// When to stop asking rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Enough if the standard error is not above this.
    pub error: f32,
}

impl Target {
    /// The fewest rays after which an error is trusted. After them, whenever their number has doubled, the error is
    /// looked at: seldom, since whoever looks often enough will see a small one by chance.
    pub const FEWEST: u32 = 64;
}

/// How the points of the cube are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sampler {
    /// Sobol' points, scrambled.
    Sobol,
    /// Independent random points.
    Random,
}

/// The points of one shading point: `count` points of the unit (D-1)-cube.
#[derive(Debug)]
pub struct Sequence {
    pub(crate) source: Source,
    pub(crate) next: u32,
}

/// What makes the points.
#[derive(Debug)]
pub(crate) enum Source {
    /// Keys of the scramblings of the coordinates and of the index.
    Sobol([u32; 4]),
    Random(Box<ChaCha8Rng>),
}

impl Sequence {
    /// The points for shading point number `number` under `seed`. Different numbers and different seeds give independent
    /// points.
    pub fn new(sampler: Sampler, seed: u64, number: u64) -> Self {
        let mut state = mix(seed ^ mix(number.wrapping_add(0x9e37_79b9_7f4a_7c15)));
        let source = match sampler {
            Sampler::Random => Source::Random(Box::new(ChaCha8Rng::seed_from_u64(state))),
            Sampler::Sobol => Source::Sobol(std::array::from_fn(|_| {
                state = mix(state.wrapping_add(0x9e37_79b9_7f4a_7c15));
                (state >> 32) as u32
            })),
        };
        Self { source, next: 0 }
    }

    /// How its points are chosen.
    pub(crate) fn sampler(&self) -> Sampler {
        match self.source {
            Source::Sobol(_) => Sampler::Sobol,
            Source::Random(_) => Sampler::Random,
        }
    }

    /// Leaves out the next `count` Sobol' points.
    pub(crate) fn skip(&mut self, count: u32) {
        self.next = self.next.wrapping_add(count);
    }

    /// The next point, each coordinate in (-1, 1) on a grid of 2^24.
    #[inline]
    pub fn next_point<const N: usize>(&mut self) -> [f32; N] {
        let bits: [u32; N] = match &mut self.source {
            Source::Random(random) => std::array::from_fn(|_| random.next_u32()),
            Source::Sobol(keys) => {
                // Shuffled by scrambling the index too, so that any prefix of any size is a fair one.
                let index = scramble(self.next, keys[3]);
                std::array::from_fn(|d| scramble(sobol(index, d), keys[d]))
            }
        };
        self.next = self.next.wrapping_add(1);
        bits.map(|b| ((b >> 8) as f32 + 0.5) * (1.0 / (1 << 23) as f32) - 1.0)
    }

    /// The next direction around the frame's normal, of length about 1.
    #[inline]
    pub fn next_direction<const D: usize>(&mut self, frame: &Frame<D>) -> Vector<D> {
        let mut local = Vector::<D>::zeros();
        match Dimension::of::<D>() {
            Dimension::Three => {
                let [a, b] = self.next_point();
                local.as_mut_slice()[..2].copy_from_slice(&square_to_disk(a, b));
            }
            Dimension::Four => {
                let [a, b, c] = self.next_point();
                local.as_mut_slice()[..3].copy_from_slice(&cube_to_ball(a, b, c));
            }
        }
        direction(&mut local, frame)
    }
}

/// Lifts a point of the (D-1)-ball, the first D - 1 coordinates of `local`, onto the hemisphere, and turns it into the
/// frame.
#[inline]
pub fn direction<const D: usize>(local: &mut Vector<D>, frame: &Frame<D>) -> Vector<D> {
    let mut square = 0.0f32;
    for i in 0..D - 1 {
        square += local[i] * local[i];
    }
    local[D - 1] = (1.0 - square).max(LOWEST_SQUARED_COSINE).sqrt();
    frame.to_world(local)
}

/// SplitMix64's finaliser.
#[inline]
fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Nested uniform scrambling of the bits of `x`, highest first, by a hash: each bit is flipped by a function of the
/// key and the bits above it (Laine and Karras 2011, with Vegdahl's constants).
#[inline]
pub(crate) fn scramble(x: u32, key: u32) -> u32 {
    scramble_reversed(x.reverse_bits(), key).reverse_bits()
}

/// The same for a number, and with a result, whose lowest bit is the first.
#[inline(always)]
pub(crate) fn scramble_reversed(x: u32, key: u32) -> u32 {
    let mut x = x;
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(key);
    x = x.wrapping_mul((key >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x
}

/// Direction numbers of the second and third Sobol' dimension (Joe and Kuo 2008); the first is the reversed index.
const SOBOL: [[u32; 32]; 2] = [sobol_matrix(1, 0, &[1]), sobol_matrix(2, 1, &[1, 3])];

/// The first so many Sobol' points, in the order of a Z curve: by the highest bits of all their coordinates, then the next.
pub(crate) fn along_curve(count: u32, dimension: Dimension) -> Vec<u32> {
    let coordinates = dimension.pick(2, 3);
    let place = |&index: &u32| {
        let point: [u32; 3] = std::array::from_fn(|d| sobol(index, d));
        let bits = (0..10).flat_map(|level| (0..coordinates).map(move |d| point[d] >> (31 - level) & 1));
        bits.fold(0u32, |place, bit| place << 1 | bit)
    };
    let mut order: Vec<u32> = (0..count).collect();
    order.sort_by_cached_key(place);
    order
}

/// The sums of the columns of the second dimension's matrix, and then of the third's, over the bits of a byte of the index: 256 for
/// its lowest byte, then for the others.
pub(crate) fn sobol_sums() -> Vec<u32> {
    let sum = |columns: &[u32], byte: u32| {
        (0..8).filter(|bit| byte >> bit & 1 == 1).fold(0, |sum, bit| sum ^ columns[bit as usize])
    };
    SOBOL.iter().flat_map(|matrix| matrix.chunks(8)).flat_map(|c| (0..256).map(move |byte| sum(c, byte))).collect()
}

/// Direction numbers from a primitive polynomial of degree `s` with inner coefficients `a`, and initial values `m`.
const fn sobol_matrix(s: usize, a: u32, m: &[u32]) -> [u32; 32] {
    let mut v = [0u32; 32];
    let mut i = 0;
    while i < 32 {
        if i < s {
            v[i] = m[i] << (31 - i);
        } else {
            v[i] = v[i - s] ^ (v[i - s] >> s);
            let mut k = 1;
            while k < s {
                v[i] ^= ((a >> (s - 1 - k)) & 1) * v[i - k];
                k += 1;
            }
        }
        i += 1;
    }
    v
}

/// Coordinate `dimension` (0, 1 or 2) of Sobol' point `index`, as a binary fraction of 32 bits.
#[inline]
pub(crate) const fn sobol(mut index: u32, dimension: usize) -> u32 {
    if dimension == 0 {
        return index.reverse_bits();
    }
    let mut x = 0;
    while index != 0 {
        x ^= SOBOL[dimension - 1][index.trailing_zeros() as usize];
        index &= index - 1;
    }
    x
}

/// Sine and cosine of `x * pi / 4` for x in [-1, 1], by Taylor's polynomials; off by less than an ulp of 1.
#[inline]
fn sin_cos_quarter(x: f32) -> (f32, f32) {
    let y = x * std::f32::consts::FRAC_PI_4;
    let z = y * y;
    let sin = y * (1.0 + z * (-1.0 / 6.0 + z * (1.0 / 120.0 + z * (-1.0 / 5040.0 + z * (1.0 / 362_880.0)))));
    let cos = 1.0 + z * (-0.5 + z * (1.0 / 24.0 + z * (-1.0 / 720.0 + z * (1.0 / 40_320.0))));
    (sin, cos)
}

/// The square [-1, 1]^2 onto the unit disk, evenly.
#[inline]
pub fn square_to_disk(a: f32, b: f32) -> [f32; 2] {
    if a == 0.0 && b == 0.0 {
        [0.0, 0.0]
    } else if a.abs() > b.abs() {
        let (sin, cos) = sin_cos_quarter(b / a);
        [a * cos, a * sin]
    } else {
        let (sin, cos) = sin_cos_quarter(a / b);
        [b * sin, b * cos]
    }
}

/// The cube [-1, 1]^3 onto the unit ball, evenly.
///
/// The concentric map makes the cube a cylinder; its surface scaled by s becomes the sphere of radius s. A third of
/// the cylinder's volume lies over its two caps, so the caps go to |cos| >= 2/3, by r^2 = 3 s^2 (1 - |cos|), and the
/// wall to the rest, by height.
#[inline]
pub fn cube_to_ball(a: f32, b: f32, c: f32) -> [f32; 3] {
    let [x, y] = square_to_disk(a, b);
    let radius = a.abs().max(b.abs());
    let shell = radius.max(c.abs());
    if shell == 0.0 {
        return [0.0; 3];
    }
    let cos = if c.abs() >= radius {
        let r = radius / shell;
        (1.0 - r * r * (1.0 / 3.0)).copysign(c)
    } else {
        c / shell * (2.0 / 3.0)
    };
    let across = if radius == 0.0 { 0.0 } else { shell * (1.0 - cos * cos).max(0.0).sqrt() / radius };
    [x * across, y * across, shell * cos]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Moments of the uniform ball of dimension n: E[x_i^2] = 1 / (n + 2), E[r] = n / (n + 1), and equal shares of all
    /// orthants and of the two halves by volume.
    fn ball<const N: usize>(map: impl Fn([f32; N]) -> [f32; N]) {
        let mut sequence = Sequence::new(Sampler::Sobol, 5, 7);
        let count = 1 << 16;
        let (mut square, mut length, mut inner) = ([0.0f64; N], 0.0, 0);
        let mut orthants = vec![0u32; 1 << N];
        for _ in 0..count {
            let p = map(sequence.next_point::<N>());
            let r = p.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>().sqrt();
            assert!(r <= 1.0 + 1e-6);
            (0..N).for_each(|i| square[i] += f64::from(p[i]).powi(2));
            length += r;
            inner += u32::from(r.powi(N as i32) < 0.5);
            orthants[(0..N).map(|i| usize::from(p[i] > 0.0) << i).sum::<usize>()] += 1;
        }
        let n = N as f64;
        let total = f64::from(count);
        for s in square {
            assert!((s / total - 1.0 / (n + 2.0)).abs() < 2e-4, "{s}");
        }
        assert!((length / total - n / (n + 1.0)).abs() < 2e-4);
        assert!((f64::from(inner) / total - 0.5).abs() < 1e-3);
        assert!(orthants.iter().all(|&o| (f64::from(o) / total - 0.5f64.powi(N as i32)).abs() < 1e-3), "{orthants:?}");
    }

    #[test]
    fn maps_are_even() {
        ball::<2>(|[a, b]| square_to_disk(a, b));
        ball::<3>(|[a, b, c]| cube_to_ball(a, b, c));
    }

    fn cosines<const D: usize>(sampler: Sampler, mean: f64, tolerance: f64) {
        let normal = Vector::<D>::from_fn(|r, _| [0.3, -0.7, 0.2, 0.6][r]).normalize();
        let frame = Frame::new(&normal);
        let mut sequence = Sequence::new(sampler, 1, 2);
        let count = 1 << 16;
        let sum: f64 = (0..count)
            .map(|_| {
                let w = sequence.next_direction(&frame);
                assert!((w.norm() - 1.0).abs() < 1e-6);
                let cosine = w.dot(&normal);
                assert!(cosine > 0.0);
                f64::from(cosine)
            })
            .sum();
        assert!((sum / f64::from(count) - mean).abs() < tolerance, "{sampler:?} {D} {}", sum / f64::from(count));
    }

    #[test]
    fn mean_cosine_is_that_of_the_cosine_weighted_hemisphere() {
        let in_4d = 3.0 * std::f64::consts::PI / 16.0;
        cosines::<3>(Sampler::Sobol, 2.0 / 3.0, 1e-4);
        cosines::<4>(Sampler::Sobol, in_4d, 1e-4);
        cosines::<3>(Sampler::Random, 2.0 / 3.0, 4e-3);
        cosines::<4>(Sampler::Random, in_4d, 4e-3);
    }

    #[test]
    fn sobol_points_stratify() {
        // The first 2^k points have one in each elementary interval: here one in each of 16 slices on every axis, and
        // one in each cell of 4 x 4 on the first two.
        let mut sequence = Sequence::new(Sampler::Sobol, 3, 11);
        let points: Vec<[f32; 3]> = (0..16).map(|_| sequence.next_point()).collect();
        for axis in 0..3 {
            let mut slices: Vec<usize> = points.iter().map(|p| ((p[axis] + 1.0) * 8.0) as usize).collect();
            slices.sort_unstable();
            assert_eq!(slices, (0..16).collect::<Vec<_>>());
        }
        let mut cells: Vec<usize> =
            points.iter().map(|p| ((p[0] + 1.0) * 2.0) as usize * 4 + ((p[1] + 1.0) * 2.0) as usize).collect();
        cells.sort_unstable();
        assert_eq!(cells, (0..16).collect::<Vec<_>>());
    }

    #[test]
    fn sequences_depend_on_seed_and_number_only() {
        for sampler in [Sampler::Sobol, Sampler::Random] {
            let first = |seed, number| Sequence::new(sampler, seed, number).next_point::<3>();
            assert_eq!(first(1, 2), first(1, 2));
            assert_ne!(first(1, 2), first(1, 3));
            assert_ne!(first(1, 2), first(2, 2));
        }
    }
}
