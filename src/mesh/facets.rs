//! Facets of simplices, told apart by the indices of their corners, and which way they run.
//!
//! A facet is what is left of a simplex without one of its corners: an edge of a triangle, a triangle of a tetrahedron.
//! Sorted, its indices are the same from whichever simplex it is looked at; the parity of the sort, and of the place of
//! the corner left out, is its orientation. So a sort of all facets brings the neighbours together.

use rayon::prelude::*;

/// The corners of a facet, ascending; in 3D the last is `u32::MAX`.
pub type Corners = [u32; 3];

/// A facet as one of its simplices has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Facet {
    /// Which facet it is.
    pub corners: Corners,
    /// The simplex: its place in the list.
    pub simplex: u32,
    /// Whether it runs against the order of `corners` there.
    pub turned: bool,
}

/// Sorts the entries, and tells whether that took an odd number of exchanges.
pub fn sort_with_parity<T: Ord>(entries: &mut [T]) -> bool {
    let mut odd = false;
    for i in 1..entries.len() {
        let mut j = i;
        while j > 0 && entries[j - 1] > entries[j] {
            entries.swap(j - 1, j);
            odd = !odd;
            j -= 1;
        }
    }
    odd
}

/// The facets of one simplex, and whether each is turned. Facets that name a vertex twice are left out: the simplices
/// that have them have no measure, and their other facets cancel.
pub fn facets_of<const D: usize>(simplex: &[u32; D]) -> impl Iterator<Item = (Corners, bool)> + '_ {
    (0..D).filter_map(|left_out| {
        let mut corners = [u32::MAX; 3];
        let others = simplex.iter().enumerate().filter(|(i, _)| *i != left_out);
        corners.iter_mut().zip(others).for_each(|(slot, (_, &vertex))| *slot = vertex);
        let odd = sort_with_parity(&mut corners[..D - 1]);
        let distinct = corners[..D - 1].windows(2).all(|pair| pair[0] < pair[1]);
        distinct.then_some((corners, odd != (left_out % 2 == 1)))
    })
}

/// The facets of all simplices, sorted, so that those with the same corners stand together: `chunk_by` their corners.
pub fn sorted_facets<const D: usize>(simplices: &[[u32; D]]) -> Vec<Facet> {
    let of_simplex = |(s, simplex): (usize, &[u32; D])| -> Vec<Facet> {
        facets_of(simplex).map(|(corners, turned)| Facet { corners, simplex: s as u32, turned }).collect()
    };
    let mut facets: Vec<Facet> = simplices.par_iter().enumerate().flat_map_iter(of_simplex).collect();
    facets.par_sort_unstable();
    facets
}

/// Whether the simplex names a vertex twice, and so has no measure.
pub fn has_double<const D: usize>(simplex: &[u32; D]) -> bool {
    (1..D).any(|i| simplex[..i].contains(&simplex[i]))
}
