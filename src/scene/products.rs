//! Products of two solids: duoprisms, duocylinders, spherinders and cubinders.
//!
//! The boundary comes from the one formula in [`super::product`]; here are only the factors, and where their pairs of points
//! lie: the first factor's coordinates come first, then the second's. What is round is made of flat pieces whose outermost points
//! lie on it, so that volumes fall short by an amount that goes with the square of the subdivisions.
//!
//! | body | factors | 3-volume | 4-volume |
//! | --- | --- | --- | --- |
//! | duoprism | polygon in xy, polygon in zw | P_1 A_2 + A_1 P_2 | A_1 A_2 |
//! | duocylinder | disc in xy, disc in zw | 2 pi^2 a b (a + b) | pi^2 a^2 b^2 |
//! | spherinder | ball in xyz, interval in w | 4 pi r^2 h + 8 pi r^3 / 3 | 4 pi r^3 h / 3 |
//! | cubinder | disc in xy, rectangle in zw | 2 pi r s t + 2 pi r^2 (s + t) | pi r^2 s t |

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Error;
use super::disc::{ball, disc};
use super::lattice::compact;
use super::numbers::{check_count, only_in, positive};
use super::product::Chain;
use crate::geometry::{Dimension, Vector64};
use crate::mesh::Surface;

/// Corners of the polygons whose sectors discs are made of.
const SECTORS: u32 = 6;

/// The product of two regular polygons, in xy and in zw.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DuoprismSpec {
    /// The corners of the polygons, 3 at least.
    pub sides: [u32; 2],
    /// The distances of their corners from the middle; 1 each if left out.
    #[serde(default = "unit")]
    pub radii: [f64; 2],
    /// Pieces along every edge; 1 if left out.
    #[serde(default = "one")]
    #[schemars(range(min = 1))]
    pub subdivisions: u32,
}

/// The product of two discs, in xy and in zw.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DuocylinderSpec {
    /// The radii of the discs; 1 each if left out.
    #[serde(default = "unit")]
    pub radii: [f64; 2],
    /// Rings of each disc; the outermost has six times as many edges.
    #[schemars(range(min = 1))]
    pub subdivisions: u32,
}

/// The product of a ball in xyz and an interval in w.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpherinderSpec {
    /// The radius of the ball.
    pub radius: f64,
    /// The length of the interval, around 0.
    pub height: f64,
    /// Shells of the ball.
    #[schemars(range(min = 1))]
    pub subdivisions: u32,
    /// Pieces of the interval; 1 if left out.
    #[serde(default = "one")]
    #[schemars(range(min = 1))]
    pub layers: u32,
}

/// The product of a disc in xy and a rectangle in zw.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CubinderSpec {
    /// The radius of the disc.
    pub radius: f64,
    /// The sides of the rectangle, around 0.
    pub sides: [f64; 2],
    /// Rings of the disc, and pieces along the sides of the rectangle.
    #[schemars(range(min = 1))]
    pub subdivisions: u32,
}

fn unit() -> [f64; 2] {
    [1.0; 2]
}

fn one() -> u32 {
    1
}

/// Refuses other dimensions than 4, and subdivisions that are none or too many.
fn check<const D: usize>(shape: &str, key: &str, subdivisions: u32) -> Result<(), Error> {
    only_in::<D>(Dimension::Four, shape, "")?;
    let path = format!("{shape}.{key}");
    match subdivisions {
        0 => Err(Error::invalid(path, format!("0 {key}; the least is 1"))),
        // Beyond this the simplices' number would not fit into what it is counted in.
        1..=10_000 => Ok(()),
        _ => Err(Error::invalid(path, format!("{subdivisions} is too many; the most is 10000"))),
    }
}

impl DuoprismSpec {
    /// The duoprism's boundary; refused in 3D.
    pub fn build<const D: usize>(&self) -> Result<Surface<D>, Error> {
        check::<D>("duoprism", "subdivisions", self.subdivisions)?;
        if let Some(sides) = self.sides.iter().find(|sides| !(3..=100_000).contains(*sides)) {
            return Err(Error::invalid("duoprism.sides", format!("{sides} is not from 3 to 100000")));
        }
        let rings = u128::from(self.subdivisions);
        let triangles = |sides: u32| if rings == 1 { u128::from(sides) - 2 } else { u128::from(sides) * rings * rings };
        let [p, q] = self.sides;
        let rims = [u128::from(p) * rings, u128::from(q) * rings];
        check_count("duoprism.subdivisions", 3 * (rims[0] * triangles(q) + rims[1] * triangles(p)))?;
        let [a, b] = self.radii;
        let a = disc(p, self.subdivisions, positive("duoprism.radii", a)?, false);
        let b = disc(q, self.subdivisions, positive("duoprism.radii", b)?, false);
        product("duoprism.subdivisions", &a, &b)
    }
}

impl DuocylinderSpec {
    /// The duocylinder's boundary; refused in 3D.
    pub fn build<const D: usize>(&self) -> Result<Surface<D>, Error> {
        check::<D>("duocylinder", "subdivisions", self.subdivisions)?;
        let n = u128::from(self.subdivisions);
        let sectors = u128::from(SECTORS);
        check_count("duocylinder.subdivisions", 6 * sectors * n * sectors * n * n)?;
        let [a, b] = self.radii;
        let a = disc(SECTORS, self.subdivisions, positive("duocylinder.radii", a)?, true);
        let b = disc(SECTORS, self.subdivisions, positive("duocylinder.radii", b)?, true);
        product("duocylinder.subdivisions", &a, &b)
    }
}

impl SpherinderSpec {
    /// The spherinder's boundary; refused in 3D.
    pub fn build<const D: usize>(&self) -> Result<Surface<D>, Error> {
        check::<D>("spherinder", "subdivisions", self.subdivisions)?;
        check::<D>("spherinder", "layers", self.layers)?;
        let (radius, height) =
            (positive("spherinder.radius", self.radius)?, positive("spherinder.height", self.height)?);
        let n = u128::from(self.subdivisions);
        check_count("spherinder.subdivisions", 16 * n * n * n + 24 * n * n * u128::from(self.layers))?;
        product("spherinder.subdivisions", &ball(self.subdivisions, radius), &interval(height, self.layers))
    }
}

impl CubinderSpec {
    /// The cubinder's boundary; refused in 3D.
    pub fn build<const D: usize>(&self) -> Result<Surface<D>, Error> {
        check::<D>("cubinder", "subdivisions", self.subdivisions)?;
        let n = u128::from(self.subdivisions);
        check_count("cubinder.subdivisions", 3 * u128::from(SECTORS) * (2 * n * n * n + 4 * n * n * n))?;
        let disc = disc(SECTORS, self.subdivisions, positive("cubinder.radius", self.radius)?, true);
        let [s, t] = self.sides;
        let (s, ss) = interval(positive("cubinder.sides", s)?, self.subdivisions);
        let (t, tt) = interval(positive("cubinder.sides", t)?, self.subdivisions);
        let points = ss.iter().flat_map(|a| tt.iter().map(|b| Vector64::<2>::new(a[0], b[0]))).collect();
        product("cubinder.subdivisions", &disc, &(s.times(&t), points))
    }
}

/// An interval around 0.
fn interval(length: f64, pieces: u32) -> (Chain, Vec<Vector64<1>>) {
    let place = |i: u32| Vector64::<1>::new(length * (f64::from(i) / f64::from(pieces) - 0.5));
    (Chain::interval(pieces), (0..=pieces).map(place).collect())
}

/// The boundary of the product of two solids of P and Q dimensions, where P + Q = D.
fn product<const P: usize, const Q: usize, const D: usize>(
    key: &str,
    a: &(Chain, Vec<Vector64<P>>),
    b: &(Chain, Vec<Vector64<Q>>),
) -> Result<Surface<D>, Error> {
    if a.1.len() as u64 * b.1.len() as u64 > u64::from(u32::MAX) {
        return Err(Error::invalid(key, "too many: there would be more than 2^32 pairs of points"));
    }
    let (used, simplices) = compact(a.0.boundary_of_product(&b.0).oriented::<D>());
    let place = |pair: u32| {
        let (first, second) = (pair as usize / b.1.len(), pair as usize % b.1.len());
        Vector64::from_fn(|axis, _| if axis < P { a.1[first][axis] } else { b.1[second][axis - P] })
    };
    Ok(Surface { vertices: used.into_iter().map(place).collect(), simplices, normals: None })
}
