//! Two folders, file by file: the regression comparison of whole runs.
//!
//! Files are matched by their paths below the folders. What this program can read is compared number by number; pictures
//! (`.png`) pixel by pixel; anything else byte by byte. Hidden files, and the sidecars of occlusion files, which say
//! how values were made and not what they are, are left out.

use std::collections::BTreeSet;
use std::fmt;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::compare::{Comparison, Tolerance, lists};
use super::{ENDINGS, Error, ending};
use crate::progress::Progress;
use crate::volume::Values;

/// The most bytes of pixels that a picture may take.
const MOST_PIXELS: usize = 1 << 30;

/// The outcome for two folders.
#[derive(Debug, Default, Serialize)]
pub struct Folders {
    /// Whether all files count as the same.
    pub same: bool,
    /// Every file of either folder that was not left out, by its path, in order.
    pub files: Vec<FileComparison>,
}

/// The outcome for a file.
#[derive(Debug, Serialize)]
pub struct FileComparison {
    /// Its path below the folders.
    pub file: PathBuf,
    /// What was found.
    #[serde(flatten)]
    pub comparison: Comparison,
}

/// Compares all files of two folders.
///
/// # Errors
/// If a folder can't be read, or if the work is to stop. A file that can't be read counts as different.
pub fn compare(a: &Path, b: &Path, tolerance: &Tolerance, progress: &dyn Progress) -> Result<Folders, Error> {
    let (mut first, mut second) = (BTreeSet::new(), BTreeSet::new());
    list(a, Path::new(""), &mut first)?;
    list(b, Path::new(""), &mut second)?;
    let all: Vec<&PathBuf> = first.union(&second).filter(|file| !tolerance.ignores(file)).collect();
    let _running = progress.stage("comparing", all.len() as u64);
    let mut found = Folders { same: true, files: Vec::new() };
    for file in all {
        let comparison = match (first.contains(file), second.contains(file)) {
            (true, false) => only("first"),
            (false, _) => only("second"),
            (true, true) => two_files(&a.join(file), &b.join(file), tolerance)
                .unwrap_or_else(|error| Comparison { differences: vec![with_causes(&error)], ..Comparison::default() }),
        };
        found.same &= comparison.same;
        found.files.push(FileComparison { file: file.clone(), comparison });
        progress.advance(1);
        if progress.cancelled() {
            break;
        }
    }
    Ok(found)
}

fn only(side: &str) -> Comparison {
    Comparison { differences: vec![format!("the file is only in the {side} folder")], ..Comparison::default() }
}

fn with_causes(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        text += &format!(": {inner}");
        cause = inner.source();
    }
    text
}

/// The files below a folder, without those that are left out.
fn list(folder: &Path, below: &Path, found: &mut BTreeSet<PathBuf>) -> Result<(), Error> {
    let failed = |cause| Error::Open { path: folder.join(below), cause };
    for entry in std::fs::read_dir(folder.join(below)).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let name = entry.file_name();
        let text = name.to_string_lossy();
        if text.starts_with('.') || text.ends_with(".f32.yaml") {
            continue;
        }
        // Links are not followed, so there is an end.
        let kind = entry.file_type().map_err(failed)?;
        if kind.is_dir() {
            list(folder, &below.join(&name), found)?;
        } else if kind.is_file() {
            found.insert(below.join(&name));
        }
    }
    Ok(())
}

/// Compares two files of one name, of whatever kind.
fn two_files(a: &Path, b: &Path, tolerance: &Tolerance) -> Result<Comparison, Error> {
    match ending(a).as_str() {
        "png" => pictures(a, b, tolerance),
        // Lists of the files that are compared themselves.
        "pvd" | "series" => bytes(a, b),
        ending if ENDINGS.contains(&ending) => {
            // An array that is asked for is compared where there is one.
            let all = Tolerance { arrays: Vec::new(), ..tolerance.clone() };
            let some = if tolerance.arrays.is_empty() { None } else { super::compare(a, b, tolerance).ok() };
            match some {
                Some(found) => Ok(found),
                None if tolerance.arrays.is_empty() => super::compare(a, b, &all),
                None => Ok(Comparison { same: true, ..Comparison::default() }),
            }
        }
        _ => bytes(a, b),
    }
}

/// Compares pixels, as an array `pixels` of as many components as there are channels.
fn pictures(a: &Path, b: &Path, tolerance: &Tolerance) -> Result<Comparison, Error> {
    let (x, y) = (pixels(a)?, pixels(b)?);
    if (x.0, x.1) != (y.0, y.1) {
        let size = |(width, height): (u32, u32)| format!("{width} x {height}");
        let differences = vec![format!("{} and {} pixels, or other channels", size(x.0), size(y.0))];
        return Ok(Comparison { differences, ..Comparison::default() });
    }
    let all = Tolerance { arrays: Vec::new(), ..tolerance.clone() };
    Ok(lists("pixels", &Values::U8(x.2), &Values::U8(y.2), &all))
}

/// Width and height, channels, and numbers of a picture.
type Pixels = ((u32, u32), usize, Vec<u8>);

fn pixels(path: &Path) -> Result<Pixels, Error> {
    let refused = |message: String| Error::Picture { path: path.into(), message };
    let file: File = crate::input::open(path).map_err(|cause| Error::Open { path: path.into(), cause })?;
    let mut decoder = png::Decoder::new(BufReader::new(file));
    decoder.set_transformations(png::Transformations::normalize_to_color8());
    let mut reader = decoder.read_info().map_err(|e| refused(e.to_string()))?;
    let size = reader.output_buffer_size().filter(|&size| size <= MOST_PIXELS);
    let mut bytes = vec![0; size.ok_or_else(|| refused("it is too large".to_owned()))?];
    let info = reader.next_frame(&mut bytes).map_err(|e| refused(e.to_string()))?;
    bytes.truncate(info.buffer_size());
    Ok(((info.width, info.height), info.color_type.samples(), bytes))
}

/// Compares byte by byte.
fn bytes(a: &Path, b: &Path) -> Result<Comparison, Error> {
    let open = |path: &Path| -> Result<_, Error> {
        let file = crate::input::open(path).map_err(|cause| Error::Open { path: path.into(), cause })?;
        Ok(BufReader::new(file).bytes())
    };
    let mut at = 0u64;
    let (mut x, mut y) = (open(a)?, open(b)?);
    loop {
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |cause| Error::Open { path, cause }
        };
        let pair = (x.next().transpose().map_err(failed(a))?, y.next().transpose().map_err(failed(b))?);
        match pair {
            (None, None) => return Ok(Comparison { same: true, ..Comparison::default() }),
            (x, y) if x == y => at += 1,
            _ => {
                let differences = vec![format!("other bytes, the first at {at}")];
                return Ok(Comparison { differences, ..Comparison::default() });
            }
        }
    }
}

impl Folders {
    /// How many files differ.
    pub fn different(&self) -> usize {
        self.files.iter().filter(|file| !file.comparison.same).count()
    }
}

impl fmt::Display for Folders {
    /// A line for each file that is the same, and all there is to say of those that are not.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for FileComparison { file, comparison } in &self.files {
            if comparison.same {
                writeln!(f, "same: {}", file.display())?;
            } else {
                writeln!(f, "different: {}", file.display())?;
                comparison
                    .to_string()
                    .lines()
                    .filter(|line| *line != "different")
                    .try_for_each(|l| writeln!(f, "  {l}"))?;
            }
        }
        match self.different() {
            0 => write!(f, "same: all {} files", self.files.len()),
            n => write!(f, "different: {n} of {} files", self.files.len()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;

    #[test]
    fn files_are_matched_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, bytes).unwrap();
        };
        let floats = |values: &[f32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
        for (name, a, b) in [
            ("x.f32", floats(&[0.0, 0.5]), floats(&[0.0, 0.75])),
            ("deep/er/y.raw", floats(&[0.0, 0.5, 1.0]), floats(&[0.0, 0.5, 1.0])),
            ("z.py", b"print(1)".to_vec(), b"print(2)".to_vec()),
            (".hidden", b"1".to_vec(), b"2".to_vec()),
            ("x.f32.yaml", Vec::new(), Vec::new()),
        ] {
            write(&format!("a/{name}"), &a);
            write(&format!("b/{name}"), &b);
        }
        std::fs::remove_file(folder.path().join("a/x.f32.yaml")).unwrap();
        std::fs::remove_file(folder.path().join("b/x.f32.yaml")).unwrap();
        write("b/new.csv", b"");
        let (a, b) = (folder.path().join("a"), folder.path().join("b"));
        let found = compare(&a, &b, &Tolerance::default(), &Silent).unwrap();
        let told = found.to_string();
        for part in [
            "same: deep/er/y.raw\n",
            "different: new.csv\n  different: the file is only in the second folder\n",
            "different: x.f32\n  different: ambient_occlusion: 1 of 2 numbers differ",
            "different: z.py\n  different: other bytes, the first at 6\n",
            "different: 3 of 4 files",
        ] {
            assert!(told.contains(part), "{part}\n{told}");
        }
        let ignore = ["*.py", "new.*"].map(|pattern| glob::Pattern::new(pattern).unwrap()).to_vec();
        let loose = Tolerance { atol: 0.25, ignore, ..Tolerance::default() };
        assert!(compare(&a, &b, &loose, &Silent).unwrap().same);
    }
}
