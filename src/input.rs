//! The one door by which input files are opened: regular files only.
//!
//! A path in a pipeline can name anything. Opening a FIFO waits for a writer, for ever if none comes, and reading
//! `/dev/zero` ends when memory does. So whatever is read as an input is asked for its kind first, and is
//! opened only if its kind is a file with a length.

use std::fs::{File, Metadata};
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// Opens a regular file for reading.
///
/// # Errors
/// If it is no regular file, or can't be opened.
pub fn open(path: &Path) -> Result<File> {
    length(path)?;
    File::open(path)
}

/// The bytes in a regular file.
///
/// # Errors
/// As [`open`].
pub fn length(path: &Path) -> Result<u64> {
    let metadata = std::fs::metadata(path)?;
    if metadata.is_file() {
        return Ok(metadata.len());
    }
    Err(Error::new(ErrorKind::InvalidInput, format!("not a regular file but {}; copy it into one", kind(&metadata))))
}

/// All bytes of a regular file.
///
/// # Errors
/// As [`open`], and if reading fails.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The text in a regular file.
///
/// # Errors
/// As [`read`], and if it is not UTF-8.
pub fn read_text(path: &Path) -> Result<String> {
    String::from_utf8(read(path)?).map_err(|e| Error::new(ErrorKind::InvalidData, e.utf8_error()))
}

fn kind(metadata: &Metadata) -> &'static str {
    if metadata.is_dir() {
        return "a folder";
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        let kind = metadata.file_type();
        if kind.is_fifo() {
            return "a FIFO";
        } else if kind.is_socket() {
            return "a socket";
        } else if kind.is_char_device() || kind.is_block_device() {
            return "a device";
        }
    }
    "something else"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_regular_files_are_opened() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a");
        std::fs::write(&file, "text").unwrap();
        assert_eq!(
            (length(&file).unwrap(), read(&file).unwrap(), read_text(&file).unwrap().as_str()),
            (4, b"text".to_vec(), "text")
        );
        assert_eq!(open(&folder.path().join("b")).unwrap_err().kind(), ErrorKind::NotFound);
        std::fs::write(&file, b"\xff").unwrap();
        assert_eq!(read_text(&file).unwrap_err().kind(), ErrorKind::InvalidData);
        for (path, kind) in [(folder.path(), "a folder"), (Path::new("/dev/zero"), "a device")] {
            let message = read(path).unwrap_err().to_string();
            assert_eq!(message, format!("not a regular file but {kind}; copy it into one"));
        }
    }
}
