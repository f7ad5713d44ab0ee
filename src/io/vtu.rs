//! `.vtu`, VTK's mesh file: the scene's simplices at the places where the camera sees them.
//!
//! The `vtkio` crate writes it, with the arrays as base64 in the XML. The mesh is in memory as a whole, and once more
//! in the text. `vtkio` names no components and writes no field data; the points lie in ParaView's 3D, so what they
//! were in 4D goes into a `position` array.

use std::io::{self, Write};

use vtkio::model::{
    Attribute, Attributes, ByteOrder, CellType, Cells as VtkCells, DataArray, DataSet, ElementType, IOBuffer, Piece,
    UnstructuredGridPiece, Version, VertexNumbers, Vtk,
};

use super::Error;
use crate::volume::{Array, Values};

/// The cells of a mesh, as indices into its points.
#[derive(Clone, Copy, Debug)]
pub enum Cells<'a> {
    /// Of a 3D scene's surface.
    Triangles(&'a [[u32; 3]]),
    /// Of a 4D scene's surface.
    Tetrahedra(&'a [[u32; 4]]),
}

/// Writes a mesh.
///
/// # Errors
/// If an array does not have a tuple for each point or cell, two have one name, an index is out of range, or the sink
/// fails.
pub fn write(
    sink: impl Write,
    points: &[[f32; 3]],
    cells: Cells<'_>,
    point_arrays: &[Array],
    cell_arrays: &[Array],
) -> Result<(), Error> {
    let (flat, size, kind) = match cells {
        Cells::Triangles(c) => (c.as_flattened(), 3, CellType::Triangle),
        Cells::Tetrahedra(c) => (c.as_flattened(), 4, CellType::Tetra),
    };
    let count = flat.len() / size;
    if let Some(p) = flat.iter().find(|&&p| p as usize >= points.len()) {
        let (found, expected) = (format!("point {p}"), format!("one of {}", points.len()));
        return Err(Error::Shape { array: "connectivity".into(), found, expected });
    }
    let cell_verts = VertexNumbers::XML {
        connectivity: flat.iter().map(|&p| p.into()).collect(),
        offsets: (1..=count).map(|i| (i * size) as u64).collect(),
    };
    let piece = UnstructuredGridPiece {
        points: IOBuffer::F32(points.as_flattened().to_vec()),
        cells: VtkCells { cell_verts, types: vec![kind; count] },
        data: Attributes { point: attributes(point_arrays, points.len())?, cell: attributes(cell_arrays, count)? },
    };
    let vtk = Vtk {
        version: Version::new_xml(1, 0),
        title: String::new(),
        byte_order: ByteOrder::LittleEndian,
        data: DataSet::UnstructuredGrid { meta: None, pieces: vec![Piece::Inline(Box::new(piece))] },
        file_path: None,
    };
    let mut sink = Watched { sink, failure: None };
    let failed = |e: vtkio::Error| Error::Mesh(e.to_string());
    if count > 0 {
        let result = vtk.write_xml(&mut sink);
        if let Some(cause) = sink.failure.take() {
            return Err(cause.into());
        }
        result.map_err(failed)?;
    } else {
        // vtkio leaves out counts of zero, without which VTK reads nothing at all.
        let mut bytes = Vec::new();
        vtk.write_xml(&mut bytes).map_err(failed)?;
        let points = if points.is_empty() { " NumberOfPoints=\"0\"" } else { "" };
        let piece = format!("<Piece{points} NumberOfCells=\"0\"");
        sink.sink.write_all(String::from_utf8_lossy(&bytes).replacen("<Piece", &piece, 1).as_bytes())?;
    }
    sink.flush()?;
    Ok(())
}

/// A sink that keeps its first error, as vtkio hands on only a text of it.
struct Watched<W> {
    sink: W,
    failure: Option<io::Error>,
}

impl<W: Write> Write for Watched<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.sink.write(bytes).map_err(|e| {
            let told = io::Error::from(e.kind());
            // An interrupted call is tried again, and is no failure.
            if e.kind() != io::ErrorKind::Interrupted {
                self.failure.get_or_insert(e);
            }
            told
        })
    }

    fn flush(&mut self) -> io::Result<()> {
        self.sink.flush()
    }
}

/// Arrays as vtkio wants them, after the checks that it leaves out.
fn attributes(arrays: &[Array], tuples: usize) -> Result<Vec<Attribute>, Error> {
    let mut attributes: Vec<Attribute> = Vec::new();
    for array in arrays {
        let shape = |found: String, expected: String| Error::Shape { array: array.name.clone(), found, expected };
        if array.components.checked_mul(tuples) != Some(array.values.len()) || array.components == 0 {
            let expected = format!("{tuples} tuples of {}", array.components);
            return Err(shape(format!("{} numbers", array.values.len()), expected));
        }
        if attributes.iter().any(|a| a.name() == array.name) {
            return Err(shape("the name a second time".into(), "another name".into()));
        }
        if array.name.is_empty() || array.name.contains(|c: char| c.is_control()) {
            return Err(Error::Name { what: "the array name", name: array.name.clone() });
        }
        attributes.push(Attribute::DataArray(DataArray {
            name: array.name.clone(),
            elem: ElementType::Generic(array.components as u32),
            data: buffer(&array.values),
        }));
    }
    Ok(attributes)
}

fn buffer(values: &Values) -> IOBuffer {
    match values.clone() {
        Values::I8(v) => IOBuffer::I8(v),
        Values::U8(v) => IOBuffer::U8(v),
        Values::I16(v) => IOBuffer::I16(v),
        Values::U16(v) => IOBuffer::U16(v),
        Values::I32(v) => IOBuffer::I32(v),
        Values::U32(v) => IOBuffer::U32(v),
        Values::I64(v) => IOBuffer::I64(v),
        Values::U64(v) => IOBuffer::U64(v),
        Values::F32(v) => IOBuffer::F32(v),
        Values::F64(v) => IOBuffer::F64(v),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::vtk;

    fn arrays() -> Vec<Array> {
        vec![
            Array::new("position", 4, (0..20).map(|i| i as f32 / 3.0).collect::<Vec<_>>()),
            Array::new("ambient_occlusion", 1, vec![0f32, 0.25, 0.5, 0.75, 1.0]),
            Array::new("object", 1, vec![1u16, 1, 2, 2, 65535]),
        ]
    }

    const POINTS: [[f32; 3]; 5] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0 / 3.0], [1.0; 3]];

    #[test]
    fn what_is_written_is_read_back() {
        let cell = [Array::new("measure", 1, vec![0.1f64, 0.2])];
        let mut bytes = Vec::new();
        let tetrahedra = [[0, 1, 2, 3], [1, 2, 3, 4]];
        write(&mut bytes, &POINTS, Cells::Tetrahedra(&tetrahedra), &arrays(), &cell).unwrap();
        let vtk::DataSet::Unstructured(grid) = vtk::parse(&bytes).unwrap() else { panic!("no mesh") };
        assert_eq!(grid.points, POINTS.map(|p| p.map(f64::from)));
        assert_eq!(grid.simplices::<4>().unwrap(), tetrahedra);
        assert!(grid.simplices::<3>().is_err());
        assert_eq!(grid.point_arrays, arrays());
        assert_eq!(grid.cell_arrays, cell);
    }

    #[test]
    fn triangles_and_nothing() {
        for (points, triangles) in [(&POINTS[..], &[[0, 1, 2]][..]), (&POINTS, &[]), (&[], &[])] {
            let mut bytes = Vec::new();
            write(&mut bytes, points, Cells::Triangles(triangles), &[], &[]).unwrap();
            let vtk::DataSet::Unstructured(grid) = vtk::parse(&bytes).unwrap() else { panic!("no mesh") };
            assert_eq!(grid.simplices::<3>().unwrap(), triangles);
            assert_eq!(grid.points.len(), points.len());
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_is_named_as_such() {
        let full = || std::fs::File::options().write(true).open("/dev/full").unwrap();
        for cells in [&[[0, 1, 2]][..], &[]] {
            for sink in [Box::new(full()) as Box<dyn Write>, Box::new(io::BufWriter::new(full()))] {
                let error = write(sink, &POINTS, Cells::Triangles(cells), &[], &[]).unwrap_err().to_string();
                assert!(error.contains("No space left on device"), "{error}");
            }
        }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let write =
            |cells: &[[u32; 4]], arrays: &[Array]| write(Vec::new(), &POINTS, Cells::Tetrahedra(cells), arrays, &[]);
        assert!(write(&[[0, 1, 2, 5]], &[]).is_err());
        assert!(write(&[], &[Array::new("a", 1, vec![0u8; 4])]).is_err());
        assert!(write(&[], &[Array::new("a", 1, vec![0u8; 5]), Array::new("a", 1, vec![0u8; 5])]).is_err());
    }
}
