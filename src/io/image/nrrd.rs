//! NRRD: lines of `key: value`, an empty line, then the values, raw or gzip-compressed; or in a file that the header names.
//!
//! The axes must be x, y, z and time in this order, as many as there are, without one for colours. Spacings come from
//! `spacings` or from the lengths of `space directions`.

use std::path::{Path, PathBuf};

use super::bytes::{Bytes, stream};
use super::{Header, Image, Request, counted, holds};
use crate::volume::Kind;

/// The longest header that is believed to be one.
const LONGEST: usize = 1 << 20;

pub(super) fn open(path: &Path, _: u64, _: &Request) -> Result<Image, String> {
    use std::io::Read;
    let mut start = Vec::new();
    stream(path, 0, false)?.take(LONGEST as u64).read_to_end(&mut start).map_err(|e| e.to_string())?;
    if !start.starts_with(b"NRRD") {
        return Err("is no NRRD file: it does not begin with \"NRRD\"".into());
    }
    let (text, after) = header(&start);
    let text = String::from_utf8_lossy(text).replace('\r', "");
    let field = |name: &str| {
        let mut lines = text.lines().filter(|line| !line.starts_with('#'));
        lines.find_map(|line| line.split_once(':').filter(|(key, _)| key.trim() == name).map(|(_, value)| value.trim()))
    };
    let needed_field = |name: &str| field(name).ok_or_else(|| format!("has no field \"{name}\" in its header"));

    let sizes = needed_field("sizes")?;
    let sizes: Vec<usize> = sizes
        .split_whitespace()
        .map(|word| word.parse().map_err(|_| format!("has the sizes \"{sizes}\", which are no whole numbers")))
        .collect::<Result<_, _>>()?;
    if !(1..=4).contains(&sizes.len()) {
        return Err(format!("has {} axes; one to four are understood", sizes.len()));
    }
    let points = std::array::from_fn(|axis| sizes.get(axis).copied().unwrap_or(1));
    let kind = kind(needed_field("type")?)?;
    let compressed = match needed_field("encoding")? {
        "raw" => false,
        "gzip" | "gz" => true,
        other => return Err(format!("is encoded as {other}; raw and gzip are understood")),
    };
    let little_endian = match field("endian") {
        Some("little") => true,
        Some("big") => false,
        None if kind.size() == 1 => true,
        other => return Err(format!("has endian {other:?}; it must be little or big")),
    };
    if field("byte skip").or(field("line skip")).is_some_and(|skip| skip != "0") {
        return Err("skips bytes or lines, which is not understood".into());
    }
    let (values, offset): (PathBuf, u64) = match field("data file").or(field("datafile")) {
        Some(name) if name.contains('%') || name == "LIST" => {
            return Err("is spread over several files, which is not understood".into());
        }
        Some(name) => (path.parent().unwrap_or(Path::new("")).join(name), 0),
        None => (path.to_owned(), after.ok_or("is cut off: its header has no end")? as u64),
    };
    let needed = counted(points, kind.size())?;
    let length = crate::input::length(&values).map_err(|e| format!("names {}: {e}", values.display()))?;
    holds(needed, offset, length, compressed)?;
    let spacing = spacing(field("spacings"), field("space directions"));
    let slices = Bytes {
        reader: stream(&values, offset, compressed)?,
        kind,
        little_endian,
        size: points[0] * points[1],
        scale: 1.0,
        shift: 0.0,
        read: 0,
    };
    Ok(Image { header: Header::even(points, [0.0; 4], spacing), slices: Box::new(slices) })
}

/// The header, and where the values begin if it has an end.
fn header(start: &[u8]) -> (&[u8], Option<usize>) {
    for (i, &byte) in start.iter().enumerate() {
        if byte == b'\n' {
            let rest = &start[i + 1..];
            let blank = if rest.starts_with(b"\n") { 1 } else { 2 };
            if rest.starts_with(b"\n") || rest.starts_with(b"\r\n") {
                return (&start[..i + 1], Some(i + 1 + blank));
            }
        }
    }
    (start, None)
}

fn kind(name: &str) -> Result<Kind, String> {
    Ok(match name {
        "signed char" | "int8" | "int8_t" => Kind::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => Kind::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => Kind::I16,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Kind::U16,
        "int" | "signed int" | "int32" | "int32_t" => Kind::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => Kind::U32,
        "longlong" | "long long" | "long long int" | "int64" | "int64_t" => Kind::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => Kind::U64,
        "float" => Kind::F32,
        "double" => Kind::F64,
        other => return Err(format!("holds numbers of type \"{other}\", which is not understood")),
    })
}

/// The distance between points along each axis; 0 where it is not told.
fn spacing(spacings: Option<&str>, directions: Option<&str>) -> [f64; 4] {
    let mut found = [0.0; 4];
    if let Some(directions) = directions {
        // Vectors as (1,0,0), or none for an axis that is not in space.
        for (slot, vector) in found.iter_mut().zip(directions.split_whitespace()) {
            let numbers = vector.trim_matches(['(', ')']).split(',').map(|x| x.trim().parse().unwrap_or(0.0));
            *slot = numbers.map(|x: f64| x * x).sum::<f64>().sqrt();
        }
    } else if let Some(spacings) = spacings {
        for (slot, word) in found.iter_mut().zip(spacings.split_whitespace()) {
            *slot = word.parse().unwrap_or(0.0);
        }
    }
    found
}
