//! `.pvti` and `.pvtu`: lists of the parts of one image or mesh, each a file of its own.
//!
//! ParaView's servers read such a file together, each its share of the parts. Parts of an image are slabs of layers, and VTK
//! counts the cells between points: so a part must reach to the first layer of the next, or the cells between the two belong
//! to nobody and are refused.

use std::io::Write;
use std::ops::Range;

use super::Error;
use super::vti::{ArraySpec, head};
use super::xml::escape;
use crate::volume::{Array, Grid};

/// Writes the list of an image: its arrays, and the layers that each part holds, with its path relative to the list.
///
/// # Errors
/// If the sink fails, or a path can't be written.
pub fn image<'a>(
    mut sink: impl Write,
    grid: &Grid,
    arrays: &[ArraySpec],
    parts: impl IntoIterator<Item = (Range<usize>, &'a str)>,
) -> Result<(), Error> {
    let (extent, place) = (head::extent(grid, 0), head::place(grid));
    begin(&mut sink, "PImageData")?;
    writeln!(sink, "  <PImageData WholeExtent=\"{extent}\" GhostLevel=\"0\" {place}>")?;
    // As in the parts themselves.
    let scalars = arrays.iter().find(|array| array.name == "opacity").or(arrays.first());
    let scalars = scalars.map_or(String::new(), |array| format!(" Scalars=\"{}\"", escape(&array.name)));
    writeln!(sink, "    <PPointData{scalars}>")?;
    for array in arrays {
        writeln!(sink, "      <PDataArray {}/>", head::attributes(array))?;
    }
    writeln!(sink, "    </PPointData>")?;
    for (layers, file) in parts {
        let slab = Grid { dimensions: [grid.dimensions[0], grid.dimensions[1], layers.len().max(1)], ..*grid };
        writeln!(sink, "    <Piece Extent=\"{}\" Source=\"{}\"/>", head::extent(&slab, layers.start), name(file)?)?;
    }
    Ok(sink.write_all(b"  </PImageData>\n</VTKFile>\n")?)
}

/// Writes the list of a mesh with these arrays on its points; the paths are relative to the list.
///
/// # Errors
/// If the sink fails, or a path can't be written.
pub fn mesh<'a>(
    mut sink: impl Write,
    point_arrays: &[Array],
    parts: impl IntoIterator<Item = &'a str>,
) -> Result<(), Error> {
    begin(&mut sink, "PUnstructuredGrid")?;
    sink.write_all(b"  <PUnstructuredGrid GhostLevel=\"0\">\n    <PPointData>\n")?;
    for array in point_arrays {
        let (kind, name, components) = (array.values.kind().vtk_name(), escape(&array.name), array.components);
        writeln!(sink, "      <PDataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\"/>")?;
    }
    sink.write_all(b"    </PPointData>\n    <PCellData/>\n    <PPoints>\n")?;
    sink.write_all(b"      <PDataArray type=\"Float32\" Name=\"Points\" NumberOfComponents=\"3\"/>\n    </PPoints>\n")?;
    for file in parts {
        writeln!(sink, "    <Piece Source=\"{}\"/>", name(file)?)?;
    }
    Ok(sink.write_all(b"  </PUnstructuredGrid>\n</VTKFile>\n")?)
}

fn begin(sink: &mut impl Write, kind: &str) -> Result<(), Error> {
    let version = "version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\"";
    Ok(writeln!(sink, "<?xml version=\"1.0\"?>\n<VTKFile type=\"{kind}\" {version}>")?)
}

/// A path as XML has it.
fn name(file: &str) -> Result<String, Error> {
    if file.is_empty() || file.chars().any(char::is_control) {
        return Err(Error::Name { what: "the file name", name: file.into() });
    }
    Ok(escape(file))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::{vti, vtk};
    use crate::volume::Volume;

    #[test]
    fn parts_that_share_a_layer_are_read_as_one_image() {
        let folder = tempfile::tempdir().unwrap();
        let grid = Grid { dimensions: [3, 2, 7], origin: [1.0, 2.0, 3.0], spacing: [0.5, 0.25, 1.0 / 3.0] };
        let values: Vec<f32> = (0..grid.len()).map(|i| i as f32).collect();
        let whole = Volume { grid, arrays: vec![Array::new("a&b", 1, values.clone())], field_data: Vec::new() };
        let layers = [0..4, 3..5, 4..7];
        for (k, layers) in layers.iter().enumerate() {
            let part = Grid { dimensions: [3, 2, layers.len()], ..grid };
            let values = values[layers.start * 6..layers.end * 6].to_vec();
            let part = Volume { grid: part, arrays: vec![Array::new("a&b", 1, values)], field_data: Vec::new() };
            let settings = vti::Settings { first_layer: layers.start, ..vti::Settings::default() };
            let file = std::fs::File::create(folder.path().join(format!("{k}.vti"))).unwrap();
            vti::write(file, &part, &settings).unwrap();
            let part = vtk::read_volume(&folder.path().join(format!("{k}.vti"))).unwrap();
            assert_eq!(part.grid.origin[2], 3.0 + layers.start as f64 / 3.0);
        }
        let list = folder.path().join("list.pvti");
        let spec = ArraySpec::new("a&b", crate::volume::Kind::F32, 1);
        let names = ["0.vti", "1.vti", "2.vti"];
        let parts = layers.into_iter().zip(names);
        image(std::fs::File::create(&list).unwrap(), &grid, &[spec], parts).unwrap();
        assert_eq!(vtk::read_volume(&list).unwrap(), whole);
        assert!(image(Vec::new(), &grid, &[], [(0..1, "")]).is_err());
    }
}
