//! The ambient occlusion and the distance of what each voxel sees.

use std::ops::Range;

use rayon::prelude::*;

use super::{NOTHING, Picture};
use crate::geometry::{Cone, Crossing, Ray, Vector, Vector64, narrow, normal_of, widen};
use crate::mesh::normals::unit;
use crate::occlusion::opencl::{self, Point};
use crate::occlusion::{Error, Method};
use crate::progress::Progress;

/// Where the ambient occlusion of a visible point comes from.
#[derive(Clone, Copy, Debug)]
pub enum Shading<'s> {
    /// Nowhere: everything is open.
    None,
    /// The mean of the simplex's vertices' values (Djami 2021, 4.6.3).
    Flat(&'s [f32]),
    /// Interpolated between the simplex's vertices' values, by barycentric coordinates.
    Smooth(&'s [f32]),
    /// Computed at the point itself, on the side that faces the ray: slow, the reference for the other two.
    Voxel(Method),
}

/// What one voxel sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fragment {
    /// The simplex, or [`NOTHING`].
    pub simplex: u32,
    /// Ambient occlusion there; 1 where nothing is.
    pub ambient_occlusion: f32,
    /// Distance from the eye; infinite where nothing is.
    pub depth: f32,
}

impl Fragment {
    /// A voxel that sees nothing.
    pub const BACKGROUND: Self = Self { simplex: NOTHING, ambient_occlusion: 1.0, depth: f32::INFINITY };
}

/// Shades the visible simplices of some layers.
pub(super) fn shade<const D: usize>(
    picture: &Picture<D>,
    layers: Range<usize>,
    visible: &[u32],
    progress: &dyn Progress,
) -> Result<Vec<Fragment>, Error> {
    if let (Shading::Voxel(method), Some(device)) = (&picture.shading, picture.device)
        && method.is_traced()
    {
        return shade_on(picture, *method, device, layers, visible, progress);
    }
    let [width, height, _] = picture.grid.dimensions;
    let mut fragments = vec![Fragment::BACKGROUND; visible.len()];
    let rows = fragments.par_chunks_mut(width).zip(visible.par_chunks(width)).enumerate();
    rows.try_for_each(|(row, (fragments, visible))| {
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        let (j, k) = (row % height, layers.start + row / height);
        let mut cones = LastCone::new();
        for (i, (fragment, &simplex)) in fragments.iter_mut().zip(visible).enumerate() {
            if simplex != NOTHING {
                // Occlusion at the voxel itself makes a single one take long.
                if matches!(picture.shading, Shading::Voxel(_)) && progress.cancelled() {
                    return Err(Error::Cancelled);
                }
                let number = (i + width * (j + height * k)) as u64;
                *fragment = shade_voxel(picture, [i, j, k], number, simplex, &mut cones)?;
            }
        }
        progress.advance(width as u64);
        Ok(())
    })?;
    Ok(fragments)
}

/// [`shade`] with the occlusion of the visible points by a device, all of a slab together.
fn shade_on<const D: usize>(
    picture: &Picture<D>,
    method: Method,
    device: &opencl::Scene<D>,
    layers: Range<usize>,
    visible: &[u32],
    progress: &dyn Progress,
) -> Result<Vec<Fragment>, Error> {
    let [width, height, _] = picture.grid.dimensions;
    let seen: Vec<usize> = (0..visible.len()).filter(|&n| visible[n] != NOTHING).collect();
    progress.advance((visible.len() - seen.len()) as u64);
    let found = seen.par_iter().map(|&n| {
        let (index, simplex) = ([n % width, n / width % height, layers.start + n / width / height], visible[n]);
        let ray = picture.camera.voxel_ray(&picture.grid, index);
        let crossing = Cone::of_simplex(&ray.origin, &picture.tracer.mesh().corners(simplex)).crossing(&ray.direction);
        let (position, normal) = visible_point(picture, simplex, &ray, &crossing);
        let number = (index[0] + width * (index[1] + height * index[2])) as u64;
        let depth = (crossing.t * widen(&ray.direction).norm()) as f32;
        (Point::Inside { position, normal, simplex, number }, depth)
    });
    let (points, depths): (Vec<Point<D>>, Vec<f32>) = found.unzip();
    let values = method.at_points_on(device, &points, progress)?;
    let mut fragments = vec![Fragment::BACKGROUND; visible.len()];
    for ((&n, estimate), depth) in seen.iter().zip(values).zip(depths) {
        let ambient_occlusion = estimate.value.clamp(0.0, 1.0);
        fragments[n] = Fragment { simplex: visible[n], ambient_occlusion, depth };
    }
    Ok(fragments)
}

/// The point of a simplex that a ray meets, and the normal there on the side that the ray comes from.
fn visible_point<const D: usize>(
    picture: &Picture<D>,
    simplex: u32,
    ray: &Ray<D>,
    crossing: &Crossing<D>,
) -> (Vector<D>, Vector<D>) {
    let corners = picture.tracer.mesh().corners(simplex).map(|v| widen(&v));
    let point = (0..D).fold(Vector64::zeros(), |p, i| p + corners[i] * crossing.barycentric[i]);
    (narrow(&point), facing_normal(&corners, ray))
}

/// The cone that was asked for last: in perspective that of the voxel before will mostly do.
struct LastCone<const D: usize>(Option<(u32, Vector<D>, Cone<D>)>);

impl<const D: usize> LastCone<D> {
    fn new() -> Self {
        Self(None)
    }

    fn of(&mut self, picture: &Picture<D>, simplex: u32, origin: &Vector<D>) -> &Cone<D> {
        let kept = self.0.take().filter(|(s, o, _)| *s == simplex && o == origin);
        let cone = || (simplex, *origin, Cone::of_simplex(origin, &picture.tracer.mesh().corners(simplex)));
        &self.0.insert(kept.unwrap_or_else(cone)).2
    }
}

fn shade_voxel<const D: usize>(
    picture: &Picture<D>,
    index: [usize; 3],
    number: u64,
    simplex: u32,
    cones: &mut LastCone<D>,
) -> Result<Fragment, Error> {
    let mesh = picture.tracer.mesh();
    let ray = picture.camera.voxel_ray(&picture.grid, index);
    let crossing = cones.of(picture, simplex, &ray.origin).crossing(&ray.direction);
    let corner = |values: &[f32], i: usize| f64::from(values[mesh.simplices[simplex as usize][i] as usize]);
    let value = match &picture.shading {
        Shading::None => 1.0,
        Shading::Flat(values) => ((0..D).map(|i| corner(values, i)).sum::<f64>() / D as f64) as f32,
        Shading::Smooth(values) => (0..D).map(|i| corner(values, i) * crossing.barycentric[i]).sum::<f64>() as f32,
        Shading::Voxel(method) => {
            let (point, normal) = visible_point(picture, simplex, &ray, &crossing);
            let place = || format!("voxel ({}, {}, {})", index[0], index[1], index[2]);
            method.at_point(picture.tracer, &point, &normal, simplex, number, place)?.value
        }
    };
    let depth = crossing.t * widen(&ray.direction).norm();
    Ok(Fragment { simplex, ambient_occlusion: value.clamp(0.0, 1.0), depth: depth as f32 })
}

/// The simplex's unit normal on the side that the ray comes from.
pub(super) fn facing_normal<const D: usize>(corners: &[Vector64<D>; D], ray: &Ray<D>) -> Vector<D> {
    let normal = normal_of(corners);
    let towards = normal.dot(&widen(&ray.direction)) > 0.0;
    unit(&if towards { -normal } else { normal })
}
