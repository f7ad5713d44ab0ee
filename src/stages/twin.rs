//! The 3D twin of a scene, for a reader who is to learn to read the 4D picture: `twin: true`.
//!
//! The scene one dimension lower ([`crate::scene::twin`]) is a scene of its own, and whatever works on the 4D scene has a
//! twin that works on it: its occlusion by the same method, its render with the same camera, and writes, animations and wireframes
//! of that, whose files are called `NAME-3d`. These are stages like any other, each just before the one that it is the twin of, called
//! `ID-3d`, so that later stages may name them; where they name none, the 4D ones are still the nearest. A figure shows each
//! image of the 4D scene with its twin to the left.
//!
//! A camera has one axis less: what it has over, z, goes, and w, along which it looks by default, takes its place. A picture
//! in 3D is one layer of pixels, so it has more of them each way.

use super::animate::{AnimateSpec, MoveSpec, TurnSpec};
use super::camera::CameraSpec;
use super::lighting::LightSpec;
use super::occlusion::OcclusionSpec;
use super::render::RenderSpec;
use super::scene::SceneSpec;
use super::wireframe::WireframeSpec;
use super::write::WriteSpec;
use super::{Invalid, Plan, StagePlan, StageSpec};
use crate::scene::{self, place, plane};

/// Pixels of a twin to a voxel, each way.
const PIXELS: u64 = 4;

/// What is appended to the names of twins.
const SUFFIX: &str = "-3d";

impl StageSpec {
    /// The stage's twin and its name, if what it works on has one; `twin_of` gives the name of that, by its place in the plan.
    /// `id` is the stage's name, `plan` the stage as understood, `path` where it is written.
    ///
    /// # Errors
    /// If there is to be one and can't be.
    pub(super) fn twin(
        &self,
        id: &str,
        plan: &StagePlan,
        path: &str,
        twin_of: impl Fn(usize) -> Option<String>,
    ) -> Result<Option<(String, StageSpec)>, Invalid> {
        let twin = match (self, plan) {
            (StageSpec::Scene(spec), _) if spec.twin == Some(true) => Some(StageSpec::Scene(of_scene(spec, path)?)),
            (StageSpec::Occlusion(spec), StagePlan::Occlusion(plan)) => match twin_of(plan.scene.index()) {
                Some(input) => Some(StageSpec::Occlusion(of_occlusion(spec, input, path)?)),
                None => None,
            },
            (StageSpec::Render(spec), StagePlan::Render(plan)) => match twin_of(plan.scene.index()) {
                Some(scene) => {
                    let occlusion = plan.occlusion.and_then(|occlusion| twin_of(occlusion.index()));
                    Some(StageSpec::Render(of_render(spec, scene, occlusion, path)?))
                }
                None => None,
            },
            (StageSpec::Write(spec), StagePlan::Write(plan)) => {
                twin_of(plan.render.index()).map(|input| StageSpec::Write(of_write(spec, input)))
            }
            (StageSpec::Animate(spec), StagePlan::Animate(plan)) => match twin_of(plan.render.index()) {
                Some(input) => Some(StageSpec::Animate(of_animate(spec, input, path)?)),
                None => None,
            },
            (StageSpec::Wireframe(spec), StagePlan::Wireframe(plan)) => {
                let input = plan.render().and_then(|render| twin_of(render.index()));
                input.map(|input| StageSpec::Wireframe(of_wireframe(spec, input)))
            }
            _ => None,
        };
        Ok(twin.map(|twin| (named(id), twin)))
    }
}

impl Plan {
    /// Whether the stage at this place is the twin of the next.
    pub fn is_twin(&self, index: usize) -> bool {
        self.stages[index].twin
    }

    /// The place of the twin of the stage at this place, if it has one.
    pub(super) fn twin_of(&self, index: usize) -> Option<usize> {
        index.checked_sub(1).filter(|&before| self.is_twin(before))
    }
}

/// The name of a twin.
fn named(id: &str) -> String {
    format!("{id}{SUFFIX}")
}

/// The file of a twin: `NAME-3d.ext` for `NAME.ext`.
fn file(name: &str) -> String {
    match name.rsplit_once('.') {
        Some((stem, ending)) => format!("{stem}{SUFFIX}.{ending}"),
        None => named(name),
    }
}

/// The complaint about a key of a stage.
fn blame(path: &str, error: &scene::Error) -> Invalid {
    let (key, message) = (error.key(), error.to_string());
    let message = message.strip_prefix(&format!("{key}: ")).unwrap_or(&message).to_owned();
    Invalid::new(if key.is_empty() { path.to_owned() } else { format!("{path}.{key}") }, message)
}

fn of_scene(spec: &SceneSpec, path: &str) -> Result<SceneSpec, Invalid> {
    if spec.dimension == Some(3) {
        let message = "a twin is a 3D scene beside a 4D one; this scene is of dimension 3 itself";
        return Err(Invalid::new(format!("{path}.twin"), message));
    }
    let objects = spec.objects.iter().enumerate();
    let twins = objects.map(|(i, object)| scene::twin(object).map_err(|e| blame(&format!("{path}.objects[{i}]"), &e)));
    Ok(SceneSpec { id: None, dimension: Some(3), twin: None, objects: twins.collect::<Result<_, _>>()? })
}

fn of_occlusion(spec: &OcclusionSpec, input: String, path: &str) -> Result<OcclusionSpec, Invalid> {
    if spec.load.is_some() {
        let message = "the file has the values of the 4D scene, and none of its twin; take `load` out, or `twin`";
        return Err(Invalid::new(format!("{path}.load"), message));
    }
    Ok(OcclusionSpec { id: None, input: Some(input), file: spec.file.as_deref().map(file), ..spec.clone() })
}

fn of_render(spec: &RenderSpec, scene: String, occlusion: Option<String>, path: &str) -> Result<RenderSpec, Invalid> {
    let vector = |key: &str, given: &Option<Vec<f64>>| {
        given.as_ref().map(|v| place(key, v)).transpose().map_err(|e| blame(path, &e))
    };
    let camera = match &spec.camera {
        None => None,
        Some(camera) => Some(CameraSpec {
            eye: vector("camera.eye", &camera.eye)?,
            target: vector("camera.target", &camera.target)?,
            up: vector("camera.up", &camera.up)?,
            over: None,
            ..camera.clone()
        }),
    };
    let mut lights = spec.lights.clone();
    for (i, light) in lights.iter_mut().flatten().enumerate() {
        let LightSpec { direction, position, .. } = light;
        *direction = vector(&format!("lights[{i}].direction"), direction)?;
        *position = vector(&format!("lights[{i}].position"), position)?;
    }
    let dimensions = spec.dimensions.iter().take(2).map(|n| n.saturating_mul(PIXELS)).collect();
    let without = occlusion.is_none().then(|| "none".to_owned());
    // Layers around bodies are for volumes.
    Ok(RenderSpec {
        id: None,
        input: Some(occlusion.unwrap_or(scene)),
        occlusion: without,
        camera,
        dimensions,
        dilate: None,
        lights,
        ..spec.clone()
    })
}

fn of_write(spec: &WriteSpec, input: String) -> WriteSpec {
    let renamed = |name: &Option<String>| name.as_deref().map(file);
    let (vti, raw, vtu, png) = (renamed(&spec.vti), renamed(&spec.raw), renamed(&spec.vtu), renamed(&spec.png));
    WriteSpec { id: None, input: Some(input), vti, raw, vtu, png, ..spec.clone() }
}

fn of_wireframe(spec: &WireframeSpec, input: String) -> WireframeSpec {
    WireframeSpec { id: None, input: Some(input), vtp: file(&spec.vtp), ..spec.clone() }
}

fn of_animate(spec: &AnimateSpec, input: String, path: &str) -> Result<AnimateSpec, Invalid> {
    let vector = |key: &str, v: &Vec<f64>| place(key, v).map_err(|e| blame(path, &e));
    let turn = match &spec.turn {
        None => None,
        Some(turn) => {
            let center = turn.center.as_ref().map(|v| vector("turn.center", v)).transpose()?;
            Some(match plane(&turn.plane) {
                Some(plane) => TurnSpec { plane, center, ..turn.clone() },
                // Nothing is left to turn.
                None => TurnSpec { plane: "xz".to_owned(), from: Some(0.0), to: Some(0.0), center },
            })
        }
    };
    let line = match &spec.r#move {
        None => None,
        Some(line) => Some(MoveSpec {
            from: line.from.as_ref().map(|v| vector("move.from", v)).transpose()?,
            to: vector("move.to", &line.to)?,
        }),
    };
    Ok(AnimateSpec { id: None, input: Some(input), turn, r#move: line, vti: file(&spec.vti), ..spec.clone() })
}
