//! Ambient occlusion among objects that let light through.
//!
//! Each surface that a ray passes keeps its object's opacity of the light, so what arrives is the product of 1 - opacity over
//! all surfaces on the way, and a value is the mean of that product over rays. A body is bounded by surfaces and filled with
//! nothing: a ray through it loses at its entry and at its exit, however thick the body is there. That agrees with what pictures
//! show of objects behind it, and needs no more than the ray's passages ([`Tracer::pass`]), even of open surfaces.
//!
//! At a vertex the simplices around it hide cones of directions. A ray that starts in them begins below a surface, and loses
//! what one surface takes, once for each object there. What takes nothing counts as not being there.
//!
//! Here it is done ray by ray; the processor's packets tell which rays hit nothing at all (`cpu/passing.rs`), and leave the others.
//! Scenes of opaque objects never come here.

use super::estimate::Estimate;
use super::shares::Shares;
use super::surroundings::star_cone;
use super::{Sampling, Sequence, ShadingPoint};
use crate::accel::Tracer;
use crate::geometry::{Cone, Dimension, Frame, Ray, Vector};
use crate::mesh::approach;
use crate::progress::{Cancelled, Progress};

/// Rays between two looks at whether to go on.
const RAYS_BETWEEN_LOOKS: u32 = 1 << 8;

/// The value at one point.
pub(super) fn estimate_at<const D: usize>(
    tracer: &Tracer<D>,
    point: &ShadingPoint<D>,
    sampling: &Sampling,
    progress: &dyn Progress,
) -> Result<Estimate, Cancelled> {
    let rays = Rays::of(tracer, point, sampling);
    if rays.normal.amax() == 0.0 {
        return Ok(Estimate::known(1.0));
    }
    let frame = Frame::new(&rays.normal);
    let mut sequence = Sequence::new(sampling.sampler, sampling.seed, point.number());
    let mut shares = Shares::new(sampling.sampler, Dimension::of::<D>());
    while shares.rays() < sampling.samples && !sampling.target.is_some_and(|target| shares.meet(&target)) {
        if shares.rays().is_multiple_of(RAYS_BETWEEN_LOOKS) && progress.cancelled() {
            return Err(Cancelled);
        }
        shares.add(rays.share(sequence.next_direction(&frame)));
    }
    Ok(shares.estimate())
}

/// All that decides what rays from a point bring.
pub(super) struct Rays<'t, const D: usize> {
    tracer: &'t Tracer<D>,
    position: Vector<D>,
    /// The normal at the point; 0 where nothing is.
    pub normal: Vector<D>,
    limit: f32,
    star: Vec<Around<D>>,
    ignored: Vec<u32>,
}

impl<'t, const D: usize> Rays<'t, D> {
    /// Those from a point.
    pub fn of(tracer: &'t Tracer<D>, point: &ShadingPoint<D>, sampling: &Sampling) -> Self {
        let (position, normal) = (point.position(tracer.mesh()), point.normal(tracer.mesh()));
        let star = if normal.amax() == 0.0 { Vec::new() } else { star(tracer, point, normal) };
        Self { tracer, position, normal, limit: sampling.max_distance, star, ignored: point.ignored(tracer) }
    }

    /// The share of light that passes along a ray.
    pub fn share(&self, direction: Vector<D>) -> f64 {
        let ray = Ray::new(self.position, direction);
        let hides = |around: &&Around<D>| around.cones.iter().any(|cone| cone.contains(&ray.direction));
        let near: f64 = self.star.iter().filter(hides).map(|around| around.passed).product();
        let far = || self.tracer.transmitted(&ray, self.limit, |simplex| self.ignored.contains(&simplex));
        if near > 0.0 { near * far() } else { 0.0 }
    }
}

/// What an object hides around a vertex, and what share of light passes it.
struct Around<const D: usize> {
    object: usize,
    passed: f64,
    cones: Vec<Cone<D>>,
}

/// The objects around a vertex; none around a point that is no vertex.
fn star<const D: usize>(tracer: &Tracer<D>, point: &ShadingPoint<D>, normal: Vector<D>) -> Vec<Around<D>> {
    let ShadingPoint::Vertex(vertex) = *point else { return Vec::new() };
    let mesh = tracer.mesh();
    let (position, identity) = (mesh.vertices[vertex as usize], mesh.identity[vertex as usize]);
    let opacity = |object: usize| f64::from(mesh.objects[object].opacity);
    // The objects in a simplex's place that take something.
    let objects = |simplex: u32| {
        let members = mesh.copies.members(simplex);
        let alone = if members.len() == 0 { Some(simplex) } else { None };
        let mut found: Vec<usize> = members.chain(alone).map(|s| mesh.object_of(s)).collect();
        found.retain(|&object| opacity(object) > 0.0);
        found.dedup();
        found
    };
    let all = tracer.incidence().around(identity);
    let around: Vec<u32> = all.iter().copied().filter(|&simplex| !objects(simplex).is_empty()).collect();
    let ways = [normal, approach(mesh, &around, vertex)];
    let mut star: Vec<Around<D>> = Vec::new();
    for &simplex in &around {
        let Some(cone) = star_cone(mesh, position, ways, identity, simplex) else { continue };
        for object in objects(simplex) {
            match star.iter_mut().find(|around| around.object == object) {
                Some(around) => around.cones.push(cone.clone()),
                None => star.push(Around { object, passed: 1.0 - opacity(object), cones: vec![cone.clone()] }),
            }
        }
    }
    star
}
