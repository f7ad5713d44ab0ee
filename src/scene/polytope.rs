//! The six regular polytopes of R^4; in R^3 the polyhedra of `polyhedron`.
//!
//! Each is given by its vertices and by the directions of its cells: a cell's vertices are those that lie furthest along
//! its direction. Polytopes come in dual pairs, whose cells are in the directions of the other's vertices: 8 and 16, 120
//! and 600; the 5-cell and the 24-cell are their own duals. The 600 cells of the 600-cell are the sets of four
//! vertices that are all neighbours, and their middles are the vertices of the 120-cell.
//!
//! Two cells that share three vertices or more share a face. A face is cut into triangles from its lowest vertex, a cell
//! into tetrahedra from its lowest vertex over the faces that don't have it ("pulling"), so that neighbours agree:
//!
//! | cells | vertices, edges, faces | tetrahedra | 3-volume | 4-volume, edges of length 1 |
//! | --- | --- | --- | --- | --- |
//! | 5 | 5, 10, 10 | 5 | 5 sqrt2 / 12 | sqrt5 / 96 |
//! | 8 | 16, 32, 24 | 48 | 8 | 1 |
//! | 16 | 8, 24, 32 | 16 | 4 sqrt2 / 3 | 1/6 |
//! | 24 | 24, 96, 96 | 96 | 8 sqrt2 | 2 |
//! | 120 | 600, 1200, 720 | 3240 | 30 (15 + 7 sqrt5) | 15 (105 + 47 sqrt5) / 4 |
//! | 600 | 120, 720, 1200 | 600 | 50 sqrt2 | 25 (2 + sqrt5) / 4 |
//!
//! With n subdivisions each tetrahedron becomes n^3, along the order of its vertices (edgewise subdivision, Edelsbrunner
//! and Grayson 2000).

use std::collections::HashMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Error;
use super::hypersphere::standard_facet;
use super::numbers::{check_count, positive};
use super::polyhedron::Faces;
use crate::geometry::{Dimension, Vector64, determinant};
use crate::mesh::Surface;

/// How much shorter two lengths may be and still count as the same; all lengths here are near 1.
const SAME: f64 = 1e-9;

/// A regular polytope around the origin; in 3D a regular polyhedron or the cuboctahedron.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PolytopeSpec {
    /// The number of its cells: 5, 8, 16, 24, 120 or 600; in 3D that of its faces: 4, 6, 8, 12, 14 or 20.
    pub cells: u32,
    /// The length of its edges; if left out, such that its vertices are 1 away from the origin.
    #[serde(default)]
    pub size: Option<f64>,
    /// Pieces along every edge; 1 if left out. Occlusion is computed at vertices, so that what it resolves depends on this.
    #[serde(default = "one")]
    #[schemars(range(min = 1))]
    pub subdivisions: u32,
}

fn one() -> u32 {
    1
}

/// Which polytope, by the number of its cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Cells {
    Cell5,
    Cell8,
    Cell16,
    Cell24,
    Cell120,
    Cell600,
}

impl Cells {
    /// The polytope with so many cells.
    pub fn of(count: u32) -> Option<Self> {
        Some(match count {
            5 => Self::Cell5,
            8 => Self::Cell8,
            16 => Self::Cell16,
            24 => Self::Cell24,
            120 => Self::Cell120,
            600 => Self::Cell600,
            _ => return None,
        })
    }

    /// The tetrahedra that its cells are cut into.
    fn tetrahedra(self) -> u128 {
        match self {
            Self::Cell5 => 5,
            Self::Cell8 => 48,
            Self::Cell16 => 16,
            Self::Cell24 => 96,
            Self::Cell120 => 3240,
            Self::Cell600 => 600,
        }
    }
}

impl PolytopeSpec {
    /// The polytope's boundary.
    pub fn build<const D: usize>(&self) -> Result<Surface<D>, Error> {
        let key = "polytope.subdivisions";
        if self.subdivisions == 0 {
            return Err(Error::invalid(key, "0 subdivisions; the least is 1"));
        }
        let pieces = u128::from(self.subdivisions).pow(D as u32 - 1);
        let size = self.size.map(|size| positive("polytope.size", size)).transpose()?;
        let none = |kind: &str, all: &str| {
            let message = format!("there is none of {} {kind}; the six have {all}", self.cells);
            Error::invalid("polytope.cells", message)
        };
        let (mut surface, edge) = match Dimension::of::<D>() {
            Dimension::Three => {
                let faces = Faces::of(self.cells).ok_or_else(|| none("faces", "4, 6, 8, 12, 14 and 20"))?;
                check_count(key, faces.triangles() * pieces)?;
                let (surface, edge) = faces.surface();
                let vertices = surface.vertices.iter().map(|point| Vector64::from_fn(|axis, _| point[axis])).collect();
                let simplices = surface.simplices.iter().map(|corners| std::array::from_fn(|i| corners[i])).collect();
                (subdivide(&Surface { vertices, simplices, normals: None }, self.subdivisions), edge)
            }
            Dimension::Four => {
                let cells = Cells::of(self.cells).ok_or_else(|| none("cells", "5, 8, 16, 24, 120 and 600"))?;
                check_count(key, cells.tetrahedra() * pieces)?;
                (regular::<D>(cells, self.subdivisions), edge_length(&vertices(cells)))
            }
        };
        if let Some(size) = size {
            surface.vertices.iter_mut().for_each(|vertex| *vertex *= size / edge);
        }
        Ok(surface)
    }
}

/// The polytope with vertices 1 away from the origin, `pieces` along every edge. D is 4.
pub fn regular<const D: usize>(cells: Cells, pieces: u32) -> Surface<D> {
    let points = vertices(cells);
    let tetrahedra = cut(&points, &directions(cells));
    let vertices = points.iter().map(|point| Vector64::from_fn(|axis, _| point[axis])).collect();
    let simplices = tetrahedra.iter().map(|corners| std::array::from_fn(|i| corners[i])).collect();
    subdivide(&Surface { vertices, simplices, normals: None }, pieces)
}

type Point = Vector64<4>;

/// Unit vectors.
fn vertices(cells: Cells) -> Vec<Point> {
    let points: Vec<Point> = match cells {
        Cells::Cell5 => {
            let base = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]];
            let height = 1.0 / 5f64.sqrt();
            let lower = base.map(|p| Point::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]), -height));
            lower.into_iter().chain([Point::new(0.0, 0.0, 0.0, 4.0 * height)]).collect()
        }
        Cells::Cell8 => signs([1.0; 4]),
        Cells::Cell16 => axes(),
        Cells::Cell24 => {
            let pairs = (0..4).flat_map(|i| (0..i).map(move |j| (i, j)));
            let pair = |(i, j)| signs(std::array::from_fn(|axis| if axis == i || axis == j { 1.0 } else { 0.0 }));
            pairs.flat_map(pair).collect()
        }
        Cells::Cell600 => {
            let golden = (1.0 + 5f64.sqrt()) / 2.0;
            let entries = [golden / 2.0, 0.5, 0.5 / golden, 0.0];
            let even = |order: &[usize; 4]| {
                let inversions = (0..4).flat_map(|i| (0..i).map(move |j| (i, j))).filter(|&(i, j)| order[j] > order[i]);
                inversions.count() % 2 == 0 && (0..4).all(|axis| order.contains(&axis))
            };
            let orders = (0..256).map(|code| std::array::from_fn(|i| code >> (2 * i) & 3)).filter(even);
            let snub = orders.flat_map(|order: [usize; 4]| signs(order.map(|i| entries[i])));
            axes().into_iter().chain(signs([0.5; 4])).chain(snub).collect()
        }
        Cells::Cell120 => directions(Cells::Cell600),
    };
    points.into_iter().map(|point| point.normalize()).collect()
}

/// Where the cells are.
fn directions(cells: Cells) -> Vec<Point> {
    match cells {
        Cells::Cell5 => vertices(cells).into_iter().map(|point| -point).collect(),
        Cells::Cell8 => vertices(Cells::Cell16),
        Cells::Cell16 => vertices(Cells::Cell8),
        Cells::Cell24 => axes().into_iter().chain(signs([0.5; 4])).collect(),
        Cells::Cell120 => vertices(Cells::Cell600),
        Cells::Cell600 => {
            let points = vertices(cells);
            let near = neighbours(&points);
            let mut middles = Vec::new();
            for a in 0..points.len() {
                for &b in near[a].iter().filter(|&&b| b > a) {
                    for &c in near[b].iter().filter(|&&c| c > b && near[a].contains(&c)) {
                        for &d in near[c].iter().filter(|d| **d > c && near[a].contains(d) && near[b].contains(d)) {
                            middles.push((points[a] + points[b] + points[c] + points[d]).normalize());
                        }
                    }
                }
            }
            middles
        }
    }
}

/// The points on the axes, 1 away from the origin.
fn axes() -> Vec<Point> {
    (0..4).flat_map(|axis| signs(std::array::from_fn(|i| f64::from(u8::from(i == axis))))).collect()
}

/// The point with all signs of those coordinates that are not 0.
fn signs(point: [f64; 4]) -> Vec<Point> {
    let some = |bits: &u32| (0..4).all(|axis| bits >> axis & 1 == 0 || point[axis] != 0.0);
    let signed = |bits: u32| Point::from_fn(|axis, _| if bits >> axis & 1 == 1 { -point[axis] } else { point[axis] });
    (0..16).filter(some).map(signed).collect()
}

fn edge_length(points: &[Point]) -> f64 {
    points[1..].iter().map(|point| (point - points[0]).norm()).fold(f64::INFINITY, f64::min)
}

/// The vertices at the other ends of each vertex's edges, ascending.
fn neighbours(points: &[Point]) -> Vec<Vec<usize>> {
    let edge = edge_length(points) + SAME;
    let near = |a: usize| (0..points.len()).filter(move |&b| b != a && (points[a] - points[b]).norm() < edge);
    (0..points.len()).map(|a| near(a).collect()).collect()
}

/// Cuts the boundary into tetrahedra that face outwards.
fn cut(points: &[Point], directions: &[Point]) -> Vec<[u32; 4]> {
    let near = neighbours(points);
    let cells: Vec<Vec<usize>> = directions
        .iter()
        .map(|direction| {
            let height = |i: usize| points[i].dot(direction);
            let top = (0..points.len()).map(height).fold(f64::NEG_INFINITY, f64::max);
            (0..points.len()).filter(|&i| height(i) > top - SAME).collect()
        })
        .collect();
    let mut tetrahedra = Vec::new();
    for cell in &cells {
        for other in &cells {
            let face: Vec<usize> = cell.iter().copied().filter(|vertex| other.contains(vertex)).collect();
            if face.len() < 3 || face.len() == cell.len() || face.contains(&cell[0]) {
                continue;
            }
            let edges = face[1..].iter().flat_map(|&a| near[a].iter().filter(move |&&b| b > a).map(move |&b| (a, b)));
            for (a, b) in edges.filter(|(_, b)| face.contains(b)) {
                let mut tetrahedron = [cell[0], face[0], a, b];
                if determinant(&tetrahedron.map(|i| points[i])) < 0.0 {
                    tetrahedron.swap(2, 3);
                }
                tetrahedra.push(tetrahedron.map(|i| i as u32));
            }
        }
    }
    tetrahedra
}

/// Cuts every simplex into n^(D-1), which share their corners.
fn subdivide<const D: usize>(surface: &Surface<D>, n: u32) -> Surface<D> {
    if n == 1 {
        return surface.clone();
    }
    let pattern = standard_facet::<D>(n as i32);
    let mut divided = Surface::default();
    // A point is the sum of corners so many n-ths each, told by those that it has a part of, in ascending order.
    let mut indices: HashMap<[(u32, i32); D], u32> = HashMap::new();
    for simplex in &surface.simplices {
        let mut sorted = *simplex;
        let odd = crate::mesh::facets::sort_with_parity(&mut sorted);
        let corners = sorted.map(|i| surface.vertices[i as usize]);
        for piece in &pattern {
            let mut vertices = piece.map(|parts| {
                let mut key = [(u32::MAX, 0); D];
                let present = (0..D).filter(|&i| parts[i] != 0);
                key.iter_mut().zip(present).for_each(|(slot, i)| *slot = (sorted[i], parts[i]));
                *indices.entry(key).or_insert_with(|| {
                    let point: Vector64<D> = (0..D).map(|i| corners[i] * f64::from(parts[i])).sum();
                    divided.vertices.push(point / f64::from(n));
                    (divided.vertices.len() - 1) as u32
                })
            });
            // The piece has the tetrahedron's orientation if its barycentric coordinates do.
            let turned = determinant(&piece.map(|parts| Vector64::from(parts.map(f64::from)))) < 0.0;
            if turned != odd {
                vertices.swap(D - 2, D - 1);
            }
            divided.simplices.push(vertices);
        }
    }
    divided
}
