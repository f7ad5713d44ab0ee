//! A pipeline as it was written: the file's tree, edited by the command line's overrides.

use std::io::Read;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use super::error::{Error, Place, Refusal};
use super::yaml::{self, Entry, Node, Origin, Problem, Segment, Value};
use super::{compose, overrides};
use crate::stages::Invalid;

/// Larger files are refused. A scene of that size belongs into a mesh file.
const MAX_BYTES: u64 = 64 << 20;

/// A pipeline's text as a tree that knows where everything stands.
#[derive(Clone, Debug)]
pub struct Document {
    file: String,
    folder: PathBuf,
    root: Node,
    sets: Vec<String>,
    /// The files that were included, by the numbers that origins have.
    included: Vec<PathBuf>,
    /// What tells it from the others of its sweep.
    swept: String,
}

/// The name that stands for standard input.
pub const STDIN: &str = "-";

impl Document {
    /// Reads a file, or standard input where it is called `-`, and what it includes.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let (text, stdin) = (read_text(path)?, path == Path::new(STDIN));
        let name = if stdin { "<stdin>".to_owned() } else { path.display().to_string() };
        // A folder whose name is not UTF-8 can be shown only roughly, but must be found.
        let folder = if stdin { PathBuf::new() } else { parent(path) };
        Self::parse_in(&name, folder, &text)
    }

    /// Reads a text; `file` is what messages call it.
    pub fn parse(file: &str, text: &str) -> Result<Self, Error> {
        Self::parse_in(file, parent(Path::new(file)), text)
    }

    fn parse_in(file: &str, folder: PathBuf, text: &str) -> Result<Self, Error> {
        let blank = Node { origin: Origin::File { line: 1, column: 1 }, value: Value::Null };
        let (file, sets, included) = (file.to_owned(), Vec::new(), Vec::new());
        let mut document = Document { file, folder, root: blank, sets, included, swept: String::new() };
        let mut root = yaml::parse(text).map_err(|p| document.error(p))?;
        if matches!(root.value, Value::Null) {
            let problem = Problem::new("is empty; a pipeline is a mapping with `name` and `stages`");
            return Err(document.error(problem.or_at(Origin::File { line: 1, column: 1 })));
        }
        let mut included = Vec::new();
        let mut wrong = None;
        let found = compose::include(&mut root, &document.folder, &mut Vec::new(), &mut |path| {
            let number = included.len();
            included.push(path.to_owned());
            let text = read_text(path).map_err(|e| with_cause(&e))?;
            match yaml::parse(&text) {
                Ok(mut node) => {
                    node.included(number);
                    Ok(node)
                }
                Err(problem) => {
                    wrong = Some((number, problem));
                    Err("is not YAML".to_owned())
                }
            }
        });
        document.included = included;
        if let Some((file, problem)) = wrong {
            let origin = match problem.origin {
                Some(Origin::File { line, column }) => Origin::Included { file, line, column },
                _ => Origin::Included { file, line: 1, column: 1 },
            };
            return Err(document.error(problem.at(origin)));
        }
        found.map_err(|p| document.error(p))?;
        document.root = root;
        Ok(document)
    }

    /// Adds a page of all that the pipeline shows, unless it has one.
    pub fn add_page(&mut self) {
        let file = yaml::map([("html", Value::Text("page.html".to_owned()))]);
        let page = yaml::node(yaml::map([("page", file)]));
        if let Value::Map(entries) = &mut self.root.value
            && let Some(Entry { value: Node { value: Value::List(stages), .. }, .. }) =
                entries.iter_mut().find(|entry| entry.key == "stages")
            && !stages.iter().any(|stage| stage.get("page").is_some())
        {
            stages.push(page);
        }
    }

    /// The pipelines that it stands for: one, or as many as its `sweep` makes, each with its variables in their places.
    ///
    /// # Errors
    /// If a sweep or a variable is wrong.
    pub(super) fn expand(mut self) -> Result<Vec<Document>, Error> {
        compose::strip(&mut self.root);
        let swept = compose::sweep(&mut self.root).map_err(|p| self.error(p))?;
        let mut all = Vec::new();
        for compose::Swept { sets, suffix } in swept.unwrap_or_else(|| vec![compose::Swept::default()]) {
            let mut document = self.clone();
            sets.iter().try_for_each(|assignment| document.set(assignment))?;
            compose::substitute(&mut document.root).map_err(|p| document.error(p))?;
            if let Value::Map(entries) = &mut document.root.value
                && let Some(Entry { value: Node { value: Value::Text(name), .. }, .. }) =
                    entries.iter_mut().find(|entry| entry.key == "name")
            {
                *name += &suffix;
            }
            document.swept = suffix.trim_start_matches('-').to_owned();
            all.push(document);
        }
        Ok(all)
    }

    /// The files that it includes, as they were found.
    pub fn included(&self) -> &[PathBuf] {
        &self.included
    }

    /// What tells it from the others of its sweep; empty if there are none.
    pub fn swept(&self) -> &str {
        &self.swept
    }

    /// Applies an override, `KEY=VALUE`. What KEY may be: [`overrides`].
    pub fn set(&mut self, assignment: &str) -> Result<(), Error> {
        let origin = Origin::Set(self.sets.len());
        self.sets.push(assignment.to_owned());
        overrides::apply(&mut self.root, assignment, origin).map_err(|p| self.error(p.or_at(origin)))
    }

    /// Reads the whole as a structure.
    pub fn decode<T: DeserializeOwned>(&self) -> Result<T, Error> {
        yaml::decode(&self.root).map_err(|p| self.error(p))
    }

    /// Puts a value in the place of what is written at a path, where complaints about it still point.
    pub(super) fn put(&mut self, path: &str, value: &serde_json::Value) {
        let Some((origin, _)) = self.origin(path) else { return };
        let mut node = Some(&mut self.root);
        for segment in yaml::parse_path(path).unwrap_or_default() {
            node = node.and_then(|node| match (&segment, &mut node.value) {
                (Segment::Key(key), Value::Map(entries)) => {
                    entries.iter_mut().find(|entry| entry.key == *key).map(|entry| &mut entry.value)
                }
                (Segment::Index(index), Value::List(items)) => items.get_mut(*index),
                _ => None,
            });
        }
        if let Some(node) = node {
            *node = yaml::node(yaml::from_json(value));
            node.set_origin(origin);
        }
    }

    /// Line and column, from 1, of the value at a dotted path, or of its nearest part that is written. None if
    /// an override gave it, or if the path is malformed.
    pub fn locate(&self, path: &str) -> Option<(usize, usize)> {
        match self.origin(path)?.0 {
            Origin::File { line, column } => Some((line, column)),
            Origin::Set(_) | Origin::Included { .. } => None,
        }
    }

    /// The complaint with its line.
    pub fn refuse(&self, invalid: Invalid) -> Error {
        let Invalid { path, message } = invalid;
        let (origin, path) = self.origin(&path).unwrap_or((self.root.origin, path));
        Error::Refused(Box::new(Refusal { place: self.place(origin), path, message }))
    }

    /// The tree, with all overrides applied.
    pub(super) fn root(&self) -> &Node {
        &self.root
    }

    /// The file's name as messages say it.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// The folder that relative paths in the pipeline start from.
    pub fn folder(&self) -> PathBuf {
        self.folder.clone()
    }

    /// Where the value at a path is, or the nearest part of it that is written; and the path as messages write it.
    /// `list.2.key` is taken for `list[2].key`.
    fn origin(&self, path: &str) -> Option<(Origin, String)> {
        let mut node = Some(&self.root);
        let mut origin = self.root.origin;
        let mut segments = if path.is_empty() { Vec::new() } else { yaml::parse_path(path).ok()? };
        for segment in &mut segments {
            if let (Segment::Key(key), Some(Value::List(_))) = (&*segment, node.map(|n| &n.value))
                && let Ok(index) = key.parse()
            {
                *segment = Segment::Index(index);
            }
            node = node.and_then(|node| match segment {
                Segment::Key(key) => node.get(key),
                Segment::Index(index) => node.items().get(*index),
            });
            origin = node.map_or(origin, |inner| inner.origin);
        }
        Some((origin, yaml::show_path(&segments)))
    }

    fn place(&self, origin: Origin) -> Place {
        match origin {
            Origin::File { line, column } => Place::File { file: self.file.clone(), line, column },
            Origin::Included { file, line, column } => {
                let file = self.included.get(file).map(|path| path.display().to_string()).unwrap_or_default();
                Place::File { file, line, column }
            }
            Origin::Set(index) => Place::Set(self.sets.get(index).cloned().unwrap_or_default()),
        }
    }

    fn error(&self, problem: Problem) -> Error {
        let place = self.place(problem.origin.unwrap_or(self.root.origin));
        Error::Refused(Box::new(Refusal { place, path: problem.path(), message: problem.to_string() }))
    }
}

/// The text of a file, or of standard input.
fn read_text(path: &Path) -> Result<String, Error> {
    let mut bytes = Vec::new();
    let read = if path == Path::new(STDIN) {
        std::io::stdin().lock().take(MAX_BYTES + 1).read_to_end(&mut bytes)
    } else {
        crate::input::open(path).and_then(|file| file.take(MAX_BYTES + 1).read_to_end(&mut bytes))
    };
    read.map_err(|source| Error::Read { path: path.to_owned(), source })?;
    let not_text = |message: String| Error::NotText { path: path.to_owned(), message };
    if bytes.len() as u64 > MAX_BYTES {
        return Err(not_text(format!("is larger than {} MB; keep meshes in files of their own", MAX_BYTES >> 20)));
    }
    String::from_utf8(bytes).map_err(|e| {
        let at = e.utf8_error().valid_up_to();
        not_text(format!("is not a pipeline: byte {at} is not UTF-8 text (a binary file, or another encoding)"))
    })
}

/// An error and its causes.
fn with_cause(error: &Error) -> String {
    let cause = std::error::Error::source(error).map(|cause| format!(": {cause}"));
    format!("{error}{}", cause.unwrap_or_default())
}

fn parent(file: &Path) -> PathBuf {
    file.parent().map(Path::to_owned).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_later_check_can_cite_the_line() {
        let mut document = Document::parse("p.yaml", "stages:\n  - render:\n      dimensions: [0, 5, 5]\n").unwrap();
        assert_eq!(document.locate("stages[0].render.dimensions[0]"), Some((3, 20)));
        assert_eq!(document.locate("stages[0].render.camera.eye"), Some((3, 7)), "absent: the mapping it would be in");
        let refusal = document.refuse(Invalid::new("stages[0].render.dimensions[0]", "too small"));
        assert_eq!(refusal.to_string(), "p.yaml:3:20: stages[0].render.dimensions[0]: too small");
        let refusal = document.refuse(Invalid::new("stages.0.render.dimensions.2", "too small"));
        assert_eq!(refusal.to_string(), "p.yaml:3:26: stages[0].render.dimensions[2]: too small");
        document.set("render.dimensions=[0, 0, 0]").unwrap();
        let refusal = document.refuse(Invalid::new("stages[0].render.dimensions[0]", "too small"));
        assert_eq!(refusal.to_string(), "--set render.dimensions=[0, 0, 0]: stages[0].render.dimensions[0]: too small");
    }
}
