//! A pipeline as it is written: the shape of the YAML, and no more.
//!
//! Every optional key is an `Option` here, even where there is a default, so that the plan can tell what was said from
//! what wasn't. Numbers are whatever was typed; ranges, references between stages and lengths of vectors are checked
//! by [`plan`](super::plan). The doc comments are what `ao4d schema` shows in an editor.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::one_or_many::OneOrMany;
pub use crate::render::Aov as Channel;
pub use crate::render::visibility::Method as Visibility;
pub use crate::scene::ObjectSpec;

/// A pipeline: named stages that turn a scene into images.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "ao4d pipeline")]
pub struct PipelineSpec {
    /// The pipeline's name; its files go into the folder `out/NAME/`.
    pub name: String,
    /// What all random numbers start from (default 0). The same seed gives the same bytes.
    pub seed: Option<u64>,
    /// What to do, in order. A stage works on the nearest earlier stage of the kind it needs, or on the one its `input` names.
    pub stages: Vec<StageSpec>,
}

/// One stage: its kind, and its settings.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StageSpec {
    /// Objects in space.
    Scene(SceneSpec),
    /// Ambient occlusion at the vertices of a scene.
    Occlusion(OcclusionSpec),
    /// An image of a scene.
    Render(RenderSpec),
    /// Files of an image.
    Write(WriteSpec),
    /// A ParaView state that shows images.
    Paraview(ParaviewSpec),
}

/// Objects in space.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneSpec {
    /// A name for later stages to refer to.
    pub id: Option<String>,
    /// 4 (default), or 3 for triangles in ordinary space.
    #[schemars(range(min = 3, max = 4))]
    pub dimension: Option<u64>,
    /// The objects. Those that come first win where two are hit at the same distance.
    pub objects: Vec<ObjectSpec>,
}

/// Ambient occlusion at the vertices of a scene: 1 is open, 0 fully occluded.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct OcclusionSpec {
    /// A name for later stages to refer to.
    pub id: Option<String>,
    /// The scene, by its id.
    pub input: Option<String>,
    /// How it is computed (default `sobol`).
    pub method: Option<Method>,
    /// Rays a vertex (default 256); powers of two suit `sobol` best.
    #[schemars(range(min = 1, max = 16777216))]
    pub samples: Option<u64>,
    /// Instead of `samples`: take rays until the estimated error is below this.
    pub target_error: Option<f64>,
    /// With `target_error`: at most so many rays a vertex (default 65536).
    #[schemars(range(min = 1, max = 16777216))]
    pub max_samples: Option<u64>,
    /// With `exact`: at most so many convex pieces a vertex, of a microsecond each (default 10000000).
    #[schemars(range(min = 1, max = 1000000000))]
    pub max_cones: Option<u64>,
    /// Occluders further away than this don't count (default: all count); not with `exact`.
    pub max_distance: Option<f64>,
    /// Writes the values into this file, `NAME.f32`.
    pub file: Option<String>,
    /// Takes the values from this file, relative to the pipeline's folder, instead of computing them.
    pub load: Option<String>,
    /// Instead of the pipeline's seed.
    pub seed: Option<u64>,
}

/// How ambient occlusion is computed.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Owen-scrambled Sobol points, cosine-weighted.
    #[default]
    Sobol,
    /// Independent random rays, cosine-weighted.
    Random,
    /// In closed form where few simplices are to be seen, by Sobol points elsewhere.
    Adaptive,
    /// In closed form, without sampling noise.
    Exact,
    /// As the thesis published it, slips and all, for its figures.
    AsPublished,
}

/// An image of a scene: a volume of voxels in 4D, a picture in 3D.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct RenderSpec {
    /// A name for later stages to refer to.
    pub id: Option<String>,
    /// The scene, or the occlusion (and with it its scene), by its id.
    pub input: Option<String>,
    /// The occlusion that darkens the image, by its id; `none` renders without (default: the nearest earlier one, if any).
    pub occlusion: Option<String>,
    /// Where it is seen from.
    pub camera: Option<CameraSpec>,
    /// Voxels along x, y and z; in 3D pixels along x and y.
    pub dimensions: Vec<u64>,
    /// How the vertices' values spread over a simplex (default `smooth`).
    pub shading: Option<Shading>,
    /// How it is found out what voxels see; changes the time, never the image (default `auto`, the faster one).
    pub visibility: Option<Visibility>,
}

/// Where a scene is seen from. Vectors have as many numbers as the scene has dimensions.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct CameraSpec {
    /// `perspective` (default) or `parallel`.
    pub projection: Option<Projection>,
    /// Where the eye is (default 1 along the last axis).
    pub eye: Option<Vec<f64>>,
    /// What it looks at (default the origin).
    pub target: Option<Vec<f64>>,
    /// Perspective: the angle of view in degrees, from bottom to top (default 90).
    pub field_of_view: Option<f64>,
    /// Parallel: the extent of the image from bottom to top, in the scene's units (default 2).
    pub height: Option<f64>,
    /// The direction that is up, +y in the image (default +y).
    pub up: Option<Vec<f64>>,
    /// In 4D the direction that is over, +z in the image (default +z).
    pub over: Option<Vec<f64>>,
}

/// How rays leave the eye.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Projection {
    /// From one point.
    #[default]
    Perspective,
    /// All in one direction.
    Parallel,
}

/// How the occlusion at the vertices becomes that of a visible point.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Shading {
    /// Interpolated over the simplex.
    #[default]
    Smooth,
    /// The mean over the simplex.
    Flat,
    /// Computed at the visible point itself: slow, the reference for the others.
    Voxel,
}

/// Files of an image. At least one of `vti`, `raw`, `vtu` and `png`.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct WriteSpec {
    /// A name for later stages to refer to.
    pub id: Option<String>,
    /// The render, by its id.
    pub input: Option<String>,
    /// VTK image data, for ParaView: `NAME.vti`.
    pub vti: Option<String>,
    /// Bare float32 RGB triples, x fastest, no header: `NAME.raw`.
    pub raw: Option<String>,
    /// The scene's mesh as the camera sees it: `NAME.vtu`.
    pub vtu: Option<String>,
    /// A quick look at slices through the image: `NAME.png`.
    pub png: Option<String>,
    /// What the `.vti` holds (default `[rgba, ambient_occlusion, opacity]`).
    pub arrays: Option<Vec<Channel>>,
    /// How the `.vti` stores numbers (default `appended`).
    pub encoding: Option<Encoding>,
    /// How the `.vti` packs them (default `none`).
    pub compression: Option<Compression>,
}

/// How a `.vti` stores numbers.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Encoding {
    /// As they are, after the XML.
    #[default]
    Appended,
    /// As base64 text inside the XML.
    Inline,
}

/// How a `.vti` packs numbers.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Compression {
    /// Not at all.
    #[default]
    None,
    /// Smaller.
    Zlib,
    /// Faster.
    Lz4,
}

/// A ParaView state (a Python file) that shows images side by side.
#[derive(Clone, Debug, Deserialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct ParaviewSpec {
    /// A name for messages.
    pub id: Option<String>,
    /// The images, from left to right, by the id of their render or write (default: the nearest earlier write).
    pub input: Option<OneOrMany>,
    /// The state: `NAME.py`.
    pub state: String,
    /// The picture that the state writes when it is run: `NAME.png`.
    pub screenshot: Option<String>,
    /// Which files the state reads (default `vti`).
    pub reader: Option<Reader>,
    /// How the volumes are cut open (default `none`).
    pub cut: Option<super::cut::Cut>,
    /// Width and height of the picture in pixels (default: 800 across for each image).
    pub size: Option<Vec<u64>>,
}

/// Which files a state reads.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reader {
    /// The `.vti`.
    #[default]
    Vti,
    /// The `.raw`, as the thesis did.
    Raw,
}
