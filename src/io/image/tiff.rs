//! TIFF stacks and ImageJ's hyperstacks, page by page, through the `tiff` crate.
//!
//! ImageJ writes how the pages are channels, slices and frames into the first page's description, channels fastest; other
//! programs don't, so `dimensions` can say it. Without either the pages are z.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use ::tiff::decoder::{Decoder, DecodingResult, ifd::Value};
use ::tiff::tags::Tag;

use super::{Header, Image, Request, Slices};

type Pages = Decoder<BufReader<File>>;

struct Stack {
    pages: Pages,
    size: usize,
    channels: usize,
    /// Pages to pass over before the next slice.
    ahead: usize,
    page: usize,
}

pub(super) fn open(path: &Path, length: u64, request: &Request) -> Result<Image, String> {
    let begin = || {
        let file = crate::input::open(path).map_err(|e| e.to_string())?;
        Decoder::new(BufReader::new(file)).map_err(|e| format!("is cut off, or no TIFF file: {e}"))
    };
    let mut pages = begin()?;
    let (width, height) = pages.dimensions().map_err(|e| format!("has no size: {e}"))?;
    // LZW makes at most 4096 bytes of twelve bits, and a point takes one bit at least.
    if u64::from(width) * u64::from(height) / 8 > length.saturating_mul(2731) || width == 0 || height == 0 {
        return Err(format!("is cut off: it declares pages of {width} x {height} points, but has {length} bytes"));
    }
    let description = pages.get_tag_ascii_string(Tag::ImageDescription).unwrap_or_default();
    let resolution = [Tag::XResolution, Tag::YResolution].map(|tag| match pages.find_tag(tag) {
        Ok(Some(Value::Rational(count, unit))) if count > 0 => f64::from(unit) / f64::from(count),
        _ => 0.0,
    });
    // Every page takes some bytes, so that a ring of pages ends.
    let mut count = 1usize;
    while pages.more_images() && (count as u64) < length {
        pages.next_image().map_err(|e| format!("is cut off, or damaged: page {count}: {e}"))?;
        count += 1;
    }
    let imagej = description.starts_with("ImageJ=");
    let told = |key: &str| {
        let line = description.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix('='));
        line.and_then(|value| value.trim().parse::<f64>().ok()).filter(|_| imagej)
    };
    let whole = |key: &str| told(key).map_or(1, |n| n.clamp(1.0, 1e9) as usize);
    let channels = whole("channels");
    let (slices, frames) = match request.dimensions {
        Some([_, _, slices, frames]) => (slices, frames),
        None if imagej => (whole("slices"), whole("frames")),
        None => (count, 1),
    };
    if let Some([x, y, _, _]) = request.dimensions.filter(|d| [d[0], d[1]] != [width as usize, height as usize]) {
        return Err(format!("has pages of {width} x {height} points, not {x} x {y}"));
    }
    if slices.checked_mul(frames).and_then(|n| n.checked_mul(channels)) != Some(count) {
        return Err(format!(
            "has {count} pages, which are not {channels} channels of {slices} slices at {frames} times; \
             give dimensions, the points along x, y, z and time"
        ));
    }
    if request.channel >= channels {
        return Err(format!("has {channels} channels, counted from 0; there is no channel {}", request.channel));
    }
    let points = [width as usize, height as usize, slices, frames];
    // ImageJ's numbers fit together only if the resolution is there as well.
    let spacing = match resolution {
        [x, y] if imagej && x > 0.0 && y > 0.0 => {
            [x, y, told("spacing").unwrap_or(0.0), told("finterval").unwrap_or(0.0)]
        }
        _ => [0.0; 4],
    };
    let size = points[0].checked_mul(points[1]).ok_or("has pages larger than can be")?;
    let stack = Stack { pages: begin()?, size, channels, ahead: request.channel, page: 0 };
    Ok(Image { header: Header::even(points, [0.0; 4], spacing), slices: Box::new(stack) })
}

impl Slices for Stack {
    fn next(&mut self) -> Result<Vec<f64>, String> {
        let wrong = |page: usize, e: ::tiff::TiffError| format!("is cut off, or damaged: page {page}: {e}");
        for _ in 0..self.ahead {
            self.page += 1;
            self.pages.next_image().map_err(|e| wrong(self.page, e))?;
        }
        self.ahead = self.channels;
        let values: Vec<f64> = match self.pages.read_image().map_err(|e| wrong(self.page, e))? {
            DecodingResult::U8(v) => v.into_iter().map(f64::from).collect(),
            DecodingResult::U16(v) => v.into_iter().map(f64::from).collect(),
            DecodingResult::U32(v) => v.into_iter().map(f64::from).collect(),
            DecodingResult::U64(v) => v.into_iter().map(|x| x as f64).collect(),
            DecodingResult::F16(v) => v.into_iter().map(|x| x.to_f64()).collect(),
            DecodingResult::F32(v) => v.into_iter().map(f64::from).collect(),
            DecodingResult::F64(v) => v,
            DecodingResult::I8(v) => v.into_iter().map(f64::from).collect(),
            DecodingResult::I16(v) => v.into_iter().map(f64::from).collect(),
            DecodingResult::I32(v) => v.into_iter().map(f64::from).collect(),
            DecodingResult::I64(v) => v.into_iter().map(|x| x as f64).collect(),
        };
        if values.len() != self.size {
            return Err(format!(
                "page {} has {} values, not {}: a page of another size, or in colour; save it as one grey channel",
                self.page,
                values.len(),
                self.size
            ));
        }
        Ok(values)
    }
}
