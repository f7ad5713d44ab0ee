//! Lists of files over time: ParaView's `.pvd` (XML) and `.vti.series`, `.vtu.series` and the like (JSON).
//!
//! A list says at which time each file is; of a `.pvd` several files may be at one time, as parts of one data set. Its steps
//! are given in the order of their times, however they are listed.

use std::path::{Path, PathBuf};

use serde::Deserialize;

/// Steps that a list may have.
const MOST: usize = 1 << 20;

/// What there is at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// The time; none if the list gives none.
    pub time: Option<f64>,
    /// The files, the list's folder before them.
    pub files: Vec<PathBuf>,
}

/// Whether a file is such a list, by its name.
pub fn is_list(path: &Path) -> bool {
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    ending == "pvd" || ending == "series"
}

/// The steps of a list, at least one.
///
/// # Errors
/// If it can't be read, names no file, or gives some of its files a time and others none.
pub fn read(path: &Path) -> Result<Vec<Step>, String> {
    let text = crate::input::read_text(path).map_err(|e| format!("can't be read: {e}"))?;
    let listed = if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("pvd")) {
        of_collection(&text)?
    } else {
        of_json(&text)?
    };
    let folder = path.parent().unwrap_or(Path::new(""));
    let timed = listed.iter().filter(|(time, _)| time.is_some()).count();
    match (listed.len(), timed) {
        (0, _) => return Err("names no file".into()),
        (n, _) if n > MOST => return Err(format!("names {n} files; the most is {MOST}")),
        (n, t) if t != 0 && t != n => return Err(format!("gives {t} of {n} files a time, and the others none")),
        _ => {}
    }
    let mut steps: Vec<Step> = Vec::new();
    let mut listed: Vec<_> = listed.into_iter().map(|(time, file)| (time, folder.join(file))).collect();
    listed.sort_by(|(a, _), (b, _)| a.unwrap_or(0.0).total_cmp(&b.unwrap_or(0.0)));
    for (time, file) in listed {
        match steps.last_mut().filter(|step| time.is_some() && step.time == time) {
            Some(step) => step.files.push(file),
            None => steps.push(Step { time, files: vec![file] }),
        }
    }
    Ok(steps)
}

/// All files that a list names; none if it can't be read.
pub fn files(path: &Path) -> Vec<PathBuf> {
    read(path).unwrap_or_default().into_iter().flat_map(|step| step.files).collect()
}

type Listed = Vec<(Option<f64>, String)>;

fn time_of(number: f64, file: &str) -> Result<Option<f64>, String> {
    if number.is_finite() { Ok(Some(number)) } else { Err(format!("gives {file:?} the time {number}")) }
}

fn of_collection(text: &str) -> Result<Listed, String> {
    super::vtk::check_nesting(text).map_err(|e| e.to_string())?;
    let xml = roxmltree::Document::parse(text).map_err(|e| format!("its XML is damaged or cut short: {e}"))?;
    let root = xml.root_element();
    if !root.has_tag_name("VTKFile") || root.attribute("type") != Some("Collection") {
        return Err("is no list of ParaView: it doesn't begin with <VTKFile type=\"Collection\">".into());
    }
    let sets = root.children().filter(|n| n.has_tag_name("Collection")).flat_map(|n| n.children());
    let mut listed = Vec::new();
    for set in sets.filter(|n| n.has_tag_name("DataSet")) {
        let file = set.attribute("file").ok_or("has a <DataSet> without the attribute file")?;
        let time = match set.attribute("timestep").map(str::trim) {
            None | Some("") => None,
            Some(word) => time_of(word.parse().map_err(|_| format!("gives {file:?} the time {word:?}"))?, file)?,
        };
        listed.push((time, file.to_owned()));
    }
    Ok(listed)
}

#[derive(Deserialize)]
struct Series {
    files: Vec<Entry>,
}

#[derive(Deserialize)]
struct Entry {
    name: String,
    time: Option<f64>,
}

fn of_json(text: &str) -> Result<Listed, String> {
    let series: Series = serde_json::from_str(text).map_err(|e| format!("is no list of ParaView: {e}"))?;
    let entry = |Entry { name, time }: Entry| Ok((time.map(|t| time_of(t, &name)).transpose()?.flatten(), name));
    series.files.into_iter().map(entry).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steps(name: &str, text: &str) -> Result<Vec<(Option<f64>, usize)>, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        let steps = read(&path)?;
        assert!(steps.iter().flat_map(|s| &s.files).all(|file| file.starts_with(folder.path())));
        Ok(steps.into_iter().map(|step| (step.time, step.files.len())).collect())
    }

    #[test]
    fn steps_are_in_the_order_of_their_times() {
        let set =
            |attributes: &str| format!("<VTKFile type='Collection'><Collection>{attributes}</Collection></VTKFile>");
        let text = set("<DataSet timestep='2' part='0' file='c.vtu'/><DataSet timestep='1.5' file='a.vtu'/>\
                        <DataSet timestep='2' part='1' file='b.vtu'/>");
        assert_eq!(steps("a.pvd", &text).unwrap(), [(Some(1.5), 1), (Some(2.0), 2)]);
        assert_eq!(steps("a.pvd", &set("<DataSet file='a.vtu'/><DataSet file='b.vtu'/>")).unwrap(), [(None, 1); 2]);
        let json =
            r#"{"file-series-version": "1.0", "files": [{"name": "b", "time": 7}, {"name": "a", "time": -1e1}]}"#;
        assert_eq!(steps("a.vti.series", json).unwrap(), [(Some(-10.0), 1), (Some(7.0), 1)]);
        for (text, message) in [
            (set(""), "names no file"),
            (set("<DataSet timestep='1' file='a'/><DataSet file='b'/>"), "gives 1 of 2 files a time"),
            (set("<DataSet timestep='x' file='a'/>"), "gives \"a\" the time \"x\""),
            (set("<DataSet timestep='inf' file='a'/>"), "gives \"a\" the time inf"),
            (set("<DataSet timestep='1'/>"), "without the attribute file"),
            ("<VTKFile type='ImageData'/>".into(), "is no list of ParaView"),
            ("<VTKFile".into(), "its XML is damaged"),
        ] {
            let error = steps("a.pvd", &text).unwrap_err();
            assert!(error.contains(message), "{text}: {error}");
        }
        assert!(steps("a.vti.series", "{\"files\": 3}").unwrap_err().contains("is no list of ParaView"));
    }
}
