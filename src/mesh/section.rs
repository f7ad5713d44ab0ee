//! Cross-sections: where a surface is cut by a hyperplane {x : n.x = c}, or by another level set ([`Level`]).
//!
//! A simplex with corners on both sides has one face, or in 4D perhaps two, of the section; its points are where the
//! hyperplane crosses the edges. Two simplices that share a facet share the crossings on it, so the section of a closed
//! surface is closed: polygons in 3D, surfaces of triangles in 4D.
//!
//! On which side a vertex lies is an exact sign, and a vertex in the hyperplane itself counts as above it (n.x > c). So a
//! section is always the limit of those at c - e, for e > 0 that goes to zero: it is closed whatever lies in the
//! hyperplane, be it vertices, edges or whole simplices. Crossings on the edges of a vertex in the hyperplane then meet in
//! that vertex and are one point; what has become a line or a point by that is left out, and so are faces that lie in the
//! hyperplane twice, back to back, as where it touches a body along a ridge.

use std::collections::HashMap;

use rayon::prelude::*;

use super::Mesh;
use super::facets::sort_with_parity;
use crate::geometry::{Dimension, Expansion, Vector, Vector64, determinant, widen};

/// Components of a normal below this count as zero, so that no product of one with a coordinate loses a bit.
const SMALLEST: f64 = 1e-200;

/// A hyperplane, and coordinates within it.
#[derive(Clone, Debug, PartialEq)]
pub struct Hyperplane<const D: usize> {
    normal: Vector64<D>,
    at: f64,
    /// D - 1 orthonormal directions within it.
    frame: Vec<Vector64<D>>,
    /// Whether the frame and the normal, in this order, are left-handed.
    mirrored: bool,
}

impl<const D: usize> Hyperplane<D> {
    /// The points x with n.x = `at`, for a normal n of any length; none if that is zero or not finite.
    ///
    /// Its own axes are the scene's, in their order and without the one that the normal is nearest to (the last of
    /// several), each made orthogonal to the normal and to those before it; its origin is the point next to the scene's.
    pub fn new(normal: Vector64<D>, at: f64) -> Option<Self> {
        let normal = normal.map(|x| if x.abs() < SMALLEST { 0.0 } else { x });
        let largest = normal.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        if !(largest > 0.0 && normal.iter().all(|x| x.is_finite()) && at.is_finite()) {
            return None;
        }
        let unit = (normal / largest).normalize();
        let left_out = (0..D).rev().find(|&axis| normal[axis].abs() == largest)?;
        let mut basis = vec![unit];
        for axis in (0..D).filter(|&axis| axis != left_out) {
            let mut rest = Vector64::from_fn(|r, _| f64::from(r == axis));
            // Twice, since the first pass leaves rounding of the size of what it took away.
            for _ in 0..2 {
                for base in &basis {
                    rest -= base * base.dot(&rest);
                }
            }
            basis.push(rest.normalize());
        }
        basis.rotate_left(1);
        let mirrored = determinant::<D>(&std::array::from_fn(|i| basis[i])) < 0.0;
        basis.truncate(D - 1);
        // Adding zero makes -0 of a projection +0.
        let frame = basis.into_iter().map(|axis| axis.add_scalar(0.0)).collect();
        Some(Self { normal, at, frame, mirrored })
    }

    /// n.x - c, whose sign is exact, zero included.
    pub fn height(&self, point: &Vector<D>) -> f64 {
        let terms = widen(point).component_mul(&self.normal);
        let value = terms.sum() - self.at;
        let reach: f64 = terms.iter().map(|x| x.abs()).sum::<f64>() + self.at.abs();
        if value.abs() > 4.0 * D as f64 * f64::EPSILON * reach {
            return value;
        }
        let number = |x: f64| Expansion::difference(x, 0.0);
        let start = number(-self.at);
        let exact =
            (0..D).fold(start, |sum, i| sum.add(&number(self.normal[i]).multiply(&number(f64::from(point[i])))));
        exact.estimate()
    }

    /// A point's coordinates within the hyperplane; in 3D the third is zero.
    pub fn coordinates(&self, point: &Vector64<D>) -> [f64; 3] {
        std::array::from_fn(|i| self.frame.get(i).map_or(0.0, |axis| axis.dot(point) + 0.0))
    }
}

impl<const D: usize> Hyperplane<D> {
    /// The point of the parallel hyperplane through the origin that has these coordinates.
    pub fn point(&self, coordinates: [f64; 3]) -> Vector64<D> {
        self.frame.iter().zip(coordinates).fold(Vector64::zeros(), |sum, (axis, x)| sum + axis * x)
    }
}

/// A function on space; a section is where it is zero.
pub trait Level<const D: usize>: Sync {
    /// Its value, up to rounding.
    fn value(&self, point: &Vector64<D>) -> f64;

    /// Its value at a vertex, where its sign decides. Points that are the same have the same.
    fn height(&self, point: &Vector<D>) -> f64 {
        self.value(&widen(point))
    }

    /// How far its zero is on the way between two points at which it is `heights`, of different signs.
    fn share(&self, _ends: [Vector64<D>; 2], heights: [f64; 2]) -> f64 {
        heights[0] / (heights[0] - heights[1])
    }

    /// Whether its faces are to run the other way round.
    fn mirrored(&self) -> bool {
        false
    }
}

impl<const D: usize> Level<D> for Hyperplane<D> {
    fn value(&self, point: &Vector64<D>) -> f64 {
        self.normal.dot(point) - self.at
    }

    fn height(&self, point: &Vector<D>) -> f64 {
        Hyperplane::height(self, point)
    }

    fn mirrored(&self) -> bool {
        self.mirrored
    }
}

/// A point of a section: on the edge between two vertices of a mesh, or a vertex that lies in the hyperplane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// One vertex.
    pub from: u32,
    /// The other; the same where the hyperplane goes through it.
    pub to: u32,
    /// How far the point is on the way from one to the other, from 0 to 1.
    pub share: f64,
    /// The object, from 0.
    pub object: u32,
}

impl Crossing {
    /// Where it is.
    pub fn position<const D: usize>(&self, mesh: &Mesh<D>) -> Vector64<D> {
        let [from, to] = [self.from, self.to].map(|v| widen(&mesh.vertices[v as usize]));
        from + (to - from) * self.share
    }

    /// What the vertices' values, one a vertex of the mesh, are there.
    pub fn value(&self, values: &[f32]) -> f32 {
        let [from, to] = [self.from, self.to].map(|v| f64::from(values[v as usize]));
        (from + (to - from) * self.share) as f32
    }

    /// The standard error of such a value, from the independent ones of the vertices.
    pub fn error(&self, errors: &[f32]) -> f32 {
        let [from, to] = [self.from, self.to].map(|v| f64::from(errors[v as usize]));
        if self.from == self.to { from as f32 } else { (from * (1.0 - self.share)).hypot(to * self.share) as f32 }
    }
}

/// A cross-section of a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Section {
    /// Its points.
    pub points: Vec<Crossing>,
    /// Triangles that face outwards, seen in the hyperplane's own coordinates. In 3D lines whose third index is
    /// `u32::MAX`, with the body on their left.
    pub faces: Vec<[u32; 3]>,
}

/// A section in the making.
struct Cut<'a, const D: usize, L: ?Sized> {
    mesh: &'a Mesh<D>,
    level: &'a L,
    heights: Vec<f64>,
    /// The first vertex of the same object that is the same point with the same value.
    same: Vec<u32>,
    numbers: HashMap<(u32, u32), u32>,
    made: Section,
}

/// Cuts a mesh. Its objects stay apart, and points that are the same for geometry are two where the vertices' `values`, if
/// there are any, tell them apart: the sides of a crease.
pub fn section<const D: usize>(mesh: &Mesh<D>, level: &(impl Level<D> + ?Sized), values: Option<&[f32]>) -> Section {
    let heights = mesh.vertices.par_iter().map(|point| level.height(point)).collect();
    let same = same_points(mesh, values);
    let mut cut = Cut { mesh, level, heights, same, numbers: HashMap::new(), made: Section::default() };
    // Faces within the hyperplane, by the places of their corners: they may lie there twice.
    let mut within: Vec<([u32; 3], bool, [u32; 3])> = Vec::new();
    for (index, object) in mesh.objects.iter().enumerate() {
        for simplex in &mesh.simplices[object.simplices.clone()] {
            for face in cut.faces(simplex, index as u32, level.mirrored()).into_iter().flatten() {
                let ends = cut.places(&face);
                if ends[..D - 1].iter().all(|(from, to)| from == to) {
                    let mut places = ends.map(|(from, _)| from);
                    let odd = sort_with_parity(&mut places[..D - 1]);
                    within.push((places, odd, face));
                } else {
                    cut.made.faces.push(face);
                }
            }
        }
        // Only faces of one object cancel.
        within.sort_unstable();
        for equal in within.chunk_by(|a, b| a.0 == b.0) {
            let odd = equal.iter().filter(|face| face.1).count();
            let (more, fewer) = (2 * odd > equal.len(), odd.min(equal.len() - odd));
            let left = equal.iter().filter(|face| face.1 == more).take(equal.len() - 2 * fewer);
            cut.made.faces.extend(left.map(|face| face.2));
        }
        within.clear();
    }
    cut.made.compact()
}

/// For each vertex the lowest one of its object with the same coordinates and the same value.
fn same_points<const D: usize>(mesh: &Mesh<D>, values: Option<&[f32]>) -> Vec<u32> {
    let mut same: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    for object in &mesh.objects {
        let mut first: HashMap<(u32, u32), u32> = HashMap::with_capacity(object.vertices.len());
        for v in object.vertices.clone() {
            let bits = values.map_or(0, |values| values[v].to_bits());
            same[v] = *first.entry((mesh.identity[v], bits)).or_insert(v as u32);
        }
    }
    same
}

impl<const D: usize, L: Level<D> + ?Sized> Cut<'_, D, L> {
    /// The faces of one simplex, none without measure.
    fn faces(&mut self, simplex: &[u32; D], object: u32, mirrored: bool) -> [Option<[u32; 3]>; 2] {
        let above = simplex.map(|v| self.heights[v as usize] >= 0.0);
        let (mut high, mut low) = (Vec::with_capacity(D), Vec::with_capacity(D));
        (0..D).for_each(|i| if above[i] { high.push(i) } else { low.push(i) });
        if high.is_empty() || low.is_empty() {
            return [None; 2];
        }
        let mut at = |a: usize, b: usize| self.number(simplex[a], simplex[b], object);
        let found = if high.len() == 1 || low.len() == 1 {
            // One corner alone. With the others in order the face looks inwards, in 4D with an even one above; each of the
            // three facts turns it over.
            let (alone, others) = if high.len() == 1 { (high[0], &low) } else { (low[0], &high) };
            let mut face = [u32::MAX; 3];
            face.iter_mut().zip(others).for_each(|(slot, &other)| *slot = at(alone, other));
            let four = Dimension::of::<D>() == Dimension::Four;
            if (four && high.len() == 1) ^ (!four && high.len() != 1) ^ (alone % 2 == 1) ^ mirrored {
                face.swap(0, 1);
            }
            [Some(face), None]
        } else {
            let ([a, b], [c, d]) = ([high[0], high[1]], [low[0], low[1]]);
            let mut corners = [at(a, c), at(b, c), at(b, d), at(a, d)];
            // Outwards if (a, b, c, d) is an even order of the corners.
            if sort_with_parity(&mut [a, b, c, d]) ^ mirrored {
                corners.reverse();
            }
            // Cut along the shorter diagonal.
            let place = |i: usize| self.made.points[corners[i] as usize].position(self.mesh);
            let length = |i: usize, j: usize| (place(i) - place(j)).norm_squared();
            let [p, q, r, s] = corners;
            if length(0, 2) <= length(1, 3) {
                [Some([p, q, r]), Some([p, r, s])]
            } else {
                [Some([q, r, s]), Some([q, s, p])]
            }
        };
        found.map(|face| {
            face.filter(|face| {
                let places = self.places(face);
                (1..D - 1).all(|i| !places[..i].contains(&places[i]))
            })
        })
    }

    /// The number of the point on the edge between two vertices, one above and one below.
    fn number(&mut self, a: u32, b: u32, object: u32) -> u32 {
        let [a, b] = [a, b].map(|v| self.same[v as usize]);
        let identity = |v: u32| self.mesh.identity[v as usize];
        // The same way from whichever simplex, so that the point is the same to the last bit.
        let (mut from, mut to) = if identity(a) < identity(b) { (a, b) } else { (b, a) };
        for v in [a, b] {
            if self.heights[v as usize] == 0.0 {
                (from, to) = (v, v);
            }
        }
        let next = self.made.points.len() as u32;
        let number = *self.numbers.entry((from, to)).or_insert(next);
        if number == next {
            let heights = [from, to].map(|v| self.heights[v as usize]);
            let ends = [from, to].map(|v| widen(&self.mesh.vertices[v as usize]));
            let share = if from == to { 0.0 } else { self.level.share(ends, heights) };
            self.made.points.push(Crossing { from, to, share, object });
        }
        number
    }

    /// Where a face's corners are, by what the mesh's points are called.
    fn places(&self, face: &[u32; 3]) -> [(u32, u32); 3] {
        face.map(|point| match self.made.points.get(point as usize) {
            Some(Crossing { from, to, .. }) => (self.mesh.identity[*from as usize], self.mesh.identity[*to as usize]),
            None => (u32::MAX, u32::MAX),
        })
    }
}

impl Section {
    /// Leaves out the points that no face uses.
    fn compact(mut self) -> Self {
        let mut numbers = vec![u32::MAX; self.points.len()];
        for &point in self.faces.as_flattened().iter().filter(|&&point| point != u32::MAX) {
            numbers[point as usize] = 0;
        }
        for (next, number) in (0..).zip(numbers.iter_mut().filter(|number| **number == 0)) {
            *number = next;
        }
        let mut at = 0;
        self.points.retain(|_| {
            at += 1;
            numbers[at - 1] != u32::MAX
        });
        let renumber = |point: &mut u32| *point = numbers.get(*point as usize).copied().unwrap_or(u32::MAX);
        self.faces.as_flattened_mut().iter_mut().for_each(renumber);
        self
    }
}
