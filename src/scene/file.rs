//! A surface from a file: in 4D a `.vtu` of tetrahedra, in 3D triangles from any mesh file that is read.
//!
//! A VTK file's points have three coordinates, so those of a 4D surface are in a point array of four components named
//! `position`, as this program writes them. In 3D such an array, of three components, wins over the points as well. A point
//! array `normal` of as many components, where there is one, is taken for the normals. Vertices keep their order; only STL,
//! which has none, is welded.

use std::path::Path;

use super::Error;
use super::numbers::MAX_SIMPLICES;
use super::welding::Weld;
use crate::geometry::{Dimension, Vector64};
use crate::io::Input;
use crate::io::mesh::Cells;
use crate::mesh::topology::facet_pairs;
use crate::mesh::weld::weld as welded;
use crate::mesh::{Surface, crossings};

/// The most triangles that are looked at to see whether they pass through each other: more would cost more than reading them.
const MOST_CROSSED: usize = 10_000;

/// The surface that the file holds.
pub fn build<const D: usize>(
    path: &Path,
    folder: &Path,
    weld: Weld,
    notes: &mut Vec<String>,
) -> Result<Surface<D>, Error> {
    let input = Input::new("file", folder, path);
    let mesh = input.read()?;
    notes.extend(mesh.notes.iter().map(|note| format!("file: {note}")));
    let position = mesh.vectors::<D>("position", &input)?;
    let normals = mesh.vectors::<D>("normal", &input)?;
    let simplices: Option<Vec<[u32; D]>> = match &mesh.cells {
        Cells::Triangles(triangles) => of_size(triangles),
        Cells::Tetrahedra(tetrahedra) => of_size(tetrahedra),
    };
    let Some(simplices) = simplices else {
        let message = match Dimension::of::<D>() {
            Dimension::Three => "holds tetrahedra; a scene of dimension 3 is made of triangles",
            Dimension::Four => {
                "holds triangles; a scene of dimension 4 is made of tetrahedra: take extrude, or dimension: 3"
            }
        };
        return Err(input.wrong(message).into());
    };
    if simplices.len() as u64 > MAX_SIMPLICES {
        return Err(input.wrong(format!("holds {} simplices; the most is {MAX_SIMPLICES}", simplices.len())).into());
    }
    let vertices = match (position, Dimension::of::<D>()) {
        (Some(position), _) => position,
        (None, Dimension::Three) => mesh.points.iter().map(|p| Vector64::from_fn(|row, _| p[row])).collect(),
        (None, Dimension::Four) => {
            let message =
                "has no point array \"position\" of 4 components; extrude sweeps a three-dimensional mesh along w";
            return Err(input.wrong(message).into());
        }
    };
    let mut surface = Surface { vertices, simplices, normals };
    if weld.wanted() {
        let (kept, simplices) = weld.kept(&surface.vertices, surface.simplices, notes)?;
        let vertices = kept.iter().map(|&i| surface.vertices[i as usize]).collect();
        let normals = surface.normals.map(|normals| kept.iter().map(|&i| normals[i as usize]).collect());
        surface = Surface { vertices, simplices, normals };
    }
    notes.extend(crossing(&surface).map(|crossing| input.wrong(crossing).to_string()));
    Ok(surface)
}

/// Where a closed surface in 3D passes through itself, in words, if it is not too large to look.
fn crossing<const D: usize>(surface: &Surface<D>) -> Option<String> {
    if D != 3 || surface.simplices.len() > MOST_CROSSED {
        return None;
    }
    let (points, triangles) = welded(&surface.vertices, surface.simplices.clone());
    let is_closed = facet_pairs(&triangles).is_closed();
    let crossing = is_closed.then(|| crossings::told_if_few(&points, &triangles, MOST_CROSSED)).flatten();
    crossing.map(|crossing| {
        format!("{crossing}; what is inside another body is dark: unite them in the program that made them if that isn't wanted")
    })
}

/// The simplices, if N is D.
fn of_size<const N: usize, const D: usize>(simplices: &[[u32; N]]) -> Option<Vec<[u32; D]>> {
    simplices.iter().map(|simplex| simplex.as_slice().try_into().ok()).collect()
}
