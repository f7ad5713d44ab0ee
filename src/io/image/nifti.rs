//! NIfTI-1 and NIfTI-2: whole (`.nii`), compressed (`.nii.gz`), or a pair of `.hdr` and `.img`.
//!
//! Both headers hold the same fields at other places and of other widths, so one table of places reads them. Points lie where
//! the sform says, or the qform, or the spacings alone, in millimetres or what the file names, to the right, front and up.

use std::io::Read;
use std::path::{Path, PathBuf};

use super::axes::{Axis, Opened, Placement, Positions, Role};
use super::numbers::{Bytes, Meaning, Packing, is_gzip, stream};
use super::{Request, counted, fits, holds};
use crate::volume::Kind;

/// The fields of either header.
struct Header {
    bytes: Vec<u8>,
    two: bool,
    little_endian: bool,
}

impl Header {
    /// Of the first bytes of a file.
    fn new(bytes: Vec<u8>) -> Result<Self, String> {
        let size = bytes.first_chunk::<4>().map(|b| (i32::from_le_bytes(*b), i32::from_be_bytes(*b)));
        let (two, little_endian) = match size {
            Some((348, _)) => (false, true),
            Some((_, 348)) => (false, false),
            Some((540, _)) => (true, true),
            Some((_, 540)) => (true, false),
            _ => return Err("is no NIfTI file: its header is neither of 348 nor of 540 bytes".into()),
        };
        if bytes.len() < if two { 540 } else { 348 } {
            return Err("is cut off: its header is not complete".into());
        }
        let header = Self { bytes, two, little_endian };
        match &header.bytes[if two { 4..7 } else { 344..347 }] {
            b"n+1" | b"n+2" | b"ni1" | b"ni2" => Ok(header),
            _ => {
                Err("unsupported: an ANALYZE file, which says nothing of its place; convert it by nibabel to .nii"
                    .into())
            }
        }
    }

    /// Whether the values are in a file of their own.
    fn is_pair(&self) -> bool {
        self.bytes[if self.two { 5 } else { 345 }] == b'i'
    }

    fn take<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut bytes = [0; N];
        bytes.copy_from_slice(&self.bytes[at..at + N]);
        if !self.little_endian {
            bytes.reverse();
        }
        bytes
    }

    fn short(&self, at: usize) -> i64 {
        i16::from_le_bytes(self.take(at)).into()
    }

    fn long(&self, at: usize) -> i64 {
        i64::from_le_bytes(self.take(at))
    }

    fn int(&self, at: usize) -> i64 {
        i32::from_le_bytes(self.take(at)).into()
    }

    /// A real number: of 4 bytes at `one`, or the `i`-th of 8 bytes at `two`.
    fn real(&self, one: usize, two: usize, i: usize) -> f64 {
        if self.two {
            f64::from_le_bytes(self.take(two + 8 * i))
        } else {
            f32::from_le_bytes(self.take(one + 4 * i)).into()
        }
    }

    fn dim(&self, i: usize) -> i64 {
        if self.two { self.long(16 + 8 * i) } else { self.short(40 + 2 * i) }
    }

    fn pixdim(&self, i: usize) -> f64 {
        self.real(76, 104, i)
    }

    fn code(&self, one: usize, two: usize) -> i64 {
        if self.two { self.int(two) } else { self.short(one) }
    }

    /// The axes' steps in the world, a vector each, and where the first point lies.
    fn placement(&self) -> Option<([[f64; 3]; 3], [f64; 3])> {
        if self.code(254, 348) > 0 {
            let row = |r: usize, c: usize| self.real(280 + 16 * r, 400 + 32 * r, c);
            return Some((
                std::array::from_fn(|c| std::array::from_fn(|r| row(r, c))),
                std::array::from_fn(|r| row(r, 3)),
            ));
        }
        if self.code(252, 344) <= 0 {
            return None;
        }
        let [b, c, d]: [f64; 3] = std::array::from_fn(|i| self.real(256, 352, i));
        let offset = std::array::from_fn(|i| self.real(268, 376, i));
        // A quaternion of length 1, of which the real part is left out.
        let rest = 1.0 - (b * b + c * c + d * d);
        let (a, b, c, d) = if rest < 1e-7 {
            let length = (b * b + c * c + d * d).sqrt();
            (0.0, b / length, c / length, d / length)
        } else {
            (rest.sqrt(), b, c, d)
        };
        let rotation = [
            [a * a + b * b - c * c - d * d, 2.0 * (b * c - a * d), 2.0 * (b * d + a * c)],
            [2.0 * (b * c + a * d), a * a + c * c - b * b - d * d, 2.0 * (c * d - a * b)],
            [2.0 * (b * d - a * c), 2.0 * (c * d + a * b), a * a + d * d - b * b - c * c],
        ];
        let handed = if self.pixdim(0) < 0.0 { -1.0 } else { 1.0 };
        // A step of 0, as flat images have it, counts as 1: so NIfTI's own library reads it.
        let length = |i: usize| Some(self.pixdim(i + 1).abs()).filter(|&step| step > 0.0).unwrap_or(1.0);
        let step = |i: usize| length(i) * if i == 2 { handed } else { 1.0 };
        Some((std::array::from_fn(|i| std::array::from_fn(|r| rotation[r][i] * step(i))), offset))
    }
}

/// The file of values beside a header.
fn image_beside(path: &Path) -> PathBuf {
    let packed = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("gz"));
    let plain = if packed { path.with_extension("") } else { path.to_owned() };
    let (image, zipped) = (plain.with_extension("img"), plain.with_extension("img.gz"));
    if packed || !image.exists() && zipped.exists() { zipped } else { image }
}

/// The files besides the header that values are read from.
pub(super) fn data_files(path: &Path) -> Vec<PathBuf> {
    match read_header(path) {
        Ok(header) if header.is_pair() => vec![image_beside(path)],
        _ => Vec::new(),
    }
}

fn read_header(path: &Path) -> Result<Header, String> {
    let packing = if is_gzip(path) { Packing::Gzip } else { Packing::None };
    let mut bytes = Vec::new();
    stream(path, 0, packing)?
        .take(540)
        .read_to_end(&mut bytes)
        .map_err(|e| format!("is cut off, or no NIfTI file: {e}"))?;
    Header::new(bytes)
}

pub(super) fn open(path: &Path, _: u64, request: &Request) -> Result<Opened, String> {
    let header = read_header(path)?;
    let count = header.dim(0);
    if !(1..=7).contains(&count) {
        return Err(format!("has {count} dimensions, which can't be"));
    }
    let size = |i: usize| if i as i64 <= count { header.dim(i) } else { 1 };
    if let Some(i) = (1..=7).find(|&i| size(i) < 1) {
        return Err(format!("has {} points along its dimension {i}, which can't be", size(i)));
    }
    if let Some(i) = (6..=7).find(|&i| size(i) > 1) {
        return Err(format!("unsupported: a dimension {i} of {} points; take it apart, by nibabel say", size(i)));
    }
    let kind = match header.short(if header.two { 12 } else { 70 }) {
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
        other => {
            let what = match other {
                1 => "single bits",
                32 | 1792 | 2048 => "complex numbers",
                128 | 2304 => "colours",
                1536 => "numbers of 128 bits",
                _ => "numbers of an unknown type",
            };
            return Err(format!("unsupported: {what} (NIfTI's type {other}); save real numbers, by nibabel say"));
        }
    };
    let mut notes = Vec::new();
    let values = if header.is_pair() { image_beside(path) } else { path.to_owned() };
    let packing = if is_gzip(&values) { Packing::Gzip } else { Packing::None };
    let offset = if header.two { header.long(168) as f64 } else { header.real(108, 0, 0) };
    let least = if header.is_pair() { 0.0 } else { if header.two { 540.0 } else { 348.0 } };
    if !(least..=1e15).contains(&offset) {
        return Err(format!("says that its values begin at byte {offset}, which can't be"));
    }
    let offset = offset as u64;
    let sizes: Vec<usize> = (1..=5).map(|i| usize::try_from(size(i)).unwrap_or(usize::MAX)).collect();
    let needed = counted(&sizes, kind.size())?;
    let length = crate::input::length(&values).map_err(|e| format!("its values, {}: {e}", values.display()))?;
    if packing == Packing::None {
        holds(needed, offset, length, packing)?;
        fits(needed, offset, length, false, &mut notes)?;
    } else {
        holds(needed, 0, length, packing)?;
    }
    let mut reader = stream(&values, if packing == Packing::None { offset } else { 0 }, packing)?;
    if packing == Packing::Gzip {
        reader.pass(offset).map_err(|e| format!("is cut off: {e}"))?;
    }
    // A slope of 0 means that there is none.
    let (slope, shift) = (header.real(112, 176, 0), header.real(116, 184, 0));
    let scaled = slope != 0.0 && slope.is_finite() && shift.is_finite();
    let meaning = if scaled { Meaning::linear(slope, shift) } else { Meaning::default() };

    let units = if header.two { header.int(500) } else { i64::from(header.bytes[123]) };
    let length_unit = match units & 7 {
        1 => Some("m"),
        2 => Some("mm"),
        3 => Some("um"),
        _ => None,
    };
    let time_unit = match units & 56 {
        8 => Some("s"),
        16 => Some("ms"),
        24 => Some("us"),
        32 => Some("Hz"),
        40 => Some("ppm"),
        48 => Some("rad/s"),
        _ => None,
    };
    let mut axes: Vec<Axis> = [Role::X, Role::Y, Role::Z, Role::Time, Role::Channel]
        .into_iter()
        .zip(&sizes)
        .enumerate()
        .map(|(i, (role, &size))| Axis::new(role.name(), Some(role), size).spaced(header.pixdim(i + 1).abs()))
        .collect();
    axes[..3].iter_mut().for_each(|axis| axis.unit = length_unit.map(str::to_owned));
    axes[3].unit = time_unit.map(str::to_owned);
    axes[3].positions = Positions::even(header.real(136, 216, 0), header.pixdim(4).abs());
    if axes[4].size == 1 {
        axes.truncate(4);
    }
    if sizes[3] > 1 && !(header.pixdim(4) != 0.0 && header.pixdim(4).is_finite()) {
        notes.push(format!("its step of time is {}; it counts as 1, if spacing says nothing else", header.pixdim(4)));
    }
    let mut opened = Opened::new(
        if header.two { "NIfTI-2" } else { "NIfTI-1" },
        axes,
        kind.vtk_name().to_lowercase(),
        Box::new(Bytes::new(reader, kind, header.little_endian, meaning)),
    );
    opened.notes = notes;
    if let Some((steps, origin)) = header.placement().filter(|_| request.placement == Placement::World) {
        for (axis, step) in opened.axes.iter_mut().zip(steps) {
            let length = step.iter().map(|x| x * x).sum::<f64>().sqrt();
            if length == 0.0 && axis.size == 1 {
                continue; // nothing lies along it
            }
            if !(length.is_finite() && length > 0.0) {
                return Err(format!(
                    "places its axis {} by a step of length {length}; placement: stored does without",
                    axis.name
                ));
            }
            axis.positions = Positions::spaced(length);
            axis.direction = Some(std::array::from_fn(|r| step.get(r).map_or(0.0, |x| x / length)));
        }
        opened.origin = [origin[0], origin[1], origin[2], 0.0];
        opened.space = Some("RAS".into());
    }
    Ok(opened)
}
