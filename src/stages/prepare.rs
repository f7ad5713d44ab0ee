//! Everything that reads inputs, before anything is computed or written: scenes are built, loaded occlusion files are
//! held against them. `ao4d check` stops here; `ao4d run` goes on from here, so both refuse the same things.

use std::path::{Path, PathBuf};

use super::occlusion::{Method, OcclusionPlan, OcclusionSource};
use super::scene::{AnyMesh, ScenePlan};
use super::{Counts, Invalid, Plan, Ref};
use crate::occlusion::{self, Estimates, Sidecar};
use crate::progress::Progress;

/// A pipeline's inputs, read and checked.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// One for each scene that was asked for.
    pub meshes: Vec<Option<AnyMesh>>,
    /// The values of each occlusion that is loaded from a file, if its scene was asked for.
    pub loaded: Vec<Option<Loaded>>,
    /// What is allowed but worth telling of each scene's objects.
    pub notes: Vec<Vec<String>>,
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
    pub fn counts(&self) -> Vec<Counts> {
        self.meshes.iter().map(|mesh| mesh.as_ref().map_or_else(Counts::default, AnyMesh::counts)).collect()
    }
}

impl Plan {
    /// Builds the scenes for which `wanted` says so, reads the occlusion files that are loaded into them and wanted too, and
    /// checks what else is read by stages that are wanted; all by their places in the plan.
    ///
    /// # Errors
    /// Whatever is wrong with an object or a file; anything if `progress` says to stop.
    pub fn prepare(&self, wanted: impl Fn(usize) -> bool, progress: &dyn Progress) -> Result<Prepared, Invalid> {
        let mut prepared = Prepared { meshes: Vec::new(), loaded: Vec::new(), notes: Vec::new() };
        for (scene, _) in self.all::<ScenePlan>() {
            let mut notes = Vec::new();
            let mesh = wanted(scene.index()).then(|| AnyMesh::build(self, scene, &mut notes, progress)).transpose()?;
            prepared.meshes.push(mesh);
            prepared.notes.push(notes);
        }
        for (occlusion, plan) in self.all::<OcclusionPlan>() {
            let mesh = prepared.meshes[plan.scene.nth()].as_ref().filter(|_| wanted(occlusion.index()));
            prepared.loaded.push(match (&plan.source, mesh) {
                (OcclusionSource::Load(file), Some(mesh)) => Some(self.load(occlusion, file, mesh)?),
                _ => None,
            });
        }
        (0..self.stages.len()).filter(|&stage| wanted(stage)).try_for_each(|stage| self.check_inputs(stage))?;
        Ok(prepared)
    }

    /// Reads an occlusion file for a mesh.
    fn load(&self, occlusion: Ref<OcclusionPlan>, file: &Path, mesh: &AnyMesh) -> Result<Loaded, Invalid> {
        let (hash, vertices) = match mesh {
            AnyMesh::Three(m) => (m.content_hash(), m.vertices.len()),
            AnyMesh::Four(m) => (m.content_hash(), m.vertices.len()),
        };
        let blame = |message| Invalid::new(format!("{}.load", self.path(occlusion)), message);
        read_values(file, &hash, vertices).map_err(blame)
    }
}

/// Reads what an earlier run has left of an occlusion; nothing if it can't be used.
pub(super) fn kept(file: &Path, hash: &str, vertices: usize) -> Option<Estimates> {
    let Loaded { values, errors, .. } = read_values(file, hash, vertices).ok()?;
    (errors.len() == values.len()).then_some(Estimates { values, errors, rays: 0 })
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

/// Reads an occlusion file for the mesh with this hash and number of vertices.
fn read_values(file: &Path, hash: &str, vertices: usize) -> Result<Loaded, String> {
    let side = sidecar_path(file);
    let unreadable = |path: &Path, cause: std::io::Error| format!("can't read {}: {cause}", path.display());
    let text = crate::input::read_text(&side).map_err(|e| unreadable(&side, e))?;
    let bytes = crate::input::read(file).map_err(|e| unreadable(file, e))?;
    let unusable = |path: &Path, cause: String| format!("can't use {}: {cause}", path.display());
    let sidecar = Sidecar::from_yaml(&text).and_then(|s| s.check(hash, vertices).map(|()| s));
    let sidecar = sidecar.map_err(|e| unusable(file, e.to_string()))?;
    let values = occlusion::decode(&bytes, vertices).map_err(|e| unusable(file, e.to_string()))?;
    let beside = errors_path(file);
    // The closed form leaves none, so a file that is there is of other values.
    if sidecar.method == Method::Exact.as_str() {
        return Ok(Loaded { values, errors: vec![0.0; vertices], sidecar });
    }
    let errors = match crate::input::read(&beside) {
        Ok(bytes) => occlusion::decode(&bytes, vertices).map_err(|e| unusable(&beside, e.to_string()))?,
        Err(_) => Vec::new(),
    };
    let found = Estimates { values, errors, rays: 0 };
    // The sidecar has six digits of their root mean square.
    if !found.errors.is_empty() && (found.error() - sidecar.error_estimate).abs() > 1e-6 {
        let message = format!(
            "it holds the errors of other values: {:.6} in the mean, where {} says {:.6}; delete it, or compute the \
             values again",
            found.error(),
            side.display(),
            sidecar.error_estimate
        );
        return Err(unusable(&beside, message));
    }
    let Estimates { values, errors, .. } = found;
    Ok(Loaded { values, errors, sidecar })
}
