//! Which components of an object are closed, and which side of them is outside.
//!
//! Two simplices are connected where they share a facet. A component is *closed* if each of its facets belongs to
//! exactly two simplices, and *orientable* if the vertex orders can be chosen so that both see the facet in opposite
//! orders. A closed component's normals point outwards at even nesting depth within its object, and into the cavity at
//! odd depth. Open components keep the order they came in, or are turned to face the eye.

use std::ops::Range;

use super::facets::{has_double, sorted_facets};
use super::{Mesh, nesting};
use crate::geometry::{Vector, Vector64, determinant, plane_side, widen};

/// How the open components of an object are oriented.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Orientation<const D: usize> {
    /// By the order of each simplex's vertices.
    Input,
    /// Every simplex on its own turns its normal to where it is seen from.
    Facing(Viewpoint<D>),
}

/// Where a scene is seen from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Viewpoint<const D: usize> {
    /// A point, for a perspective camera.
    Eye(Vector<D>),
    /// The direction towards the eye, for a parallel one.
    Direction(Vector<D>),
}

/// A set of simplices connected through facets.
struct Component {
    simplices: Vec<u32>,
    closed: bool,
}

/// Splits the simplices into components, and finds for each simplex whether it must be turned to agree with the first
/// of its component.
fn components<const D: usize>(corners: &[[u32; D]]) -> (Vec<Component>, Vec<bool>) {
    let mut facets = sorted_facets(corners);
    // A simplex with two equal corners has no facet that isn't doubled or degenerate itself.
    facets.retain(|facet| !has_double(&corners[facet.simplex as usize]));
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
pub fn orient<const D: usize>(mesh: &mut Mesh<D>, simplices: Range<usize>, open: &Orientation<D>) -> (usize, usize) {
    let corners: Vec<[u32; D]> =
        mesh.simplices[simplices.clone()].iter().map(|s| s.map(|v| mesh.identity[v as usize])).collect();
    let (components, turned) = components(&corners);
    let wide = |s: u32| corners[s as usize].map(|v| widen(&mesh.vertices[v as usize]));
    let closed: Vec<&Component> = components.iter().filter(|c| c.closed).collect();
    let points: Vec<[Vector<D>; D]> = corners.iter().map(|s| s.map(|v| mesh.vertices[v as usize])).collect();
    let depths = nesting::depths(&points, &closed.iter().map(|c| &c.simplices[..]).collect::<Vec<_>>());
    let mut flip = vec![false; corners.len()];
    for (component, depth) in closed.iter().zip(depths) {
        // D! times the enclosed measure, by the divergence theorem, about a corner of the component.
        let origin = wide(component.simplices[0])[0];
        let volume: f64 = (component.simplices.iter())
            .map(|&s| {
                let edges: [Vector64<D>; D] = wide(s).map(|v| v - origin);
                determinant(&edges) * if turned[s as usize] { -1.0 } else { 1.0 }
            })
            .sum();
        // det[v_i - p] is minus the height of p above the simplex: positive if the normal points away from p.
        let inward = volume < 0.0;
        let cavity = depth % 2 == 1;
        for &s in &component.simplices {
            flip[s as usize] = turned[s as usize] ^ inward ^ cavity;
        }
    }
    if let Orientation::Facing(viewpoint) = open {
        for &s in components.iter().filter(|c| !c.closed).flat_map(|c| &c.simplices) {
            flip[s as usize] = match viewpoint {
                Viewpoint::Eye(eye) => plane_side(&points[s as usize], eye) < 0,
                Viewpoint::Direction(d) => crate::geometry::normal_of(&wide(s)).dot(&widen(d)) < 0.0,
            };
        }
    }
    let counts = (components.len(), closed.len());
    for (simplex, _) in mesh.simplices[simplices].iter_mut().zip(flip).filter(|(_, flip)| *flip) {
        simplex.swap(D - 2, D - 1);
    }
    counts
}
