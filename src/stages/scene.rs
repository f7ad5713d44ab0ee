//! `scene`: objects in space.
//!
//! The one place where a dimension known at run time becomes one known to the compiler: [`AnyMesh`].

use std::collections::BTreeMap;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use super::camera::camera;
use super::describe::{Counts, grouped};
use super::render::RenderPlan;
use super::{Invalid, LeftOut, Plan, Ref, Resolver, Stage};
use crate::geometry::{Dimension, Vector64};
use crate::mesh::{Mesh, MeshBuilder, Orientation, Surface};
use crate::progress::Progress;
use crate::scene::{self, ObjectSpec, TransformStep, build_object_watched};

/// The most objects in a scene: the `object` array numbers them with 16 bits, and 0 is the background.
pub const MAX_OBJECTS: usize = 65_535;
/// Said where a stage lacks a scene.
pub(super) const MISSING: &str = "there is no earlier `scene` to work on; put one first";

/// Objects in space.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneSpec {
    /// A name for later stages to refer to.
    pub id: Option<String>,
    /// 4 (default), or 3 for triangles in ordinary space.
    #[schemars(range(min = 3, max = 4))]
    pub dimension: Option<u64>,
    /// Whether its twin in 3D stands beside it, made and shown by whatever works on the scene (default `false`).
    pub twin: Option<bool>,
    /// The objects. Where two are hit at the same distance, one that faces the eye wins, else the first.
    pub objects: Vec<ObjectSpec>,
}

/// Objects in space, as understood.
#[derive(Clone, Debug, Serialize)]
pub struct ScenePlan {
    /// The space it is in.
    pub dimension: Dimension,
    /// What is in it.
    pub objects: Vec<ObjectSpec>,
    /// The eye of the first render of this scene, for open objects that are to face it.
    pub eye: Option<Vec<f64>>,
}

impl ScenePlan {
    /// Whether light passes some object.
    pub fn is_translucent(&self) -> bool {
        self.translucent().is_some()
    }

    /// Whether some object reflects lights in highlights of its own.
    pub(super) fn is_glossy(&self) -> bool {
        self.objects.iter().any(|object| object.specular.is_some_and(|specular| specular > 0.0))
    }

    /// What the first object that light passes is called, if there is one.
    pub(super) fn translucent(&self) -> Option<String> {
        let at = self.objects.iter().position(|object| object.opacity.is_some_and(|opacity| opacity < 1.0))?;
        Some(self.objects[at].name.clone().unwrap_or_else(|| format!("object {}", at + 1)))
    }
}

impl Stage for ScenePlan {
    type Spec = SceneSpec;
    const KIND: &'static str = "scene";
    const LIST: &'static str = "scenes";
    const LEFT_OUT: &'static [LeftOut] =
        &[LeftOut::new("/eye", "where an object faces the eye, the whole camera takes part; nothing else looks at it")];

    fn id(spec: &SceneSpec) -> Option<&str> {
        spec.id.as_deref()
    }

    fn resolve(spec: &SceneSpec, path: &str, resolver: &mut Resolver) -> Result<Self, Invalid> {
        let number = spec.dimension.unwrap_or(4);
        let Some(dimension) = Dimension::new(number) else {
            return Err(Invalid::new(format!("{path}.dimension"), format!("expected 3 or 4, found {number}")));
        };
        let objects = format!("{path}.objects");
        if spec.objects.is_empty() {
            resolver.warn(&objects, "the scene is empty; its images show background only");
        }
        if spec.objects.len() > MAX_OBJECTS {
            let message = format!("expected at most {MAX_OBJECTS} objects, found {}", spec.objects.len());
            return Err(Invalid::new(objects, message));
        }
        let mut names = BTreeMap::new();
        for (i, object) in spec.objects.iter().enumerate() {
            let Some(name) = &object.name else { continue };
            if let Some(first) = names.insert(name, i) {
                let message = format!("objects[{first}] is called `{name}` already");
                return Err(Invalid::new(format!("{objects}[{i}].name"), message));
            }
        }
        Ok(Self { dimension, objects: spec.objects.clone(), eye: None })
    }

    fn works_on(&self) -> Vec<usize> {
        Vec::new()
    }

    fn scene(me: Ref<Self>, _plan: &Plan) -> Option<Ref<Self>> {
        Some(me)
    }

    fn input_files(&self, plan: &Plan) -> Vec<PathBuf> {
        let shapes = self.objects.iter().filter_map(|object| object.shape().ok());
        shapes.flat_map(|shape| shape.input_files(&plan.folder)).collect()
    }

    fn written(me: Ref<Self>, plan: &Plan) -> Value {
        let Self { dimension, objects, .. } = &plan[me];
        json!({ "dimension": dimension.get(), "objects": objects })
    }

    fn depends_on(me: Ref<Self>, plan: &Plan) -> Value {
        let faces_eye = plan[me].objects.iter().any(|object| object.orientation == scene::Orientation::Eye);
        // The first camera matters to what is turned to face it, and to nothing else.
        json!(first_render(plan, me).filter(|_| faces_eye).map(|render| &render.camera))
    }

    fn line(me: Ref<Self>, plan: &Plan, counts: &[Counts]) -> String {
        let Self { dimension, objects, .. } = &plan[me];
        let counts = (counts.get(me.nth()))
            .map(|c| format!(", {} vertices, {} simplices", grouped(c.vertices), grouped(c.simplices)));
        let noun = if objects.len() == 1 { "object" } else { "objects" };
        format!("{}D, {} {noun}{}", dimension.get(), objects.len(), counts.unwrap_or_default())
    }

    fn show(fields: &mut Map<String, Value>) {
        let count = fields["objects"].as_array().map_or(0, Vec::len);
        fields["objects"] = count.into();
    }
}

/// The first render of a scene.
fn first_render(plan: &Plan, scene: Ref<ScenePlan>) -> Option<&RenderPlan> {
    plan.all::<RenderPlan>().map(|(_, render)| render).find(|render| render.scene == scene)
}

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
    /// Whatever is wrong with an object, at the key to blame; anything if `progress` says to stop.
    pub fn build(
        plan: &Plan,
        scene: Ref<ScenePlan>,
        notes: &mut Vec<String>,
        progress: &dyn Progress,
    ) -> Result<Self, Invalid> {
        match plan[scene].dimension {
            Dimension::Three => build(plan, scene, notes, progress).map(Self::Three),
            Dimension::Four => build(plan, scene, notes, progress).map(Self::Four),
        }
    }

    /// How much is in it.
    pub fn counts(&self) -> Counts {
        let (vertices, simplices) = match self {
            Self::Three(m) => (m.vertices.len(), m.simplices.len()),
            Self::Four(m) => (m.vertices.len(), m.simplices.len()),
        };
        Counts { vertices: vertices as u64, simplices: simplices as u64 }
    }
}

/// Builds a scene: each object's surface, one after the other, into one mesh.
pub fn build<const D: usize>(
    plan: &Plan,
    scene: Ref<ScenePlan>,
    notes: &mut Vec<String>,
    progress: &dyn Progress,
) -> Result<Mesh<D>, Invalid> {
    let (path, id) = (plan.path(scene), plan.id(scene));
    let mut builder = MeshBuilder::<D>::new();
    for i in 0..plan[scene].objects.len() {
        let surface = surface(plan, scene, i, notes, progress)?;
        add(&mut builder, plan, scene, i, &surface)?;
    }
    let mesh = builder.finish_watched(progress).ok_or_else(|| Invalid::new(path, "stopped"))?;
    notes.extend(worth_telling(&mesh).into_iter().map(|note| format!("scene {id}: {note}")));
    Ok(mesh)
}

/// What every object is called in messages and files.
fn name_of(object: &ObjectSpec, i: usize) -> String {
    object.name.clone().unwrap_or_else(|| format!("object {}", i + 1))
}

/// The complaint about a key of an object.
fn blame(plan: &Plan, scene: Ref<ScenePlan>, i: usize, error: &scene::Error) -> Invalid {
    let (key, message) = (error.key(), error.to_string());
    let here = format!("{}.objects[{i}]", plan.path(scene));
    // The path names the key already.
    let message = message.strip_prefix(&format!("{key}: ")).unwrap_or(&message).to_owned();
    Invalid::new(if key.is_empty() { here } else { format!("{here}.{key}") }, message)
}

/// The surface of an object, in its place.
fn surface<const D: usize>(
    plan: &Plan,
    scene: Ref<ScenePlan>,
    i: usize,
    notes: &mut Vec<String>,
    progress: &dyn Progress,
) -> Result<Surface<D>, Invalid> {
    let (object, mut told) = (&plan[scene].objects[i], Vec::new());
    let surface = build_object_watched::<D>(object, &plan.folder, &mut told, progress);
    let surface = surface.map_err(|e| blame(plan, scene, i, &e))?;
    let (id, name) = (plan.id(scene), name_of(object, i));
    notes.extend(told.into_iter().map(|note| format!("scene {id}, {name}: {note}")));
    Ok(surface)
}

/// Puts an object's surface into a mesh.
fn add<const D: usize>(
    builder: &mut MeshBuilder<D>,
    plan: &Plan,
    scene: Ref<ScenePlan>,
    i: usize,
    surface: &Surface<D>,
) -> Result<(), Invalid> {
    let object = &plan[scene].objects[i];
    let here = format!("{}.objects[{i}]", plan.path(scene));
    let refuse = |message: String| Invalid::new(format!("{here}.orientation"), message);
    let open = match object.orientation {
        scene::Orientation::Input => Orientation::Input,
        scene::Orientation::Eye => match first_render(plan, scene) {
            Some(render) => {
                let camera = camera::<D>(&render.camera).map_err(|e| refuse(e.to_string()))?;
                Orientation::Facing(camera.viewpoint())
            }
            None => {
                let message = "`eye` faces the camera of the first render of this scene, and there is none";
                return Err(refuse(message.to_owned()));
            }
        },
    };
    let color = object.color.rgb().map_err(|e| blame(plan, scene, i, &e))?;
    let crease = object.crease().map_err(|e| blame(plan, scene, i, &e))?;
    let name = name_of(object, i);
    let opacity = object.surface_opacity().map_err(|e| blame(plan, scene, i, &e))?;
    builder.add_creased(&name, color, surface, open, crease).map_err(|e| Invalid::new(here.clone(), e.to_string()))?;
    builder.set_opacity(opacity);
    builder.set_gloss(object.gloss().map_err(|e| blame(plan, scene, i, &e))?);
    Ok(())
}

/// The surfaces of a scene's objects, kept so that some of them can be moved without building them again.
pub(super) struct Bodies<const D: usize> {
    scene: Ref<ScenePlan>,
    surfaces: Vec<Surface<D>>,
}

impl<const D: usize> Bodies<D> {
    /// Builds them.
    pub fn build(plan: &Plan, scene: Ref<ScenePlan>, progress: &dyn Progress) -> Result<Self, Invalid> {
        let objects = 0..plan[scene].objects.len();
        // What there is to tell of them was told when the scene was built.
        let surfaces: Result<_, _> = objects.map(|i| surface(plan, scene, i, &mut Vec::new(), progress)).collect();
        Ok(Self { scene, surfaces: surfaces? })
    }

    /// The points that simplices use.
    pub fn used_points(&self) -> Vec<Vector64<D>> {
        let mut points = Vec::new();
        for surface in &self.surfaces {
            let mut used = vec![false; surface.vertices.len()];
            surface.simplices.iter().flatten().for_each(|&v| used[v as usize] = true);
            points.extend(surface.vertices.iter().zip(&used).filter(|(_, used)| **used).map(|(point, _)| *point));
        }
        points
    }

    /// The scene with these objects moved on by these steps; the same as if the steps stood at the end of their `transform`.
    pub fn moved(
        &self,
        plan: &Plan,
        objects: &[usize],
        steps: &[TransformStep],
        progress: &dyn Progress,
    ) -> Result<Mesh<D>, Invalid> {
        let mut builder = MeshBuilder::<D>::new();
        for (i, surface) in self.surfaces.iter().enumerate() {
            if objects.contains(&i) {
                let surface = scene::moved(surface, steps).map_err(|e| blame(plan, self.scene, i, &e))?;
                add(&mut builder, plan, self.scene, i, &surface)?;
            } else {
                add(&mut builder, plan, self.scene, i, surface)?;
            }
        }
        builder.finish_watched(progress).ok_or_else(|| Invalid::new(plan.path(self.scene), "stopped"))
    }
}

/// Simplices that nothing hits, that rounding turned over, or that lie on others.
fn worth_telling<const D: usize>(mesh: &Mesh<D>) -> Vec<String> {
    let total = mesh.simplices.len();
    let mut told = Vec::new();
    let mut tell = |count: usize, first: u32, what: &str, near: bool| {
        let name = &mesh.objects[mesh.object_of(first)].name;
        let at: Vec<String> = mesh.corners(first)[0].iter().map(f32::to_string).collect();
        let near = if near { format!(", near ({})", at.join(", ")) } else { String::new() };
        told.push(format!("{count} of {total} simplices {what} (the first is number {first}, of {name}{near})"));
    };
    if let Some(&first) = mesh.degenerate.first() {
        tell(mesh.degenerate.len(), first, "have measure zero and are left out", false);
    }
    if let Some(&first) = mesh.turned_over.first() {
        let what = "turned over or flat once rounded to single precision: they are thinner than its steps there, and may \
                    shadow what is beside them";
        tell(mesh.turned_over.len(), first, what, true);
    }
    if let Some((first, _)) = mesh.copies.iter().next() {
        let what = "lie on others with the same corners: those that face the same way count once, and of two that face \
                    opposite ways each is seen from its own side";
        tell(mesh.copies.len(), first, what, false);
    }
    told
}
