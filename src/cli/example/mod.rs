//! `ao4d example`: the shipped pipelines, for whoever has the program alone.
//!
//! They are part of the program, with the meshes and images that they read. Written out they keep their places to each
//! other, so the paths in them hold; beside them goes the JSON Schema, named in the first line of each, by which editors
//! complete and check as one types.

mod shipped;

use std::ffi::OsStr;
use std::path::PathBuf;

use clap::builder::{PossibleValue, StringValueParser, TypedValueParser};
use clap::{Arg, Args, Command};

use super::console::Console;
use super::{Failure, Outcome};
use shipped::{DATA, PIPELINES};

/// The schema's file.
const SCHEMA: &str = "ao4d.schema.json";

/// What `example` takes.
#[derive(Args, Debug)]
pub struct Example {
    /// Which one, such as two_tetrahedra or lessons/02_cube; `all` for all of them; lists them if left out
    #[arg(value_parser = Names, hide_possible_values = true)]
    name: Option<String>,
    /// Write it into this folder
    #[arg(long, value_name = "DIR", default_value = ".")]
    out: PathBuf,
    /// Write over files that are there already
    #[arg(long)]
    force: bool,
}

/// The names that shells complete. Others are taken too: parts of them, and with hyphens.
#[derive(Clone)]
struct Names;

impl TypedValueParser for Names {
    type Value = String;

    fn parse_ref(&self, command: &Command, argument: Option<&Arg>, value: &OsStr) -> Result<String, clap::Error> {
        StringValueParser::new().parse_ref(command, argument, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        let names = PIPELINES.iter().map(|(name, _)| *name).chain(["all"]);
        Some(Box::new(names.map(PossibleValue::new)))
    }
}

impl Example {
    pub fn execute(self, console: &Console) -> Result<Outcome, Failure> {
        let Some(name) = &self.name else {
            let width = PIPELINES.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
            let line = |(name, text): &(&str, &str)| format!("{name:width$}  {}\n", about(text));
            console.result(&PIPELINES.iter().map(line).collect::<String>())?;
            return Ok(Outcome::Done);
        };
        let plain = |name: &str| name.trim_end_matches(".yaml").replace('-', "_");
        let wanted = plain(name);
        // The last part of a name will do where it is one example's alone.
        let ends = |known: &str| known.rsplit('/').next() == Some(wanted.as_str());
        let found: Vec<_> = match PIPELINES.iter().find(|(known, _)| *known == wanted) {
            Some(found) => vec![found],
            None if wanted == "all" => PIPELINES.iter().collect(),
            None => PIPELINES.iter().filter(|(known, _)| ends(known)).collect(),
        };
        if found.is_empty() || (found.len() > 1 && wanted != "all") {
            let known = PIPELINES.iter().map(|(name, _)| *name);
            let message = ao4d::pipeline::unknown_word(&format!("there is no example `{name}`"), &wanted, known);
            return Err(Failure::refused(message));
        }
        let mut files: Vec<(PathBuf, Vec<u8>)> = vec![(SCHEMA.into(), schema()?)];
        for (name, text) in &found {
            let up = "../".repeat(name.matches('/').count());
            let text = format!("# yaml-language-server: $schema={up}{SCHEMA}\n{text}");
            files.push((format!("{name}.yaml").into(), text.into_bytes()));
        }
        let needed = |folder: &str| found.iter().any(|(_, text)| text.contains(&format!("{folder}/")));
        for (path, bytes) in DATA {
            let folder = path.split('/').next().unwrap_or_default();
            if needed(folder) {
                files.push((path.into(), bytes.to_vec()));
            }
        }
        let there = |(file, bytes): &&(PathBuf, Vec<u8>)| {
            let path = self.out.join(file);
            // What is there already as it would be written is in nobody's way.
            path.exists() && !std::fs::read(&path).is_ok_and(|found| found == *bytes)
        };
        if let Some((file, _)) = files.iter().find(there).filter(|_| !self.force) {
            let path = self.out.join(file);
            return Err(Failure::refused(format!(
                "{} is there already; write elsewhere by --out, or over it by --force",
                path.display()
            )));
        }
        for (file, bytes) in &files {
            super::write(&self.out.join(file), bytes)?;
        }
        for (name, _) in &found {
            let path = self.out.join(format!("{name}.yaml"));
            console.result(&path.display().to_string())?;
        }
        if let [(name, _)] = found[..] {
            console.tell(&format!("run it by: ao4d run {}", self.out.join(format!("{name}.yaml")).display()));
        }
        Ok(Outcome::Done)
    }
}

fn schema() -> Result<Vec<u8>, Failure> {
    let text = serde_json::to_string_pretty(&ao4d::pipeline::schema()).map_err(|e| Failure::Failed(Box::new(e)))?;
    Ok((text + "\n").into_bytes())
}

/// Characters of what a list says of an example.
const LONGEST: usize = 90;

/// What those of the thesis begin with; their names say it too.
const THESIS: &str = "Djami, Ambient Occlusion in 4D (2021), ";

/// What an example shows: the first sentence of the comment that opens it.
fn about(text: &str) -> String {
    let comment: Vec<&str> = text.lines().map_while(|line| line.strip_prefix('#')).map(str::trim).collect();
    let comment = comment.join(" ");
    let comment = comment.trim_start_matches(THESIS);
    let mut ends = comment.match_indices([';', '.']).map(|(at, _)| at);
    let is_end = |&at: &usize| {
        comment[at + 1..].starts_with(' ') && !comment[..at].ends_with("Fig") && !comment[..at].ends_with("Figs")
    };
    let first = comment[..ends.find(is_end).unwrap_or(comment.len())].trim_end_matches('.');
    match first.char_indices().nth(LONGEST) {
        None => first.to_owned(),
        Some((end, _)) => format!("{} ...", first[..end].rsplit_once(' ').map_or(first, |(words, _)| words)),
    }
}
