//! How the simplices of a surface hang together, and what they enclose.
//!
//! A surface is *closed* when its boundary, as a sum of oriented facets, is zero: every facet of a simplex is met by
//! one of another simplex with the opposite orientation. A closed surface divides space, and by the
//! divergence theorem its simplices add up to the volume inside:
//!
//! ```text
//! volume = 1/D! * sum over simplices of det[v_0 - p, v_1 - p, ..., v_(D-1) - p]      for any point p
//! ```
//!
//! which is positive when the normals point outwards. For an open surface the sum depends on p and means nothing.

use rayon::prelude::*;

use super::facets::{facets_of, has_double, sorted_facets};
use super::union_find::UnionFind;
use crate::geometry::{Dimension, Vector64, determinant, measure};

/// How the facets of a surface are shared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FacetPairs {
    /// Distinct facets.
    pub facets: usize,
    /// Facets of exactly two simplices, with opposite orientations: what a closed manifold consists of.
    pub paired: usize,
    /// Facets of one simplex only: the rim of an open surface.
    pub open: usize,
    /// Facets of exactly two simplices that run the same way: the two are oriented against each other.
    pub misoriented: usize,
    /// Facets of three simplices or more: bodies that touch along a facet.
    pub crowded: usize,
    /// Facets whose orientations don't cancel, among them all open and misoriented ones.
    pub unbalanced: usize,
}

impl FacetPairs {
    /// Whether the surface has no boundary, so that it encloses a volume.
    pub fn is_closed(&self) -> bool {
        self.unbalanced == 0
    }

    /// Whether every facet has exactly two simplices, in agreement.
    pub fn is_manifold(&self) -> bool {
        self.paired == self.facets
    }
}

/// How the facets of these simplices are shared. Vertices are told apart by index: weld first what should count as one.
pub fn facet_pairs<const D: usize>(simplices: &[[u32; D]]) -> FacetPairs {
    let mut pairs = FacetPairs::default();
    for shared in sorted_facets(simplices).chunk_by(|a, b| a.corners == b.corners) {
        let turned = shared.iter().filter(|facet| facet.turned).count();
        pairs.facets += 1;
        pairs.unbalanced += usize::from(2 * turned != shared.len());
        match (shared.len(), turned) {
            (1, _) => pairs.open += 1,
            (2, 1) => pairs.paired += 1,
            (2, _) => pairs.misoriented += 1,
            _ => pairs.crowded += 1,
        }
    }
    pairs
}

/// Whether the surface has no boundary: [`FacetPairs::is_closed`].
pub fn is_closed<const D: usize>(simplices: &[[u32; D]]) -> bool {
    facet_pairs(simplices).is_closed()
}

/// How many vertices, edges, triangles and, in 4D, tetrahedra there are: the f-vector. Only vertices that a simplex uses
/// count, and they are told apart by index.
pub fn f_vector<const D: usize>(simplices: &[[u32; D]]) -> Vec<usize> {
    fn distinct<T: Ord>(mut faces: Vec<T>) -> usize {
        faces.sort_unstable();
        faces.dedup();
        faces.len()
    }
    let edges = |simplex: &[u32; D]| {
        let pairs = (0..D).flat_map(|i| (0..i).map(move |j| (i, j)));
        pairs.map(|(i, j)| (simplex[i].min(simplex[j]), simplex[i].max(simplex[j]))).collect::<Vec<_>>()
    };
    let mut counts = vec![
        distinct(simplices.as_flattened().to_vec()),
        distinct(simplices.iter().flat_map(edges).filter(|(a, b)| a < b).collect()),
    ];
    match Dimension::of::<D>() {
        // The facets of triangles are the edges.
        Dimension::Three => {}
        Dimension::Four => {
            counts.push(distinct(simplices.iter().flat_map(facets_of).map(|(facet, _)| facet).collect()))
        }
    }
    counts.push(simplices.len());
    counts
}

/// How many pieces there are that no facet connects. Bodies that touch along a facet are one piece here.
pub fn components<const D: usize>(simplices: &[[u32; D]]) -> usize {
    let mut pieces = UnionFind::new(simplices.len());
    for pair in sorted_facets(simplices).windows(2).filter(|pair| pair[0].corners == pair[1].corners) {
        pieces.join(pair[0].simplex, pair[1].simplex);
    }
    pieces.sets()
}

/// How many vertices there are where the surface touches itself: whose simplices, cut off around the vertex, make up
/// something else than a sphere or, at a rim, a disc (in 3D: a circle or a path). Two cones tip to tip are the simplest
/// case, and in 4D also two bodies that share an edge. Vertices are told apart by index.
pub fn singular_vertices<const D: usize>(simplices: &[[u32; D]]) -> usize {
    let mut corners: Vec<(u32, u32)> = (simplices.iter().enumerate())
        .flat_map(|(s, simplex)| simplex.iter().map(move |&vertex| (vertex, s as u32)))
        .collect();
    corners.par_sort_unstable();
    // A simplex that names a vertex twice has no measure; what is around it is judged without it.
    corners.dedup();
    let stars: Vec<&[(u32, u32)]> = corners.chunk_by(|a, b| a.0 == b.0).collect();
    stars.par_iter().filter(|star| !is_regular(star, simplices)).count()
}

/// Whether the link of a vertex is a sphere or a disc of dimension D - 2, by its Euler characteristic: of all connected
/// closed surfaces only the sphere has 2, of those with a rim only the disc has 1, and points where such a surface touches
/// itself lower it.
fn is_regular<const D: usize>(star: &[(u32, u32)], simplices: &[[u32; D]]) -> bool {
    let mut link: Vec<[u32; D]> = Vec::with_capacity(star.len());
    for &(vertex, s) in star {
        let mut simplex = simplices[s as usize];
        simplex.sort_unstable();
        if has_double(&simplex) {
            continue;
        }
        // The vertex goes to the end, where it is out of the way; the others stay sorted.
        let place = simplex.iter().position(|&v| v == vertex).unwrap_or(D - 1);
        simplex[place..].rotate_left(1);
        link.push(simplex);
    }
    if link.is_empty() {
        return true;
    }
    let mut ridges: Vec<([u32; 2], u32)> = Vec::with_capacity(link.len() * (D - 1));
    let mut vertices: Vec<u32> = Vec::with_capacity(link.len() * (D - 1));
    for (i, face) in link.iter().enumerate() {
        vertices.extend(&face[..D - 1]);
        for left_out in 0..D - 1 {
            let mut ridge = [u32::MAX; 2];
            let others = face[..D - 1].iter().enumerate().filter(|(k, _)| *k != left_out);
            ridge.iter_mut().zip(others).for_each(|(slot, (_, &v))| *slot = v);
            ridges.push((ridge, i as u32));
        }
    }
    vertices.sort_unstable();
    vertices.dedup();
    ridges.sort_unstable();
    let mut pieces = UnionFind::new(link.len());
    let (mut distinct, mut open) = (0, 0);
    for shared in ridges.chunk_by(|a, b| a.0 == b.0) {
        distinct += 1;
        match shared {
            [_] => open += 1,
            [a, b] => pieces.join(a.1, b.1),
            _ => return false,
        }
    }
    pieces.sets() == 1
        && match Dimension::of::<D>() {
            Dimension::Three => true,
            Dimension::Four => {
                let euler = vertices.len() as i64 - distinct as i64 + link.len() as i64;
                euler == if open == 0 { 2 } else { 1 }
            }
        }
}

/// The corners of each simplex. Indices must be within `vertices`.
pub fn corners<const D: usize>(
    vertices: &[Vector64<D>],
    simplices: &[[u32; D]],
) -> impl Iterator<Item = [Vector64<D>; D]> {
    simplices.iter().map(|simplex| simplex.map(|i| vertices[i as usize]))
}

/// The D-volume within a closed surface, in the scene's units to the power D; negative where its normals point inwards.
pub fn enclosed_volume<const D: usize>(corners: impl IntoIterator<Item = [Vector64<D>; D]>) -> f64 {
    let mut corners = corners.into_iter().peekable();
    // Measured from one of its own points, a body far from the origin loses no digits.
    let Some(from) = corners.peek().map(|first| first[0]) else { return 0.0 };
    let sum: f64 = corners.map(|simplex| determinant(&simplex.map(|v| v - from))).sum();
    sum / (1..=D).product::<usize>() as f64
}

/// The (D-1)-measure of the surface: area in 3D, 3-volume in 4D.
pub fn surface_measure<const D: usize>(corners: impl IntoIterator<Item = [Vector64<D>; D]>) -> f64 {
    corners.into_iter().map(|simplex| measure(&simplex)).sum()
}

/// How near a simplex is to a regular one: 1 if regular, 0 if flat. The ratio of its measure, made a length, to the
/// root mean square of its edges, normalised: 4 sqrt(3) A / sum l^2 for a triangle, 12 (3 V)^(2/3) / sum l^2 for a
/// tetrahedron (Liu and Joe, *Relationship between tetrahedron shape measures*, 1994).
pub fn quality<const D: usize>(simplex: &[Vector64<D>; D]) -> f64 {
    let squares: f64 =
        (0..D).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| (simplex[i] - simplex[j]).norm_squared()).sum();
    let volume = measure(simplex);
    let numerator = match Dimension::of::<D>() {
        Dimension::Three => 48f64.sqrt() * volume,
        Dimension::Four => 12.0 * (3.0 * volume).powf(2.0 / 3.0),
    };
    if squares > 0.0 { numerator / squares } else { 0.0 }
}

/// The lowest [`quality`] of all simplices, and the index of the simplex that has it; `None` without simplices.
pub fn worst_quality<const D: usize>(corners: impl IntoIterator<Item = [Vector64<D>; D]>) -> Option<(usize, f64)> {
    corners.into_iter().map(|simplex| quality(&simplex)).enumerate().min_by(|a, b| a.1.total_cmp(&b.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The boundary of the corner simplex 0, e_1, ..., e_D, oriented outwards.
    fn corner_boundary<const D: usize>() -> (Vec<Vector64<D>>, Vec<[u32; D]>) {
        let vertices = (0..=D).map(|i| Vector64::from_fn(|r, _| f64::from(i > 0 && r == i - 1))).collect();
        let simplices = (0..=D)
            .map(|left_out| {
                let mut facet: [u32; D] = std::array::from_fn(|k| (k + usize::from(k >= left_out)) as u32);
                if left_out % 2 == 1 {
                    facet.swap(0, 1);
                }
                facet
            })
            .collect();
        (vertices, simplices)
    }

    fn check<const D: usize>() {
        let (vertices, mut simplices) = corner_boundary::<D>();
        let pairs = facet_pairs(&simplices);
        assert_eq!(pairs.facets, D * (D + 1) / 2);
        assert!(pairs.is_closed() && pairs.is_manifold());
        let factorial = Dimension::of::<D>().pick(6.0, 24.0);
        let volume = enclosed_volume(corners(&vertices, &simplices));
        assert!((volume - 1.0 / factorial).abs() < 1e-15, "{volume}");
        let moved: Vec<_> = vertices.iter().map(|v| v + Vector64::from_element(1e6)).collect();
        assert!((enclosed_volume(corners(&moved, &simplices)) - 1.0 / factorial).abs() < 1e-9);
        // D facets of measure 1/(D-1)! and the slanted one, which is sqrt(D) as large.
        let expected = (D as f64 + (D as f64).sqrt()) * D as f64 / factorial;
        assert!((surface_measure(corners(&vertices, &simplices)) - expected).abs() < 1e-14);
        let regular: [Vector64<D>; D] = std::array::from_fn(|i| Vector64::from_fn(|r, _| f64::from(r == i)));
        assert!((quality(&regular) - 1.0).abs() < 1e-14);
        assert_eq!(worst_quality([regular, [regular[0]; D]]), Some((1, 0.0)));

        simplices[0].swap(0, 1);
        let pairs = facet_pairs(&simplices);
        assert_eq!((pairs.misoriented, pairs.open, pairs.unbalanced), (D, 0, D));
        let turned = simplices.remove(0);
        let pairs = facet_pairs(&simplices);
        assert_eq!((pairs.misoriented, pairs.open, pairs.unbalanced), (0, D, D));
        assert!(!pairs.is_closed());
        // Both sides of one simplex enclose nothing, but they are closed; a third and fourth crowd their facets.
        let mut other = turned;
        other.swap(0, 1);
        assert!(is_closed(&[turned, other]));
        let pairs = facet_pairs(&[turned, other, turned, other]);
        assert_eq!((pairs.crowded, pairs.is_closed(), pairs.is_manifold()), (D, true, false));
    }

    #[test]
    fn corner_simplex_is_closed_and_has_its_volume() {
        check::<3>();
        check::<4>();
    }

    #[test]
    fn faces_and_pieces_are_counted() {
        let (_, mut simplices) = corner_boundary::<4>();
        assert_eq!(f_vector(&simplices), [5, 10, 10, 5]);
        assert_eq!(f_vector(&corner_boundary::<3>().1), [4, 6, 4]);
        assert_eq!(components(&simplices), 1);
        // A second body, far from the first but for one vertex; then a bridge over a facet of each.
        simplices.extend(corner_boundary::<4>().1.iter().map(|s| s.map(|v| v + 4)));
        assert_eq!((components(&simplices), f_vector(&simplices)), (2, vec![9, 20, 20, 10]));
        simplices.push([0, 1, 2, 100]);
        simplices.push([5, 6, 7, 101]);
        assert_eq!(components(&simplices), 2);
        simplices.extend([[2, 100, 0, 5], [5, 0, 100, 6], [5, 6, 7, 100]]);
        assert_eq!(components(&simplices), 1);
        assert_eq!((components::<3>(&[]), f_vector::<3>(&[])), (0, vec![0, 0, 0]));
    }

    #[test]
    fn bodies_that_touch_are_singular_there() {
        fn check<const D: usize>() {
            let (_, simplices) = corner_boundary::<D>();
            let n = D as u32 + 1;
            assert_eq!(singular_vertices(&simplices), 0);
            // With a rim.
            assert_eq!(singular_vertices(&simplices[1..]), 0);
            assert_eq!(singular_vertices(&simplices[2..]), 0);
            // A second body shares 1 vertex with the first, then 2.
            for shared in 1..=2 {
                let mut both = simplices.clone();
                both.extend(simplices.iter().map(|s| s.map(|v| if v < shared { v } else { v + n })));
                assert_eq!(singular_vertices(&both), shared as usize);
            }
            assert_eq!(singular_vertices::<D>(&[]), 0);
        }
        check::<3>();
        check::<4>();
        // Around this vertex is a torus of 7 vertices (Császár's): every facet is paired, and yet no manifold.
        let torus: Vec<[u32; 4]> =
            (0..7u32).flat_map(|i| [[i, (i + 1) % 7, (i + 3) % 7, 7], [i, (i + 3) % 7, (i + 2) % 7, 7]]).collect();
        assert_eq!(singular_vertices(&torus), 1);
    }

    #[test]
    fn a_simplex_that_names_a_vertex_twice_does_not_open_a_surface() {
        let (_, mut simplices) = corner_boundary::<4>();
        simplices.push([2, 2, 0, 1]);
        assert!(is_closed(&simplices));
    }
}
