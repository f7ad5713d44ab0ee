//! Connected parts of a surface, and leaving out the small ones: the dust of noisy images.

use super::super::lattice::compact;
use crate::mesh::{Surface, UnionFind};

/// The surface without those connected parts that have fewer simplices than this. Simplices are connected if they share
/// a vertex. The order of what stays is kept.
pub fn at_least<const D: usize>(surface: Surface<D>, simplices: u64) -> Surface<D> {
    let mut parts = UnionFind::new(surface.vertices.len());
    for simplex in &surface.simplices {
        simplex[1..].iter().for_each(|&vertex| parts.join(simplex[0], vertex));
    }
    let mut sizes = vec![0u64; surface.vertices.len()];
    let roots: Vec<u32> = surface.simplices.iter().map(|simplex| parts.root(simplex[0])).collect();
    roots.iter().for_each(|&root| sizes[root as usize] += 1);
    let large = surface.simplices.iter().zip(&roots).filter(|(_, root)| sizes[**root as usize] >= simplices);
    let (used, kept) = compact(large.map(|(simplex, _)| *simplex).collect());
    let vertices = used.into_iter().map(|vertex| surface.vertices[vertex as usize]).collect();
    Surface { vertices, simplices: kept, normals: None }
}
