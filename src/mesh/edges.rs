//! Edges for wireframes: those of polytopes, and of any surface where it creases.
//!
//! A *ridge* is a facet of simplices (an edge in 3D, a triangle in 4D) where the surface bends: its two simplices' normals
//! differ by more than an angle; or where the surface ends, or more than two simplices meet. In 3D the ridges are the
//! feature edges. In 4D they make up surfaces, such as the squares of a tesseract, and the feature edges are where such a
//! surface bends in its turn by more than the angle, ends, or meets others: the 32 edges of the tesseract, and not the
//! diagonals that cut its squares into triangles. A smooth body has no feature edges, and one with a smooth ridge, as a
//! duocylinder, has none either.
//!
//! Vertices are told apart by their coordinates, within one object.

use std::collections::HashMap;

use super::Mesh;
use super::facets::{Corners, has_double, sorted_facets};
use crate::geometry::{Dimension, Vector64, normal_of, widen};

/// Which edges are shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Edges {
    /// Where the surface bends by more than this angle, in degrees.
    Feature(f64),
    /// All edges of all simplices.
    All,
}

/// An edge of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// Its vertices, the first of each place.
    pub ends: [u32; 2],
    /// The object, from 0.
    pub object: u32,
}

/// The edges of a mesh, object by object.
pub fn edges<const D: usize>(mesh: &Mesh<D>, which: Edges) -> Vec<Edge> {
    let mut found = Vec::new();
    for (index, object) in mesh.objects.iter().enumerate() {
        let mut first: HashMap<u32, u32> = HashMap::with_capacity(object.vertices.len());
        for v in object.vertices.clone() {
            first.entry(mesh.identity[v]).or_insert(v as u32);
        }
        let numbers = object.simplices.clone();
        let welded: Vec<[u32; D]> =
            mesh.simplices[numbers.clone()].iter().map(|s| s.map(|v| first[&mesh.identity[v as usize]])).collect();
        let pairs = match which {
            Edges::All => all(&welded),
            Edges::Feature(degrees) => {
                // Coordinates are single precision: angles that are equal but for their rounding are equal.
                let cosine = libm::cos(degrees.to_radians()) - 1e-6;
                let normals: Vec<Vector64<D>> = (numbers.zip(&welded))
                    .map(|(s, simplex)| match mesh.degenerate.binary_search(&(s as u32)) {
                        Ok(_) => Vector64::zeros(),
                        Err(_) => unit(normal_of(&simplex.map(|v| widen(&mesh.vertices[v as usize])))),
                    })
                    .collect();
                let ridges = ridges(&welded, &normals, cosine);
                match Dimension::of::<D>() {
                    Dimension::Three => ridges.into_iter().map(|[a, b, _]| [a, b]).collect(),
                    Dimension::Four => bends(mesh, &ridges, cosine),
                }
            }
        };
        found.extend(pairs.into_iter().map(|ends| Edge { ends, object: index as u32 }));
    }
    found
}

/// A vector at length 1; zero where it is.
fn unit<const D: usize>(v: Vector64<D>) -> Vector64<D> {
    v.try_normalize(0.0).unwrap_or_else(Vector64::zeros)
}

/// Every edge once.
fn all<const D: usize>(simplices: &[[u32; D]]) -> Vec<[u32; 2]> {
    let of_simplex = |simplex: &[u32; D]| {
        let pairs = (0..D).flat_map(|i| (0..i).map(move |j| (i, j)));
        pairs.map(|(i, j)| [simplex[i].min(simplex[j]), simplex[i].max(simplex[j])]).collect::<Vec<_>>()
    };
    let mut pairs: Vec<[u32; 2]> = simplices.iter().flat_map(of_simplex).filter(|[a, b]| a < b).collect();
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

/// The facets where the surface bends, ends or branches. What has no measure bends nothing.
fn ridges<const D: usize>(simplices: &[[u32; D]], normals: &[Vector64<D>], cosine: f64) -> Vec<Corners> {
    let facets = sorted_facets(simplices);
    let is_ridge = |shared: &&[super::facets::Facet]| match shared {
        [a, b] => {
            let [a, b] = [a, b].map(|facet| normals[facet.simplex as usize]);
            a.norm_squared() > 0.0 && b.norm_squared() > 0.0 && a.dot(&b) < cosine
        }
        // A simplex that names a vertex twice has no measure, nor a neighbour on every side.
        _ => shared.iter().any(|facet| !has_double(&simplices[facet.simplex as usize])),
    };
    facets.chunk_by(|a, b| a.corners == b.corners).filter(is_ridge).map(|shared| shared[0].corners).collect()
}

/// The edges where triangles in 4D don't go on in their own plane on the other side.
fn bends<const D: usize>(mesh: &Mesh<D>, triangles: &[Corners], cosine: f64) -> Vec<[u32; 2]> {
    // Each edge with the corner across from it.
    let mut sides: Vec<([u32; 2], u32)> =
        triangles.iter().flat_map(|&[a, b, c]| [([a, b], c), ([a, c], b), ([b, c], a)]).collect();
    sides.sort_unstable();
    let point = |v: u32| widen(&mesh.vertices[v as usize]);
    let bends = |shared: &&[([u32; 2], u32)]| match shared {
        [(ends, c), (_, d)] => {
            let along = unit(point(ends[1]) - point(ends[0]));
            let [c, d] = [c, d].map(|&apex| {
                let offset = point(apex) - point(ends[0]);
                unit(offset - along * along.dot(&offset))
            });
            c.norm_squared() > 0.0 && d.norm_squared() > 0.0 && -c.dot(&d) < cosine
        }
        _ => true,
    };
    sides.chunk_by(|a, b| a.0 == b.0).filter(bends).map(|shared| shared[0].0).collect()
}
