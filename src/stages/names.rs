//! The names of output files: below the output folder, and each used once.
//!
//! A pipeline may come from anyone, so the files it names must not reach outside its output folder. Names that
//! differ only in case are one file on some systems, so they count as the same here.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use super::Invalid;

/// The files named so far.
#[derive(Default)]
pub(super) struct Outputs {
    /// The name in lower case, and the path of the key that gave it.
    taken: BTreeMap<String, String>,
}

impl Outputs {
    /// The file that the key at `path` names. `extension` without a dot; none allows any.
    pub fn claim(&mut self, path: &str, name: &str, extension: Option<&str>) -> Result<PathBuf, Invalid> {
        let refuse = |message: String| Err(Invalid::new(path, message));
        if let Some(reason) = unfit(name) {
            return refuse(format!("{reason}; expected a file's name below the output folder"));
        }
        let file = Path::new(name);
        if let Some(wanted) = extension {
            let found = file.extension().and_then(|e| e.to_str()).unwrap_or("");
            if !found.eq_ignore_ascii_case(wanted) {
                return refuse(format!("expected a name that ends in .{wanted}, found \"{name}\""));
            }
        }
        let folded = name.to_lowercase();
        if let Some(owner) = self.taken.get(&folded) {
            return refuse(format!("the file \"{name}\" is written by {owner} already; give it another name"));
        }
        // A film has thousands of files, so none is held against all others.
        let above = folded.match_indices('/').find_map(|(end, _)| self.taken.get(&folded[..end]));
        let inside = format!("{folded}/");
        let below = self.taken.range(inside.clone()..).next().filter(|(other, _)| other.starts_with(&inside));
        if let Some(owner) = above.or(below.map(|(_, owner)| owner)) {
            return refuse(format!("\"{name}\" would have to be a file and a folder (see {owner})"));
        }
        self.taken.insert(folded, path.to_owned());
        Ok(file.to_owned())
    }
}

/// The names of files as a list beside them has them.
pub(super) fn file_names(files: &[PathBuf]) -> Vec<String> {
    files.iter().map(|file| file.file_name().unwrap_or_default().to_string_lossy().into_owned()).collect()
}

/// Why a text can't name a file below the output folder.
fn unfit(name: &str) -> Option<String> {
    if name.is_empty() {
        return Some("the name is empty".into());
    }
    if name.chars().any(|c| c.is_control() || c == '\\') {
        return Some("the name has a backslash or a control character".into());
    }
    if name.ends_with('/') || name.contains("//") {
        return Some(format!("\"{name}\" lacks a name between or after slashes"));
    }
    for component in Path::new(name).components() {
        match component {
            Component::Normal(part) if part.len() > 200 => return Some("the name is longer than 200 bytes".into()),
            Component::Normal(part) if part.to_string_lossy().starts_with('.') => {
                return Some(format!("\"{name}\" begins with a dot"));
            }
            Component::Normal(_) => {}
            Component::ParentDir | Component::CurDir => return Some(format!("\"{name}\" has `.` or `..` in it")),
            Component::RootDir | Component::Prefix(_) => return Some(format!("\"{name}\" is an absolute path")),
        }
    }
    // `a/./b` is normalised away by `components`.
    if name.split('/').any(|part| part == ".") { Some(format!("\"{name}\" has `.` or `..` in it")) } else { None }
}

/// Why a text can't be a pipeline's name, which names a folder.
pub(super) fn unfit_name(name: &str) -> Option<String> {
    if name.contains('/') {
        return Some("the name has a slash".into());
    }
    if name.trim() != name {
        return Some("the name begins or ends with a space".into());
    }
    unfit(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stay_inside() {
        for name in [
            "",
            "/etc/a.vti",
            "../a.vti",
            "a/../b.vti",
            "./a.vti",
            "a/./b.vti",
            ".a.vti",
            "a/.b.vti",
            "a//b.vti",
            "a.vti/",
            "a\\b.vti",
            "a\n.vti",
            "..",
        ] {
            assert!(Outputs::default().claim("p", name, None).is_err(), "{name:?}");
        }
        for name in ["a.vti", "images/a.vti", "a b.vti", "a..b.vti", "ä.vti"] {
            assert_eq!(Outputs::default().claim("p", name, Some("vti")), Ok(PathBuf::from(name)));
        }
        assert!(Outputs::default().claim("p", &"a".repeat(300), None).is_err());
    }

    #[test]
    fn each_once() {
        let mut outputs = Outputs::default();
        outputs.claim("first", "a.vti", Some("vti")).unwrap();
        for (name, message) in [
            ("A.vti", "p: the file \"A.vti\" is written by first already; give it another name"),
            ("a.vti/b", "p: \"a.vti/b\" would have to be a file and a folder (see first)"),
        ] {
            assert_eq!(outputs.claim("p", name, None).unwrap_err().to_string(), message);
        }
        assert!(outputs.claim("p", "a.vtib", None).is_ok());
        assert!(outputs.claim("p", "a.vti-/b/c", None).is_ok());
        let message = "p: \"a.vti-\" would have to be a file and a folder (see p)";
        assert_eq!(outputs.claim("p", "a.vti-", None).unwrap_err().to_string(), message);
        assert!(outputs.claim("p", "b.txt", Some("vti")).is_err());
    }
}
