//! `mesh`: a scene's mesh as it is, without a camera.
//!
//! The `.vtu` of a `write` shows the mesh as a camera sees it, and lacks what is not wholly before the eye. Here every
//! simplex is written and no vertex moved: `position` has the coordinates in R^D, beside normals, objects and, where there
//! is one, ambient occlusion. The file's own points, which have three coordinates, are the first three of each vertex.
//! `ao4d info` tells of it what holds in R^D, and `file` in a scene reads it back, vertex by vertex.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::describe::{Counts, grouped};
use super::occlusion::{self, OcclusionPlan};
use super::piece::{self, Piece};
use super::scene::ScenePlan;
use super::subject::scene_and_occlusion;
use super::write::{Found, MeshPart, vtu};
use super::{Invalid, Keys, LeftOut, Output, Plan, Ref, Resolver, Run, SceneRun, Stage, StageError, Told};
use crate::io;

/// A scene's mesh as it is, without a camera.
#[derive(Clone, Debug, Deserialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct MeshSpec {
    /// A name for later stages to refer to.
    pub id: Option<String>,
    /// The scene, or the occlusion (and with it its scene), by its id.
    pub input: Option<String>,
    /// The occlusion that is written with it, by its id; `none` writes none (default: the nearest earlier one, if any).
    pub occlusion: Option<String>,
    /// The file: `NAME.vtu`.
    pub vtu: String,
}

/// A mesh that is written, as understood.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeshPlan {
    /// The scene whose mesh it is.
    pub scene: Ref<ScenePlan>,
    /// The occlusion that is written with it.
    pub occlusion: Option<Ref<OcclusionPlan>>,
    /// The file, below `out`.
    #[serde(serialize_with = "super::describe::path")]
    pub file: PathBuf,
}

impl Stage for MeshPlan {
    type Spec = MeshSpec;
    const KIND: &'static str = "mesh";
    const LIST: &'static str = "meshes";
    const LEFT_OUT: &'static [LeftOut] = &[
        LeftOut::new("/scene", "the key of the scene itself takes part"),
        LeftOut::new("/occlusion", "the key of the occlusion itself takes part"),
        LeftOut::new("/file", "a file doesn't depend on its name"),
    ];

    fn id(spec: &MeshSpec) -> Option<&str> {
        spec.id.as_deref()
    }

    fn resolve(spec: &MeshSpec, path: &str, resolver: &mut Resolver) -> Result<Self, Invalid> {
        let (scene, occlusion) = scene_and_occlusion(resolver, path, spec.input.as_deref(), spec.occlusion.as_deref())?;
        let file = resolver.outputs.claim(&format!("{path}.vtu"), &spec.vtu, Some("vtu"))?;
        Ok(Self { scene, occlusion, file })
    }

    fn works_on(&self) -> Vec<usize> {
        std::iter::once(self.scene.index()).chain(self.occlusion.map(Ref::index)).collect()
    }

    fn scene(me: Ref<Self>, plan: &Plan) -> Option<Ref<ScenePlan>> {
        Some(plan[me].scene)
    }

    fn wants_values(&self, occlusion: usize) -> bool {
        self.occlusion.is_some_and(|own| own.index() == occlusion)
    }

    fn files(&self) -> Vec<&Path> {
        vec![&self.file]
    }

    fn outputs(me: Ref<Self>, plan: &Plan, keys: &Keys) -> Vec<Output> {
        vec![Output::alone(&plan[me].file, keys.of(me.index()).to_owned())]
    }

    fn parts(me: Ref<Self>, plan: &Plan, keys: &Keys, piece: Piece) -> Vec<Output> {
        let list = (piece.index() == 0).then(|| piece::list_of(&plan[me].file));
        let part = |output: Output| Output { beside: list.clone().into_iter().collect(), ..output };
        Self::outputs(me, plan, keys).into_iter().map(part).collect()
    }

    fn retell(_: Ref<Self>, plan: &Plan, output: &Path, text: &str) -> Result<u64, io::Error> {
        vtu::retell(&plan.out.join(output), text)
    }

    fn line(me: Ref<Self>, plan: &Plan, counts: &[Counts]) -> String {
        let MeshPlan { scene, occlusion, file } = &plan[me];
        let with = occlusion.map_or("without occlusion".into(), |occlusion| format!("with {}", plan.id(occlusion)));
        let simplices = counts.get(scene.nth()).map(|c| format!(", {} simplices", grouped(c.simplices)));
        format!("{} {with}{} -> {}", plan.id(*scene), simplices.unwrap_or_default(), file.display())
    }

    fn run<const D: usize>(me: Ref<Self>, run: &mut Run, scene: &mut SceneRun<D>) -> Result<Told, StageError> {
        let plan = run.plan;
        let MeshPlan { occlusion, file, .. } = &plan[me];
        if !run.is_stale(file) {
            return Ok("as it was".into());
        }
        if let Some(occlusion) = *occlusion {
            occlusion::values(occlusion, run, scene)?;
        }
        let mesh = scene.session.mesh();
        let points: Vec<[f32; 3]> = mesh.vertices.iter().map(vtu::first_three).collect();
        let values = occlusion.map(|occlusion| &*scene.values[&occlusion]);
        let list = piece::list_of(file);
        let part = plan.piece.map(|piece| MeshPart::of(piece, mesh.vertices.len(), file, &list));
        let is_list = part.as_ref().is_some_and(|part| part.list.is_some());
        let bytes = vtu::write(
            &plan.out.join(file),
            run.told,
            mesh,
            &points,
            &mesh.simplices,
            Found { values, vectors: None },
            part,
        )?;
        if is_list {
            run.made_beside(&list, 0)?;
        }
        run.made(file, bytes, Vec::new())?;
        Ok(Told::default())
    }
}
