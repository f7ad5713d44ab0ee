//! What earlier runs left, so that a second run recomputes nothing whose inputs are unchanged.
//!
//! Every output has a key, a hash over all that decides its bytes ([`crate::stages::key`]). A small file in the output
//! folder holds the key, length and time of each output, and what was told of it. An output is fresh if its key is the
//! one it would get now and the file is still the one that was written. Whoever deletes, edits or moves an output only
//! makes the next run compute it again.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use serde::{Deserialize, Serialize};

use crate::io::{self, AtomicFile};

/// The file's name in the output folder.
pub(super) const NAME: &str = ".ao4d-cache.json";

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Entry {
    key: String,
    bytes: u64,
    /// Nanoseconds since 1970, as text, since JSON numbers are doubles.
    modified: String,
    /// What the user was told of it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    notes: Vec<String>,
    /// The hash of what it tells of the pipeline.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    told: Option<String>,
    /// Where the pipeline was whose inputs it is made of.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    folder: Option<String>,
}

/// What a file was made by.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MadeBy {
    /// The hash of what files tell of the pipeline.
    pub told: String,
    /// Where paths of inputs start, as an absolute path.
    pub folder: Option<String>,
}

/// Where the pipeline was that a file was made by, if the file still is in its output folder.
pub fn folder_of(file: &Path) -> Option<PathBuf> {
    let file = file.canonicalize().ok()?;
    file.ancestors().skip(1).find_map(|out| {
        let entries = Cache::open(out, false).entries;
        let entry = entries.get(&file.strip_prefix(out).ok()?.to_string_lossy()[..])?;
        entry.folder.as_ref().map(PathBuf::from)
    })
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
        let found = || self.state(file);
        !self.force && known.is_some_and(|e| e.key == key && found() == Some((e.bytes, e.modified.clone())))
    }

    /// Whether the file tells of the pipeline what has this hash.
    pub fn tells(&self, file: &Path, told: &str) -> bool {
        self.entries.get(&file.to_string_lossy()[..]).is_some_and(|entry| entry.told.as_deref() == Some(told))
    }

    /// What the user was told of a file.
    pub fn notes(&self, file: &Path) -> &[String] {
        self.entries.get(&file.to_string_lossy()[..]).map_or(&[], |entry| &entry.notes)
    }

    /// A file's length and time.
    fn state(&self, file: &Path) -> Option<(u64, String)> {
        let metadata = std::fs::metadata(self.folder.join(file)).ok().filter(std::fs::Metadata::is_file)?;
        let modified = metadata.modified().ok()?.duration_since(UNIX_EPOCH).ok()?.as_nanos().to_string();
        Some((metadata.len(), modified))
    }

    /// Remembers a file that was just written, and that on disk.
    ///
    /// # Errors
    /// If the folder can't be written to.
    pub fn record(&mut self, file: &Path, key: &str, notes: Vec<String>, by: &MadeBy) -> Result<(), io::Error> {
        if let Some((bytes, modified)) = self.state(file) {
            let (told, folder) = (Some(by.told.clone()), by.folder.clone());
            let entry = Entry { key: key.to_owned(), bytes, modified, notes, told, folder };
            self.entries.insert(file.to_string_lossy().into_owned(), entry);
        }
        self.save()
    }

    /// Forgets a file.
    ///
    /// # Errors
    /// If the folder can't be written to.
    pub fn forget(&mut self, file: &Path) -> Result<(), io::Error> {
        self.entries.remove(&file.to_string_lossy()[..]);
        self.save()
    }

    fn save(&self) -> Result<(), io::Error> {
        let text = serde_json::to_string_pretty(&self.entries).unwrap_or_default();
        let mut out = AtomicFile::create(self.folder.join(NAME))?;
        out.write_all(text.as_bytes())?;
        out.commit().map(|_| ())
    }
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
        let by = MadeBy { told: "t".to_owned(), folder: None };
        cache.record(file, "k", vec!["note".to_owned()], &by).unwrap();
        let cache = Cache::open(folder.path(), false);
        assert!(cache.is_fresh(file, "k") && !cache.is_fresh(file, "l"));
        assert_eq!(cache.notes(file), ["note"]);
        assert!(cache.tells(file, "t") && !cache.tells(file, "u"));
        assert_eq!(folder_of(&folder.path().join(file)), None);
        let mut cache = cache;
        let by = MadeBy { folder: Some("/where".to_owned()), ..by };
        cache.record(file, "k", Vec::new(), &by).unwrap();
        assert_eq!(folder_of(&folder.path().join(file)), Some(PathBuf::from("/where")));
        assert!(!Cache::open(folder.path(), true).is_fresh(file, "k"));
        std::fs::write(folder.path().join(file), "other").unwrap();
        assert!(!cache.is_fresh(file, "k"));
        std::fs::remove_file(folder.path().join(file)).unwrap();
        assert!(!cache.is_fresh(file, "k"));
        std::fs::write(folder.path().join(NAME), "{broken").unwrap();
        assert!(!Cache::open(folder.path(), false).is_fresh(file, "k"));
    }
}
