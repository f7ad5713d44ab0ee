//! Arrays kept aside until the file's head can be written, compressed block by block on the way in.
//!
//! VTK's form: how many blocks, their length before compression, the length of the last one if it is not full, then
//! the compressed length of each; and the blocks, one after the other.

use std::io::{Seek, Write};
use std::path::Path;

use tempfile::SpooledTempFile;

use super::super::Error;
use super::Compression;

/// Bytes of a compressed block before compression. VTK's own 32 KiB compress worse and need long lists of lengths.
const BLOCK: usize = 1 << 18;
/// Bytes of an array kept in memory before it moves to a temporary file.
const MEMORY: usize = 1 << 22;

/// An array kept aside.
pub(super) struct Spool {
    /// What there is of it, as it goes into the file.
    pub file: SpooledTempFile,
    /// Bytes not yet a whole block.
    partial: Vec<u8>,
    /// Compressed length of each block so far.
    packed: Vec<u64>,
}

impl Spool {
    /// An empty array; beyond a few megabytes it goes to a nameless file in `folder`, or else in the system's own.
    pub fn new(folder: Option<&Path>) -> Self {
        let file = match folder {
            Some(folder) => SpooledTempFile::new_in(MEMORY, folder),
            None => SpooledTempFile::new(MEMORY),
        };
        Self { file, partial: Vec::new(), packed: Vec::new() }
    }

    /// Bytes of all blocks so far.
    pub fn packed_len(&self) -> u64 {
        self.packed.iter().sum()
    }

    /// Takes bytes in; whole blocks of them are compressed at once.
    pub fn push(&mut self, mut bytes: &[u8], compression: Compression) -> Result<(), Error> {
        if compression == Compression::None {
            return Ok(self.file.write_all(bytes)?);
        }
        while !bytes.is_empty() {
            let (now, later) = bytes.split_at(bytes.len().min(BLOCK - self.partial.len()));
            self.partial.extend_from_slice(now);
            bytes = later;
            if self.partial.len() == BLOCK {
                self.pack(compression)?;
            }
        }
        Ok(())
    }

    /// Compresses what is there as one block.
    fn pack(&mut self, compression: Compression) -> Result<(), Error> {
        let packed = match compression {
            Compression::None => std::mem::take(&mut self.partial),
            Compression::Lz4 => lz4_flex::block::compress(&self.partial),
            Compression::Zlib => {
                let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
                encoder.write_all(&self.partial)?;
                encoder.finish()?
            }
        };
        self.partial.clear();
        self.packed.push(packed.len() as u64);
        self.file.write_all(&packed)?;
        Ok(())
    }

    /// Packs the rest, goes back to the beginning, and returns the numbers that stand before the array.
    pub fn complete(&mut self, length: u64, compression: Compression) -> Result<Vec<u8>, Error> {
        let rest = self.partial.len() as u64;
        if rest > 0 {
            self.pack(compression)?;
        }
        self.file.rewind()?;
        if compression == Compression::None {
            return Ok(length.to_le_bytes().to_vec());
        }
        let numbers = [self.packed.len() as u64, BLOCK as u64, rest].into_iter().chain(self.packed.iter().copied());
        Ok(numbers.flat_map(u64::to_le_bytes).collect())
    }
}
