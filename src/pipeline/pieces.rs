//! The pieces of a run as `ao4d merge` finds them: all there, and all of one pipeline, or refused with what is wrong.
//!
//! Each piece's cache knows the keys of its files, so a piece of another pipeline, seed, input or program is told from one that
//! fits; a small file beside it has the text that it tells, from which the complaint says in what they differ.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::Pipeline;
use super::cache::Cache;
use crate::io;
use crate::stages::key::program;
use crate::stages::piece::{self, Joined, MOST};
use crate::stages::write::{PROGRAM, write_whole};
use crate::stages::{Keys, Piece, Plan};
use crate::text::shortened;

/// The file's name in a piece's folder.
pub(super) const NAME: &str = ".ao4d-piece.json";
/// So many pieces are named where more are wrong.
const NAMED: usize = 12;

/// Why pieces can't be joined.
#[derive(Debug, thiserror::Error)]
pub enum PiecesError {
    /// There are none.
    #[error(
        "there are no pieces in {}; make them by `ao4d run --piece K/N`, or name their folder's parent by --out",
        out
    )]
    None {
        /// Where they would be.
        out: String,
    },
    /// There are pieces of several runs.
    #[error("{out} has pieces of several runs: of {counts}; say which by --pieces N")]
    Several {
        /// Where.
        out: String,
        /// Of how many pieces each.
        counts: String,
    },
    /// Some aren't there, or not whole.
    #[error(
        "{which} of {count} {verb} missing or unfinished; make {them} by `ao4d run --piece K/{count}`, then merge again"
    )]
    Missing {
        /// The pieces.
        which: String,
        /// How many there should be.
        count: usize,
        /// One is, several are.
        verb: &'static str,
        /// It or them.
        them: &'static str,
    },
    /// Some are of something else.
    #[error("{which} of {count} can't be joined: {why}; run {them} again by `ao4d run --piece K/{count}`")]
    Foreign {
        /// The pieces.
        which: String,
        /// How many there are.
        count: usize,
        /// In what the first of them differs.
        why: String,
        /// It or them.
        them: &'static str,
    },
}

/// What a piece tells of itself.
#[derive(Serialize, Deserialize, PartialEq)]
struct Told {
    program: String,
    /// Which build of that.
    build: String,
    pipeline: String,
}

/// Lets a piece tell what it is of.
pub(super) fn tell(plan: &Plan, text: &str) -> Result<(), io::Error> {
    let path = plan.out.join(NAME);
    let told = Told { program: PROGRAM.to_owned(), build: program(), pipeline: text.to_owned() };
    if read(&path).is_some_and(|known| known == told) {
        return Ok(());
    }
    write_whole(&path, serde_json::to_string(&told).unwrap_or_default().as_bytes()).map(drop)
}

fn read(path: &Path) -> Option<Told> {
    serde_json::from_str(&crate::input::read_text(path).ok()?).ok()
}

/// The pieces of this run: of so many, or of as many as there are folders for.
pub(super) fn find(pipeline: &Pipeline, count: Option<usize>) -> Result<Joined, PiecesError> {
    let out = &pipeline.plan.out;
    if let Some(count) = count {
        return Ok(Joined::new(out, count));
    }
    let mut counts: Vec<usize> = Vec::new();
    for entry in std::fs::read_dir(out).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let count = name.strip_prefix(piece::FOLDER).and_then(|n| n.parse().ok()).filter(|n| (1..=MOST).contains(n));
        counts.extend(count.filter(|count| piece::folder(out, *count).is_dir()));
    }
    counts.sort_unstable();
    match counts[..] {
        [] => Err(PiecesError::None { out: out.display().to_string() }),
        [count] => Ok(Joined::new(out, count)),
        _ => {
            let counts: Vec<String> = counts.iter().map(ToString::to_string).collect();
            Err(PiecesError::Several { out: out.display().to_string(), counts: counts.join(", of ") })
        }
    }
}

/// Refuses pieces that aren't there, or whose files are not those that they would make of this pipeline.
pub(super) fn check(pipeline: &Pipeline, keys: &Keys, text: &str, joined: &Joined) -> Result<(), PiecesError> {
    let (plan, count) = (&pipeline.plan, joined.count());
    let (mut missing, mut foreign, mut why) = (Vec::new(), Vec::new(), None);
    for piece in Piece::all(count) {
        let folder = piece.folder(&plan.out);
        let cache = Cache::open(&folder, false);
        let outputs: Vec<_> = (0..plan.stages.len()).flat_map(|stage| plan.left_by(stage, keys, piece)).collect();
        let files =
            || outputs.iter().flat_map(|o| std::iter::once(&o.file).chain(&o.beside).map(|file| (file, &o.key)));
        if files().all(|(file, key)| cache.is_fresh(file, key)) {
            continue;
        }
        // What is of another pipeline is no better for being whole.
        match read(&folder.join(NAME)).and_then(|told| difference(&told, text)) {
            Some(difference) => {
                why.get_or_insert(difference);
                foreign.push(piece.index());
            }
            None => missing.push(piece.index()),
        }
    }
    if let Some(why) = why {
        let them = if foreign.len() == 1 { "it" } else { "them" };
        return Err(PiecesError::Foreign { which: named(&foreign), count, why, them });
    }
    let (verb, them) = if missing.len() == 1 { ("is", "it") } else { ("are", "them") };
    match missing.is_empty() {
        true => Ok(()),
        false => Err(PiecesError::Missing { which: named(&missing), count, verb, them }),
    }
}

/// In what a piece differs from what is to be joined.
fn difference(told: &Told, text: &str) -> Option<String> {
    if told.program != PROGRAM {
        return Some(format!("it was made by {}, and this is {PROGRAM}", told.program));
    }
    let (mut theirs, mut ours) = (told.pipeline.lines(), text.lines());
    let build = || "it was made by another build of the program, whose file has another length or time".to_owned();
    loop {
        match (theirs.next(), ours.next()) {
            (None, None) => return (told.build != program()).then(build),
            (a, b) if a == b => {}
            (a, b) => {
                let line = |line: Option<&str>| {
                    line.map_or("nothing".to_owned(), |l| format!("`{}`", shortened(l.trim(), 80)))
                };
                return Some(format!("its pipeline says {} where this one says {}", line(a), line(b)));
            }
        }
    }
}

/// Pieces by their numbers, ranges of them in short.
fn named(pieces: &[usize]) -> String {
    let mut ranges: Vec<(usize, usize)> = Vec::new();
    for &piece in pieces {
        match ranges.last_mut() {
            Some((_, last)) if *last + 1 == piece => *last = piece,
            _ => ranges.push((piece, piece)),
        }
    }
    let more = ranges.len().saturating_sub(NAMED);
    let range =
        |&(first, last): &(usize, usize)| if first == last { first.to_string() } else { format!("{first} to {last}") };
    let mut text = ranges.iter().take(NAMED).map(range).collect::<Vec<_>>().join(", ");
    if more > 0 {
        text += &format!(" and {more} more");
    }
    format!("{} {text}", if pieces.len() == 1 { "piece" } else { "pieces" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_named_in_short() {
        assert_eq!(named(&[3]), "piece 3");
        assert_eq!(named(&[0, 1, 2, 5, 7, 8]), "pieces 0 to 2, 5, 7 to 8");
        let every_other: Vec<usize> = (0..100).step_by(2).collect();
        assert!(named(&every_other).ends_with("22 and 38 more"));
    }

    #[test]
    fn a_difference_is_told_by_its_line() {
        let told = |name: &str, pipeline: &str| Told {
            program: name.to_owned(),
            build: program(),
            pipeline: pipeline.to_owned(),
        };
        let other = Told { build: "other".to_owned(), ..told(PROGRAM, "") };
        assert!(difference(&other, "").unwrap().contains("another build"));
        assert_eq!(difference(&told(PROGRAM, "seed: 1\n"), "seed: 1\n"), None);
        let seed = difference(&told(PROGRAM, "name: a\nseed: 2\n"), "name: a\nseed: 1\n").unwrap();
        assert_eq!(seed, "its pipeline says `seed: 2` where this one says `seed: 1`");
        assert!(difference(&told("ao4d 0.0.1", ""), "").unwrap().starts_with("it was made by ao4d 0.0.1, and this is"));
    }
}
