//! One run at a time in an output folder.
//!
//! A run holds a lock on a small file in its folder, from before it looks at what is there until its last file is
//! written. The system lets go of it however the process ends. The file says who holds it.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{ErrorKind, Read, Seek, Write};
use std::path::{Path, PathBuf};

use crate::io::Unfinished;

/// The file's name in the output folder.
const NAME: &str = ".ao4d-lock";

/// Another run is at work in the folder.
#[derive(Debug, thiserror::Error)]
#[error("{}: another run {who}is writing here; wait for it, or write elsewhere with --out", folder.display())]
pub struct Busy {
    folder: PathBuf,
    /// The process that holds it, where it is known.
    who: String,
}

/// A folder that is this run's alone until this is dropped.
#[derive(Debug)]
pub struct Lock {
    path: PathBuf,
    /// None where the folder can't be written to, so that nothing will be either.
    file: Option<(File, Vec<Unfinished>)>,
    /// Folders that were made for it, the innermost first.
    made: Vec<PathBuf>,
}

impl Lock {
    /// Locks a folder; makes it if it isn't there. A folder that can't be written to is not locked: whoever goes on to
    /// write there finds out why it can't be.
    ///
    /// # Errors
    /// If another run holds it.
    pub fn take(folder: &Path) -> Result<Self, Busy> {
        let made: Vec<PathBuf> =
            folder.ancestors().take_while(|f| !f.as_os_str().is_empty() && !f.exists()).map(Path::to_owned).collect();
        let _ = std::fs::create_dir_all(folder);
        let mut lock = Self { path: folder.join(NAME), file: None, made };
        let mut tries = 8;
        loop {
            // Opening anything but a file could wait for ever.
            if std::fs::symlink_metadata(&lock.path).is_ok_and(|m| !m.is_file()) {
                return Ok(lock);
            }
            let opened = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&lock.path);
            let mut file = match opened {
                Ok(file) => file,
                // Another run that made the folder too has gone, and the folder with it.
                Err(error) if error.kind() == ErrorKind::NotFound && tries > 0 => {
                    tries -= 1;
                    let _ = std::fs::create_dir_all(folder);
                    continue;
                }
                Err(_) => return Ok(lock),
            };
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    let mut text = String::new();
                    let _ = (&mut file).take(128).read_to_string(&mut text);
                    let who = holder(&text);
                    lock.made.clear();
                    return Err(Busy { folder: folder.to_owned(), who });
                }
                // A file system without locks.
                Err(TryLockError::Error(_)) => return Ok(lock),
            }
            // The run before may have taken the file away between the opening and the locking.
            if is_at(&file, &lock.path) {
                let _ = file.set_len(0).and_then(|()| file.rewind());
                let _ = writeln!(file, "{} {}", std::process::id(), host());
                let own = lock.made.iter().chain([&lock.path]).cloned().map(Unfinished::new).collect();
                lock.file = Some((file, own));
                return Ok(lock);
            }
        }
    }
}

/// Who holds a lock, by what is written in its file: a process, and where it runs if that is elsewhere.
fn holder(text: &str) -> String {
    let (id, there) = text.trim().split_once(' ').unwrap_or((text.trim(), ""));
    match id.parse::<u32>() {
        Err(_) => String::new(),
        Ok(id) if there.is_empty() || there == host() => format!("(process {id}) "),
        Ok(id) => format!("(process {id} on {there}) "),
    }
}

/// This computer's name, where the system tells it.
fn host() -> String {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    name.trim().chars().take(64).filter(|c| !c.is_control()).collect()
}

#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let (open, named) = (file.metadata(), std::fs::metadata(path));
    open.is_ok_and(|open| named.is_ok_and(|named| (open.dev(), open.ino()) == (named.dev(), named.ino())))
}

#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

impl Drop for Lock {
    fn drop(&mut self) {
        if self.file.is_some() {
            let _ = std::fs::remove_file(&self.path);
        }
        self.file = None;
        // Only those that are empty go.
        for folder in &self.made {
            let _ = std::fs::remove_dir(folder);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_at_a_time_and_no_trace() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("a/b");
        let lock = Lock::take(&out).unwrap();
        let message = Lock::take(&out).unwrap_err().to_string();
        let expected = format!("another run (process {}) is writing here; wait for it", std::process::id());
        assert!(message.contains(&expected), "{message}");
        assert!(out.is_dir(), "whoever was refused takes nothing away");
        drop(lock);
        assert!(!folder.path().join("a").exists());
        let lock = Lock::take(&out).unwrap();
        std::fs::write(out.join("file"), "").unwrap();
        drop(lock);
        assert_eq!(std::fs::read_dir(&out).unwrap().count(), 1);
        let elsewhere = format!("{}.elsewhere", host());
        assert_eq!(holder(&format!("12 {elsewhere}\n")), format!("(process 12 on {elsewhere}) "));
        assert_eq!((holder("12"), holder("")), ("(process 12) ".to_owned(), String::new()));
        // What a killed run leaves is no hindrance.
        std::fs::write(out.join(NAME), "1").unwrap();
        drop(Lock::take(&out).unwrap());
    }
}
