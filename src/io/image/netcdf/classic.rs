//! NetCDF of the classic kinds: each variable in one stretch, or in records side by side with others that grow.

use std::path::{Path, PathBuf};

use super::super::counted;
use super::super::numbers::{Bytes, Meaning, Numbers, Packing, Stream, stream};
use super::Container;
use super::header::{Header, Variable};
use crate::volume::Kind;

/// A file, and what its variables share.
pub(super) struct Classic {
    path: PathBuf,
    length: u64,
    header: Header,
    /// How often the growing dimension has grown.
    records: u64,
    /// The bytes from one record to the next.
    record: u64,
}

impl Container for Classic {
    fn format(&self) -> &'static str {
        match self.header.version {
            1 => "NetCDF (CDF-1)",
            2 => "NetCDF (CDF-2)",
            _ => "NetCDF (CDF-5)",
        }
    }

    fn header(&self) -> &Header {
        &self.header
    }

    fn size(&self, dimension: usize) -> usize {
        match self.header.dimensions[dimension].size {
            0 => usize::try_from(self.records).unwrap_or(usize::MAX),
            size => usize::try_from(size).unwrap_or(usize::MAX),
        }
    }

    fn numbers(&self, variable: &Variable, kind: Kind, meaning: Meaning) -> Result<Box<dyn Numbers>, String> {
        let sizes: Vec<usize> = variable.dimensions.iter().map(|&d| self.size(d)).collect();
        self.check(variable, counted(&sizes, kind.size())?)?;
        Ok(Box::new(Bytes::new(self.stream(variable)?, kind, false, meaning)))
    }
}

impl Classic {
    pub fn open(path: &Path, length: u64) -> Result<Self, String> {
        let header = Header::read(path)?;
        let record = header.record_bytes().ok_or("declares records larger than can be")?;
        let records = match header.records {
            Some(records) => records,
            // Left open by a writer that didn't count: as many as the file has room for.
            None => {
                let begin = header.variables.iter().filter(|v| header.grows(v)).map(|v| v.begin).min();
                length.saturating_sub(begin.unwrap_or(length)) / record.max(1)
            }
        };
        Ok(Self { path: path.into(), length, header, records, record })
    }

    /// Refuses a variable that reaches beyond the file.
    fn check(&self, variable: &Variable, needed: u64) -> Result<(), String> {
        let end = match self.header.grows(variable) {
            // Of the last record what this variable takes.
            true => (self.records.saturating_sub(1))
                .checked_mul(self.record)
                .and_then(|n| n.checked_add(self.header.bytes_of(variable)?)),
            false => Some(needed),
        };
        let end = end.and_then(|n| n.checked_add(variable.begin));
        if end.is_none_or(|end| end > self.length) {
            let (name, length) = (&variable.name, self.length);
            return Err(format!("is cut off: variable \"{name}\" takes {needed} bytes, the file has {length} bytes"));
        }
        Ok(())
    }

    fn stream(&self, variable: &Variable) -> Result<Box<dyn Stream>, String> {
        let file = stream(&self.path, variable.begin, Packing::None)?;
        let own = self.header.bytes_of(variable).unwrap_or(0);
        if !self.header.grows(variable) || own == self.record {
            return Ok(file);
        }
        Ok(Box::new(Records { file, own, gap: self.record - own, left: own }))
    }
}

/// One variable's bytes out of records that hold several.
struct Records {
    file: Box<dyn Stream>,
    own: u64,
    gap: u64,
    left: u64,
}

impl Records {
    fn next(&mut self) -> std::io::Result<()> {
        if self.left == 0 {
            self.file.pass(self.gap)?;
            self.left = self.own;
        }
        Ok(())
    }
}

impl std::io::Read for Records {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        self.next()?;
        let most = bytes.len().min(usize::try_from(self.left).unwrap_or(usize::MAX));
        let count = self.file.read(&mut bytes[..most])?;
        self.left -= count as u64;
        Ok(count)
    }
}

impl Stream for Records {
    fn pass(&mut self, count: u64) -> std::io::Result<()> {
        let mut count = count;
        while count > 0 {
            self.next()?;
            let now = count.min(self.left);
            self.file.pass(now)?;
            self.left -= now;
            count -= now;
        }
        Ok(())
    }
}
