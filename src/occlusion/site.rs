//! A point at which ambient occlusion is asked for, and what its own surroundings hide.

use crate::accel::Tracer;
use crate::geometry::{Column, Cone, Frame, Ray, Vector, widen};
use crate::mesh::{Incidence, Mesh, approach};

/// What a simplex with a corner at the point hides, as seen on the way to the point from where it is approached: the
/// cone of its edges from there and -approach. None if it is wholly below the tangent hyperplane, and hides nothing above it.
pub(super) fn fold_cone<const D: usize>(
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

/// A shading point: a place, a normal, and the simplices around it that rays can't be traced against.
#[derive(Clone, Debug)]
pub struct Site<const D: usize> {
    /// Where the rays start.
    pub position: Vector<D>,
    /// The middle of the hemisphere; of length 1.
    pub normal: Vector<D>,
    /// The simplices with a corner here that may block something, each as its edges from here and -approach.
    fold: Vec<Cone<D>>,
    /// The simplex this point is inside of.
    ignored: Option<u32>,
}

impl<const D: usize> Site<D> {
    /// A vertex of the mesh, seen as `vertex` of its object.
    pub fn at_vertex(tracer: &Tracer<D>, incidence: &Incidence, vertex: u32) -> Self {
        let mesh = tracer.mesh();
        let position = mesh.vertices[vertex as usize];
        let normal = mesh.normals[vertex as usize];
        let identity = mesh.identity[vertex as usize];
        let around = incidence.around(identity);
        let ways = [normal, approach(mesh, around, vertex)];
        let fold = (around.iter()).filter_map(|&simplex| fold_cone(mesh, position, ways, identity, simplex)).collect();
        Self { position, normal, fold, ignored: None }
    }

    /// A visible point inside a simplex, on the side that its normal points to.
    pub fn inside_simplex(position: Vector<D>, normal: Vector<D>, simplex: u32) -> Self {
        Self { position, normal, fold: Vec::new(), ignored: Some(simplex) }
    }

    /// Its local frame.
    pub fn frame(&self) -> Frame<D> {
        Frame::new(&self.normal)
    }

    /// Whether the simplices with a corner here hide the ray's direction.
    #[inline]
    pub(super) fn hides(&self, ray: &Ray<D>) -> bool {
        self.fold.iter().any(|cone| cone.contains(&ray.direction))
    }

    /// The visibility V of a direction: whether a ray escapes, or reaches `limit`.
    #[inline]
    pub fn is_visible(&self, tracer: &Tracer<D>, direction: Vector<D>, limit: f32) -> bool {
        let ray = Ray::new(self.position, direction);
        !self.hides(&ray) && !tracer.occluded(&ray, limit, self.ignored)
    }
}
