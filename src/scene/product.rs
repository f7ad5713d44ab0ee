//! Products of simplicial complexes, and their boundaries: the one routine behind boxes, tesseracts and extrusions.
//!
//! A [`Chain`] is a sum of oriented simplices, each kept as its vertices in ascending order and the sign of the sort.
//! The product of two simplices is cut into simplices along *staircases*: paths through the grid of vertex pairs
//! (a_i, b_j) that climb from (a_0, b_0) to the last pair one step at a time. A p-simplex times a q-simplex has
//! (p+q choose p) of them, and the sign of each is that of the shuffle of its steps (Eilenberg and Mac Lane 1953).
//! As the cut depends on the order of the vertices only, neighbouring products agree on what they share, so the whole
//! is a conforming triangulation. Its boundary needs no interior:
//!
//! ```text
//! d(A x B) = dA x B + (-1)^dim A * A x dB
//! ```
//!
//! A positively oriented simplex's boundary faces outwards in the sense of [`crate::geometry::normal_of`]: with
//! d[v_0 ... v_D] = sum of (-1)^i [... v_i left out ...], the facet opposite v_0 has the normal n for which
//! n . (v_1 - v_0) = det[v_1 - v_0, v_2 - v_1, ...] > 0.

use crate::mesh::facets::sort_with_parity;

/// Vertices of the largest simplex a chain holds: a tetrahedron.
const MOST: usize = 4;

/// A sum of oriented simplices of one dimension, of at most four vertices each.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    dimension: usize,
    vertex_count: u32,
    /// Vertices in ascending order, unused places filled with `u32::MAX`; whether the orientation is the opposite.
    simplices: Vec<([u32; MOST], bool)>,
}

impl Chain {
    /// The empty sum of simplices of this dimension, over vertices 0 to `vertex_count` - 1.
    pub fn new(dimension: usize, vertex_count: u32) -> Self {
        assert!(dimension < MOST, "chains hold simplices up to dimension 3, not {dimension}");
        Self { dimension, vertex_count, simplices: Vec::new() }
    }

    /// The interval, in `pieces` pieces.
    pub fn interval(pieces: u32) -> Self {
        let mut chain = Self::new(1, pieces + 1);
        (0..pieces).for_each(|i| chain.push(&[i, i + 1]));
        chain
    }

    /// The sum of these simplices, oriented by the order of their vertices.
    pub fn of<const N: usize>(vertex_count: u32, simplices: &[[u32; N]]) -> Self {
        let mut chain = Self::new(N - 1, vertex_count);
        simplices.iter().for_each(|simplex| chain.push(simplex));
        chain
    }

    /// Adds a simplex; one that names a vertex twice has no measure and adds nothing.
    fn push(&mut self, vertices: &[u32]) {
        let mut sorted = [u32::MAX; MOST];
        sorted[..vertices.len()].copy_from_slice(vertices);
        let odd = sort_with_parity(&mut sorted[..vertices.len()]);
        if sorted[..vertices.len()].windows(2).all(|pair| pair[0] < pair[1]) {
            self.simplices.push((sorted, odd));
        }
    }

    /// The vertices of each simplex, in ascending order, and whether the orientation is the opposite.
    fn iter(&self) -> impl Iterator<Item = (&[u32], bool)> {
        self.simplices.iter().map(|(vertices, negative)| (&vertices[..=self.dimension], *negative))
    }

    /// The number of simplices.
    pub fn len(&self) -> usize {
        self.simplices.len()
    }

    /// Whether the sum is empty.
    pub fn is_empty(&self) -> bool {
        self.simplices.is_empty()
    }

    /// The boundary: all facets, those that cancel left out, in ascending order of their vertices.
    pub fn boundary(&self) -> Self {
        assert!(self.dimension > 0, "points have no boundary");
        let mut facets = Vec::with_capacity(self.len() * (self.dimension + 1));
        for (vertices, negative) in self.iter() {
            for left_out in 0..vertices.len() {
                let mut facet = [u32::MAX; MOST];
                let kept = vertices.iter().enumerate().filter(|(i, _)| *i != left_out);
                facet.iter_mut().zip(kept).for_each(|(slot, (_, &vertex))| *slot = vertex);
                facets.push((facet, negative != (left_out % 2 == 1)));
            }
        }
        facets.sort_unstable();
        let mut boundary = Self::new(self.dimension - 1, self.vertex_count);
        for shared in facets.chunk_by(|a, b| a.0 == b.0) {
            let negative = shared.iter().filter(|(_, negative)| *negative).count();
            let positive = shared.len() - negative;
            let left = positive.abs_diff(negative);
            boundary.simplices.extend(std::iter::repeat_n((shared[0].0, negative > positive), left));
        }
        boundary
    }

    /// The product, triangulated. The pair of vertices (i, j) becomes vertex `i * other.vertex_count + j`; the caller
    /// sees to it that this fits into 32 bits.
    pub fn times(&self, other: &Self) -> Self {
        let (p, q) = (self.dimension, other.dimension);
        let mut product = Self::new(p + q, self.vertex_count * other.vertex_count);
        product.simplices.reserve(self.len() * other.len() * staircases(p, q).count());
        for (a, a_negative) in self.iter() {
            for (b, b_negative) in other.iter() {
                for (steps, odd) in staircases(p, q) {
                    let mut vertices = [u32::MAX; MOST];
                    let (mut i, mut j) = (0, 0);
                    vertices[0] = a[0] * other.vertex_count + b[0];
                    for (step, slot) in vertices[1..=p + q].iter_mut().enumerate() {
                        if steps >> step & 1 == 1 {
                            i += 1
                        } else {
                            j += 1
                        }
                        *slot = a[i] * other.vertex_count + b[j];
                    }
                    product.simplices.push((vertices, a_negative ^ b_negative ^ odd));
                }
            }
        }
        product
    }

    /// The boundary of the product, without its interior. Vertices are numbered as [`Chain::times`] does.
    pub fn boundary_of_product(&self, other: &Self) -> Self {
        let mut walls = self.boundary().times(other);
        let mut caps = self.times(&other.boundary());
        if self.dimension % 2 == 1 {
            caps.simplices.iter_mut().for_each(|(_, negative)| *negative = !*negative);
        }
        walls.simplices.append(&mut caps.simplices);
        walls
    }

    /// The simplices as lists of vertices whose order is their orientation.
    pub fn oriented<const N: usize>(&self) -> Vec<[u32; N]> {
        assert_eq!(self.dimension + 1, N);
        let oriented = |(vertices, negative): (&[u32], bool)| {
            let mut simplex: [u32; N] = std::array::from_fn(|i| vertices[i]);
            if negative {
                simplex.swap(N - 2, N - 1);
            }
            simplex
        };
        self.iter().map(oriented).collect()
    }
}

/// All orders of p steps along the first factor (bits set, lowest first) and q along the second, and whether the
/// shuffle is odd: whether the pairs in which a step along the second comes before one along the first are odd in number.
fn staircases(p: usize, q: usize) -> impl Iterator<Item = (u32, bool)> {
    (0u32..1 << (p + q)).filter(move |steps| steps.count_ones() as usize == p).map(move |steps| {
        let inversions: u32 =
            (0..p + q).filter(|step| steps >> step & 1 == 0).map(|step| (steps >> step).count_ones()).sum();
        (steps, inversions % 2 == 1)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boundary_of_a_boundary_is_zero() {
        let tetrahedra = Chain::of(5, &[[0, 1, 2, 3], [4, 1, 2, 3]]);
        let surface = tetrahedra.boundary();
        assert_eq!(surface.len(), 8, "the facet they share has one orientation in both: it stays, twice");
        assert!(surface.boundary().is_empty());
        let tetrahedra = Chain::of(5, &[[0, 1, 2, 3], [4, 2, 1, 3]]);
        assert_eq!(tetrahedra.boundary().len(), 6);
        assert!(tetrahedra.boundary().boundary().is_empty());
    }

    #[test]
    fn formula_gives_the_same_boundary_as_cancellation() {
        // Interval by interval, then square by interval: the interior's facets cancel to what the formula says.
        let square = Chain::interval(2).times(&Chain::interval(3));
        assert_eq!(square.len(), 12);
        let by_formula = |a: &Chain, b: &Chain| {
            let mut chain = a.boundary_of_product(b);
            chain.simplices.sort_unstable();
            chain
        };
        assert_eq!(by_formula(&Chain::interval(2), &Chain::interval(3)), square.boundary());
        let cube = square.times(&Chain::interval(2));
        assert_eq!(cube.len(), 72);
        assert_eq!(by_formula(&square, &Chain::interval(2)), cube.boundary());
        assert_eq!(by_formula(&Chain::interval(2), &square), Chain::interval(2).times(&square).boundary());
        // The tesseract has no interior here, so that only its boundary's boundary can be asked.
        let tesseract = cube.boundary_of_product(&Chain::interval(2));
        assert!(tesseract.boundary().is_empty());
        assert!(square.boundary_of_product(&square).boundary().is_empty());
    }

    #[test]
    fn simplices_keep_their_orientation() {
        let chain = Chain::of(9, &[[7, 3, 5], [3, 5, 7], [5, 3, 7]]);
        assert_eq!(chain.oriented::<3>(), [[3, 5, 7], [3, 5, 7], [3, 7, 5]]);
    }
}
