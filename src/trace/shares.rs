//! How sure a sampled value is whose rays are let through in part: [`Accumulator`](super::estimate::Accumulator) for numbers
//! between 0 and 1. Of rays that are let through whole or not at all it gives the same bits.

use super::estimate::{Estimate, bound, variance_together};
use super::groups::Groups;
use super::noise;
use super::sampling::{Sampler, Target};
use crate::geometry::Dimension;

/// Sums of what rays bring, by group.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shares {
    groups: Groups<f64>,
    /// The sum of all rays' squares.
    squares: f64,
    /// In what space rays are even; none if they know nothing of each other.
    even_in: Option<Dimension>,
}

impl Shares {
    /// For rays of this sampler in a space of this dimension.
    pub fn new(sampler: Sampler, dimension: Dimension) -> Self {
        Self { groups: Groups::new(), squares: 0.0, even_in: (sampler == Sampler::Sobol).then_some(dimension) }
    }

    /// The next ray, of which this share gets through.
    pub fn add(&mut self, share: f64) {
        self.groups.add(1, share);
        self.squares += share * share;
    }

    /// Rays so far.
    pub fn rays(&self) -> u32 {
        self.groups.rays()
    }

    fn sum(&self) -> f64 {
        self.groups.sum()
    }

    /// The standard error, at most 1.
    fn error(&self) -> f64 {
        let rays = f64::from(self.rays());
        let variance = match self.even_in {
            None => self.variance_of_rays().max(bound(self.rays()).powi(2)),
            Some(dimension) => {
                let together = variance_together(rays / f64::from(self.groups.size()), dimension);
                let value = (self.sum() + 0.5) / (rays + 1.0);
                (self.variance_of_groups() * together).max(0.5 * noise::of_even_rays(dimension, value, rays))
            }
        };
        variance.sqrt().min(1.0)
    }

    fn variance_of_rays(&self) -> f64 {
        let (rays, sum) = (f64::from(self.rays()), self.sum());
        (rays * self.squares - sum * sum).max(0.0) / (rays * rays) / (rays - 1.0).max(1.0)
    }

    fn variance_of_groups(&self) -> f64 {
        let groups = self.groups.finished();
        let count = groups.len() as f64;
        let sum: f64 = groups.iter().sum();
        let squares: f64 = groups.iter().map(|g| g * g).sum();
        let scatter = (count * squares - sum * sum).max(0.0) / count;
        let grouped = count * f64::from(self.groups.size());
        scatter * count / (count - 1.0).max(1.0) / (grouped * grouped) * (grouped / f64::from(self.rays()))
    }

    /// Whether the rays so far are enough; as of rays that get through whole or not at all.
    pub fn meet(&self, target: &Target) -> bool {
        let rays = self.rays();
        let cautious = || {
            let variance = if self.even_in.is_none() { self.variance_of_rays() } else { self.variance_of_groups() };
            variance.sqrt().max(bound(rays)).min(1.0).max(self.error())
        };
        rays >= Target::FEWEST && rays.is_power_of_two() && cautious() <= f64::from(target.error)
    }

    /// What they say together.
    pub fn estimate(&self) -> Estimate {
        let value = self.sum() / f64::from(self.rays());
        Estimate { value: value as f32, error: self.error() as f32, rays: self.rays() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::estimate::Accumulator;

    #[test]
    fn whole_shares_are_rays_that_escape() {
        for sampler in [Sampler::Sobol, Sampler::Random] {
            let mut shares = Shares::new(sampler, Dimension::Four);
            let mut accumulator = Accumulator::new(sampler, Dimension::Four);
            for i in 0..1000u32 {
                let open = i.wrapping_mul(2_654_435_769).rotate_left(11) % 3 == 0;
                shares.add(f64::from(u8::from(open)));
                accumulator.add(u64::from(open), 1);
                if i > 0 {
                    assert_eq!(shares.estimate(), accumulator.estimate(), "{sampler:?}, {i}");
                }
                let target = Target { error: 0.04 };
                assert_eq!(shares.meet(&target), target.is_met(&accumulator));
            }
        }
    }

    #[test]
    fn halves_are_half_as_sure_to_differ() {
        let (mut halves, mut wholes) = [Shares::new(Sampler::Random, Dimension::Three); 2].into();
        for i in 0..512 {
            wholes.add(f64::from(i % 2));
            halves.add(0.5 * f64::from(i % 2));
        }
        let (halves, wholes) = (halves.estimate(), wholes.estimate());
        assert_eq!((halves.value, wholes.value), (0.25, 0.5));
        assert!((halves.error - 0.5 * wholes.error).abs() < 1e-6);
    }
}
