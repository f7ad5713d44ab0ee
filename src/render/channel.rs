//! The arrays that a picture can have.

use std::ops::Range;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Fragment, NOTHING, Picture, shading};
use crate::geometry::widen;
use crate::volume::{Array, Values};

/// What an array of a picture holds.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Channel {
    /// Colour times ambient occlusion and opacity, 4 x uint8: what volume rendering shows directly.
    Rgba,
    /// Ambient occlusion, 1 = open; 1 where nothing is.
    AmbientOcclusion,
    /// 1 where something is seen, 0 elsewhere.
    Opacity,
    /// Colour times ambient occlusion, 3 x float32; white where nothing is.
    Rgb,
    /// Distance from the eye; infinite where nothing is.
    Depth,
    /// The number of the object from 1, or 0 where nothing is.
    Object,
    /// The unit normal of the simplex, on the side that is seen, D x float32; 0 where nothing is.
    Normal,
}

impl Channel {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::Rgba, Self::AmbientOcclusion, Self::Opacity, Self::Rgb, Self::Depth, Self::Object, Self::Normal];

    /// The array's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rgba => "rgba",
            Self::AmbientOcclusion => "ambient_occlusion",
            Self::Opacity => "opacity",
            Self::Rgb => "rgb",
            Self::Depth => "depth",
            Self::Object => "object",
            Self::Normal => "normal",
        }
    }

    /// Numbers a voxel, for a scene of dimension D.
    pub fn components<const D: usize>(self) -> usize {
        match self {
            Self::Rgba => 4,
            Self::Rgb => 3,
            Self::Normal => D,
            _ => 1,
        }
    }

    /// Bytes a voxel.
    pub fn bytes<const D: usize>(self) -> usize {
        match self {
            Self::Rgba => 4,
            Self::Object => 2,
            _ => 4 * self.components::<D>(),
        }
    }

    /// The array of some layers.
    pub(super) fn array<const D: usize>(
        self,
        picture: &Picture<D>,
        layers: Range<usize>,
        fragments: &[Fragment],
    ) -> Array {
        let mesh = picture.tracer.mesh();
        let color = |f: &Fragment| {
            let color = mesh.objects[mesh.object_of(f.simplex)].color;
            color.map(|c| (c * f.ambient_occlusion).clamp(0.0, 1.0))
        };
        let values = match self {
            Self::Rgba => Values::U8(per_voxel(fragments, [255, 255, 255, 0], |_, f| {
                // To the nearest, exactly, as adding a half loses nothing in f64.
                let [r, g, b] = color(f).map(|c| (f64::from(c * 255.0) + 0.5) as u8);
                [r, g, b, 255]
            })),
            Self::Rgb => Values::F32(per_voxel(fragments, [1.0; 3], |_, f| color(f))),
            Self::AmbientOcclusion => Values::F32(per_voxel(fragments, [1.0], |_, f| [f.ambient_occlusion])),
            Self::Opacity => Values::F32(per_voxel(fragments, [0.0], |_, _| [1.0])),
            Self::Depth => Values::F32(per_voxel(fragments, [f32::INFINITY], |_, f| [f.depth])),
            Self::Object => Values::U16(per_voxel(fragments, [0], |_, f| [mesh.object_of(f.simplex) as u16 + 1])),
            Self::Normal => Values::F32(per_voxel(fragments, [0.0; D], |place, f| {
                let [width, height, _] = picture.grid.dimensions;
                let row = place / width;
                let index = [place % width, row % height, layers.start + row / height];
                let ray = picture.camera.voxel_ray(&picture.grid, index);
                shading::facing_normal(&mesh.corners(f.simplex).map(|v| widen(&v)), &ray).into()
            })),
        };
        Array { name: self.name().to_owned(), components: self.components::<D>(), values }
    }
}

/// N numbers a voxel, on all cores.
fn per_voxel<T: Copy + Send + Sync, const N: usize>(
    fragments: &[Fragment],
    background: [T; N],
    value: impl Fn(usize, &Fragment) -> [T; N] + Sync,
) -> Vec<T> {
    let tuples: Vec<[T; N]> = (fragments.par_iter().enumerate())
        .with_min_len(4096)
        .map(|(place, f)| if f.simplex == NOTHING { background } else { value(place, f) })
        .collect();
    tuples.into_flattened()
}
