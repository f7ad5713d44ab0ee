//! `.vtu`, VTK's mesh file: the scene's simplices at the places where the camera sees them.
//!
//! Every array stands in the XML as base64, behind its length in 64 bits, so that whatever reads XML reads the file. The mesh
//! is in memory as a whole, its text is not. The points lie in ParaView's 3D, so what they were in 4D goes into a `position`
//! array.

use std::io::{BufRead, Write};

use super::Error;
use super::inline::{File, check, check_indices};
use super::vtk::cell::{TETRAHEDRON, TRIANGLE};
use crate::volume::{Array, Kind};

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
    write_told(sink, points, cells, point_arrays, cell_arrays, &[])
}

/// The same with texts in the field data, each under its name.
///
/// # Errors
/// As [`write()`], and if a name can't be written.
pub fn write_told(
    sink: impl Write,
    points: &[[f32; 3]],
    cells: Cells<'_>,
    point_arrays: &[Array],
    cell_arrays: &[Array],
    texts: &[(&str, &str)],
) -> Result<(), Error> {
    let (flat, size, kind) = match cells {
        Cells::Triangles(c) => (c.as_flattened(), 3, TRIANGLE),
        Cells::Tetrahedra(c) => (c.as_flattened(), 4, TETRAHEDRON),
    };
    let count = flat.len() / size;
    check_indices(flat, points.len())?;
    check(point_arrays, points.len())?;
    check(cell_arrays, count)?;
    let mut file = File { sink };
    let piece = format!("NumberOfPoints=\"{}\" NumberOfCells=\"{count}\"", points.len());
    write!(
        file.sink,
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" \
         header_type=\"UInt64\">\n<UnstructuredGrid>\n"
    )?;
    file.texts(texts)?;
    write!(file.sink, "<Piece {piece}>\n<PointData>\n")?;
    point_arrays.iter().try_for_each(|array| file.array(array))?;
    file.text("</PointData>\n<CellData>\n")?;
    cell_arrays.iter().try_for_each(|array| file.array(array))?;
    file.text("</CellData>\n<Points>\n")?;
    file.points(points)?;
    file.text("</Points>\n<Cells>\n")?;
    file.cells(flat, size)?;
    file.data("types", Kind::U8, 1, count, |range, bytes| bytes.extend(range.map(|_| kind)))?;
    file.text("</Cells>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n")?;
    Ok(file.sink.flush()?)
}

/// Copies a file that this writer made, with another text in its field data under this name.
///
/// # Errors
/// If it has no such text, or reading or writing fails.
pub fn retell(mut source: impl BufRead, mut sink: impl Write, text: (&str, &str)) -> Result<(), Error> {
    super::vtk::text::retell(&mut source, &mut sink, text, |_, _| Ok(()))
}

#[cfg(test)]
mod tests {
    use std::io;

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
