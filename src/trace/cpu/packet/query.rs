//! What is asked: which rays from a point hit a mesh.

use super::directions::{BLOCK, Rays};
use crate::accel::{Tracer, WideBvh};
use crate::geometry::{Ray, Vector};

/// One shading point among the simplices of a mesh.
pub(super) struct Query<'t, const D: usize> {
    pub tracer: &'t Tracer<D>,
    pub wide: &'t WideBvh<D>,
    pub position: Vector<D>,
    /// The position in the coordinates of the leaves.
    pub scaled: Vector<D>,
    /// The position in the coordinates of the boxes.
    pub centred: Vector<D>,
    /// All rays surely go to this side, if it isn't zero.
    pub normal: Vector<D>,
    /// Hits beyond it don't count.
    pub limit: f32,
    /// The simplices that rays don't hit.
    pub ignored: &'t [u32],
}

impl<'t, const D: usize> Query<'t, D> {
    pub fn new(tracer: &'t Tracer<D>, position: Vector<D>, normal: Vector<D>, limit: f32, ignored: &'t [u32]) -> Self {
        let wide = tracer.wide();
        let (scaled, centred) = (wide.scale.scaled(&position), wide.scale.centred(&position));
        Self { tracer, wide, position, scaled, centred, normal, limit, ignored }
    }

    /// A ray of a block, for exact arithmetic.
    pub fn ray(&self, rays: &Rays<D>, i: usize) -> Ray<D> {
        Ray::new(self.position, Vector::from_fn(|k, _| rays.direction[k][i]))
    }

    /// Which of the rays `alive` hit what lies apart.
    pub fn hits_far(&self, rays: &Rays<D>, alive: u64) -> u64 {
        let Self { tracer, limit, ignored, .. } = *self;
        let far = &self.wide.far;
        let hits = |i: &usize| {
            let ray = self.ray(rays, *i);
            far.any(&ray, limit, |simplex| !ignored.contains(&simplex) && tracer.hits(simplex, &ray, limit))
        };
        (0..BLOCK).filter(|i| alive >> i & 1 == 1).filter(hits).fold(0, |found, i| found | 1 << i)
    }

    /// The limit in the coordinates of the boxes, and a little more.
    pub fn box_limit(&self) -> f32 {
        (f64::from(self.limit) * self.wide.scale.factor * (1.0 + 1e-5)) as f32
    }
}
