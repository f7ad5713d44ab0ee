//! Space in convex cells that fit together: cells have faces, faces have corners, and what two share is one.
//!
//! A cell is split by a plane, and with it those of its faces and edges that the plane crosses. The cells on the other side of
//! a face that was split learn of it when they are looked at: a split face knows its halves, and a split edge its middle. So
//! faces that are flush may be several, and sides of a face may have corners along them, but nowhere does one cell's face
//! meet a part of another's.

use std::collections::HashMap;

use num_bigint::BigInt;

use super::exact::{Plane, Point, turn};

/// A convex polygon between two cells.
struct Face {
    /// Corners, counterclockwise as seen from the plane's positive side.
    corners: Vec<u32>,
    plane: u32,
    halves: Option<[u32; 2]>,
}

/// Where the complex is split further: a plane and what is on both sides of it, or a cell.
#[derive(Clone, Copy)]
pub enum Node {
    /// What is on the plane's negative and on its positive side.
    Split {
        /// The plane.
        plane: u32,
        /// Nodes on its negative and positive side.
        sides: [u32; 2],
    },
    /// One convex cell.
    Cell(u32),
}

/// Convex cells that fill a box.
pub struct Complex {
    pub points: Vec<Point>,
    pub planes: Vec<Plane>,
    faces: Vec<Face>,
    /// Middles of split edges, by the lower and the higher end.
    middles: HashMap<(u32, u32), u32>,
    /// Faces of each cell, and whether it is on their planes' positive side.
    cells: Vec<Vec<(u32, bool)>>,
    /// The tree of splits; the first is the root.
    pub nodes: Vec<Node>,
}

impl Complex {
    /// One cell, a box with whole corners.
    pub fn new([low, high]: [[BigInt; 3]; 2]) -> Self {
        let mut complex = Self {
            points: Vec::new(),
            planes: Vec::new(),
            faces: Vec::new(),
            middles: HashMap::new(),
            cells: vec![Vec::new()],
            nodes: vec![Node::Cell(0)],
        };
        for corner in 0..8 {
            let at = |axis: usize| if corner >> axis & 1 == 1 { high[axis].clone() } else { low[axis].clone() };
            complex.points.push(Point::whole([at(0), at(1), at(2)]));
        }
        for axis in 0..3 {
            for (end, limit) in [&low, &high].into_iter().enumerate() {
                let plane = complex.add_plane(Plane::across(axis, limit[axis].clone()));
                let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
                let start = (end as u32) << axis;
                let corners = vec![start, start | 1 << i, start | 1 << i | 1 << j, start | 1 << j];
                complex.faces.push(Face { corners, plane, halves: None });
                complex.cells[0].push((complex.faces.len() as u32 - 1, end == 0));
            }
        }
        complex
    }

    /// A new plane's number.
    pub fn add_plane(&mut self, plane: Plane) -> u32 {
        self.planes.push(plane);
        self.planes.len() as u32 - 1
    }

    /// The number of cells.
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// A cell's faces as they are by now, and whether it is on their planes' positive side.
    pub fn faces_of(&self, cell: u32) -> Vec<(u32, bool)> {
        let mut found = Vec::new();
        let mut open: Vec<(u32, bool)> = self.cells[cell as usize].iter().rev().copied().collect();
        while let Some((face, positive)) = open.pop() {
            match self.faces[face as usize].halves {
                Some(halves) => open.extend(halves.iter().rev().map(|&half| (half, positive))),
                None => found.push((face, positive)),
            }
        }
        found
    }

    /// A face's plane.
    pub fn plane_of(&self, face: u32) -> u32 {
        self.faces[face as usize].plane
    }

    /// A face's corners as they are by now, counterclockwise as seen from the plane's positive side; among them those along
    /// its sides.
    pub fn corners_of(&self, face: u32) -> Vec<u32> {
        let corners = &self.faces[face as usize].corners;
        let mut found = Vec::with_capacity(corners.len() + 2);
        for (i, &from) in corners.iter().enumerate() {
            // The ends of pieces still to come, the nearest last.
            let (mut from, mut ends) = (from, vec![corners[(i + 1) % corners.len()]]);
            while let Some(&end) = ends.last() {
                match self.middles.get(&(from.min(end), from.max(end))) {
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

    /// Splits a node's cell by a plane that has points of it on both sides.
    pub fn split(&mut self, node: u32, plane: u32) {
        let Node::Cell(cell) = self.nodes[node as usize] else { return };
        let faces = self.faces_of(cell);
        let mut sides: HashMap<u32, i32> = HashMap::new();
        // The plane's own edges within the cell, by their ends.
        let mut rim: Vec<(u32, u32)> = Vec::new();
        let mut parts: [Vec<(u32, bool)>; 2] = Default::default();
        for (face, positive) in faces {
            let corners = self.corners_of(face);
            for &corner in &corners {
                let side = || self.planes[plane as usize].side(&self.points[corner as usize]);
                sides.entry(corner).or_insert_with(side);
            }
            let signs: Vec<i32> = corners.iter().map(|corner| sides[corner]).collect();
            if signs.iter().all(|&s| s >= 0) || signs.iter().all(|&s| s <= 0) {
                for i in 0..corners.len() {
                    let j = (i + 1) % corners.len();
                    if signs[i] == 0 && signs[j] == 0 {
                        rim.push((corners[i].min(corners[j]), corners[i].max(corners[j])));
                    }
                }
                parts[usize::from(signs.iter().any(|&s| s > 0))].push((face, positive));
                continue;
            }
            let mut loops: [Vec<u32>; 2] = Default::default();
            let mut on = Vec::with_capacity(2);
            for i in 0..corners.len() {
                let j = (i + 1) % corners.len();
                match signs[i] {
                    0 => {
                        loops.iter_mut().for_each(|l| l.push(corners[i]));
                        on.push(corners[i]);
                    }
                    s => loops[usize::from(s > 0)].push(corners[i]),
                }
                if signs[i] * signs[j] < 0 {
                    let middle = self.split_edge(corners[i], corners[j], plane);
                    sides.insert(middle, 0);
                    loops.iter_mut().for_each(|l| l.push(middle));
                    on.push(middle);
                }
            }
            debug_assert_eq!(on.len(), 2, "a plane meets a convex polygon's sides twice");
            rim.push((on[0].min(on[1]), on[0].max(on[1])));
            let halves = loops.map(|corners| {
                self.faces.push(Face { corners, plane: self.faces[face as usize].plane, halves: None });
                self.faces.len() as u32 - 1
            });
            self.faces[face as usize].halves = Some(halves);
            for (part, half) in parts.iter_mut().zip(halves) {
                part.push((half, positive));
            }
        }
        let between = self.cut_face(rim, plane);
        parts[0].push((between, false));
        parts[1].push((between, true));
        let [negative, positive] = parts;
        self.cells[cell as usize] = negative;
        self.cells.push(positive);
        let next = self.nodes.len() as u32;
        self.nodes.push(Node::Cell(cell));
        self.nodes.push(Node::Cell(self.cells.len() as u32 - 1));
        self.nodes[node as usize] = Node::Split { plane, sides: [next, next + 1] };
    }

    fn split_edge(&mut self, a: u32, b: u32, plane: u32) -> u32 {
        let key = (a.min(b), a.max(b));
        if let Some(&middle) = self.middles.get(&key) {
            return middle;
        }
        let [from, to] = [key.0, key.1].map(|i| &self.points[i as usize]);
        self.points.push(Point::between(from, to, &self.planes[plane as usize]));
        let middle = self.points.len() as u32 - 1;
        self.middles.insert(key, middle);
        middle
    }

    /// The face along a plane, from its edges.
    fn cut_face(&mut self, mut rim: Vec<(u32, u32)>, plane: u32) -> u32 {
        rim.sort_unstable();
        rim.dedup();
        let mut next: HashMap<u32, Vec<u32>> = HashMap::new();
        for &(a, b) in &rim {
            next.entry(a).or_default().push(b);
            next.entry(b).or_default().push(a);
        }
        let start = rim[0].0;
        let (mut before, mut here) = (u32::MAX, start);
        let mut corners = Vec::with_capacity(rim.len());
        while corners.len() < rim.len() {
            corners.push(here);
            let onwards = next[&here].iter().copied().find(|&other| other != before).unwrap_or(start);
            (before, here) = (here, onwards);
        }
        debug_assert_eq!(here, start, "the rim of a cut closes");
        // Counterclockwise as seen from the positive side.
        let (axis, sign) = self.planes[plane as usize].view();
        let of = |i: usize| &self.points[corners[i] as usize];
        let way = (1..corners.len() - 1).map(|i| turn([of(0), of(i), of(i + 1)], axis)).find(|&t| t != 0);
        if way.is_some_and(|way| way != sign) {
            corners.reverse();
        }
        self.faces.push(Face { corners, plane, halves: None });
        self.faces.len() as u32 - 1
    }
}
