//! VTK's `.vtu`: unstructured grids of triangles or tetrahedra, through `vtkio`.
//!
//! Where a file holds cells of several kinds, those of the highest dimension count (meshers add the boundary's triangles
//! to a solid); anything of that dimension that is no simplex is refused.

use std::io::Cursor;

use vtkio::model::{Attribute, CellType, DataSet, ElementType, IOBuffer, Piece, UnstructuredGridPiece, VertexNumbers};

use super::{Cells, FileMesh, PointArray};
use crate::geometry::Vector64;

pub fn read(bytes: &[u8]) -> Result<FileMesh, String> {
    let vtk = vtkio::Vtk::parse_xml(Cursor::new(bytes)).map_err(|e| format!("is cut off, or no .vtu file: {e}"))?;
    let DataSet::UnstructuredGrid { pieces, .. } = vtk.data else {
        return Err("holds no unstructured grid".into());
    };
    let mut pieces = pieces.into_iter();
    match (pieces.next(), pieces.next()) {
        (Some(Piece::Inline(piece)), None) => mesh(*piece),
        (None, _) => Err("holds no piece".into()),
        _ => Err("holds several pieces; merge them into one".into()),
    }
}

fn mesh(piece: UnstructuredGridPiece) -> Result<FileMesh, String> {
    let coordinates = numbers(piece.points).ok_or("its points are no numbers")?;
    if coordinates.len() % 3 != 0 {
        return Err(format!("its points have {} coordinates, not three each", coordinates.len()));
    }
    let points = coordinates.chunks_exact(3).map(Vector64::from_column_slice).collect();
    let cells = cells(&piece.cells.types, lists(piece.cells.cell_verts)?)?;
    let mut point_arrays = Vec::new();
    for attribute in piece.data.point {
        if let Attribute::DataArray(array) = attribute {
            let components = match array.elem {
                ElementType::Generic(n) => n as usize,
                ElementType::Scalars { num_comp, .. } => num_comp as usize,
                _ => 3,
            };
            if let Some(values) = numbers(array.data) {
                point_arrays.push(PointArray { name: array.name, components, values });
            }
        }
    }
    Ok(FileMesh { points, cells, point_arrays })
}

/// The vertices of each cell.
fn lists(vertices: VertexNumbers) -> Result<Vec<Vec<u32>>, String> {
    let index = |i: u64| u32::try_from(i).map_err(|_| format!("a cell names point {i}, beyond 2^32"));
    match vertices {
        VertexNumbers::XML { connectivity, offsets } => {
            let ends = offsets.strip_prefix(&[0]).unwrap_or(&offsets);
            let mut start = 0;
            ends.iter()
                .enumerate()
                .map(|(cell, &end)| {
                    let list = connectivity.get(start..end as usize).ok_or_else(|| {
                        format!("cell {cell} takes entries {start} to {end} of {}", connectivity.len())
                    })?;
                    start = end as usize;
                    list.iter().map(|&i| index(i)).collect()
                })
                .collect()
        }
        VertexNumbers::Legacy { .. } => Err("its cells are in the legacy form".into()),
    }
}

fn cells(types: &[CellType], lists: Vec<Vec<u32>>) -> Result<Cells, String> {
    if types.len() != lists.len() {
        return Err(format!("has {} cell types for {} cells", types.len(), lists.len()));
    }
    let highest = types.iter().map(|&kind| dimension(kind)).max().unwrap_or(0);
    let of_highest = || types.iter().zip(&lists).enumerate().filter(|(_, (kind, _))| dimension(**kind) == highest);
    let simplex = if highest == 3 { CellType::Tetra } else { CellType::Triangle };
    if let Some((i, (kind, _))) = of_highest().find(|(_, (kind, _))| **kind != simplex) {
        return Err(format!(
            "cell {i} is of type {kind:?}; only triangles and tetrahedra are read (ParaView's Tetrahedralize makes them)"
        ));
    }
    let wrong = |(i, list): (usize, &Vec<u32>)| format!("cell {i} is a {simplex:?} of {} points", list.len());
    if highest == 3 {
        let cell =
            |(i, (_, list)): (usize, (&CellType, &Vec<u32>))| list.as_slice().try_into().map_err(|_| wrong((i, list)));
        Ok(Cells::Tetrahedra(of_highest().map(cell).collect::<Result<_, _>>()?))
    } else {
        let cell =
            |(i, (_, list)): (usize, (&CellType, &Vec<u32>))| list.as_slice().try_into().map_err(|_| wrong((i, list)));
        Ok(Cells::Triangles(of_highest().map(cell).collect::<Result<_, _>>()?))
    }
}

fn dimension(kind: CellType) -> usize {
    use CellType as C;
    match kind {
        C::Vertex | C::PolyVertex => 0,
        C::Line | C::PolyLine | C::QuadraticEdge | C::CubicLine => 1,
        C::Triangle | C::TriangleStrip | C::Polygon | C::Pixel | C::Quad => 2,
        C::QuadraticTriangle | C::BiquadraticTriangle | C::QuadraticQuad | C::BiquadraticQuad => 2,
        _ => 3,
    }
}

fn numbers(buffer: IOBuffer) -> Option<Vec<f64>> {
    buffer.cast_into::<f64>()
}
