//! Which simplices a point is a corner of.

use super::Mesh;

/// For every point, found by its identity, the simplices of any object that have it as a corner, ascending; those of
/// measure zero are left out, and of those that lie one on the other all but the first.
#[derive(Clone, Debug)]
pub struct Incidence {
    starts: Vec<u32>,
    simplices: Vec<u32>,
}

impl Incidence {
    /// Collects them.
    pub fn new<const D: usize>(mesh: &Mesh<D>) -> Self {
        let mut left_out = vec![false; mesh.simplices.len()];
        let copies = mesh.copies.iter().map(|(copy, _)| copy);
        mesh.degenerate.iter().copied().chain(copies).for_each(|s| left_out[s as usize] = true);
        let corners = || {
            let identity = |v: u32| mesh.identity[v as usize] as usize;
            (mesh.simplices.iter().enumerate())
                .filter(|(s, _)| !left_out[*s])
                .flat_map(move |(s, simplex)| simplex.map(|v| (identity(v), s as u32)))
        };
        let mut starts = vec![0u32; mesh.vertices.len() + 1];
        corners().for_each(|(v, _)| starts[v + 1] += 1);
        for v in 0..mesh.vertices.len() {
            starts[v + 1] += starts[v];
        }
        let mut next = starts.clone();
        let mut simplices = vec![0; *starts.last().unwrap_or(&0) as usize];
        for (v, s) in corners() {
            simplices[next[v] as usize] = s;
            next[v] += 1;
        }
        Self { starts, simplices }
    }

    /// The simplices around all points, one point's after the other's.
    pub fn simplices(&self) -> &[u32] {
        &self.simplices
    }

    /// Where those of each identity begin in [`Self::simplices`], and where the last ones end.
    pub fn starts(&self) -> &[u32] {
        &self.starts
    }

    /// The simplices around the point whose identity is `identity`.
    pub fn around(&self, identity: u32) -> &[u32] {
        let i = identity as usize;
        &self.simplices[self.starts[i] as usize..self.starts[i + 1] as usize]
    }
}
