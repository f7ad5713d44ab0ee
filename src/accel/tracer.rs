//! Rays against a mesh.
//!
//! Whether a simplex is hit is decided by exact signs ([`Cone`]), so the answers here are those of testing every
//! simplex in turn; the hierarchy only saves the work.

use std::cmp::Ordering;
use std::sync::{Arc, OnceLock};

use super::{Bvh, Places, WideBvh};
use crate::geometry::{Aabb, Cone, Crossing, Ray, Vector};
use crate::mesh::{Incidence, Mesh};

/// A mesh with the hierarchy over its simplices of positive measure, the first of each place, which is made when it is first asked for. It owns
/// the mesh together with whoever else holds it, so it can be kept in anything.
#[derive(Clone, Debug)]
pub struct Tracer<const D: usize> {
    mesh: Arc<Mesh<D>>,
    bvh: OnceLock<Bvh<D>>,
    wide: OnceLock<WideBvh<D>>,
    incidence: OnceLock<Incidence>,
    places: OnceLock<Places>,
}

/// The simplex that a ray hits first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit<const D: usize> {
    /// Which one; of several at exactly the same distance the lowest index.
    pub simplex: u32,
    /// Distance along the ray, in lengths of its direction; above zero.
    pub t: f64,
    /// Barycentric coordinates of the point, in the order of the simplex's corners.
    pub barycentric: [f64; D],
}

impl<const D: usize> Tracer<D> {
    /// Builds nothing yet.
    pub fn new(mesh: impl Into<Arc<Mesh<D>>>) -> Self {
        Self {
            mesh: mesh.into(),
            bvh: OnceLock::new(),
            wide: OnceLock::new(),
            incidence: OnceLock::new(),
            places: OnceLock::new(),
        }
    }

    /// The mesh it was made of.
    pub fn mesh(&self) -> &Arc<Mesh<D>> {
        &self.mesh
    }

    /// Which simplices each vertex is a corner of; made when first asked for.
    pub fn incidence(&self) -> &Incidence {
        self.incidence.get_or_init(|| Incidence::new(&self.mesh))
    }

    /// Builds the hierarchy on all threads, unless it is there. Who is going to trace from many threads calls this
    /// before; else the first of them builds it alone while the others wait.
    pub fn prepare(&self) {
        // Not within `get_or_init`: a thread that waits for its half of the work takes up other work meanwhile, and would
        // wait for itself if that asked for the hierarchy.
        if self.bvh.get().is_none() {
            let _ = self.bvh.set(self.build(true));
        }
    }

    /// Builds the hierarchy that is laid out for SIMD, on all threads, unless it is there. The binary one that it is made of
    /// is kept only if it was there before, or is needed beside it: together they would be half as large again.
    pub fn prepare_wide(&self) {
        if self.wide.get().is_some() {
            return;
        }
        let wide = match self.bvh.get() {
            Some(bvh) => WideBvh::new(bvh, &self.mesh, true),
            None => {
                let (wide, needed) = WideBvh::replacing(self.build(true), &self.mesh, true);
                needed.into_iter().for_each(|bvh| _ = self.bvh.set(bvh));
                wide
            }
        };
        let _ = self.wide.set(wide);
    }

    /// Whether the binary hierarchy is there already.
    pub fn is_prepared(&self) -> bool {
        self.bvh.get().is_some()
    }

    /// The simplices in the order of a hierarchy, whichever there is; that laid out for SIMD may leave out some that lie far
    /// apart.
    pub fn spatial_order(&self) -> &[u32] {
        match (self.bvh.get(), self.wide.get()) {
            (None, Some(wide)) => &wide.order,
            _ => &self.bvh().order,
        }
    }

    /// Where simplices and vertices are in that order; made when first asked for.
    pub fn places(&self) -> &Places {
        self.places.get_or_init(|| Places::new(&self.mesh, self.spatial_order()))
    }

    /// Calls `visit` for all simplices, and maybe some others, whose boxes are within `room` of the point on each axis.
    pub(super) fn around(&self, point: &Vector<D>, room: f32, visit: impl FnMut(u32)) {
        if let Some(wide) = self.wide.get().filter(|wide| wide.is_whole() && wide.serves(point)) {
            wide.around(point, room, visit);
            return;
        }
        let near =
            |bounds: &Aabb<D>| (0..D).all(|k| bounds.min[k] - room <= point[k] && point[k] <= bounds.max[k] + room);
        self.bvh().within(near, visit);
    }

    /// The binary hierarchy; made when first asked for, on one thread.
    #[inline]
    pub fn bvh(&self) -> &Bvh<D> {
        self.bvh.get_or_init(|| self.build(false))
    }

    fn build(&self, parallel: bool) -> Bvh<D> {
        let mut solid: Vec<u32> = (0..self.mesh.simplices.len() as u32).collect();
        if !self.mesh.degenerate.is_empty() {
            solid.retain(|s| self.mesh.degenerate.binary_search(s).is_err());
        }
        // A ray that hits several in one place hits the first.
        if !self.mesh.copies.is_empty() {
            solid.retain(|&s| self.mesh.copies.first(s) == s);
        }
        Bvh::build(&solid, |s| Aabb::of(&self.mesh.corners(s)), parallel)
    }

    /// The same hierarchy laid out for SIMD; made when first asked for, on one thread.
    pub fn wide(&self) -> &WideBvh<D> {
        self.wide.get_or_init(|| WideBvh::new(self.bvh(), &self.mesh, false))
    }

    /// Whether the ray hits this simplex at a distance in `(0, limit]`.
    #[inline]
    pub fn hits(&self, simplex: u32, ray: &Ray<D>, limit: f32) -> bool {
        let cone = Cone::of_simplex(&ray.origin, &self.mesh.corners(simplex));
        cone.contains(&ray.direction) && (limit == f32::INFINITY || cone.crossing(&ray.direction).t <= f64::from(limit))
    }

    /// Whether the ray hits any simplex but `ignored` at a distance in `(0, limit]`.
    #[inline]
    pub fn occluded(&self, ray: &Ray<D>, limit: f32, ignored: Option<u32>) -> bool {
        self.occluded_by_others(ray, limit, ignored.as_slice())
    }

    /// Whether the ray hits any simplex but the `ignored` ones at a distance in `(0, limit]`.
    #[inline]
    pub fn occluded_by_others(&self, ray: &Ray<D>, limit: f32, ignored: &[u32]) -> bool {
        self.bvh().any(ray, limit, |simplex| !ignored.contains(&simplex) && self.hits(simplex, ray, limit))
    }

    /// The simplex that the ray hits first, if any.
    #[inline]
    pub fn closest_hit(&self, ray: &Ray<D>) -> Option<Hit<D>> {
        self.closest_of(ray, |_, _, _| true)
    }

    /// The simplex that the ray hits first of all but the `ignored` ones, if any.
    pub fn closest_hit_of_others(&self, ray: &Ray<D>, ignored: &[u32]) -> Option<Hit<D>> {
        self.closest_of(ray, |simplex, _, _| !ignored.contains(&simplex))
    }

    /// The simplex that the ray hits first behind the place where it hits the simplex `after`: strictly behind, by
    /// exact signs, so that what touches or coincides there is passed over, and layer after layer can be peeled off.
    /// A simplex that the ray doesn't hit bounds nothing.
    pub fn next_hit(&self, ray: &Ray<D>, after: u32) -> Option<Hit<D>> {
        if after as usize >= self.mesh.simplices.len() {
            return self.closest_hit(ray);
        }
        let bound = Cone::of_simplex(&ray.origin, &self.mesh.corners(after));
        if !bound.contains(&ray.direction) {
            return self.closest_hit(ray);
        }
        let bound = bound.crossing(&ray.direction);
        self.closest_of(ray, |simplex, cone, crossing| {
            if simplex == after {
                false
            } else if (crossing.t - bound.t).abs() > crossing.error + bound.error {
                crossing.t > bound.t
            } else {
                self.exact_order(ray, simplex, cone, after) == Ordering::Greater
            }
        })
    }

    /// The first hit of those that `counts` accepts.
    #[inline]
    fn closest_of(&self, ray: &Ray<D>, counts: impl Fn(u32, &Cone<D>, &Crossing<D>) -> bool) -> Option<Hit<D>> {
        let mut best: Option<(Hit<D>, f64)> = None;
        self.bvh().nearest(ray, f32::INFINITY, |simplex, limit| {
            let cone = Cone::of_simplex(&ray.origin, &self.mesh.corners(simplex));
            if !cone.contains(&ray.direction) {
                return limit;
            }
            let crossing = cone.crossing(&ray.direction);
            if !counts(simplex, &cone, &crossing) {
                return limit;
            }
            if let Some((hit, error)) = &best {
                let order = if (crossing.t - hit.t).abs() > crossing.error + error {
                    crossing.t.total_cmp(&hit.t)
                } else {
                    self.exact_order(ray, simplex, &cone, hit.simplex)
                };
                if order.then(simplex.cmp(&hit.simplex)) == Ordering::Greater {
                    return limit;
                }
            }
            let hit = Hit { simplex, t: crossing.t, barycentric: crossing.barycentric };
            best = Some((hit, crossing.error));
            // Rounded up, with room for what ties.
            ((crossing.t + crossing.error) as f32) * (1.0 + 4.0 * f32::EPSILON)
        });
        best.map(|(hit, _)| hit)
    }

    /// Which of two simplices comes first on a ray that hits both: `Less` if it is `a`. Of those at exactly the same
    /// distance it is the one of the lower index, as for [`Tracer::closest_hit`].
    pub fn order(&self, ray: &Ray<D>, a: u32, b: u32) -> Ordering {
        self.distances(ray, a, b).then(a.cmp(&b))
    }

    /// Compares the distances at which a ray hits two simplices, exactly.
    pub(super) fn distances(&self, ray: &Ray<D>, a: u32, b: u32) -> Ordering {
        let [one, two] = [a, b].map(|s| Cone::of_simplex(&ray.origin, &self.mesh.corners(s)));
        let [t, u] = [&one, &two].map(|cone| cone.crossing(&ray.direction));
        if (t.t - u.t).abs() > t.error + u.error { t.t.total_cmp(&u.t) } else { self.exact_order(ray, a, &one, b) }
    }

    /// Compares the distances of two hits exactly, as fractions.
    #[cold]
    pub(super) fn exact_order(&self, ray: &Ray<D>, simplex: u32, cone: &Cone<D>, other: u32) -> Ordering {
        let corners = self.mesh.corners(other);
        // Both hold the point where they share what the ray meets of the one: a facet or less of neighbours, or all, as where
        // two boxes touch.
        let own = self.mesh.corners(simplex);
        if (0..D).all(|i| corners.contains(&own[i]) || cone.is_on_facet(i, &ray.direction)) {
            return Ordering::Equal;
        }
        let other = Cone::of_simplex(&ray.origin, &corners);
        let (a, b) = cone.exact_distance(&ray.direction);
        let (c, d) = other.exact_distance(&ray.direction);
        a.multiply(&d).add(&c.multiply(&b).negate()).sign().cmp(&0)
    }
}
