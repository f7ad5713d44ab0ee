//! Points on surfaces as rays can start from them: well inside their simplex.
//!
//! A visible point is rounded to `f32`, which may put it beside the simplex that is seen and a hair below a neighbour. Rays
//! then start behind that neighbour, and half of them are hidden by it: where voxel centres lie on facets, as they do in scenes
//! with the image's symmetry, single voxels come out dark. So a point near its simplex's border is moved inwards, by more
//! than rounding can move it out, and by far less than a voxel.

use crate::geometry::{Vector, Vector64, narrow, widen};
use crate::mesh::Mesh;

/// How many steps of the coordinates a point keeps from its simplex's facets. Of the rays that would start behind a neighbour those
/// below a slope of one in so many still do.
const STEPS: f64 = 256.0 * f32::EPSILON as f64;

/// The most that a barycentric coordinate is raised to, in simplices that are hardly larger than steps of their coordinates.
const MOST: f64 = 0.125;

/// A visible point of a simplex, or one beside it that is farther from all facets.
pub(super) fn inside<const D: usize>(mesh: &Mesh<D>, simplex: u32, position: &Vector<D>) -> Vector<D> {
    moved(&mesh.corners(simplex).map(|corner| widen(&corner)), position)
}

fn moved<const D: usize>(corners: &[Vector64<D>; D], position: &Vector<D>) -> Vector<D> {
    let (mut weights, mut is_moved) = ([0.0; D], false);
    let room = STEPS * corners.iter().map(|corner| corner.amax()).fold(0.0, f64::max);
    let point = widen(position);
    for corner in 0..D {
        // A barycentric coordinate is the height over the facet, as a share of the corner's.
        let across = across(corners, corner);
        let height = across.norm();
        let least = MOST.min(room / height);
        let weight = across.dot(&(point - corners[(corner + 1) % D])) / (height * height);
        // Nothing is known of it in a simplex without extent.
        let is_far = weight >= least || !weight.is_finite();
        is_moved |= !is_far;
        weights[corner] = if weight.is_finite() { weight.max(least) } else { least };
    }
    if !is_moved {
        return *position;
    }
    let sum: f64 = weights.iter().sum();
    narrow(&(0..D).fold(Vector64::zeros(), |point, c| point + corners[c] * (weights[c] / sum)))
}

/// What leads from the facet of the others to a corner, at right angles; 0 or close to it in flat simplices.
fn across<const D: usize>(corners: &[Vector64<D>; D], corner: usize) -> Vector64<D> {
    let base = corners[(corner + 1) % D];
    let mut across = corners[corner] - base;
    let mut axes = [Vector64::<D>::zeros(); D];
    for next in 2..D {
        let mut axis = corners[(corner + next) % D] - base;
        axes[2..next].iter().for_each(|known| axis -= known * known.dot(&axis));
        axes[next] = axis.try_normalize(0.0).unwrap_or_else(Vector64::zeros);
        across -= axes[next] * axes[next].dot(&across);
    }
    across
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corners<const D: usize>(scale: f64) -> [Vector64<D>; D] {
        std::array::from_fn(|c| Vector64::from_fn(|k, _| if k == c { 3.0 * scale } else { scale }))
    }

    /// The barycentric coordinates in such a simplex: the coordinates less `scale`, over twice of it.
    fn weights<const D: usize>(point: &Vector<D>, scale: f64) -> [f64; D] {
        std::array::from_fn(|k| (f64::from(point[k]) - scale) / (2.0 * scale))
    }

    fn points_keep_away_from_facets_and_stay_where_they_are_inside<const D: usize>() {
        for scale in [1e-20, 1.0, 1e20] {
            let corners = corners::<D>(scale);
            let found = weights(&moved(&corners, &narrow(&corners[0])), scale);
            let height = across(&corners, 1).norm() / scale;
            for (k, weight) in found.iter().enumerate().skip(1) {
                let steps = weight * height / f64::from(f32::EPSILON) / 3.0;
                assert!((200.0..300.0).contains(&steps), "{D}D, {scale}, {k}: {steps}");
            }
            let middle = narrow(&Vector64::<D>::repeat(scale * (1.0 + 2.0 / D as f64)));
            assert_eq!(moved(&corners, &middle), middle);
        }
    }

    #[test]
    fn points_keep_away_from_facets() {
        points_keep_away_from_facets_and_stay_where_they_are_inside::<3>();
        points_keep_away_from_facets_and_stay_where_they_are_inside::<4>();
    }

    #[test]
    fn flat_and_tiny_simplices_give_points_between_their_corners() {
        let flat = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]].map(Vector64::<3>::from);
        let found = moved(&flat, &narrow(&flat[1]));
        assert!(found[1] == 0.0 && found[2] == 0.0 && (0.5..1.5).contains(&found[0]), "{found}");
        let tiny = [[1.0, 0.0, 0.0], [1.0 + 1e-7, 0.0, 0.0], [1.0, 1e-7, 0.0]].map(Vector64::<3>::from);
        let found = moved(&tiny, &narrow(&tiny[0]));
        assert!((f64::from(found[0]) - 1.0).abs() < 2e-7 && (0.0..1e-7).contains(&f64::from(found[1])), "{found}");
    }
}
