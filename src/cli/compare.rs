//! `ao4d compare`: do two files, or all files of two folders, hold the same values?

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use ao4d::inspect::compare::Tolerance;
use ao4d::inspect::folders::{self, FileComparison, Folders};
use ao4d::inspect::{self, picture};
use ao4d::progress::Progress;
use clap::Args;

use super::console::Console;
use super::watch::Watch;
use super::{Failure, Outcome};

/// What `compare` takes. A value differs where |a - b| > ATOL + RTOL |b|.
#[derive(Args, Debug)]
pub struct Compare {
    /// A volume (.vti, .raw), a mesh (.vtu, .vtp, .stl, .ply) or an occlusion file (.f32); or a folder, file by file
    a: PathBuf,
    /// What it is compared with
    b: PathBuf,
    /// Differences up to this are none
    #[arg(long, value_name = "X", default_value_t = 0.0, value_parser = tolerance)]
    atol: f64,
    /// Differences up to this times B's value are none
    #[arg(long, value_name = "X", default_value_t = 0.0, value_parser = tolerance)]
    rtol: f64,
    /// So many values of an array may differ
    #[arg(long, value_name = "N", default_value_t = 0)]
    max_different: usize,
    /// Compare this array only; may be given several times
    #[arg(long, value_name = "NAME")]
    array: Vec<String>,
    /// Tolerances from a file: `default` and `arrays`, each with atol, rtol and max_different; `ignore`, files left out
    #[arg(long, value_name = "FILE.yaml")]
    tolerances: Option<PathBuf>,
    /// Also write the result as JUnit's XML
    #[arg(long, value_name = "FILE.xml")]
    junit: Option<PathBuf>,
    /// Also write the result as Markdown
    #[arg(long, value_name = "FILE.md")]
    markdown: Option<PathBuf>,
    /// Also draw the differences of images into this folder: slices of the first, of the second, and how far they are apart
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

impl Compare {
    pub fn execute(self, console: &Console) -> Result<Outcome, Failure> {
        for path in [&self.a, &self.b] {
            if !path.is_dir() {
                super::existing(path)?;
            }
        }
        let watch = Watch::new(console)?;
        let Self { a, b, atol, rtol, max_different, array, json, .. } = &self;
        let (atol, rtol, max_different, arrays) = (*atol, *rtol, *max_different, array.clone());
        let mut tolerance = Tolerance { atol, rtol, max_different, arrays, ..Tolerance::default() };
        if let Some(file) = &self.tolerances {
            super::existing(file)?;
            tolerance = tolerance.with_file(file)?;
        }
        let folders = match (a.is_dir(), b.is_dir()) {
            (true, true) => folders::compare(a, b, &tolerance, &watch)?,
            (false, false) => {
                let running = (&watch as &dyn Progress).stage("comparing", 0);
                let comparison = inspect::compare(a, b, &tolerance)?;
                running.end();
                if *json { console.json(&comparison) } else { console.result(&comparison.to_string()) }?;
                let file = a.file_name().map(PathBuf::from).unwrap_or_default();
                Folders { same: comparison.same, files: vec![FileComparison { file, comparison }] }
            }
            _ => return Err(Failure::refused("one is a folder and the other a file; compare two of a kind")),
        };
        if watch.cancelled() {
            return Err(Failure::Cancelled);
        }
        if a.is_dir() {
            if *json { console.json(&folders) } else { console.result(&folders.to_string()) }?;
        }
        self.report(&folders, &tolerance, console)?;
        Ok(if folders.same { Outcome::Done } else { Outcome::Different })
    }

    /// Writes the reports and pictures that are asked for.
    fn report(&self, folders: &Folders, tolerance: &Tolerance, console: &Console) -> Result<(), Failure> {
        let mut drawn = BTreeMap::new();
        if let Some(into) = &self.pictures {
            for FileComparison { file, .. } in folders.files.iter().filter(|file| !file.comparison.same) {
                let side = |root: &Path| if root.is_dir() { root.join(file) } else { root.to_owned() };
                let (a, b) = (side(&self.a), side(&self.b));
                let name = format!("{}.png", file.to_string_lossy().replace(['/', '\\'], "-"));
                let path = into.join(&name);
                let there = a.is_file() && b.is_file();
                if there && picture::write(&a, &b, tolerance, &path).map_err(|e| Failure::Failed(Box::new(e)))? {
                    console.tell(&format!("written: {}", path.display()));
                    drawn.insert(file.clone(), path);
                }
            }
        }
        let markdown = |into: &Path| {
            let beside = into.parent().unwrap_or(Path::new(""));
            folders.markdown(&|file| {
                let path = drawn.get(&file.file)?;
                Some(path.strip_prefix(beside).unwrap_or(path).to_string_lossy().replace('\\', "/").replace(' ', "%20"))
            })
        };
        let wanted = [
            self.junit.as_ref().map(|path| (path, folders.junit())),
            self.markdown.as_ref().map(|path| (path, markdown(path))),
        ];
        for (path, text) in wanted.into_iter().flatten() {
            super::write(path, text.as_bytes())?;
            console.tell(&format!("written: {}", path.display()));
        }
        Ok(())
    }
}

fn tolerance(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|x| x.is_finite() && *x >= 0.0);
    number.ok_or_else(|| "expected a number, 0 or above".into())
}
