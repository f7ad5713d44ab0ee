//! The XML around a `.vti` file's arrays.
//!
//! ParaView up to 5.12.0 with a patched or recent libexpat reads no appended file unless a multiple of 4096 bytes
//! falls 2 to 8 bytes behind `<AppendedData`: its XML parser is handed 4096 bytes at a time, and must not see the rest
//! of that tag's line and the raw bytes before the reader has stopped it. So the head is padded with spaces such that
//! the tag begins at 4079 modulo 4096, which every version accepts.

use std::fmt::Write;

use super::super::vtk::text::text_array;
use super::super::xml::escape;
use super::{ArraySpec, Compression, Settings};
use crate::volume::Grid;

/// Where `<AppendedData` begins, modulo the size of the chunks in which VTK reads XML.
const TAG_PLACE: usize = 4079;
/// The size of those chunks.
const CHUNK: usize = 4096;

/// What the appended bytes begin with.
pub(super) const TAG: &str = "<AppendedData encoding=\"raw\">";

/// What closes the head behind the arrays.
pub(super) const BEHIND_ARRAYS: &str = "      </PointData>\n      <CellData/>\n    </Piece>\n  </ImageData>\n";

/// The head up to the `_` in front of the appended bytes; each array's offset counts from there.
pub(super) fn appended<'a>(before: String, arrays: impl Iterator<Item = (&'a ArraySpec, u64)>) -> String {
    let mut head = before;
    for (array, offset) in arrays {
        let attributes = attributes(array);
        let _ = writeln!(head, "        <DataArray {attributes} format=\"appended\" offset=\"{offset}\"/>");
    }
    head.push_str(BEHIND_ARRAYS);
    pad(&mut head);
    head.push_str(TAG);
    head.push_str("\n_");
    head
}

/// Adds spaces such that the tag behind them stands where every ParaView reads it.
pub(super) fn pad(head: &mut String) {
    let padding = (TAG_PLACE + CHUNK - head.len() % CHUNK) % CHUNK;
    head.extend(std::iter::repeat_n(' ', padding));
}

/// The head in front of the arrays; `scalars` is the array that ParaView shows first.
pub(super) fn before_arrays(grid: &Grid, settings: &Settings, scalars: Option<&ArraySpec>) -> String {
    let compressor = match settings.compression {
        Compression::None => "",
        Compression::Zlib => " compressor=\"vtkZLibDataCompressor\"",
        Compression::Lz4 => " compressor=\"vtkLZ4DataCompressor\"",
    };
    let (extent, place) = (extent(grid, settings.first_layer), place(grid));
    let mut head = format!(
        r#"<?xml version="1.0"?>
<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" header_type="UInt64"{compressor}>
  <ImageData WholeExtent="{extent}" {place}>
"#
    );
    if settings.time.is_some() || !settings.field_data.is_empty() || !settings.numbers.is_empty() {
        head.push_str("    <FieldData>\n");
        if let Some(time) = settings.time {
            let open = r#"<DataArray type="Float64" Name="TimeValue" NumberOfTuples="1" format="ascii">"#;
            let _ = writeln!(head, "      {open}{time:?}</DataArray>");
        }
        for (name, number) in &settings.numbers {
            let (name, number) = (escape(name), fixed_width(*number));
            let open = format!(r#"<DataArray type="Float64" Name="{name}" NumberOfTuples="1" format="ascii">"#);
            let _ = writeln!(head, "      {open}{number}</DataArray>");
        }
        for (name, text) in &settings.field_data {
            head.push_str("      ");
            head.push_str(&text_array(name, text));
            head.push('\n');
        }
        head.push_str("    </FieldData>\n");
    }
    let scalars = scalars.map_or(String::new(), |a| format!(" Scalars=\"{}\"", escape(&a.name)));
    let _ = write!(head, "    <Piece Extent=\"{extent}\">\n      <PointData{scalars}>\n");
    head
}

/// The first and last point along each axis, of layers from this one on.
pub(in crate::io) fn extent(grid: &Grid, first_layer: usize) -> String {
    let [x, y, z] = grid.dimensions.map(|n| n - 1);
    format!("0 {x} 0 {y} {first_layer} {}", first_layer + z)
}

/// Where an image lies.
pub(in crate::io) fn place(grid: &Grid) -> String {
    // The shortest text that reads back as the same f64.
    let triple = |v: [f64; 3]| format!("{:?} {:?} {:?}", v[0], v[1], v[2]);
    let (origin, spacing) = (triple(grid.origin), triple(grid.spacing));
    format!("Origin=\"{origin}\" Spacing=\"{spacing}\" Direction=\"1 0 0 0 1 0 0 0 1\"")
}

/// A number as text that is as long for every number, so that it can be written over.
fn fixed_width(number: f64) -> String {
    format!("{number:>24?}")
}

/// What every `<DataArray>` says, wherever its bytes are.
pub(in crate::io) fn attributes(array: &ArraySpec) -> String {
    let (kind, name, components) = (array.kind.vtk_name(), escape(&array.name), array.components.len());
    let mut text = format!("type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\"");
    if components > 1 {
        for (i, name) in array.components.iter().enumerate() {
            let _ = write!(text, " ComponentName{i}=\"{}\"", escape(name));
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::Kind;

    #[test]
    fn the_tag_lies_where_every_paraview_reads_it_at_any_head_length() {
        let grid = Grid { dimensions: [2, 3, 4], origin: [0.0; 3], spacing: [1.0 / 3.0; 3] };
        let array = ArraySpec::new("rgba", Kind::U8, 4);
        let mut paddings = std::collections::HashSet::new();
        for length in 0..=CHUNK {
            let before = before_arrays(&grid, &Settings::default(), Some(&array)) + &"\n".repeat(length);
            let head = appended(before, [(&array, 0)].into_iter());
            let tag = head.find("<AppendedData").unwrap();
            let behind_tag = tag + "<AppendedData".len();
            let boundary = behind_tag.next_multiple_of(CHUNK);
            assert!((2..=8).contains(&(boundary - behind_tag)), "{length}");
            assert!(head.ends_with("<AppendedData encoding=\"raw\">\n_"));
            paddings.insert(tag - head[..tag].trim_end_matches(' ').len());
        }
        assert_eq!(paddings.len(), CHUNK);
    }
}
