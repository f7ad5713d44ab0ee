//! Lights: what reaches the eye beside the ambient light, from lights that are far away or at a point, with exact shadows
//! (Hollasch 1991, chapter 4, who has them in four dimensions without shadows).
//!
//! Nothing here depends on how many dimensions there are but the falloff. At a visible point with the unit normal n, the
//! direction v to the eye and, of each light, the direction l and the halfway vector h = (l + v) / |l + v|, what is sent to
//! the eye is
//!
//! ```text
//! c (a A + sum of E V (n . l))  +  s sum of E V (n . h)^m
//! ```
//!
//! with the surface's reflectance c, the ambient light a and its occlusion A, the light's strength E there, the visibility V
//! of the light (0 or 1, or what objects that let light through leave of it), the specular reflectance s and the shininess m (Lambert; Blinn 1977). E = 1 shows a white surface
//! that faces the light as white. A light at a point sends what it has through ever larger spheres, so E falls as
//! 1 / r^(D-1): by the square of the distance in 3D and by its cube in 4D.
//!
//! Cosines are taken with the interpolated normal, but a simplex that turns its back to a light gets nothing of it.
//!
//! **Shadows** need no offset: whether a simplex is in the way is told by exact signs, and a simplex in whose hyperplane the
//! point lies is never in the way, just as for occlusion. The point is rounded to `f32`, though, so "in the hyperplane" is
//! to mean as near to it as rounding may have moved the point.
//!
//! **Depth cues** mix what is sent with a colour, by the distance from the eye.

use std::sync::atomic::{AtomicBool, Ordering};

use super::inside::inside;
use super::tone::to_linear;
use crate::accel::Tracer;
use crate::geometry::{Ray, Vector, Vector64, narrow, normal_of, widen};
use crate::mesh::Gloss;

/// How far from a simplex's hyperplane a point may be that lies in it, as a share of its distance from the origin: some
/// roundings to `f32` of the point and of the corners.
const ROUNDING: f64 = 8.0 * (f32::EPSILON as f64);

/// How a picture is lit.
#[derive(Debug)]
pub struct Lighting<const D: usize> {
    /// The ambient light where all is open.
    pub ambient: f64,
    /// The share of a light that is reflected as by a mirror, in highlights, by objects that don't say their own.
    pub specular: f64,
    /// The exponent of the highlights: the higher the smaller they are.
    pub shininess: f64,
    /// What distance does, if anything.
    pub depth_cue: Option<DepthCue>,
    lights: Vec<Light<D>>,
    /// Whether a light reached anything that was seen so far.
    reached: Vec<AtomicBool>,
}

/// A light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light<const D: usize> {
    /// Where it comes from.
    pub source: Source<D>,
    /// Its strength in linear red, green and blue; of a light at a point that at distance 1.
    pub strength: [f64; 3],
}

/// Where light comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Source<const D: usize> {
    /// From so far away that all its rays go in this direction; not zero.
    Directional(Vector64<D>),
    /// From this point.
    Point(Vector64<D>),
}

/// What is far away takes on a colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthCue {
    /// Up to this distance from the eye nothing changes.
    pub near: f64,
    /// From this distance on nothing but the colour is left; above `near`.
    pub far: f64,
    /// Linear red, green and blue.
    pub color: [f64; 3],
}

/// A visible point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lit<const D: usize> {
    /// The simplex it is inside of.
    pub simplex: u32,
    pub point: Vector64<D>,
    /// The simplex's unit normal on the side that is seen.
    pub facing: Vector64<D>,
    /// The unit normal that cosines are taken with.
    pub normal: Vector64<D>,
    /// The unit vector to the eye.
    pub to_eye: Vector64<D>,
    /// What it reflects, linear.
    pub reflectance: [f64; 3],
    /// Its highlights, where they are not those of the picture.
    pub gloss: Gloss,
}

impl<const D: usize> Lighting<D> {
    /// These lights beside this ambient light, with neither highlights nor depth cues.
    pub fn new(lights: Vec<Light<D>>, ambient: f64) -> Self {
        let reached = lights.iter().map(|_| AtomicBool::new(false)).collect();
        Self { ambient, specular: 0.0, shininess: 1.0, depth_cue: None, lights, reached }
    }

    /// The lights.
    pub fn lights(&self) -> &[Light<D>] {
        &self.lights
    }

    /// The lights, by their place, that have reached nothing that was seen in pictures so far.
    pub fn in_vain(&self) -> Vec<usize> {
        (0..self.lights.len()).filter(|&i| !self.reached[i].load(Ordering::Relaxed)).collect()
    }

    /// What a point sends to the eye of the lights' light, linear, before depth cues.
    pub(super) fn direct(&self, tracer: &Tracer<D>, lit: &Lit<D>) -> [f64; 3] {
        let mut sum = [0.0; 3];
        let specular = lit.gloss.specular.unwrap_or(self.specular);
        let shininess = lit.gloss.shininess.unwrap_or(self.shininess);
        for (light, reached) in self.lights.iter().zip(&self.reached) {
            if light.strength == [0.0; 3] {
                continue;
            }
            let point = narrow(&lit.point);
            let Some((towards, distance)) = light.source.from(&widen(&point)) else { continue };
            let cosine = lit.normal.dot(&towards);
            if cosine <= 0.0 || lit.facing.dot(&towards) <= 0.0 {
                continue;
            }
            let arriving = arriving(tracer, inside(tracer.mesh(), lit.simplex, &point), lit.simplex, towards, distance);
            if arriving == 0.0 {
                continue;
            }
            reached.store(true, Ordering::Relaxed);
            let falloff = match light.source {
                Source::Directional(_) => 1.0,
                Source::Point(_) => distance.powi(1 - D as i32),
            };
            let halfway = towards + lit.to_eye;
            let highlight = if specular > 0.0 && halfway.norm() > 0.0 {
                specular * libm::pow(lit.normal.dot(&halfway.normalize()).clamp(0.0, 1.0), shininess)
            } else {
                0.0
            };
            for c in 0..3 {
                // As near to a light as can be it is infinitely bright.
                let strength = (light.strength[c] * falloff).min(f64::from(f32::MAX)) * arriving;
                sum[c] += strength * (lit.reflectance[c] * cosine + highlight);
            }
        }
        sum
    }

    /// How much of the light is left at this distance from the eye, and what the depth cue adds.
    pub(super) fn cue(&self, depth: f64) -> (f64, [f64; 3]) {
        let Some(DepthCue { near, far, color }) = self.depth_cue else { return (1.0, [0.0; 3]) };
        let left = ((far - depth) / (far - near)).clamp(0.0, 1.0);
        (left, color.map(|c| c * (1.0 - left)))
    }
}

/// The reflectance of a surface of this colour, linear, from the colour as a screen shows it.
pub fn reflectance(color: [f32; 3]) -> [f64; 3] {
    color.map(|c| to_linear(f64::from(c)))
}

impl<const D: usize> Source<D> {
    /// The unit vector from a point to the light, and how far away it is; none where the light itself is.
    fn from(&self, point: &Vector64<D>) -> Option<(Vector64<D>, f64)> {
        let (vector, infinite) = match self {
            Self::Directional(direction) => (-direction, true),
            Self::Point(light) => (light - point, false),
        };
        // Scaled first, so that squares neither overflow nor vanish.
        let largest = vector.amax();
        let scaled = vector / largest;
        let length = scaled.norm();
        (largest > 0.0).then(|| (scaled / length, if infinite { f64::INFINITY } else { largest * length }))
    }
}

/// The share of a light that arrives at a point inside a simplex: 1 or 0, unless light passes some objects.
fn arriving<const D: usize>(
    tracer: &Tracer<D>,
    point: Vector<D>,
    own: u32,
    towards: Vector64<D>,
    distance: f64,
) -> f64 {
    let (ray, limit) = (Ray::new(point, narrow(&towards)), distance as f32);
    let point = widen(&point);
    let rounding = ROUNDING * point.norm();
    let is_in_plane = |simplex: u32| {
        let corners = tracer.mesh().corners(simplex).map(|v| widen(&v));
        let normal = normal_of(&corners);
        normal.dot(&(point - corners[0])).abs() <= rounding * normal.norm()
    };
    if tracer.mesh().is_translucent() {
        return tracer.transmitted(&ray, limit, |simplex| simplex == own || is_in_plane(simplex));
    }
    let hides = |simplex: u32| simplex != own && tracer.hits(simplex, &ray, limit) && !is_in_plane(simplex);
    if tracer.bvh().any(&ray, limit, hides) { 0.0 } else { 1.0 }
}
