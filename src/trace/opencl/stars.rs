//! Shading points as a device knows them, with what the simplices around them hide.
//!
//! A vertex that is approached along its normal, as nearly all are, has its cones made by the device (`kernels/stars.cl`): the host would take
//! longer for them than the device for a hundred rays, and half of that to bring them there. Where a vertex is approached otherwise, cones may be exactly
//! flat, which only the host can tell.

use rayon::prelude::*;

use super::backend::OpenClBackend;
use super::device::{Argument, Memory};
use super::error::Error;
use super::layout::{self, Apex, StarCone, float4};
use super::scene::{OnDevice, Part, is_exact, sampled_point};
use crate::geometry::{Cone, Frame};
use crate::mesh::approach;
use crate::trace::backend::NOTHING;
use crate::trace::point::ShadingPoint;
use crate::trace::sampling::{Sampling, Sequence};
use crate::trace::surroundings::star;

/// Points that one thread prepares at a time.
pub(super) const BLOCK: usize = 512;

/// A point with what its rays need.
pub(super) struct Prepared {
    /// As the device knows it, but for the next ray; its star as its block has it.
    point: layout::Point,
    /// Whether the device makes its star.
    stars_there: bool,
    /// Whether the device can be asked.
    pub serves: bool,
}

/// [`BLOCK`] points.
pub(super) struct Block {
    pub points: Vec<Prepared>,
    /// Where the stars begin on the device that were made here, and those that it makes.
    first: [u32; 2],
}

impl Block {
    /// A point as the device knows it, but for the next ray.
    pub fn point(&self, index: usize) -> layout::Point {
        let Prepared { point, stars_there, .. } = self.points[index];
        let star = if point.star == NOTHING { NOTHING } else { point.star + self.first[usize::from(stars_there)] };
        layout::Point { star, ..point }
    }
}

/// The stars of a block.
#[derive(Default)]
struct Stars {
    made: Vec<StarCone>,
    /// What is to be made, and how much room it takes.
    asked: Vec<Apex>,
    room: u32,
}

impl<const D: usize> OpenClBackend<D> {
    /// Sees to it that the device has what simplices around the points hide.
    pub(super) fn prepare(
        &self,
        on: &Part,
        on_device: &mut OnDevice,
        points: &[ShadingPoint<D>],
        sampling: &Sampling,
        serves: bool,
    ) -> Result<Vec<Block>, Error> {
        let block = |points: &[ShadingPoint<D>]| {
            let mut stars = Stars::default();
            let prepared = |point| self.prepared(point, sampling, serves, &mut stars);
            (Block { points: points.iter().map(prepared).collect(), first: [0; 2] }, stars)
        };
        let (mut blocks, mut stars): (Vec<Block>, Vec<Stars>) = points.par_chunks(BLOCK).map(block).unzip();
        let made: usize = stars.iter().map(|stars| stars.made.len()).sum();
        let all = made + stars.iter().map(|stars| stars.room as usize).sum::<usize>();
        let (device, room) = (&on.device, &mut on_device.room);
        let memory = device.room(&mut room.star, all, "cones around points")?;
        let mut first = [0, made as u32];
        for (block, stars) in blocks.iter_mut().zip(&mut stars) {
            block.first = first;
            device.write(memory, first[0] as usize, &stars.made)?;
            stars.asked.iter_mut().for_each(|apex| apex.star += first[1]);
            first = [first[0] + stars.made.len() as u32, first[1] + stars.room];
        }
        let asked: Vec<Apex> = stars.into_iter().flat_map(|stars| stars.asked).collect();
        if !asked.is_empty() {
            let count = Argument::U64(asked.len() as u64);
            let apices = device.filled(&mut room.apices, &asked, "vertices")?;
            let mut arguments = on_device.mesh.arguments();
            arguments.extend(on_device.mesh.around.each_ref().map(Memory::argument));
            arguments.extend([apices.argument(), count, memory.argument()]);
            device.launch(&on_device.kernels.stars, &arguments, asked.len())?;
        }
        Ok(blocks)
    }

    /// A point; what its star hides, or what is to be asked for it, is added to that of others.
    fn prepared(&self, point: &ShadingPoint<D>, sampling: &Sampling, serves: bool, stars: &mut Stars) -> Prepared {
        let mesh = self.tracer.mesh();
        let position = point.position(mesh);
        let ignored = point.ignored(&self.tracer);
        let normal = point.normal(mesh);
        let scaled = float4(&self.scale.scaled(&position));
        let (mut head, mut vertex, mut stars_there) = (NOTHING, NOTHING, false);
        if let ShadingPoint::Vertex(v) = *point {
            vertex = mesh.identity[v as usize];
            let around = self.tracer.incidence().around(vertex);
            stars_there = approach(mesh, around, v) == normal;
            if stars_there {
                head = stars.room;
                let star = head;
                stars.asked.push(Apex { position: scaled, normal: float4(&normal), vertex, star, ..Apex::default() });
                stars.room += 1 + around.len() as u32;
            } else {
                head = stars.made.len() as u32;
                let cones = star(&self.tracer, point);
                let cones: Vec<StarCone> = cones.iter().filter_map(|(_, cone)| star_cone(cone)).collect();
                // Not approached along the normal, they may be as high as any.
                stars.made.push(StarCone::head(cones.len() as u32, 2.0));
                stars.made.extend(cones);
            }
        }
        let sequence = Sequence::new(sampling.sampler, sampling.seed, point.number());
        Prepared {
            point: layout::Point {
                position: scaled,
                ignored: ignored.first().copied().unwrap_or(NOTHING),
                star: head,
                vertex,
                ..sampled_point(&Frame::new(&normal), &sequence)
            },
            stars_there,
            // The kernel knows of one simplex that is ignored, and its boxes are made for origins in the scene (`wide.rs`).
            serves: serves
                && ignored.len() <= 1
                && is_exact(&self.scale, &position)
                && self.scale.centred(&position).amax() <= 0.51,
        }
    }
}

/// A cone for the device; none if it is flat, and holds no direction.
fn star_cone<const D: usize>(cone: &Cone<D>) -> Option<StarCone> {
    let sign = f64::from(cone.orientation());
    if sign == 0.0 {
        return None;
    }
    let mut found = StarCone::default();
    for i in 0..D {
        let (normal, bound) = cone.facet(i);
        let size = normal.amax();
        if size > 0.0 {
            found.normals[i] = float4(&normal.map(|x| (x * sign / size) as f32));
        }
        // The normal's rounding here, that of the product there, and what is too small for single precision.
        found.bounds.0[i] = if size > 0.0 { (bound / size) as f32 * 1.01 + 1e-6 } else { 1.0 };
    }
    Some(found)
}
