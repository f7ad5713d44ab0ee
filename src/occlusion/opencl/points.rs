//! Shading points on a device.

use std::sync::PoisonError;

use rayon::prelude::*;

use super::device::{Argument, Memory};
use super::layout::{self, Float4, Fold};
use super::scene::{MOST_RAYS, Part, Scene, float4, is_exact};
use crate::geometry::{Cone, Frame, Vector};
use crate::mesh::Incidence;
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

/// A point as the device knows it, so far as its rays are concerned.
pub(super) fn sampled_site<const D: usize>(frame: &Frame<D>, sequence: &Sequence, next: u32) -> layout::Site {
    let (axis, factor, turned) = frame.parts();
    let keys = match &sequence.source {
        Source::Sobol(keys) => *keys,
        Source::Random(_) => [0; 4],
    };
    layout::Site { axis: float4(axis), keys, factor, turned: u32::from(turned), next, ..layout::Site::default() }
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
        let job = |part: &Part, i: usize| self.estimate_some(part, &incidence, jobs[i], settings, target, progress);
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
                let cones = incidence.around(identity).iter();
                let folds = cones.filter_map(|&s| fold_cone(mesh, position, normal, identity, s)).filter_map(fold);
                let (number, ignored) = (u64::from(vertex), layout::NONE);
                Prepared { position, frame, number, ignored, serves: serves(&position), folds: folds.collect() }
            }
        }
    }

    /// The point for exact arithmetic.
    fn site(&self, incidence: &Incidence, point: &Point<D>) -> Site<D> {
        match *point {
            Point::Vertex(vertex) => Site::at_vertex(self.tracer, incidence, vertex),
            Point::Inside { position, normal, simplex, .. } => Site::inside_simplex(position, normal, simplex),
        }
    }

    /// All points of a chunk: those that need more rays go on together, all of them with as many rays as each other.
    fn estimate_some(
        &self,
        on: &Part,
        incidence: &Incidence,
        points: &[Point<D>],
        settings: &Settings,
        target: Option<Target>,
        progress: &dyn Progress,
    ) -> Result<Vec<Estimate>, Error> {
        let prepared: Vec<Prepared<D>> = points.par_iter().map(|p| self.prepare(incidence, p)).collect();
        let mut sequences: Vec<Sequence> =
            prepared.par_iter().map(|p| Sequence::new(settings.sampler, settings.seed, p.number)).collect();
        let mut tallies = vec![Tally::new(settings.sampler); points.len()];
        let mut active: Vec<usize> = (0..points.len()).filter(|&i| self.normal(&points[i]).amax() > 0.0).collect();
        progress.advance((points.len() - active.len()) as u64);
        let known: Vec<bool> = points.par_iter().map(|p| self.normal(p).amax() == 0.0).collect();
        let mut done = 0;
        while !active.is_empty() {
            let step = match target {
                Some(_) => done.max(Target::FEWEST),
                None => settings.samples,
            };
            let rays = step.min(settings.samples - done);
            self.trace(
                on,
                incidence,
                points,
                &prepared,
                &active,
                rays,
                &mut sequences,
                &mut tallies,
                settings,
                progress,
            )?;
            done += rays;
            let before = active.len();
            active.retain(|&i| done < settings.samples && target.is_none_or(|target| !target.is_met(&tallies[i])));
            progress.advance((before - active.len()) as u64);
        }
        let estimate = |(known, tally): (bool, Tally)| if known { Estimate::known(1.0) } else { tally.estimate() };
        Ok(known.into_iter().zip(tallies).map(estimate).collect())
    }

    /// Traces so many more rays of the active points.
    #[allow(clippy::too_many_arguments)]
    fn trace(
        &self,
        on: &Part,
        incidence: &Incidence,
        points: &[Point<D>],
        prepared: &[Prepared<D>],
        active: &[usize],
        rays: u32,
        sequences: &mut [Sequence],
        tallies: &mut [Tally],
        settings: &Settings,
        progress: &dyn Progress,
    ) -> Result<(), Error> {
        let given = settings.sampler == Sampler::Random || !on.makes_directions;
        let limit = (f64::from(settings.max_distance) * self.scale.factor) as f32;
        let mut on_device = on.on_device.lock().unwrap_or_else(PoisonError::into_inner);
        let mut out: Option<Memory<u8>> = None;
        let mut traced = 0;
        while traced < rays {
            // Few points with many rays take them piece by piece, in multiples of 64 but for the last.
            let piece = (rays - traced).min(MOST_RAYS as u32 / 4);
            let mut begin = 0;
            while begin < active.len() {
                if progress.cancelled() {
                    return Err(Cancelled.into());
                }
                let count = (on_device.rays / piece as usize).clamp(1, active.len() - begin);
                let part = &active[begin..begin + count];
                let start = std::time::Instant::now();
                let total = count * piece as usize;
                let mut sites = Vec::with_capacity(count);
                let mut folds = Vec::new();
                for &i in part {
                    let point = &prepared[i];
                    sites.push(layout::Site {
                        position: float4(&self.scale.scaled(&point.position)),
                        ignored: point.ignored,
                        fold_first: folds.len() as u32,
                        fold_count: point.folds.len() as u32,
                        ..sampled_site(&point.frame, &sequences[i], sequences[i].next)
                    });
                    folds.extend_from_slice(&point.folds);
                }
                let firsts: Vec<u32> = part.iter().map(|&i| sequences[i].next).collect();
                let ways: Vec<Vector<D>> = if given {
                    let mut ways = vec![Vector::zeros(); total];
                    let mut of: Vec<(usize, &mut Sequence)> =
                        sequences.iter_mut().enumerate().filter(|(i, _)| part.binary_search(i).is_ok()).collect();
                    ways.par_chunks_mut(piece as usize).zip(of.par_iter_mut()).for_each(|(ways, (i, sequence))| {
                        ways.iter_mut().for_each(|way| *way = sequence.next_direction(&prepared[*i].frame));
                    });
                    ways
                } else {
                    part.iter().for_each(|&i| sequences[i].next = sequences[i].next.wrapping_add(piece));
                    Vec::new()
                };
                let sites = on.device.filled(&sites, "points")?;
                let folds = on.device.filled(&folds, "cones around points")?;
                let uploaded: Vec<Float4> = ways.iter().map(float4).collect();
                let uploaded = on.device.filled(&uploaded, "rays")?;
                if out.as_ref().is_none_or(|out| out.room < total) {
                    out = Some(on.device.empty::<u8>(total.max(on_device.rays), "results")?);
                }
                let Some(out) = &out else { continue };
                let arguments = [
                    on_device.nodes.argument(),
                    on_device.corners.argument(),
                    on_device.simplices.argument(),
                    Argument::U32(u32::from(self.is_empty())),
                    sites.argument(),
                    folds.argument(),
                    on_device.matrices.argument(),
                    uploaded.argument(),
                    Argument::U32(u32::from(given)),
                    Argument::U32(piece),
                    Argument::U64(total as u64),
                    Argument::F32(limit),
                    out.argument(),
                ];
                on.device.launch(&on_device.kernels.occluded, &arguments, total)?;
                let mut found = vec![layout::OPEN; total];
                on.device.read(out, &mut found)?;
                on_device.learn(total, start.elapsed().as_secs_f64());
                found.par_chunks_mut(piece as usize).enumerate().for_each(|(k, found)| {
                    let i = part[k];
                    let way = |n: usize| match given {
                        true => ways[k * piece as usize + n],
                        false => {
                            let mut sequence = Sequence::new(settings.sampler, settings.seed, prepared[i].number);
                            sequence.next = firsts[k].wrapping_add(n as u32);
                            sequence.next_direction(&prepared[i].frame)
                        }
                    };
                    self.settle(incidence, &points[i], prepared[i].serves, settings.max_distance, found, way);
                });
                for (&i, found) in part.iter().zip(found.chunks(piece as usize)) {
                    for word in found.chunks(64) {
                        let open = word.iter().rev().fold(0u64, |bits, &f| bits << 1 | u64::from(f == layout::OPEN));
                        tallies[i].add(open, word.len() as u32);
                    }
                }
                begin += count;
            }
            traced += piece;
        }
        Ok(())
    }

    /// Decides exactly what the device left open.
    fn settle(
        &self,
        incidence: &Incidence,
        point: &Point<D>,
        serves: bool,
        limit: f32,
        found: &mut [u8],
        way: impl Fn(usize) -> Vector<D>,
    ) {
        let (mut site, mut settled) = (None, 0);
        for (n, found) in found.iter_mut().enumerate() {
            if serves && matches!(*found, layout::OPEN | layout::HIT) {
                continue;
            }
            let site = site.get_or_insert_with(|| self.site(incidence, point));
            settled += 1;
            *found = if site.is_visible(self.tracer, way(n), limit) { layout::OPEN } else { layout::HIT };
        }
        self.settled.fetch_add(settled, std::sync::atomic::Ordering::Relaxed);
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
