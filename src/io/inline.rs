//! What VTK's XML files of meshes are made of: arrays that stand in the XML itself.
//!
//! Every array is base64 behind its length in 64 bits, so that whatever reads XML reads the file.

use std::io::{self, Write};

use base64::engine::general_purpose::STANDARD;
use base64::write::EncoderWriter;

use super::Error;
use super::vtk::text::text_array;
use super::xml::escape;
use crate::volume::{Array, Kind, Values};

/// Numbers turned into bytes at a time.
const BATCH: usize = 1 << 14;

/// A file in the making.
pub(super) struct File<W> {
    /// Where it goes.
    pub sink: W,
}

impl<W: Write> File<W> {
    /// Text as it is.
    pub fn text(&mut self, text: &str) -> io::Result<()> {
        self.sink.write_all(text.as_bytes())
    }

    /// An array under its name.
    pub fn array(&mut self, array: &Array) -> io::Result<()> {
        let values: &Values = &array.values;
        self.data(&array.name, values.kind(), array.components, values.len(), |range, bytes| {
            values.extend_le_bytes(range, bytes);
        })
    }

    /// One `<DataArray>` of `count` numbers, whose bytes `fill` appends by ranges of numbers.
    pub fn data(
        &mut self,
        name: &str,
        kind: Kind,
        components: usize,
        count: usize,
        fill: impl Fn(std::ops::Range<usize>, &mut Vec<u8>),
    ) -> io::Result<()> {
        let (name, number) = (escape(name), kind.vtk_name());
        let attributes = format!("type=\"{number}\" Name=\"{name}\" NumberOfComponents=\"{components}\"");
        writeln!(self.sink, "<DataArray {attributes} format=\"binary\">")?;
        let mut encoder = EncoderWriter::new(&mut self.sink, &STANDARD);
        encoder.write_all(&((count * kind.size()) as u64).to_le_bytes())?;
        let mut bytes = Vec::with_capacity(BATCH * kind.size());
        for start in (0..count).step_by(BATCH) {
            bytes.clear();
            fill(start..count.min(start + BATCH), &mut bytes);
            encoder.write_all(&bytes)?;
        }
        encoder.finish()?;
        drop(encoder);
        self.text("\n</DataArray>\n")
    }

    /// The array of the points.
    pub fn points(&mut self, points: &[[f32; 3]]) -> io::Result<()> {
        let coordinates = points.as_flattened();
        self.data("Points", Kind::F32, 3, coordinates.len(), |range, bytes| {
            coordinates[range].iter().for_each(|x| bytes.extend(x.to_le_bytes()));
        })
    }

    /// The arrays of cells that have `size` points each.
    pub fn cells(&mut self, flat: &[u32], size: usize) -> io::Result<()> {
        self.data("connectivity", Kind::I64, 1, flat.len(), |range, bytes| {
            flat[range].iter().for_each(|&p| bytes.extend(i64::from(p).to_le_bytes()));
        })?;
        self.data("offsets", Kind::I64, 1, flat.len() / size, |range, bytes| {
            range.for_each(|i| bytes.extend((((i + 1) * size) as i64).to_le_bytes()));
        })
    }

    /// Texts in the field data, each under its name.
    pub fn texts(&mut self, texts: &[(&str, &str)]) -> Result<(), Error> {
        if texts.is_empty() {
            return Ok(());
        }
        self.text("<FieldData>\n")?;
        for (name, text) in texts {
            if name.is_empty() || name.contains(|c: char| c.is_control()) || text.contains('\0') {
                return Err(Error::Name { what: "the field data name", name: (*name).to_owned() });
            }
            writeln!(self.sink, "{}", text_array(name, text))?;
        }
        Ok(self.text("</FieldData>\n")?)
    }
}

/// Refuses cells over points that aren't there.
pub(super) fn check_indices(flat: &[u32], points: usize) -> Result<(), Error> {
    match flat.iter().find(|&&p| p as usize >= points) {
        None => Ok(()),
        Some(p) => Err(Error::Shape {
            array: "connectivity".into(),
            found: format!("point {p}"),
            expected: format!("one of {points}"),
        }),
    }
}

/// Refuses arrays that don't have a tuple for each point or cell, or a name that can't stand in a file.
pub(super) fn check(arrays: &[Array], tuples: usize) -> Result<(), Error> {
    for (i, array) in arrays.iter().enumerate() {
        let shape = |found: String, expected: String| Error::Shape { array: array.name.clone(), found, expected };
        if array.components.checked_mul(tuples) != Some(array.values.len()) || array.components == 0 {
            let expected = format!("{tuples} tuples of {}", array.components);
            return Err(shape(format!("{} numbers", array.values.len()), expected));
        }
        if arrays[..i].iter().any(|a| a.name == array.name) {
            return Err(shape("the name a second time".into(), "another name".into()));
        }
        if array.name.is_empty() || array.name.contains(|c: char| c.is_control()) {
            return Err(Error::Name { what: "the array name", name: array.name.clone() });
        }
    }
    Ok(())
}
