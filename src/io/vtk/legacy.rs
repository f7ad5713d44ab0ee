//! VTK's legacy files, `.vtk`: unstructured grids, polygons and images, as text or binary (big-endian), in the layouts of
//! versions 1 to 4 and of 5 (offsets and connectivity apart).
//!
//! The format is a stream without an index: what stands in front must be understood to find what stands behind. So a scene,
//! which needs points, cells and two arrays by name, stops where all it asked for is there, and where an attribute of the
//! points can't be read it makes do without that; `info` and `compare` take in all of the file or none.

use super::cell::flat_kind;
use super::{DataSet, Field, Image, Problem, UnstructuredGrid, Wanted};
use crate::volume::{Array, Grid, Kind, Values};

/// How every legacy file begins.
pub(super) const MAGIC: &[u8] = b"# vtk DataFile Version";

/// The data set in a legacy file.
pub(super) fn read(bytes: &[u8], wanted: Wanted<'_>) -> Result<DataSet, Problem> {
    let mut file = File { bytes, at: 0, binary: false };
    let version = file.line()?;
    let version = version.get(MAGIC.len()..).unwrap_or_default();
    let version = String::from_utf8_lossy(version).trim().to_owned();
    let offsets_apart = version.split('.').next().and_then(|n| n.parse::<u32>().ok()).is_some_and(|n| n >= 5);
    file.line()?;
    let form = file.line()?.trim_ascii();
    file.binary = match form {
        b"ASCII" => false,
        b"BINARY" => true,
        other => return Err(wrong(format!("is \"{}\", neither ASCII nor BINARY", brief(other)))),
    };
    let mut parts = Parts::default();
    let attributes = parts.read_structure(&mut file, offsets_apart)?;
    if attributes {
        let read = parts.read_attributes(&mut file, wanted);
        if wanted == Wanted::All {
            read?;
        }
    }
    parts.finish()
}

/// What a file has said so far.
#[derive(Default)]
struct Parts {
    kind: String,
    /// None before the file has told them.
    points: Option<Vec<[f64; 3]>>,
    cells: Option<Vec<Vec<u32>>>,
    types: Vec<u8>,
    /// Vertices, lines, polygons and strips of POLYDATA, in the order in which VTK numbers them.
    flat: [Vec<Vec<u32>>; 4],
    dimensions: [usize; 3],
    origin: [f64; 3],
    spacing: Option<[f64; 3]>,
    point_arrays: Vec<Array>,
    cell_arrays: Vec<Array>,
    field_data: Vec<Field>,
}

impl Parts {
    /// Everything up to the attributes; whether there are any.
    fn read_structure(&mut self, file: &mut File<'_>, offsets_apart: bool) -> Result<bool, Problem> {
        while let Some(word) = file.word() {
            match word.to_ascii_uppercase().as_slice() {
                b"DATASET" => {
                    self.kind = text(file.needed()?).to_ascii_uppercase();
                    if !["UNSTRUCTURED_GRID", "POLYDATA", "STRUCTURED_POINTS"].contains(&self.kind.as_str()) {
                        return Err(Problem::Unsupported {
                            what: format!("a legacy `.vtk` file that holds {}", brief(self.kind.as_bytes())),
                            remedy: "UNSTRUCTURED_GRID, POLYDATA and STRUCTURED_POINTS are understood (in ParaView: \
                                     Extract Surface, or Append Datasets, makes a mesh of it)",
                        });
                    }
                }
                b"FIELD" => self.field_data.extend(file.field()?),
                b"METADATA" => file.skip_metadata(),
                b"POINTS" => {
                    let count = file.whole()?;
                    let kind = file.kind()?;
                    let numbers = file.numbers(count.checked_mul(3), kind)?.to_f64();
                    self.points = Some(numbers.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect());
                }
                b"CELLS" => self.cells = Some(file.cells(offsets_apart)?),
                b"CELL_TYPES" => {
                    let count = file.whole()?;
                    let types = file.numbers(Some(count), Kind::I32)?;
                    let kind = |i| u8::try_from(types.integer(i).unwrap_or(-1)).ok();
                    self.types = (0..count)
                        .map(|i| kind(i).ok_or_else(|| wrong(format!("has a cell of type {}", types.format(i)))))
                        .collect::<Result<_, _>>()?;
                }
                b"VERTICES" => self.flat[0] = file.cells(offsets_apart)?,
                b"LINES" => self.flat[1] = file.cells(offsets_apart)?,
                b"POLYGONS" => self.flat[2] = file.cells(offsets_apart)?,
                b"TRIANGLE_STRIPS" => self.flat[3] = file.cells(offsets_apart)?,
                b"DIMENSIONS" => self.dimensions = [file.whole()?, file.whole()?, file.whole()?],
                b"ORIGIN" => self.origin = file.triple()?,
                b"SPACING" | b"ASPECT_RATIO" => self.spacing = Some(file.triple()?),
                b"POINT_DATA" | b"CELL_DATA" => {
                    file.at -= word.len();
                    return Ok(true);
                }
                other => return Err(wrong(format!("has \"{}\" where points or cells should be", brief(other)))),
            }
        }
        Ok(false)
    }

    /// POINT_DATA and CELL_DATA, in either order.
    fn read_attributes(&mut self, file: &mut File<'_>, wanted: Wanted<'_>) -> Result<(), Problem> {
        let (mut of_points, mut tuples) = (true, 0);
        while let Some(word) = file.word() {
            let word = word.to_ascii_uppercase();
            let arrays = match word.as_slice() {
                b"POINT_DATA" | b"CELL_DATA" => {
                    of_points = word == b"POINT_DATA";
                    tuples = file.whole()?;
                    continue;
                }
                b"METADATA" => {
                    file.skip_metadata();
                    continue;
                }
                b"LOOKUP_TABLE" => {
                    // Colours for values, four bytes or numbers each; they belong to no point.
                    let (_name, size) = (file.needed()?, file.whole()?);
                    file.numbers(size.checked_mul(4), if file.binary { Kind::U8 } else { Kind::F32 })?;
                    continue;
                }
                b"FIELD" => file.field()?,
                _ => vec![Field::Numbers(file.attribute(&word, tuples)?)],
            };
            let to = if of_points { &mut self.point_arrays } else { &mut self.cell_arrays };
            for field in arrays {
                if wanted.takes(field.name()) {
                    if to.iter().any(|a| a.name == field.name()) {
                        return Err(Problem::Duplicate { array: field.name().into() });
                    }
                    match field {
                        Field::Numbers(array) if array.tuples() == tuples => to.push(array),
                        Field::Numbers(array) => {
                            let (expected, found) = (tuples as u64, array.tuples() as u64);
                            return Err(Problem::Length { array: array.name, unit: "tuples", expected, found });
                        }
                        Field::Text(name, lines) => self.field_data.push(Field::Text(name, lines)),
                    }
                }
            }
        }
        Ok(())
    }

    fn finish(self) -> Result<DataSet, Problem> {
        if self.kind.is_empty() {
            return Err(wrong("is cut off: it has no DATASET"));
        }
        if self.kind == "STRUCTURED_POINTS" {
            return self.image();
        }
        let Some(points) = self.points else { return Err(wrong("is cut off: it has no POINTS")) };
        if self.kind == "UNSTRUCTURED_GRID" && self.cells.is_none() {
            return Err(wrong("is cut off: it has no CELLS"));
        }
        let cells = self.cells.unwrap_or_default();
        if self.types.len() != cells.len() {
            return Err(wrong(format!("has {} cells and {} types of cells", cells.len(), self.types.len())));
        }
        let mut grid = UnstructuredGrid {
            points,
            point_arrays: self.point_arrays,
            cell_arrays: self.cell_arrays,
            field_data: self.field_data,
            ..UnstructuredGrid::default()
        };
        cells.iter().zip(&self.types).for_each(|(cell, &kind)| grid.push(kind, cell));
        for (element, cells) in ["Verts", "Lines", "Polys", "Strips"].into_iter().zip(&self.flat) {
            cells.iter().for_each(|cell| grid.push(flat_kind(element, cell.len()), cell));
        }
        grid.validate()?;
        Ok(DataSet::Unstructured(grid))
    }

    fn image(self) -> Result<DataSet, Problem> {
        let spacing = self.spacing.unwrap_or([1.0; 3]);
        let usable = self.dimensions.iter().all(|n| (1..=1 << 31).contains(n))
            && self.origin.iter().all(|x| x.is_finite())
            && spacing.iter().all(|&x| x.is_finite() && x > 0.0);
        let grid = Grid { dimensions: self.dimensions, origin: self.origin, spacing };
        let (Some(points), true) = (grid.checked_len(), usable) else {
            return Err(wrong(format!(
                "has dimensions {:?} and spacing {spacing:?}, which make no sense",
                self.dimensions
            )));
        };
        let cells: usize = self.dimensions.iter().map(|n| (n - 1).max(1)).product();
        for (arrays, tuples) in [(&self.point_arrays, points), (&self.cell_arrays, cells)] {
            if let Some(array) = arrays.iter().find(|a| a.tuples() != tuples) {
                let (expected, found) = (tuples as u64, array.tuples() as u64);
                return Err(Problem::Length { array: array.name.clone(), unit: "tuples", expected, found });
            }
        }
        Ok(DataSet::Image(Image::new(grid, self.point_arrays, self.cell_arrays, self.field_data)))
    }
}

fn wrong(message: impl Into<String>) -> Problem {
    Problem::Legacy(message.into())
}

fn text(word: &[u8]) -> String {
    String::from_utf8_lossy(word).into_owned()
}

fn brief(word: &[u8]) -> String {
    String::from_utf8_lossy(word).chars().take(40).collect()
}

/// A name as it is meant: VTK writes spaces and the like as `%20`.
fn decoded(word: &[u8]) -> String {
    let (mut bytes, mut rest) = (Vec::with_capacity(word.len()), word);
    while let Some((&first, behind)) = rest.split_first() {
        let code = behind.get(..2).and_then(|hex| std::str::from_utf8(hex).ok()).filter(|_| first == b'%');
        match code.and_then(|hex| u8::from_str_radix(hex, 16).ok()) {
            Some(byte) => (bytes.push(byte), rest = &behind[2..]).1,
            None => (bytes.push(first), rest = behind).1,
        }
    }
    text(&bytes)
}

/// A file, read from the front.
struct File<'a> {
    bytes: &'a [u8],
    at: usize,
    binary: bool,
}

impl<'a> File<'a> {
    fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.at..).unwrap_or_default()
    }

    fn line(&mut self) -> Result<&'a [u8], Problem> {
        let rest = self.rest();
        if rest.is_empty() {
            return Err(wrong("is cut off"));
        }
        let length = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
        self.at += length + 1;
        Ok(&rest[..length])
    }

    fn word(&mut self) -> Option<&'a [u8]> {
        let rest = self.rest();
        let start = rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let length = rest[start..].iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len() - start);
        self.at += start + length;
        Some(&rest[start..start + length])
    }

    fn needed(&mut self) -> Result<&'a [u8], Problem> {
        self.word().ok_or_else(|| wrong("is cut off"))
    }

    fn parsed<T: std::str::FromStr>(&mut self, what: &str) -> Result<T, Problem> {
        let word = self.needed()?;
        let value = std::str::from_utf8(word).ok().and_then(|text| text.parse().ok());
        value.ok_or_else(|| wrong(format!("has \"{}\" where {what} should be", brief(word))))
    }

    fn whole(&mut self) -> Result<usize, Problem> {
        self.parsed("a whole number")
    }

    fn triple(&mut self) -> Result<[f64; 3], Problem> {
        Ok([self.parsed("a number")?, self.parsed("a number")?, self.parsed("a number")?])
    }

    /// The type of numbers that comes next.
    fn kind(&mut self) -> Result<Kind, Problem> {
        let word = self.needed()?;
        kind(word).ok_or_else(|| wrong(format!("holds numbers of type \"{}\", which is not understood", brief(word))))
    }

    /// Up to the next empty line.
    fn skip_metadata(&mut self) {
        let _ = self.line();
        while self.line().is_ok_and(|line| !line.trim_ascii().is_empty()) {}
    }

    /// So many numbers, from the next line on.
    fn numbers(&mut self, count: Option<usize>, kind: Kind) -> Result<Values, Problem> {
        let size = if self.binary { kind.size() } else { 1 };
        let Some(needed) = count.and_then(|n| n.checked_mul(size)).filter(|&n| n <= self.rest().len()) else {
            return Err(wrong("is cut off: it declares more numbers than there are"));
        };
        if self.binary {
            self.line()?;
            let bytes = self.rest().get(..needed).ok_or_else(|| wrong("is cut off"))?;
            self.at += needed;
            return Ok(kind.decode(bytes, false));
        }
        let mut words = Vec::new();
        for _ in 0..needed {
            words.push(std::str::from_utf8(self.needed()?).unwrap_or("?"));
        }
        kind.parse(words.into_iter())
            .map_err(|word| wrong(format!("has \"{}\" where a number should be", brief(word.as_bytes()))))
    }

    /// `Bit` numbers, eight a byte with the highest first.
    fn bits(&mut self, count: Option<usize>) -> Result<Values, Problem> {
        if !self.binary {
            return self.numbers(count, Kind::U8);
        }
        let Values::U8(bytes) = self.numbers(count.map(|n| n.div_ceil(8)), Kind::U8)? else {
            return Err(wrong("is cut off"));
        };
        Ok(Values::U8((0..count.unwrap_or(0)).map(|i| bytes[i / 8] >> (7 - i % 8) & 1).collect()))
    }

    /// An array of a type that comes next, or has been read.
    fn array(&mut self, name: &[u8], components: usize, tuples: usize, kind_word: &[u8]) -> Result<Array, Problem> {
        let count = components.checked_mul(tuples);
        let values = if kind_word.eq_ignore_ascii_case(b"bit") {
            self.bits(count)?
        } else {
            let kind = kind(kind_word).ok_or_else(|| {
                wrong(format!("holds numbers of type \"{}\", which is not understood", brief(kind_word)))
            })?;
            self.numbers(count, kind)?
        };
        Ok(Array { name: decoded(name), components, values })
    }

    /// One attribute of the old kinds, each with its own count of components.
    fn attribute(&mut self, keyword: &[u8], tuples: usize) -> Result<Array, Problem> {
        let name = self.needed()?;
        match keyword {
            b"COLOR_SCALARS" => {
                let components = self.whole()?;
                self.array(name, components.max(1), tuples, if self.binary { b"unsigned_char" } else { b"float" })
            }
            b"TEXTURE_COORDINATES" => {
                let components = self.whole()?;
                let kind = self.needed()?;
                self.array(name, components.max(1), tuples, kind)
            }
            b"SCALARS" => {
                let kind = self.needed()?;
                // The number of components may be left out, and so may the name of a table of colours.
                let components = self.maybe(|word| std::str::from_utf8(word).ok()?.parse().ok()).unwrap_or(1);
                if self.maybe(|word| word.eq_ignore_ascii_case(b"LOOKUP_TABLE").then_some(())).is_some() {
                    self.needed()?;
                }
                self.array(name, usize::max(components, 1), tuples, kind)
            }
            b"VECTORS" | b"NORMALS" | b"TENSORS" | b"TENSORS6" | b"GLOBAL_IDS" | b"PEDIGREE_IDS" | b"EDGE_FLAGS" => {
                let kind = self.needed()?;
                let components = match keyword {
                    b"VECTORS" | b"NORMALS" => 3,
                    b"TENSORS" => 9,
                    b"TENSORS6" => 6,
                    _ => 1,
                };
                self.array(name, components, tuples, kind)
            }
            other => Err(Problem::Unsupported {
                what: format!("the attribute {} of a legacy `.vtk` file", brief(other)),
                remedy: "save it as `.vtu`, `.vtp` or `.vti` (in ParaView: Save Data)",
            }),
        }
    }

    /// The next word, if it is what is looked for.
    fn maybe<T>(&mut self, is: impl Fn(&[u8]) -> Option<T>) -> Option<T> {
        let before = self.at;
        let found = self.word().and_then(is);
        if found.is_none() {
            self.at = before;
        }
        found
    }

    /// The arrays of a FIELD.
    fn field(&mut self) -> Result<Vec<Field>, Problem> {
        let (_name, count) = (self.needed()?, self.whole()?);
        let mut fields = Vec::new();
        while fields.len() < count {
            let name = self.needed()?;
            if name.eq_ignore_ascii_case(b"METADATA") {
                self.skip_metadata();
                continue;
            }
            let (components, tuples) = (self.whole()?, self.whole()?);
            let kind = self.needed()?;
            fields.push(if kind.eq_ignore_ascii_case(b"string") {
                Field::Text(decoded(name), self.strings(components.saturating_mul(tuples))?)
            } else {
                Field::Numbers(self.array(name, components.max(1), tuples, kind)?)
            });
        }
        Ok(fields)
    }

    /// Strings: a line each, or each behind its length, whose two highest bits say how many bytes that takes.
    fn strings(&mut self, count: usize) -> Result<Vec<String>, Problem> {
        self.line()?;
        let mut strings = Vec::new();
        for _ in 0..count {
            if !self.binary {
                strings.push(decoded(self.line()?.trim_ascii_end()));
                continue;
            }
            let first = *self.rest().first().ok_or_else(|| wrong("is cut off"))?;
            let bytes = [8, 4, 2, 1][usize::from(first >> 6)];
            let head = self.rest().get(..bytes).ok_or_else(|| wrong("is cut off"))?;
            let length =
                head.iter().enumerate().fold(0u64, |n, (i, &b)| n << 8 | u64::from(if i == 0 { b & 63 } else { b }));
            self.at += bytes;
            let string = usize::try_from(length).ok().and_then(|n| self.rest().get(..n));
            let string = string.ok_or_else(|| wrong("is cut off within a string"))?;
            self.at += string.len();
            strings.push(text(string));
        }
        Ok(strings)
    }

    /// Lists of points.
    fn cells(&mut self, offsets_apart: bool) -> Result<Vec<Vec<u32>>, Problem> {
        let (count, size) = (self.whole()?, self.whole()?);
        let indices = |values: Values| -> Result<Vec<u32>, Problem> {
            (0..values.len())
                .map(|i| {
                    let index = values.integer(i).and_then(|n| u32::try_from(n).ok());
                    index.ok_or_else(|| wrong(format!("has {} where a point's number should be", values.format(i))))
                })
                .collect()
        };
        if !offsets_apart {
            let mut rest = indices(self.numbers(Some(size), Kind::I32)?)?.into_iter();
            let mut cells = Vec::new();
            while let Some(length) = rest.next() {
                let cell: Vec<u32> = rest.by_ref().take(length as usize).collect();
                if cell.len() < length as usize {
                    return Err(wrong("has a last cell that is not whole"));
                }
                cells.push(cell);
            }
            if cells.len() != count {
                return Err(wrong(format!("declares {count} cells and has {}", cells.len())));
            }
            return Ok(cells);
        }
        let mut list = |name: &[u8], count: usize| {
            let word = self.needed()?;
            if !word.eq_ignore_ascii_case(name) {
                return Err(wrong(format!("has \"{}\" where {} should be", brief(word), text(name))));
            }
            let kind = self.kind()?;
            indices(self.numbers(Some(count), kind)?)
        };
        let (offsets, points) = (list(b"OFFSETS", count)?, list(b"CONNECTIVITY", size)?);
        let cell = |pair: &[u32]| points.get(pair[0] as usize..pair[1] as usize).map(<[u32]>::to_vec);
        offsets.windows(2).map(cell).collect::<Option<_>>().ok_or_else(|| wrong("has offsets that make no sense"))
    }
}

fn kind(name: &[u8]) -> Option<Kind> {
    Some(match name.to_ascii_lowercase().as_slice() {
        b"char" | b"signed_char" | b"vtktypeint8" => Kind::I8,
        b"unsigned_char" | b"vtktypeuint8" => Kind::U8,
        b"short" | b"vtktypeint16" => Kind::I16,
        b"unsigned_short" | b"vtktypeuint16" => Kind::U16,
        b"int" | b"vtkidtype" | b"vtktypeint32" => Kind::I32,
        b"unsigned_int" | b"vtktypeuint32" => Kind::U32,
        b"long" | b"long_long" | b"vtktypeint64" => Kind::I64,
        b"unsigned_long" | b"unsigned_long_long" | b"vtktypeuint64" => Kind::U64,
        b"float" | b"vtktypefloat32" => Kind::F32,
        b"double" | b"vtktypefloat64" => Kind::F64,
        _ => return None,
    })
}
