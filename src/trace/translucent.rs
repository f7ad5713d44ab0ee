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
//! Packets tell which rays hit nothing at all; the others are looked at here ray by ray, without SIMD. Scenes of opaque objects never
//! come here.

use rayon::prelude::*;

use super::cpu::PacketTracer;
use super::estimate::Estimate;
use super::shares::Shares;
use super::surroundings::star_cone;
use super::{Sampling, Sequence, ShadingPoint};
use crate::accel::Tracer;
use crate::geometry::{Cone, Dimension, Frame, Ray, Vector};
use crate::mesh::approach;
use crate::progress::{Cancelled, Progress};

/// Points that a thread takes at a time.
const BATCH: usize = 16;
/// Rays between two looks at whether to go on.
const RAYS_BETWEEN_LOOKS: u32 = 1 << 8;

/// The values at points, in their order.
pub(super) fn open_fractions<const D: usize>(
    tracer: &Tracer<D>,
    points: &[ShadingPoint<D>],
    sampling: &Sampling,
    progress: &dyn Progress,
) -> Result<Vec<Estimate>, Cancelled> {
    tracer.prepare_wide();
    // What takes nothing is hit by packets all the same, and counts at vertices for the ways they are approached.
    let has_nothing = tracer.mesh().objects.iter().any(|object| object.opacity <= 0.0);
    let found = points.par_chunks(BATCH).map_init(PacketTracer::default, |packets, points| {
        let estimate = |point| {
            let found = match has_nothing || sampling.target.is_some() {
                true => estimate_at(tracer, point, sampling, progress)?,
                false => estimate_by(packets, tracer, point, sampling, progress)?,
            };
            progress.advance(1);
            Ok(found)
        };
        points.iter().map(estimate).collect::<Result<Vec<_>, Cancelled>>()
    });
    Ok(found.collect::<Result<Vec<_>, Cancelled>>()?.concat())
}

/// The value at one point, of as many rays as the sampling says: [`estimate_at`]'s, bit for bit.
fn estimate_by<const D: usize>(
    packets: &mut PacketTracer<D>,
    tracer: &Tracer<D>,
    point: &ShadingPoint<D>,
    sampling: &Sampling,
    progress: &dyn Progress,
) -> Result<Estimate, Cancelled> {
    let rays = Rays::of(tracer, point, sampling);
    if rays.normal.amax() == 0.0 {
        return Ok(Estimate::known(1.0));
    }
    let mut shares = Shares::new(sampling.sampler, Dimension::of::<D>());
    let mut watch = |direction, is_open| shares.add(if is_open { 1.0 } else { rays.share(direction) });
    packets.watched(tracer, point, sampling, &mut watch, progress)?;
    Ok(shares.estimate())
}

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
struct Rays<'t, const D: usize> {
    tracer: &'t Tracer<D>,
    position: Vector<D>,
    normal: Vector<D>,
    limit: f32,
    star: Vec<Around<D>>,
    ignored: Vec<u32>,
}

impl<'t, const D: usize> Rays<'t, D> {
    fn of(tracer: &'t Tracer<D>, point: &ShadingPoint<D>, sampling: &Sampling) -> Self {
        let (position, normal) = (point.position(tracer.mesh()), point.normal(tracer.mesh()));
        let star = if normal.amax() == 0.0 { Vec::new() } else { star(tracer, point, normal) };
        Self { tracer, position, normal, limit: sampling.max_distance, star, ignored: point.ignored(tracer) }
    }

    /// The share of light that passes along a ray.
    fn share(&self, direction: Vector<D>) -> f64 {
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
