//! What objects that let light through show of what is behind them.
//!
//! Each surface that a sample's ray passes keeps the share of its object's opacity, o, of what comes from behind, and sends
//! its own colour in that share. Front to back over all of them (Porter and Duff 1984),
//!
//! ```text
//! colour = sum over k of c_k o_k T_k        opacity = 1 - T_end        T_k = product over j < k of (1 - o_j)
//! ```
//!
//! up to the first opaque one. A picture's colour is that of what it shows, so the sum is divided by the opacity. Where lights are,
//! colours are linear light, and the tone curve comes afterwards; else they are what is shown, as is colour times occlusion there.
//!
//! The first surface goes on living in the columns of its own, less what passes it, so that filters still see its
//! occlusion; what comes from behind it is a column more. There the samples that pass the same simplex make a group, as at first
//! hits, and occlusion is that of the simplex's vertices, or by rays of its own where the picture has none of vertices.

use rayon::prelude::*;

use super::gbuffer::{GBuffer, RowMut};
use super::inside::inside;
use super::light::reflectance;
use super::samples::Group;
use super::surface::{Hit, SurfacePass, facing};
use super::visibility::Passages;
use super::{Columns, Shading};
use crate::geometry::{Cone, Vector64, narrow, normal_of, widen};
use crate::occlusion::{Error, Estimator};
use crate::progress::{Progress, Uncounted};
use crate::trace::{RayBackend, ShadingPoint};

/// The columns that a picture of such a scene has beside the others.
pub(super) const COLUMNS: Columns = Columns::BEHIND.union(Columns::THROUGH);

/// Ambient light of a surface behind, whose occlusion is still to be found.
#[derive(Clone, Copy, Debug)]
struct Pending<const D: usize> {
    /// The voxel's place in the buffer.
    voxel: usize,
    /// What it adds where it is open.
    light: [f64; 3],
    point: ShadingPoint<D>,
}

/// What is left from voxel to voxel of a row.
#[derive(Default)]
struct Scratch {
    groups: Vec<Group>,
    /// Of each group its share of the voxel, and which layer it was met in first.
    weights: Vec<(f64, usize)>,
}

/// Adds to some layers of voxels, whose first surfaces are there, what is behind them.
///
/// # Errors
/// If `progress` says so, and those of the estimator of occlusion.
pub(super) fn add<const D: usize>(
    pass: &SurfacePass<D>,
    backend: &dyn RayBackend<D>,
    buffer: &mut GBuffer<D>,
    progress: &dyn Progress,
) -> Result<(), Error> {
    let (layers, [width, height, _]) = (buffer.layers(), buffer.dimensions());
    let behind = Behind { pass, passages: pass.sampling.passages(pass.visibility, &layers, progress)? };
    let row = |(row, out): (usize, &mut RowMut<D>)| {
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        let (mut scratch, mut pending) = (Scratch::default(), Vec::new());
        for i in 0..width {
            let place = [i, row % height, row / height];
            let index = [i, row % height, layers.start + row / height];
            behind.voxel([index, place], &mut scratch, out, &mut pending);
        }
        Ok(pending)
    };
    let pending = buffer.rows_mut().par_iter_mut().enumerate().map(row).collect::<Result<Vec<_>, _>>()?.concat();
    match pass.shading {
        Shading::Voxel(estimator) if !pending.is_empty() => shade(backend, *estimator, &pending, buffer, progress),
        _ => Ok(()),
    }
}

/// What is needed to see what is behind.
struct Behind<'r, const D: usize> {
    pass: &'r SurfacePass<'r, D>,
    passages: Passages,
}

impl<const D: usize> Behind<'_, D> {
    /// Adds to a voxel of the image, which has this `place` among those of the passages.
    fn voxel(
        &self,
        [index, place]: [[usize; 3]; 2],
        scratch: &mut Scratch,
        out: &mut RowMut<D>,
        pending: &mut Vec<Pending<D>>,
    ) {
        let Scratch { groups, weights } = scratch;
        groups.clear();
        weights.clear();
        let (mut seen, mut kept) = (0.0, 0.0);
        for (n, sample) in self.pass.sampling.of_voxel(place) {
            let mut left = 1.0;
            for (layer, passage) in self.passages.of(sample).iter().enumerate() {
                let opacity = self.pass.opacity_of(passage.simplex);
                if layer > 0 && opacity > 0.0 {
                    let group = self.pass.sampling.add_to(groups, passage.simplex, n);
                    weights.resize(groups.len(), (0.0, layer));
                    weights[group].0 += left * opacity;
                }
                left *= 1.0 - opacity;
                if left == 0.0 {
                    break;
                }
            }
            if self.passages.count(sample) > 0 {
                seen += 1.0;
                kept += 1.0 - left;
            }
        }
        if seen == 0.0 {
            return;
        }
        let i = index[0];
        out.through[i] = (1.0 - kept / seen) as f32;
        let mut behind = [0.0; 3];
        for (group, &(weight, layer)) in groups.iter().zip(weights.iter()) {
            let (hit, light) = self.light(index, group, weight / kept, &mut behind);
            if let Shading::Voxel(_) = self.pass.shading {
                let [width, height, _] = self.pass.sampling.grid.dimensions;
                let voxel = i + width * (place[1] + height * place[2]);
                pending.push(Pending { voxel, light, point: self.point(&hit, index, layer) });
            } else {
                let vertices = self.pass.tracer.mesh().simplices[group.simplex as usize];
                let occlusion = f64::from(self.pass.shading.at_vertices(vertices, &hit.crossing.barycentric).0);
                (0..3).for_each(|c| behind[c] += light[c] * occlusion);
            }
        }
        // Of what was seen the share that counts in what is shown.
        let factor = if kept > 0.0 { (seen / kept) as f32 } else { 0.0 };
        if let Some(albedo) = out.albedo.get_mut(i) {
            *albedo = if kept > 0.0 { albedo.map(|c| c * factor) } else { [1.0; 3] };
        }
        if let Some(direct) = out.direct.get_mut(i) {
            *direct = direct.map(|c| (c * factor).min(f32::MAX));
        }
        out.behind[i] = behind.map(|c| c.min(f64::from(f32::MAX)) as f32);
    }

    /// A surface behind, as the mean of a group's samples sees it, and its ambient light where it is open; adds what else it
    /// sends.
    fn light(&self, index: [usize; 3], group: &Group, weight: f64, direct: &mut [f64; 3]) -> (Hit<D>, [f64; 3]) {
        let mesh = self.pass.tracer.mesh();
        let ray = self.pass.sampling.mean_ray(self.pass.camera, index, group);
        let crossing = Cone::of_simplex(&ray.origin, &mesh.corners(group.simplex)).crossing(&ray.direction);
        let hit = Hit { simplex: group.simplex, ray, crossing };
        let color = mesh.objects[mesh.object_of(group.simplex)].color;
        let Some(lighting) = self.pass.lighting else { return (hit, color.map(|c| weight * f64::from(c))) };
        let reflectance = reflectance(color);
        let light = lighting.direct(self.pass.tracer, &self.pass.lit(&hit, reflectance));
        let (left, cue) = lighting.cue(hit.depth());
        (0..3).for_each(|c| direct[c] += weight * (light[c] * left + cue[c]));
        (hit, reflectance.map(|c| weight * c * lighting.ambient * left))
    }

    /// A shading point in this layer of a voxel.
    fn point(&self, hit: &Hit<D>, index: [usize; 3], layer: usize) -> ShadingPoint<D> {
        let mesh = self.pass.tracer.mesh();
        let corners = mesh.corners(hit.simplex).map(|v| widen(&v));
        let weights = hit.crossing.barycentric;
        let position = (0..D).fold(Vector64::zeros(), |p, c| p + corners[c] * weights[c]);
        let grid = &self.pass.sampling.grid;
        let voxel = index[0] + grid.dimensions[0] * (index[1] + grid.dimensions[1] * index[2]);
        ShadingPoint::Inside {
            position: inside(mesh, hit.simplex, &narrow(&position)),
            normal: facing(normal_of(&corners), &hit.ray),
            simplex: hit.simplex,
            number: (layer * grid.len() + voxel) as u64,
        }
    }
}

/// Finds the occlusion of surfaces behind, and adds their light.
///
/// # Errors
/// Those of the estimator.
fn shade<const D: usize>(
    backend: &dyn RayBackend<D>,
    estimator: Estimator,
    pending: &[Pending<D>],
    buffer: &mut GBuffer<D>,
    progress: &dyn Progress,
) -> Result<(), Error> {
    let points: Vec<ShadingPoint<D>> = pending.iter().map(|pending| pending.point).collect();
    let found = estimator.estimate(backend, &points, None, &Uncounted(progress))?;
    for (pending, value) in pending.iter().zip(found.values) {
        let behind = &mut buffer.behind[pending.voxel];
        let value = f64::from(value.clamp(0.0, 1.0));
        (0..3).for_each(|c| behind[c] += (pending.light[c] * value) as f32);
    }
    Ok(())
}
