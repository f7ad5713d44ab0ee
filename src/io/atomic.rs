//! The one place that opens output files: a file appears under its final name only when it is whole.
//!
//! Bytes go to a temporary file beside the final one, hence on the same disk, and [`AtomicFile::commit`] renames it. A
//! file that is dropped before that takes its temporary file with it, so a failed or cancelled run leaves what was
//! there before. A process that can't wait for that calls [`abandon`] before it ends. Only one that is killed outright
//! leaves a `.NAME.*.partial` behind. The rename survives the
//! process, but a power failure right after it may still lose what the system had not yet written.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard};

use tempfile::NamedTempFile;

use super::Error;

/// Bytes collected before the system is asked to write.
const BUFFER: usize = 1 << 18;

/// Files that have to go if the process ends before they are whole.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
/// Held while files that belong together get their final names.
static TOGETHER: RwLock<()> = RwLock::new(());

/// A file, or a folder if it is empty then, that goes with the process, should that be ended in the middle of its work.
#[derive(Debug)]
pub struct Unfinished(PathBuf);

impl Unfinished {
    /// Remembers a file until this is dropped.
    pub fn new(path: PathBuf) -> Self {
        unfinished().insert(path.clone());
        Self(path)
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        unfinished().remove(&self.0);
    }
}

fn unfinished() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Files that get their final names while this is held do so all, or none of them.
pub fn together() -> RwLockReadGuard<'static, ()> {
    TOGETHER.read().unwrap_or_else(PoisonError::into_inner)
}

/// Takes away all files that aren't whole, and folders that were made for them. From then on no file gets its final name, and who tries to waits for ever: the
/// process is to end at once.
pub fn abandon() {
    std::mem::forget(TOGETHER.write());
    let files = unfinished();
    // What is in a folder goes before the folder.
    for path in files.iter().rev() {
        let _ = std::fs::remove_file(path).or_else(|_| std::fs::remove_dir(path));
    }
    std::mem::forget(files);
}

/// A file that does not exist until it is committed.
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    file: BufWriter<NamedTempFile>,
    unfinished: Unfinished,
}

impl AtomicFile {
    /// A file that is to appear as `path`. Folders on the way are made.
    ///
    /// # Errors
    /// If the folder can't be made or written to, or `path` is a folder.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self, Error> {
        let path = path.into();
        let failed = |action, path: &Path| {
            let path = path.to_path_buf();
            move |cause| Error::File { path, action, cause }
        };
        if path.is_dir() || path.file_name().is_none() {
            return Err(failed("be written", &path)(io::Error::from(io::ErrorKind::IsADirectory)));
        }
        let folder = match path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        std::fs::create_dir_all(folder).map_err(failed("make the folder", folder))?;
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let prefix = format!(".{name}.");
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix).suffix(".partial");
        // A temporary file is its owner's alone by default; the final file should be as any other.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let file = {
            let mut files = unfinished();
            let file = builder.tempfile_in(folder).map_err(failed("be written", &path))?;
            files.insert(file.path().to_owned());
            file
        };
        let unfinished = Unfinished(file.path().to_owned());
        Ok(Self { path, file: BufWriter::with_capacity(BUFFER, file), unfinished })
    }

    /// The final path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes out what is left and gives the file its final name, in place of one that is there. Returns its length.
    ///
    /// # Errors
    /// If the disk is full or the file cannot be renamed; it is gone then.
    pub fn commit(mut self) -> Result<u64, Error> {
        let path = self.path;
        let failed = |action| {
            let path = path.clone();
            move |cause| Error::File { path, action, cause }
        };
        self.file.flush().map_err(failed("be written"))?;
        let length = self.file.seek(SeekFrom::End(0)).map_err(failed("be written"))?;
        let file = self.file.into_inner().map_err(|e| failed("be written")(e.into_error()))?;
        let mut files = unfinished();
        let _: File = file.persist(&path).map_err(|e| failed("be put in place")(e.error))?;
        files.remove(&self.unfinished.0);
        Ok(length)
    }

    /// Names the file in an error that came from a writer over it.
    pub fn name_in(path: &Path) -> impl Fn(Error) -> Error + use<> {
        let path = path.to_path_buf();
        move |error| match error {
            Error::Write(cause) => Error::File { path: path.clone(), action: "be written", cause },
            other => other,
        }
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

/// Bytes that the disk of `path` has left for this user, if that can be told. The path need not exist yet.
pub fn free_space(path: &Path) -> Option<u64> {
    let absolute = std::path::absolute(path).ok()?;
    absolute.ancestors().find(|p| p.exists()).and_then(|p| fs4::available_space(p).ok())
}

/// Refuses beforehand what does not fit on the disk.
///
/// # Errors
/// If the disk is known to have less than `needed` bytes left.
pub fn check_free_space(path: &Path, needed: u64) -> Result<(), Error> {
    match free_space(path) {
        Some(free) if free < needed => Err(Error::NoSpace { path: path.into(), needed, free }),
        _ => Ok(()),
    }
}

/// Refuses beforehand a folder that files can't be put into; makes it if it isn't there.
///
/// # Errors
/// If the folder can't be made or written to.
pub fn check_writable(folder: &Path) -> Result<(), Error> {
    AtomicFile::create(folder.join("probe")).map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_there_until_commit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/b.vti");
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, "before").unwrap();
        let entries = || std::fs::read_dir(path.parent().unwrap()).unwrap().count();
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"0123456789").unwrap();
        assert_eq!(entries(), 2);
        drop(file);
        assert_eq!((entries(), std::fs::read(&path).unwrap().as_slice()), (1, b"before".as_slice()));

        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"0123456789").unwrap();
        file.seek(SeekFrom::Start(3)).unwrap();
        file.write_all(b"x").unwrap();
        assert_eq!(file.commit().unwrap(), 10);
        assert_eq!((entries(), std::fs::read(&path).unwrap().as_slice()), (1, b"012x456789".as_slice()));
    }

    #[test]
    fn errors_name_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let error = AtomicFile::create(folder.path()).unwrap_err().to_string();
        assert!(error.contains(&folder.path().display().to_string()), "{error}");
        std::fs::write(folder.path().join("file"), "").unwrap();
        let error = AtomicFile::create(folder.path().join("file/inside.vti")).unwrap_err().to_string();
        assert!(error.contains("cannot make the folder"), "{error}");
    }

    #[test]
    fn a_full_disk_is_told() {
        let free = free_space(Path::new("not/yet/there.vti")).unwrap();
        assert!(free > 0);
        let error = check_free_space(Path::new("there.vti"), u64::MAX).unwrap_err().to_string();
        assert!(error.contains(&u64::MAX.to_string()), "{error}");
        check_free_space(Path::new("there.vti"), 0).unwrap();
    }

    #[test]
    fn a_folder_is_tried_without_a_trace() {
        let folder = tempfile::tempdir().unwrap();
        let new = folder.path().join("a/b");
        check_writable(&new).unwrap();
        assert_eq!(std::fs::read_dir(&new).unwrap().count(), 0);
        std::fs::write(new.join("file"), "").unwrap();
        let error = check_writable(&new.join("file")).unwrap_err().to_string();
        assert!(error.contains("a file is in the way"), "{error}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn writing_to_a_full_device_fails_with_its_reason() {
        let mut full = File::options().write(true).open("/dev/full").unwrap();
        let error = Error::from(full.write_all(b"x").unwrap_err());
        let error = AtomicFile::name_in(Path::new("out/a.vti"))(error).to_string();
        assert!(error.starts_with("out/a.vti: cannot be written: No space left"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn the_file_is_readable_as_any_other() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode();
        let (ours, theirs) = (folder.path().join("ours"), folder.path().join("theirs"));
        AtomicFile::create(&ours).unwrap().commit().unwrap();
        std::fs::write(&theirs, "").unwrap();
        assert_eq!(mode(&ours), mode(&theirs));
    }
}
