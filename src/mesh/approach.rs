//! From where a vertex is approached: the side of what stands around it that its own simplices are on.
//!
//! A value at a vertex p is the limit of the values at points that come nearer to it, and what simplices around p hide
//! depends on the way: seen from p + e d, for a small e, a simplex with the corner p hides the cone of its edges from p
//! and -d. Where all simplices around p are one smooth piece, d is the normal n. In a fold, or where another body touches,
//! p + e n may lie within the other simplices' hyperplanes or behind them: at the foot of a wall, p + e n is on the wall
//! itself. What is interpolated over a face is to be the limit within that face, so there d is u + n/64, for a direction
//! u from p into one of the face's own simplices; or with a larger share of n where the face is curved, such that p + e d
//! is above all of its simplices.

use super::Mesh;
use crate::geometry::{Vector, Vector64, narrow, normal_of, widen};

/// How much longer the part along the surface is than that along the normal: the first of these that is above all of the
/// vertex's own simplices, else none of it. The first is right in folds down to a degree.
const SHARES: [f64; 4] = [64.0, 16.0, 4.0, 1.0];

/// The direction d for a vertex; `around` are the simplices with a corner in its place, as [`super::Incidence`] has them.
/// A simplex is the vertex's own if it, or one that lies on it, has the vertex's normal there.
pub fn approach<const D: usize>(mesh: &Mesh<D>, around: &[u32], vertex: u32) -> Vector<D> {
    let (normal, identity) = (mesh.normals[vertex as usize], mesh.identity[vertex as usize]);
    let object = mesh.objects.partition_point(|o| o.vertices.end <= vertex as usize);
    let Some(object) = mesh.objects.get(object) else { return normal };
    let has_it = |simplex: u32| {
        mesh.simplices[simplex as usize].iter().any(|&v| {
            let v = v as usize;
            mesh.identity[v] == identity && object.vertices.contains(&v) && mesh.normals[v] == normal
        })
    };
    // The one in this place that is the vertex's own.
    let own = |&first: &u32| {
        let of_object = || mesh.copies.members_within(first, &object.simplices).find(|&s| has_it(s));
        if has_it(first) { Some(first) } else { of_object() }
    };
    if around.iter().all(|first| own(first).is_some()) {
        return normal;
    }
    let owned: Vec<u32> = around.iter().filter_map(own).collect();
    let point = widen(&mesh.vertices[vertex as usize]);
    let corners = |simplex: u32| mesh.corners(simplex).map(|v| widen(&v));
    let inwards: Vec<Vector64<D>> = (owned.iter())
        .filter_map(|&s| {
            let corners = corners(s);
            let sum = corners.iter().fold(Vector64::zeros(), |sum, v| sum + (v - point));
            unit(sum)
        })
        .collect();
    // Into the simplex whose middle is nearest to the middle of all: inside the face, whatever its shape.
    let middle = inwards.iter().fold(Vector64::zeros(), |sum, u| sum + u);
    let Some(inward) = inwards.iter().max_by(|a, b| a.dot(&middle).total_cmp(&b.dot(&middle))) else { return normal };
    let up = widen(&normal);
    let is_above = |d: &Vector64<D>, least: f64| {
        owned.iter().all(|&s| unit(normal_of(&corners(s))).is_none_or(|n| n.dot(d) >= least))
    };
    let ways = SHARES.iter().map(|share| (inward + up / *share, 0.5 / share));
    ways.into_iter().find(|(d, least)| is_above(d, *least)).map_or(normal, |(d, _)| narrow(&d.normalize()))
}

/// The vector at length 1, unless it is zero.
fn unit<const D: usize>(v: Vector64<D>) -> Option<Vector64<D>> {
    let largest = v.amax();
    (largest > 0.0).then(|| (v / largest).normalize())
}
