//! The layers of a picture: what the ray through each voxel's centre passes, front to back, as arrays of their own.
//!
//! Layer k of a voxel is the k-th surface that its ray passes, whatever object it belongs to: at which depth, whether the
//! ray enters a body there or leaves it, with which normal and occlusion. The first layer is what the voxel's centre sees.
//! Neither filters nor supersampling touch layers.

use std::ops::Range;

use rayon::prelude::*;

use super::inside::inside;
use super::surface::facing;
use super::visibility::Passages;
use super::{Camera, Shading, Visibility};
use crate::accel::Passage;
use crate::geometry::{Cone, Crossing, Ray, Vector, Vector64, narrow, normal_of, widen};
use crate::mesh::Mesh;
use crate::occlusion::Error;
use crate::progress::{Progress, Uncounted};
use crate::trace::{RayBackend, ShadingPoint};
use crate::volume::Grid;

/// The most layers.
pub const MOST: usize = 1000;

/// A place where a voxel's ray passes a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerPoint<const D: usize> {
    /// The simplex.
    pub simplex: u32,
    /// Whether it faces the eye, so that the ray enters what it bounds; else the ray leaves it.
    pub enters: bool,
    /// Distance from the eye.
    pub depth: f32,
    /// The object's number from 1.
    pub object: u16,
    /// The simplex's unit normal on the side that the ray comes from.
    pub normal: Vector<D>,
    /// Ambient occlusion, 1 is open.
    pub occlusion: f32,
}

/// What the rays of some layers of voxels pass.
#[derive(Clone, Debug, Default)]
pub struct Layers<const D: usize> {
    /// How many layers arrays are made of.
    most: usize,
    passages: Passages,
    points: Vec<LayerPoint<D>>,
}

impl<const D: usize> Layers<D> {
    /// How many layers there are.
    pub fn most(&self) -> usize {
        self.most
    }

    /// What a voxel shows in a layer, the first being 0.
    pub fn get(&self, layer: usize, voxel: usize) -> Option<&LayerPoint<D>> {
        self.points[self.passages.range(voxel)].get(layer)
    }

    /// How many surfaces a voxel's ray passes, 65,535 at most.
    pub fn count(&self, voxel: usize) -> u16 {
        self.passages.count(voxel).min(u32::from(u16::MAX)) as u16
    }
}

/// What finds the layers of voxels.
pub(super) struct LayerPass<'r, const D: usize> {
    pub backend: &'r dyn RayBackend<D>,
    pub camera: &'r Camera<D>,
    pub grid: &'r Grid,
    /// Of the voxels' centres.
    pub visibility: &'r Visibility<D>,
    pub shading: &'r Shading,
    /// How many of a voxel are kept.
    pub most: usize,
    /// Whether occlusion is asked for.
    pub occluded: bool,
}

impl<const D: usize> LayerPass<'_, D> {
    /// The layers of some layers of voxels.
    ///
    /// # Errors
    /// If `progress` says so, and those of the estimator of occlusion.
    pub fn layers(&self, voxels: Range<usize>, progress: &dyn Progress) -> Result<Layers<D>, Error> {
        let first = voxels.start * self.grid.layer_len();
        let passages = self.visibility.passages(voxels, self.most, &Uncounted(progress))?;
        let points: Vec<Vec<LayerPoint<D>>> = (0..passages.voxels())
            .into_par_iter()
            .with_min_len(1024)
            .fold(Vec::new, |mut points, voxel| {
                self.add(first + voxel, passages.of(voxel), &mut points);
                points
            })
            .collect();
        let mut points = points.concat();
        if let (Shading::Voxel(estimator), true) = (self.shading, self.occluded) {
            let point = |voxel: usize, layer: usize, passage: &Passage| {
                let simplex = passage.simplex;
                let (ray, crossing) = self.crossing(first + voxel, simplex);
                let corners = self.mesh().corners(simplex).map(|v| widen(&v));
                let weights = crossing.barycentric;
                let position = (0..D).fold(Vector64::zeros(), |p, c| p + corners[c] * weights[c]);
                ShadingPoint::Inside {
                    position: inside(self.mesh(), simplex, &narrow(&position)),
                    normal: facing(normal_of(&corners), &ray),
                    simplex,
                    // Those of the first layer have the rays that the picture's own points have.
                    number: (layer * self.grid.len() + first + voxel) as u64,
                }
            };
            let asked: Vec<ShadingPoint<D>> = (0..passages.voxels())
                .into_par_iter()
                .flat_map_iter(|voxel| {
                    let passages = passages.of(voxel).iter().enumerate();
                    passages.map(move |(layer, passage)| point(voxel, layer, passage))
                })
                .collect();
            let found = estimator.estimate(self.backend, &asked, None, &Uncounted(progress))?;
            points.iter_mut().zip(found.values).for_each(|(point, value)| point.occlusion = value.clamp(0.0, 1.0));
        }
        Ok(Layers { most: self.most, passages, points })
    }

    fn mesh(&self) -> &Mesh<D> {
        self.backend.tracer().mesh()
    }

    /// Where the ray of a voxel of the image meets a simplex.
    fn crossing(&self, voxel: usize, simplex: u32) -> (Ray<D>, Crossing<D>) {
        let ray = self.camera.voxel_ray(self.grid, self.grid.index(voxel));
        let crossing = Cone::of_simplex(&ray.origin, &self.mesh().corners(simplex)).crossing(&ray.direction);
        (ray, crossing)
    }

    /// Adds what a voxel of the image shows.
    fn add(&self, voxel: usize, passages: &[Passage], points: &mut Vec<LayerPoint<D>>) {
        let mesh = self.mesh();
        for &Passage { simplex, enters } in passages {
            let (ray, crossing) = self.crossing(voxel, simplex);
            let corners = mesh.corners(simplex).map(|v| widen(&v));
            let vertices = mesh.simplices[simplex as usize];
            points.push(LayerPoint {
                simplex,
                enters,
                depth: (crossing.t * widen(&ray.direction).norm()) as f32,
                object: mesh.object_of(simplex) as u16 + 1,
                normal: facing(normal_of(&corners), &ray),
                occlusion: self.shading.at_vertices(vertices, &crossing.barycentric).0,
            });
        }
    }
}
