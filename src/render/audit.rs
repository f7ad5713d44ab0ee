//! How far off the occlusion of a picture is, measured: some of its voxels are looked at again, with many rays.
//!
//! The voxels are chosen by a hash of their number, the lowest of those that see something, so that the choice depends on
//! nothing but the picture. The rays' own variance is known ([`Sampling::expected_variance`]) and taken off:
//!
//! ```text
//! RMS^2 = mean of ((shown - looked at)^2 - variance)
//! ```
//!
//! That variance is known to a tenth or so, and an error below about 0.003 is not told from it.
//! So the number holds for any shading, and for what no shading says of itself: values interpolated across a contact, or
//! by a method that is wrong.

use std::collections::BTreeMap;

use super::NOTHING;
use super::gbuffer::{Columns, GBuffer};
use super::inside::inside;
use crate::geometry::{Dimension, Vector};
use crate::occlusion::{Error, Estimator};
use crate::progress::{Progress, Uncounted};
use crate::trace::{RayBackend, Sampling, ShadingPoint};

/// Voxels that are looked at.
const VOXELS: usize = 512;

/// How far off a picture's occlusion is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Accuracy {
    /// The root mean square of what voxels are off.
    pub rms: f64,
    /// The most that a voxel was off, of those that were looked at.
    pub largest: f64,
    /// How many voxels were looked at.
    pub voxels: usize,
}

/// A voxel that is to be looked at again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Checked<const D: usize> {
    /// Its number in the image.
    pub number: u64,
    /// The simplex that it sees.
    pub simplex: u32,
    /// The point that it shows.
    pub position: Vector<D>,
    /// The normal there.
    pub normal: Vector<D>,
    /// The occlusion that it shows.
    pub shown: f32,
}

/// Voxels to be looked at again. Which of a picture that is made in parts, is known when all parts are there: each part
/// tells its own candidates.
#[derive(Clone, Debug)]
pub struct Audit<const D: usize> {
    sampling: Sampling,
    /// By the hash of the voxel's number.
    chosen: BTreeMap<(u64, u64), Checked<D>>,
}

impl<const D: usize> Audit<D> {
    /// What it needs to know of voxels.
    pub(super) const COLUMNS: Columns =
        Columns::SIMPLEX.union(Columns::POSITION).union(Columns::NORMAL).union(Columns::OCCLUSION);

    /// Looks again with these rays, which must be others than the picture's own.
    pub fn new(sampling: Sampling) -> Self {
        Self { sampling, chosen: BTreeMap::new() }
    }

    /// Voxels whose number has a hash above this are not chosen any more.
    pub fn limit(&self) -> u64 {
        match self.chosen.last_key_value() {
            Some((&(last, _), _)) if self.chosen.len() == VOXELS => last,
            _ => u64::MAX,
        }
    }

    /// Chooses among some finished layers.
    pub(super) fn add(&mut self, buffer: &GBuffer<D>) {
        let first = buffer.layers().start * buffer.layer_len();
        for i in (0..buffer.len()).filter(|&i| buffer.simplex[i] != NOTHING) {
            self.choose((first + i) as u64, |number| Checked {
                number,
                simplex: buffer.simplex[i],
                position: buffer.position[i],
                normal: buffer.normal[i],
                shown: buffer.occlusion[i],
            });
        }
    }

    /// Takes a candidate of a part.
    pub fn insert(&mut self, candidate: Checked<D>) {
        self.choose(candidate.number, |_| candidate);
    }

    fn choose(&mut self, number: u64, candidate: impl FnOnce(u64) -> Checked<D>) {
        let key = (hash(number), number);
        if self.chosen.len() == VOXELS && self.chosen.last_key_value().is_some_and(|(last, _)| *last < key) {
            return;
        }
        self.chosen.insert(key, candidate(number));
        if self.chosen.len() > VOXELS {
            self.chosen.pop_last();
        }
    }

    /// What was chosen so far.
    pub fn candidates(&self) -> impl Iterator<Item = &Checked<D>> {
        self.chosen.values()
    }

    /// Looks at what was chosen; none if no voxel sees anything.
    ///
    /// # Errors
    /// If `progress` says so, or a device fails.
    pub fn finish(self, backend: &dyn RayBackend<D>, progress: &dyn Progress) -> Result<Option<Accuracy>, Error> {
        let mesh = backend.tracer().mesh();
        let point = |checked: Checked<D>| {
            let Checked { number, simplex, position, normal, shown } = checked;
            let position = inside(mesh, simplex, &position);
            (ShadingPoint::Inside { position, normal, simplex, number }, shown)
        };
        let (points, shown): (Vec<_>, Vec<f32>) = self.chosen.into_values().map(point).unzip();
        let found = Estimator::Sampled(self.sampling).estimate(backend, &points, None, &Uncounted(progress))?;
        let (mut sum, mut largest) = (0.0, 0.0f64);
        for (&truth, &shown) in found.values.iter().zip(&shown) {
            let (truth, shown) = (f64::from(truth), f64::from(shown));
            let noise = self.sampling.expected_variance(Dimension::of::<D>(), truth);
            // Where all rays agree with what is shown there is nothing to take off.
            let square = if truth == shown { 0.0 } else { (truth - shown).powi(2) - noise };
            sum += square;
            largest = largest.max(square.max(0.0).sqrt());
        }
        let voxels = points.len();
        let rms = (sum.max(0.0) / voxels.max(1) as f64).sqrt();
        Ok((voxels > 0).then_some(Accuracy { rms, largest, voxels }))
    }
}

/// Spreads numbers evenly (the finaliser of SplitMix64; Steele, Lea and Flood 2014).
pub(super) fn hash(number: u64) -> u64 {
    let mut x = number.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}
