//! What the simplices around a vertex hide of its own hemisphere.
//!
//! A simplex with a corner at the vertex hides the cone of its edges and -n ([`crate::trace::Surroundings`]), or another
//! vector where other faces or bodies meet it ([`crate::mesh::approach`]). On a smooth surface
//! that is a sliver at the horizon: with s n for the part along the normal, a direction of the cone is
//! w = sum mu_i e_i - s n, so its height over the tangent hyperplane is at most that of a vector in the simplex's own
//! hyperplane, which is at most the sine of the angle between the two hyperplanes. Rays above all of these
//! heights need no test.

use super::cones::{Cones, dot};
use super::directions::Rays;
use super::lanes::Lanes;
use super::query::Query;
use crate::accel::WIDTH;
use crate::geometry::Vector;
use crate::trace::surroundings::star_cone;

/// Rounding of the height of an edge, relative to its 1-norm: twice what D differences, products and sums make.
const HEIGHT_ROUNDING: f32 = 16.0 / (1 << 24) as f32;

/// The cones of the simplices around a vertex, eight by eight.
#[derive(Debug)]
pub(super) struct VertexStar<const D: usize> {
    cones: Vec<Cones<D>>,
    /// Above which each eight hide nothing.
    heights: Vec<f32>,
    normal: Vector<D>,
    /// From where the vertex is approached: the normal, or beside another face or body a way along the own one.
    approach: Vector<D>,
    identity: u32,
}

impl<const D: usize> VertexStar<D> {
    pub fn new() -> Self {
        Self { cones: Vec::new(), heights: Vec::new(), normal: Vector::zeros(), approach: Vector::zeros(), identity: 0 }
    }

    /// For a point with no simplex around it.
    pub fn clear(&mut self) {
        self.heights.clear();
    }

    /// For a vertex, with the simplices around it.
    #[inline(always)]
    pub fn set<L: Lanes>(
        &mut self,
        query: &Query<D>,
        [normal, approach]: [Vector<D>; 2],
        identity: u32,
        around: &[u32],
    ) {
        self.clear();
        (self.normal, self.approach, self.identity) = (normal, approach, identity);
        for simplices in around.chunks(WIDTH) {
            if self.cones.len() == self.heights.len() {
                self.cones.push(Cones::new());
            }
            let height = self.set_block::<L>(query, simplices);
            // If not approached from straight above, the cones are as high as may be.
            self.heights.push(if approach == normal { height } else { 1.0 });
        }
    }

    /// The next eight; returns the height above which they hide nothing.
    #[inline(always)]
    fn set_block<L: Lanes>(&mut self, query: &Query<D>, simplices: &[u32]) -> f32 {
        let mesh = query.tracer.mesh();
        let mut rows = [[[0.0f32; WIDTH]; D]; D];
        for lane in 0..WIDTH {
            let simplex = mesh.simplices[simplices[lane.min(simplices.len() - 1)] as usize];
            let others = simplex.into_iter().filter(|&v| mesh.identity[v as usize] != self.identity);
            for (row, vertex) in rows.iter_mut().zip(others) {
                let edge = query.wide.scale.scaled(&mesh.vertices[vertex as usize]) - query.scaled;
                (0..D).for_each(|k| row[k][lane] = edge[k]);
            }
        }
        let mut normal = [L::splat(0.0); D];
        for k in 0..D {
            normal[k] = L::splat(self.normal[k]);
        }
        let mut edges = [[L::splat(0.0); D]; D];
        let (mut surely, mut maybe) = (L::splat(-1.0), L::splat(-1.0));
        for (i, edge) in edges.iter_mut().enumerate() {
            for k in 0..D {
                edge[k] = if i < D - 1 { L::load(&rows[i][k]) } else { L::splat(-self.approach[k]) };
            }
            if i < D - 1 {
                let height = dot(edge, &normal);
                let mut length = L::splat(0.0);
                for x in edge.iter() {
                    length = length.add(x.abs());
                }
                let bound = length.mul(L::splat(HEIGHT_ROUNDING));
                surely = surely.max(height.sub(bound));
                maybe = maybe.max(height.add(bound));
            }
        }
        let cones = &mut self.cones[self.heights.len()];
        // A simplex that rises nowhere hides nothing; where that isn't sure, the exact cone is asked.
        let [determinants, squares] = cones.set(&edges, maybe);
        for lane in simplices.len()..WIDTH {
            cones.remove(lane);
        }
        cones.trusted &= !surely.less_or_equal(L::splat(0.0));
        let (bounds, holding) = cones.last_bounds::<L>();
        let mut heights = [0.0; WIDTH];
        highest(determinants, squares, bounds).store(&mut heights);
        let mut height = -1.0;
        for lane in 0..WIDTH {
            height = if holding >> lane & 1 == 1 && heights[lane] > height { heights[lane] } else { height };
        }
        height
    }

    /// Which of the rays are hidden.
    #[inline(always)]
    pub fn hidden<L: Lanes>(&self, query: &Query<D>, rays: &Rays<D>, around: &[u32], alive: u64) -> u64 {
        let mut hidden = 0;
        for ((cones, &height), simplices) in self.cones.iter().zip(&self.heights).zip(around.chunks(WIDTH)) {
            let mut low = alive & !hidden & rays.up_to_height::<L>(height);
            while low != 0 {
                let i = low.trailing_zeros() as usize;
                let bit = low & low.wrapping_neg();
                low &= low - 1;
                let direction = rays.splat::<L>(i);
                let candidates = cones.candidates::<L>(&direction);
                if candidates == 0 {
                    continue;
                }
                let verdict = cones.judge::<L>(candidates, &direction);
                if verdict.inside != 0 || self.exactly(query, rays, i, simplices, verdict.doubtful) {
                    hidden |= bit;
                }
            }
        }
        hidden
    }

    #[cold]
    fn exactly(&self, query: &Query<D>, rays: &Rays<D>, i: usize, simplices: &[u32], doubtful: u8) -> bool {
        let direction = query.ray(rays, i).direction;
        (simplices.iter().enumerate()).filter(|(lane, _)| doubtful >> lane & 1 == 1).any(|(_, &simplex)| {
            let mesh = query.tracer.mesh();
            star_cone(mesh, query.position, [self.normal, self.approach], self.identity, simplex)
                .is_some_and(|cone| cone.contains(&direction))
        })
    }
}

/// An upper bound of the sine of the angle between the tangent hyperplane and that of a simplex, given the determinant of
/// its edges and -n, the square of its own normal m, and a bound on the rounding of m . w for any w of length 1.
#[inline(always)]
fn highest<L: Lanes>(determinant: L, square: L, bound: L) -> L {
    let [zero, one] = [0.0, 1.0].map(L::splat);
    // The determinant is m . n but for rounding: of m, and as much again for each unit of the 1-norm of n.
    let sure = L::splat(3.0).negated_mul_add(bound, determinant.abs());
    let length = square.square_root().mul(L::splat(1.00001)).add(L::splat(2.0).mul(bound));
    let cosine = sure.max(zero).div(length).min(one);
    cosine.negated_mul_add(cosine, one).max(zero).square_root().add(L::splat(1e-5))
}
