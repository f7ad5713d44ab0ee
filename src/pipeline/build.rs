//! From a plan's scene to a mesh: the one place where a dimension known at run time becomes one known to the compiler.

use super::Invalid;
use super::plan::{CameraPlan, Plan, ProjectionPlan, SceneCounts, ScenePlan};
use crate::geometry::{Dimension, Vector64};
use crate::mesh::{Mesh, MeshBuilder, Orientation};
use crate::render::{Camera, Projection, View};
use crate::scene::{self, build_object_with_notes};

/// A mesh of either dimension.
#[derive(Clone, Debug)]
pub enum AnyMesh {
    /// Triangles in R^3.
    Three(Mesh<3>),
    /// Tetrahedra in R^4.
    Four(Mesh<4>),
}

impl AnyMesh {
    /// Builds a scene of the plan. What is worth telling of its objects goes into `notes`.
    ///
    /// # Errors
    /// Whatever is wrong with an object, at the key to blame.
    pub fn build(plan: &Plan, scene: usize, notes: &mut Vec<String>) -> Result<Self, Invalid> {
        match plan.scenes[scene].dimension {
            Dimension::Three => build(plan, scene, notes).map(Self::Three),
            Dimension::Four => build(plan, scene, notes).map(Self::Four),
        }
    }

    /// How much is in it.
    pub fn counts(&self) -> SceneCounts {
        let (vertices, simplices) = match self {
            Self::Three(m) => (m.vertices.len(), m.simplices.len()),
            Self::Four(m) => (m.vertices.len(), m.simplices.len()),
        };
        SceneCounts { vertices: vertices as u64, simplices: simplices as u64 }
    }
}

/// The camera of a plan.
///
/// # Errors
/// If rounding leaves it without a frame.
pub fn camera<const D: usize>(plan: &CameraPlan) -> Result<Camera<D>, crate::render::CameraError> {
    let vector = |v: &[f64]| Vector64::<D>::from_fn(|r, _| v[r]);
    Camera::new(&View {
        projection: match plan.projection {
            ProjectionPlan::Perspective { field_of_view } => Projection::Perspective { field_of_view },
            ProjectionPlan::Parallel { height } => Projection::Parallel { height },
        },
        eye: vector(&plan.eye),
        target: vector(&plan.target),
        up: vector(&plan.up),
        over: plan.over.as_deref().map_or_else(Vector64::zeros, vector),
    })
}

/// Builds a scene: each object's surface, one after the other, into one mesh.
pub fn build<const D: usize>(plan: &Plan, scene: usize, notes: &mut Vec<String>) -> Result<Mesh<D>, Invalid> {
    let ScenePlan { path, objects, id, .. } = &plan.scenes[scene];
    let mut builder = MeshBuilder::<D>::new();
    for (i, object) in objects.iter().enumerate() {
        let here = format!("{path}.objects[{i}]");
        let refuse = |key: &str, message: String| {
            Invalid::new(if key.is_empty() { here.clone() } else { format!("{here}.{key}") }, message)
        };
        // The path names the key already.
        let blame = |error: scene::Error| {
            let (key, message) = (error.key(), error.to_string());
            refuse(key, message.strip_prefix(&format!("{key}: ")).unwrap_or(&message).to_owned())
        };
        let name = object.name.clone().unwrap_or_else(|| format!("object {}", i + 1));
        let mut told = Vec::new();
        let surface = build_object_with_notes::<D>(object, &plan.folder, &mut told).map_err(blame)?;
        notes.extend(told.into_iter().map(|note| format!("scene {id}, {name}: {note}")));
        let open = match object.orientation {
            scene::Orientation::Input => Orientation::Input,
            scene::Orientation::Eye => match plan.renders.iter().find(|r| r.scene == scene) {
                Some(render) => {
                    let camera = camera::<D>(&render.camera).map_err(|e| refuse("orientation", e.to_string()))?;
                    Orientation::Facing(camera.viewpoint())
                }
                None => {
                    let message = "`eye` faces the camera of the first render of this scene, and there is none";
                    return Err(refuse("orientation", message.to_owned()));
                }
            },
        };
        let color = object.color.rgb().map_err(blame)?;
        let crease = object.crease().map_err(blame)?;
        builder.add_creased(&name, color, &surface, open, crease).map_err(|e| refuse("", e.to_string()))?;
    }
    Ok(builder.finish())
}
