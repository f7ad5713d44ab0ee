//! Where things lie in the order of a hierarchy.

use crate::mesh::Mesh;

/// For each simplex, copies too, and each vertex its place in the order of a hierarchy, a vertex's being that of the first of
/// its simplices. What is close in the order is close in space; what the hierarchy leaves out comes last.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Places {
    of_simplex: Vec<u32>,
    of_vertex: Vec<u32>,
}

impl Places {
    /// What lies nowhere.
    pub const LAST: u32 = u32::MAX;

    pub(super) fn new<const D: usize>(mesh: &Mesh<D>, order: &[u32]) -> Self {
        let (mut of_simplex, mut of_vertex) =
            (vec![Self::LAST; mesh.simplices.len()], vec![Self::LAST; mesh.vertices.len()]);
        for (place, &simplex) in (0..).zip(order) {
            of_simplex[simplex as usize] = place;
        }
        for (copy, first) in mesh.copies.iter() {
            of_simplex[copy as usize] = of_simplex[first as usize];
        }
        for (simplex, &place) in mesh.simplices.iter().zip(&of_simplex) {
            simplex.iter().for_each(|&v| of_vertex[v as usize] = place.min(of_vertex[v as usize]));
        }
        Self { of_simplex, of_vertex }
    }

    /// Of a simplex; [`Places::LAST`] if there is none of this number.
    #[inline]
    pub fn of_simplex(&self, simplex: u32) -> u32 {
        self.of_simplex.get(simplex as usize).copied().unwrap_or(Self::LAST)
    }

    /// Of a vertex.
    #[inline]
    pub fn of_vertex(&self, vertex: u32) -> u32 {
        self.of_vertex[vertex as usize]
    }
}
