//! Simplices that lie in one hyperplane and overlap: sheets with two sides, or listed twice.
//!
//! Where two simplices share their corners the mesh knows ([`crate::mesh::Copies`]). Sheets may be cut into simplices in
//! different ways, though, or overlap in part. So whoever stands on a simplex asks what else lies exactly there: such
//! simplices don't hide anything from a point in their own hyperplane, and one that is seen at the same distance as another
//! may be the one that faces the eye.

use super::Tracer;
use crate::geometry::{Aabb, Cone, Ray, Vector, narrow, normal_of, plane_side, widen};
use crate::mesh::normals::unit;

/// Steps of the coordinates that a point on a simplex may be beside it, once it is rounded.
const STEPS: f32 = 4.0 * f32::EPSILON;

impl<const D: usize> Tracer<D> {
    /// The simplices that hide nothing from a point inside one of them: that one, or what stands for it, and those in its
    /// hyperplane that the point is inside of too; ascending.
    pub fn underfoot(&self, simplex: u32, position: &Vector<D>) -> Vec<u32> {
        let mesh = self.mesh();
        if simplex as usize >= mesh.simplices.len() {
            return Vec::new();
        }
        let (first, own) = (mesh.copies.first(simplex), mesh.corners(simplex));
        let room = (position.amax() * STEPS).max(f32::MIN_POSITIVE);
        let near = |bounds: &Aabb<D>| {
            (0..D).all(|k| bounds.min[k] - room <= position[k] && position[k] <= bounds.max[k] + room)
        };
        let mut found = vec![first];
        let mut normal: Option<Vector<D>> = None;
        self.around(position, room, |other| {
            let corners = mesh.corners(other);
            if other != first && near(&Aabb::of(&corners)) {
                // Seen from far above the point, the other simplex is straight below. Most neighbours are not, which is
                // told quickly; that those of a flat face lie in one hyperplane takes exact arithmetic.
                let normal = normal.get_or_insert_with(|| unit(&normal_of(&own.map(|c| widen(&c)))));
                let height = corners.iter().map(|c| (c - position).amax()).fold(0.0, f32::max);
                let above = narrow(&(widen(position) + widen(normal) * f64::from(height)));
                let below = || Cone::of_simplex(&above, &corners).contains(&-*normal);
                if below() && corners.iter().all(|c| plane_side(&own, c) == 0) {
                    found.push(other);
                }
            }
        });
        found.sort_unstable();
        found
    }

    /// Of the simplices that a ray meets where it hits `simplex`, at exactly the same distance, the first that faces
    /// where the ray comes from; none if none does.
    pub fn facing_there(&self, ray: &Ray<D>, simplex: u32) -> Option<u32> {
        let mesh = self.mesh();
        let faces = |s: &u32| plane_side(&mesh.corners(*s), &ray.origin) > 0;
        let in_place = |first: u32| {
            let alone = mesh.copies.members(first).len() == 0;
            if alone { Some(first).filter(faces) } else { mesh.copies.members(first).find(faces) }
        };
        let cone = Cone::of_simplex(&ray.origin, &mesh.corners(simplex));
        if !cone.contains(&ray.direction) {
            return None;
        }
        let here = cone.crossing(&ray.direction);
        let limit = ((here.t + here.error) as f32) * (1.0 + 4.0 * f32::EPSILON);
        let mut best: Option<u32> = None;
        self.bvh().any(ray, limit, |other| {
            let cone = Cone::of_simplex(&ray.origin, &mesh.corners(other));
            if cone.contains(&ray.direction) {
                let there = cone.crossing(&ray.direction);
                let near = (there.t - here.t).abs() <= there.error + here.error;
                if near
                    && self.exact_order(ray, other, &cone, simplex).is_eq()
                    && let Some(found) = in_place(other)
                {
                    best = Some(best.map_or(found, |best| best.min(found)));
                }
            }
            false
        });
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vector64;
    use crate::mesh::{MeshBuilder, Orientation, Surface};

    fn check<const D: usize>() {
        // On a lattice, so that much overlaps.
        let mut state = 3u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from((state >> 24) % 4)
        };
        let mut surface = Surface::<D> { vertices: Vec::new(), simplices: Vec::new(), normals: None };
        for s in 0..300 {
            surface.vertices.extend((0..D).map(|_| Vector64::<D>::from_fn(|_, _| random())));
            surface.simplices.push(std::array::from_fn(|i| (s * D + i) as u32));
        }
        let mut builder = MeshBuilder::new();
        builder.add("soup", [1.0; 3], &surface, Orientation::Input).unwrap();
        let mesh = std::sync::Arc::new(builder.finish());
        let [binary, wide] = [Tracer::new(mesh.clone()), Tracer::new(mesh.clone())];
        binary.prepare();
        wide.prepare_wide();
        assert!(!wide.is_prepared(), "the binary tree is kept beside the wide one");
        assert_eq!(wide.spatial_order(), binary.spatial_order());
        let mut several = 0;
        for simplex in 0..mesh.simplices.len() as u32 {
            let middle = mesh.corners(simplex).iter().sum::<Vector<D>>() / D as f32;
            let found = binary.underfoot(simplex, &middle);
            assert_eq!(wide.underfoot(simplex, &middle), found);
            several += usize::from(found.len() > 1);
        }
        assert!(!wide.is_prepared() && several > 0, "{several}");
    }

    #[test]
    fn either_hierarchy_finds_what_lies_in_one_hyperplane() {
        check::<3>();
        check::<4>();
    }
}
