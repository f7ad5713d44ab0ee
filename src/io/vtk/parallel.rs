//! `.pvti`, `.pvtu` and `.pvtp`: a list of files, each a piece of one image or mesh, as parallel programs write them.
//!
//! The list says of an image how large it is and where it lies; what the pieces hold, they say themselves.

use std::path::{Path, PathBuf};

use super::data_array::field_data;
use super::document::{Document, numbers, required};
use super::pieces::Piece;
use super::{DataSet, Problem, image, mesh, with_document};

/// The data set of a list.
pub(super) fn read(document: &Document<'_>, path: &Path) -> Result<DataSet, Problem> {
    let head = (document.kind == "PImageData").then(|| image::head(document.data_set)).transpose()?;
    let (mut blocks, mut meshes) = (Vec::new(), Vec::new());
    let mut any = false;
    for node in document.pieces() {
        // VTK leaves out the file of a piece that is empty.
        let Some(source) = node.attribute("Source").filter(|source| !source.is_empty()) else {
            required(node, "Extent")?;
            continue;
        };
        any = true;
        let named = |cause: String| Problem::Piece { file: source.into(), cause };
        let bytes = crate::input::read(&beside(path, source)).map_err(|e| named(format!("cannot be read: {e}")))?;
        let budget = document.budget.get();
        let left = with_document(&bytes, document.wanted, budget, |piece| {
            match (&head, piece.kind) {
                (Some(head), "ImageData") => {
                    let extent = numbers(node, "Extent", image::BOUNDS)?;
                    blocks.extend(placed(head, extent, piece)?);
                }
                (None, kind) if Some(kind) == document.kind.strip_prefix('P') => meshes.push(mesh::read(piece)?),
                (_, kind) => {
                    let found = format!("{kind}, in a list of the kind {}", document.kind);
                    return Err(Problem::Kind { found, expected: "a piece of the same kind" });
                }
            }
            Ok(piece.budget.get())
        });
        document.budget.set(left.map_err(|problem| named(problem.to_string()))?);
    }
    if !any {
        return Err(Problem::Missing { element: document.kind.into(), lacks: "pieces that name a `Source`".into() });
    }
    let own = field_data(document)?;
    Ok(match head {
        Some(head) => DataSet::Image(head.image(document, blocks, own)?),
        None => {
            let mut whole = mesh::joined(meshes)?;
            if !own.is_empty() {
                whole.field_data = own;
            }
            DataSet::Unstructured(whole)
        }
    })
}

/// The blocks of one file, where the list says that it lies.
fn placed(head: &image::Head, listed: Option<[i64; 6]>, piece: &Document<'_>) -> Result<Vec<Piece>, Problem> {
    let own = image::head(piece.data_set)?;
    let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(x, y)| (x - y).abs() <= 1e-5 * x.abs().max(1e-300));
    if !near(&head.grid.spacing, &own.grid.spacing) {
        let (there, here) = (own.grid.spacing, head.grid.spacing);
        return Err(Problem::Pieces { problem: format!("differ: one has the spacing {there:?}, the whole {here:?}") });
    }
    let mut blocks = image::pieces(piece, own.extent)?;
    let Some(listed) = listed.filter(|&listed| listed != own.extent) else { return Ok(blocks) };
    // Some programs count the points of each file from 0.
    let size = |e: [i64; 6], a: usize| e[2 * a + 1].checked_sub(e[2 * a]);
    if (0..3).any(|a| size(listed, a) != size(own.extent, a)) {
        let there = own.extent;
        return Err(Problem::Pieces {
            problem: format!("differ: one has the extent {there:?}, by the list {listed:?}"),
        });
    }
    for block in &mut blocks {
        for i in 0..6 {
            let shift = listed[i].checked_sub(own.extent[i]);
            let moved = shift.and_then(|shift| block.extent[i].checked_add(shift));
            block.extent[i] = moved.ok_or_else(|| Problem::Pieces { problem: "lie beyond all numbers".into() })?;
        }
    }
    Ok(blocks)
}

/// The files that a list names; none if it is no such list.
pub(super) fn files(document: &Document<'_>, path: &Path) -> Vec<PathBuf> {
    let sources = document.pieces().filter_map(|node| node.attribute("Source")).filter(|source| !source.is_empty());
    if document.kind.starts_with('P') { sources.map(|source| beside(path, source)).collect() } else { Vec::new() }
}

/// A file that another names.
fn beside(path: &Path, name: &str) -> PathBuf {
    path.parent().unwrap_or(Path::new("")).join(name)
}
