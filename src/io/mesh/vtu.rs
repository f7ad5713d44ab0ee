//! VTK's `.vtu`: unstructured grids of triangles or tetrahedra, in whatever encoding, through [`crate::io::vtk`].
//!
//! Where a file holds cells of several kinds, those of the highest dimension count (meshers add the boundary's triangles
//! to a solid); anything of that dimension that is no simplex is refused.

use super::{Cells, FileMesh, PointArray};
use crate::geometry::Vector64;
use crate::io::vtk::{self, DataSet, TETRAHEDRON, TRIANGLE, UnstructuredGrid, cell_name};

pub fn read(bytes: &[u8]) -> Result<FileMesh, String> {
    let DataSet::Unstructured(grid) = vtk::parse(bytes).map_err(|problem| problem.to_string())? else {
        return Err("holds an image, where a mesh was expected".into());
    };
    let points = grid.points.iter().map(|&p| Vector64::from(p)).collect();
    let cells = cells(&grid)?;
    let point_arrays = (grid.point_arrays.into_iter())
        .map(|a| PointArray { values: a.values.to_f64(), name: a.name, components: a.components })
        .collect();
    Ok(FileMesh { points, cells, point_arrays })
}

fn cells(grid: &UnstructuredGrid) -> Result<Cells, String> {
    let highest = grid.types.iter().map(|&kind| dimension(kind)).max().unwrap_or(0);
    if highest == 3 {
        simplices(grid, TETRAHEDRON).map(Cells::Tetrahedra)
    } else {
        simplices(grid, TRIANGLE).map(Cells::Triangles)
    }
}

/// The cells of one kind; cells of lower dimension are passed over, all others refused.
fn simplices<const N: usize>(grid: &UnstructuredGrid, wanted: u8) -> Result<Vec<[u32; N]>, String> {
    let highest = dimension(wanted);
    let simplex = |(i, (kind, points)): (usize, (u8, &[u32]))| {
        if kind != wanted {
            return Err(format!(
                "cell {i} is of type {}; only triangles and tetrahedra are read (ParaView's Tetrahedralize makes them)",
                cell_name(kind)
            ));
        }
        points.try_into().map_err(|_| format!("cell {i} is a {} of {} points", cell_name(kind), points.len()))
    };
    // A mesh of points and lines only has cells below a triangle's dimension, and is refused as one without triangles.
    grid.cells().enumerate().filter(|(_, (kind, _))| dimension(*kind) >= highest).map(simplex).collect()
}

/// How many dimensions a cell of this VTK type has; three for all that is not known to have fewer.
fn dimension(kind: u8) -> usize {
    match kind {
        0..=2 => 0,                          // nothing, one vertex, several
        3 | 4 | 21 | 35 | 68 | 75 => 1,      // lines, straight and curved
        5..=9 | 22 | 23 | 28 | 30 | 34 => 2, // triangles, strips, polygons, pixels, quadrilaterals, and curved ones
        36 | 69 | 70 | 76 | 77 => 2,         // curved polygons, Lagrange, Bezier
        _ => 3,
    }
}
