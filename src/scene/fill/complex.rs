//! A solid in polyhedral cells that fit together: cells have faces, faces have corners, and what two share is one.
//!
//! Faces are convex polygons; cells need not be convex. A cell is cut by a plane across an axis, and with it those of its faces
//! and edges that the plane crosses. The cells on the other side of a face that was cut learn of it when they are looked
//! at: a cut face knows its halves, and a cut edge its middle. So faces that are flush may be several, and sides of a face
//! may have corners along them, but nowhere does one cell's face meet a part of another's.

use std::collections::HashMap;

use super::kernel::Plane;
use super::section;
use crate::geometry::Vector64;

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
    middles: HashMap<[u32; 2], u32>,
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
        (Self { points, faces, middles: HashMap::new() }, cell)
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
                match self.middles.get(&ordered(from, end)) {
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

    /// The same, counterclockwise as seen from outside the cell.
    pub fn corners_outward(&self, (face, positive): Side) -> Vec<u32> {
        let mut corners = self.corners(face);
        if positive {
            corners.reverse();
        }
        corners
    }

    /// Cuts a cell by the plane across an axis at a value that no corner of it has: what is below, and what is above.
    ///
    /// # Errors
    /// A point near which the surface passes through itself; nothing is cut then.
    pub fn cut(&mut self, cell: &[Side], axis: usize, at: f64) -> Result<[Vec<Side>; 2], Vector64<3>> {
        let mut parts: [Vec<Side>; 2] = Default::default();
        let mut crossed: Vec<(Side, Vec<u32>)> = Vec::new();
        // Edges of the section by the edges that its corners are on, around what is to be filled as seen from above.
        let mut rim: Vec<[[u32; 2]; 2]> = Vec::new();
        for &(face, positive) in cell {
            let corners = self.corners(face);
            let above = |i: usize| self.points[corners[i % corners.len()] as usize][axis] > at;
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
        let middles: Vec<Vector64<3>> = edges.iter().map(|edge| self.middle(edge, axis, at)).collect();
        let flat: Vec<[f64; 2]> = middles.iter().map(|p| [1, 2].map(|k| p[(axis + k) % 3])).collect();
        let index = |edge: [u32; 2]| edges.binary_search(&edge).unwrap_or_default() as u32;
        let rim: Vec<[u32; 2]> = rim.into_iter().map(|ends| ends.map(index)).collect();
        let triangles = section::triangles(&flat, &rim).map_err(|point| middles[point as usize])?;

        let first = self.points.len() as u32;
        self.points.extend(middles);
        self.middles.extend(edges.into_iter().zip(first..));
        for ((face, positive), corners) in crossed {
            let mut loops: [Vec<u32>; 2] = Default::default();
            for (i, &corner) in corners.iter().enumerate() {
                loops[usize::from(self.points[corner as usize][axis] > at)].push(corner);
                if let Some(&middle) = self.middles.get(&ordered(corner, corners[(i + 1) % corners.len()])) {
                    loops.iter_mut().for_each(|corners| corners.push(middle));
                }
            }
            let plane = self.faces[face as usize].plane;
            let halves = loops.map(|corners| self.add_face(corners, plane));
            self.faces[face as usize].halves = Some(halves);
            for (part, half) in parts.iter_mut().zip(halves) {
                part.push((half, positive));
            }
        }
        let plane = Plane { normal: Vector64::from_fn(|r, _| f64::from(r == axis)), offset: at };
        for triangle in triangles {
            let face = self.add_face(triangle.map(|i| first + i).to_vec(), plane);
            parts[0].push((face, false));
            parts[1].push((face, true));
        }
        Ok(parts)
    }

    /// The shortest side of the section that a plane would make through faces with these corners.
    pub fn shortest_side(&self, loops: &[Vec<u32>], axis: usize, at: f64) -> f64 {
        let mut shortest = f64::INFINITY;
        for corners in loops {
            let above = |i: usize| self.points[corners[i % corners.len()] as usize][axis] > at;
            let mut before: Option<Vector64<3>> = None;
            for i in (0..corners.len()).filter(|&i| above(i) != above(i + 1)) {
                let here = self.middle(&ordered(corners[i], corners[(i + 1) % corners.len()]), axis, at);
                if let Some(before) = before {
                    shortest = shortest.min((here - before).norm());
                }
                before = Some(here);
            }
        }
        shortest
    }

    fn add_face(&mut self, corners: Vec<u32>, plane: Plane) -> u32 {
        self.faces.push(Face { corners, plane, halves: None });
        self.faces.len() as u32 - 1
    }

    /// Where an edge meets the plane across an axis.
    fn middle(&self, edge: &[u32; 2], axis: usize, at: f64) -> Vector64<3> {
        let [from, to] = edge.map(|i| self.points[i as usize]);
        let mut point = from + (to - from) * ((at - from[axis]) / (to[axis] - from[axis]));
        point[axis] = at;
        point
    }
}

/// An edge as a key.
fn ordered(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}
