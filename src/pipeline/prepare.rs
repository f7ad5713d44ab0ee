//! Everything that reads inputs, before anything is computed or written: scenes are built, loaded occlusion files are
//! held against them. `ao4d check` stops here; `ao4d run` goes on from here, so both refuse the same things.

use std::path::{Path, PathBuf};

use super::build::AnyMesh;
use super::plan::{OcclusionSource, Plan, SceneCounts};
use super::{Error, Invalid, Pipeline};
use crate::occlusion::{self, Sidecar};

/// A pipeline's inputs, read and checked.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// One for each scene that was asked for.
    pub meshes: Vec<Option<AnyMesh>>,
    /// The values of each occlusion that is loaded from a file, if its scene was asked for.
    pub loaded: Vec<Option<Loaded>>,
    /// What is allowed but worth telling of the scenes' objects.
    pub notes: Vec<String>,
}

/// An occlusion that was computed before.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// One value a vertex.
    pub values: Vec<f32>,
    /// Their standard errors; empty if nothing is known of them.
    pub errors: Vec<f32>,
    /// What stands beside them.
    pub sidecar: Sidecar,
}

impl Prepared {
    /// How much is in each scene; nothing in those that weren't asked for.
    pub fn counts(&self) -> Vec<SceneCounts> {
        let none = SceneCounts { vertices: 0, simplices: 0 };
        self.meshes.iter().map(|m| m.as_ref().map_or(none, AnyMesh::counts)).collect()
    }
}

impl Pipeline {
    /// Builds the scenes for which `wanted` says so, and reads the occlusion files that are loaded into them.
    ///
    /// # Errors
    /// Whatever is wrong with an object or a file, with the line that asked for it.
    pub fn prepare(&self, wanted: impl Fn(usize) -> bool) -> Result<Prepared, Error> {
        prepare(&self.plan, wanted).map_err(|invalid| self.document.refuse(invalid))
    }
}

fn prepare(plan: &Plan, wanted: impl Fn(usize) -> bool) -> Result<Prepared, Invalid> {
    let (mut meshes, mut notes) = (Vec::with_capacity(plan.scenes.len()), Vec::new());
    for scene in 0..plan.scenes.len() {
        meshes.push(if wanted(scene) { Some(AnyMesh::build(plan, scene, &mut notes)?) } else { None });
    }
    let mut loaded = Vec::with_capacity(plan.occlusions.len());
    for occlusion in &plan.occlusions {
        loaded.push(match (&occlusion.source, &meshes[occlusion.scene]) {
            (OcclusionSource::Load(file), Some(mesh)) => {
                let blame = |message| Invalid::new(format!("{}.load", occlusion.path), message);
                Some(load(file, mesh).map_err(blame)?)
            }
            _ => None,
        });
    }
    Ok(Prepared { meshes, loaded, notes })
}

/// The sidecar's path: `NAME.f32.yaml` beside `NAME.f32`.
pub(super) fn sidecar_path(file: &Path) -> PathBuf {
    let mut name = file.as_os_str().to_owned();
    name.push(".yaml");
    PathBuf::from(name)
}

/// The path of the values' standard errors: `NAME.error.f32` beside `NAME.f32`.
pub(super) fn errors_path(file: &Path) -> PathBuf {
    file.with_extension("error.f32")
}

/// Reads an occlusion file for a mesh.
fn load(file: &Path, mesh: &AnyMesh) -> Result<Loaded, String> {
    let (hash, vertices) = match mesh {
        AnyMesh::Three(m) => (m.content_hash(), m.vertices.len()),
        AnyMesh::Four(m) => (m.content_hash(), m.vertices.len()),
    };
    read_values(file, &hash, vertices)
}

/// Reads an occlusion file for the mesh with this hash and number of vertices.
pub(super) fn read_values(file: &Path, hash: &str, vertices: usize) -> Result<Loaded, String> {
    let side = sidecar_path(file);
    let unreadable = |path: &Path, cause: std::io::Error| format!("can't read {}: {cause}", path.display());
    let text = crate::input::read_text(&side).map_err(|e| unreadable(&side, e))?;
    let bytes = crate::input::read(file).map_err(|e| unreadable(file, e))?;
    let unusable = |path: &Path, cause: String| format!("can't use {}: {cause}", path.display());
    let sidecar = Sidecar::from_yaml(&text).and_then(|s| s.check(hash, vertices).map(|()| s));
    let sidecar = sidecar.map_err(|e| unusable(file, e.to_string()))?;
    let values = occlusion::decode(&bytes, vertices).map_err(|e| unusable(file, e.to_string()))?;
    let beside = errors_path(file);
    let errors = match crate::input::read(&beside) {
        Ok(bytes) => occlusion::decode(&bytes, vertices).map_err(|e| unusable(&beside, e.to_string()))?,
        // The closed form leaves none.
        Err(_) if sidecar.error_estimate == 0.0 => vec![0.0; vertices],
        Err(_) => Vec::new(),
    };
    Ok(Loaded { values, errors, sidecar })
}
