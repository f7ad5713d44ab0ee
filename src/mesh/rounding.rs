//! Simplices that turn over when their corners are rounded to `f32`.
//!
//! Rounding moves each corner by half a unit in the last place of its largest coordinate. A simplex whose height is not many
//! times that may come out flat or facing the other way: where its surface was smooth there is then a fold, which rays
//! hit and which shadows its neighbours.

use rayon::prelude::*;

use super::Surface;
use crate::geometry::{Vector64, narrow, normal_of, widen};

/// How long a normal must be, in terms of the product of the edges, to point anywhere rather than be rounding itself.
const FLAT: f64 = 1e-12;

/// The simplices whose normal is turned by a right angle or more once their corners are rounded, ascending. Those that are flat
/// before that are left out, and so are those that name a vertex that isn't there.
pub fn turned_over<const D: usize>(surface: &Surface<D>) -> Vec<u32> {
    let turns = |simplex: &[u32; D]| {
        if simplex.iter().any(|&v| v as usize >= surface.vertices.len()) {
            return false;
        }
        let before = simplex.map(|v| surface.vertices[v as usize]);
        let after: [Vector64<D>; D] = before.each_ref().map(|point| widen(&narrow(point)));
        let edges: f64 = (1..D).map(|i| (before[i] - before[0]).norm()).product();
        let normal = normal_of(&before);
        normal.norm() > FLAT * edges && normal.dot(&normal_of(&after)) <= 0.0
    };
    let count = surface.simplices.len() as u32;
    (0..count).into_par_iter().filter(|&s| turns(&surface.simplices[s as usize])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check<const D: usize>() {
        // A corner lifted above the facet opposite to it, and far from the origin, where steps are as large as that.
        let corner = |i: usize| Vector64::<D>::from_fn(|r, _| f64::from(i > 0 && r == i - 1));
        let mut vertices: Vec<Vector64<D>> = (0..D).map(corner).collect();
        let middle: Vector64<D> = vertices[..D - 1].iter().sum::<Vector64<D>>() / (D - 1) as f64;
        vertices[D - 1] = middle + Vector64::from_fn(|r, _| if r == D - 2 { 1e-3 } else { 0.0 });
        let simplices = vec![std::array::from_fn(|i| i as u32)];
        let mut surface = Surface { vertices, simplices, normals: None };
        assert!(turned_over(&surface).is_empty());
        surface.vertices.iter_mut().for_each(|v| *v += Vector64::repeat(1e6));
        assert_eq!(turned_over(&surface), [0]);
        surface.vertices[D - 1] = surface.vertices[0];
        assert!(turned_over(&surface).is_empty(), "flat from the beginning");
    }

    #[test]
    fn slivers_far_away_turn_over() {
        check::<3>();
        check::<4>();
    }
}
