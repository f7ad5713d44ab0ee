//! Whether the lists in a NetCDF-3 header are as long as they say: the crate that reads them makes room for what is declared
//! before it looks, so a damaged count would ask for more memory than there is.

use std::io::Read;
use std::path::Path;

/// Headers are a few kilobytes; beyond this nothing is believed.
const LONGEST: u64 = 1 << 24;

/// Bytes of a value, by NetCDF-3's number for its type.
fn bytes_of(kind: u64) -> Result<u64, String> {
    match kind {
        1 | 2 => Ok(1),
        3 => Ok(2),
        4 | 5 => Ok(4),
        6 => Ok(8),
        other => Err(format!("is damaged: it has values of type {other}")),
    }
}

/// Checks the header of a file.
pub fn check(path: &Path) -> Result<(), String> {
    let mut bytes = Vec::new();
    let file = crate::input::open(path).map_err(|e| e.to_string())?;
    file.take(LONGEST).read_to_end(&mut bytes).map_err(|e| e.to_string())?;
    let wide = bytes.get(3) == Some(&2);
    let mut rest = Rest(bytes.get(8..).unwrap_or_default());
    for _ in 0..rest.list()? {
        rest.name()?;
        rest.skip(4)?;
    }
    rest.attributes()?;
    for _ in 0..rest.list()? {
        rest.name()?;
        let dimensions = rest.number()?;
        rest.skip(4 * dimensions)?;
        rest.attributes()?;
        rest.skip(if wide { 16 } else { 12 })?;
    }
    Ok(())
}

/// What is left of the header.
struct Rest<'a>(&'a [u8]);

impl Rest<'_> {
    fn skip(&mut self, bytes: u64) -> Result<(), String> {
        let left = usize::try_from(bytes).ok().and_then(|n| self.0.get(n..));
        self.0 = left.ok_or("is cut off, or damaged: its header is longer than the file")?;
        Ok(())
    }

    fn number(&mut self) -> Result<u64, String> {
        let number = self.0.first_chunk::<4>().map_or(0, |bytes| u64::from(u32::from_be_bytes(*bytes)));
        self.skip(4)?;
        Ok(number)
    }

    /// The number of entries of a list, each of which takes eight bytes at least.
    fn list(&mut self) -> Result<u64, String> {
        self.skip(4)?;
        let count = self.number()?;
        if 8 * count > self.0.len() as u64 {
            return Err(format!("is cut off, or damaged: its header declares a list of {count} entries"));
        }
        Ok(count)
    }

    /// Something of so many bytes, filled up to a multiple of four.
    fn padded(&mut self, bytes: u64) -> Result<(), String> {
        self.skip(bytes.div_ceil(4) * 4)
    }

    fn name(&mut self) -> Result<(), String> {
        let length = self.number()?;
        self.padded(length)
    }

    fn attributes(&mut self) -> Result<(), String> {
        for _ in 0..self.list()? {
            self.name()?;
            let size = bytes_of(self.number()?)?;
            let count = self.number()?;
            self.padded(size * count)?;
        }
        Ok(())
    }
}
