//! Keys: what decides the bytes of a file, as one hash.
//!
//! A stage's key is the hash of its kind, of its plan as JSON, of the keys of the stages it works on, and of the content of
//! every file it reads. A field takes part by being there; leaving one out takes a line in the stage's `LEFT_OUT`, with the
//! reason. Plans are serialised whole for that, so `#[serde(skip)]` has no place in them.
//!
//! Inputs are hashed as streams, never held as a whole. What was hashed is remembered by its size and times, so that
//! [`Inputs::changed`] can tell whether what was read later is the same. An input that can't be read whole gets a key that
//! nothing ever had or will have: what is made of it is never taken for fresh.

use std::collections::BTreeMap;
use std::fs::Metadata;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use serde::Serialize;
use serde_json::Value;
use sha2::{Digest, Sha256};

use super::{Piece, Plan};

/// A field that a key leaves out, and why no byte of a result depends on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeftOut {
    /// Where it is in the plan's JSON, as `/samples/fixed`.
    pub field: &'static str,
    /// Why.
    pub reason: &'static str,
}

impl LeftOut {
    /// The field at `field`, for this reason.
    pub const fn new(field: &'static str, reason: &'static str) -> Self {
        Self { field, reason }
    }
}

/// A file that a stage leaves.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Output {
    /// Its path below the output folder.
    pub file: PathBuf,
    /// Files without which it is of no use, and which are made with it.
    pub beside: Vec<PathBuf>,
    /// What decides its bytes, but for what it tells of the pipeline as a whole.
    pub key: String,
    /// Which of these files tells of the pipeline as a whole, if one does.
    pub tells: Option<PathBuf>,
}

impl Output {
    /// A file that stands alone, and tells of the pipeline itself.
    pub fn alone(file: &Path, key: String) -> Self {
        Self { file: file.to_owned(), beside: Vec::new(), key, tells: Some(file.to_owned()) }
    }
}

/// A file changed within this time before it was hashed may change again without its times telling.
const COARSE: Duration = Duration::from_secs(2);
/// Bytes hashed at a time.
const CHUNK: usize = 1 << 18;

/// The files that a pipeline reads, as they were when they were hashed.
#[derive(Clone, Debug, Default)]
pub struct Inputs {
    files: BTreeMap<PathBuf, Option<Hashed>>,
}

#[derive(Clone, Debug, PartialEq)]
struct Hashed {
    stamp: Stamp,
    hash: String,
    /// Whether another change could leave the stamp as it is.
    recent: bool,
}

/// What a file's metadata tell of its content.
#[derive(Clone, Debug, PartialEq)]
struct Stamp {
    bytes: u64,
    modified: Option<SystemTime>,
    /// Device, inode, and when those changed: a file that was put in the place of another has others.
    identity: [i64; 4],
}

impl Stamp {
    fn new(metadata: &Metadata) -> Self {
        #[cfg(unix)]
        let identity = {
            use std::os::unix::fs::MetadataExt;
            [metadata.dev().cast_signed(), metadata.ino().cast_signed(), metadata.ctime(), metadata.ctime_nsec()]
        };
        #[cfg(not(unix))]
        let identity = [0; 4];
        Self { bytes: metadata.len(), modified: metadata.modified().ok(), identity }
    }
}

impl Inputs {
    /// The hash of a file's content; none if there is no such file.
    fn hash(&mut self, path: &Path) -> Option<String> {
        let known = self.files.entry(path.to_owned()).or_insert_with(|| match std::fs::symlink_metadata(path) {
            Err(_) => None,
            Ok(_) => Some(hash_file(path).unwrap_or_else(|| Hashed {
                stamp: Stamp { bytes: 0, modified: None, identity: [0; 4] },
                hash: unique(),
                recent: true,
            })),
        });
        known.as_ref().map(|hashed| hashed.hash.clone())
    }

    /// The files that there are, each with the SHA-256 of its content.
    pub fn hashes(&self) -> impl Iterator<Item = (&Path, &str)> {
        self.files.iter().filter_map(|(path, known)| Some((path.as_path(), known.as_ref()?.hash.as_str())))
    }

    /// The first file that is no longer what was hashed.
    pub fn changed(&self) -> Option<&Path> {
        let same = |path: &Path, known: &Option<Hashed>| match (known, std::fs::metadata(path)) {
            (None, found) => found.is_err(),
            (Some(_), Err(_)) => false,
            (Some(known), Ok(metadata)) => {
                // Of what couldn't be hashed nothing is known; its key is unlike any other already.
                known.stamp.modified.is_none()
                    || known.stamp == Stamp::new(&metadata)
                        && (!known.recent || hash_file(path).is_some_and(|again| again.hash == known.hash))
            }
        };
        self.files.iter().find(|(path, known)| !same(path, known)).map(|(path, _)| path.as_path())
    }
}

/// The SHA-256 of a regular file's content, in hexadecimal digits; none if it can't be read whole, or changes meanwhile.
pub fn sha256(path: &Path) -> Option<String> {
    hash_file(path).map(|hashed| hashed.hash)
}

/// The content of a regular file, hashed; none if it can't be read whole, or changes meanwhile.
fn hash_file(path: &Path) -> Option<Hashed> {
    let mut file = crate::input::open(path).ok()?;
    let stamp = Stamp::new(&file.metadata().ok()?);
    let (mut hasher, mut chunk, mut bytes) = (Sha256::new(), vec![0; CHUNK], 0);
    loop {
        match file.read(&mut chunk).ok()? {
            0 => break,
            n => {
                hasher.update(&chunk[..n]);
                bytes += n as u64;
            }
        }
    }
    let unchanged = bytes == stamp.bytes && stamp == Stamp::new(&file.metadata().ok()?);
    let age = stamp.modified.and_then(|then| SystemTime::now().duration_since(then).ok());
    unchanged.then(|| Hashed { stamp, hash: hex(&hasher.finalize()), recent: age.is_none_or(|age| age < COARSE) })
}

/// A text that stands nowhere else.
fn unique() -> String {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_nanos();
    static COUNT: std::sync::atomic::AtomicU64 = std::sync::atomic::AtomicU64::new(0);
    let count = COUNT.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    format!("unreadable {now} {} {count}", std::process::id())
}

/// The keys of a plan's stages.
#[derive(Clone, Debug)]
pub struct Keys {
    /// Of each stage as a whole.
    stages: Vec<String>,
    inputs: Inputs,
    /// What decides that part of the bytes of images which is neither seen nor told by every file alike.
    provenance: String,
}

impl Keys {
    /// Hashes what decides each stage's result; reads the files that are inputs.
    pub fn new(plan: &Plan) -> Self {
        let mut keys = Self { stages: Vec::new(), inputs: Inputs::default(), provenance: String::new() };
        keys.provenance = keys.hash(&(&plan.name, plan.seed));
        for index in 0..plan.stages.len() {
            let key = keys.stage(plan, index, plan.left_out(index));
            keys.stages.push(key);
        }
        keys
    }

    /// The key of a stage, with these fields left out.
    fn stage(&mut self, plan: &Plan, index: usize, left_out: &[LeftOut]) -> String {
        let contents: Vec<_> = plan.input_files(index).iter().map(|path| self.inputs.hash(path)).collect();
        let base = self.part(plan, index, left_out);
        self.hash(&(base, contents))
    }

    /// A key of the stage at this place without the files it reads, and with other fields left out than [`Keys::of`]
    /// leaves out: for what depends on less, or more, of it.
    pub fn part(&self, plan: &Plan, index: usize, left_out: &[LeftOut]) -> String {
        let below: Vec<&str> = plan.works_on(index).iter().map(|&stage| self.of(stage)).collect();
        let fields = without(plan.fields(index), left_out);
        self.hash(&(program(), plan.kind(index), fields, below, plan.depends_on(index)))
    }

    /// The key of the stage at this place of the plan.
    pub fn of(&self, index: usize) -> &str {
        &self.stages[index]
    }

    /// What the settings that images tell depend on beside their stages: the pipeline's name and seed.
    pub fn provenance(&self) -> &str {
        &self.provenance
    }

    /// The files that were hashed.
    pub fn inputs(&self) -> &Inputs {
        &self.inputs
    }

    /// A hash over anything that can be written as JSON.
    pub fn hash(&self, parts: &impl Serialize) -> String {
        match serde_json::to_vec(parts) {
            Ok(text) => hex(&Sha256::digest(text)),
            Err(_) => unique(),
        }
    }
}

impl Plan {
    /// All fields of a stage's plan.
    pub fn fields(&self, index: usize) -> Value {
        serde_json::to_value(&self.stages[index].plan).unwrap_or_else(|_| unique().into())
    }
}

/// JSON without some fields.
pub fn without(mut fields: Value, left_out: &[LeftOut]) -> Value {
    for LeftOut { field, .. } in left_out {
        let (above, name) = field.rsplit_once('/').unwrap_or_default();
        if let Some(Value::Object(map)) = fields.pointer_mut(above) {
            map.shift_remove(name);
        }
    }
    fields
}

/// The program: its version, and which build of it this is, so that a new build trusts nothing an older one made.
pub fn program() -> String {
    let build = std::env::current_exe().and_then(std::fs::metadata).and_then(|m| Ok((m.len(), m.modified()?)));
    format!("{} {build:?}", env!("CARGO_PKG_VERSION"))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}
impl Plan {
    /// The files that a stage leaves and the cache knows, each with its key; of a piece its parts.
    pub fn left(&self, index: usize, keys: &Keys) -> Vec<Output> {
        match self.piece {
            None => self.outputs(index, keys),
            Some(piece) => self.left_by(index, keys, piece),
        }
    }

    /// The same of a piece, with keys that know it.
    pub fn left_by(&self, index: usize, keys: &Keys, piece: Piece) -> Vec<Output> {
        let keyed =
            |output: Output| Output { key: keys.hash(&(&output.key, "piece", piece.index(), piece.count())), ..output };
        self.parts(index, keys, piece).into_iter().map(keyed).collect()
    }
}
