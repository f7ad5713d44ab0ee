//! What is asked: which rays from a point hit a mesh.

use super::directions::Rays;
use super::nets::BLOCK;
use crate::accel::{Leaf, Row, Tracer, WideBvh};
use crate::geometry::{Ray, Vector};

/// One shading point among the simplices of a mesh.
pub(super) struct Query<'t, const D: usize> {
    pub tracer: &'t Tracer<D>,
    pub wide: &'t WideBvh<D>,
    /// The nodes and leaves.
    pub rows: &'t [Row],
    pub position: Vector<D>,
    /// The position in the coordinates of the boxes and leaves.
    pub scaled: Vector<D>,
    /// All rays surely go to this side, if it isn't zero.
    pub normal: Vector<D>,
    /// How much they rise to that side at least, as a share of their length.
    pub rise: f32,
    /// Hits beyond it don't count.
    pub limit: f32,
    /// The simplices that rays don't hit.
    pub ignored: &'t [u32],
    /// The identity of the vertex that the rays start from, if they do. Simplices with a corner there are never hit, and left out
    /// before that is asked.
    pub vertex: Option<u32>,
}

impl<'t, const D: usize> Query<'t, D> {
    pub fn new(
        tracer: &'t Tracer<D>,
        position: Vector<D>,
        (normal, rise): (Vector<D>, f32),
        limit: f32,
        ignored: &'t [u32],
        vertex: Option<u32>,
    ) -> Self {
        let wide = tracer.wide();
        let rows = wide.rows();
        Self {
            tracer,
            wide,
            rows,
            position,
            scaled: wide.scale.scaled(&position),
            normal,
            rise,
            limit,
            ignored,
            vertex,
        }
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

    /// The lanes of a leaf with simplices that are to be ignored.
    #[inline(never)]
    pub fn ignored_lanes(&self, leaf: &Leaf<D>) -> u8 {
        self.lanes(leaf, u8::MAX, |simplex| self.ignored.contains(&simplex))
    }

    /// Those of these lanes of a leaf whose simplices have a corner at the vertex that rays start from.
    #[inline(never)]
    pub fn around_lanes(&self, leaf: &Leaf<D>, lanes: u8) -> u8 {
        let mesh = self.tracer.mesh();
        let there = |&corner: &u32| Some(mesh.identity[corner as usize]) == self.vertex;
        self.lanes(leaf, lanes, |simplex| mesh.simplices[simplex as usize].iter().any(there))
    }

    /// Those of these lanes for which this holds, unused ones as the last.
    fn lanes(&self, leaf: &Leaf<D>, lanes: u8, holds: impl Fn(u32) -> bool) -> u8 {
        let simplices = &self.wide.order[leaf.range()];
        let mut found = 0;
        for (lane, &simplex) in simplices.iter().enumerate() {
            if lanes >> lane & 1 == 1 && holds(simplex) {
                let last = lane + 1 == simplices.len();
                found |= if last { u8::MAX << lane } else { 1 << lane };
            }
        }
        found
    }

    /// The limit in the coordinates of the boxes, and a little more.
    pub fn box_limit(&self) -> f32 {
        (f64::from(self.limit) * self.wide.scale.factor * (1.0 + 1e-5)) as f32
    }
}
