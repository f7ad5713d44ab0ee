//! `.vti`, VTK's image file, streamed.
//!
//! The file is a head in XML, which says what there is and where, and the arrays' bytes. By default those are appended
//! raw behind the head, array after array, each behind a `u64` with its length. All lengths are known beforehand, so
//! slabs of z layers can go straight to their places, and no more than a slab is ever in memory.
//!
//! `Encoding::Inline` puts the arrays into the XML as base64, a third longer but proof against everything that reads
//! XML; `Compression` packs blocks of each array by themselves. Either way an array's place depends on what comes
//! before, so arrays are kept aside, in memory and beyond a limit in nameless temporary files, until
//! [`VtiWriter::finish`].

pub(in crate::io) mod head;
mod spool;

use std::io::{BufRead, Seek, SeekFrom, Write};
use std::path::PathBuf;

use base64::engine::general_purpose::STANDARD;
use base64::write::EncoderWriter;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::spool::Spool;
use super::Error;
use crate::volume::{Grid, Kind, Values, Volume};

/// Numbers turned into bytes at a time.
const BATCH: usize = 1 << 14;

/// How the arrays are kept in the file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Encoding {
    /// Raw bytes behind the XML.
    #[default]
    Appended,
    /// base64 inside the XML.
    Inline,
}

/// How blocks of the arrays are compressed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Compression {
    /// Not at all.
    #[default]
    None,
    /// Small.
    Zlib,
    /// Fast.
    Lz4,
}

/// What a file says beside its arrays, and how it keeps them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settings {
    /// Where the arrays' bytes go.
    pub encoding: Encoding,
    /// Whether they are compressed.
    pub compression: Compression,
    /// Named strings: program version, pipeline, settings.
    pub field_data: Vec<(String, String)>,
    /// Named numbers, which may be set anew until the file is finished.
    pub numbers: Vec<(String, f64)>,
    /// The image's time, which ParaView shows.
    pub time: Option<f64>,
    /// The folder for temporary files, best on the disk of the file itself; the system's own otherwise.
    pub scratch: Option<PathBuf>,
    /// Of a part of an image: which of the image's layers is the first here. The grid is the part's, its origin the image's.
    pub first_layer: usize,
}

/// An array that is going to be written.
#[derive(Clone, Debug, PartialEq)]
pub struct ArraySpec {
    /// Its name.
    pub name: String,
    /// The type of its numbers.
    pub kind: Kind,
    /// The name of each component; as many as a point has numbers. A single one is not named in the file.
    pub components: Vec<String>,
}

impl ArraySpec {
    /// An array of `components` numbers a point, named as its purpose asks for: colours r, g, b, a, and vectors x, y,
    /// z, w; more than four by number.
    pub fn new(name: impl Into<String>, kind: Kind, components: usize) -> Self {
        let name = name.into();
        let letters = if name.starts_with("rgb") { ["r", "g", "b", "a"] } else { ["x", "y", "z", "w"] };
        let component = |i: usize| letters.get(i).filter(|_| components <= 4).map_or(i.to_string(), |l| l.to_string());
        Self { components: (0..components).map(component).collect(), name, kind }
    }

    /// Bytes of a point.
    pub fn point_size(&self) -> usize {
        self.kind.size() * self.components.len()
    }
}

/// Bytes that a file without compression takes, but for a head of a few kilobytes: what the disk must have left.
pub fn estimated_size(grid: &Grid, arrays: &[ArraySpec], settings: &Settings) -> Option<u64> {
    let points = grid.checked_len()? as u64;
    let bytes = arrays.iter().try_fold(0u64, |n, a| n.checked_add(points.checked_mul(a.point_size() as u64)?))?;
    if settings.encoding == Encoding::Inline { bytes.div_ceil(3).checked_mul(4) } else { Some(bytes) }
}

/// Writes a whole image.
///
/// # Errors
/// As [`VtiWriter`]'s methods.
pub fn write<W: Write + Seek>(sink: W, volume: &Volume, settings: &Settings) -> Result<W, Error> {
    let arrays: Vec<_> = volume.arrays.iter().map(|a| ArraySpec::new(&a.name, a.values.kind(), a.components)).collect();
    let mut writer = VtiWriter::new(sink, &volume.grid, &arrays, settings)?;
    for (i, array) in volume.arrays.iter().enumerate() {
        writer.write_slab(i, 0, &array.values)?;
    }
    writer.finish()
}

/// Copies a file that this writer made, with another text in its field data under this name.
///
/// # Errors
/// If it has no such text, or reading or writing fails.
pub fn retell(
    mut source: impl BufRead,
    mut sink: impl Write,
    encoding: Encoding,
    text: (&str, &str),
) -> Result<(), Error> {
    super::vtk::text::retell(&mut source, &mut sink, text, |head, source| {
        if encoding == Encoding::Inline {
            return Ok(());
        }
        // The head has another length now, and its end a place of its own.
        super::vtk::text::read_to(source, head::TAG.as_bytes(), head)?;
        head.truncate(head.len() - head::TAG.len());
        let mut text = String::from_utf8_lossy(head.trim_ascii_end()).into_owned() + "\n";
        head::pad(&mut text);
        text.push_str(head::TAG);
        *head = text.into_bytes();
        Ok(())
    })
}

/// A `.vti` file in the making.
pub struct VtiWriter<W: Write + Seek> {
    sink: W,
    grid: Grid,
    settings: Settings,
    arrays: Vec<Pending>,
    bytes: Vec<u8>,
}

/// An array of which some layers are written.
struct Pending {
    spec: ArraySpec,
    layers: usize,
    /// Bytes of the whole array.
    length: u64,
    place: Place,
}

/// Where an array's bytes go.
enum Place {
    /// To their final place in the file, from here on.
    Direct(u64),
    /// Aside, until all arrays are whole.
    Spool(Box<Spool>),
}

impl<W: Write + Seek> VtiWriter<W> {
    /// Starts a file at the sink's beginning with these arrays, in this order.
    ///
    /// # Errors
    /// If the grid or an array is empty or too large, a name cannot be written or is there twice, or the sink fails.
    pub fn new(mut sink: W, grid: &Grid, arrays: &[ArraySpec], settings: &Settings) -> Result<Self, Error> {
        check(grid, arrays, settings)?;
        let direct = settings.encoding == Encoding::Appended && settings.compression == Compression::None;
        let points = grid.len() as u64;
        let mut pending = Vec::new();
        let mut offset = 0;
        for spec in arrays {
            let length = points * spec.point_size() as u64;
            let place = if direct {
                Place::Direct(offset)
            } else {
                Place::Spool(Box::new(Spool::new(settings.scratch.as_deref())))
            };
            pending.push(Pending { spec: spec.clone(), layers: 0, length, place });
            offset += 8 + length;
        }
        sink.rewind()?;
        let mut writer = Self { sink, grid: *grid, settings: settings.clone(), arrays: pending, bytes: Vec::new() };
        if direct {
            let head = writer.head();
            writer.sink.write_all(head.as_bytes())?;
            for array in &mut writer.arrays {
                if let Place::Direct(at) = &mut array.place {
                    *at += head.len() as u64;
                    writer.sink.seek(SeekFrom::Start(*at))?;
                    writer.sink.write_all(&array.length.to_le_bytes())?;
                    *at += 8;
                }
            }
        }
        Ok(writer)
    }

    /// Writes the next layers of array number `array`: as many as `values` hold, from `first_layer` on.
    ///
    /// Arrays may take turns, but each one's layers come in order.
    ///
    /// # Errors
    /// If these are not the layers or numbers that come next, or the sink fails.
    pub fn write_slab(&mut self, array: usize, first_layer: usize, values: &Values) -> Result<(), Error> {
        let count = self.arrays.len();
        let Some(pending) = self.arrays.get_mut(array) else {
            return Err(shape("", format!("array number {array}"), format!("one of {count}")));
        };
        let spec = &pending.spec;
        if values.kind() != spec.kind {
            return Err(shape(&spec.name, values.kind().vtk_name().into(), spec.kind.vtk_name().into()));
        }
        let layer = self.grid.layer_len() * spec.components.len();
        let layers = values.len() / layer;
        if !values.len().is_multiple_of(layer) || layers > self.grid.dimensions[2] - pending.layers {
            let left = self.grid.dimensions[2] - pending.layers;
            return Err(shape(&spec.name, format!("{} numbers", values.len()), format!("1 to {left} times {layer}")));
        }
        if first_layer != pending.layers {
            return Err(shape(&spec.name, format!("layer {first_layer}"), format!("layer {}", pending.layers)));
        }
        if let Place::Direct(start) = pending.place {
            self.sink.seek(SeekFrom::Start(start + (first_layer * layer * spec.kind.size()) as u64))?;
        }
        for from in (0..values.len()).step_by(BATCH) {
            self.bytes.clear();
            values.extend_le_bytes(from..values.len().min(from + BATCH), &mut self.bytes);
            match &mut pending.place {
                Place::Direct(_) => self.sink.write_all(&self.bytes)?,
                Place::Spool(spool) => spool.push(&self.bytes, self.settings.compression)?,
            }
        }
        pending.layers += layers;
        Ok(())
    }

    /// Completes the file and gives the sink back.
    ///
    /// # Errors
    /// If layers are missing, or the sink fails.
    pub fn finish(mut self) -> Result<W, Error> {
        let depth = self.grid.dimensions[2];
        if let Some(array) = self.arrays.iter().find(|a| a.layers != depth) {
            return Err(shape(&array.spec.name, format!("{} layers", array.layers), format!("{depth}")));
        }
        let compression = self.settings.compression;
        // Lengths in front of each array kept aside.
        let mut heads = Vec::new();
        for array in &mut self.arrays {
            if let Place::Spool(spool) = &mut array.place {
                heads.push(spool.complete(array.length, compression)?);
            }
        }
        if self.settings.encoding == Encoding::Inline {
            self.write_inline(&heads)?;
        } else {
            if compression != Compression::None {
                self.write_packed(&heads)?;
            } else if !self.settings.numbers.is_empty() {
                // As long as before.
                self.sink.rewind()?;
                let head = self.head();
                self.sink.write_all(head.as_bytes())?;
            }
            self.sink.seek(SeekFrom::End(0))?;
            self.sink.write_all(b"\n  </AppendedData>\n</VTKFile>\n")?;
        }
        self.sink.flush()?;
        Ok(self.sink)
    }

    /// Sets a named number; it must be among those of the settings.
    pub fn set_number(&mut self, name: &str, number: f64) {
        let found = self.settings.numbers.iter_mut().find(|(own, _)| own == name);
        debug_assert!(found.is_some(), "{name} has no place");
        if let Some((_, own)) = found {
            *own = number;
        }
    }

    /// The head of a file whose arrays lie behind it one after the other, each behind its length.
    fn head(&self) -> String {
        let mut at = 0;
        let offsets = self.arrays.iter().map(|array| {
            let offset = at;
            at += 8 + array.length;
            (&array.spec, offset)
        });
        head::appended(self.before_arrays(), offsets)
    }

    fn before_arrays(&self) -> String {
        // `opacity` wherever it is: ParaView 5.11 aborts in Contour where the active array has several components.
        let opacity = self.arrays.iter().find(|a| a.spec.name == "opacity");
        head::before_arrays(&self.grid, &self.settings, opacity.or(self.arrays.first()).map(|a| &a.spec))
    }

    /// Compressed arrays behind the head, now that their lengths are known.
    fn write_packed(&mut self, heads: &[Vec<u8>]) -> Result<(), Error> {
        let mut offsets = Vec::new();
        let mut offset = 0;
        for (array, head) in self.arrays.iter().zip(heads) {
            offsets.push(offset);
            if let Place::Spool(spool) = &array.place {
                offset += head.len() as u64 + spool.packed_len();
            }
        }
        let specs = self.arrays.iter().map(|a| &a.spec);
        let text = head::appended(self.before_arrays(), specs.zip(offsets));
        self.sink.write_all(text.as_bytes())?;
        for (array, head) in self.arrays.iter_mut().zip(heads) {
            self.sink.write_all(head)?;
            if let Place::Spool(spool) = &mut array.place {
                std::io::copy(&mut spool.file, &mut self.sink)?;
            }
        }
        Ok(())
    }

    /// All of the file as XML. The lengths in front of compressed blocks are a base64 text of their own, as VTK has it.
    fn write_inline(&mut self, heads: &[Vec<u8>]) -> Result<(), Error> {
        self.sink.write_all(self.before_arrays().as_bytes())?;
        for (array, lengths) in self.arrays.iter_mut().zip(heads) {
            writeln!(self.sink, "        <DataArray {} format=\"binary\">", head::attributes(&array.spec))?;
            let mut encoder = EncoderWriter::new(&mut self.sink, &STANDARD);
            encoder.write_all(lengths)?;
            if self.settings.compression != Compression::None {
                encoder.finish()?;
                drop(encoder);
                encoder = EncoderWriter::new(&mut self.sink, &STANDARD);
            }
            if let Place::Spool(spool) = &mut array.place {
                std::io::copy(&mut spool.file, &mut encoder)?;
            }
            encoder.finish()?;
            drop(encoder);
            self.sink.write_all(b"\n        </DataArray>\n")?;
        }
        self.sink.write_all(head::BEHIND_ARRAYS.as_bytes())?;
        self.sink.write_all(b"</VTKFile>\n")?;
        Ok(())
    }
}

fn shape(array: &str, found: String, expected: String) -> Error {
    Error::Shape { array: array.into(), found, expected }
}

/// Refuses what no file can hold.
fn check(grid: &Grid, arrays: &[ArraySpec], settings: &Settings) -> Result<(), Error> {
    let dimensions = || format!("{:?} points", grid.dimensions);
    if grid.dimensions.contains(&0) || grid.dimensions.iter().any(|&n| n > i32::MAX as usize) {
        return Err(shape("", dimensions(), "1 to 2^31 - 1 along each axis".into()));
    }
    if estimated_size(grid, arrays, settings).is_none_or(|n| n > i64::MAX as u64) {
        return Err(shape("", dimensions(), "fewer of them".into()));
    }
    let own = settings.numbers.iter().map(|(_, number)| number);
    let numbers = grid.origin.iter().chain(&grid.spacing).chain(&settings.time).chain(own);
    if numbers.into_iter().any(|x| !x.is_finite()) || grid.spacing.iter().any(|&x| x <= 0.0) {
        let found = format!("origin {:?}, spacing {:?}, time {:?}", grid.origin, grid.spacing, settings.time);
        return Err(shape("", found, "finite numbers, and spacing above 0".into()));
    }
    for (i, array) in arrays.iter().enumerate() {
        if array.components.is_empty() {
            return Err(shape(&array.name, "no components".into(), "at least one".into()));
        }
        if arrays[..i].iter().any(|other| other.name == array.name) {
            return Err(shape(&array.name, "the name a second time".into(), "another name".into()));
        }
    }
    let names =
        arrays.iter().flat_map(|a| std::iter::once(&a.name).chain(&a.components)).map(|n| ("the array name", n));
    let of_fields = settings.field_data.iter().map(|(n, _)| n).chain(settings.numbers.iter().map(|(n, _)| n));
    for (what, name) in names.chain(of_fields.map(|n| ("the field data name", n))) {
        if name.is_empty() || name.chars().any(|c| c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}')) {
            return Err(Error::Name { what, name: name.clone() });
        }
    }
    let zero = settings.field_data.iter().find(|(_, text)| text.contains('\0'));
    match zero {
        Some((name, _)) => Err(shape(name, "a text with a zero byte".into(), "text without".into())),
        None => Ok(()),
    }
}
