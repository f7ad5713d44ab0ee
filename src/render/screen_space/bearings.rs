//! Where the sectors of a slice lie: the mean direction of each, for directional occlusion (Ritschel, Grosch and Seidel 2009).
//!
//! The vector b is the integral of the open directions, weighted as ambient occlusion weights them. Within a slice a direction
//! at the angle t from the direction to the eye, V, is V cos t + w sin t; so what is needed of a sector is the mean of cos t and
//! that of sin t, by the weight of the slice ([`super::sectors`]). Sectors depend on the slice's angle g alone, so a table of
//! some angles serves all slices, and values between are interpolated.

use std::f64::consts::{FRAC_PI_2, PI};

use super::sectors::{Hidden, SECTORS, Slice, arc_cosine};

/// Angles g in the table, from -pi/2 to pi/2.
const ANGLES: usize = 65;
/// Steps of the integrals along a slice, for each sector: where the weight is least, sectors are some hundred steps wide.
const STEPS: usize = 64;

/// The parts of sectors along V and along w: of all together those of the slice, by its weight.
type Row = [[f32; 2]; SECTORS];

/// The table, for a scene of dimension D.
#[derive(Clone, Debug)]
pub(super) struct Bearings<const D: usize> {
    rows: Vec<Row>,
    /// The sums over all sectors.
    sums: Vec<[f32; 2]>,
}

impl<const D: usize> Bearings<D> {
    pub fn new() -> Self {
        let angle = |n: usize| PI * n as f64 / (ANGLES - 1) as f64 - FRAC_PI_2;
        let rows: Vec<Row> = (0..ANGLES).map(|n| row::<D>(angle(n))).collect();
        let sum = |row: &Row| row.iter().fold([0.0; 2], |sum, part| [sum[0] + part[0], sum[1] + part[1]]);
        Self { sums: rows.iter().map(sum).collect(), rows }
    }

    /// The integral over what is open of a slice, along V and along w, relative to the slice's weight.
    pub fn open(&self, slice: &Slice<D>, hidden: Hidden) -> [f32; 2] {
        let [cos, sin] = slice.angle();
        let place = (arc_cosine(cos).copysign(sin) / std::f32::consts::PI + 0.5) * (ANGLES - 1) as f32;
        let first = (place as usize).min(ANGLES - 2);
        let part = place - first as f32;
        let between = |rows: [[f32; 2]; 2]| [0, 1].map(|c| rows[0][c] + part * (rows[1][c] - rows[0][c]));
        let mut open = between([self.sums[first], self.sums[first + 1]]);
        let mut rest = hidden.sectors();
        while rest != 0 {
            let sector = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let taken = between([self.rows[first][sector], self.rows[first + 1][sector]]);
            (0..2).for_each(|c| open[c] -= taken[c]);
        }
        open
    }
}

/// The sectors of a slice of this angle g, by sums along it.
fn row<const D: usize>(g: f64) -> Row {
    const ALL: usize = SECTORS * STEPS;
    let angle = |i: usize| g - FRAC_PI_2 + (i as f64 + 0.5) * PI / ALL as f64;
    let weight = |t: f64| libm::cos(t - g) * libm::sin(t).abs().powi(D as i32 - 2);
    let total: f64 = (0..ALL).map(|i| weight(angle(i))).sum();
    let (mut row, mut before) = ([[0.0f64; 2]; SECTORS], 0.0);
    for i in 0..ALL {
        let t = angle(i);
        let share = weight(t) / total;
        let sector = (((before + 0.5 * share) * SECTORS as f64) as usize).min(SECTORS - 1);
        row[sector][0] += share * libm::cos(t);
        row[sector][1] += share * libm::sin(t);
        before += share;
    }
    row.map(|part| part.map(|x| x as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is open of a slice beyond an angle is the integral there.
    fn integrals<const D: usize>() {
        let bearings = Bearings::<D>::new();
        for g in [-1.4, -0.62, 0.0, 0.27, 1.13] {
            let slice = Slice::<D>::new(f64::cos(g) as f32, f64::sin(g) as f32).unwrap();
            let weight = |t: f64| (t - g).cos() * t.sin().abs().powi(D as i32 - 2);
            let integral = |from: f64, part: fn(f64) -> f64| {
                let (steps, end) = (20_000, g + FRAC_PI_2);
                let width = (end - from) / f64::from(steps);
                let at = |i: i32| from + (f64::from(i) + 0.5) * width;
                (0..steps).map(|i| weight(at(i)) * part(at(i)) * width).sum::<f64>()
            };
            let start = g - FRAC_PI_2;
            let all = integral(start, |_| 1.0);
            for from in [start, -0.3, 0.0, 0.4, g + FRAC_PI_2] {
                let side =
                    if from < 0.0 { super::super::sectors::Side::Behind } else { super::super::sectors::Side::Ahead };
                let mut hidden = Hidden::default();
                hidden.hide(0.0, if from == start { 0.0 } else { slice.share(side, from.cos() as f32) }, 0.5);
                let found = bearings.open(&slice, hidden);
                for (c, part) in [f64::cos as fn(f64) -> f64, f64::sin].into_iter().enumerate() {
                    let expected = integral(from.max(start), part) / all;
                    // Half a sector.
                    assert!((f64::from(found[c]) - expected).abs() < 0.009, "{g} {from}: {found:?} {expected}");
                }
            }
        }
    }

    #[test]
    fn what_is_open_is_summed_where_it_lies() {
        integrals::<3>();
        integrals::<4>();
    }
}
