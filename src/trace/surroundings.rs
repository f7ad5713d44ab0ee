//! What the mesh right around a shading point hides, and whether a ray from there escapes.
//!
//! No ray can be traced against a simplex that has the ray's origin as a corner: it would hit at distance 0. What such a
//! simplex hides is a cone of directions instead, spanned by its edges from there and by the inverted normal, or by the
//! inverse of another way to the vertex where other faces or bodies meet it ([`crate::mesh::approach`]). All the
//! simplices around a vertex are its star.

use crate::accel::Tracer;
use crate::geometry::{Column, Cone, Frame, Ray, Vector, widen};
use crate::mesh::{Mesh, approach};

use super::point::ShadingPoint;

/// What a simplex with a corner at the point hides: the cone of its edges from there and -approach. None if it is wholly
/// below the tangent hyperplane, and hides nothing above it.
pub(super) fn star_cone<const D: usize>(
    mesh: &Mesh<D>,
    position: Vector<D>,
    [normal, approach]: [Vector<D>; 2],
    identity: u32,
    simplex: u32,
) -> Option<Cone<D>> {
    let mut columns = [Column::vector(-approach); D];
    let mut rises = false;
    let others = mesh.simplices[simplex as usize].into_iter();
    for (column, v) in columns.iter_mut().zip(others.filter(|&v| mesh.identity[v as usize] != identity)) {
        let other = mesh.vertices[v as usize];
        *column = Column::edge(other, position);
        let edge = widen(&other) - widen(&position);
        rises |= edge.dot(&widen(&normal)) > 0.0;
    }
    rises.then(|| Cone::new(columns))
}

/// What the simplices around a vertex hide: a cone each, with the simplex. Of a point that is no vertex there is none.
pub(super) fn star<const D: usize>(tracer: &Tracer<D>, point: &ShadingPoint<D>) -> Vec<(u32, Cone<D>)> {
    let ShadingPoint::Vertex(vertex) = *point else { return Vec::new() };
    let mesh = tracer.mesh();
    let (position, normal) = (mesh.vertices[vertex as usize], mesh.normals[vertex as usize]);
    let identity = mesh.identity[vertex as usize];
    let around = tracer.incidence().around(identity);
    let ways = [normal, approach(mesh, around, vertex)];
    let cone = |&simplex: &u32| Some((simplex, star_cone(mesh, position, ways, identity, simplex)?));
    around.iter().filter_map(cone).collect()
}

/// What a ray meets, and where on it, in barycentric coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Met<const D: usize> {
    pub simplex: u32,
    pub barycentric: [f64; D],
}

/// A shading point with all that decides whether a ray from there escapes. This is the slow way, which defines it.
#[derive(Clone, Debug)]
pub struct Surroundings<const D: usize> {
    /// Where the rays start.
    pub position: Vector<D>,
    /// The middle of the hemisphere; of length 1, or zero if there is none.
    pub normal: Vector<D>,
    /// What the vertex star hides, simplex by simplex.
    star: Vec<(u32, Cone<D>)>,
    /// The simplices this point is inside of.
    ignored: Vec<u32>,
}

impl<const D: usize> Surroundings<D> {
    /// Those of a point.
    pub fn of(tracer: &Tracer<D>, point: &ShadingPoint<D>) -> Self {
        let mesh = tracer.mesh();
        Self {
            position: point.position(mesh),
            normal: point.normal(mesh),
            star: star(tracer, point),
            ignored: point.ignored(tracer),
        }
    }

    /// The local frame, around the normal.
    pub fn frame(&self) -> Frame<D> {
        Frame::new(&self.normal)
    }

    /// Whether the vertex star hides the ray's direction.
    #[inline]
    pub(crate) fn hides(&self, ray: &Ray<D>) -> bool {
        self.star.iter().any(|(_, cone)| cone.contains(&ray.direction))
    }

    /// The visibility V of a direction: whether a ray escapes, or reaches `limit`.
    #[inline]
    pub fn is_visible(&self, tracer: &Tracer<D>, direction: Vector<D>, limit: f32) -> bool {
        let ray = Ray::new(self.position, direction);
        !self.hides(&ray) && !tracer.occluded_by_others(&ray, limit, &self.ignored)
    }

    /// What a ray in this direction meets first; none if it is visible.
    pub(super) fn meets(&self, tracer: &Tracer<D>, direction: Vector<D>, limit: f32) -> Option<Met<D>> {
        let (ray, mesh) = (Ray::new(self.position, direction), tracer.mesh());
        if let Some(&(simplex, _)) = self.star.iter().find(|(_, cone)| cone.contains(&ray.direction)) {
            // Met at the vertex itself.
            let here = |v: u32| f64::from(u8::from(mesh.vertices[v as usize] == self.position));
            return Some(Met { simplex, barycentric: mesh.simplices[simplex as usize].map(here) });
        }
        let hit = tracer.closest_hit_of_others(&ray, &self.ignored)?;
        (hit.t <= f64::from(limit)).then_some(Met { simplex: hit.simplex, barycentric: hit.barycentric })
    }
}
