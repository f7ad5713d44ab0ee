//! Numbers without structure, x fastest: raw files, and what follows the headers of NIfTI and NRRD.

use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use super::{ByteOrder, Header, Image, Request, Slices, counted};
use crate::volume::Kind;

/// Slices from a stream of bytes.
pub(super) struct Bytes {
    pub reader: Box<dyn Read>,
    pub kind: Kind,
    pub little_endian: bool,
    /// Numbers in a slice.
    pub size: usize,
    /// Each value times `scale`, plus `shift`.
    pub scale: f64,
    pub shift: f64,
    pub read: usize,
}

impl Slices for Bytes {
    fn next(&mut self) -> Result<Vec<f64>, String> {
        let mut bytes = Vec::new();
        let wanted = self.size * self.kind.size();
        // Read as far as there is, so that a declared size alone allocates nothing.
        let found = self.reader.by_ref().take(wanted as u64).read_to_end(&mut bytes);
        let found = found.map_err(|e| format!("slice {} can't be read: {e}", self.read))?;
        if found < wanted {
            return Err(format!("is cut off: slice {} has {found} bytes of {wanted}", self.read));
        }
        self.read += 1;
        let mut values = self.kind.decode(&bytes, self.little_endian).to_f64();
        if (self.scale, self.shift) != (1.0, 0.0) {
            values.iter_mut().for_each(|value| *value = *value * self.scale + self.shift);
        }
        Ok(values)
    }
}

/// The bytes of a file from an offset on; decompressed on the way if they begin as gzip does.
pub(super) fn stream(path: &Path, offset: u64, compressed: bool) -> Result<Box<dyn Read>, String> {
    let mut file = BufReader::with_capacity(1 << 18, crate::input::open(path).map_err(|e| e.to_string())?);
    file.seek(SeekFrom::Start(offset)).map_err(|e| e.to_string())?;
    Ok(if compressed { Box::new(flate2::bufread::MultiGzDecoder::new(file)) } else { Box::new(file) })
}

pub(super) fn open_raw(path: &Path, length: u64, request: &Request) -> Result<Image, String> {
    let points = request.dimensions.ok_or("is a raw file, which doesn't say its sizes: give dimensions")?;
    let kind = request.number.ok_or("is a raw file, which doesn't say its numbers: give type, such as uint8")?.kind();
    let needed = counted(points, kind.size())?;
    if request.offset.checked_add(needed) != Some(length) {
        return Err(format!(
            "has {length} bytes, but {} numbers of {} bytes after {} bytes take {}; check dimensions, type and offset",
            needed / kind.size() as u64,
            kind.size(),
            request.offset,
            request.offset.saturating_add(needed)
        ));
    }
    let slices = Bytes {
        reader: stream(path, request.offset, false)?,
        kind,
        little_endian: request.byte_order == ByteOrder::Little,
        size: points[0] * points[1],
        scale: 1.0,
        shift: 0.0,
        read: 0,
    };
    Ok(Image { header: Header::even(points, [0.0; 4], [1.0; 4]), slices: Box::new(slices) })
}
