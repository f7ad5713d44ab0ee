//! Spheres: the cross-polytope's boundary, divided and projected.
//!
//! The points of the integer lattice with |x_1| + ... + |x_D| = n lie on the boundary of the cross-polytope (the
//! octahedron in 3D, the 16-cell in 4D) of size n, and divide each of its 2^D facets into n^(D-1) simplices of one
//! measure: with y_i = x_(i+1) + ... + x_D a facet is n >= y_1 >= ... >= y_(D-1) >= 0, which Kuhn's triangulation of the
//! unit cubes fits exactly. Facets that meet share the order of the axes and so the triangulation. Vertices are then
//! moved along their ray onto the sphere. 4D: 16 n^3 tetrahedra over (8 n^3 + 16 n) / 3 vertices; 3D: 8 n^2 triangles over
//! 4 n^2 + 2 vertices. Closed, facing outwards; n = 18 in 4D is the test scene of NTracer (93,312 tetrahedra).
//!
//! Made from the 600-cell instead (see [`super::polytope`]), the tetrahedra are closer to regular.

use std::collections::HashMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Error;
use super::numbers::{check_count, point, positive};
use super::polytope;
use crate::geometry::{Dimension, Vector64, determinant};
use crate::mesh::Surface;

/// A closed sphere made of flat simplices whose vertices lie on it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SphereSpec {
    /// The radius, above 0.
    pub radius: f64,
    /// The centre, one number an axis; the origin if left out.
    #[serde(default)]
    pub center: Option<Vec<f64>>,
    /// Pieces along every edge of the cross-polytope it is made from: 16 n^3 tetrahedra in 4D, 8 n^2 triangles in 3D.
    #[schemars(range(min = 1))]
    pub subdivisions: u32,
    /// What it is made from: the 16-cell (3D: the octahedron), if left out, or in 4D the 600-cell, which makes
    /// 600 n^3 tetrahedra of better and more equal shape.
    #[serde(default)]
    pub from: Base,
}

/// What a sphere is made from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Base {
    /// The cross-polytope: the 16-cell, in 3D the octahedron.
    #[default]
    #[serde(rename = "16-cell")]
    Cell16,
    /// The 600-cell.
    #[serde(rename = "600-cell")]
    Cell600,
}

impl SphereSpec {
    /// The sphere; `shape` is the key that asked for it.
    pub fn build<const D: usize>(&self, shape: &str) -> Result<Surface<D>, Error> {
        let radius = positive(&format!("{shape}.radius"), self.radius)?;
        let center = match &self.center {
            Some(center) => point(&format!("{shape}.center"), center)?,
            None => Vector64::zeros(),
        };
        let key = format!("{shape}.subdivisions");
        if self.subdivisions == 0 {
            return Err(Error::invalid(key, "0 subdivisions; the least is 1"));
        }
        let pieces = u128::from(self.subdivisions).pow(D as u32 - 1);
        let mut surface = match self.from {
            Base::Cell16 => {
                check_count(&key, (1 << D) * pieces)?;
                cross_polytope::<D>(self.subdivisions as i32)
            }
            Base::Cell600 => match Dimension::of::<D>() {
                Dimension::Three => {
                    let message = "a sphere of dimension 3 is made from 16-cell only";
                    return Err(Error::invalid(format!("{shape}.from"), message));
                }
                Dimension::Four => {
                    check_count(&key, 600 * pieces)?;
                    polytope::regular::<D>(polytope::Cells::Cell600, self.subdivisions)
                }
            },
        };
        for vertex in &mut surface.vertices {
            *vertex = center + *vertex * (radius / vertex.norm());
        }
        Ok(surface)
    }
}

/// The boundary of the cross-polytope of size n, over the points of the integer lattice.
fn cross_polytope<const D: usize>(n: i32) -> Surface<D> {
    let mut surface = Surface::default();
    let mut indices: HashMap<[i32; D], u32> = HashMap::new();
    let facet = standard_facet::<D>(n);
    for orthant in 0..1 << D {
        for simplex in &facet {
            let points = simplex.map(|x| std::array::from_fn(|i| if orthant >> i & 1 == 1 { -x[i] } else { x[i] }));
            let mut corners = points.map(|x: [i32; D]| {
                *indices.entry(x).or_insert_with(|| {
                    surface.vertices.push(Vector64::from_column_slice(&x.map(f64::from)));
                    (surface.vertices.len() - 1) as u32
                })
            });
            // Seen from the centre, det[v_0, ..., v_(D-1)] is positive where the normal points away; small integers
            // make it exact.
            if determinant(&points.map(|x| Vector64::from_column_slice(&x.map(f64::from)))) < 0.0 {
                corners.swap(D - 2, D - 1);
            }
            surface.simplices.push(corners);
        }
    }
    surface
}

/// The facet x >= 0, sum x = n, in n^(D-1) simplices.
pub(super) fn standard_facet<const D: usize>(n: i32) -> Vec<[[i32; D]; D]> {
    let mut simplices = Vec::new();
    let mut corner = [0; D];
    // Only the first D - 1 entries of `corner` and of an order are used: y_1 to y_(D-1).
    loop {
        for order in orders::<D>() {
            let mut y = corner;
            let path: [[i32; D]; D] = std::array::from_fn(|step| {
                if step > 0 {
                    y[order[step - 1]] += 1;
                }
                y
            });
            let within = |y: &[i32; D]| y[0] <= n && y[..D - 1].windows(2).all(|pair| pair[0] >= pair[1]);
            if path.iter().all(within) {
                simplices.push(path.map(|y| {
                    let above = |i: usize| if i == 0 { n } else { y[i - 1] };
                    std::array::from_fn(|i| above(i) - if i < D - 1 { y[i] } else { 0 })
                }));
            }
        }
        // The next corner with y_1 >= y_2 >= ..., the last entry running fastest.
        let Some(axis) =
            (0..D - 1).rev().find(|&axis| corner[axis] + 1 < if axis == 0 { n } else { corner[axis - 1] + 1 })
        else {
            return simplices;
        };
        corner[axis] += 1;
        corner[axis + 1..].fill(0);
    }
}

/// The orders of the first D - 1 axes.
fn orders<const D: usize>() -> Vec<[usize; D]> {
    let mut found = Vec::new();
    for code in 0..D.pow(D as u32 - 1) {
        let order: [usize; D] = std::array::from_fn(|i| code / D.pow(i as u32) % D);
        let distinct = (0..D - 1).all(|i| order[i] < D - 1 && !order[..i].contains(&order[i]));
        if distinct {
            found.push(order);
        }
    }
    found
}
