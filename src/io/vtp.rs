//! `.vtp`, VTK's file of lines and triangles in space: slices and wireframes.
//!
//! It is written as [`super::vtu`] is, every array as base64 in the XML.

use std::io::{BufRead, Write};

use super::Error;
use super::inline::{File, check, check_indices};
use crate::volume::Array;

/// The cells of a file, as indices into its points.
#[derive(Clone, Copy, Debug)]
pub enum Cells<'a> {
    /// Straight lines between two points.
    Lines(&'a [[u32; 2]]),
    /// Triangles.
    Triangles(&'a [[u32; 3]]),
}

/// Writes points, cells over them, and texts in the field data, each under its name.
///
/// # Errors
/// If an array does not have a tuple for each point or cell, two have one name, a name can't be written, an index is out
/// of range, or the sink fails.
pub fn write(
    sink: impl Write,
    points: &[[f32; 3]],
    cells: Cells<'_>,
    point_arrays: &[Array],
    cell_arrays: &[Array],
    texts: &[(&str, &str)],
) -> Result<(), Error> {
    let (flat, size) = match cells {
        Cells::Lines(lines) => (lines.as_flattened(), 2),
        Cells::Triangles(triangles) => (triangles.as_flattened(), 3),
    };
    let count = flat.len() / size;
    check_indices(flat, points.len())?;
    check(point_arrays, points.len())?;
    check(cell_arrays, count)?;
    let (lines, triangles) = if size == 2 { (count, 0) } else { (0, count) };
    let mut file = File { sink };
    file.text(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" \
         header_type=\"UInt64\">\n<PolyData>\n",
    )?;
    file.texts(texts)?;
    write!(
        file.sink,
        "<Piece NumberOfPoints=\"{}\" NumberOfVerts=\"0\" NumberOfLines=\"{lines}\" NumberOfStrips=\"0\" \
         NumberOfPolys=\"{triangles}\">\n<PointData>\n",
        points.len()
    )?;
    point_arrays.iter().try_for_each(|array| file.array(array))?;
    file.text("</PointData>\n<CellData>\n")?;
    cell_arrays.iter().try_for_each(|array| file.array(array))?;
    file.text("</CellData>\n<Points>\n")?;
    file.points(points)?;
    file.text("</Points>\n")?;
    let element = if size == 2 { "Lines" } else { "Polys" };
    writeln!(file.sink, "<{element}>")?;
    file.cells(flat, size)?;
    write!(file.sink, "</{element}>\n</Piece>\n</PolyData>\n</VTKFile>\n")?;
    Ok(file.sink.flush()?)
}

/// Copies a file that this writer made, with another text in its field data under this name.
///
/// # Errors
/// If it has no such text, or reading or writing fails.
pub fn retell(source: impl BufRead, sink: impl Write, text: (&str, &str)) -> Result<(), Error> {
    super::vtu::retell(source, sink, text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::vtk;

    const POINTS: [[f32; 3]; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0 / 3.0]];

    #[test]
    fn what_is_written_is_read_back() {
        let values = [Array::new("w", 1, vec![0f32, 0.25, 0.5, 0.75])];
        for (cells, expected) in [
            (Cells::Lines(&[[0, 1], [3, 2]]), vec![0, 1, 3, 2]),
            (Cells::Triangles(&[[0, 1, 2], [3, 2, 1]]), vec![0, 1, 2, 3, 2, 1]),
            (Cells::Triangles(&[]), vec![]),
            (Cells::Lines(&[]), vec![]),
        ] {
            let mut bytes = Vec::new();
            write(&mut bytes, &POINTS, cells, &values, &[], &[("told", "a <b>")]).unwrap();
            let vtk::DataSet::Unstructured(grid) = vtk::parse(&bytes).unwrap() else { panic!("no mesh") };
            assert_eq!(grid.points, POINTS.map(|p| p.map(f64::from)));
            assert_eq!((grid.connectivity, grid.point_arrays), (expected, values.to_vec()));
            let mut again = Vec::new();
            retell(&bytes[..], &mut again, ("told", "a <b>")).unwrap();
            assert_eq!(again, bytes);
        }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let write = |cells: Cells<'_>, arrays: &[Array]| write(Vec::new(), &POINTS, cells, arrays, &[], &[]);
        assert!(write(Cells::Lines(&[[0, 4]]), &[]).is_err());
        assert!(write(Cells::Lines(&[[0, 1]]), &[Array::new("a", 1, vec![0u8; 3])]).is_err());
    }
}
