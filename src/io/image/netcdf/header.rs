//! The header of a NetCDF file of the classic kinds: CDF-1, CDF-2 (64-bit offsets) and CDF-5 (64-bit sizes as well).
//!
//! Lists of dimensions, attributes and variables, in big-endian numbers, each padded to four bytes. A list's declared length is
//! held against the bytes at hand before room is made for it.

use std::io::Read;
use std::path::Path;

use crate::volume::{Kind, Values};

/// Headers are a few kilobytes; beyond this nothing is believed.
const LONGEST: u64 = 1 << 24;

/// A dimension.
pub(super) struct Dimension {
    pub name: String,
    /// 0 for the one that grows.
    pub size: u64,
}

/// What an attribute holds.
#[derive(Debug)]
pub(super) enum Content {
    Text(String),
    Numbers(Values),
}

/// A variable.
pub(super) struct Variable {
    pub name: String,
    /// Indices of its dimensions, the slowest first.
    pub dimensions: Vec<usize>,
    pub attributes: Vec<(String, Content)>,
    /// None for text.
    pub kind: Option<Kind>,
    /// Where its values begin.
    pub begin: u64,
}

impl Variable {
    /// An attribute that is text.
    pub fn text(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find_map(|(key, content)| match content {
            Content::Text(text) if key == name => Some(text.trim_matches(['\0', ' '])),
            _ => None,
        })
    }

    /// An attribute that is numbers.
    pub fn numbers(&self, name: &str) -> Option<&Values> {
        self.attributes.iter().find_map(|(key, content)| match content {
            Content::Numbers(numbers) if key == name => Some(numbers),
            _ => None,
        })
    }

    /// The first number of an attribute.
    pub fn number(&self, name: &str) -> Option<f64> {
        self.numbers(name).filter(|numbers| !numbers.is_empty()).map(|numbers| numbers.get(0))
    }
}

/// The lists of a header.
pub(super) struct Header {
    pub version: u8,
    /// How often the growing dimension has grown; none if that is left open.
    pub records: Option<u64>,
    pub dimensions: Vec<Dimension>,
    pub variables: Vec<Variable>,
}

impl Header {
    /// Reads the header of a file.
    pub fn read(path: &Path) -> Result<Self, String> {
        let mut bytes = Vec::new();
        let file = crate::input::open(path).map_err(|e| e.to_string())?;
        file.take(LONGEST).read_to_end(&mut bytes).map_err(|e| e.to_string())?;
        let version = match bytes.as_slice() {
            [b'C', b'D', b'F', version @ (1 | 2 | 5), ..] => *version,
            [0x0e, 3, 0x13, 1, ..] => {
                return Err("unsupported: an HDF4 file; convert it to NetCDF: h4tonccf IN OUT.nc".into());
            }
            _ => return Err("is no NetCDF file: it begins neither with CDF nor as HDF5 does".into()),
        };
        let mut rest = Rest { bytes: &bytes[4..], wide_counts: version == 5, wide_offsets: version != 1 };
        let records = rest.count()?;
        let open = if version == 5 { u64::MAX } else { u64::from(u32::MAX) };
        let mut header = Self {
            version,
            records: Some(records).filter(|&n| n != open),
            dimensions: Vec::new(),
            variables: Vec::new(),
        };
        for _ in 0..rest.list()? {
            header.dimensions.push(Dimension { name: rest.name()?, size: rest.count()? });
        }
        rest.attributes()?;
        for _ in 0..rest.list()? {
            let name = rest.name()?;
            let count = rest.fitting(4)?;
            let dimensions: Vec<usize> =
                (0..count).map(|_| rest.count().map(|n| n as usize)).collect::<Result<_, _>>()?;
            if dimensions.iter().any(|&d| d >= header.dimensions.len()) {
                return Err(format!("is damaged: variable \"{name}\" has a dimension that isn't there"));
            }
            let attributes = rest.attributes()?;
            let kind = kind(rest.word()?)?;
            rest.count()?; // Its length in bytes, which the sizes say as well, and which doesn't hold large ones.
            let begin = if rest.wide_offsets { rest.double()? } else { rest.word()? };
            header.variables.push(Variable { name, dimensions, attributes, kind, begin });
        }
        Ok(header)
    }

    /// Whether a variable grows.
    pub fn grows(&self, variable: &Variable) -> bool {
        variable.dimensions.first().is_some_and(|&d| self.dimensions[d].size == 0)
    }

    /// The bytes of a variable, or of one record of it; none if there are more than can be.
    pub fn bytes_of(&self, variable: &Variable) -> Option<u64> {
        let size = variable.kind.map_or(1, Kind::size) as u64;
        let fixed = &variable.dimensions[usize::from(self.grows(variable))..];
        fixed.iter().try_fold(size, |product, &d| product.checked_mul(self.dimensions[d].size))
    }

    /// The bytes from one record to the next; none if there are more than can be.
    pub fn record_bytes(&self) -> Option<u64> {
        let growing: Vec<&Variable> = self.variables.iter().filter(|v| self.grows(v)).collect();
        // A single growing variable is not padded.
        if let [one] = growing.as_slice() {
            return self.bytes_of(one);
        }
        growing.iter().try_fold(0u64, |sum, v| sum.checked_add(self.bytes_of(v)?.checked_next_multiple_of(4)?))
    }
}

/// The type of numbers; none for text.
fn kind(number: u64) -> Result<Option<Kind>, String> {
    Ok(Some(match number {
        1 => Kind::I8,
        2 => return Ok(None),
        3 => Kind::I16,
        4 => Kind::I32,
        5 => Kind::F32,
        6 => Kind::F64,
        7 => Kind::U8,
        8 => Kind::U16,
        9 => Kind::U32,
        10 => Kind::I64,
        11 => Kind::U64,
        other => return Err(format!("is cut off, or damaged: it has values of type {other}")),
    }))
}

/// What is left of the header.
struct Rest<'a> {
    bytes: &'a [u8],
    wide_counts: bool,
    wide_offsets: bool,
}

impl<'a> Rest<'a> {
    fn take(&mut self, count: u64) -> Result<&'a [u8], String> {
        let taken = usize::try_from(count).ok().and_then(|n| self.bytes.split_at_checked(n));
        let (taken, rest) = taken.ok_or("is cut off, or damaged: its header is longer than the file")?;
        self.bytes = rest;
        Ok(taken)
    }

    fn word(&mut self) -> Result<u64, String> {
        Ok(self.take(4)?.first_chunk().map_or(0, |bytes| u32::from_be_bytes(*bytes).into()))
    }

    fn double(&mut self) -> Result<u64, String> {
        Ok(self.take(8)?.first_chunk().map_or(0, |bytes| u64::from_be_bytes(*bytes)))
    }

    fn count(&mut self) -> Result<u64, String> {
        if self.wide_counts { self.double() } else { self.word() }
    }

    /// A count of things that take so many bytes each at least.
    fn fitting(&mut self, bytes: u64) -> Result<u64, String> {
        let count = self.count()?;
        if count.saturating_mul(bytes) > self.bytes.len() as u64 {
            return Err(format!("is cut off, or damaged: its header declares a list of {count} entries"));
        }
        Ok(count)
    }

    fn list(&mut self) -> Result<u64, String> {
        self.word()?;
        self.fitting(8)
    }

    /// Something of so many bytes, filled up to a multiple of four.
    fn padded(&mut self, bytes: u64) -> Result<&'a [u8], String> {
        let taken = self.take(bytes)?;
        let padding = bytes.next_multiple_of(4) - bytes;
        self.take(padding.min(self.bytes.len() as u64))?;
        Ok(taken)
    }

    fn name(&mut self) -> Result<String, String> {
        let length = self.count()?;
        if length > LONGEST {
            return Err("is cut off, or damaged: a name is longer than the file".into());
        }
        self.padded(length).map(|bytes| String::from_utf8_lossy(bytes).into_owned())
    }

    fn attributes(&mut self) -> Result<Vec<(String, Content)>, String> {
        let mut attributes = Vec::new();
        for _ in 0..self.list()? {
            let name = self.name()?;
            let kind = kind(self.word()?)?;
            let size = kind.map_or(1, Kind::size) as u64;
            let count = self.fitting(size)?;
            let bytes = self.padded(size * count)?;
            attributes.push((
                name,
                match kind {
                    Some(kind) => Content::Numbers(kind.decode(bytes, false)),
                    None => Content::Text(String::from_utf8_lossy(bytes).into_owned()),
                },
            ));
        }
        Ok(attributes)
    }
}
