//! The table of marching hypercubes: for each way in which the corners of a cell can be inside or outside, the simplices
//! that separate them, after Bhaniramka, Wenger and Crawfis (*Isosurfacing in higher dimensions*, 2000).
//!
//! The rule: take the convex hull of the corners that are inside and of the midpoints of the edges whose ends differ.
//! Those of its facets that do not lie on the boundary of the cell are the surface. No hull library is needed, since the
//! cell has coordinates 0, 1 and 2 only: a facet that is not on the boundary has midpoints alone for vertices, hence lies
//! on one of the few thousand hyperplanes through midpoints, and such a hyperplane carries a facet of a case if all its
//! points are on one side. With points as bits that is one AND. (A corner that is inside can't be on such a facet: along
//! each edge the hull goes on from it, to the next corner or to the midpoint, so that near it the hull is the cell.)
//!
//! A facet is a polytope of dimension D-1 and is cut into simplices by *pulling*: cones from the first of its vertices over
//! its own facets that do not have it, which are cut in the same way. "First" is lexicographic in the coordinates, which
//! two cells that share a face agree on, so neighbours meet without cracks whatever the rest of their corners is. Two
//! corners that are inside and diagonal to each other are joined, not parted: the rule is not symmetric under exchanging
//! inside and outside, which is what makes it free of cracks.
//!
//! For D = 4 there are 65,536 cases of 847,760 tetrahedra in all; for D = 3 the same lines give marching cubes.
//! A case is worked out when it is first met, since a smooth surface meets few of them.

use std::sync::OnceLock;

use crate::geometry::{Vector64, determinant};

/// An edge of the cell, by the corner it starts from. Corner bits are coordinates: bit 0 is x.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// The end whose coordinate along `axis` is the lower one.
    pub corner: u8,
    /// The direction.
    pub axis: u8,
}

/// What separates the corners of one case.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Case<const D: usize> {
    /// The edges that have a vertex of the surface, ascending.
    pub edges: Box<[u8]>,
    /// The simplices, D places in `edges` each, with normals from inside to outside.
    pub simplices: Box<[[u8; D]]>,
}

/// A hyperplane through midpoints: which points it parts. Bits: corners first, then edges.
#[derive(Clone, Copy, Debug)]
struct Hyperplane {
    normal: [i32; 4],
    above: u64,
    below: u64,
    on: u64,
}

/// The cases of dimension D, worked out when first asked for.
#[derive(Debug)]
pub struct Table<const D: usize> {
    edges: Vec<Edge>,
    /// Coordinates of the edges' midpoints, in lexicographic order; unused axes are 0.
    midpoints: Vec<[i32; 4]>,
    hyperplanes: Vec<Hyperplane>,
    cases: Vec<OnceLock<Case<D>>>,
}

impl<const D: usize> Default for Table<D> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const D: usize> Table<D> {
    const CORNERS: usize = 1 << D;

    /// The table, with no case worked out yet.
    pub fn new() -> Self {
        let mut edges: Vec<Edge> = (0..Self::CORNERS as u8)
            .flat_map(|corner| (0..D as u8).map(move |axis| Edge { corner, axis }))
            .filter(|edge| edge.corner >> edge.axis & 1 == 0)
            .collect();
        edges.sort_unstable_by_key(|edge| midpoint::<D>(*edge));
        let midpoints: Vec<[i32; 4]> = edges.iter().map(|&edge| midpoint::<D>(edge)).collect();
        let hyperplanes = hyperplanes::<D>(&midpoints);
        Self { edges, midpoints, hyperplanes, cases: (0..1 << Self::CORNERS).map(|_| OnceLock::new()).collect() }
    }

    /// The edges, in the order in which cases name them.
    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// The case in which exactly the corners with a bit in `inside` are inside.
    #[inline]
    pub fn case(&self, inside: usize) -> &Case<D> {
        self.cases[inside].get_or_init(|| self.work_out(inside))
    }

    fn work_out(&self, inside: usize) -> Case<D> {
        let mut simplices = Vec::new();
        for (normal, on) in self.facets(inside) {
            let first = simplices.len();
            self.cut(normal, on, &mut simplices);
            for simplex in &mut simplices[first..] {
                self.orient(normal, simplex);
            }
        }
        let crossed = self.crossed(inside);
        let edges: Box<[u8]> = (0..self.edges.len() as u8).filter(|edge| crossed >> edge & 1 == 1).collect();
        // Every crossed edge is a vertex of the hull, so it is in the list.
        let place = |edge: u8| (crossed & ((1 << edge) - 1)).count_ones() as u8;
        let simplices = simplices.into_iter().map(|simplex: [u8; D]| simplex.map(place)).collect();
        Case { edges, simplices }
    }

    /// The edges whose ends differ, as bits.
    fn crossed(&self, inside: usize) -> u64 {
        let differs = |edge: &Edge| (inside >> edge.corner ^ inside >> (edge.corner | 1 << edge.axis)) & 1;
        self.edges.iter().enumerate().map(|(i, edge)| (differs(edge) as u64) << i).sum()
    }

    /// The supporting hyperplanes of a case: outward normals, and the midpoints on them as bits. Among them are some
    /// that only touch an edge or a corner of the hull, which [`Table::cut`] makes nothing of.
    fn facets(&self, inside: usize) -> impl Iterator<Item = ([i32; 4], u64)> + '_ {
        let points = inside as u64 | self.crossed(inside) << Self::CORNERS;
        self.hyperplanes.iter().filter_map(move |plane| {
            let on = (points & plane.on) >> Self::CORNERS;
            if on.count_ones() < D as u32 {
                None
            } else if points & plane.above == 0 {
                Some((plane.normal, on))
            } else if points & plane.below == 0 {
                Some((plane.normal.map(|n| -n), on))
            } else {
                None
            }
        })
    }

    /// Cuts the hull of midpoints on one hyperplane into simplices; none if it is flat.
    fn cut(&self, normal: [i32; 4], on: u64, simplices: &mut Vec<[u8; D]>) {
        let dropped = normal.iter().position(|&n| n != 0).unwrap_or(0);
        let points: Vec<Point> = (0..self.edges.len() as u8)
            .filter(|edge| on >> edge & 1 == 1)
            .map(|edge| Point { edge, at: without(self.midpoints[edge as usize], dropped) })
            .collect();
        pull(&points, D - 1, &mut Vec::with_capacity(D), simplices);
    }

    fn orient(&self, normal: [i32; 4], simplex: &mut [u8; D]) {
        let at = simplex.map(|edge| self.midpoints[edge as usize]);
        let columns: [Vector64<D>; D] = std::array::from_fn(|column| {
            Vector64::from_fn(|row, _| match column {
                0 => f64::from(normal[row]),
                _ => f64::from(at[column][row] - at[0][row]),
            })
        });
        if determinant(&columns) < 0.0 {
            simplex.swap(D - 2, D - 1);
        }
    }
}

/// The midpoint of an edge, in a cell of size 2.
fn midpoint<const D: usize>(edge: Edge) -> [i32; 4] {
    std::array::from_fn(|axis| if axis == usize::from(edge.axis) { 1 } else { i32::from(edge.corner >> axis & 1) * 2 })
}

fn dot(a: [i32; 4], b: [i32; 4]) -> i32 {
    (0..4).map(|i| a[i] * b[i]).sum()
}

fn minus(a: [i32; 4], b: [i32; 4]) -> [i32; 4] {
    std::array::from_fn(|i| a[i] - b[i])
}

/// The normal of the hyperplane that the points span, in the first `points.len()` coordinates; zero if they span none.
fn span(points: &[[i32; 4]]) -> [i32; 4] {
    let edge = |i: usize| minus(points[i], points[0]);
    let cross = |a: [i32; 4], b: [i32; 4], i: usize, j: usize| a[i] * b[j] - a[j] * b[i];
    match points.len() {
        2 => [edge(1)[1], -edge(1)[0], 0, 0],
        3 => [cross(edge(1), edge(2), 1, 2), cross(edge(1), edge(2), 2, 0), cross(edge(1), edge(2), 0, 1), 0],
        _ => {
            let (a, b, c) = (edge(1), edge(2), edge(3));
            let minor = |i, j, k| a[i] * cross(b, c, j, k) - a[j] * cross(b, c, i, k) + a[k] * cross(b, c, i, j);
            [minor(1, 2, 3), -minor(0, 2, 3), minor(0, 1, 3), -minor(0, 1, 2)]
        }
    }
}

/// Calls `visit` with each subset of `size` of the points, in their order.
fn subsets(points: &[[i32; 4]], size: usize, mut visit: impl FnMut(&[[i32; 4]])) {
    let mut chosen: [usize; 4] = std::array::from_fn(|i| i);
    while size <= points.len() {
        let subset = chosen.map(|i| points.get(i).copied().unwrap_or_default());
        visit(&subset[..size]);
        // The last index that can still rise does, and those behind it follow closely.
        let Some(rising) = (0..size).rev().find(|&i| chosen[i] + size < points.len() + i) else { return };
        let first = chosen[rising] + 1;
        (rising..size).for_each(|i| chosen[i] = first + i - rising);
    }
}

/// All hyperplanes through midpoints but those that bound the cell.
fn hyperplanes<const D: usize>(midpoints: &[[i32; 4]]) -> Vec<Hyperplane> {
    let mut found: Vec<([i32; 4], i32)> = Vec::new();
    subsets(midpoints, D, |points| {
        let normal = span(points);
        let Some(lead) = normal.iter().find(|&&n| n != 0) else { return };
        let divisor = normal.iter().fold(0, |a, &b| greatest_common_divisor(a, b.abs())) * lead.signum();
        let normal = normal.map(|n| n / divisor);
        found.push((normal, dot(normal, points[0])));
    });
    found.sort_unstable();
    found.dedup();
    let corner = |i: usize| std::array::from_fn(|axis| (i >> axis & 1) as i32 * 2);
    let points: Vec<[i32; 4]> = (0..1 << D).map(corner).chain(midpoints.iter().copied()).collect();
    let parted = |(normal, offset): ([i32; 4], i32)| {
        let side = |sign: i32| {
            let bits =
                points.iter().enumerate().map(|(i, &p)| u64::from((dot(normal, p) - offset).signum() == sign) << i);
            bits.sum()
        };
        Hyperplane { normal, above: side(1), below: side(-1), on: side(0) }
    };
    found.into_iter().map(parted).filter(|plane| plane.above != 0 && plane.below != 0).collect()
}

fn greatest_common_divisor(a: i32, b: i32) -> i32 {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

/// A vertex of a polytope.
#[derive(Clone, Copy)]
struct Point {
    edge: u8,
    at: [i32; 4],
}

/// The other coordinates; the last one becomes 0.
fn without(at: [i32; 4], dropped: usize) -> [i32; 4] {
    std::array::from_fn(|i| at.get(i + usize::from(i >= dropped)).copied().unwrap_or(0))
}

/// Cuts a polytope of this dimension, given by its vertices in order, into cones from the first.
fn pull<const D: usize>(points: &[Point], dimension: usize, apexes: &mut Vec<u8>, simplices: &mut Vec<[u8; D]>) {
    if dimension == 1 {
        if let [a, b] = points {
            let corners = apexes.iter().copied().chain([a.edge, b.edge]);
            let mut simplex = [0; D];
            simplex.iter_mut().zip(corners).for_each(|(slot, corner)| *slot = corner);
            simplices.push(simplex);
        }
        return;
    }
    let Some((apex, others)) = points.split_first() else { return };
    apexes.push(apex.edge);
    // The facets met so far, by which points are on them.
    let mut seen: Vec<u64> = Vec::new();
    let places: Vec<[i32; 4]> = others.iter().map(|point| point.at).collect();
    subsets(&places, dimension, |spanning| {
        let normal = span(spanning);
        let Some(dropped) = normal.iter().position(|&n| n != 0) else { return };
        let offset = dot(normal, spanning[0]);
        let side = (dot(normal, apex.at) - offset).signum();
        let mut on = 0;
        for (i, &place) in places.iter().enumerate() {
            let height = (dot(normal, place) - offset).signum();
            if side == 0 || height == -side {
                return;
            }
            on |= u64::from(height == 0) << i;
        }
        if !seen.contains(&on) {
            seen.push(on);
            let facet = others.iter().enumerate().filter(|(i, _)| on >> i & 1 == 1);
            let facet: Vec<Point> = facet.map(|(_, p)| Point { edge: p.edge, at: without(p.at, dropped) }).collect();
            pull(&facet, dimension - 1, apexes, simplices);
        }
    });
    apexes.pop();
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use rayon::prelude::*;

    use super::*;
    use crate::mesh::facets::sort_with_parity;

    /// Simplices of at most three vertices, sorted, and how often each is there; those that cancel left out.
    type Sum = Vec<([u8; 3], i32)>;

    fn boundary<const D: usize>(case: &Case<D>) -> Sum {
        let mut all: Sum = Vec::with_capacity(D * case.simplices.len());
        for simplex in &case.simplices {
            for left_out in 0..D {
                let mut facet = [u8::MAX; 3];
                let corners = (0..D).filter(|&i| i != left_out).map(|i| case.edges[usize::from(simplex[i])]);
                facet.iter_mut().zip(corners).for_each(|(slot, corner)| *slot = corner);
                let odd = sort_with_parity(&mut facet) != (left_out % 2 == 1);
                all.push((facet, if odd { -1 } else { 1 }));
            }
        }
        add_up(all)
    }

    fn add_up(mut all: Sum) -> Sum {
        all.sort_unstable();
        let sums = all.chunk_by(|a, b| a.0 == b.0).map(|same| (same[0].0, same.iter().map(|(_, times)| times).sum()));
        sums.filter(|(_, times)| *times != 0).collect()
    }

    /// For each edge the edge opposite to it across the cell along this axis, with the lower coordinate. It keeps the
    /// order, so that a sorted simplex stays sorted.
    fn lowered<const D: usize>(table: &Table<D>, axis: usize) -> Vec<Option<u8>> {
        let lower = |edge: &Edge| Edge { corner: edge.corner & !(1 << axis), axis: edge.axis };
        let place = |edge: &Edge| table.edges.iter().position(|other| *other == lower(edge)).map(|i| i as u8);
        table.edges.iter().map(|edge| place(edge).filter(|_| usize::from(edge.axis) != axis)).collect()
    }

    /// Within every case the facets of its simplices pair up but for those on the cell's faces; what is left on a face
    /// depends on the signs there only, and is the opposite of what the neighbour leaves.
    fn prove<const D: usize>() -> Vec<usize> {
        let table = Table::<D>::new();
        let all: Vec<usize> = (0..1 << (1 << D)).collect();
        let boundaries: Vec<Sum> = all.par_iter().map(|&inside| boundary(table.case(inside))).collect();
        // Which faces a simplex lies on: two bits an axis.
        let faces: Vec<u32> = (table.midpoints.iter())
            .map(|at| (0..D).map(|axis| [1, 0, 2][at[axis] as usize] << (2 * axis)).sum())
            .collect();
        let faces_of = |simplex: &[u8; 3]| {
            simplex[..D - 1].iter().fold(u32::MAX, |common, &edge| common & faces[usize::from(edge)])
        };
        for (inside, boundary) in boundaries.iter().enumerate() {
            assert!(boundary.iter().all(|(simplex, _)| faces_of(simplex) != 0), "case {inside:#x}");
        }
        (0..D).into_par_iter().for_each(|axis| {
            let lowered = lowered(&table, axis);
            let upper_corners = (0..1u8 << D).filter(|corner| corner >> axis & 1 == 1);
            let upper: usize = upper_corners.map(|corner| 1 << corner).sum();
            // What a face with these signs is left with, as the first case that has them leaves it.
            let mut known: Vec<Option<Sum>> = vec![None; 1 << (1 << D)];
            for (inside, boundary) in boundaries.iter().enumerate() {
                for (bit, sign) in [(1, 1), (2, -1)] {
                    let signs = if bit == 1 { inside & !upper } else { (inside & upper) >> (1 << axis) };
                    let on_face = boundary.iter().filter(|(simplex, _)| faces_of(simplex) >> (2 * axis) & bit != 0);
                    let left = add_up(
                        on_face
                            .map(|(simplex, times)| {
                                let lower = |&edge: &u8| lowered.get(usize::from(edge)).copied().flatten();
                                (simplex.each_ref().map(|edge| lower(edge).unwrap_or(u8::MAX)), sign * times)
                            })
                            .collect(),
                    );
                    match &known[signs] {
                        Some(known) => assert_eq!(known, &left, "case {inside:#x}, axis {axis}"),
                        None => known[signs] = Some(left),
                    }
                }
            }
        });
        all.iter().map(|&inside| table.case(inside).simplices.len()).collect()
    }

    #[test]
    fn every_case_in_3d_fits_every_neighbour() {
        let counts = prove::<3>();
        assert_eq!((counts[0], counts[255]), (0, 0));
        assert_eq!((counts[1], counts[254], counts[0b1111]), (1, 1, 2));
    }

    #[test]
    fn every_case_in_4d_fits_every_neighbour() {
        let counts = prove::<4>();
        assert_eq!((counts[0], counts[65_535]), (0, 0));
        assert_eq!((counts[1], counts[0xff]), (1, 6), "a corner, and a cube of six tetrahedra");
        assert_eq!(counts.iter().sum::<usize>(), 847_760);
        assert_eq!(counts.iter().max(), Some(&24));
    }

    #[test]
    fn facets_and_distinct_polytopes() {
        let table = Table::<4>::new();
        assert_eq!(table.hyperplanes.len(), 2_744);
        let whole = |&(normal, on): &([i32; 4], u64)| {
            let mut simplices = Vec::new();
            table.cut(normal, on, &mut simplices);
            !simplices.is_empty()
        };
        let facets: Vec<([i32; 4], u64)> =
            (1..65_535usize).into_par_iter().flat_map_iter(|inside| table.facets(inside).filter(whole)).collect();
        assert_eq!(facets.len(), 484_928);
        // The same polytope can face either way.
        assert_eq!(facets.into_iter().collect::<BTreeSet<_>>().len(), 9_272);
    }

    #[test]
    fn normals_point_out_of_the_inside() {
        let table = Table::<4>::new();
        // The half x = 0: the surface is the cube x = 1, its normals are along +x.
        let inside = (0..16).filter(|corner| corner & 1 == 0).map(|corner| 1 << corner).sum();
        let case = table.case(inside);
        assert_eq!((case.edges.len(), case.simplices.len()), (8, 6));
        for simplex in &case.simplices {
            let corners = simplex.map(|place| {
                Vector64::<4>::from(table.midpoints[usize::from(case.edges[usize::from(place)])].map(f64::from))
            });
            let normal = crate::geometry::normal_of(&corners);
            assert!(normal[0] > 0.0 && normal[1] == 0.0 && normal[2] == 0.0 && normal[3] == 0.0);
        }
    }
}
