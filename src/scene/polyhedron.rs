//! The five regular polyhedra of R^3 and the cuboctahedron: the siblings of the polytopes of R^4.
//!
//! As there, each is given by its vertices and by the directions of its faces: a face's vertices are those that lie
//! furthest along its direction. A face is cut into triangles from its first vertex, in the order in which they go round.
//!
//! | faces | name | vertices, edges | sibling in R^4 |
//! | --- | --- | --- | --- |
//! | 4 | tetrahedron | 4, 6 | 5-cell |
//! | 6 | cube | 8, 12 | 8-cell |
//! | 8 | octahedron | 6, 12 | 16-cell |
//! | 12 | dodecahedron | 20, 30 | 120-cell |
//! | 14 | cuboctahedron | 12, 24 | 24-cell, which has no regular one: its section through the middle |
//! | 20 | icosahedron | 12, 30 | 600-cell |

use crate::geometry::{Vector64, determinant};
use crate::mesh::Surface;

/// How much shorter two lengths may be and still count as the same; all lengths here are near 1.
const SAME: f64 = 1e-9;

type Point = Vector64<3>;

/// Which polyhedron, by the number of its faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Faces {
    /// A tetrahedron.
    Four,
    /// A cube.
    Six,
    /// An octahedron.
    Eight,
    /// A dodecahedron.
    Twelve,
    /// A cuboctahedron.
    Fourteen,
    /// An icosahedron.
    Twenty,
}

impl Faces {
    /// The polyhedron with so many faces.
    pub fn of(count: u32) -> Option<Self> {
        Some(match count {
            4 => Self::Four,
            6 => Self::Six,
            8 => Self::Eight,
            12 => Self::Twelve,
            14 => Self::Fourteen,
            20 => Self::Twenty,
            _ => return None,
        })
    }

    /// The triangles that its faces are cut into.
    pub fn triangles(self) -> u128 {
        match self {
            Self::Four => 4,
            Self::Six => 12,
            Self::Eight => 8,
            Self::Twelve => 36,
            Self::Fourteen => 20,
            Self::Twenty => 20,
        }
    }

    /// Unit vectors.
    fn vertices(self) -> Vec<Point> {
        let golden = (1.0 + 5f64.sqrt()) / 2.0;
        let points: Vec<Point> = match self {
            Self::Four => vec![[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]]
                .into_iter()
                .map(Point::from)
                .collect(),
            Self::Six => signs([1.0; 3]),
            Self::Eight => around([1.0, 0.0, 0.0]),
            Self::Twelve => signs([1.0; 3]).into_iter().chain(around([0.0, 1.0 / golden, golden])).collect(),
            Self::Fourteen => around([0.0, 1.0, 1.0]),
            Self::Twenty => around([0.0, golden, 1.0]),
        };
        points.into_iter().map(|point| point.normalize()).collect()
    }

    /// Where the faces are.
    fn directions(self) -> Vec<Point> {
        match self {
            Self::Four => self.vertices().into_iter().map(|point| -point).collect(),
            Self::Six => Self::Eight.vertices(),
            Self::Eight => Self::Six.vertices(),
            Self::Twelve => Self::Twenty.vertices(),
            Self::Fourteen => Self::Eight.vertices().into_iter().chain(Self::Six.vertices()).collect(),
            Self::Twenty => Self::Twelve.vertices(),
        }
    }

    /// The polyhedron with vertices 1 away from the origin, not subdivided; and the length of its edges.
    pub fn surface(self) -> (Surface<3>, f64) {
        let vertices = self.vertices();
        let mut simplices = Vec::with_capacity(self.triangles() as usize);
        for direction in self.directions() {
            let height = |i: u32| vertices[i as usize].dot(&direction);
            let top = (0..vertices.len() as u32).map(height).fold(f64::NEG_INFINITY, f64::max);
            let mut face: Vec<u32> = (0..vertices.len() as u32).filter(|&i| height(i) > top - SAME).collect();
            // Seen from outside, each is followed by the one next to its left.
            let point = |i: u32| vertices[i as usize];
            let first = face[0];
            let side = |a: u32, b: u32| determinant(&[point(first), point(a), point(b)]);
            face[1..].sort_by(|&a, &b| side(b, a).total_cmp(&side(a, b)));
            simplices.extend((1..face.len() - 1).map(|i| [first, face[i], face[i + 1]]));
        }
        let edge = vertices[1..].iter().map(|point| (point - vertices[0]).norm()).fold(f64::INFINITY, f64::min);
        (Surface { vertices, simplices, normals: None }, edge)
    }
}

/// The point with all signs of those coordinates that are not 0.
fn signs(point: [f64; 3]) -> Vec<Point> {
    let some = |bits: &u32| (0..3).all(|axis| bits >> axis & 1 == 0 || point[axis] != 0.0);
    let signed = |bits: u32| Point::from_fn(|axis, _| if bits >> axis & 1 == 1 { -point[axis] } else { point[axis] });
    (0..8).filter(some).map(signed).collect()
}

/// The same with the coordinates moved on by one axis and by two.
fn around([x, y, z]: [f64; 3]) -> Vec<Point> {
    [[x, y, z], [z, x, y], [y, z, x]].into_iter().flat_map(signs).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_are_closed_and_have_the_volume_they_should() {
        let (root2, root5) = (2f64.sqrt(), 5f64.sqrt());
        for (faces, vertices, volume) in [
            (4, 4, root2 / 12.0),
            (6, 8, 1.0),
            (8, 6, root2 / 3.0),
            (12, 20, (15.0 + 7.0 * root5) / 4.0),
            (14, 12, 5.0 * root2 / 3.0),
            (20, 12, 5.0 * (3.0 + root5) / 12.0),
        ] {
            let polyhedron = Faces::of(faces).unwrap();
            let (surface, edge) = polyhedron.surface();
            assert_eq!((surface.vertices.len(), surface.simplices.len() as u128), (vertices, polyhedron.triangles()));
            let corners = |s: &[u32; 3]| s.map(|i| surface.vertices[i as usize]);
            let found: f64 = surface.simplices.iter().map(|s| determinant(&corners(s)) / 6.0).sum();
            assert!((found / edge.powi(3) - volume).abs() < 1e-12, "{faces}: {found}");
            // Every directed edge has its opposite.
            let edges: std::collections::BTreeSet<(u32, u32)> =
                surface.simplices.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).collect();
            assert_eq!(edges.len(), 3 * surface.simplices.len(), "{faces}");
            assert!(edges.iter().all(|&(a, b)| edges.contains(&(b, a))), "{faces}");
        }
        assert_eq!(Faces::of(7), None);
    }
}
