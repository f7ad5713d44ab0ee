//! `wireframe`: edges of a scene's bodies as a render's camera sees them (Noll 1967), as lines beside its volume.
//!
//! Straight lines of R^D are straight in the image, so an edge is a line between the images of its ends; what lies behind
//! the eye is cut off a little before it. Which edges are shown is told in [`crate::mesh::edges`].

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::camera::{CameraPlan, camera};
use super::describe::Counts;
use super::range::positive;
use super::render::RenderPlan;
use super::scene::ScenePlan;
use super::write::vtu;
use super::{Invalid, Keys, LeftOut, Output, Plan, Ref, Resolver, Run, SceneRun, Stage, StageError};
use crate::geometry::{Dimension, Vector, narrow, widen};
use crate::io::{self, AtomicFile, PIPELINE, vtp};
use crate::mesh::Mesh;
use crate::mesh::edges::{self, Edge};
use crate::render::{Camera, Projection};
use crate::text::number;
use crate::volume::Array;

/// Said where it lacks a camera.
const MISSING: &str = "there is no earlier `render` whose camera it could look through; put one first";
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
    /// The render whose scene and camera it shows, by its id (default: the nearest earlier one).
    pub input: Option<String>,
    /// `feature` (default): where the surface bends; or `all` edges of the mesh.
    pub edges: Option<EdgesWord>,
    /// With `feature`: by how many degrees it bends there at least (default 10).
    #[schemars(range(min = 0, max = 180))]
    pub angle: Option<f64>,
    /// How far before the eye, along the line of sight, edges are cut off (default: a hundredth of the way to the target).
    pub near: Option<f64>,
    /// The file: `NAME.vtp`.
    pub vtp: String,
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
    /// The render whose camera it is.
    pub render: Ref<RenderPlan>,
    /// The scene whose edges they are.
    pub scene: Ref<ScenePlan>,
    /// The camera.
    pub camera: CameraPlan,
    /// Which edges.
    pub edges: EdgesWord,
    /// The angle of feature edges, in degrees.
    pub angle: Option<f64>,
    /// How far before the eye they are cut off.
    pub near: f64,
    /// The file, below `out`.
    #[serde(serialize_with = "super::describe::path")]
    pub file: PathBuf,
}

impl Stage for WireframePlan {
    type Spec = WireframeSpec;
    const KIND: &'static str = "wireframe";
    const LIST: &'static str = "wireframes";
    const LEFT_OUT: &'static [LeftOut] = &[
        LeftOut::new("/render", "its camera takes part; nothing else of it is looked at"),
        LeftOut::new("/scene", "the key of the scene itself takes part"),
        LeftOut::new("/file", "a file doesn't depend on its name"),
    ];

    fn id(spec: &WireframeSpec) -> Option<&str> {
        spec.id.as_deref()
    }

    fn resolve(spec: &WireframeSpec, path: &str, resolver: &mut Resolver) -> Result<Self, Invalid> {
        let render: Ref<RenderPlan> = resolver.input(path, spec.input.as_deref(), MISSING)?;
        let RenderPlan { scene, camera, .. } = &resolver.plan[render];
        let (scene, camera) = (*scene, camera.clone());
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
        let near = match spec.near {
            Some(near) => positive(&format!("{path}.near"), near)?,
            None => {
                let squares = camera.eye.iter().zip(&camera.target).map(|(e, t)| (e - t) * (e - t));
                NEAR * squares.sum::<f64>().sqrt()
            }
        };
        let file = resolver.outputs.claim(&format!("{path}.vtp"), &spec.vtp, Some("vtp"))?;
        Ok(Self { render, scene, camera, edges, angle, near, file })
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
        let Self { edges, angle, near, .. } = &plan[me];
        match angle {
            Some(angle) => json!({ "edges": edges, "angle": angle, "near": near }),
            None => json!({ "edges": edges, "near": near }),
        }
    }

    fn line(me: Ref<Self>, plan: &Plan, _: &[Counts]) -> String {
        let Self { render, scene, angle, file, .. } = &plan[me];
        let which = match angle {
            Some(angle) => format!("edges where it bends by more than {} degrees", number(*angle)),
            None => "all edges".to_owned(),
        };
        format!("{}, {which}, seen as by {} -> {}", plan.id(*scene), plan.id(*render), file.display())
    }

    fn run<const D: usize>(me: Ref<Self>, run: &mut Run, scene: &mut SceneRun<D>) -> Result<String, StageError> {
        let plan = run.plan;
        let Self { camera: seen, angle, near, file, .. } = &plan[me];
        if !run.is_stale(file) {
            return Ok("as it was".to_owned());
        }
        let mesh = scene.session.mesh();
        let which = angle.map_or(edges::Edges::All, edges::Edges::Feature);
        let edges = edges::edges(mesh, which);
        let camera = camera::<D>(seen)?;
        let lines = Lines::new(mesh, &camera, *near, &edges);
        let mut notes = Vec::new();
        if edges.is_empty() {
            let remedy = "a lower `angle`, or `edges: all`, would show some";
            notes.push(format!("{}: there are no such edges; {remedy}", plan.id(me)));
        } else if lines.lines.is_empty() {
            notes.push(format!("{}: all edges are behind the eye, or nearer than `near`", plan.id(me)));
        }
        let bytes = lines.write(&plan.out.join(file), run.told)?;
        run.made(file, bytes, notes)?;
        Ok(format!("{} lines", lines.lines.len()))
    }
}

/// Edges as a camera sees them.
struct Lines<const D: usize> {
    /// Where each point is in space, and in the image.
    points: Vec<(Vector<D>, [f32; 3])>,
    /// How far each is from the eye.
    depth: Vec<f32>,
    /// The object of each.
    object: Vec<u16>,
    lines: Vec<[u32; 2]>,
}

impl<const D: usize> Lines<D> {
    /// Projects the edges, without what is nearer to the eye than `near`.
    fn new(mesh: &Mesh<D>, camera: &Camera<D>, near: f64, edges: &[Edge]) -> Self {
        let mut made = Self { points: Vec::new(), depth: Vec::new(), object: Vec::new(), lines: Vec::new() };
        let mut numbers: HashMap<u32, Option<u32>> = HashMap::new();
        for edge in edges {
            let [a, b] = edge.ends.map(|v| mesh.vertices[v as usize]);
            let distances = [a, b].map(|point| camera.project(&point).1);
            if distances.iter().all(|&distance| distance < near) {
                continue;
            }
            let cut = || {
                let share = (near - distances[0]) / (distances[1] - distances[0]);
                narrow(&(widen(&a) + (widen(&b) - widen(&a)) * share))
            };
            let mut ends = [None; 2];
            for (end, (vertex, distance)) in ends.iter_mut().zip(edge.ends.into_iter().zip(distances)) {
                *end = if distance < near {
                    made.add(camera, cut(), edge.object)
                } else {
                    let point = mesh.vertices[vertex as usize];
                    *numbers.entry(vertex).or_insert_with(|| made.add(camera, point, edge.object))
                };
            }
            if let [Some(a), Some(b)] = ends {
                made.lines.push([a, b]);
            }
        }
        made
    }

    /// Adds a point, if it has an image.
    fn add(&mut self, camera: &Camera<D>, point: Vector<D>, object: u32) -> Option<u32> {
        let (image, distance) = camera.project(&point);
        let seen = image.map(|x| x as f32 + 0.0);
        if !seen.iter().all(|x| x.is_finite()) {
            return None;
        }
        // Along the point's own ray, as in pictures.
        let slant = match camera.projection() {
            Projection::Perspective { .. } => (1.0 + image.iter().map(|x| x * x).sum::<f64>()).sqrt(),
            Projection::Parallel { .. } => 1.0,
        };
        self.points.push((point, seen));
        self.depth.push((distance * slant) as f32);
        self.object.push(object as u16 + 1);
        Some(self.points.len() as u32 - 1)
    }

    /// Writes them; returns the file's length.
    fn write(&self, path: &Path, told: &str) -> Result<u64, io::Error> {
        let image: Vec<[f32; 3]> = self.points.iter().map(|point| point.1).collect();
        let position: Vec<f32> = self.points.iter().flat_map(|point| point.0.iter().copied()).collect();
        let mut arrays = vec![
            Array::new("position", D, position),
            Array::new("depth", 1, self.depth.clone()),
            Array::new("object", 1, self.object.clone()),
        ];
        if Dimension::of::<D>() == Dimension::Four {
            let w: Vec<f32> = self.points.iter().map(|point| point.0[D - 1]).collect();
            arrays.push(Array::new("w", 1, w));
        }
        let mut file = AtomicFile::create(path)?;
        let texts = [(PIPELINE, told)];
        vtp::write(&mut file, &image, vtp::Cells::Lines(&self.lines), &arrays, &[], &texts)
            .map_err(AtomicFile::name_in(path))?;
        file.commit()
    }
}
