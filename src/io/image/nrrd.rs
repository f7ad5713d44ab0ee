//! NRRD: lines of `field: value`, an empty line, then the values, raw, gzip-compressed or as text; or in files that the
//! header names.
//!
//! What an axis is follows from `kinds`, `labels` and `space directions`; places from `space directions` and `space origin`,
//! or from `spacings` and `axis mins`. A value axis (vector, colour, list) is taken apart by `channel`.

use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use super::axes::{Axis, Opened, Positions, Role};
use super::numbers::{Bytes, Meaning, Numbers, Packing, Stream, Words, stream};
use super::units::metres;
use super::{Request, counted, fits, holds};
use crate::volume::Kind;

/// The longest header that is believed to be one.
const LONGEST: usize = 1 << 20;

/// The most files that one header may name.
const MOST_FILES: u64 = 100_000;

/// A header: its fields in lower case without spaces, and where the values begin if they follow it.
struct Fields {
    fields: Vec<(String, Vec<u8>)>,
    /// The lines after `data file: LIST`.
    listed: Vec<Vec<u8>>,
    after: Option<u64>,
}

impl Fields {
    fn read(path: &Path) -> Result<Self, String> {
        let mut start = Vec::new();
        stream(path, 0, Packing::None)?.take(LONGEST as u64).read_to_end(&mut start).map_err(|e| e.to_string())?;
        if !start.starts_with(b"NRRD") {
            return Err("is no NRRD file: it does not begin with \"NRRD\"".into());
        }
        let mut found = Self { fields: Vec::new(), listed: Vec::new(), after: None };
        let (mut at, mut listing) = (0, false);
        for line in start.split_inclusive(|&byte| byte == b'\n').map(<[u8]>::to_vec) {
            at += line.len();
            let line = line.trim_ascii();
            if line.is_empty() {
                found.after = Some(at as u64);
                break;
            }
            if listing {
                found.listed.push(line.to_vec());
            } else if let Some(colon) = line.iter().position(|&byte| byte == b':').filter(|_| line[0] != b'#') {
                let (name, value) = (String::from_utf8_lossy(&line[..colon]), &line[colon + 1..]);
                // `key:=value` is for whoever wrote the file.
                if value.first() != Some(&b'=') {
                    let name = name.to_lowercase().replace([' ', '\t'], "");
                    let value = value.trim_ascii().to_vec();
                    listing = name == "datafile" && value.starts_with(b"LIST");
                    found.fields.push((name, value));
                }
            }
        }
        Ok(found)
    }

    fn bytes(&self, name: &str) -> Option<&[u8]> {
        self.fields.iter().find(|(field, _)| field == name).map(|(_, value)| value.as_slice())
    }

    fn text(&self, name: &str) -> Option<String> {
        self.bytes(name).map(|value| String::from_utf8_lossy(value).into_owned())
    }

    fn needed(&self, name: &str) -> Result<String, String> {
        self.text(name).ok_or_else(|| format!("has no field \"{name}\" in its header"))
    }

    /// Numbers, one an axis; empty if there is no such field.
    fn numbers(&self, name: &str) -> Result<Vec<f64>, String> {
        let Some(text) = self.text(name) else { return Ok(Vec::new()) };
        let number = |word: &str| word.parse().map_err(|_| format!("has the {name} \"{text}\", which are no numbers"));
        text.split_whitespace().map(number).collect()
    }

    fn whole(&self, name: &str) -> Result<i64, String> {
        let Some(text) = self.text(name) else { return Ok(0) };
        text.parse().map_err(|_| format!("has the {name} \"{text}\", which is no whole number"))
    }

    /// The files with the values; the header's own if it names none.
    fn files(&self, path: &Path) -> Result<Vec<PathBuf>, String> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let Some(value) = self.bytes("datafile") else { return Ok(vec![path.to_owned()]) };
        if value.starts_with(b"LIST") {
            return Ok(self.listed.iter().map(|name| folder.join(path_of(name))).collect());
        }
        let text = String::from_utf8_lossy(value).into_owned();
        let words: Vec<&str> = text.split_whitespace().collect();
        // `name%03d.raw 1 10 1`: numbered files, from, to, step.
        let (Some(pattern), [_, from, to, step, ..]) = (words.first().filter(|w| w.contains('%')), words.as_slice())
        else {
            return Ok(vec![folder.join(path_of(value))]);
        };
        let wrong = || format!("has the data file \"{text}\", which is not understood; name the files below LIST");
        let number = |word: &str| word.parse::<i64>().map_err(|_| wrong());
        let (from, to, step) = (number(from)?, number(to)?, number(step)?);
        let (before, rest) = pattern.split_once('%').ok_or_else(wrong)?;
        let (width, after) = rest.split_once('d').ok_or_else(wrong)?;
        let count = if step == 0 { 0 } else { (i128::from(to) - i128::from(from)) / i128::from(step) + 1 };
        if count < 1 || count > i128::from(MOST_FILES) || !width.chars().all(|c| c.is_ascii_digit()) || width.len() > 2
        {
            return Err(wrong());
        }
        let digits: usize = width.trim_start_matches('0').parse().unwrap_or(0);
        let numbered = |i: i128| {
            let number = i128::from(from) + i * i128::from(step);
            let number =
                if width.starts_with('0') { format!("{number:0digits$}") } else { format!("{number:digits$}") };
            folder.join(format!("{before}{number}{after}"))
        };
        Ok((0..count).map(numbered).collect())
    }
}

/// A name of a file as it is, in UTF-8 or not.
#[cfg(unix)]
fn path_of(bytes: &[u8]) -> PathBuf {
    use std::os::unix::ffi::OsStrExt;
    std::ffi::OsStr::from_bytes(bytes).into()
}

#[cfg(not(unix))]
fn path_of(bytes: &[u8]) -> PathBuf {
    String::from_utf8_lossy(bytes).into_owned().into()
}

/// The files besides the header that values are read from.
pub(super) fn data_files(path: &Path) -> Vec<PathBuf> {
    let files = Fields::read(path).and_then(|fields| fields.files(path)).unwrap_or_default();
    files.into_iter().filter(|file| file != path).collect()
}

pub(super) fn open(path: &Path, _: u64, _: &Request) -> Result<Opened, String> {
    let fields = Fields::read(path)?;
    let sizes = fields.needed("sizes")?;
    let sizes: Vec<usize> = sizes
        .split_whitespace()
        .map(|word| word.parse().map_err(|_| format!("has the sizes \"{sizes}\", which are no whole numbers")))
        .collect::<Result<_, _>>()?;
    if sizes.is_empty() || sizes.len() > 16 {
        return Err(format!("has {} axes, which can't be", sizes.len()));
    }
    let dimension = fields.whole("dimension")?;
    if fields.bytes("dimension").is_some() && dimension != sizes.len() as i64 {
        return Err(format!("has the dimension {dimension}, and {} sizes", sizes.len()));
    }
    let kind = kind(&fields.needed("type")?.to_lowercase())?;
    let mut notes = Vec::new();
    if fields.bytes("oldmin").is_some() || fields.bytes("oldmax").is_some() {
        notes.push("its values were quantized (old min, old max); they are read as they are stored".to_owned());
    }
    let (axes, origin) = axes(&fields, &sizes, &mut notes)?;
    let space = fields.text("space").and_then(|space| letters(&space));
    let values = values(&fields, path, &sizes, kind, &mut notes)?;
    let mut opened = Opened::new("NRRD", axes, kind.vtk_name().to_lowercase(), values);
    (opened.origin, opened.space, opened.notes) = (origin, space, notes);
    opened.unit = fields.text("sampleunits").map(|unit| unit.trim_matches('"').to_owned());
    Ok(opened)
}

/// The stream of values.
fn values(
    fields: &Fields,
    path: &Path,
    sizes: &[usize],
    kind: Kind,
    notes: &mut Vec<String>,
) -> Result<Box<dyn Numbers>, String> {
    let encoding = fields.needed("encoding")?.to_lowercase();
    let packing = match encoding.as_str() {
        "raw" | "txt" | "text" | "ascii" => Packing::None,
        "gzip" | "gz" => Packing::Gzip,
        other => {
            return Err(format!(
                "unsupported: the encoding {other}; convert it: unu save -f nrrd -e gzip -i IN -o OUT"
            ));
        }
    };
    let text = packing == Packing::None && encoding != "raw";
    let little_endian = match fields.text("endian").map(|order| order.to_lowercase()).as_deref() {
        Some("little") => true,
        Some("big") => false,
        _ if kind.size() == 1 || text => true,
        other => return Err(format!("has endian {other:?}; it must be little or big")),
    };
    let files = fields.files(path)?;
    let (lines, bytes) = (fields.whole("lineskip")?, fields.whole("byteskip")?);
    if lines < 0 || bytes < -1 || (bytes == -1 && packing != Packing::None) {
        return Err(format!("skips {lines} lines and {bytes} bytes, which can't be"));
    }
    let needed = counted(sizes, kind.size())?;
    if files.is_empty() || needed % files.len() as u64 != 0 {
        return Err(format!("spreads {needed} bytes over {} files, which can't be", files.len()));
    }
    let each = needed / files.len() as u64;
    let mut parts = Vec::new();
    for file in &files {
        let own = file == path;
        let start = if own { fields.after.ok_or("is cut off: its header has no end")? } else { 0 };
        let named = |message: String| if own { message } else { format!("its data file {} {message}", file.display()) };
        let length = crate::input::length(file).map_err(|e| named(format!("can't be read: {e}")))?;
        let start = start + skipped(file, start, lines as u64).map_err(named)?;
        let start = match (bytes, packing) {
            (-1, _) => length.checked_sub(each).filter(|&at| at >= start).unwrap_or(start),
            (bytes, Packing::None) => start.saturating_add(bytes as u64),
            _ => start,
        };
        if text {
            // A digit and a separator a value.
            holds(2 * counted(sizes, 1)? / files.len() as u64 - 1, start, length, Packing::None).map_err(named)?;
        } else {
            holds(each, start, length, packing).map_err(named)?;
        }
        if !text && packing == Packing::None {
            fits(each, start, length, !own, notes).map_err(named)?;
        }
        parts.push((file.clone(), start));
    }
    if text {
        let [(file, start)] = parts.as_slice() else {
            return Err("unsupported: text in several files; convert it: unu save -f nrrd -e raw -i IN -o OUT".into());
        };
        return Ok(Box::new(Words::new(BufReader::new(stream(file, *start, packing)?))));
    }
    let inner = if packing == Packing::Gzip { bytes as u64 } else { 0 };
    let whole = packing == Packing::Gzip && files.iter().all(|file| file != path);
    let parts = Parts { parts: parts.into_iter(), packing, inner, each, whole, current: None };
    Ok(Box::new(Bytes::new(Box::new(parts), kind, little_endian, Meaning::default())))
}

/// How many bytes so many lines take.
fn skipped(path: &Path, start: u64, lines: u64) -> Result<u64, String> {
    if lines == 0 {
        return Ok(0);
    }
    let mut left = lines;
    for (i, byte) in BufReader::new(stream(path, start, Packing::None)?).bytes().enumerate() {
        left -= u64::from(byte.map_err(|e| e.to_string())? == b'\n');
        if left == 0 {
            return Ok(i as u64 + 1);
        }
    }
    Err(format!("is cut off: {lines} lines are to be skipped, and {} are there", lines - left))
}

/// The bytes of several files, one after the other.
struct Parts {
    parts: std::vec::IntoIter<(PathBuf, u64)>,
    packing: Packing,
    /// Bytes to pass over after unpacking.
    inner: u64,
    /// Bytes of each.
    each: u64,
    /// Whether nothing may follow them.
    whole: bool,
    current: Option<(Box<dyn Stream>, u64)>,
}

impl Parts {
    /// The current file, and the bytes that are left of it.
    fn current(&mut self) -> std::io::Result<Option<&mut (Box<dyn Stream>, u64)>> {
        if self.current.as_ref().is_none_or(|(_, left)| *left == 0) {
            let Some((path, start)) = self.parts.next() else { return Ok(None) };
            let mut file = stream(&path, start, self.packing).map_err(std::io::Error::other)?;
            file.pass(self.inner)?;
            self.current = Some((file, self.each));
        }
        Ok(self.current.as_mut())
    }
}

impl Read for Parts {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        let whole = self.whole;
        let Some((file, left)) = self.current()? else { return Ok(0) };
        let most = bytes.len().min(usize::try_from(*left).unwrap_or(usize::MAX));
        let count = file.read(&mut bytes[..most])?;
        *left -= count as u64;
        if whole && *left == 0 && count > 0 && file.read(&mut [0])? > 0 {
            return Err(std::io::Error::other(
                "a data file holds more values than the sizes and type make: they don't fit",
            ));
        }
        Ok(count)
    }
}

impl Stream for Parts {
    fn pass(&mut self, count: u64) -> std::io::Result<()> {
        let mut count = count;
        while count > 0 {
            let Some((file, left)) = self.current()? else { return Err(std::io::ErrorKind::UnexpectedEof.into()) };
            let now = count.min(*left);
            file.pass(now)?;
            *left -= now;
            count -= now;
        }
        Ok(())
    }
}

/// Kinds whose values stand beside each other at one place.
fn is_of_space(kind: &str) -> bool {
    matches!(kind, "domain" | "space")
}

/// The axes, and where the first point lies.
fn axes(fields: &Fields, sizes: &[usize], notes: &mut Vec<String>) -> Result<(Vec<Axis>, [f64; 4]), String> {
    let words = |name: &str| -> Vec<String> {
        fields.text(name).unwrap_or_default().split_whitespace().map(str::to_lowercase).collect()
    };
    let (kinds, centres) = (words("kinds"), [words("centerings"), words("centers")].concat());
    let (labels, units) = (quoted(fields.text("labels")), quoted(fields.text("units")));
    let mut space_units = quoted(fields.text("spaceunits"));
    let mut directions = vectors(&fields.text("spacedirections").unwrap_or_default())?;
    let spacings = fields.numbers("spacings")?;
    let (mins, maxs) = (fields.numbers("axismins")?, fields.numbers("axismaxs")?);
    for (name, count) in [
        ("kinds", kinds.len()),
        ("centerings", centres.len()),
        ("space directions", directions.len()),
        ("spacings", spacings.len()),
        ("axis mins", mins.len()),
        ("axis maxs", maxs.len()),
    ] {
        if count != 0 && count != sizes.len() {
            return Err(format!("has {count} {name} for {} axes", sizes.len()));
        }
    }
    // Each axis of the world has a unit of its own; all are brought to the first's.
    let mut measures = [1.0; 4];
    let lengths: Vec<Option<f64>> = space_units.iter().map(|unit| metres(unit)).collect();
    if let Some(Some(wanted)) = lengths.first()
        && lengths.iter().flatten().any(|length| length != wanted)
    {
        notes.push(format!("its space units, {}, are brought to {}", space_units.join(", "), space_units[0]));
        for (k, length) in lengths.iter().enumerate().take(4) {
            if let Some(length) = length {
                measures[k] = length / wanted;
                space_units[k] = space_units[0].clone();
            }
        }
    }
    directions.iter_mut().flatten().for_each(|vector| (0..4).for_each(|k| vector[k] *= measures[k]));
    let mut axes = Vec::new();
    for (i, &size) in sizes.iter().enumerate() {
        let kind = kinds.get(i).map_or("", String::as_str).trim_matches('?');
        let kind = if kind == "none" { "" } else { kind };
        let label = labels.get(i).map_or("", String::as_str);
        let vector = directions.get(i).and_then(Option::as_ref);
        // A label of one letter may be anatomic: S is superior.
        let named = Role::of_name(label).filter(|&role| role != Role::Channel || label.len() > 1);
        let role = match (kind, named) {
            ("time", _) => Some(Role::Time),
            ("" | "domain" | "space", named) => named.filter(|&role| role != Role::Channel || kind.is_empty()),
            ("list", Some(Role::Time)) => Some(Role::Time),
            _ => Some(Role::Channel),
        };
        let name = [label, kind].into_iter().find(|word| !word.is_empty());
        let mut axis = Axis::new(name.map_or_else(|| format!("axis {i}"), str::to_owned), role, size);
        let told = |list: &[f64]| list.get(i).copied().filter(|x| x.is_finite());
        if let Some(vector) = vector {
            let length = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
            if !(length.is_finite() && length > 0.0) {
                return Err(format!("has a space direction of length {length} along \"{}\"", axis.name));
            }
            axis = axis.spaced(length);
            axis.direction = Some(vector.map(|x| x / length));
            axis.unit = space_units.get(vector.iter().position(|x| *x != 0.0).unwrap_or(0)).cloned();
        } else {
            let cells = centres.get(i).is_some_and(|centre| centre == "cell");
            let between =
                |low: f64, high: f64| (high - low) / (if cells { size as f64 } else { (size as f64 - 1.0).max(1.0) });
            let step = told(&spacings).or_else(|| Some(between(told(&mins)?, told(&maxs)?))).unwrap_or(0.0);
            let start = told(&mins).unwrap_or(0.0) + if cells && told(&mins).is_some() { step / 2.0 } else { 0.0 };
            axis.positions = Positions::even(start, step);
            axis.unit = units.get(i).cloned();
        }
        axis.unit = axis.unit.filter(|unit| !unit.is_empty());
        axes.push(axis);
    }
    if !(kinds.is_empty() && directions.is_empty() && axes.iter().all(|axis| axis.role.is_none())) {
        // Axes of space are x, y and z in their order, and a fourth is time.
        let of_space = |i: usize| {
            kinds.get(i).is_some_and(|kind| is_of_space(kind)) || directions.get(i).is_some_and(Option::is_some)
        };
        for i in (0..axes.len()).filter(|&i| of_space(i)) {
            let free = Role::GRID.into_iter().find(|&role| axes.iter().all(|axis| axis.role != Some(role)));
            if axes[i].role.is_none() {
                axes[i].role = free;
            }
        }
        let last = axes.len() - 1;
        if axes[last].role.is_none() && axes.iter().all(|axis| axis.role != Some(Role::Time)) && sizes[last] > 1 {
            notes.push(format!("its last axis, \"{}\", is taken as time; axes says otherwise", axes[last].name));
            axes[last].role = Some(Role::Time);
        }
    }
    let mut origin = [0.0; 4];
    if let Some(Some(vector)) = vectors(&fields.text("spaceorigin").unwrap_or_default())?.first() {
        // A file may leave the origin open.
        if vector.iter().all(|x| x.is_finite()) {
            origin = std::array::from_fn(|k| vector[k] * measures[k]);
        }
    }
    Ok((axes, origin))
}

/// Strings in quotation marks; or words, where there are none.
fn quoted(text: Option<String>) -> Vec<String> {
    let text = text.unwrap_or_default();
    if text.contains('"') {
        return text.split('"').skip(1).step_by(2).map(str::to_owned).collect();
    }
    text.split_whitespace().map(str::to_owned).collect()
}

/// Vectors as `(1, 0, 0)`, or `none`.
fn vectors(text: &str) -> Result<Vec<Option<[f64; 4]>>, String> {
    let mut found = Vec::new();
    let mut rest = text.trim_start();
    while !rest.is_empty() {
        if let Some(after) = rest.strip_prefix('(') {
            let (inner, after) = after.split_once(')').ok_or_else(|| format!("has the vectors \"{text}\", cut off"))?;
            let numbers: Vec<f64> = inner
                .split(',')
                .map(|x| x.trim().parse().map_err(|_| format!("has the vectors \"{text}\", which are no numbers")))
                .collect::<Result<_, _>>()?;
            if numbers.len() > 4 {
                return Err(format!("has vectors of {} numbers; four at most are understood", numbers.len()));
            }
            found.push(Some(std::array::from_fn(|k| numbers.get(k).copied().unwrap_or(0.0))));
            rest = after.trim_start();
        } else {
            let end = rest.find(char::is_whitespace).unwrap_or(rest.len());
            if rest[..end].to_lowercase() != "none" {
                return Err(format!("has the vectors \"{text}\", which are not understood"));
            }
            found.push(None);
            rest = rest[end..].trim_start();
        }
    }
    Ok(found)
}

/// Which way the axes of a named space point.
fn letters(space: &str) -> Option<String> {
    let space = space.to_lowercase().replace("-time", "");
    Some(match space.as_str() {
        "right-anterior-superior" | "ras" | "rast" => "RAS".into(),
        "left-anterior-superior" | "las" | "last" => "LAS".into(),
        "left-posterior-superior" | "lps" | "lpst" => "LPS".into(),
        _ => return None,
    })
}

fn kind(name: &str) -> Result<Kind, String> {
    Ok(match name {
        "signed char" | "int8" | "int8_t" => Kind::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => Kind::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => Kind::I16,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Kind::U16,
        "int" | "signed int" | "int32" | "int32_t" => Kind::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => Kind::U32,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => Kind::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => Kind::U64,
        "float" => Kind::F32,
        "double" => Kind::F64,
        other => {
            return Err(format!(
                "unsupported: numbers of type \"{other}\"; convert it: unu convert -t float -i IN -o OUT"
            ));
        }
    })
}
