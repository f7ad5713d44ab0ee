//! The surface pass: from the simplices that samples see to the columns of the G-buffer.
//!
//! What a column needs is computed only if it was asked for. Where a voxel's samples see several simplices, each of them
//! is looked at once, where the mean of its samples is, and counts by their number.
//!
//! Sums are taken in `f64`, in which the values of one simplex lose nothing: a voxel that sees one simplex has just the
//! value at its centre.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use super::gbuffer::{Columns, GBuffer, RowMut};
use super::light::{Lighting, Lit, reflectance};
use super::samples::{Group, Sampling};
use super::{Camera, Shading, Skylight, Visibility, audit};
use crate::accel::Tracer;
use crate::geometry::{Cone, Crossing, Ray, Vector, Vector64, narrow, normal_of, widen};
use crate::mesh::normals::unit;
use crate::occlusion::{Error, open_vector};
use crate::progress::Progress;

/// What turns hits into columns.
pub(super) struct SurfacePass<'r, const D: usize> {
    pub tracer: &'r Tracer<D>,
    pub camera: &'r Camera<D>,
    pub sampling: &'r Sampling,
    pub visibility: &'r Visibility<D>,
    pub shading: &'r Shading,
    pub lighting: Option<&'r Lighting<D>>,
    pub skylight: Option<&'r Skylight<D>>,
    /// If it is there, voxels' points are needed only where the hash of the voxel's number is at most this.
    pub points: Option<&'r AtomicU64>,
}

/// Where a ray meets a simplex.
pub(super) struct Hit<const D: usize> {
    pub simplex: u32,
    pub ray: Ray<D>,
    pub crossing: Crossing<D>,
}

/// What is left from voxel to voxel of a row.
struct Scratch<const D: usize> {
    groups: Vec<Group>,
    /// The cone that was asked for last: in perspective that of the voxel before will mostly do.
    cone: Option<(u32, Vector<D>, Cone<D>)>,
}

impl<const D: usize> Scratch<D> {
    fn cone(&mut self, tracer: &Tracer<D>, simplex: u32, origin: &Vector<D>) -> &Cone<D> {
        let kept = self.cone.take().filter(|(s, o, _)| *s == simplex && o == origin);
        let cone = || (simplex, *origin, Cone::of_simplex(origin, &tracer.mesh().corners(simplex)));
        &self.cone.insert(kept.unwrap_or_else(cone)).2
    }
}

/// Means over a voxel's samples, weighted by their number.
struct Means<const D: usize> {
    samples: f64,
    depth: f64,
    occlusion: f64,
    error: f64,
    albedo: [f64; 3],
    lit: [f64; 3],
    sky: Skies<D>,
}

/// Sums of where the sky is open, and of the light of what hides it.
struct Skies<const D: usize> {
    open: f64,
    vector: Vector64<D>,
    bounced: [f64; 3],
    bounced_error: f64,
}

impl<const D: usize> SurfacePass<'_, D> {
    /// Some layers of the image, with their occlusion where it comes from vertices.
    ///
    /// # Errors
    /// Those of [`Visibility::first_hits`].
    pub fn layers(&self, layers: Range<usize>, columns: Columns, progress: &dyn Progress) -> Result<GBuffer<D>, Error> {
        let dimensions = self.sampling.grid.dimensions;
        let found = self.sampling.first_hits(self.visibility, &layers, progress)?;
        let mut buffer = GBuffer::new(dimensions, layers.clone(), columns);
        let [width, height, _] = dimensions;
        buffer.rows_mut().par_iter_mut().enumerate().try_for_each(|(row, out)| {
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            let (j, layer) = (row % height, row / height);
            let mut scratch = Scratch { groups: Vec::new(), cone: None };
            for i in 0..width {
                if let Some((sample, simplex)) = self.sampling.groups(&found, [i, j, layer], &mut scratch.groups) {
                    let index = [i, j, layers.start + layer];
                    self.voxel(index, sample, simplex, &mut scratch, out);
                    if let (Some(lighting), false) = (self.lighting, out.direct.is_empty()) {
                        let samples = |simplex: u32| self.sampling.of_simplex(&found, [i, j, layer], simplex);
                        out.direct[i] = self.direct(lighting, index, samples, &mut scratch);
                    }
                }
            }
            progress.advance(width as u64);
            Ok(())
        })?;
        Ok(buffer)
    }

    /// Whether nobody asks for the point of this voxel.
    fn needs_no_point(&self, [i, j, k]: [usize; 3]) -> bool {
        let [width, height, _] = self.sampling.grid.dimensions;
        let number = i + width * (j + height * k);
        self.points.is_some_and(|limit| audit::hash(number as u64) > limit.load(Ordering::Relaxed))
    }

    /// How much of what is behind a simplex it hides.
    pub fn opacity_of(&self, simplex: u32) -> f64 {
        let mesh = self.tracer.mesh();
        f64::from(mesh.objects[mesh.object_of(simplex)].opacity)
    }

    /// Fills in one voxel, whose groups are in `scratch` and whose point is what `sample` sees of `simplex`.
    #[inline]
    fn voxel(&self, index: [usize; 3], sample: usize, simplex: u32, scratch: &mut Scratch<D>, out: &mut RowMut<D>) {
        let i = index[0];
        let mesh = self.tracer.mesh();
        let corners = mesh.corners(simplex).map(|v| widen(&v));
        let seen: usize = scratch.groups.iter().map(|group| group.count).sum();
        set(out.simplex, i, || simplex);
        set(out.object, i, || mesh.object_of(simplex) as u16 + 1);
        set(out.coverage, i, || seen as f32 / self.sampling.count() as f32);
        if out.has_means() {
            self.means(index, scratch, out.has_sky()).set(i, out);
        }
        if !out.has_point() || self.needs_no_point(index) {
            return;
        }
        let ray = self.sampling.ray(self.camera, index, sample);
        set(out.normal, i, || facing(normal_of(&corners), &ray));
        let weights = scratch.cone(self.tracer, simplex, &ray.origin).crossing(&ray.direction).barycentric;
        let vertices = mesh.simplices[simplex as usize];
        set(out.barycentric, i, || weights.map(|w| w as f32));
        set(out.position, i, || narrow(&(0..D).fold(Vector64::zeros(), |p, c| p + corners[c] * weights[c])));
        set(out.shading_normal, i, || {
            let normal = |c: usize| widen(&mesh.normals[vertices[c] as usize]);
            facing((0..D).fold(Vector64::zeros(), |n, c| n + normal(c) * weights[c]), &ray)
        });
    }

    /// The means over a voxel's groups.
    fn means(&self, index: [usize; 3], scratch: &mut Scratch<D>, has_sky: bool) -> Means<D> {
        let mesh = self.tracer.mesh();
        let mut means = Means::<D>::nothing();
        for g in 0..scratch.groups.len() {
            let group = scratch.groups[g];
            let ray = self.sampling.mean_ray(self.camera, index, &group);
            let crossing = scratch.cone(self.tracer, group.simplex, &ray.origin).crossing(&ray.direction);
            let hit = Hit { simplex: group.simplex, ray, crossing };
            let vertices = mesh.simplices[group.simplex as usize];
            let (occlusion, error) = self.shading.at_vertices(vertices, &hit.crossing.barycentric);
            let (weight, occlusion) = (group.count as f64, f64::from(occlusion));
            means.samples += weight;
            means.depth += weight * hit.depth();
            means.occlusion += weight * occlusion;
            means.error += weight * f64::from(error);
            let color = mesh.objects[mesh.object_of(group.simplex)].color;
            let kept = weight * self.opacity_of(group.simplex);
            let ambient = match self.lighting {
                None => color.map(f64::from),
                Some(lighting) => reflectance(color).map(|c| c * lighting.ambient * lighting.cue(hit.depth()).0),
            };
            for (c, color) in ambient.into_iter().enumerate() {
                means.albedo[c] += kept * color;
                means.lit[c] += kept * color * occlusion;
            }
            if has_sky {
                self.add_sky(&hit, weight, &mut means.sky);
            }
        }
        means
    }

    /// The mean over a voxel's samples of what lights and depth cues send to the eye. Each sample looks for itself, as
    /// a shadow may end between them.
    fn direct<I: Iterator<Item = usize>>(
        &self,
        lighting: &Lighting<D>,
        index: [usize; 3],
        samples: impl Fn(u32) -> I,
        scratch: &mut Scratch<D>,
    ) -> [f32; 3] {
        let mesh = self.tracer.mesh();
        let (mut sum, mut count) = ([0.0; 3], 0.0);
        for g in 0..scratch.groups.len() {
            let simplex = scratch.groups[g].simplex;
            let reflectance = reflectance(mesh.objects[mesh.object_of(simplex)].color);
            let opacity = self.opacity_of(simplex);
            for sample in samples(simplex) {
                let ray = self.sampling.ray(self.camera, index, sample);
                let crossing = scratch.cone(self.tracer, simplex, &ray.origin).crossing(&ray.direction);
                let hit = Hit { simplex, ray, crossing };
                let light = lighting.direct(self.tracer, &self.lit(&hit, reflectance));
                let (left, cue) = lighting.cue(hit.depth());
                (0..3).for_each(|c| sum[c] += (light[c] * left + cue[c]) * opacity);
                count += 1.0;
            }
        }
        sum.map(|c: f64| (c / count).min(f64::from(f32::MAX)) as f32)
    }

    /// Adds where the sky is open at a point, by the values at the simplex's vertices.
    fn add_sky(&self, hit: &Hit<D>, weight: f64, sky: &mut Skies<D>) {
        let mesh = self.tracer.mesh();
        let vertices = mesh.simplices[hit.simplex as usize];
        let weights = match self.shading {
            Shading::None => {
                let normal = normal_of(&mesh.corners(hit.simplex).map(|v| widen(&v)));
                sky.open += weight;
                sky.vector += open_vector(&widen(&facing(normal, &hit.ray))) * weight;
                return;
            }
            // Found at the point itself, or not at all.
            Shading::Voxel(_) | Shading::ScreenSpace(_) => return,
            Shading::Flat(_) => [weight / D as f64; D],
            Shading::Smooth(_) | Shading::Auto(..) => hit.crossing.barycentric.map(|w| w * weight),
        };
        let Some(skylight) = self.skylight else { return };
        let directions = skylight.directions.as_deref();
        let mut variance = 0.0;
        for (v, w) in vertices.into_iter().map(|v| v as usize).zip(weights) {
            if let Some(found) = directions {
                sky.open += w * f64::from(found.estimates.values[v]);
                sky.vector += widen(&found.vectors[v]) * w;
            }
            if let Some(bounced) = skylight.bounced.as_deref() {
                (0..3).for_each(|c| sky.bounced[c] += w * f64::from(bounced.light[v][c]));
                variance += (w * f64::from(bounced.errors[v])).powi(2);
            }
        }
        sky.bounced_error += variance.sqrt();
    }

    /// What lights ask of a point.
    pub(super) fn lit(&self, hit: &Hit<D>, reflectance: [f64; 3]) -> Lit<D> {
        let mesh = self.tracer.mesh();
        let corners = mesh.corners(hit.simplex).map(|v| widen(&v));
        let (vertices, weights) = (mesh.simplices[hit.simplex as usize], hit.crossing.barycentric);
        let facing = widen(&facing(normal_of(&corners), &hit.ray));
        let interpolated = match self.shading {
            Shading::Flat(_) => Vector64::zeros(),
            _ => (0..D).fold(Vector64::zeros(), |n, c| n + widen(&mesh.normals[vertices[c] as usize]) * weights[c]),
        };
        // On the side of the simplex's own, even where it has turned away from the eye already.
        let interpolated = widen(&unit(&interpolated));
        let side = interpolated.dot(&facing);
        Lit {
            simplex: hit.simplex,
            point: (0..D).fold(Vector64::zeros(), |p, c| p + corners[c] * weights[c]),
            facing,
            normal: if side == 0.0 { facing } else { interpolated * side.signum() },
            to_eye: widen(&unit(&-widen(&hit.ray.direction))),
            reflectance,
            gloss: mesh.objects[mesh.object_of(hit.simplex)].gloss,
        }
    }
}

impl<const D: usize> Hit<D> {
    /// Distance from the eye.
    pub(super) fn depth(&self) -> f64 {
        self.crossing.t * widen(&self.ray.direction).norm()
    }
}

impl<const D: usize> RowMut<'_, D> {
    /// Whether it has columns that belong to the voxel's point.
    fn has_point(&self) -> bool {
        !(self.normal.is_empty()
            && self.barycentric.is_empty()
            && self.position.is_empty()
            && self.shading_normal.is_empty())
    }

    /// Whether it has columns that are means over a voxel's samples.
    fn has_means(&self) -> bool {
        !(self.depth.is_empty() && self.occlusion.is_empty() && self.error.is_empty() && self.albedo.is_empty())
            || self.has_sky()
    }

    /// Whether it has columns of where the sky is open.
    fn has_sky(&self) -> bool {
        !(self.direction.is_empty() && self.hidden.is_empty() && self.bounce_error.is_empty())
    }
}

impl<const D: usize> Means<D> {
    fn nothing() -> Self {
        let sky = Skies { open: 0.0, vector: Vector64::zeros(), bounced: [0.0; 3], bounced_error: 0.0 };
        Self { samples: 0.0, depth: 0.0, occlusion: 0.0, error: 0.0, albedo: [0.0; 3], lit: [0.0; 3], sky }
    }

    fn set(&self, i: usize, out: &mut RowMut<D>) {
        let mean = |sum: f64| (sum / self.samples) as f32;
        set(out.depth, i, || mean(self.depth));
        set(out.occlusion, i, || mean(self.occlusion));
        set(out.error, i, || mean(self.error));
        // Weighted by occlusion, unless all is dark.
        let albedo =
            |c: usize| if self.occlusion > 0.0 { (self.lit[c] / self.occlusion) as f32 } else { mean(self.albedo[c]) };
        set(out.albedo, i, || [0, 1, 2].map(albedo));
        let (open, hidden) = (self.sky.open, self.samples - self.sky.open);
        if open > 0.0 {
            set(out.direction, i, || narrow(&(self.sky.vector / open)));
        }
        if hidden > 0.0 {
            set(out.hidden, i, || self.sky.bounced.map(|c| (c / hidden) as f32));
        }
        set(out.bounce_error, i, || mean(self.sky.bounced_error));
    }
}

/// Sets a column's voxel, if there is such a column.
#[inline]
fn set<T>(column: &mut [T], i: usize, value: impl FnOnce() -> T) {
    if let Some(place) = column.get_mut(i) {
        *place = value();
    }
}

/// A normal at length 1, on the side that the ray comes from.
#[inline]
pub(super) fn facing<const D: usize>(normal: Vector64<D>, ray: &Ray<D>) -> Vector<D> {
    let towards = normal.dot(&widen(&ray.direction)) > 0.0;
    unit(&if towards { -normal } else { normal })
}
