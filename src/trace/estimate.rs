//! How sure a sampled value is.
//!
//! The rays of a point fall into R groups of equal size, and the scatter of the groups' means tells the error of the mean
//! of all, with no assumption about how the integrand behaves:
//!
//! ```text
//! error^2 = R^(-0.6/d) * 1/R * 1/(R - 1) * sum over groups (mean of the group - mean of all)^2         R = 8 to 15
//! ```
//!
//! A group is a run of 2^k rays of the [`Sequence`](super::Sequence), each an evenly spread point set under an Owen
//! scrambling that is uniformly random by itself. So every group alone has the variance of an independently scrambled set
//! of its size, and R independent ones have 1/R of it. But together the groups are one larger set, spread more evenly
//! still: what one leaves out the others cover, and their errors cancel in part. The variance of N even points of a
//! d-dimensional hemisphere falls like N^(-1 - 1/d) ([`Sampling::expected_variance`](super::Sampling::expected_variance)),
//! so that of R times as many is R^(-1/d) less than that of R independent sets. Where silhouettes are everywhere it gains less, and
//! few groups scatter too little now and then; with six tenths of that exponent at least 90 % of all values lie
//! within two standard errors on every scene tried. With independent
//! sets that factor would be 1, and the error itself larger, measured 1.3 to 1.5 times at 256 rays: the values would be
//! made worse for the sake of their error bars. Of independent rays each is a group of its own.
//!
//! Where all agree there is no scatter, and yet no certainty. So no estimate is below half of the variance that is to be
//! expected of so many even rays at a place of that value, half a ray the other way added: 0.3/N to 0.4/N where all agree.
//! Of independent rays, none out of N going the other way means, at 95 %, a share below
//! 3/N (the rule of three), which are two standard errors of 1.5/N: no estimate is below that.

use std::sync::LazyLock;

use super::groups::{Groups, LEAST};
use super::noise;
use super::sampling::{Sampler, Target};
use crate::geometry::{Dimension, Vector};

/// Is told of each ray where it goes, and whether it escapes.
pub type Watch<'w, const D: usize> = dyn FnMut(Vector<D>, bool) + 'w;

/// How much more even several groups are together, as a share of the exponent that the rate of convergence gives.
const GAIN: f64 = 0.6;

/// A value, and how sure it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Ambient occlusion, within [0, 1].
    pub value: f32,
    /// Its standard error; 0 only where no ray was asked.
    pub error: f32,
    /// How many rays were asked.
    pub rays: u32,
}

impl Estimate {
    /// A value that is known without rays.
    pub fn known(value: f64) -> Self {
        Self { value: value as f32, error: 0.0, rays: 0 }
    }

    /// The share of so many independent rays.
    pub fn independent(value: f32, rays: u32) -> Self {
        let (share, count) = (f64::from(value), f64::from(rays));
        let error = (share * (1.0 - share) / (count - 1.0).max(1.0)).sqrt().max(bound(rays)).min(1.0);
        Self { value, error: error as f32, rays }
    }
}

impl Target {
    /// How many rays there are when the error is looked at next, after so many.
    pub(crate) fn next_look(rays: usize) -> usize {
        (rays + 1).next_power_of_two().max(Self::FEWEST as usize)
    }

    /// Whether the rays so far are enough.
    pub(crate) fn is_met(&self, accumulator: &Accumulator) -> bool {
        let rays = accumulator.rays();
        rays >= Self::FEWEST && rays.is_power_of_two() && accumulator.cautious_error() <= f64::from(self.error)
    }
}

/// Counts of rays that escape, by group.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Accumulator {
    groups: Groups<u32>,
    /// In what space rays are even; none if they know nothing of each other.
    even_in: Option<Dimension>,
}

impl Accumulator {
    /// For rays of this sampler in a space of this dimension.
    pub fn new(sampler: Sampler, dimension: Dimension) -> Self {
        Self { groups: Groups::new(), even_in: (sampler == Sampler::Sobol).then_some(dimension) }
    }

    /// The next `count` rays; the lowest bits of `open` tell which of them escape.
    pub fn add(&mut self, mut open: u64, mut count: u32) {
        if count == u64::BITS && self.rays() == 0 {
            // What the loop below would come to: a run for each byte.
            return self.add_runs(u64::BITS / LEAST as u32, open.to_le_bytes().map(u8::count_ones));
        }
        while count > 0 {
            let taken = count.min(self.groups.room()).min(u64::BITS);
            self.groups.add(taken, (open & (u64::MAX >> (u64::BITS - taken))).count_ones());
            count -= taken;
            open = open.checked_shr(taken).unwrap_or(0);
        }
    }

    /// The next rays, in [`LEAST`] runs of equal size, which is a power of two that divides the size of groups: how many of each escape.
    pub fn add_runs(&mut self, size: u32, escaped: [u32; LEAST]) {
        if self.rays() == 0 {
            self.groups = Groups::of(size, escaped);
            return;
        }
        for count in escaped {
            debug_assert!(size <= self.groups.room(), "runs of {size} rays in groups of {}", self.groups.size());
            self.groups.add(size, count);
        }
    }

    /// Rays so far.
    pub fn rays(&self) -> u32 {
        self.groups.rays()
    }

    /// How many of them escape.
    pub fn escaped(&self) -> u32 {
        self.groups.sum()
    }

    /// The standard error, at most 1.
    pub fn error(&self) -> f64 {
        let rays = f64::from(self.rays());
        let variance = match self.even_in {
            None => self.variance_of_rays().max(bound(self.rays()).powi(2)),
            Some(dimension) => {
                let together = variance_together(rays / f64::from(self.groups.size()), dimension);
                let groups = self.variance_of_groups() * together;
                let value = (f64::from(self.escaped()) + 0.5) / (rays + 1.0);
                groups.max(0.5 * noise::of_even_rays(dimension, value, rays))
            }
        };
        variance.sqrt().min(1.0)
    }

    /// A standard error to stop by. Whoever stops as soon as an error is small enough stops at the luckiest, so groups count
    /// as if they were independent, and agreement as of independent rays.
    pub fn cautious_error(&self) -> f64 {
        let variance = match self.even_in {
            None => self.variance_of_rays(),
            Some(_) => self.variance_of_groups(),
        };
        variance.sqrt().max(bound(self.rays())).min(1.0).max(self.error())
    }

    fn variance_of_rays(&self) -> f64 {
        let (rays, escaped) = (f64::from(self.rays()), f64::from(self.escaped()));
        escaped * (rays - escaped) / (rays * rays) / (rays - 1.0).max(1.0)
    }

    /// From whole numbers, so that the order of the groups doesn't matter.
    fn variance_of_groups(&self) -> f64 {
        let groups = self.groups.finished();
        let count = groups.len() as f64;
        let sum: u64 = groups.iter().map(|&g| u64::from(g)).sum();
        let squares: u64 = groups.iter().map(|&g| u64::from(g) * u64::from(g)).sum();
        let scatter = (groups.len() as u64 * squares - sum * sum) as f64 / count;
        let grouped = count * f64::from(self.groups.size());
        // Of all rays, those of an unfinished group too.
        let share = grouped / f64::from(self.rays());
        scatter * count / (count - 1.0).max(1.0) / (grouped * grouped) * share
    }

    /// What they say together.
    pub fn estimate(&self) -> Estimate {
        let value = f64::from(self.escaped()) / f64::from(self.rays());
        Estimate { value: value as f32, error: self.error() as f32, rays: self.rays() }
    }
}

/// The variance of the mean of so many groups of even rays, of that of independent ones.
pub(super) fn variance_together(groups: f64, dimension: Dimension) -> f64 {
    /// Of as many groups as 2^n rays make.
    static OF_LEAST: LazyLock<[f64; 2]> =
        LazyLock::new(|| [Dimension::Three, Dimension::Four].map(|d| of(LEAST as f64, d)));
    fn of(groups: f64, dimension: Dimension) -> f64 {
        libm::pow(groups, -GAIN / dimension.pick(2.0, 3.0))
    }
    if groups == LEAST as f64 { dimension.pick(OF_LEAST[0], OF_LEAST[1]) } else { of(groups, dimension) }
}

/// What no estimate of so many independent rays is below: the rule of three.
pub(super) fn bound(rays: u32) -> f64 {
    1.5 / f64::from(rays)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn accumulator(rays: &[bool]) -> Accumulator {
        let mut accumulator = Accumulator::new(Sampler::Sobol, Dimension::Four);
        rays.iter().for_each(|&ray| accumulator.add(u64::from(ray), 1));
        accumulator
    }

    /// Looks random, with a share of 1/3.
    fn pattern(count: u32) -> Vec<bool> {
        (0..count).map(|i| i.wrapping_mul(2_654_435_769).rotate_left(11) % 3 == 0).collect()
    }

    #[test]
    fn groups_are_what_they_are_said_to_be() {
        for count in 1..700 {
            let rays = pattern(count);
            let found = accumulator(&rays);
            assert_eq!(found.rays(), count);
            assert_eq!(found.escaped(), rays.iter().filter(|&&r| r).count() as u32);
            if count < 2 {
                continue;
            }
            let size = if count < 16 { 1 } else { 1 << (count.ilog2() - 3) };
            let means: Vec<f64> = rays
                .chunks_exact(size)
                .map(|group| group.iter().filter(|&&r| r).count() as f64 / size as f64)
                .collect();
            let n = means.len() as f64;
            assert!((2..16).contains(&means.len()));
            let mean = means.iter().sum::<f64>() / n;
            let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (n - 1.0) / n;
            let groups = f64::from(count) / size as f64;
            let expected = (variance * n / groups).sqrt() * groups.powf(-GAIN / 6.0);
            let value = (f64::from(found.escaped()) + 0.5) / f64::from(count + 1);
            let expected = expected.max((0.5 * noise::of_even_rays(Dimension::Four, value, count.into())).sqrt());
            assert!((found.error() - expected.min(1.0)).abs() < 1e-12, "{count}: {} {expected}", found.error());
        }
    }

    #[test]
    fn independent_rays_are_groups_of_their_own() {
        let rays = pattern(300);
        let mut accumulator = Accumulator::new(Sampler::Random, Dimension::Four);
        rays.iter().for_each(|&ray| accumulator.add(u64::from(ray), 1));
        let share = rays.iter().filter(|&&r| r).count() as f64 / 300.0;
        assert!((accumulator.error() - (share * (1.0 - share) / 299.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn words_count_like_single_rays() {
        let rays = pattern(64 * 40);
        let mut words = Accumulator::new(Sampler::Sobol, Dimension::Four);
        for (n, word) in rays.chunks(64).enumerate() {
            words.add(word.iter().rev().fold(0, |w, &r| w << 1 | u64::from(r)), 64);
            let single = accumulator(&rays[..64 * (n + 1)]);
            assert_eq!(words.estimate(), single.estimate());
            assert_eq!((words.groups.finished(), words.rays()), (single.groups.finished(), single.rays()));
        }
    }

    #[test]
    fn agreement_is_not_certainty() {
        for all in [true, false] {
            for count in [1u32, 5, 64, 100, 1 << 20] {
                for (sampler, least) in [(Sampler::Sobol, 0.28f64), (Sampler::Random, 1.5)] {
                    let mut accumulator = Accumulator::new(sampler, Dimension::Four);
                    (0..count).for_each(|_| accumulator.add(u64::from(all), 1));
                    let estimate = accumulator.estimate();
                    assert_eq!(estimate.value, f32::from(u8::from(all)));
                    let rays = f64::from(estimate.error) * f64::from(count);
                    assert!((least.min(f64::from(count))..1.5 * least).contains(&(rays + 1e-6)), "{count}: {rays}");
                }
            }
        }
    }

    #[test]
    fn targets_are_looked_at_when_rays_have_doubled() {
        let easy = Target { error: 0.5 };
        for count in 1..300 {
            let expected = [64, 128, 256].contains(&count);
            assert_eq!(easy.is_met(&accumulator(&pattern(count))), expected, "{count}");
        }
        assert!(!Target { error: 1e-4 }.is_met(&accumulator(&pattern(256))));
    }
}
