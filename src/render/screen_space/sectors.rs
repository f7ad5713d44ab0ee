//! A slice through a shading point, and which of its sectors are hidden (the visibility bitmask of Therrien, Levesque and
//! Gilet 2023).
//!
//! A slice is the plane of the direction to the eye, V, and a direction w across it. Ambient occlusion is the mean over all
//! slices of what is open in each, where a direction at the angle t from V counts by
//!
//! ```text
//! n_p cos(t - g) |sin t|^(D - 2) dt
//! ```
//!
//! n_p is the length of the normal's part within the slice and g the angle of that part from V, towards w. The power of the
//! sine is the measure of directions around V, of which each angle has a circle in 3D and a sphere in 4D; it is all that
//! differs between the dimensions. Angles are known by their cosines and sines, and the integral from 0 to h is
//!
//! ```text
//! 4D: (cos g sin^3 h + sin g (1 - cos h)^2 (2 + cos h)) / 3        3D: (cos g sin^2 h + sin g (h - sin h cos h)) / 2
//! ```
//!
//! Sectors are cut so that each has the same share of the slice's weight, so what is open is the number of sectors left.

use crate::geometry::Dimension;

/// Sectors of a slice: the bits of a word.
pub(super) const SECTORS: usize = u64::BITS as usize;

/// A side of a slice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    /// That of w.
    Ahead,
    /// That of -w.
    Behind,
}

/// A slice.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slice<const D: usize> {
    /// Cosine and sine of g.
    cos: f32,
    sin: f32,
    /// The weight of the side of -w, and of both sides, but for n_p.
    behind: f32,
    total: f32,
    /// What the slice counts.
    pub weight: f32,
}

impl<const D: usize> Slice<D> {
    /// The slice in which a normal has these parts along V and along w; none if it is across the slice.
    pub fn new(to_eye: f32, across: f32) -> Option<Self> {
        let length = (to_eye * to_eye + across * across).sqrt();
        if length < 1e-6 {
            return None;
        }
        let (cos, sin) = (to_eye / length, across / length);
        // The hemisphere ends at pi/2 + g on the side of w, and at pi/2 - g on the other.
        let behind = Self::integral(sin, cos, -sin, cos);
        let total = behind + Self::integral(-sin, cos, sin, cos);
        Some(Self { cos, sin, behind, total, weight: length * total })
    }

    /// Cosine and sine of g.
    pub fn angle(&self) -> [f32; 2] {
        [self.cos, self.sin]
    }

    /// The integral from 0 to h, by the cosines and sines of h and g; the sine of g comes before its cosine.
    #[inline]
    fn integral(cos_h: f32, sin_h: f32, sin_g: f32, cos_g: f32) -> f32 {
        match Dimension::of::<D>() {
            Dimension::Three => 0.5 * (cos_g * sin_h * sin_h + sin_g * (arc_cosine(cos_h) - sin_h * cos_h)),
            Dimension::Four => {
                let rest = (1.0 - cos_h) * (1.0 - cos_h) * (2.0 + cos_h);
                (cos_g * sin_h * sin_h * sin_h + sin_g * rest) / 3.0
            }
        }
    }

    /// The share of the slice's weight from its end on the side of -w to an angle from V on one of its sides.
    #[inline]
    pub fn share(&self, side: Side, cos_angle: f32) -> f32 {
        let (sin_g, end) = match side {
            Side::Ahead => (self.sin, 1.0),
            Side::Behind => (-self.sin, 0.0),
        };
        if cos_angle <= -sin_g {
            return end;
        }
        let sin_angle = (1.0 - cos_angle * cos_angle).max(0.0).sqrt();
        let own = Self::integral(cos_angle, sin_angle, sin_g, self.cos);
        let below = match side {
            Side::Ahead => self.behind + own,
            Side::Behind => self.behind - own,
        };
        below / self.total
    }
}

/// The arc cosine to 7e-5 (Abramowitz and Stegun 4.4.45): a six-hundredth of a sector.
#[inline]
pub(super) fn arc_cosine(x: f32) -> f32 {
    let y = x.abs().min(1.0);
    let near = (1.0 - y).sqrt() * (1.570_728_8 + y * (-0.212_114_4 + y * (0.074_261 - y * 0.018_729_3)));
    if x < 0.0 { std::f32::consts::PI - near } else { near }
}

/// Which sectors are hidden.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Hidden(u64);

impl Hidden {
    /// Hides what lies between two shares of the weight, in either order. A sector that is hidden in part counts as hidden
    /// with the probability of that part, where `dither` is an even random number from 0 up to 1, the same for a whole
    /// slice. Returns the share of the weight that was open before.
    #[inline]
    pub fn hide(&mut self, one: f32, other: f32, dither: f32) -> f32 {
        let place = |share: f32| ((share * SECTORS as f32 + dither) as u32).min(u64::BITS);
        let (first, end) = (place(one.min(other)), place(one.max(other)));
        if first >= end {
            return 0.0;
        }
        let sectors = (u64::MAX >> (u64::BITS - (end - first))) << first;
        let new = sectors & !self.0;
        self.0 |= sectors;
        new.count_ones() as f32 / SECTORS as f32
    }

    /// The hidden sectors, the first from the end on the side of -w lowest.
    pub fn sectors(self) -> u64 {
        self.0
    }

    /// The share of the weight that is open.
    pub fn open(self) -> f32 {
        self.0.count_zeros() as f32 / SECTORS as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The weight of a slice from its end on the side of -w to the angle t, by sums.
    fn summed<const D: usize>(g: f64, t: f64) -> f64 {
        let (steps, end) = (20_000, g - std::f64::consts::FRAC_PI_2);
        let width = (t - end) / f64::from(steps);
        let at = |i: i32| end + (f64::from(i) + 0.5) * width;
        (0..steps).map(|i| (at(i) - g).cos() * at(i).sin().abs().powi(D as i32 - 2) * width).sum()
    }

    fn weights<const D: usize>() {
        for g in [-1.5, -0.8, -0.1, 0.0, 0.3, 1.0, 1.55] {
            let (cos, sin) = (f64::cos(g) as f32, f64::sin(g) as f32);
            let slice = Slice::<D>::new(0.7 * cos, 0.7 * sin).unwrap();
            let all = summed::<D>(g, g + std::f64::consts::FRAC_PI_2);
            assert!((f64::from(slice.weight) - 0.7 * all).abs() < 1e-4, "{g}: {} {all}", slice.weight);
            for i in 0..=20 {
                let t = g - std::f64::consts::FRAC_PI_2 + std::f64::consts::PI * f64::from(i) / 20.0;
                let side = if t < 0.0 { Side::Behind } else { Side::Ahead };
                let (share, expected) = (slice.share(side, t.cos() as f32), summed::<D>(g, t) / all);
                assert!((f64::from(share) - expected).abs() < 3e-4, "{g} {t}: {share} {expected}");
            }
        }
        assert!(Slice::<D>::new(0.0, 1e-9).is_none());
    }

    #[test]
    fn shares_are_those_of_the_integral() {
        weights::<3>();
        weights::<4>();
    }

    #[test]
    fn what_is_hidden_twice_counts_once() {
        let mut hidden = Hidden::default();
        assert_eq!(hidden.open(), 1.0);
        assert_eq!(hidden.hide(0.25, 0.5, 0.5), 0.25);
        assert_eq!(hidden.hide(0.5, 0.375, 0.5), 0.0);
        assert_eq!(hidden.hide(0.25, 0.25, 0.5), 0.0);
        assert_eq!(hidden.open(), 0.75);
        // Less than a sector is hidden by the dither alone.
        for (dither, open) in [(0.0, 0.75), (0.5, 0.75), (0.95, 0.734375)] {
            let mut again = hidden;
            again.hide(0.75, 0.7515, dither);
            assert_eq!(again.open(), open, "{dither}");
        }
        hidden.hide(0.0, 1.0, 0.999);
        assert_eq!(hidden.open(), 0.0);
    }
}
