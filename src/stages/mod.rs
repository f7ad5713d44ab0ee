//! The stages of a pipeline, one file each: `scene`, `occlusion`, `render`, `write`, `paraview`, `mesh`, `slice`,
//! `wireframe`, `animate`, `shade`, `page`.
//!
//! A stage's file holds all there is to know of it: what is written in YAML (its `Spec`), what is understood of that
//! (its `Plan`: checked, resolved, every default filled in), its part of the key that tells whether a file is fresh, its
//! line in `ao4d check`, how it is run, and which files it leaves. [`Stage`] is the list of these; the rows at the end of
//! this page are the index. A new stage is one file and one row.
//!
//! A [`Plan`] is plain numbers and names. Stages refer to each other by [`Ref`], so nothing that runs a plan looks anything
//! up, and whatever is wrong with a pipeline by itself has been refused before. (What depends on the contents of files, such
//! as a mesh's vertex indices, is checked where they are read.)
//!
//! Which stage works on which:
//! - an `occlusion` works on a scene;
//! - a `render` works on a scene, and is darkened by an occlusion of that scene. Named by `input` or `occlusion`, or
//!   the nearest earlier of each. If these two don't belong together, the plan asks instead of guessing;
//! - a `write` works on a render;
//! - a `mesh` or a `slice` works on a scene, and has the values of an occlusion of that scene, found as a render finds them;
//! - a `wireframe` works on the scene of a render, and looks through its camera;
//! - an `animate` works on a render, whose picture it makes again and again while something moves;
//! - a `shade` works on an image in a file;
//! - a `page` works on writes and animations, all earlier ones if it doesn't say which;
//! - a `paraview` figure works on writes, which it finds also by the name of their render, and on animations.

pub mod animate;
pub mod camera;
pub mod cut;
pub mod describe;
mod error;
pub(crate) mod fit;
pub mod key;
pub mod lighting;
pub mod memory;
pub mod mesh;
mod names;
pub mod occlusion;
mod one_or_many;
pub mod page;
pub mod paraview;
mod picture;
pub mod piece;
mod plan;
pub mod prepare;
pub mod projection;
mod range;
mod rays;
pub mod render;
mod resolve;
mod run;
pub mod scene;
pub mod screen_space;
pub mod shade;
mod skylight;
pub mod slice;
mod subject;
pub(crate) mod suggest;
mod twin;
pub mod wireframe;
pub mod write;

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::io;

pub use describe::{Counts, Totals};
pub use error::{Invalid, StageError};
pub use key::{Keys, LeftOut, Output};
pub use one_or_many::OneOrMany;
pub use piece::Piece;
pub use plan::{Plan, Planned, Ref};
pub use resolve::Resolver;
pub use run::{Ledger, Made, Run, SceneRun, Told, Work};

/// Coordinates and lengths beyond this are refused: their squares must stay far inside `f32`.
pub const MAX_LENGTH: f64 = 1e12;
/// No length that must be above zero may be below this.
pub const MIN_LENGTH: f64 = 1e-12;

/// What every kind of stage says of itself.
pub trait Stage: plan::OfKind + Serialize {
    /// What is written in YAML.
    type Spec;
    /// The kind, as the pipeline's text names it.
    const KIND: &'static str;
    /// What `ao4d check --json` calls the list of these.
    const LIST: &'static str;
    /// The fields that its key leaves out, each with the reason why no byte of a result depends on it.
    const LEFT_OUT: &'static [LeftOut];

    /// The id, where one is written.
    fn id(spec: &Self::Spec) -> Option<&str>;

    /// Checks what is written at `path`, fills in defaults, finds what it works on, and claims the names of its files.
    ///
    /// # Errors
    /// Whatever can be refused without reading inputs.
    fn resolve(spec: &Self::Spec, path: &str, resolver: &mut Resolver) -> Result<Self, Invalid>;

    /// What is allowed but probably not meant, once all stages are known.
    fn unused(_me: Ref<Self>, _plan: &Plan) -> Option<&'static str> {
        None
    }

    /// The stages whose results it works on, by their places in the plan.
    fn works_on(&self) -> Vec<usize>;

    /// The scene that it is about; none if it works on files alone, and runs after all scenes.
    fn scene(me: Ref<Self>, plan: &Plan) -> Option<Ref<scene::ScenePlan>>;

    /// The files it reads. Those that needn't exist are among them.
    fn input_files(&self, _plan: &Plan) -> Vec<PathBuf> {
        Vec::new()
    }

    /// Reads files that are no part of a scene, so that what is wrong with them is told before anything is computed.
    ///
    /// # Errors
    /// Whatever is wrong with one.
    fn check_inputs(_me: Ref<Self>, _plan: &Plan) -> Result<(), Invalid> {
        Ok(())
    }

    /// Whether it shows the values of the occlusion at this place at every vertex, seen or not.
    fn wants_values(&self, _occlusion: usize) -> bool {
        false
    }

    /// What else decides its result, beside its own fields, what it works on, and the files it reads.
    fn depends_on(_me: Ref<Self>, _plan: &Plan) -> Value {
        Value::Null
    }

    /// The files that it names, below the output folder.
    fn files(&self) -> Vec<&Path> {
        Vec::new()
    }

    /// Files that it may leave beside those, under names that follow from theirs.
    fn files_beside(&self) -> Vec<PathBuf> {
        Vec::new()
    }

    /// The files that it leaves and the cache knows, each with its key.
    fn outputs(_me: Ref<Self>, _plan: &Plan, _keys: &Keys) -> Vec<Output> {
        Vec::new()
    }

    /// The files that a piece of a run leaves in the place of those, each with its key. What isn't among them is made when
    /// all pieces are joined.
    fn parts(_me: Ref<Self>, _plan: &Plan, _keys: &Keys, _piece: Piece) -> Vec<Output> {
        Vec::new()
    }

    /// Pictures of its own that show values at vertices, of those that a piece of a run makes: in a piece their vertices are
    /// wanted, not all.
    fn pictures(_me: Ref<Self>, _plan: &Plan, _piece: Piece) -> Option<Vec<(PathBuf, render::RenderPlan)>> {
        None
    }

    /// Puts another text in the place of the one that a file of its outputs tells of the pipeline; the rest of the file
    /// stays as it is. Returns the file's length.
    ///
    /// # Errors
    /// If the file is none of this stage's, or can't be written.
    fn retell(_me: Ref<Self>, _plan: &Plan, _output: &Path, _text: &str) -> Result<u64, io::Error> {
        Ok(0)
    }

    /// What is understood of it beyond what is written, in the form of what is written. A pipeline that a file tells has
    /// these in the place of what was left out, so that it is still the same when a default becomes another.
    fn written(_me: Ref<Self>, _plan: &Plan) -> Value {
        Value::Null
    }

    /// The memory that it takes at once and the bytes that it leaves, given which files have to be made.
    fn needs(_me: Ref<Self>, _plan: &Plan, _stale: &dyn Fn(&Path) -> bool) -> Needs {
        Needs::default()
    }

    /// Its line in `ao4d check`, without kind and id.
    fn line(me: Ref<Self>, plan: &Plan, counts: &[Counts]) -> String;

    /// Its part of the sums over all stages.
    fn totals(_me: Ref<Self>, _plan: &Plan, _counts: &[Counts]) -> Totals {
        Totals::default()
    }

    /// Makes its fields what `ao4d check --json` shows of them.
    fn show(_fields: &mut Map<String, Value>) {}

    /// Makes those of its files that have to be made, in the scene that it is about. Returns what is worth telling of
    /// the work, such as its speed.
    ///
    /// # Errors
    /// [`StageError`]
    fn run<const D: usize>(_me: Ref<Self>, _run: &mut Run, _scene: &mut SceneRun<D>) -> Result<Told, StageError> {
        Ok(Told::default())
    }

    /// The same for a stage that is about no scene.
    ///
    /// # Errors
    /// [`StageError`]
    fn run_last(_me: Ref<Self>, _run: &mut Run) -> Result<Told, StageError> {
        Ok(Told::default())
    }
}

/// What a stage takes of the computer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Needs {
    /// Bytes of memory at once, at the least.
    pub memory: u64,
    /// Bytes of large files, where they are known before.
    pub disk: u64,
    /// What the memory holds, for complaints.
    pub holds: &'static str,
}

/// Builds the index from its rows: a name, what is written, what is understood.
macro_rules! stages {
    ($($(#[$doc:meta])+ $name:ident: $spec:ty => $plan:ty;)+) => {
        /// One stage: its kind, and its settings.
        #[derive(Clone, Debug, Deserialize, JsonSchema)]
        #[serde(rename_all = "snake_case")]
        // A pipeline has a handful of them: what boxes would save is nothing.
        #[allow(clippy::large_enum_variant)]
        pub enum StageSpec {
            $($(#[$doc])+ $name($spec),)+
        }

        /// One stage as understood.
        #[derive(Clone, Debug, Serialize)]
        #[serde(untagged)]
        pub enum StagePlan {
            $($(#[$doc])+ $name($plan),)+
        }

        /// The kinds of stage, as the pipeline's text names them.
        pub const KINDS: &[&str] = &[$(<$plan>::KIND),+];

        /// What `ao4d check --json` calls the lists of them.
        const LISTS: &[(&str, &str)] = &[$((<$plan>::KIND, <$plan>::LIST)),+];

        impl StageSpec {
            /// The kind, as the pipeline's text names it.
            pub fn kind(&self) -> &'static str {
                match self { $(Self::$name(_) => <$plan>::KIND),+ }
            }

            /// The id, where one is written.
            pub fn id(&self) -> Option<&str> {
                match self { $(Self::$name(spec) => <$plan>::id(spec)),+ }
            }

            fn resolve(&self, path: &str, resolver: &mut Resolver) -> Result<StagePlan, Invalid> {
                Ok(match self { $(Self::$name(spec) => StagePlan::$name(<$plan>::resolve(spec, path, resolver)?)),+ })
            }
        }

        /// Each of these does what the method of [`Stage`] with its name does, for the stage at this place of a plan.
        #[allow(missing_docs, clippy::missing_errors_doc)]
        impl Plan {
            pub fn kind(&self, index: usize) -> &'static str {
                match self.stages[index].plan { $(StagePlan::$name(_) => <$plan>::KIND),+ }
            }

            pub fn left_out(&self, index: usize) -> &'static [LeftOut] {
                match self.stages[index].plan { $(StagePlan::$name(_) => <$plan>::LEFT_OUT),+ }
            }

            pub fn unused(&self, index: usize) -> Option<&'static str> {
                match self.stages[index].plan { $(StagePlan::$name(_) => <$plan>::unused(self.at(index), self)),+ }
            }

            pub fn works_on(&self, index: usize) -> Vec<usize> {
                match &self.stages[index].plan { $(StagePlan::$name(plan) => plan.works_on()),+ }
            }

            pub fn scene_of(&self, index: usize) -> Option<Ref<scene::ScenePlan>> {
                match self.stages[index].plan { $(StagePlan::$name(_) => <$plan>::scene(self.at(index), self)),+ }
            }

            pub fn input_files(&self, index: usize) -> Vec<PathBuf> {
                match &self.stages[index].plan { $(StagePlan::$name(plan) => plan.input_files(self)),+ }
            }

            pub fn check_inputs(&self, index: usize) -> Result<(), Invalid> {
                match self.stages[index].plan { $(StagePlan::$name(_) => <$plan>::check_inputs(self.at(index), self)),+ }
            }

            pub fn wants_values(&self, index: usize, occlusion: usize) -> bool {
                match &self.stages[index].plan { $(StagePlan::$name(plan) => plan.wants_values(occlusion)),+ }
            }

            fn depends_on(&self, index: usize) -> Value {
                match self.stages[index].plan { $(StagePlan::$name(_) => <$plan>::depends_on(self.at(index), self)),+ }
            }

            pub fn files_of(&self, index: usize) -> Vec<&Path> {
                match &self.stages[index].plan { $(StagePlan::$name(plan) => plan.files()),+ }
            }

            pub fn files_beside(&self, index: usize) -> Vec<PathBuf> {
                match &self.stages[index].plan { $(StagePlan::$name(plan) => plan.files_beside()),+ }
            }

            pub fn outputs(&self, index: usize, keys: &Keys) -> Vec<Output> {
                match self.stages[index].plan { $(StagePlan::$name(_) => <$plan>::outputs(self.at(index), self, keys)),+ }
            }

            fn parts(&self, index: usize, keys: &Keys, piece: Piece) -> Vec<Output> {
                match self.stages[index].plan { $(StagePlan::$name(_) => <$plan>::parts(self.at(index), self, keys, piece)),+ }
            }

            fn pictures(&self, index: usize, piece: Piece) -> Option<Vec<(PathBuf, render::RenderPlan)>> {
                match self.stages[index].plan { $(StagePlan::$name(_) => <$plan>::pictures(self.at(index), self, piece)),+ }
            }

            pub fn retell(&self, index: usize, output: &Path, text: &str) -> Result<u64, io::Error> {
                match self.stages[index].plan { $(StagePlan::$name(_) => <$plan>::retell(self.at(index), self, output, text)),+ }
            }

            pub fn written(&self, index: usize) -> Value {
                match self.stages[index].plan { $(StagePlan::$name(_) => <$plan>::written(self.at(index), self)),+ }
            }

            pub fn needs(&self, index: usize, stale: &dyn Fn(&Path) -> bool) -> Needs {
                match self.stages[index].plan { $(StagePlan::$name(_) => <$plan>::needs(self.at(index), self, stale)),+ }
            }

            fn line(&self, index: usize, counts: &[Counts]) -> String {
                match self.stages[index].plan { $(StagePlan::$name(_) => <$plan>::line(self.at(index), self, counts)),+ }
            }

            fn totals_of(&self, index: usize, counts: &[Counts]) -> Totals {
                match self.stages[index].plan { $(StagePlan::$name(_) => <$plan>::totals(self.at(index), self, counts)),+ }
            }

            fn show(&self, index: usize, fields: &mut Map<String, Value>) {
                match self.stages[index].plan { $(StagePlan::$name(_) => <$plan>::show(fields)),+ }
            }

            pub fn run<const D: usize>(
                &self,
                index: usize,
                run: &mut Run,
                scene: &mut SceneRun<D>,
            ) -> Result<Told, StageError> {
                match self.stages[index].plan { $(StagePlan::$name(_) => <$plan>::run(self.at(index), run, scene)),+ }
            }

            pub fn run_last(&self, index: usize, run: &mut Run) -> Result<Told, StageError> {
                match self.stages[index].plan { $(StagePlan::$name(_) => <$plan>::run_last(self.at(index), run)),+ }
            }
        }

        $(impl plan::OfKind for $plan {
            fn of_kind(stage: &StagePlan) -> Option<&Self> {
                #[allow(unreachable_patterns)]
                match stage { StagePlan::$name(plan) => Some(plan), _ => None }
            }

            fn of_kind_mut(stage: &mut StagePlan) -> Option<&mut Self> {
                #[allow(unreachable_patterns)]
                match stage { StagePlan::$name(plan) => Some(plan), _ => None }
            }
        })+
    };
}

stages! {
    /// Objects in space.
    Scene: scene::SceneSpec => scene::ScenePlan;
    /// Ambient occlusion at the vertices of a scene.
    Occlusion: occlusion::OcclusionSpec => occlusion::OcclusionPlan;
    /// An image of a scene.
    Render: render::RenderSpec => render::RenderPlan;
    /// Files of an image.
    Write: write::WriteSpec => write::WritePlan;
    /// A ParaView state that shows images.
    Paraview: paraview::ParaviewSpec => paraview::FigurePlan;
    /// A scene's mesh as it is, without a camera.
    Mesh: mesh::MeshSpec => mesh::MeshPlan;
    /// Cross-sections of a scene's bodies by hyperplanes.
    Slice: slice::SliceSpec => slice::SlicePlan;
    /// Edges of a scene's bodies as a render's camera sees them.
    Wireframe: wireframe::WireframeSpec => wireframe::WireframePlan;
    /// A render again and again while something moves.
    Animate: animate::AnimateSpec => animate::AnimatePlan;
    /// Ambient occlusion for an image that is there already.
    Shade: shade::ShadeSpec => shade::ShadePlan;
    /// One HTML file that shows images in a browser.
    Page: page::PageSpec => page::PagePlan;
}
