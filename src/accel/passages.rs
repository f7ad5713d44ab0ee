//! All surfaces that a ray passes, front to back, not only the first (Steiner and Burton, *Hidden Volumes: The 4th
//! Dimension*, 1987, keep all layers of a voxel).
//!
//! A ray that goes through a facet which two simplices share hits both of them, as hits are defined, and one that touches
//! a silhouette may hit one simplex or five. So where a ray meets boundaries, another one counts: infinitesimally beside it,
//! moved towards the inside of the simplex that the ray sees first ([`Cone::contains_beside`]). That one passes every surface
//! through the inside of a simplex. It still passes first what the ray sees first; from a point outside it passes a closed
//! body an even number of times, in and out in turn, and a convex one twice or never. Distances are those of the ray itself,
//! compared exactly; of several passages at the same distance those into bodies come first, then the lowest index, as for first hits.
//!
//! Simplices that lie one on the other are passed each, as each belongs to a body or is a side of a sheet; of those of one
//! object that face the same way one counts.

use std::cmp::Ordering;

use super::Tracer;
use crate::geometry::{Column, Cone, Ray, plane_side};

/// A place where a ray passes a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Passage {
    /// The simplex.
    pub simplex: u32,
    /// Whether the simplex faces where the ray comes from, so that the ray enters what it bounds; else the ray leaves it.
    pub enters: bool,
}

/// A simplex that a ray hits, of those that stand for all in their place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// The simplex.
    pub simplex: u32,
    /// How near it is, between two numbers: any measure that is the same for all candidates of a ray, larger being nearer.
    pub near: (f32, f32),
    /// Whether the ray surely passes its inside; else perhaps its boundary.
    pub inside: bool,
}

/// What whoever gathers candidates has to say of a simplex, before it is known whether it is hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// It counts as not being there.
    No,
    /// It is wanted if it is hit.
    Yes,
    /// If it is hit, nothing else is wanted.
    Alone,
}

impl<const D: usize> Tracer<D> {
    /// Gathers all simplices that the ray hits at a distance in `(0, limit]`, in no order; or returns true as soon as
    /// there is one that is wanted alone.
    pub fn gather(&self, ray: &Ray<D>, limit: f32, wanted: impl Fn(u32) -> Wanted, found: &mut Vec<Candidate>) -> bool {
        found.clear();
        self.bvh().any(ray, limit, |simplex| {
            let wanted = wanted(simplex);
            if wanted == Wanted::No {
                return false;
            }
            let cone = Cone::of_simplex(&ray.origin, &self.mesh().corners(simplex));
            if !cone.contains(&ray.direction) {
                return false;
            }
            let crossing = cone.crossing(&ray.direction);
            if limit != f32::INFINITY && crossing.t > f64::from(limit) {
                return false;
            }
            if wanted == Wanted::Alone {
                return true;
            }
            let (low, high) = (-(crossing.t + crossing.error), -(crossing.t - crossing.error));
            let near = ((low as f32).next_down(), (high as f32).next_up());
            found.push(Candidate { simplex, near, inside: cone.strictly_contains(&ray.direction) == Some(true) });
            false
        })
    }

    /// Adds to `passages` what the ray passes of these simplices, all of which it hits, front to back. `is_away` says of a
    /// simplex whether it faces away from where the ray comes from.
    pub fn pass(
        &self,
        ray: &Ray<D>,
        candidates: &mut Vec<Candidate>,
        is_away: impl Fn(u32) -> bool,
        passages: &mut Vec<Passage>,
    ) {
        let copies = &self.mesh().copies;
        let passage = |simplex: u32| Passage { simplex, enters: !is_away(simplex) };
        if let ([Candidate { simplex, inside: true, .. }], true) = (candidates.as_slice(), copies.is_empty()) {
            passages.push(passage(*simplex));
            return;
        }
        candidates.sort_unstable_by(|a, b| self.nearer(ray, a, b).then(a.simplex.cmp(&b.simplex)));
        candidates.dedup_by_key(|candidate| candidate.simplex);
        // All in one place, once an object and side.
        let in_place = |first: u32, passages: &mut Vec<Passage>| {
            if copies.members(first).len() == 0 {
                return passages.push(passage(first));
            }
            let start = passages.len();
            let object = |simplex: u32| self.mesh().object_of(simplex);
            for new in copies.members(first).map(passage) {
                let is_new = |p: &Passage| p.enters != new.enters || object(p.simplex) != object(new.simplex);
                if passages[start..].iter().all(is_new) {
                    passages.push(new);
                }
            }
        };
        if candidates.iter().any(|candidate| !candidate.inside) {
            let mut seen = Vec::new();
            candidates[..self.together(ray, candidates)].iter().for_each(|c| in_place(c.simplex, &mut seen));
            if let Some(seen) = seen.iter().min_by_key(|p| rank(p)) {
                let towards = self.mesh().corners(seen.simplex).map(|v| Column::edge(v, ray.origin));
                candidates.retain(|candidate| {
                    let cone = || Cone::of_simplex(&ray.origin, &self.mesh().corners(candidate.simplex));
                    candidate.inside || cone().contains_beside(&ray.direction, &towards)
                });
            }
        }
        let mut rest = candidates.as_slice();
        while !rest.is_empty() {
            let (here, behind) = rest.split_at(self.together(ray, rest));
            let start = passages.len();
            here.iter().for_each(|candidate| in_place(candidate.simplex, passages));
            passages[start..].sort_unstable_by_key(rank);
            rest = behind;
        }
    }

    /// The share of light along a ray, up to `limit`, that the objects' surfaces let through: each that is passed lets
    /// through what its opacity leaves. Simplices for which `ignored` is true, of those that stand for all in their place,
    /// count as not being there.
    pub fn transmitted(&self, ray: &Ray<D>, limit: f32, ignored: impl Fn(u32) -> bool) -> f64 {
        let mesh = self.mesh();
        let opacity = |simplex: u32| mesh.objects[mesh.object_of(simplex)].opacity;
        let wanted = |first: u32| {
            let alone = mesh.copies.members(first).len() == 0;
            let most = if alone { opacity(first) } else { mesh.copies.members(first).map(opacity).fold(0.0, f32::max) };
            match most {
                _ if ignored(first) => Wanted::No,
                opaque if opaque >= 1.0 => Wanted::Alone,
                open if open <= 0.0 => Wanted::No,
                _ => Wanted::Yes,
            }
        };
        let mut found = Vec::new();
        if self.gather(ray, limit, wanted, &mut found) {
            return 0.0;
        }
        let mut passages = Vec::new();
        let is_away = |simplex: u32| plane_side(&mesh.corners(simplex), &ray.origin) < 0;
        self.pass(ray, &mut found, is_away, &mut passages);
        passages.iter().map(|passage| 1.0 - f64::from(opacity(passage.simplex))).product()
    }

    /// How many of the first of these are at exactly the same distance.
    fn together(&self, ray: &Ray<D>, candidates: &[Candidate]) -> usize {
        let Some((first, rest)) = candidates.split_first() else { return 0 };
        1 + rest.iter().take_while(|other| self.nearer(ray, first, other).is_eq()).count()
    }

    /// Which of two is nearer, exactly: `Less` if it is the first.
    #[inline]
    fn nearer(&self, ray: &Ray<D>, a: &Candidate, b: &Candidate) -> Ordering {
        if a.near.0 > b.near.1 {
            Ordering::Less
        } else if b.near.0 > a.near.1 {
            Ordering::Greater
        } else if a.simplex == b.simplex {
            Ordering::Equal
        } else {
            self.distances(ray, a.simplex, b.simplex)
        }
    }
}

/// Which of several passages at the same distance comes first.
fn rank(passage: &Passage) -> (bool, u32) {
    (!passage.enters, passage.simplex)
}
