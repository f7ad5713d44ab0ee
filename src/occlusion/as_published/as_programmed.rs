//! The thesis's program as it was written, which is not the algorithm that its text describes ([`super`] is that one). For
//! the thesis's figures, and for no other use.
//!
//! What it does, in `f32`, for each simplex, and then for each of the simplex's vertices O:
//!
//! 1. The normal is the simplex's own, by the formal determinant (4.4) of its edges, with the sign that the order of its
//!    vertices gives.
//! 2. Points of the unit sphere *around O* come from uniform angles, the last in [0, 2 pi], the others in [0, pi]. Such a
//!    point, not its difference to O, is taken for a direction. It is kept if its product with the normal is above 0.
//! 3. A ray hits a simplex if Cramer's rule gives barycentric coordinates l_2, l_3, ... >= 0 with a sum of at most 1. A
//!    determinant below 3e-5 counts as a miss. The distance t is computed and never looked at: what lies behind O is hit as
//!    well, and so is the simplex that O belongs to, wherever the ray goes, unless rounding is against it.
//! 4. Occlusion is the share of the rays that hit something.
//! 5. The loop over simplices returns inside its body: vertices of the first simplex get a value, all others keep 0.
//!
//! The fifth point is the published picture: one tetrahedron dark, and all others not occluded at all. Each point is a switch
//! of its own ([`ProgramDeviations`]). With all of them off, what is left is the truth wherever simplices that share a
//! vertex don't hide each other.

use super::cramer::laplace;
use super::{LOOK, simplex_normal};
use crate::accel::Tracer;
use crate::geometry::{Frame, Vector};
use crate::progress::{Cancelled, Progress};
use crate::trace::{Sampler, Sampling, Sequence};

/// Where the program takes a determinant for zero.
const FLAT: f32 = 3e-5;

/// What lies further ahead than rounding: a vertex meets its own simplices at t = 0.
const AHEAD: f32 = 1e-6;

/// What the program does otherwise than it should. Each can be taken back by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProgramDeviations {
    /// The loop over simplices returns in its first round. Without it each vertex gets the value of the last simplex that it
    /// belongs to.
    pub first_simplex_only: bool,
    /// Points of the sphere around a vertex are taken for directions, instead of their differences to the vertex.
    pub points_as_directions: bool,
    /// The distance isn't looked at. Without it a hit must lie ahead.
    pub hits_behind: bool,
    /// Determinants below 3e-5 are misses. Without it only 0 is.
    pub small_determinants_miss: bool,
    /// Angles are drawn uniformly, and there is no cosine. Without it directions are cosine-weighted.
    pub uniform_angles: bool,
    /// Products are fused into sums, as OpenCL compilers may. Not a deviation of the program's source, but it decides how much
    /// of a vertex its own simplex hides.
    pub contracted: bool,
}

impl ProgramDeviations {
    /// The program as it was written.
    pub const PROGRAMMED: Self = Self {
        first_simplex_only: true,
        points_as_directions: true,
        hits_behind: true,
        small_determinants_miss: true,
        uniform_angles: true,
        contracted: false,
    };

    /// All deviations taken back.
    pub const NONE: Self = Self {
        first_simplex_only: false,
        points_as_directions: false,
        hits_behind: false,
        small_determinants_miss: false,
        uniform_angles: false,
        contracted: false,
    };
}

/// The program on a mesh.
#[derive(Debug)]
pub struct AsProgrammed<'t, const D: usize> {
    tracer: &'t Tracer<D>,
    deviations: ProgramDeviations,
    /// For each vertex the simplex whose round of the loop gives its value, if one does.
    rounds: Vec<Option<u32>>,
}

impl<'t, const D: usize> AsProgrammed<'t, D> {
    /// With these deviations.
    pub fn new(tracer: &'t Tracer<D>, deviations: ProgramDeviations) -> Self {
        let mesh = tracer.mesh();
        let mut rounds = vec![None; mesh.vertices.len()];
        let most = if deviations.first_simplex_only { 1 } else { mesh.simplices.len() };
        for (simplex, corners) in (0..).zip(&mesh.simplices).take(most) {
            corners.iter().for_each(|&vertex| rounds[vertex as usize] = Some(simplex));
        }
        Self { tracer, deviations, rounds }
    }

    /// The value 1 - occlusion at a vertex, by `sampling.samples` rays; sampler, target and largest distance aren't asked.
    ///
    /// # Errors
    /// [`Cancelled`] if `progress` says so.
    pub fn at_vertex(&self, vertex: u32, sampling: &Sampling, progress: &dyn Progress) -> Result<f32, Cancelled> {
        let Some(simplex) = self.rounds[vertex as usize] else {
            return Ok(1.0);
        };
        let mesh = self.tracer.mesh();
        let normal = simplex_normal(&mesh.corners(simplex));
        if normal.amax() == 0.0 {
            return Ok(1.0);
        }
        let centre = mesh.vertices[vertex as usize];
        let frame = Frame::new(&normal.normalize());
        let mut sequence = Sequence::new(Sampler::Random, sampling.seed, u64::from(vertex));
        let (mut rays, mut hits) = (0u32, 0u32);
        for tried in 0..sampling.samples.saturating_mul(64) {
            if tried % LOOK == 0 && progress.cancelled() {
                return Err(Cancelled);
            }
            let unit = if self.deviations.uniform_angles {
                sphere_point(&mut sequence)
            } else {
                sequence.next_direction(&frame)
            };
            let direction = if self.deviations.points_as_directions { centre + unit } else { unit };
            if direction.dot(&normal) <= 0.0 {
                continue;
            }
            rays += 1;
            let blocked = (0..mesh.simplices.len() as u32).any(|s| self.hits(&mesh.corners(s), &centre, &direction));
            hits += u32::from(blocked);
            if rays == sampling.samples {
                break;
            }
        }
        Ok(1.0 - (f64::from(hits) / f64::from(rays.max(1))) as f32)
    }

    fn hits(&self, corners: &[Vector<D>; D], origin: &Vector<D>, direction: &Vector<D>) -> bool {
        let right = origin - corners[0];
        let mut columns: [Vector<D>; D] =
            std::array::from_fn(|i| if i == 0 { -direction } else { corners[i] - corners[0] });
        let denominator = laplace(&columns, self.deviations.contracted);
        if denominator == 0.0 || self.deviations.small_determinants_miss && denominator.abs() < FLAT {
            return false;
        }
        let solution: [f32; D] = std::array::from_fn(|i| {
            let column = std::mem::replace(&mut columns[i], right);
            let numerator = laplace(&columns, self.deviations.contracted);
            columns[i] = column;
            numerator / denominator
        });
        let weights = &solution[1..];
        let inside = weights.iter().all(|&l| l >= 0.0) && weights.iter().sum::<f32>() <= 1.0;
        inside && (self.deviations.hits_behind || solution[0] > AHEAD)
    }
}

/// A point of the unit sphere around the origin, from angles of which the last goes all the way round.
fn sphere_point<const D: usize>(sequence: &mut Sequence) -> Vector<D> {
    let angles = sequence.next_point::<3>().map(|x| (x + 1.0) * std::f32::consts::FRAC_PI_2);
    let mut point = Vector::<D>::zeros();
    let mut product = 1.0;
    for i in 0..D - 1 {
        let angle = if i == D - 2 { 2.0 * angles[i] } else { angles[i] };
        point[i] = product * libm::cosf(angle);
        product *= libm::sinf(angle);
    }
    point[D - 1] = product;
    point
}
