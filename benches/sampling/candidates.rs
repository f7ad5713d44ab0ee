//! Ways to choose the points of the (D-1)-ball.

use ao4d::trace::{Sampler, Sequence, cube_to_ball, square_to_disk};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

/// Tells whether a point of the ball is visible.
pub type See<'a> = &'a mut dyn FnMut([f32; 3]) -> bool;

/// Estimates the visible share of the ball of this dimension (2 or 3) from about so many points.
pub type Candidate = fn(u32, u64, usize, See) -> f64;

/// All of them, `random` first.
pub const CANDIDATES: &[(&str, Candidate)] = &[
    ("random", random),
    ("sobol", sobol),
    ("8 sets", eight_sets),
    ("net", net),
    ("mirrored", mirrored),
    ("jittered", jittered),
    ("lattice", lattice),
    ("folded", folded),
    ("turned", turned),
    ("refined", refined),
];

/// The unit cube onto the ball.
fn ball(dimension: usize, cube: [f64; 3]) -> [f32; 3] {
    let [a, b, c] = cube.map(|x| (2.0 * x - 1.0) as f32);
    if dimension == 3 { cube_to_ball(a, b, c) } else { flat(square_to_disk(a, b)) }
}

fn flat([x, y]: [f32; 2]) -> [f32; 3] {
    [x, y, 0.0]
}

fn next(dimension: usize, sequence: &mut Sequence) -> [f32; 3] {
    if dimension == 3 {
        let [a, b, c] = sequence.next_point();
        cube_to_ball(a, b, c)
    } else {
        let [a, b] = sequence.next_point();
        flat(square_to_disk(a, b))
    }
}

fn generator(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

fn share(count: u32, see: impl FnMut(u32) -> bool) -> f64 {
    (0..count).map(see).filter(|&visible| visible).count() as f64 / f64::from(count)
}

/// Independent points.
fn random(count: u32, seed: u64, dimension: usize, see: See) -> f64 {
    let mut random = generator(seed);
    share(count, |_| see(ball(dimension, random.random())))
}

/// Sobol' points under one nested scrambling: `method: sobol`.
fn sobol(count: u32, seed: u64, dimension: usize, see: See) -> f64 {
    let mut sequence = Sequence::new(Sampler::Sobol, seed, 1);
    share(count, |_| see(next(dimension, &mut sequence)))
}

/// Eight sets of an eighth of the points, each under a scrambling of its own.
fn eight_sets(count: u32, seed: u64, dimension: usize, see: See) -> f64 {
    let one = |set: u64| {
        let mut sequence = Sequence::new(Sampler::Sobol, seed, 1000 + set);
        share(count / 8, |_| see(next(dimension, &mut sequence)))
    };
    (0..8).map(one).sum::<f64>() / 8.0
}

/// Nested scrambling by a hash (Laine and Karras 2011).
fn scramble(bits: u32, key: u32) -> u32 {
    let mut x = bits.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(key);
    x = x.wrapping_mul((key >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

/// The second Sobol' dimension.
fn second(mut index: u32) -> u32 {
    let (mut bits, mut column) = (0, 1u32 << 31);
    while index > 0 {
        if index & 1 == 1 {
            bits ^= column;
        }
        column ^= column >> 1;
        index >>= 1;
    }
    bits
}

/// Hammersley's (0, m, 3)-net under nested scrambling: the evenest there is in base 2, of a number known before.
fn net(count: u32, seed: u64, dimension: usize, see: See) -> f64 {
    let mut random = generator(seed);
    let keys: [u32; 3] = random.random();
    let log = count.ilog2();
    share(count, |i| {
        let bits = [i.reverse_bits(), second(i), i << (32 - log)];
        see(ball(dimension, std::array::from_fn(|d| (f64::from(scramble(bits[d], keys[d])) + 0.5) / 2f64.powi(32))))
    })
}

/// Half as many Sobol' points, and for each the one opposite in the ball.
fn mirrored(count: u32, seed: u64, dimension: usize, see: See) -> f64 {
    let mut sequence = Sequence::new(Sampler::Sobol, seed, 1);
    let mut last = [0.0; 3];
    share(count, |i| {
        last = if i % 2 == 0 { next(dimension, &mut sequence) } else { last.map(|x| -x) };
        see(last)
    })
}

/// One point in each cell of a grid.
fn jittered(count: u32, seed: u64, dimension: usize, see: See) -> f64 {
    let side = f64::from(count).powf(1.0 / dimension as f64).round() as u32;
    let mut random = generator(seed);
    share(side.pow(dimension as u32), |i| {
        let cell = [i % side, i / side % side, i / side / side];
        see(ball(dimension, cell.map(|c| (f64::from(c) + random.random::<f64>()) / f64::from(side))))
    })
}

/// The generator of Korobov's lattice whose nearest points are farthest from each other.
fn korobov(count: u32, dimension: usize) -> [f64; 3] {
    let n = u64::from(count);
    let generator = |a: u64| [1, a, a * a % n];
    let shortest = |a: u64| {
        let square =
            |k: u64| -> u64 { generator(a)[..dimension].iter().map(|g| (k * g % n).min(n - k * g % n).pow(2)).sum() };
        (1..n).map(square).min().unwrap_or(0)
    };
    let best = (2..n / 2).max_by_key(|&a| shortest(a)).unwrap_or(1);
    generator(best).map(|g| g as f64 / n as f64)
}

fn shifted_lattice(count: u32, seed: u64, dimension: usize, see: See, fold: fn(f64) -> f64) -> f64 {
    use std::{cell::RefCell, collections::BTreeMap};
    thread_local!(static KNOWN: RefCell<BTreeMap<(u32, usize), [f64; 3]>> = const { RefCell::new(BTreeMap::new()) });
    let step =
        KNOWN.with_borrow_mut(|known| *known.entry((count, dimension)).or_insert_with(|| korobov(count, dimension)));
    let shift: [f64; 3] = generator(seed).random();
    share(count, |i| see(ball(dimension, std::array::from_fn(|d| fold((shift[d] + step[d] * f64::from(i)).fract())))))
}

/// A lattice of the periodic cube, moved at random.
fn lattice(count: u32, seed: u64, dimension: usize, see: See) -> f64 {
    shifted_lattice(count, seed, dimension, see, |x| x)
}

/// The same, each axis folded in two, since visibility is not periodic.
fn folded(count: u32, seed: u64, dimension: usize, see: See) -> f64 {
    shifted_lattice(count, seed, dimension, see, |x| 1.0 - (2.0 * x - 1.0).abs())
}

/// The points of a densest lattice (face-centred, or hexagonal) that lie in the ball, after it was turned and moved at
/// random. Their number is not fixed, so the share has a little bias.
fn turned(count: u32, seed: u64, dimension: usize, see: See) -> f64 {
    let mut random = generator(seed);
    let (basis, volume, cell): ([[f64; 3]; 3], f64, f64) = if dimension == 3 {
        ([[0.0, 1.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 0.0]], 4.0 / 3.0 * std::f64::consts::PI, 2.0)
    } else {
        let height = 0.75f64.sqrt();
        ([[1.0, 0.0, 0.0], [0.5, height, 0.0], [0.0; 3]], std::f64::consts::PI, height)
    };
    let scale = (volume / f64::from(count) / cell).powf(1.0 / dimension as f64);
    let turn = rotation(dimension, &mut random);
    let shift: [f64; 3] = random.random();
    let reach = (2.2 / scale) as i32 + 2;
    let deep = if dimension == 3 { reach } else { 0 };
    let (mut all, mut open) = (0u32, 0u32);
    for (a, b, c) in
        (-reach..=reach).flat_map(|a| (-reach..=reach).flat_map(move |b| (-deep..=deep).map(move |c| (a, b, c))))
    {
        let steps = [a, b, c].map(f64::from);
        let mut point = [0.0; 3];
        for d in 0..dimension {
            for (j, axis) in turn.iter().enumerate() {
                (0..3).for_each(|k| point[k] += scale * (steps[d] + shift[d]) * basis[d][j] * axis[k]);
            }
        }
        if point.iter().map(|x| x * x).sum::<f64>() < 1.0 {
            all += 1;
            open += u32::from(see(point.map(|x| x as f32)));
        }
    }
    f64::from(open) / f64::from(all)
}

/// A random orthonormal basis, by Gram and Schmidt.
fn rotation(dimension: usize, random: &mut ChaCha8Rng) -> Vec<[f64; 3]> {
    let mut basis: Vec<[f64; 3]> = Vec::new();
    while basis.len() < dimension {
        let mut v: [f64; 3] =
            std::array::from_fn(|k| if k < dimension { random.random::<f64>() * 2.0 - 1.0 } else { 0.0 });
        let inside = v.iter().map(|x| x * x).sum::<f64>() <= 1.0;
        for u in &basis {
            let along: f64 = (0..3).map(|k| u[k] * v[k]).sum();
            (0..3).for_each(|k| v[k] -= along * u[k]);
        }
        let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
        if inside && length > 1e-3 {
            basis.push(v.map(|x| x / length));
        }
    }
    basis
}

/// A quarter of the points in the cells of a grid; the others go where neighbouring cells disagree. How many a cell gets
/// is decided by its neighbours, never by its own point, so no cell's mean is biased by its own luck.
fn refined(count: u32, seed: u64, dimension: usize, see: See) -> f64 {
    let side = (f64::from(count) / 4.0).powf(1.0 / dimension as f64).round() as usize;
    let cells = side.pow(dimension as u32);
    let mut random = generator(seed);
    let at = |i: usize| [i % side, i / side % side, i / side / side];
    let place = |i: usize, within: [f64; 3]| {
        let cell = at(i);
        ball(dimension, std::array::from_fn(|k| (cell[k] as f64 + within[k]) / side as f64))
    };
    let first: Vec<bool> = (0..cells).map(|i| see(place(i, random.random()))).collect();
    let disagreement = |i: usize| {
        let (mut open, mut all) = (0.0, 0.0);
        for j in (0..cells).filter(|&j| j != i) {
            let square: usize = (0..dimension).map(|k| at(i)[k].abs_diff(at(j)[k]).pow(2)).sum();
            if square <= dimension && (0..dimension).all(|k| at(i)[k].abs_diff(at(j)[k]) <= 1) {
                all += 1.0 / square as f64;
                open += f64::from(u8::from(first[j])) / square as f64;
            }
        }
        let share: f64 = open / all;
        (share * (1.0 - share)).sqrt()
    };
    let wanted: Vec<f64> = (0..cells).map(disagreement).collect();
    let total: f64 = wanted.iter().sum();
    let left = f64::from(count) - cells as f64;
    let mut due = random.random::<f64>();
    let mut sum = 0.0;
    for i in 0..cells {
        due += if total > 0.0 { wanted[i] / total * left } else { left / cells as f64 };
        let more = due.floor();
        due -= more;
        let mut sequence = Sequence::new(Sampler::Sobol, seed, 77 + i as u64);
        let mut open = f64::from(u8::from(first[i]));
        for _ in 0..more as u32 {
            let within = sequence.next_point::<3>().map(|x| 0.5 * f64::from(x) + 0.5);
            open += f64::from(u8::from(see(place(i, within))));
        }
        sum += open / (more + 1.0);
    }
    sum / cells as f64
}
