//! `wireframe`: edges of a scene's bodies as a render's camera sees them (Noll 1967), as lines beside its volume.
//!
//! What lies behind the eye is cut off a little before it, and each line tells whether something hides it (`lines`). Or the
//! edges are projected stereographically, from what lies around a centre, without a camera. Which edges are shown is told in
//! [`crate::mesh::edges`].

mod lines;

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use self::lines::Lines;
use super::camera::{CameraPlan, camera};
use super::describe::Counts;
use super::projection::{ProjectionWord, StereographicPlan};
use super::range::positive;
use super::render::RenderPlan;
use super::scene::ScenePlan;
use super::write::vtu;
use super::{Invalid, Keys, LeftOut, Output, Plan, Ref, Resolver, Run, SceneRun, Stage, StageError, Told};
use crate::io;
use crate::mesh::edges;
use crate::text::number;

/// Said where it lacks a camera.
const MISSING: &str = "there is no earlier `render` whose camera it could look through; put one first";
/// Said where it lacks a scene.
const NO_SCENE: &str = "there is no earlier `scene` whose edges it could show; put one first";
/// The angle of feature edges where nothing else is said, in degrees: the 600-cell's cells meet at 15.5.
const ANGLE: f64 = 10.0;
/// How far before the eye edges are cut off where nothing else is said, in distances from the eye to its target.
const NEAR: f64 = 0.01;

/// Edges of a scene's bodies as a render's camera sees them.
#[derive(Clone, Debug, Deserialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct WireframeSpec {
    /// A name for later stages to refer to.
    pub id: Option<String>,
    /// The render whose scene and camera it shows, by its id (default: the nearest earlier one); of a stereographic
    /// projection the scene (default: the nearest earlier one).
    pub input: Option<String>,
    /// `feature` (default): where the surface bends; or `all` edges of the mesh.
    pub edges: Option<EdgesWord>,
    /// With `feature`: by how many degrees it bends there at least (default 10).
    #[schemars(range(min = 0, max = 180))]
    pub angle: Option<f64>,
    /// How far before the eye, along the line of sight, edges are cut off (default: a hundredth of the way to the target).
    pub near: Option<f64>,
    /// What becomes of parts that something hides from the camera (default `mark`).
    pub hidden: Option<Hidden>,
    /// What shows the edges: `camera` (default), or `stereographic`, on the sphere around `center`.
    pub projection: Option<ProjectionWord>,
    /// The centre of the sphere of a stereographic projection (default: the origin).
    pub center: Option<Vec<f64>>,
    /// From where that projects: the pole's direction from the centre (default: along the last axis).
    pub pole: Option<Vec<f64>>,
    /// The file: `NAME.vtp`.
    pub vtp: String,
}

/// What becomes of parts of edges that something hides.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Hidden {
    /// The array `visible` tells which they are.
    #[default]
    Mark,
    /// They are left out.
    LeaveOut,
    /// Nobody asks.
    Ignore,
}

/// Which edges are shown.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum EdgesWord {
    /// Where the surface bends.
    #[default]
    Feature,
    /// Those of all simplices.
    All,
}

/// A wireframe, as understood.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WireframePlan {
    /// What shows them.
    pub view: View,
    /// The scene whose edges they are.
    pub scene: Ref<ScenePlan>,
    /// Which edges.
    pub edges: EdgesWord,
    /// The angle of feature edges, in degrees.
    pub angle: Option<f64>,
    /// The file, below `out`.
    #[serde(serialize_with = "super::describe::path")]
    pub file: PathBuf,
}

/// What shows the edges.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum View {
    /// The camera of a render.
    Camera {
        /// The render.
        render: Ref<RenderPlan>,
        /// Its camera.
        camera: CameraPlan,
        /// How far before the eye edges are cut off.
        near: f64,
        /// What becomes of what is hidden.
        hidden: Hidden,
        /// The render's dimensions, whose voxels tell how finely that is asked.
        dimensions: [usize; 3],
    },
    /// A stereographic projection.
    Stereographic(StereographicPlan),
}

impl WireframePlan {
    /// The render through whose camera they are seen.
    pub fn render(&self) -> Option<Ref<RenderPlan>> {
        match self.view {
            View::Camera { render, .. } => Some(render),
            View::Stereographic(_) => None,
        }
    }
}

impl Stage for WireframePlan {
    type Spec = WireframeSpec;
    const KIND: &'static str = "wireframe";
    const LIST: &'static str = "wireframes";
    const LEFT_OUT: &'static [LeftOut] = &[
        LeftOut::new("/view/camera/render", "its camera and dimensions take part; nothing else of it is looked at"),
        LeftOut::new("/scene", "the key of the scene itself takes part"),
        LeftOut::new("/file", "a file doesn't depend on its name"),
    ];

    fn id(spec: &WireframeSpec) -> Option<&str> {
        spec.id.as_deref()
    }

    fn resolve(spec: &WireframeSpec, path: &str, resolver: &mut Resolver) -> Result<Self, Invalid> {
        let (view, scene) = view(spec, path, resolver)?;
        let edges = spec.edges.unwrap_or_default();
        let angle = match (edges, spec.angle) {
            (EdgesWord::Feature, given) => {
                let angle = given.unwrap_or(ANGLE);
                if !(0.0..=180.0).contains(&angle) {
                    let message = format!("expected 0 to 180 degrees, found {}", number(angle));
                    return Err(Invalid::new(format!("{path}.angle"), message));
                }
                Some(angle)
            }
            (EdgesWord::All, None) => None,
            (EdgesWord::All, Some(_)) => {
                resolver.warn(format!("{path}.angle"), "has no use where all edges are shown");
                None
            }
        };
        let file = resolver.outputs.claim(&format!("{path}.vtp"), &spec.vtp, Some("vtp"))?;
        Ok(Self { view, scene, edges, angle, file })
    }

    fn works_on(&self) -> Vec<usize> {
        vec![self.scene.index()]
    }

    fn scene(me: Ref<Self>, plan: &Plan) -> Option<Ref<ScenePlan>> {
        Some(plan[me].scene)
    }

    fn files(&self) -> Vec<&Path> {
        vec![&self.file]
    }

    fn outputs(me: Ref<Self>, plan: &Plan, keys: &Keys) -> Vec<Output> {
        vec![Output::alone(&plan[me].file, keys.of(me.index()).to_owned())]
    }

    fn retell(_: Ref<Self>, plan: &Plan, output: &Path, text: &str) -> Result<u64, io::Error> {
        vtu::retell(&plan.out.join(output), text)
    }

    fn written(me: Ref<Self>, plan: &Plan) -> Value {
        let Self { view, edges, angle, .. } = &plan[me];
        let mut written = match view {
            View::Camera { near, hidden, .. } => json!({ "near": near, "hidden": hidden }),
            View::Stereographic(StereographicPlan { center, pole }) => json!({ "center": center, "pole": pole }),
        };
        written["edges"] = json!(edges);
        if let Some(angle) = angle {
            written["angle"] = json!(angle);
        }
        written
    }

    fn line(me: Ref<Self>, plan: &Plan, _: &[Counts]) -> String {
        let Self { view, scene, angle, file, .. } = &plan[me];
        let which = match angle {
            Some(angle) => format!("edges where it bends by more than {} degrees", number(*angle)),
            None => "all edges".to_owned(),
        };
        let how = match view {
            View::Camera { render, .. } => format!("seen as by {}", plan.id(*render)),
            View::Stereographic(_) => "projected stereographically".to_owned(),
        };
        format!("{}, {which}, {how} -> {}", plan.id(*scene), file.display())
    }

    fn run<const D: usize>(me: Ref<Self>, run: &mut Run, scene: &mut SceneRun<D>) -> Result<Told, StageError> {
        let plan = run.plan;
        let Self { view, angle, file, .. } = &plan[me];
        if !run.is_stale(file) {
            return Ok("as it was".into());
        }
        let mesh = scene.session.mesh();
        let which = angle.map_or(edges::Edges::All, edges::Edges::Feature);
        let edges = edges::edges(mesh, which);
        let lines = match view {
            View::Camera { camera: seen, near, hidden, dimensions, .. } => {
                let camera = camera::<D>(seen)?;
                let mut lines = Lines::seen(mesh, &camera, *near, &edges);
                if *hidden != Hidden::Ignore && !lines.lines.is_empty() {
                    let voxel = camera.grid(*dimensions).spacing[1];
                    let backend = scene.session.backend();
                    lines.look(&**backend, &camera, voxel, *hidden == Hidden::LeaveOut, run.progress)?;
                }
                lines
            }
            View::Stereographic(projection) => {
                // The checks before leave no projection that can't be.
                let Some(map) = projection.map::<D>() else { return Ok(Told::default()) };
                Lines::projected(mesh, &map, &edges)
                    .map_err(|(why, object)| projection.complain(me, plan, why, &mesh.objects[object as usize].name))?
            }
        };
        let mut notes = Vec::new();
        if edges.is_empty() {
            let remedy = "a lower `angle`, or `edges: all`, would show some";
            notes.push(format!("{}: there are no such edges; {remedy}", plan.id(me)));
        } else if lines.lines.is_empty() {
            notes.push(format!("{}: all edges are behind the eye, nearer than `near`, or hidden", plan.id(me)));
        }
        let bytes = lines.write(&plan.out.join(file), run.told)?;
        run.made(file, bytes, notes)?;
        let hidden = match lines.hidden() {
            0 => String::new(),
            hidden => format!(", {hidden} of them hidden"),
        };
        let numbers = json!({ "lines": lines.lines.len(), "hidden": lines.hidden() });
        Ok(Told::new(format!("{} lines{hidden}", lines.lines.len()), numbers))
    }
}

/// What shows the edges, and of which scene.
fn view(spec: &WireframeSpec, path: &str, resolver: &Resolver) -> Result<(View, Ref<ScenePlan>), Invalid> {
    let refuse = |key: &str, message: &str| Err(Invalid::new(format!("{path}.{key}"), message));
    match spec.projection.unwrap_or(ProjectionWord::Camera) {
        ProjectionWord::Plane => {
            refuse("projection", "edges lie in no common hyperplane; take `camera` or `stereographic`")
        }
        ProjectionWord::Camera => {
            for (key, given) in [("center", &spec.center), ("pole", &spec.pole)] {
                if given.is_some() {
                    return refuse(key, "is for `projection: stereographic`; add that, or take it out");
                }
            }
            let render: Ref<RenderPlan> = resolver.input(path, spec.input.as_deref(), MISSING)?;
            let RenderPlan { scene, camera, dimensions, .. } = &resolver.plan[render];
            let near = match spec.near {
                Some(near) => positive(&format!("{path}.near"), near)?,
                None => {
                    let squares = camera.eye.iter().zip(&camera.target).map(|(e, t)| (e - t) * (e - t));
                    NEAR * squares.sum::<f64>().sqrt()
                }
            };
            let (camera, hidden) = (camera.clone(), spec.hidden.unwrap_or_default());
            Ok((View::Camera { render, camera, near, hidden, dimensions: *dimensions }, *scene))
        }
        ProjectionWord::Stereographic => {
            for (key, given) in [("near", spec.near.is_some()), ("hidden", spec.hidden.is_some())] {
                if given {
                    return refuse(key, "is for what a camera sees; a stereographic projection shows all");
                }
            }
            let scene: Ref<ScenePlan> = resolver.input(path, spec.input.as_deref(), NO_SCENE)?;
            let dimension = resolver.plan[scene].dimension;
            let plan = StereographicPlan::new(spec.center.as_deref(), spec.pole.as_deref(), path, dimension)?;
            Ok((View::Stereographic(plan), scene))
        }
    }
}
