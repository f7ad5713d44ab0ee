//! A pipeline as understood: checked, resolved, every default filled in.
//!
//! A plan is plain numbers and names. Stages refer to each other by index into the plan's lists, so nothing that runs
//! it needs to look anything up, and whatever is wrong with a pipeline by itself has been refused on the way here
//! (what depends on files' contents, such as a mesh's vertex indices, is checked where they are read).
//!
//! Which stage works on which:
//! - an `occlusion` works on a scene;
//! - a `render` works on a scene, and is darkened by an occlusion of that scene. Named by `input` or `occlusion`, or
//!   the nearest earlier of each. If these two don't belong together, the plan asks instead of guessing;
//! - a `write` works on a render;
//! - a `paraview` figure works on writes, and finds them also by the name of their render.

mod camera;
mod describe;
mod occlusion;
mod outputs;
mod range;
mod render;
mod resolve;
mod write;

use std::path::PathBuf;

use serde::Serialize;

pub use camera::{CameraPlan, ProjectionPlan};
pub use describe::{Description, SceneCounts, grouped, size};

use super::Cut;
use super::error::Invalid;
use super::spec::{Channel, Compression, Encoding, Method, ObjectSpec, PipelineSpec, Reader, Shading, Visibility};
use crate::geometry::Dimension;
/// The most samples a vertex.
pub const MAX_SAMPLES: u64 = 1 << 24;
/// The most pieces that a vertex's view may be cut into.
pub const MAX_CONES: u64 = 1_000_000_000;
/// The most voxels along an axis.
pub const MAX_DIMENSION: u64 = 65_535;
/// The most objects in a scene: the `object` array numbers them with 16 bits, and 0 is the background.
pub const MAX_OBJECTS: usize = 65_535;
/// Coordinates and lengths beyond this are refused: their squares must stay far inside `f32`.
pub const MAX_LENGTH: f64 = 1e12;
/// No length that must be above zero may be below this.
pub const MIN_LENGTH: f64 = 1e-12;

/// Everything a run needs to know.
#[derive(Clone, Debug, Serialize)]
pub struct Plan {
    /// The pipeline's name, fit to be a folder's.
    pub name: String,
    /// What random numbers start from, unless a stage has its own.
    pub seed: u64,
    /// Where relative paths of inputs start.
    #[serde(skip)]
    pub folder: PathBuf,
    /// Where the outputs go.
    #[serde(serialize_with = "describe::path")]
    pub out: PathBuf,
    /// The stages in the order they were written.
    pub order: Vec<StageRef>,
    /// The scenes.
    pub scenes: Vec<ScenePlan>,
    /// The occlusions.
    pub occlusions: Vec<OcclusionPlan>,
    /// The images.
    pub renders: Vec<RenderPlan>,
    /// The files of images.
    pub writes: Vec<WritePlan>,
    /// The ParaView figures.
    pub figures: Vec<FigurePlan>,
    /// What is allowed but probably not meant.
    #[serde(skip)]
    pub warnings: Vec<Invalid>,
}

impl Plan {
    /// Checks and resolves a pipeline. `folder` is where its inputs are, `out` where its outputs go (default
    /// `out/NAME`).
    pub fn new(spec: &PipelineSpec, folder: PathBuf, out: Option<PathBuf>) -> Result<Plan, Invalid> {
        resolve::resolve(spec, folder, out)
    }

    /// A stage's id.
    pub fn id(&self, stage: StageRef) -> &str {
        match stage {
            StageRef::Scene(i) => &self.scenes[i].id,
            StageRef::Occlusion(i) => &self.occlusions[i].id,
            StageRef::Render(i) => &self.renders[i].id,
            StageRef::Write(i) => &self.writes[i].id,
            StageRef::Figure(i) => &self.figures[i].id,
        }
    }

    /// Every file the run leaves in `out`, in the order of the stages.
    pub fn files(&self) -> Vec<&PathBuf> {
        let of_stage = |stage: &StageRef| -> Vec<&PathBuf> {
            match *stage {
                StageRef::Scene(_) | StageRef::Render(_) => Vec::new(),
                StageRef::Occlusion(i) => self.occlusions[i].file.iter().collect(),
                StageRef::Write(i) => self.writes[i].files().collect(),
                StageRef::Figure(i) => {
                    let figure = &self.figures[i];
                    std::iter::once(&figure.state).chain(&figure.screenshot).collect()
                }
            }
        };
        self.order.iter().flat_map(of_stage).collect()
    }
}

/// A stage, by its place in the plan's list of its kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum StageRef {
    /// `scenes[i]`
    Scene(usize),
    /// `occlusions[i]`
    Occlusion(usize),
    /// `renders[i]`
    Render(usize),
    /// `writes[i]`
    Write(usize),
    /// `figures[i]`
    #[serde(rename = "paraview")]
    Figure(usize),
}

impl StageRef {
    /// The kind, as the pipeline's text names it.
    pub fn kind(self) -> &'static str {
        match self {
            StageRef::Scene(_) => "scene",
            StageRef::Occlusion(_) => "occlusion",
            StageRef::Render(_) => "render",
            StageRef::Write(_) => "write",
            StageRef::Figure(_) => "paraview",
        }
    }

    /// Its index, if it is a scene.
    fn scene(self) -> Option<usize> {
        if let StageRef::Scene(i) = self { Some(i) } else { None }
    }

    /// Its index, if it is an occlusion.
    fn occlusion(self) -> Option<usize> {
        if let StageRef::Occlusion(i) = self { Some(i) } else { None }
    }

    /// Its index, if it is a render.
    fn render(self) -> Option<usize> {
        if let StageRef::Render(i) = self { Some(i) } else { None }
    }

    /// Its index, if it is a write.
    fn write(self) -> Option<usize> {
        if let StageRef::Write(i) = self { Some(i) } else { None }
    }
}

/// Said where a stage lacks a scene.
const NO_SCENE: &str = "there is no earlier `scene` to work on; put one first";

/// Objects in space.
#[derive(Clone, Debug, Serialize)]
pub struct ScenePlan {
    /// Its own id, or one made up; unique.
    pub id: String,
    /// Where it is written, for complaints: `stages[0].scene`.
    #[serde(skip)]
    pub path: String,
    /// The space it is in.
    pub dimension: Dimension,
    /// What is in it; in JSON, how many.
    #[serde(serialize_with = "describe::count")]
    pub objects: Vec<ObjectSpec>,
    /// The eye of the first render of this scene, for open objects that are to face it.
    pub eye: Option<Vec<f64>>,
}

/// Ambient occlusion at a scene's vertices.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OcclusionPlan {
    /// Its own id, or one made up; unique.
    pub id: String,
    /// Where it is written, for complaints.
    #[serde(skip)]
    pub path: String,
    /// The scene it is of.
    pub scene: usize,
    /// Where the values come from.
    pub source: OcclusionSource,
    /// The file they are written to, below `out`.
    pub file: Option<PathBuf>,
}

/// Where occlusion comes from.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum OcclusionSource {
    /// It is computed.
    Compute(Computation),
    /// It is read from a file, which existed when the plan was made.
    Load(#[serde(serialize_with = "describe::path")] PathBuf),
}

/// How occlusion is computed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Computation {
    /// By which method.
    pub method: Method,
    /// With how many rays.
    pub samples: Samples,
    /// For `exact`: the most convex pieces a vertex. No value depends on it.
    #[serde(skip)]
    pub max_cones: u64,
    /// Occluders further away don't count.
    pub max_distance: Option<f64>,
    /// What its random numbers start from.
    pub seed: u64,
}

/// How many rays a vertex sends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Samples {
    /// None: the method is exact.
    Exact,
    /// So many.
    Fixed(u64),
    /// As many as bring the estimated error below a bound.
    Target {
        /// The bound.
        error: f64,
        /// At most so many.
        max_samples: u64,
    },
}

/// An image of a scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RenderPlan {
    /// Its own id, or one made up; unique.
    pub id: String,
    /// Where it is written, for complaints.
    #[serde(skip)]
    pub path: String,
    /// The scene it shows.
    pub scene: usize,
    /// The occlusion that darkens it; none renders without.
    pub occlusion: Option<usize>,
    /// Where it is seen from.
    pub camera: CameraPlan,
    /// Voxels along x, y and z; one layer in 3D.
    pub dimensions: [usize; 3],
    /// How vertex values spread.
    pub shading: Shading,
    /// How it is found out what voxels see.
    pub visibility: Visibility,
    /// The arrays that its files need, in their own order, each once.
    pub arrays: Vec<Channel>,
}

impl RenderPlan {
    /// The number of voxels.
    pub fn voxels(&self) -> u64 {
        self.dimensions.iter().map(|&d| d as u64).product()
    }
}

/// Files of an image.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WritePlan {
    /// Its own id, or one made up; unique.
    pub id: String,
    /// Where it is written, for complaints.
    #[serde(skip)]
    pub path: String,
    /// The image.
    pub render: usize,
    /// The image data, below `out`, as all files here.
    pub vti: Option<PathBuf>,
    /// The bare triples.
    pub raw: Option<PathBuf>,
    /// The mesh.
    pub vtu: Option<PathBuf>,
    /// The quick look.
    pub png: Option<PathBuf>,
    /// What the image data holds, in this order.
    pub arrays: Vec<Channel>,
    /// How it stores numbers.
    pub encoding: Encoding,
    /// How it packs them.
    pub compression: Compression,
}

impl WritePlan {
    /// The files it leaves.
    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        [&self.vti, &self.raw, &self.vtu, &self.png].into_iter().flatten()
    }
}

/// A ParaView state.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FigurePlan {
    /// Its own id, or one made up; unique.
    pub id: String,
    /// Where it is written, for complaints.
    #[serde(skip)]
    pub path: String,
    /// The images' files, from left to right; each has the file that `reader` reads.
    pub writes: Vec<usize>,
    /// The state's file, below `out`.
    pub state: PathBuf,
    /// The picture's.
    pub screenshot: Option<PathBuf>,
    /// Which files it reads.
    pub reader: Reader,
    /// How the volumes are cut open.
    pub cut: Cut,
    /// Width and height of the picture in pixels, where they were given.
    pub size: Option<[u32; 2]>,
}
