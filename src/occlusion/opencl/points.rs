//! Shading points on a device.

use std::sync::PoisonError;
use std::sync::atomic::Ordering;
use std::time::Instant;

use rayon::prelude::*;

use super::device::Argument;
use super::layout::{self, Float4, Fold};
use super::scene::{MOST_RAYS, OnDevice, Part, Scene, float4, is_exact};
use crate::geometry::{Cone, Frame, Vector};
use crate::mesh::{Incidence, approach};
use crate::occlusion::estimate::Tally;
use crate::occlusion::sampling::Source;
use crate::occlusion::site::fold_cone;
use crate::occlusion::{Cancelled, Error, Estimate, Sampler, Sequence, Settings, Site, Target};
use crate::progress::Progress;

/// Points that are prepared together.
const POINTS: usize = 1 << 14;

/// A point at which ambient occlusion is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Point<const D: usize> {
    /// A vertex of the mesh.
    Vertex(u32),
    /// A visible point inside a simplex, on the side that the normal points to.
    Inside {
        /// Where it is.
        position: Vector<D>,
        /// The normal, of length 1.
        normal: Vector<D>,
        /// The simplex.
        simplex: u32,
        /// Tells points apart.
        number: u64,
    },
}

/// A point with what its rays need.
struct Prepared<const D: usize> {
    position: Vector<D>,
    frame: Frame<D>,
    number: u64,
    ignored: u32,
    /// Whether the device can be asked.
    serves: bool,
    folds: Vec<Fold>,
}

/// Points that are worked on together.
struct Chunk<'a, const D: usize> {
    incidence: &'a Incidence,
    points: &'a [Point<D>],
    prepared: Vec<Prepared<D>>,
    settings: &'a Settings,
    /// Whether directions are made here and handed over.
    given: bool,
}

/// How far a point's rays have come.
struct Running {
    sequence: Sequence,
    tally: Tally,
}

/// A point as the device knows it, so far as its rays are concerned.
pub(super) fn sampled_site<const D: usize>(frame: &Frame<D>, sequence: &Sequence) -> layout::Site {
    let (axis, factor, turned) = frame.parts();
    let keys = match &sequence.source {
        Source::Sobol(keys) => *keys,
        Source::Random(_) => [0; 4],
    };
    let (turned, next) = (u32::from(turned), sequence.next);
    layout::Site { axis: float4(axis), keys, factor, turned, next, ..layout::Site::default() }
}

impl<const D: usize> Scene<'_, D> {
    /// Estimates A at points, in their order, as [`crate::occlusion::estimate_at`] does.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if `progress` says so, [`Error::OpenCl`] if a call fails.
    pub fn estimate(
        &self,
        points: &[Point<D>],
        settings: &Settings,
        target: Option<Target>,
        progress: &dyn Progress,
    ) -> Result<Vec<Estimate>, Error> {
        let incidence = Incidence::new(self.tracer.mesh());
        let size = POINTS.min(points.len().div_ceil(if self.parts.len() == 1 { 1 } else { 4 * self.parts.len() }));
        let jobs: Vec<&[Point<D>]> = points.chunks(size.max(1)).collect();
        let job = |on: &Part, i: usize| {
            let prepared = jobs[i].par_iter().map(|p| self.prepare(&incidence, p)).collect();
            let given = settings.sampler == Sampler::Random || !on.makes_directions;
            let chunk = Chunk { incidence: &incidence, points: jobs[i], prepared, settings, given };
            self.estimate_chunk(on, &chunk, target, progress)
        };
        Ok(self.share(jobs.len(), job)?.concat())
    }

    fn normal(&self, point: &Point<D>) -> Vector<D> {
        match point {
            Point::Vertex(vertex) => self.tracer.mesh().normals[*vertex as usize],
            Point::Inside { normal, .. } => *normal,
        }
    }

    fn prepare(&self, incidence: &Incidence, point: &Point<D>) -> Prepared<D> {
        let mesh = self.tracer.mesh();
        let normal = self.normal(point);
        let frame = Frame::new(&normal);
        let serves = |position| self.serves && is_exact(&self.scale, position);
        match *point {
            Point::Inside { position, simplex, number, .. } => {
                Prepared { position, frame, number, ignored: simplex, serves: serves(&position), folds: Vec::new() }
            }
            Point::Vertex(vertex) => {
                let (position, identity) = (mesh.vertices[vertex as usize], mesh.identity[vertex as usize]);
                let around = incidence.around(identity);
                let ways = [normal, approach(mesh, around, vertex)];
                let cones = around.iter().filter_map(|&s| fold_cone(mesh, position, ways, identity, s));
                let folds = cones.filter_map(fold);
                let (number, ignored) = (u64::from(vertex), layout::NONE);
                Prepared { position, frame, number, ignored, serves: serves(&position), folds: folds.collect() }
            }
        }
    }

    /// All points of a chunk: those that need more rays go on together, each with as many as the others.
    fn estimate_chunk(
        &self,
        on: &Part,
        chunk: &Chunk<D>,
        target: Option<Target>,
        progress: &dyn Progress,
    ) -> Result<Vec<Estimate>, Error> {
        let settings = chunk.settings;
        let run = |p: &Prepared<D>| Running {
            sequence: Sequence::new(settings.sampler, settings.seed, p.number),
            tally: Tally::new(settings.sampler),
        };
        let mut running: Vec<Running> = chunk.prepared.par_iter().map(run).collect();
        // Without a normal there is nothing to ask.
        let open: Vec<bool> = chunk.points.iter().map(|p| self.normal(p).amax() == 0.0).collect();
        let mut active: Vec<usize> = (0..open.len()).filter(|&i| !open[i]).collect();
        progress.advance((open.len() - active.len()) as u64);
        let mut done = 0;
        while !active.is_empty() {
            let step = target.map_or(settings.samples, |_| done.max(Target::FEWEST)).min(settings.samples - done);
            self.trace(on, chunk, &active, step, &mut running, progress)?;
            done += step;
            let before = active.len();
            let goes_on = |tally| done < settings.samples && target.is_none_or(|target| !target.is_met(tally));
            active.retain(|&i| goes_on(&running[i].tally));
            progress.advance((before - active.len()) as u64);
        }
        let estimate = |(open, r): (bool, Running)| if open { Estimate::known(1.0) } else { r.tally.estimate() };
        Ok(open.into_iter().zip(running).map(estimate).collect())
    }

    /// Traces so many more rays of the active points, a launch at a time.
    fn trace(
        &self,
        on: &Part,
        chunk: &Chunk<D>,
        active: &[usize],
        rays: u32,
        running: &mut [Running],
        progress: &dyn Progress,
    ) -> Result<(), Error> {
        let mut on_device = on.on_device.lock().unwrap_or_else(PoisonError::into_inner);
        let mut traced = 0;
        while traced < rays {
            // Many rays of a point go piece by piece, in multiples of 64 but for the last.
            let piece = (rays - traced).min(MOST_RAYS as u32 / 4);
            let mut begin = 0;
            while begin < active.len() {
                if progress.cancelled() {
                    return Err(Cancelled.into());
                }
                let count = (on_device.rays / piece as usize).clamp(1, active.len() - begin);
                let part = &active[begin..begin + count];
                let start = Instant::now();
                let found = self.launch(on, &on_device, chunk, part, piece, running)?;
                on_device.learn(found.len(), start.elapsed().as_secs_f64());
                for (&i, found) in part.iter().zip(found.chunks(piece as usize)) {
                    for word in found.chunks(64) {
                        let open = word.iter().rev().fold(0u64, |bits, &f| bits << 1 | u64::from(f == layout::OPEN));
                        running[i].tally.add(open, word.len() as u32);
                    }
                }
                begin += count;
            }
            traced += piece;
        }
        Ok(())
    }

    /// What becomes of the next `piece` rays of each point of a part: open or hit, point after point.
    fn launch(
        &self,
        on: &Part,
        on_device: &OnDevice,
        chunk: &Chunk<D>,
        part: &[usize],
        piece: u32,
        running: &mut [Running],
    ) -> Result<Vec<u8>, Error> {
        let size = piece as usize;
        let total = part.len() * size;
        let mut sites = Vec::with_capacity(part.len());
        let mut folds = Vec::new();
        for &i in part {
            let point = &chunk.prepared[i];
            sites.push(layout::Site {
                position: float4(&self.scale.scaled(&point.position)),
                ignored: point.ignored,
                fold_first: folds.len() as u32,
                fold_count: point.folds.len() as u32,
                ..sampled_site(&point.frame, &running[i].sequence)
            });
            folds.extend_from_slice(&point.folds);
        }
        let firsts: Vec<u32> = part.iter().map(|&i| running[i].sequence.next).collect();
        let mut ways = Vec::new();
        for &i in part {
            let sequence = &mut running[i].sequence;
            if chunk.given {
                ways.extend((0..piece).map(|_| sequence.next_direction::<D>(&chunk.prepared[i].frame)));
            } else {
                sequence.next = sequence.next.wrapping_add(piece);
            }
        }
        let given: Vec<Float4> = ways.iter().map(float4).collect();
        let (sites, folds) = (on.device.filled(&sites, "points")?, on.device.filled(&folds, "cones around points")?);
        let (given, out) = (on.device.filled(&given, "rays")?, on.device.empty::<u8>(total, "results")?);
        let arguments = [
            on_device.nodes.argument(),
            on_device.corners.argument(),
            on_device.simplices.argument(),
            Argument::U32(u32::from(self.is_empty())),
            sites.argument(),
            folds.argument(),
            on_device.matrices.argument(),
            given.argument(),
            Argument::U32(u32::from(chunk.given)),
            Argument::U32(piece),
            Argument::U64(total as u64),
            Argument::F32((f64::from(chunk.settings.max_distance) * self.scale.factor) as f32),
            out.argument(),
        ];
        on.device.launch(&on_device.kernels.occluded, &arguments, total)?;
        let mut found = vec![layout::OPEN; total];
        on.device.read(&out, &mut found)?;
        found.par_chunks_mut(size).enumerate().for_each(|(k, found)| {
            let way = |n: usize| {
                if chunk.given {
                    return ways[k * size + n];
                }
                let point = &chunk.prepared[part[k]];
                let mut sequence = Sequence::new(chunk.settings.sampler, chunk.settings.seed, point.number);
                sequence.next = firsts[k].wrapping_add(n as u32);
                sequence.next_direction(&point.frame)
            };
            self.settle(chunk, part[k], found, way);
        });
        Ok(found)
    }

    /// Decides exactly what the device left open, of the rays of one point.
    fn settle(&self, chunk: &Chunk<D>, index: usize, found: &mut [u8], way: impl Fn(usize) -> Vector<D>) {
        let (mut site, mut settled) = (None, 0);
        for (n, found) in found.iter_mut().enumerate() {
            if chunk.prepared[index].serves && matches!(*found, layout::OPEN | layout::HIT) {
                continue;
            }
            let site = site.get_or_insert_with(|| match chunk.points[index] {
                Point::Vertex(vertex) => Site::at_vertex(self.tracer, chunk.incidence, vertex),
                Point::Inside { position, normal, simplex, .. } => Site::inside_simplex(position, normal, simplex),
            });
            settled += 1;
            let visible = site.is_visible(self.tracer, way(n), chunk.settings.max_distance);
            *found = if visible { layout::OPEN } else { layout::HIT };
        }
        self.settled.fetch_add(settled, Ordering::Relaxed);
    }
}

/// A cone for the device; none if it is flat, and holds no direction.
fn fold<const D: usize>(cone: Cone<D>) -> Option<Fold> {
    let sign = f64::from(cone.orientation());
    if sign == 0.0 {
        return None;
    }
    let mut fold = Fold::default();
    for i in 0..D {
        let (normal, bound) = cone.facet(i);
        let size = normal.amax();
        if size > 0.0 {
            fold.normals[i] = float4(&normal.map(|x| (x * sign / size) as f32));
        }
        // The normal's rounding here, that of the product there, and what is too small for single precision.
        fold.bounds.0[i] = if size > 0.0 { (bound / size) as f32 * 1.01 + 1e-6 } else { 1.0 };
    }
    Some(fold)
}
