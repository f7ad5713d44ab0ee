//! NIfTI-1, whole (`.nii`) or compressed (`.nii.gz`): the header through the `nifti` crate, the values as a stream.
//!
//! Spacings are taken from the header, in its own units; orientation is not, the image stays as it is stored.

use std::io::Read;
use std::path::Path;

use ::nifti::{Endianness, NiftiHeader};

use super::bytes::{Bytes, stream};
use super::{Header, Image, Request, counted, holds};
use crate::volume::Kind;

pub(super) fn open(path: &Path, length: u64, _: &Request) -> Result<Image, String> {
    let mut magic = [0; 2];
    let compressed =
        crate::input::open(path).and_then(|mut f| f.read_exact(&mut magic)).is_ok() && magic == [0x1f, 0x8b];
    let mut reader = stream(path, 0, compressed)?;
    let mut bytes = [0; 348];
    reader.read_exact(&mut bytes).map_err(|e| format!("is cut off, or no NIfTI file: {e}"))?;
    let header = NiftiHeader::from_reader(&bytes[..]).map_err(|e| format!("is no NIfTI file: {e}"))?;
    if &header.magic != b"n+1\0" {
        return Err("is no single NIfTI-1 file (a pair of .hdr and .img, or NIfTI-2); save it as .nii".into());
    }
    let dimensions = header.dim().map_err(|e| format!("has sizes that make no sense: {e}"))?;
    if dimensions.len() > 4 && dimensions[4..].iter().any(|&n| n > 1) {
        return Err(format!("has {} dimensions; four at most are understood", dimensions.len()));
    }
    let points = std::array::from_fn(|axis| dimensions.get(axis).map_or(1, |&n| usize::from(n)));
    let kind = match header.datatype {
        2 => Kind::U8,
        4 => Kind::I16,
        8 => Kind::I32,
        16 => Kind::F32,
        64 => Kind::F64,
        256 => Kind::I8,
        512 => Kind::U16,
        768 => Kind::U32,
        1024 => Kind::I64,
        1280 => Kind::U64,
        other => return Err(format!("holds numbers of NIfTI's type {other}; only real ones are understood")),
    };
    let needed = counted(points, kind.size())?;
    let offset = header.vox_offset;
    if !(348.0..=1e9).contains(&offset) {
        return Err(format!("says that its values begin at byte {offset}, which can't be"));
    }
    holds(needed, if compressed { 0 } else { offset as u64 }, length, compressed)?;
    std::io::copy(&mut reader.by_ref().take(offset as u64 - 348), &mut std::io::sink()).map_err(|e| e.to_string())?;
    // A slope of 0 means that there is none.
    let scaled = header.scl_slope != 0.0 && header.scl_slope.is_finite() && header.scl_inter.is_finite();
    let slices = Bytes {
        reader,
        kind,
        little_endian: header.endianness == Endianness::Little,
        size: points[0] * points[1],
        scale: if scaled { f64::from(header.scl_slope) } else { 1.0 },
        shift: if scaled { f64::from(header.scl_inter) } else { 0.0 },
        read: 0,
    };
    let spacing = std::array::from_fn(|axis| f64::from(header.pixdim[axis + 1]));
    Ok(Image { header: Header::even(points, [0.0; 4], spacing), slices: Box::new(slices) })
}
