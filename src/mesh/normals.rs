//! Measure-weighted vertex normals.
//!
//! The generalised cross product of a simplex's edges has a length of (D-1)! times its measure, so the plain sum over
//! the simplices around a vertex is the measure-weighted normal. Within one object, points with identical coordinates
//! share their normal.

use std::ops::Range;

use super::Mesh;
use super::copies::Sides;
use crate::geometry::{Vector64, narrow, normal_of, widen};

/// Sets the normals of one object's vertices from its simplices. A vertex whose sum vanishes, as on a sheet folded
/// flat, takes the normal of its first simplex; one without simplices keeps zero.
pub(super) fn set_vertex_normals<const D: usize>(
    mesh: &mut Mesh<D>,
    vertices: Range<usize>,
    simplices: Range<usize>,
    sides: &Sides,
) {
    let first = vertices.start;
    let mut slots = vec![usize::MAX; vertices.len()];
    // Identities may point into an earlier object; within this one the lowest vertex with that identity stands for it.
    let mut lowest = std::collections::HashMap::with_capacity(vertices.len());
    for v in vertices.clone() {
        slots[v - first] = *lowest.entry(mesh.identity[v]).or_insert(v - first);
    }
    let mut sums = vec![Vector64::<D>::zeros(); vertices.len()];
    let mut fallback = vec![Vector64::<D>::zeros(); vertices.len()];
    for s in simplices.filter(|&s| sides.leader(s as u32).is_none()) {
        let simplex = &mesh.simplices[s];
        let normal = normal_of(&simplex.map(|v| widen(&mesh.vertices[v as usize])));
        for &v in simplex {
            let slot = slots[v as usize - first];
            sums[slot] += normal;
            if fallback[slot].amax() == 0.0 {
                fallback[slot] = normal;
            }
        }
    }
    for v in vertices {
        let slot = slots[v - first];
        let scale = fallback[slot].norm();
        let sum = if sums[slot].norm() > 1e-12 * scale { sums[slot] } else { fallback[slot] };
        mesh.normals[v] = unit(&sum);
    }
}

/// The vector at length 1, in `f32`; zero stays zero.
pub fn unit<const D: usize>(v: &Vector64<D>) -> crate::geometry::Vector<D> {
    // Scaled first, so that squares neither overflow nor vanish.
    let largest = v.amax();
    if largest > 0.0 && largest.is_finite() {
        let scaled = v / largest;
        narrow(&(scaled / scaled.norm()))
    } else {
        narrow(&Vector64::zeros())
    }
}

/// The same, but that a vector of length 1, as well as `f32` can say, stays as it is: a mesh that is written and read has
/// the very normals that it had.
pub fn unit_if_not<const D: usize>(v: &Vector64<D>) -> crate::geometry::Vector<D> {
    let rounded = narrow(v);
    let length = widen(&rounded).norm();
    if (length - 1.0).abs() < 1e-6 { rounded } else { unit(v) }
}
