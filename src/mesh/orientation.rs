//! Which components of an object are closed, and which side of them is outside.
//!
//! Two simplices are connected where they share a facet. A component is *closed* if each of its facets belongs to
//! exactly two simplices, and *orientable* if the vertex orders can be chosen so that both see the facet in opposite
//! orders. A closed component's normals point outwards at even nesting depth within its object, and into the cavity at
//! odd depth. Open components keep the order they came in.
//!
//! An object may be told to face the eye instead. Then each simplex of its open components turns to the eye by itself, and a closed
//! component shows the eye the side that it is on: outwards if the eye is outside of it, inwards if it is within, as
//! in a room. Shells within shells, each looked at by itself, then all face the space that the eye is in.
//!
//! Of simplices that lie one on the other ([`super::copies`]) the first counts. With the first of a closed component the
//! others turn: those that faced as it did still do, and those that faced the other way are the component's other side.

use std::ops::Range;

use super::facets::{has_double, sorted_facets};
use super::{Copies, Mesh, nesting};
use crate::geometry::{Aabb, Column, Cone, Vector, Vector64, determinant, plane_side, widen};

/// How the components of an object are oriented.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Orientation<const D: usize> {
    /// Open ones by the order of each simplex's vertices, closed ones by what they enclose.
    Input,
    /// Towards where they are seen from: every simplex of an open one on its own, a closed one as a whole.
    Facing(Viewpoint<D>),
}

/// Where a scene is seen from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Viewpoint<const D: usize> {
    /// A point, for a perspective camera.
    Eye(Vector<D>),
    /// The direction towards the eye, for a parallel one, and the middle of the image, where rays start.
    Parallel {
        /// Towards the eye.
        direction: Vector<D>,
        /// The middle of the image.
        middle: Vector<D>,
    },
}

impl<const D: usize> Viewpoint<D> {
    /// Whether a simplex is seen from behind, exactly.
    pub fn is_behind(&self, corners: &[Vector<D>; D]) -> bool {
        match self {
            Self::Eye(eye) => plane_side(corners, eye) < 0,
            Self::Parallel { direction, .. } => {
                // det[direction, edges] = normal . direction.
                let column = |i: usize| match i {
                    0 => Column::vector(*direction),
                    i => Column::edge(corners[i], corners[0]),
                };
                Cone::new(std::array::from_fn(column)).orientation() < 0
            }
        }
    }

    /// Where it is: the eye, or what stands for it.
    fn place(&self) -> &Vector<D> {
        match self {
            Self::Eye(place) | Self::Parallel { middle: place, .. } => place,
        }
    }
}

/// Directions tried until none meets the rim of a simplex.
const DIRECTIONS: u32 = 31;

/// A set of simplices connected through facets.
struct Component {
    simplices: Vec<u32>,
    closed: bool,
}

/// Splits the simplices into components, and finds for each simplex whether it must be turned to agree with the first
/// of its component. Those that lie on an earlier one are in none.
fn components<const D: usize>(corners: &[[u32; D]], copies: &Copies) -> (Vec<Component>, Vec<bool>) {
    let mut facets = sorted_facets(corners);
    // A simplex with two equal corners has no facet that isn't doubled or degenerate itself.
    facets
        .retain(|facet| !has_double(&corners[facet.simplex as usize]) && copies.first(facet.simplex) == facet.simplex);
    let mut neighbours: Vec<[Option<(u32, bool)>; D]> = vec![[None; D]; corners.len()];
    let mut open = vec![false; corners.len()];
    for around in facets.chunk_by(|a, b| a.corners == b.corners) {
        if let [a, b] = around {
            for (one, other) in [(a, b), (b, a)] {
                let free = neighbours[one.simplex as usize].iter_mut().find(|n| n.is_none());
                *free.expect("a simplex has D facets") = Some((other.simplex, a.turned == b.turned));
            }
        } else {
            around.iter().for_each(|f| open[f.simplex as usize] = true);
        }
    }
    let mut turned = vec![false; corners.len()];
    let mut seen = vec![false; corners.len()];
    copies.iter().for_each(|(copy, _)| seen[copy as usize] = true);
    let mut all = Vec::new();
    for start in 0..corners.len() {
        if seen[start] {
            continue;
        }
        seen[start] = true;
        let mut component = Component { simplices: vec![start as u32], closed: true };
        let mut next = 0;
        while next < component.simplices.len() {
            let s = component.simplices[next] as usize;
            next += 1;
            component.closed &= !open[s] && neighbours[s].iter().all(Option::is_some);
            for (other, same) in neighbours[s].iter().flatten() {
                let o = *other as usize;
                if !seen[o] {
                    seen[o] = true;
                    turned[o] = turned[s] ^ same;
                    component.simplices.push(*other);
                } else if turned[o] != turned[s] ^ same {
                    component.closed = false; // not orientable
                }
            }
        }
        all.push(component);
    }
    (all, turned)
}

/// Turns one object's simplices as the module's rules say; returns the number of its components and how many of them
/// are closed and orientable.
pub fn orient<const D: usize>(mesh: &mut Mesh<D>, simplices: Range<usize>, facing: &Orientation<D>) -> (usize, usize) {
    let corners: Vec<[u32; D]> =
        mesh.simplices[simplices.clone()].iter().map(|s| s.map(|v| mesh.identity[v as usize])).collect();
    // Those of the whole mesh may lie on another object's.
    let copies = match mesh.copies.is_empty() {
        true => Copies::default(),
        false => Copies::find(&corners, |s| !has_double(&corners[s as usize])),
    };
    let (components, turned) = components(&corners, &copies);
    let wide = |s: u32| corners[s as usize].map(|v| widen(&mesh.vertices[v as usize]));
    let closed: Vec<&Component> = components.iter().filter(|c| c.closed).collect();
    let points: Vec<[Vector<D>; D]> = corners.iter().map(|s| s.map(|v| mesh.vertices[v as usize])).collect();
    let inwards: Vec<bool> = match facing {
        Orientation::Input => {
            let lists: Vec<&[u32]> = closed.iter().map(|c| &c.simplices[..]).collect();
            nesting::depths(&points, &lists).into_iter().map(|depth| depth % 2 == 1).collect()
        }
        Orientation::Facing(viewpoint) => closed.iter().map(|c| holds(&points, c, viewpoint.place())).collect(),
    };
    let mut flip = vec![false; corners.len()];
    for (component, inwards) in closed.iter().zip(inwards) {
        // D! times the enclosed measure, by the divergence theorem, about a corner of the component.
        let origin = wide(component.simplices[0])[0];
        let volume: f64 = (component.simplices.iter())
            .map(|&s| {
                let edges: [Vector64<D>; D] = wide(s).map(|v| v - origin);
                determinant(&edges) * if turned[s as usize] { -1.0 } else { 1.0 }
            })
            .sum();
        // det[v_i - p] is minus the height of p above the simplex: positive if the normal points away from p.
        let points_inwards = volume < 0.0;
        for &s in &component.simplices {
            flip[s as usize] = turned[s as usize] ^ points_inwards ^ inwards;
        }
    }
    // What turns a simplex turns those that lie on it.
    copies.iter().for_each(|(copy, first)| flip[copy as usize] = flip[first as usize]);
    if let Orientation::Facing(viewpoint) = facing {
        let firsts = components.iter().filter(|c| !c.closed).flat_map(|c| &c.simplices);
        for s in firsts.flat_map(|&first| std::iter::once(first).chain(copies.members(first))) {
            flip[s as usize] = viewpoint.is_behind(&points[s as usize]);
        }
    }
    let counts = (components.len(), closed.len());
    for (simplex, _) in mesh.simplices[simplices].iter_mut().zip(flip).filter(|(_, flip)| *flip) {
        simplex.swap(D - 2, D - 1);
    }
    counts
}

/// Whether a closed component holds a point: whether a ray from there crosses it an odd number of times.
fn holds<const D: usize>(points: &[[Vector<D>; D]], component: &Component, point: &Vector<D>) -> bool {
    let simplices = || component.simplices.iter().map(|&s| &points[s as usize]);
    if !Aabb::of(simplices().flatten()).contains(&Aabb::of([point])) {
        return false;
    }
    let parity = |k: u32| {
        let direction = nesting::direction::<D>(k);
        let crosses = |simplex: &[Vector<D>; D]| {
            let cone = Cone::of_simplex(point, simplex);
            // From within its hyperplane no ray crosses it.
            if cone.orientation() == 0 { Some(false) } else { cone.strictly_contains(&direction) }
        };
        simplices().try_fold(false, |odd, simplex| Some(odd ^ crosses(simplex)?))
    };
    (1..=DIRECTIONS).find_map(parity).unwrap_or(false)
}
