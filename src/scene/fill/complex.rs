//! A solid in polyhedral cells that fit together: cells have faces, faces have corners, and what two share is one.
//!
//! Faces are convex polygons; cells need not be convex. A cell is cut by a plane across an axis, and with it those of its faces
//! and edges that the plane crosses. The cells on the other side of a face that was cut learn of it when they are looked
//! at: a cut face knows its halves, and a cut edge its middle. So faces that are flush may be several, and sides of a face
//! may have corners along them, but nowhere does one cell's face meet a part of another's.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

use super::kernel::Plane;
use super::{LEAST, section};
use crate::geometry::Vector64;
use crate::mesh::UnionFind;

/// A convex polygon: of the surface, with the outside on its positive side, or between two cells.
struct Face {
    /// Corners, counterclockwise as seen from the plane's positive side.
    corners: Vec<u32>,
    plane: Plane,
    halves: Option<[u32; 2]>,
}

/// A face as seen from one of its cells: its number, and whether the cell is on its plane's positive side.
pub type Side = (u32, bool);

/// Cells under construction: their points, faces and cut edges.
pub struct Complex {
    pub points: Vec<Vector64<3>>,
    faces: Vec<Face>,
    /// Middles of cut edges, by the lower and the higher end.
    middles: HashMap<u64, u32, BuildHasherDefault<Mixer>>,
    /// What has been cut, in order, so that it can be taken back.
    cut_edges: Vec<[u32; 2]>,
    cut_faces: Vec<u32>,
}

/// What a cut makes of a cell.
pub struct Halves {
    /// Below and above.
    pub cells: [Vec<Side>; 2],
    /// The cell's other faces, if only a part of the section was cut: then those below and above are next to it alone.
    pub others: Option<Vec<Side>>,
    /// A point of the section.
    pub middle: Vector64<3>,
    /// The shortest side of the section, or how close its plane comes to a corner beside it.
    pub shortest: f64,
}

impl Complex {
    /// The cell within triangles that face outwards; those without area, which have no plane, are left out.
    pub fn new(points: Vec<Vector64<3>>, triangles: &[[u32; 3]]) -> (Self, Vec<Side>) {
        let mut faces = Vec::with_capacity(triangles.len());
        for triangle in triangles {
            let [a, b, c] = triangle.map(|i| points[i as usize]);
            let normal = (b - a).cross(&(c - a));
            // Too small to have a direction, the normal is that of nothing: no point is inside or outside of it.
            let normal = normal.try_normalize(f64::MIN_POSITIVE).unwrap_or_default();
            let plane = Plane { normal, offset: normal.dot(&((a + b + c) / 3.0)) };
            faces.push(Face { corners: triangle.to_vec(), plane, halves: None });
        }
        let cell = (0..faces.len() as u32).map(|face| (face, false)).collect();
        (Self { points, faces, middles: HashMap::default(), cut_edges: Vec::new(), cut_faces: Vec::new() }, cell)
    }

    /// A cell's faces as they are by now.
    pub fn resolve(&self, cell: &[Side]) -> Vec<Side> {
        let mut found = Vec::with_capacity(cell.len());
        let mut open: Vec<Side> = cell.iter().rev().copied().collect();
        while let Some((face, positive)) = open.pop() {
            match self.faces[face as usize].halves {
                Some(halves) => open.extend(halves.iter().rev().map(|&half| (half, positive))),
                None => found.push((face, positive)),
            }
        }
        found
    }

    /// The plane of a face, facing out of the cell.
    pub fn plane(&self, (face, positive): Side) -> Plane {
        let Plane { normal, offset } = self.faces[face as usize].plane;
        if positive { Plane { normal: -normal, offset: -offset } } else { Plane { normal, offset } }
    }

    /// A face's corners as they are by now, counterclockwise as seen from the plane's positive side; among them those along
    /// its sides.
    pub fn corners(&self, face: u32) -> Vec<u32> {
        let corners = &self.faces[face as usize].corners;
        let mut found = Vec::with_capacity(corners.len() + 2);
        for (i, &from) in corners.iter().enumerate() {
            // The ends of pieces still to come, the nearest last.
            let (mut from, mut ends) = (from, vec![corners[(i + 1) % corners.len()]]);
            while let Some(&end) = ends.last() {
                match self.middles.get(&key(ordered(from, end))) {
                    Some(&middle) => ends.push(middle),
                    None => {
                        found.push(from);
                        from = end;
                        ends.pop();
                    }
                }
            }
        }
        found
    }

    /// The corners of all of a cell's faces.
    pub fn corners_of(&self, cell: &[Side]) -> Vec<u32> {
        let mut corners: Vec<u32> = cell.iter().flat_map(|&(face, _)| self.corners(face)).collect();
        corners.sort_unstable();
        corners.dedup();
        corners
    }

    /// A face's corners as they are by now, counterclockwise as seen from outside the cell.
    pub fn corners_outward(&self, (face, positive): Side) -> Vec<u32> {
        let mut corners = self.corners(face);
        if positive {
            corners.reverse();
        }
        corners
    }

    /// Cuts a cell by a plane, or only where the part of its section next to `near` is: what is below, and what is above.
    ///
    /// # Errors
    /// A point near which the surface passes through itself, or the plane comes too close to a corner.
    pub fn cut(&mut self, cell: &[Side], by: &Plane, near: Option<&Vector64<3>>) -> Result<Halves, Vector64<3>> {
        let mut parts: [Vec<Side>; 2] = Default::default();
        let mut crossed: Vec<(Side, Vec<u32>)> = Vec::new();
        // Edges of the section by the edges that its corners are on, around what is to be filled as seen from above.
        let mut rim: Vec<[[u32; 2]; 2]> = Vec::new();
        for &(face, positive) in cell {
            let corners = self.corners(face);
            let above = |i: usize| self.height(by, corners[i % corners.len()]) > 0.0;
            if (1..corners.len()).all(|i| above(i) == above(0)) {
                parts[usize::from(above(0))].push((face, positive));
                continue;
            }
            let edge = |i: usize| ordered(corners[i], corners[(i + 1) % corners.len()]);
            let leaves = |upwards: bool| (0..corners.len()).filter(move |&i| (!above(i) && above(i + 1)) == upwards);
            let leaves = |upwards: bool| leaves(upwards).filter(|&i| above(i) != above(i + 1)).collect::<Vec<_>>();
            let (&[up], &[down]) = (&leaves(true)[..], &leaves(false)[..]) else {
                return Err(self.points[corners[0] as usize]);
            };
            // The part below has the edge from `up` to `down` if seen from outside, the section the opposite.
            rim.push(if positive { [edge(up), edge(down)] } else { [edge(down), edge(up)] });
            crossed.push(((face, positive), corners));
        }
        let mut edges: Vec<[u32; 2]> = rim.as_flattened().to_vec();
        edges.sort_unstable();
        edges.dedup();
        let middles: Vec<Vector64<3>> = edges.iter().map(|edge| self.middle(edge, by)).collect();
        let [u, v] = across(&by.normal);
        let flat: Vec<[f64; 2]> = middles.iter().map(|p| [u.dot(p), v.dot(p)]).collect();
        let index = |edge: [u32; 2]| edges.binary_search(&edge).unwrap_or_default() as u32;
        let rim: Vec<[u32; 2]> = rim.into_iter().map(|ends| ends.map(index)).collect();
        let mut triangles = section::triangles(&flat, &rim).map_err(|point| middles[point as usize])?;

        // Whether an edge's middle is in the part of the section that is wanted.
        let mut wanted = vec![true; edges.len()];
        if let Some(near) = near {
            let mut islands = UnionFind::new(edges.len());
            rim.iter().for_each(|&[a, b]| islands.join(a, b));
            for &[a, b, c] in &triangles {
                islands.join(a, b);
                islands.join(b, c);
            }
            let distance = |i: usize| (middles[i] - near).norm_squared();
            if let Some(nearest) = (0..middles.len()).min_by(|&i, &j| distance(i).total_cmp(&distance(j))) {
                let island = islands.root(nearest as u32);
                (0..edges.len()).for_each(|i| wanted[i] = islands.root(i as u32) == island);
            }
            triangles.retain(|triangle| wanted[triangle[0] as usize]);
        }
        let mut shortest = f64::INFINITY;
        for (&[a, b], (_, corners)) in rim.iter().zip(&crossed).filter(|([a, _], _)| wanted[*a as usize]) {
            shortest = shortest.min((middles[a as usize] - middles[b as usize]).norm());
            shortest = corners.iter().map(|&corner| self.height(by, corner).abs()).fold(shortest, f64::min);
        }
        if shortest < LEAST {
            return Err(middles[0]);
        }

        let first = self.points.len() as u32;
        let middle = middles.first().copied().unwrap_or_default();
        self.points.extend(&middles);
        for ((edge, middle), _) in edges.into_iter().zip(first..).zip(&wanted).filter(|(_, wanted)| **wanted) {
            self.middles.insert(key(edge), middle);
            self.cut_edges.push(edge);
        }
        let whole = wanted.iter().all(|wanted| *wanted);
        let mut others = Vec::new();
        if !whole {
            others = parts.concat();
            parts = Default::default();
        }
        for (((face, positive), corners), [end, _]) in crossed.into_iter().zip(rim) {
            if !wanted[end as usize] {
                others.push((face, positive));
                continue;
            }
            let mut loops: [Vec<u32>; 2] = Default::default();
            for (i, &corner) in corners.iter().enumerate() {
                loops[usize::from(self.height(by, corner) > 0.0)].push(corner);
                if let Some(&middle) = self.middles.get(&key(ordered(corner, corners[(i + 1) % corners.len()]))) {
                    loops.iter_mut().for_each(|corners| corners.push(middle));
                }
            }
            let plane = self.faces[face as usize].plane;
            let halves = loops.map(|corners| self.add_face(corners, plane));
            self.faces[face as usize].halves = Some(halves);
            self.cut_faces.push(face);
            for (part, half) in parts.iter_mut().zip(halves) {
                part.push((half, positive));
            }
        }
        for triangle in triangles {
            let face = self.add_face(triangle.map(|i| first + i).to_vec(), *by);
            parts[0].push((face, false));
            parts[1].push((face, true));
        }
        Ok(Halves { cells: parts, others: (!whole).then_some(others), middle, shortest })
    }

    /// How far all is, for [`Complex::undo`].
    pub fn mark(&self) -> [usize; 4] {
        [self.points.len(), self.faces.len(), self.cut_edges.len(), self.cut_faces.len()]
    }

    /// Takes back all cuts since a mark.
    pub fn undo(&mut self, [points, faces, edges, halved]: [usize; 4]) {
        for edge in self.cut_edges.drain(edges..) {
            self.middles.remove(&key(edge));
        }
        for face in self.cut_faces.drain(halved..) {
            self.faces[face as usize].halves = None;
        }
        self.points.truncate(points);
        self.faces.truncate(faces);
    }

    /// The shortest side of the section that a plane would make through faces with these corners.
    pub fn shortest_side(&self, loops: &[Vec<u32>], by: &Plane) -> f64 {
        let mut shortest = f64::INFINITY;
        for corners in loops {
            let above = |i: usize| self.height(by, corners[i % corners.len()]) > 0.0;
            let mut before: Option<Vector64<3>> = None;
            for i in (0..corners.len()).filter(|&i| above(i) != above(i + 1)) {
                let here = self.middle(&ordered(corners[i], corners[(i + 1) % corners.len()]), by);
                if let Some(before) = before {
                    shortest = shortest.min((here - before).norm());
                }
                before = Some(here);
            }
        }
        shortest
    }

    /// How far above a plane a point is.
    fn height(&self, plane: &Plane, point: u32) -> f64 {
        plane.normal.dot(&self.points[point as usize]) - plane.offset
    }

    fn add_face(&mut self, corners: Vec<u32>, plane: Plane) -> u32 {
        self.faces.push(Face { corners, plane, halves: None });
        self.faces.len() as u32 - 1
    }

    /// Where an edge meets a plane.
    fn middle(&self, edge: &[u32; 2], by: &Plane) -> Vector64<3> {
        let [from, to] = edge.map(|i| self.points[i as usize]);
        let [below, above] = edge.map(|i| self.height(by, i));
        let point = from + (to - from) * (below / (below - above));
        point + by.normal * (by.offset - by.normal.dot(&point))
    }
}

/// Two directions that make a right-handed frame with a normal, which comes last.
fn across(normal: &Vector64<3>) -> [Vector64<3>; 2] {
    let least = normal.iamin();
    let helper = Vector64::<3>::from_fn(|r, _| f64::from(r == least));
    let u = helper.cross(normal).normalize();
    [u, normal.cross(&u)]
}

fn key([a, b]: [u32; 2]) -> u64 {
    u64::from(a) << 32 | u64::from(b)
}

/// Hashes edges, which are looked up more often than anything else is done.
#[derive(Default)]
struct Mixer(u64);

impl Hasher for Mixer {
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|&byte| self.write_u64(u64::from(byte)));
    }

    fn write_u64(&mut self, value: u64) {
        let mixed = (self.0 ^ value).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 = mixed ^ mixed >> 32;
    }

    fn finish(&self) -> u64 {
        self.0
    }
}

/// An edge, the lower end first.
fn ordered(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}
