//! The algorithm as the thesis published it (Djami 2021, 2.1.2, 2.3, 4.3, 4.4 and 4.6.3), deviations and all, to show what its
//! figures show: objects that are fully occluded, or not at all. Not for any other use.
//!
//! Of a vertex O, in `f32` throughout:
//!
//! 1. The normal is the sum of the formal determinants (4.4) of the edges of its simplices, in their vertices' order.
//! 2. Points of the unit sphere around O come from angles (Eq. 2.9, 4.5), the first uniform in [0, 2 pi], the others in
//!    [0, pi]. Directions with w . n <= 0 are thrown away. The angles are uniform, the directions are not.
//! 3. A ray hits a simplex if Cramer's rule for `O - A = -t w + l_2 (B - A) + l_3 (C - A) + ...` gives t >= 0 and no negative
//!    l_i, with l_1 = 1 - l_2 - ...; determinants by Laplace's expansion along their first row.
//! 4. Occlusion is the share of the rays that hit something. The cosine of Eq. 2.8 is left out.
//!
//! The deviation that makes all or nothing is the third. The vertex's own simplices are tested like any other, and there t is 0:
//! - for A, as O - A = 0, all numerators are exactly 0: every ray hits, the vertex is fully occluded;
//! - for other vertices O - A equals another column. Products cancel exactly where the expansion subtracts them from each
//!   other, and leave rounding noise where it sums them in another order: then the sign of noise decides. The noise in t
//!   is the same for all rays of the vertex, so they all hit, or all miss.
//!
//! What the compiler makes of a sum thus decides between black and white. OpenCL lets it fuse products into sums unless
//! forbidden; [`Deviations::contracted`] does that, and other vertices change sides.
//!
//! Each deviation is a switch of its own ([`Deviations`]); with all of them off the truth is left. The hierarchy is used to save time:
//! hits that rounding finds outside a simplex's box aren't seen.

mod as_programmed;
mod cramer;

pub use as_programmed::{AsProgrammed, ProgramDeviations};
pub use cramer::plain_cramer;

use cramer::{cramer, laplace};

use crate::accel::Tracer;
use crate::geometry::{Frame, Ray, Vector};
use crate::progress::{Cancelled, Progress};
use crate::trace::{Sampler, Sampling, Sequence, ShadingPoint, Surroundings};

/// Directions between two looks at whether to go on.
const LOOK: u32 = 1 << 10;

/// What the published algorithm does otherwise than it should. Each can be taken back by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Deviations {
    /// Angles drawn uniformly, and no cosine: neither the density of the integral nor that of the sphere. Without it
    /// directions are cosine-weighted.
    pub uniform_angles: bool,
    /// A hit at t = 0 counts. Without it t must be above 0.
    pub hits_at_zero: bool,
    /// The simplices that a vertex belongs to are tested like others. Without it they hide the cone of their edges and the
    /// inverted normal, which is what is left of them as the point moves off the surface.
    pub own_simplices: bool,
    /// Cramer's rule in `f32`. Without it signs are exact, whatever the following two say.
    pub single_precision: bool,
    /// Products are fused into sums, as OpenCL compilers may. Not a deviation of the text.
    pub contracted: bool,
    /// Eq. 2.7 and 4.3 as printed: t counts backwards, and A's first coordinate is subtracted in rows where it doesn't
    /// belong. No program with this in it shows a scene, so it is a slip of the printed text alone.
    pub printed_equations: bool,
}

impl Deviations {
    /// The algorithm as its text describes it.
    pub const PUBLISHED: Self = Self {
        uniform_angles: true,
        hits_at_zero: true,
        own_simplices: true,
        single_precision: true,
        contracted: false,
        printed_equations: false,
    };

    /// All deviations taken back.
    pub const NONE: Self = Self {
        uniform_angles: false,
        hits_at_zero: false,
        own_simplices: false,
        single_precision: false,
        ..Self::PUBLISHED
    };
}

/// The formal determinant (4.4) of a simplex's edges, in the order of its vertices: its normal, as long as its volume is large.
fn simplex_normal<const D: usize>(corners: &[Vector<D>; D]) -> Vector<D> {
    Vector::from_fn(|axis, _| {
        // The formal determinant's first column holds the unit vectors.
        let unit = Vector::from_fn(|r, _| if r == axis { 1.0 } else { 0.0 });
        let columns = std::array::from_fn(|i| if i == 0 { unit } else { corners[i] - corners[0] });
        laplace(&columns, false)
    })
}

/// The unit normals by the formal determinants of the simplices' edges, in the order of their vertices; zero where there
/// are none.
fn normals<const D: usize>(tracer: &Tracer<D>) -> Vec<Vector<D>> {
    let mesh = tracer.mesh();
    let mut sums = vec![Vector::<D>::zeros(); mesh.vertices.len()];
    for simplex in &mesh.simplices {
        let corners = simplex.map(|v| mesh.vertices[v as usize]);
        let normal = simplex_normal(&corners);
        simplex.iter().for_each(|&v| sums[v as usize] += normal);
    }
    sums.iter().map(|sum| sum.try_normalize(0.0).unwrap_or_else(Vector::zeros)).collect()
}

/// The algorithm on a mesh.
#[derive(Debug)]
pub struct AsPublished<'t, const D: usize> {
    tracer: &'t Tracer<D>,
    deviations: Deviations,
    normals: Vec<Vector<D>>,
}

impl<'t, const D: usize> AsPublished<'t, D> {
    /// With these deviations.
    pub fn new(tracer: &'t Tracer<D>, deviations: Deviations) -> Self {
        Self { tracer, deviations, normals: normals(tracer) }
    }

    /// The value 1 - occlusion at a vertex, by `sampling.samples` rays; neither sampler nor target are asked.
    ///
    /// # Errors
    /// [`Cancelled`] if `progress` says so.
    pub fn at_vertex(&self, vertex: u32, sampling: &Sampling, progress: &dyn Progress) -> Result<f32, Cancelled> {
        let normal = &self.normals[vertex as usize];
        if normal.amax() == 0.0 {
            return Ok(1.0);
        }
        let own =
            (!self.deviations.own_simplices).then(|| Surroundings::of(self.tracer, &ShadingPoint::Vertex(vertex)));
        let mut sequence = Sequence::new(Sampler::Random, sampling.seed, u64::from(vertex));
        let origin = self.tracer.mesh().vertices[vertex as usize];
        let frame = Frame::new(normal);
        let (mut rays, mut hits) = (0u32, 0u32);
        // About every second direction is on the normal's side; where rounding leaves none, there is no value.
        for tried in 0..sampling.samples.saturating_mul(64) {
            if tried % LOOK == 0 && progress.cancelled() {
                return Err(Cancelled);
            }
            let direction = if self.deviations.uniform_angles {
                let point = origin + sphere_point(&mut sequence);
                point - origin
            } else {
                sequence.next_direction(&frame)
            };
            if direction.dot(normal) <= 0.0 {
                continue;
            }
            rays += 1;
            hits += u32::from(self.hits_something(&Ray::new(origin, direction), own.as_ref(), sampling.max_distance));
            if rays == sampling.samples {
                break;
            }
        }
        Ok(1.0 - (f64::from(hits) / f64::from(rays.max(1))) as f32)
    }

    /// `own` is what the vertex's own simplices hide, where they aren't tested like others.
    fn hits_something(&self, ray: &Ray<D>, own: Option<&Surroundings<D>>, limit: f32) -> bool {
        let mesh = self.tracer.mesh();
        if own.is_some_and(|own| own.hides(ray)) {
            return true;
        }
        self.tracer.bvh().any(ray, limit, |simplex| {
            let corners = mesh.corners(simplex);
            if own.is_some() && corners.contains(&ray.origin) {
                return false;
            }
            if !self.deviations.single_precision {
                return self.tracer.hits(simplex, ray, limit);
            }
            let (t, weights) = cramer(&corners, &ray.origin, &ray.direction, self.deviations);
            let ahead = if self.deviations.hits_at_zero { t >= 0.0 } else { t > 0.0 };
            ahead && t <= limit && weights.iter().all(|&w| w >= 0.0)
        })
    }
}

/// A point of the unit sphere around the origin, from angles (Eq. 2.9, 4.5).
fn sphere_point<const D: usize>(sequence: &mut Sequence) -> Vector<D> {
    let angles = sequence.next_point::<3>().map(|x| (x + 1.0) * std::f32::consts::FRAC_PI_2);
    let mut point = Vector::<D>::zeros();
    let mut product = 1.0;
    for i in 0..D - 1 {
        let angle = if i == 0 { 2.0 * angles[0] } else { angles[i] };
        point[i] = product * libm::cosf(angle);
        product *= libm::sinf(angle);
    }
    point[D - 1] = product;
    point
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_miss_the_density() {
        // On the sphere of R^4 the mean of |x_1| is 4 / (3 pi); by uniform angles it is 2 / pi.
        let mut sequence = Sequence::new(Sampler::Random, 1, 1);
        let mean = (0..20_000).map(|_| sphere_point::<4>(&mut sequence)[0].abs()).sum::<f32>() / 20_000.0;
        assert!((mean - 2.0 / std::f32::consts::PI).abs() < 0.01, "{mean}");
    }
}
