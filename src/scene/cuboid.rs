//! Boxes and tesseracts: the boundary of a product of divided intervals.
//!
//! With n pieces along every edge a tesseract has 8 cubes of n^3 pieces of 6 tetrahedra, 48 n^3 in all, over
//! 8 n^3 + 8 n vertices; a box in 3D has 12 n^2 triangles over 6 n^2 + 2 vertices. Vertices are shared, the surface is
//! closed and faces outwards.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Error;
use super::lattice::Lattice;
use super::numbers::{OneOrEach, bounds, check_count, only_in, positive, subdivisions};
use super::product::Chain;
use crate::geometry::{Dimension, Vector64};
use crate::mesh::Surface;

fn one() -> OneOrEach<u32> {
    OneOrEach::One(1)
}

/// A closed axis-parallel box.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoxSpec {
    /// The lowest corner, one number an axis.
    pub min: Vec<f64>,
    /// The highest corner, one number an axis.
    pub max: Vec<f64>,
    /// Pieces along every edge, or a list with one number an axis; 1 if left out. Occlusion is computed at vertices, so
    /// that what it resolves depends on this.
    #[serde(default = "one")]
    pub subdivisions: OneOrEach<u32>,
}

impl BoxSpec {
    /// The box's boundary.
    pub fn build<const D: usize>(&self) -> Result<Surface<D>, Error> {
        let (min, max) = bounds("box", ("min", &self.min), ("max", &self.max))?;
        cuboid(&min, &max, subdivisions("box.subdivisions", &self.subdivisions)?, "box.subdivisions")
    }
}

/// The boundary of the 4-cube around the origin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TesseractSpec {
    /// Pieces along every edge; 1 if left out. Makes 48 n^3 tetrahedra.
    #[serde(default = "one_piece")]
    #[schemars(range(min = 1))]
    pub subdivisions: u32,
    /// Length of the edges; 2 if left out.
    #[serde(default = "two")]
    pub size: f64,
}

fn one_piece() -> u32 {
    1
}

fn two() -> f64 {
    2.0
}

impl TesseractSpec {
    /// The tesseract's boundary; refused in 3D.
    pub fn build<const D: usize>(&self) -> Result<Surface<D>, Error> {
        only_in::<D>(Dimension::Four, "tesseract", "; take a box")?;
        let half = positive("tesseract.size", self.size)? / 2.0;
        let pieces = subdivisions("tesseract.subdivisions", &OneOrEach::One(self.subdivisions))?;
        let corner = Vector64::from_element(half);
        cuboid(&-corner, &corner, pieces, "tesseract.subdivisions")
    }
}

fn cuboid<const D: usize>(
    min: &Vector64<D>,
    max: &Vector64<D>,
    pieces: [u32; D],
    key: &str,
) -> Result<Surface<D>, Error> {
    // Two opposite facets for each axis, each of as many pieces as the other axes make, each piece of (D-1)! simplices.
    let others = |axis| (0..D).filter(|&a| a != axis).map(|a| u128::from(pieces[a])).product::<u128>();
    check_count(key, (0..D).map(|axis| 2 * others(axis) * u128::from(Dimension::of::<D>().simplices_a_cube())).sum())?;
    let lattice_points: u128 = pieces.iter().map(|&n| u128::from(n) + 1).product();
    if lattice_points > u128::from(u32::MAX) {
        return Err(Error::invalid(key, "too many pieces: the lattice they form has more than 2^32 points"));
    }
    let mut body = Chain::interval(pieces[0]);
    for &n in &pieces[1..D - 1] {
        body = body.times(&Chain::interval(n));
    }
    let boundary = body.boundary_of_product(&Chain::interval(pieces[D - 1]));
    Ok(Lattice::even(min, max, pieces).surface(boundary.oriented()))
}
