//! What earlier runs left, so that a second run recomputes nothing whose inputs are unchanged.
//!
//! Every output has a key: a hash over all that decides its bytes, which are the program, the scene as written, the
//! contents of the files it names, and the settings of the stages on the way. A small file in the output folder holds
//! the key, length and time of each output. An output is fresh if its key is the one it would get now and the file is
//! still the one that was written. Whoever deletes, edits or moves an output only makes the next run compute it again.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::plan::{OcclusionSource, Plan, ScenePlan, WritePlan};
use super::prepare::{errors_path, sidecar_path};
use crate::io::{self, AtomicFile};
use crate::scene::Orientation;

/// The file's name in the output folder.
const NAME: &str = ".ao4d-cache.json";

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Entry {
    key: String,
    bytes: u64,
    /// Nanoseconds since 1970, as text, since JSON numbers are doubles.
    modified: String,
}

/// What is known of the files in an output folder.
#[derive(Clone, Debug)]
pub struct Cache {
    folder: PathBuf,
    entries: BTreeMap<String, Entry>,
    force: bool,
}

impl Cache {
    /// Reads what is known; nothing if there is nothing, or nothing readable. With `force` nothing counts as fresh.
    pub fn open(folder: &Path, force: bool) -> Self {
        let text = crate::input::read_text(&folder.join(NAME)).unwrap_or_default();
        Self { folder: folder.to_owned(), entries: serde_json::from_str(&text).unwrap_or_default(), force }
    }

    /// Whether the file is there as the run that had this key left it.
    pub fn is_fresh(&self, file: &Path, key: &str) -> bool {
        let known = self.entries.get(&file.to_string_lossy()[..]);
        !self.force && known.is_some_and(|e| e.key == key && self.state(file, key).as_ref() == Some(e))
    }

    fn state(&self, file: &Path, key: &str) -> Option<Entry> {
        let metadata = std::fs::metadata(self.folder.join(file)).ok()?;
        let modified = metadata.modified().ok()?.duration_since(UNIX_EPOCH).ok()?.as_nanos().to_string();
        Some(Entry { key: key.to_owned(), bytes: metadata.len(), modified })
    }

    /// Remembers a file that was just written, and that on disk.
    ///
    /// # Errors
    /// If the folder can't be written to.
    pub fn record(&mut self, file: &Path, key: &str) -> Result<(), io::Error> {
        if let Some(entry) = self.state(file, key) {
            self.entries.insert(file.to_string_lossy().into_owned(), entry);
        }
        let text = serde_json::to_string_pretty(&self.entries).unwrap_or_default();
        let mut out = AtomicFile::create(self.folder.join(NAME))?;
        out.write_all(text.as_bytes())?;
        out.commit().map(|_| ())
    }
}

/// The keys of a plan's stages.
#[derive(Clone, Debug)]
pub struct Keys {
    occlusions: Vec<String>,
    renders: Vec<String>,
    /// Of each render's scene as its camera sees it, whatever the picture is like.
    meshes: Vec<String>,
    /// What images tell of the pipeline as a whole.
    provenance: String,
}

impl Keys {
    /// Hashes what decides each stage's result; reads the files that are inputs.
    pub fn new(plan: &Plan) -> Self {
        let program = program();
        let scenes: Vec<String> = (plan.scenes.iter().enumerate())
            .map(|(i, scene)| {
                // The first camera matters to what is turned to face it, and to nothing else.
                let faces_eye = scene.objects.iter().any(|o| o.orientation == Orientation::Eye);
                let first = plan.renders.iter().find(|r| r.scene == i && faces_eye).map(|r| &r.camera);
                let inputs: Vec<String> = inputs(plan, scene).iter().map(|path| content(path)).collect();
                key(&(&program, scene.dimension, &scene.objects, first, inputs))
            })
            .collect();
        let occlusions: Vec<String> = (plan.occlusions.iter())
            .map(|occlusion| match &occlusion.source {
                OcclusionSource::Load(file) => {
                    let beside = [sidecar_path(file), errors_path(file)].map(|path| content(&path));
                    key(&(&scenes[occlusion.scene], content(file), beside))
                }
                OcclusionSource::Compute(computation) => key(&(&scenes[occlusion.scene], computation)),
            })
            .collect();
        let meshes: Vec<String> = (plan.renders.iter())
            .map(|render| key(&(&scenes[render.scene], render.occlusion.map(|o| &occlusions[o]), &render.camera)))
            .collect();
        let renders = (plan.renders.iter().zip(&meshes))
            .map(|(render, mesh)| key(&(mesh, render.dimensions, render.shading)))
            .collect();
        Self { occlusions, renders, meshes, provenance: key(&(&plan.name, plan.seed)) }
    }

    /// The key of an occlusion file.
    pub fn occlusion(&self, index: usize) -> &str {
        &self.occlusions[index]
    }

    /// The key of one of a write's files, by its kind.
    pub fn file(&self, write: &WritePlan, kind: &str) -> String {
        match kind {
            "vti" => {
                let how = (&write.arrays, write.encoding, write.compression);
                key(&(&self.renders[write.render], kind, &self.provenance, how))
            }
            "vtu" => key(&(&self.meshes[write.render], kind)),
            _ => key(&(&self.renders[write.render], kind)),
        }
    }
}

/// The files that a scene reads.
fn inputs(plan: &Plan, scene: &ScenePlan) -> Vec<PathBuf> {
    let shapes = scene.objects.iter().filter_map(|o| o.shape().ok());
    shapes.flat_map(|s| s.input_files().into_iter().map(|f| plan.folder.join(f)).collect::<Vec<_>>()).collect()
}

/// The program: its version, and which build of it this is, so that a new build trusts nothing an older one made.
fn program() -> String {
    let build = std::env::current_exe().and_then(std::fs::metadata).and_then(|m| Ok((m.len(), m.modified()?)));
    format!("{} {build:?}", env!("CARGO_PKG_VERSION"))
}

/// A hash over anything that can be written as JSON.
fn key(parts: &impl Serialize) -> String {
    hex(&Sha256::digest(serde_json::to_vec(parts).unwrap_or_default()))
}

/// A hash over a file's content; of nothing if it can't be read, which whoever needs it will find out.
fn content(path: &Path) -> String {
    hex(&Sha256::digest(crate::input::read(path).unwrap_or_default()))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_fresh_until_key_or_content_change() {
        let folder = tempfile::tempdir().unwrap();
        let file = Path::new("a.vti");
        std::fs::write(folder.path().join(file), "one").unwrap();
        let mut cache = Cache::open(folder.path(), false);
        assert!(!cache.is_fresh(file, "k"));
        cache.record(file, "k").unwrap();
        let cache = Cache::open(folder.path(), false);
        assert!(cache.is_fresh(file, "k") && !cache.is_fresh(file, "l"));
        assert!(!Cache::open(folder.path(), true).is_fresh(file, "k"));
        std::fs::write(folder.path().join(file), "other").unwrap();
        assert!(!cache.is_fresh(file, "k"));
        std::fs::remove_file(folder.path().join(file)).unwrap();
        assert!(!cache.is_fresh(file, "k"));
        std::fs::write(folder.path().join(NAME), "{broken").unwrap();
        assert!(!Cache::open(folder.path(), false).is_fresh(file, "k"));
    }
}
