//! The `weld` of meshes from files: points near each other become one.
//!
//! Many programs write each part of a surface with points of its own, which differ by a last digit where parts meet. Such a
//! surface is open there, though it looks closed. The tolerance is absolute, in the file's units, and small beside the mesh: one
//! as wide as a hundredth of it would merge what is meant to be apart.

use super::Error;
use super::numbers::finite;
use crate::geometry::Vector64;
use crate::mesh::weld::{weld, weld_within};

/// How far apart points may be that are one; not at all if none is given.
#[derive(Clone, Copy, Debug)]
pub struct Weld(f64);

/// The tolerance's largest and smallest share of the mesh's extent. Below that, points in one place alone are one.
const LARGEST: f64 = 0.01;
const SMALLEST: f64 = 1e-15;

impl Weld {
    /// The tolerance as given.
    pub fn new(tolerance: Option<f64>) -> Result<Self, Error> {
        let tolerance = finite("weld", tolerance.unwrap_or(0.0))?;
        if tolerance < 0.0 {
            return Err(Error::invalid("weld", format!("{tolerance} is below 0; a distance isn't")));
        }
        Ok(Self(tolerance))
    }

    /// Whether there is a tolerance.
    pub fn wanted(self) -> bool {
        self.0 > 0.0
    }

    /// Points in one place, or within the tolerance, become one; what has no extent afterwards and what is not used goes. A note
    /// tells how many. Returns which points remain.
    pub fn kept<const D: usize, const N: usize>(
        self,
        points: &[Vector64<D>],
        simplices: Vec<[u32; N]>,
        notes: &mut Vec<String>,
    ) -> Result<(Vec<u32>, Vec<[u32; N]>), Error> {
        let low = points.iter().fold(Vector64::repeat(f64::INFINITY), |low: Vector64<D>, p| low.inf(p));
        let high = points.iter().fold(Vector64::repeat(f64::NEG_INFINITY), |high: Vector64<D>, p| high.sup(p));
        let extent = if points.is_empty() { 0.0 } else { (high - low).amax() };
        if self.0 > LARGEST * extent {
            let message = format!(
                "{} is more than a hundredth of the mesh's extent, {extent}: it would merge what is apart; give less (in the \
                 file's units)",
                self.0
            );
            return Err(Error::invalid("weld", message));
        }
        let before = (points.len(), simplices.len());
        // Whatever is below a last digit merges only what is in one place.
        let (kept, simplices) = weld_within(points, simplices, self.0.max(SMALLEST * extent).max(f64::MIN_POSITIVE));
        let (points, flat) = (before.0 - kept.len(), before.1 - simplices.len());
        if points > 0 {
            let left_out = match flat {
                0 => String::new(),
                1 => "; 1 simplex without extent is left out".to_owned(),
                _ => format!("; {flat} simplices without extent are left out"),
            };
            notes.push(format!("weld: {points} points became one with others, or belong to nothing{left_out}"));
        }
        Ok((kept, simplices))
    }

    /// The same, with the points; without a tolerance as every mesh is welded, and without a word.
    pub fn apply<const N: usize>(
        self,
        points: &[Vector64<3>],
        simplices: Vec<[u32; N]>,
        notes: &mut Vec<String>,
    ) -> Result<(Vec<Vector64<3>>, Vec<[u32; N]>), Error> {
        if !self.wanted() {
            return Ok(weld(points, simplices));
        }
        let (kept, simplices) = self.kept(points, simplices, notes)?;
        Ok((kept.into_iter().map(|i| points[i as usize]).collect(), simplices))
    }
}
