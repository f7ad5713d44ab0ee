//! TIFF stacks, page by page, through the `tiff` crate; with what OME-XML, ImageJ and tifffile say of them ([`layout`]).
//!
//! The numbers stored are read, whatever they look like: of pages with a table of colours the indices, of masks zeros and ones.
//! Of colours one is taken by `channel`.

mod directories;
mod layout;

use std::path::Path;

use ::tiff::TiffError;
use ::tiff::decoder::ifd::Value;
use ::tiff::decoder::{Decoder, DecodingResult, Limits};
use ::tiff::tags::Tag;

use self::directories::{Directories, Grey};
use self::layout::{Layout, Page};
use super::axes::{Axis, Opened, Role};
use super::numbers::{Bytes, Meaning, Numbers, Packing, stream};
use super::{Request, holds, room_for};
use crate::text::shortened;
use crate::volume::Kind;

/// The most points that come out of a byte: Zstandard makes 128 KiB of four bytes, and a point takes one bit at least.
const MOST_POINTS_A_BYTE: u64 = 8 << 15;

/// What is wrong, in words.
fn told(error: &TiffError) -> String {
    match error {
        TiffError::UnsupportedError(what) => {
            // A list that a damaged page gives for its format may be as long as the file.
            format!("unsupported: {}; convert it: tiffcp -c lzw IN.tif OUT.tif", shortened(&what.to_string(), 200))
        }
        TiffError::LimitsExceeded => "unsupported: a page larger than can be held".into(),
        error => format!("is cut off, or damaged: {}", shortened(&error.to_string(), 200)),
    }
}

pub(super) fn open(path: &Path, length: u64, request: &Request) -> Result<Opened, String> {
    let directories = Directories::read(path)?;
    let mut decoder = Decoder::new(Grey::open(path, &directories)?).map_err(|e| told(&e))?;
    // A description may be long: as long as the file at most.
    let mut limits = Limits::default();
    limits.ifd_value_size = limits.ifd_value_size.max(usize::try_from(length).unwrap_or(usize::MAX));
    decoder = decoder.with_limits(limits.clone());
    let (width, height) = decoder.dimensions().map_err(|e| told(&e))?;
    if u64::from(width) * u64::from(height) > length.saturating_mul(MOST_POINTS_A_BYTE) || width == 0 || height == 0 {
        return Err(format!("is cut off: it declares pages of {width} x {height} points, but has {length} bytes"));
    }
    let mut number = |tag: Tag| decoder.find_tag_unsigned::<u64>(tag).map_err(|e| told(&e));
    let samples = number(Tag::SamplesPerPixel)?.unwrap_or(1).max(1) as usize;
    let planar = number(Tag::PlanarConfiguration)? == Some(2);
    let compression = number(Tag::Compression)?.unwrap_or(1);
    let format = number(Tag::SampleFormat).unwrap_or(None).unwrap_or(1);
    let bits = decoder.find_tag_unsigned_vec::<u16>(Tag::BitsPerSample).map_err(|e| told(&e))?.unwrap_or_default();
    let bits = bits.first().copied().unwrap_or(1);
    let resolution = [Tag::XResolution, Tag::YResolution].map(|tag| match decoder.find_tag(tag) {
        Ok(Some(Value::Rational(count, unit))) if count > 0 && unit > 0 => Some(f64::from(unit) / f64::from(count)),
        _ => None,
    });
    // Text of any encoding: what matters of it is ASCII, or UTF-8.
    let description = match decoder.find_tag(Tag::ImageDescription) {
        Ok(Some(Value::Ascii(text))) => text,
        Ok(Some(other)) => other.into_u8_vec().map(|b| String::from_utf8_lossy(&b).into_owned()).unwrap_or_default(),
        _ => String::new(),
    };
    let page = Page {
        width: width as usize,
        height: height as usize,
        samples,
        planar,
        count: directories.count,
        resolution,
        description: &description,
        name: path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
    };
    let mut layout = Layout::of(&page, request)?;
    if directories.has_table {
        layout
            .notes
            .push("it has a table of colours, which is not applied: its numbers are read as they are stored".into());
    }
    if directories.white_is_zero {
        layout.notes.push("it shows 0 as white; its numbers are read as they are stored".into());
    }
    let kind = number_kind(bits, format)?;
    let size = page
        .width
        .checked_mul(page.height)
        .and_then(|n| n.checked_mul(samples))
        .ok_or("has pages larger than can be")?;
    let meaning = Meaning::linear(layout.linear.0, layout.linear.1);
    let values: Box<dyn Numbers> = if directories.count == 1 && layout.planes() > 1 {
        // All planes behind the first one, as ImageJ writes stacks of more than 4 GB.
        if compression != 1 || bits < 8 || planar {
            return Err(format!(
                "unsupported: {} planes on one page that is packed; save it in ImageJ as pages",
                layout.planes()
            ));
        }
        let offsets =
            decoder.find_tag_unsigned_vec::<u64>(Tag::StripOffsets).map_err(|e| told(&e))?.unwrap_or_default();
        let start = offsets.first().copied().ok_or("is damaged: its page is nowhere")?;
        let needed = (size as u64).checked_mul(layout.planes() as u64).and_then(|n| n.checked_mul(kind.size() as u64));
        holds(needed.ok_or("declares more points than can be")?, start, length, Packing::None)?;
        Box::new(Bytes::new(stream(path, start, Packing::None)?, kind, directories.little_endian, meaning))
    } else {
        if layout.planes() != directories.count && layout.format != "OME-TIFF" {
            return Err(format!(
                "has {} pages, which are not the {} planes of {}; give dimensions, the points along x, y, z and time",
                directories.count,
                layout.planes(),
                layout.outer.iter().map(|axis| format!("{} {}", axis.size, axis.name)).collect::<Vec<_>>().join(" x ")
            ));
        }
        room_for(size as u64 * (kind.size() as u64 + 1), "it is read page by page, and a page is held")?;
        // Lists in its directories keep the decoder's own limit; a page may be larger.
        let page_bytes = size.saturating_mul(kind.size());
        limits.decoding_buffer_size = limits.decoding_buffer_size.max(page_bytes);
        let packed = page_bytes.max(usize::try_from(length).unwrap_or(usize::MAX));
        limits.intermediate_buffer_size = limits.intermediate_buffer_size.max(packed);
        decoder = decoder.with_limits(limits);
        let row = page.width * samples;
        let inner = 2 + usize::from(samples > 1);
        Box::new(Pages { decoder, size, row, bits, inner, pages: layout.pages.clone(), at: 0, current: None, meaning })
    };
    let mut axes: Vec<Axis> = layout.inner.into_iter().collect();
    if samples > 1 {
        axes.insert(if planar { 2 } else { 0 }, Axis::new("sample", Some(Role::Channel), samples));
    }
    axes.extend(layout.outer.into_iter().filter(|axis| axis.size > 1 || axis.role != Some(Role::Channel)));
    let number = if bits < 8 { format!("uint{bits}") } else { kind.vtk_name().to_lowercase() };
    let mut opened = Opened::new(layout.format, axes, number, values);
    opened.unit = layout.unit;
    opened.has_times = layout.has_times;
    opened.notes = layout.notes;
    opened.first_channel = samples == 1;
    Ok(opened)
}

fn number_kind(bits: u16, format: u64) -> Result<Kind, String> {
    Ok(match (format, bits) {
        (1 | 4, 1..=8) => Kind::U8,
        (1 | 4, 9..=16) => Kind::U16,
        (1 | 4, 17..=32) => Kind::U32,
        (1 | 4, 33..=64) => Kind::U64,
        (2, 1..=8) => Kind::I8,
        (2, 9..=16) => Kind::I16,
        (2, 17..=32) => Kind::I32,
        (2, 33..=64) => Kind::I64,
        (3, 16 | 32) => Kind::F32,
        (3, 64) => Kind::F64,
        (5 | 6, _) => return Err("unsupported: complex numbers; save their real parts".into()),
        _ => return Err(format!("unsupported: numbers of {bits} bits in format {format}; save them as float32")),
    })
}

/// The pages of a file, one in memory.
struct Pages {
    decoder: Decoder<Grey>,
    /// Numbers on a page.
    size: usize,
    /// Numbers in a row.
    row: usize,
    bits: u16,
    /// How many axes lie within a page.
    inner: usize,
    /// Which pages, in this order.
    pages: Vec<usize>,
    /// The next value.
    at: u64,
    current: Option<(usize, DecodingResult)>,
    meaning: Meaning,
}

impl Pages {
    fn page(&mut self, index: usize) -> Result<&DecodingResult, String> {
        let page = *self.pages.get(index).ok_or("has no more pages")?;
        if self.current.as_ref().is_none_or(|(held, _)| *held != page) {
            self.current = None;
            let wrong = |e: TiffError| format!("page {page} {}", told(&e));
            self.decoder.seek_to_image(page).map_err(wrong)?;
            let (width, height) = self.decoder.dimensions().map_err(wrong)?;
            let samples = self.decoder.find_tag_unsigned::<u64>(Tag::SamplesPerPixel).map_err(wrong)?.unwrap_or(1);
            let size = u64::from(width) * u64::from(height) * samples;
            if size != self.size as u64 {
                return Err(format!(
                    "page {page} has {width} x {height} points of {samples} numbers, unlike the first"
                ));
            }
            let mut values = DecodingResult::U8(Vec::new());
            self.decoder.read_image_to_buffer(&mut values).map_err(wrong)?;
            self.current = Some((page, unpacked(values, self.bits, self.row, self.size)));
        }
        self.current.as_ref().map(|(_, values)| values).ok_or_else(|| "has no more pages".into())
    }
}

/// One number a place, of numbers that share bytes; every row begins with a byte of its own.
fn unpacked(values: DecodingResult, bits: u16, row: usize, size: usize) -> DecodingResult {
    let bits = usize::from(bits);
    match values {
        DecodingResult::U8(bytes) if bits < 8 && 8 % bits == 0 && bytes.len() < size => {
            let mask = (1u16 << bits) as u8 - 1;
            let (each, rows) = (8 / bits, bytes.chunks_exact((row * bits).div_ceil(8)));
            DecodingResult::U8(
                rows.flat_map(|bytes| (0..row).map(move |x| bytes[x / each] >> (8 - bits * (x % each + 1)) & mask))
                    .collect(),
            )
        }
        other => other,
    }
}

/// Numbers from a place on, in double precision.
fn copied(values: &DecodingResult, from: usize, out: &mut [f64]) -> Option<()> {
    fn copy<T: Copy>(values: &[T], from: usize, out: &mut [f64], number: impl Fn(T) -> f64) -> Option<()> {
        let values = values.get(from..from + out.len())?;
        out.iter_mut().zip(values).for_each(|(slot, value)| *slot = number(*value));
        Some(())
    }
    match values {
        DecodingResult::U8(v) => copy(v, from, out, f64::from),
        DecodingResult::U16(v) => copy(v, from, out, f64::from),
        DecodingResult::U32(v) => copy(v, from, out, f64::from),
        DecodingResult::U64(v) => copy(v, from, out, |x| x as f64),
        DecodingResult::F16(v) => copy(v, from, out, |x| x.to_f64()),
        DecodingResult::F32(v) => copy(v, from, out, f64::from),
        DecodingResult::F64(v) => copy(v, from, out, |x| x),
        DecodingResult::I8(v) => copy(v, from, out, f64::from),
        DecodingResult::I16(v) => copy(v, from, out, f64::from),
        DecodingResult::I32(v) => copy(v, from, out, f64::from),
        DecodingResult::I64(v) => copy(v, from, out, |x| x as f64),
    }
}

impl Numbers for Pages {
    fn read(&mut self, out: &mut [f64]) -> Result<(), String> {
        let mut done = 0;
        while done < out.len() {
            let (index, from) = ((self.at / self.size as u64) as usize, (self.at % self.size as u64) as usize);
            let now = (out.len() - done).min(self.size - from);
            let slots = &mut out[done..done + now];
            let page = self.page(index)?;
            copied(page, from, slots).ok_or_else(|| format!("page {index} holds fewer numbers than it declares"))?;
            done += now;
            self.at += now as u64;
        }
        self.meaning.apply(out);
        Ok(())
    }

    fn skip(&mut self, count: u64) -> Result<(), String> {
        self.at += count;
        Ok(())
    }

    /// Pages can come in any order, as long as what is on a page stays as it is.
    fn reorder(&mut self, sizes: &[usize], order: &[usize]) -> Option<Vec<usize>> {
        let (within, over): (Vec<usize>, Vec<usize>) = order.iter().partition(|&&axis| axis < self.inner);
        if !within.is_sorted() || !order.starts_with(&within) {
            return None;
        }
        let rest = (self.inner..sizes.len()).filter(|axis| !over.contains(axis));
        let outer: Vec<usize> = over.iter().copied().chain(rest).collect();
        let stride = |axis: usize| sizes[self.inner..axis].iter().product::<usize>();
        let place = |mut index: usize| {
            outer
                .iter()
                .map(|&axis| {
                    let at = index % sizes[axis];
                    index /= sizes[axis];
                    at * stride(axis)
                })
                .sum::<usize>()
        };
        self.pages = (0..self.pages.len()).map(|i| self.pages.get(place(i)).copied()).collect::<Option<_>>()?;
        Some((0..self.inner).chain(outer).collect())
    }
}
