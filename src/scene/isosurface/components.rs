//! Connected parts of a surface, and leaving out the small ones: the dust of noisy images.

use super::super::lattice::compact;
use crate::mesh::Surface;

/// The surface without those connected parts that have fewer simplices than this. Simplices are connected if they share
/// a vertex. The order of what stays is kept.
pub fn at_least<const D: usize>(surface: Surface<D>, simplices: u64) -> Surface<D> {
    let mut parents: Vec<u32> = (0..surface.vertices.len() as u32).collect();
    for simplex in &surface.simplices {
        let first = root(&mut parents, simplex[0]);
        for &vertex in &simplex[1..] {
            let other = root(&mut parents, vertex);
            let first = root(&mut parents, first);
            // The lower one is the root, whatever the order of simplices.
            parents[first.max(other) as usize] = first.min(other);
        }
    }
    let mut sizes = vec![0u64; parents.len()];
    let roots: Vec<u32> = surface.simplices.iter().map(|simplex| root(&mut parents, simplex[0])).collect();
    roots.iter().for_each(|&root| sizes[root as usize] += 1);
    let large = surface.simplices.iter().zip(&roots).filter(|(_, root)| sizes[**root as usize] >= simplices);
    let (used, kept) = compact(large.map(|(simplex, _)| *simplex).collect());
    let vertices = used.into_iter().map(|vertex| surface.vertices[vertex as usize]).collect();
    Surface { vertices, simplices: kept, normals: None }
}

fn root(parents: &mut [u32], mut vertex: u32) -> u32 {
    while parents[vertex as usize] != vertex {
        // Halving the path on the way keeps paths short.
        parents[vertex as usize] = parents[parents[vertex as usize] as usize];
        vertex = parents[vertex as usize];
    }
    vertex
}
