//! Simplices that lie one on the other: with the same corners, whatever their order.
//!
//! Files hold them where a surface is listed twice, and where a sheet is to have two sides, each simplex once in either
//! order. All of them hide the same, so one of them, the *first*, stands for all where rays and what they hit are
//! concerned; which of two sides is seen is decided by who looks. Their number and their order then decide nothing.
//!
//! Flaps of closed bodies are something else: where vertices nearly coincide, rounding folds parts of a body flat, and two of
//! its simplices lie one on the other, facing opposite ways. They are no sheet; what lies between them is the body's
//! inside or its outside, and they go on hiding one another.

use std::collections::{HashMap, HashSet};
use std::ops::Range;

use rayon::prelude::*;

use super::facets::{sort_with_parity, sorted_facets};
use super::{Mesh, UnionFind};

/// Which simplices lie on another.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Copies {
    /// Each simplex but the first of its place, and that first one; ascending.
    firsts: Vec<[u32; 2]>,
    /// The first of each place that has several, and each simplex there; ascending.
    members: Vec<[u32; 2]>,
}

impl Copies {
    /// Finds them. `corners` are points that are the same only if their numbers are, one set a simplex; those for which
    /// `counts` is false lie on nothing.
    pub fn find<const D: usize>(corners: &[[u32; D]], counts: impl Fn(u32) -> bool + Sync) -> Self {
        let sorted = |s: u32| {
            let mut key = corners[s as usize];
            key.sort_unstable();
            (key, s)
        };
        let mut places: Vec<([u32; D], u32)> =
            (0..corners.len() as u32).into_par_iter().filter(|&s| counts(s)).map(sorted).collect();
        places.par_sort_unstable();
        let mut copies = Self::default();
        let several = || places.chunk_by(|a, b| a.0 == b.0).filter(|place| place.len() > 1);
        if several().next().is_none() {
            return copies;
        }
        let odd = |place: &[([u32; D], u32)]| place.iter().filter(|(_, s)| is_odd(corners[*s as usize])).count();
        let are_opposed = |place: &&[([u32; D], u32)]| (1..place.len()).contains(&odd(place));
        let opposed: HashSet<u32> = several().filter(are_opposed).flatten().map(|&(_, s)| s).collect();
        let bodies = if opposed.is_empty() { Vec::new() } else { bodies(corners, &opposed) };
        let is_flap = |s: u32| opposed.contains(&s) && bodies[s as usize];
        for place in several().filter(|place| !is_flap(place[0].1)) {
            let first = place[0].1;
            copies.firsts.extend(place[1..].iter().map(|&(_, s)| [s, first]));
            copies.members.extend(place.iter().map(|&(_, s)| [first, s]));
        }
        copies.firsts.sort_unstable();
        copies.members.sort_unstable();
        copies
    }

    /// How many simplices lie on an earlier one.
    pub fn len(&self) -> usize {
        self.firsts.len()
    }

    /// Whether no simplex lies on another.
    pub fn is_empty(&self) -> bool {
        self.firsts.is_empty()
    }

    /// Those that lie on an earlier one, ascending, each with the first of its place.
    pub fn iter(&self) -> impl Iterator<Item = (u32, u32)> + '_ {
        self.firsts.iter().map(|&[copy, first]| (copy, first))
    }

    /// The first of those in the place of a simplex; mostly the simplex itself.
    #[inline]
    pub fn first(&self, simplex: u32) -> u32 {
        if self.firsts.is_empty() {
            return simplex;
        }
        let place = self.firsts.binary_search_by_key(&simplex, |pair| pair[0]);
        place.map_or(simplex, |i| self.firsts[i][1])
    }

    /// All in the place of a simplex that is the first there, ascending; none if it is alone.
    pub fn members(&self, first: u32) -> impl ExactSizeIterator<Item = u32> + '_ {
        self.members_within(first, &(0..usize::MAX))
    }

    /// Those of them that are in this range.
    pub fn members_within(&self, first: u32, simplices: &Range<usize>) -> impl ExactSizeIterator<Item = u32> + '_ {
        let before = |end: usize| self.members.partition_point(|&[f, s]| (f, s as usize) < (first, end));
        self.members[before(simplices.start)..before(simplices.end)].iter().map(|pair| pair[1])
    }
}

/// Whether each simplex belongs to a closed body: to simplices connected by facets, of which every facet is used as often
/// in one direction as in the other, and not only because all simplices are `opposed` to others in their place, as a sheet's two sides are.
fn bodies<const D: usize>(corners: &[[u32; D]], opposed: &HashSet<u32>) -> Vec<bool> {
    let count = corners.len();
    let mut sets = UnionFind::new(count);
    let facets = sorted_facets(corners);
    let around = || facets.chunk_by(|a, b| a.corners == b.corners);
    around().flat_map(|facet| facet.windows(2)).for_each(|pair| sets.join(pair[0].simplex, pair[1].simplex));
    let (mut closed, mut solid) = (vec![true; count], vec![false; count]);
    for facet in around().filter(|facet| 2 * facet.iter().filter(|f| f.turned).count() != facet.len()) {
        closed[sets.root(facet[0].simplex) as usize] = false;
    }
    for s in (0..count as u32).filter(|s| !opposed.contains(s)) {
        solid[sets.root(s) as usize] = true;
    }
    (0..count as u32)
        .map(|s| {
            let root = sets.root(s) as usize;
            closed[root] && solid[root]
        })
        .collect()
}

/// Whether an odd number of exchanges sorts the corners. Two simplices with the same corners face the same way if they agree
/// in this.
fn is_odd<const D: usize>(mut corners: [u32; D]) -> bool {
    sort_with_parity(&mut corners)
}

/// What the simplices that lie one on the other within an object are to its normals: those that face the same way
/// count once, and those that face opposite ways are two sides, which have nothing to do with each other.
#[derive(Clone, Debug, Default)]
pub(super) struct Sides {
    repeats: HashMap<u32, u32>,
    two_sided: HashSet<u32>,
}

impl Sides {
    /// Finds them in a mesh whose simplices are oriented.
    pub fn find<const D: usize>(mesh: &Mesh<D>) -> Self {
        let mut sides = Self::default();
        for place in mesh.copies.members.chunk_by(|a, b| a[0] == b[0]) {
            let key = |s: u32| (mesh.object_of(s), is_odd(mesh.places_of(s)));
            let mut leaders: HashMap<(usize, bool), u32> = HashMap::new();
            for &[_, s] in place {
                let leader = *leaders.entry(key(s)).or_insert(s);
                if leader != s {
                    sides.repeats.insert(s, leader);
                }
            }
            let members = place.iter().map(|pair| pair[1]);
            sides.two_sided.extend(members.filter(|&s| {
                let (object, odd) = key(s);
                leaders.contains_key(&(object, !odd))
            }));
        }
        sides
    }

    /// The earlier simplex of the same object, in the same place and facing the same way, that stands for this one.
    #[inline]
    pub fn leader(&self, simplex: u32) -> Option<u32> {
        if self.repeats.is_empty() { None } else { self.repeats.get(&simplex).copied() }
    }

    /// Whether another simplex of the same object in the same place faces the other way.
    #[inline]
    pub fn is_two_sided(&self, simplex: u32) -> bool {
        !self.two_sided.is_empty() && self.two_sided.contains(&simplex)
    }

    /// Whether some of these simplices are two-sided.
    pub fn any_two_sided(&self, simplices: &Range<usize>) -> bool {
        self.two_sided.iter().any(|&s| simplices.contains(&(s as usize)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flaps_of_bodies_are_no_sides() {
        // A tetrahedron's surface, and a flap of two triangles along one of its edges; then the flap alone.
        let body = [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]];
        let flap = [[0, 1, 4], [1, 0, 4]];
        let with: Vec<[u32; 3]> = body.into_iter().chain(flap).collect();
        assert!(Copies::find(&with, |_| true).is_empty());
        assert_eq!(Copies::find(&flap, |_| true).iter().collect::<Vec<_>>(), [(1, 0)]);
        // Beside an open sheet the flap is one of two sides; and a body listed twice is one.
        let open: Vec<[u32; 3]> = body[1..].iter().copied().chain(flap).collect();
        assert_eq!(Copies::find(&open, |_| true).len(), 1);
        let twice: Vec<[u32; 3]> = body.into_iter().chain(body).collect();
        assert_eq!(Copies::find(&twice, |_| true).len(), 4);
    }

    #[test]
    fn places_are_found_whatever_the_order() {
        let corners = [[5, 2, 9], [1, 2, 3], [9, 5, 2], [2, 5, 9], [3, 1, 2], [7, 7, 7], [7, 7, 7]];
        let copies = Copies::find(&corners, |s| s < 5);
        assert_eq!(copies.iter().collect::<Vec<_>>(), [(2, 0), (3, 0), (4, 1)]);
        assert_eq!([0, 1, 2, 3, 4, 5, 6].map(|s| copies.first(s)), [0, 1, 0, 0, 1, 5, 6]);
        assert_eq!(copies.members(0).collect::<Vec<_>>(), [0, 2, 3]);
        assert_eq!(copies.members_within(0, &(1..3)).collect::<Vec<_>>(), [2]);
        assert_eq!((copies.members(1).len(), copies.members(2).len(), copies.members(5).len()), (2, 0, 0));
        assert_eq!([0, 2, 3].map(|s| is_odd(corners[s])), [true, true, false]);
    }
}
