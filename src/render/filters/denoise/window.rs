//! The neighbours of a voxel, and how much each of them counts.
//!
//! A neighbour counts if it shows the same object, by
//!
//! - the cosine of the two normals, to the power of 32;
//! - its distance d from the voxel's tangent plane in footprints of a voxel: (1 - d^2/4)^4, which is about exp(-d^2);
//! - its place in the window.
//!
//! The columns are copied into planes of plain numbers, one component after the other, with empty voxels around each row,
//! so that a row of neighbours is some groups of [`LANES`] numbers, which compilers turn into SIMD code.

use rayon::prelude::*;

use crate::geometry::Vector;
use crate::render::gbuffer::GBuffer;
use crate::render::{Camera, NOTHING};

/// Numbers that are worked on at once.
pub(super) const LANES: usize = 8;

/// So many numbers.
pub(super) type Lanes = [f32; LANES];

/// The window of neighbours around a voxel, and the weights of its places.
#[derive(Clone, Debug)]
pub(super) struct Window {
    /// How far it reaches along each axis of the image.
    pub radius: [usize; 3],
    /// The weight of a neighbour by its offset along an axis, 0 to the radius.
    by_offset: Vec<f32>,
    /// Those of the offsets along a row, from the lowest on, in groups; 0 beyond the window.
    by_lane: Vec<Lanes>,
}

impl Window {
    /// A window that reaches equally far along each of the image's `axes`, with the weights of the offsets 0, 1, 2 and so
    /// on along each.
    pub fn new(axes: usize, by_offset: Vec<f32>) -> Self {
        let wide = by_offset.len() - 1;
        let radius = std::array::from_fn(|a| if a < axes { wide } else { 0 });
        let lane = |n: usize| if n > 2 * wide { 0.0 } else { by_offset[n.abs_diff(wide)] };
        let by_lane =
            (0..(2 * wide + 1).div_ceil(LANES)).map(|g| std::array::from_fn(|l| lane(LANES * g + l))).collect();
        Self { radius, by_offset, by_lane }
    }

    /// Groups of neighbours in a row.
    pub fn groups(&self) -> usize {
        self.by_lane.len()
    }

    /// The offset along the row of a lane of a group.
    pub fn offset(&self, group: usize, lane: usize) -> f64 {
        (LANES * group + lane) as f64 - self.radius[0] as f64
    }

    /// Shows `visit` all neighbours of a voxel, itself among them: the number of the group in its row, the offsets across
    /// rows, the place of the first in the planes, and their weights.
    #[inline(always)]
    pub fn visit<const D: usize>(
        &self,
        planes: &Planes<D>,
        [x, j, k]: [usize; 3],
        mut visit: impl FnMut(usize, [f32; 2], usize, &Lanes),
    ) {
        let here = planes.place([x, j, k]);
        let (object, per_footprint) = (planes.object[here], planes.per_footprint[here]);
        let normal: [f32; D] = std::array::from_fn(|d| planes.normal[d][here]);
        let position: [f32; D] = std::array::from_fn(|d| planes.position[d][here]);
        let [rx, ry, rz] = self.radius;
        for nk in k.saturating_sub(rz)..=(k + rz).min(planes.layers - 1) {
            for nj in j.saturating_sub(ry)..=(j + ry).min(planes.height - 1) {
                if !planes.rows[nk * planes.height + nj] {
                    continue;
                }
                let across = self.by_offset[nk.abs_diff(k)] * self.by_offset[nj.abs_diff(j)];
                let offsets = [nj as f32 - j as f32, nk as f32 - k as f32];
                let row = planes.place([x, nj, nk]) - rx;
                for (group, kernel) in self.by_lane.iter().enumerate() {
                    let at = row + LANES * group;
                    let (mut cosine, mut distance) = ([0.0f32; LANES], [0.0f32; LANES]);
                    for d in 0..D {
                        let (n, p) = (lanes(&planes.normal[d], at), lanes(&planes.position[d], at));
                        for l in 0..LANES {
                            cosine[l] += normal[d] * n[l];
                            distance[l] += normal[d] * (p[l] - position[d]);
                        }
                    }
                    let objects = lanes(&planes.object, at);
                    let mut weights = [0.0; LANES];
                    for l in 0..LANES {
                        let w = across * kernel[l] * weight(cosine[l], distance[l] * per_footprint);
                        weights[l] = if objects[l] == object { w } else { 0.0 };
                    }
                    visit(group, offsets, at, &weights);
                }
            }
        }
    }
}

/// Eight numbers from a place on.
#[inline(always)]
pub(super) fn lanes(of: &[f32], at: usize) -> &Lanes {
    match of[at..].first_chunk() {
        Some(lanes) => lanes,
        None => unreachable!("planes end with empty voxels"),
    }
}

/// The weight of a neighbour by the cosine of the normals and the distance from the tangent plane in footprints.
#[inline(always)]
fn weight(cosine: f32, distance: f32) -> f32 {
    // Below a half nothing is left of the power but numbers so small that they are slow.
    let c = if cosine > 0.5 { cosine } else { 0.0 };
    let (c2, d2) = (c * c, distance * distance);
    let (c4, near) = (c2 * c2, (1.0 - d2 * 0.25).max(0.0));
    let (c8, near2) = (c4 * c4, near * near);
    let c16 = c8 * c8;
    c16 * c16 * near2 * near2
}

/// Columns of a buffer as plain numbers, component by component.
pub(super) struct Planes<const D: usize> {
    height: usize,
    layers: usize,
    /// Empty voxels before and after each row.
    margin: usize,
    stride: usize,
    position: [Vec<f32>; D],
    normal: [Vec<f32>; D],
    /// The object's number from 1; 0 where nothing is seen.
    object: Vec<f32>,
    /// One over the footprint of a voxel, in the scene's units; 0 where nothing is seen.
    per_footprint: Vec<f32>,
    /// Whether a row shows anything.
    rows: Vec<bool>,
}

impl<const D: usize> Planes<D> {
    /// Those of a buffer, to be looked at through windows that reach at most `radius` far along a row.
    pub fn new(input: &GBuffer<D>, camera: &Camera<D>, spacing: f64, radius: usize) -> Self {
        let [width, height, _] = input.dimensions();
        // The last group of the last voxel of a row may begin at the window's end.
        let margin = radius + LANES;
        let mut planes = Self {
            height,
            layers: input.layers().len(),
            margin,
            stride: width + 2 * margin,
            position: std::array::from_fn(|_| Vec::new()),
            normal: std::array::from_fn(|_| Vec::new()),
            object: Vec::new(),
            per_footprint: Vec::new(),
            rows: input.simplex.par_chunks(width).map(|row| row.iter().any(|&s| s != NOTHING)).collect(),
        };
        let component = |of: &Vec<Vector<D>>, d: usize| planes.padded(width, |n| of[n][d]);
        let (position, normal) = (
            std::array::from_fn(|d| component(&input.position, d)),
            std::array::from_fn(|d| component(&input.normal, d)),
        );
        let object = planes.padded(width, |n| f32::from(input.object[n]));
        let per_footprint = planes.padded(width, |n| match (input.simplex[n], camera.is_parallel()) {
            (NOTHING, _) => 0.0,
            (_, true) => (1.0 / spacing) as f32,
            (_, false) => (1.0 / (spacing * camera.project(&input.position[n]).1)) as f32,
        });
        (planes.position, planes.normal, planes.object, planes.per_footprint) =
            (position, normal, object, per_footprint);
        planes
    }

    /// One more plane of numbers, by the voxels' places in the buffer.
    pub fn plane(&self, value: impl Fn(usize) -> f32 + Sync) -> Vec<f32> {
        self.padded(self.stride - 2 * self.margin, value)
    }

    /// Whether row j of layer k shows anything.
    pub fn shows(&self, [j, k]: [usize; 2]) -> bool {
        self.rows[k * self.height + j]
    }

    /// Where a voxel is in the planes.
    #[inline(always)]
    pub fn place(&self, [x, j, k]: [usize; 3]) -> usize {
        (k * self.height + j) * self.stride + self.margin + x
    }

    fn padded(&self, width: usize, value: impl Fn(usize) -> f32 + Sync) -> Vec<f32> {
        // A row is empty before it begins and after it ends; one more margin lies behind the last.
        let mut plane = vec![0.0; self.rows.len() * self.stride + LANES];
        plane[..self.rows.len() * self.stride].par_chunks_mut(self.stride.max(1)).enumerate().for_each(|(row, out)| {
            if self.rows[row] {
                for x in 0..width {
                    out[self.margin + x] = value(row * width + x);
                }
            }
        });
        plane
    }
}
