//! The arrays that a picture can have (arbitrary output variables, as renderers call them), in one table.
//!
//! A row of the table says all there is to know of an array: its name, its type, its components, its unit, which columns
//! of the G-buffer it is made of, and how. Keys in YAML, the JSON Schema, what a run computes and what files hold follow
//! from it. Of the rows below `layers:` there is one array a layer.

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::gbuffer::{Columns, GBuffer};
use super::layers::Layers;
use super::tone::to_screen;
use crate::volume::{Array, Kind, Values};

/// Components of an array that has as many as the scene has dimensions.
const DIMENSION: usize = usize::MAX;

macro_rules! aovs {
    ($($(#[$doc:meta])+ $variant:ident $name:literal: $kind:ident x $components:expr, $unit:literal,
       [$($column:ident)+] |$g:ident, $i:ident| $value:expr;)+
     layers:
     $($(#[$layer_doc:meta])+ $layer:ident $layer_name:literal: $layer_kind:ident x $layer_components:expr,
       $layer_unit:literal, |$point:ident| $layer_value:expr, $nothing:expr;)+) => {
        /// An array of a picture.
        #[derive(Clone, Copy, Debug, Deserialize, JsonSchema, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
        #[serde(rename_all = "snake_case")]
        pub enum Aov {
            $($(#[$doc])+ $variant,)+
            $($(#[$layer_doc])+ $layer,)+
        }

        impl Aov {
            /// All of them.
            pub const ALL: &[Self] = &[$(Self::$variant,)+ $(Self::$layer),+];

            /// Its name, in files and in YAML.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name,)+ $(Self::$layer => $layer_name),+ }
            }

            /// The type of its numbers.
            pub fn kind(self) -> Kind {
                match self { $(Self::$variant => Kind::$kind,)+ $(Self::$layer => Kind::$layer_kind),+ }
            }

            /// The unit of its numbers; empty if they have none.
            pub fn unit(self) -> &'static str {
                match self { $(Self::$variant => $unit,)+ $(Self::$layer => $layer_unit),+ }
            }

            /// Numbers a voxel, for a scene of dimension D.
            pub fn components<const D: usize>(self) -> usize {
                match match self { $(Self::$variant => $components,)+ $(Self::$layer => $layer_components),+ } {
                    DIMENSION => D,
                    components => components,
                }
            }

            /// The columns it is made of.
            pub fn columns(self) -> Columns {
                match self {
                    $(Self::$variant => Columns::empty() $(.union(Columns::$column))+,)+
                    $(Self::$layer => Columns::empty(),)+
                }
            }

            /// Whether there is one array a layer.
            pub fn is_layered(self) -> bool {
                matches!(self, $(Self::$layer)|+)
            }

            /// The array itself, for all voxels of a G-buffer that has the columns; or one for each of their layers.
            pub fn arrays<const D: usize>(self, buffer: &GBuffer<D>, layers: &Layers<D>) -> Vec<Array> {
                let values: Vec<Values> = match self {
                    $(Self::$variant => vec![Values::$kind(per_voxel(buffer, |$g, $i| $value))],)+
                    $(Self::$layer => {
                        let value = |layer: usize, i: usize| layers.get(layer, i).map_or($nothing, |$point| $layer_value);
                        let layer = |layer: usize| Values::$layer_kind(per_voxel(buffer, |_, i| value(layer, i)));
                        (0..layers.most()).map(layer).collect()
                    })+
                };
                let array = |(name, values)| Array { name, components: self.components::<D>(), values };
                self.names(layers.most()).into_iter().zip(values).map(array).collect()
            }
        }
    };
}

aovs! {
    /// Colour times ambient occlusion, or of a lit picture its light as a screen shows it, and opacity, 4 x uint8: what
    /// volume rendering shows directly.
    Rgba "rgba": U8 x 4, "", [ALBEDO OCCLUSION COVERAGE] |g, i| {
        let [red, green, blue] = color(g, i);
        [byte(red), byte(green), byte(blue), byte(g.opacity(i))]
    };
    /// Ambient occlusion, 1 = open; 1 where nothing is.
    AmbientOcclusion "ambient_occlusion": F32 x 1, "", [OCCLUSION] |g, i| [g.occlusion[i]];
    /// 1 where something is seen, 0 elsewhere; a fraction where voxels are supersampled, or light passes what is seen.
    Opacity "opacity": F32 x 1, "", [COVERAGE] |g, i| [g.opacity(i)];
    /// The same colours over white, 3 x float32; white where nothing is.
    Rgb "rgb": F32 x 3, "", [ALBEDO OCCLUSION COVERAGE] |g, i| {
        let opacity = g.opacity(i);
        color(g, i).map(|c| c * opacity + (1.0 - opacity))
    };
    /// Distance from the eye; infinite where nothing is.
    Depth "depth": F32 x 1, "scene units", [DEPTH] |g, i| [g.depth[i]];
    /// The number of the object from 1, or 0 where nothing is.
    Object "object": U16 x 1, "", [OBJECT] |g, i| [g.object[i]];
    /// The unit normal of the simplex, on the side that is seen, D x float32; 0 where nothing is.
    Normal "normal": F32 x DIMENSION, "", [NORMAL] |g, i| <[f32; D]>::from(g.normal[i]);
    /// The unit normal interpolated over the simplex, on the side that is seen, D x float32; 0 where nothing is.
    ShadingNormal "shading_normal": F32 x DIMENSION, "", [SHADING_NORMAL] |g, i| <[f32; D]>::from(g.shading_normal[i]);
    /// The visible point in the scene's own coordinates, D x float32; 0 where nothing is.
    Position "position": F32 x DIMENSION, "scene units", [POSITION] |g, i| <[f32; D]>::from(g.position[i]);
    /// Barycentric coordinates of the visible point within its simplex, D x float32; 0 where nothing is.
    Barycentric "barycentric": F32 x DIMENSION, "", [BARYCENTRIC] |g, i| g.barycentric[i];
    /// The number of the simplex from 0, or 4294967295 where nothing is.
    Simplex "simplex": U32 x 1, "", [SIMPLEX] |g, i| [g.simplex[i]];
    /// The standard error of the ambient occlusion; 0 where nothing is.
    OcclusionError "occlusion_error": F32 x 1, "", [ERROR] |g, i| [g.error[i]];
    /// The vector b: the integral of the open directions weighted as ambient occlusion weights them, D x float32; it points along
    /// the bent normal, and where all is open is 2/3 long in 3D, 3 pi/16 in 4D. A sky of light 1 + g . w gives ambient
    /// occlusion + g . b; 0 where nothing is.
    BentNormal "bent_normal": F32 x DIMENSION, "", [DIRECTION OCCLUSION] |g, i| {
        <[f32; D]>::from(g.direction[i] * g.occlusion[i])
    };
    /// The light that arrives from the sky and from other surfaces, 3 x float32, where an open surface under a sky of 1 has 1; 1
    /// where nothing is.
    Irradiance "irradiance": F32 x 3, "", [IRRADIANCE OCCLUSION] |g, i| g.irradiance[i];
    /// The light of other surfaces in it, 3 x float32; 0 where nothing is. With `bounce: 1`.
    Bounce "bounce": F32 x 3, "", [HIDDEN OCCLUSION] |g, i| g.hidden[i].map(|c| c * (1.0 - g.occlusion[i]));
    /// The standard error of the bounce; 0 where nothing is. With `bounce: 1`.
    BounceError "bounce_error": F32 x 1, "", [BOUNCE_ERROR] |g, i| [g.bounce_error[i]];
    /// The part of the voxel that sees something, 0 to 1.
    Coverage "coverage": F32 x 1, "", [COVERAGE] |g, i| [g.coverage[i]];
    /// The light that reaches the eye, linear RGB without bound, 3 x float32; white where nothing is. Of lit pictures.
    Light "light": F32 x 3, "", [ALBEDO OCCLUSION] |g, i| light(g, i);
    /// How many surfaces the ray through the voxel's centre passes, front and back ones, also beyond the layers that are
    /// kept; 65535 at most.
    Layers "layers": U16 x 1, "", [PASSAGES] |g, i| [g.passages[i]];
    layers:
    /// Distance from the eye of each layer, `depth_1` and so on; infinite where the ray passes fewer surfaces.
    LayerDepth "layer_depth": F32 x 1, "scene units", |point| [point.depth], [f32::INFINITY];
    /// The number of each layer's object from 1, `object_1` and so on; 0 where the ray passes fewer surfaces.
    LayerObject "layer_object": U16 x 1, "", |point| [point.object], [0];
    /// Whether the ray enters a body at each layer, 1, or leaves it, -1: `side_1` and so on; 0 where it passes fewer surfaces.
    LayerSide "layer_side": I8 x 1, "", |point| [if point.enters { 1 } else { -1 }], [0];
    /// Ambient occlusion of each layer, `ambient_occlusion_1` and so on; 1 where the ray passes fewer surfaces.
    LayerAmbientOcclusion "layer_ambient_occlusion": F32 x 1, "", |point| [point.occlusion], [1.0];
    /// The unit normal of each layer's simplex on the side that the ray comes from, D x float32: `normal_1` and so on; 0
    /// where it passes fewer surfaces.
    LayerNormal "layer_normal": F32 x DIMENSION, "", |point| <[f32; D]>::from(point.normal), [0.0; D];
}

impl Aov {
    /// The names of its arrays in a picture with so many layers.
    pub fn names(self, layers: usize) -> Vec<String> {
        match self.name().strip_prefix("layer_") {
            Some(quantity) => (1..=layers).map(|layer| format!("{quantity}_{layer}")).collect(),
            None => vec![self.name().to_owned()],
        }
    }

    /// How many arrays it is in a picture with so many layers.
    pub fn count(self, layers: usize) -> usize {
        if self.is_layered() { layers } else { 1 }
    }

    /// Whether a picture needs layers for it.
    pub fn needs_layers(self) -> bool {
        self.is_layered() || self == Self::Layers
    }

    /// Whether it shows how a picture is lit.
    pub fn is_lit(self) -> bool {
        self.columns().contains(Columns::ALBEDO)
    }

    /// Bytes a voxel.
    pub fn bytes<const D: usize>(self) -> usize {
        self.kind().size() * self.components::<D>()
    }
}

/// Colour times occlusion; of a lit picture what the tone curve makes of its light.
fn color<const D: usize>(buffer: &GBuffer<D>, i: usize) -> [f32; 3] {
    let light = light(buffer, i);
    if buffer.columns().contains(Columns::DIRECT) {
        light.map(|c| to_screen(f64::from(c)) as f32)
    } else {
        light.map(|c| c.clamp(0.0, 1.0))
    }
}

/// What reaches the eye: ambient light, as far as it is not occluded or comes from other surfaces, that of lights, and what
/// comes from behind.
fn light<const D: usize>(buffer: &GBuffer<D>, i: usize) -> [f32; 3] {
    let (albedo, occlusion) = (buffer.albedo[i], buffer.occlusion[i]);
    // A picture that isn't lit shows occlusion, whatever arrays it has beside.
    let irradiance = buffer.irradiance.get(i).filter(|_| buffer.columns().contains(Columns::DIRECT));
    let ambient = irradiance.copied().unwrap_or([occlusion; 3]);
    let [direct, behind] = [&buffer.direct, &buffer.behind].map(|column| column.get(i).copied().unwrap_or_default());
    std::array::from_fn(|c| (albedo[c] * ambient[c] + direct[c] + behind[c]).min(f32::MAX))
}

/// A number from 0 to 1 as a byte: to the nearest, exactly, as adding a half loses nothing in f64.
fn byte(x: f32) -> u8 {
    (f64::from(x * 255.0) + 0.5) as u8
}

/// N numbers a voxel, on all cores.
fn per_voxel<T: Copy + Default + Send, const N: usize, const D: usize>(
    buffer: &GBuffer<D>,
    value: impl Fn(&GBuffer<D>, usize) -> [T; N] + Sync,
) -> Vec<T> {
    let mut values = vec![T::default(); buffer.len() * N];
    in_blocks(&mut values, BLOCK * N, &|block, values| {
        let tuples = values.as_chunks_mut::<N>().0;
        tuples.iter_mut().zip(block * BLOCK..).for_each(|(tuple, voxel)| *tuple = value(buffer, voxel));
    });
    values
}

/// Voxels that one core takes at a time.
const BLOCK: usize = 4096;

/// Fills an array block by block, on all cores. It knows nothing of what fills it, so that the compiler makes this, which is long,
/// once a type and not once an array.
fn in_blocks<T: Send>(values: &mut [T], size: usize, fill: &(dyn Fn(usize, &mut [T]) + Sync)) {
    values.par_chunks_mut(size).enumerate().for_each(|(block, values)| fill(block, values));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_voxel_that_sees_nothing_is_transparent_white() {
        let all = Aov::ALL.iter().fold(Columns::empty(), |all, aov| all | aov.columns());
        let buffer = GBuffer::<4>::new([1; 3], 0..1, all);
        let layers = Layers::default();
        assert_eq!(Aov::Rgba.arrays(&buffer, &layers)[0].values, Values::U8(vec![255, 255, 255, 0]));
        assert_eq!(Aov::Rgb.arrays(&buffer, &layers)[0].values, Values::F32(vec![1.0; 3]));
        for aov in Aov::ALL.iter().filter(|aov| !aov.is_layered()) {
            let array = &aov.arrays(&buffer, &layers)[0];
            assert_eq!(
                (array.values.kind(), array.values.len()),
                (aov.kind(), aov.components::<4>()),
                "{}",
                aov.name()
            );
            assert_eq!(aov.names(3), [aov.name()]);
        }
        for aov in Aov::ALL {
            // What YAML calls it is its name.
            assert_eq!(serde_json::to_value(aov).unwrap(), aov.name());
            assert_eq!(aov.names(4).len(), aov.count(4));
        }
        assert_eq!(Aov::LayerAmbientOcclusion.names(2), ["ambient_occlusion_1", "ambient_occlusion_2"]);
        assert_eq!((Aov::Normal.bytes::<4>(), Aov::Normal.bytes::<3>(), Aov::Rgba.bytes::<3>()), (16, 12, 4));
    }
}
