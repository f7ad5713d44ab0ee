//! NetCDF of the classic kinds (CDF-1, -2 and -5): one variable over some of x, y, z and time, in any order.
//!
//! What a dimension is follows from its coordinate variable, the one of its name: `axis`, `standard_name`, `units` and
//! `positive`, as CF and COARDS have them, or from its own name; where its points are, from that variable's values. Stored numbers
//! become values as the attributes say: `_Unsigned`, `_FillValue`, `missing_value`, `valid_*`, `scale_factor`, `add_offset`; a
//! number that the library fills unwritten places with is none.

use std::path::Path;

use super::axes::{Axis, Opened, Positions, Role};
use super::netcdf_header::{Header, Variable};
use super::numbers::{Bytes, Meaning, Numbers, Packing, Stream, stream};
use super::{Request, counted};
use crate::volume::{Kind, Values};

pub(super) fn open(path: &Path, length: u64, request: &Request) -> Result<Opened, String> {
    let header = Header::read(path)?;
    let variable = choose(&header, request.array.as_deref())?;
    let name = &variable.name;
    let kind = stored_kind(variable)?;
    let record = header.record_bytes().ok_or("declares records larger than can be")?;
    let records = match header.records {
        Some(records) => records,
        // Left open by a writer that didn't count: as many as the file has room for.
        None => {
            let begin = header.variables.iter().filter(|v| header.grows(v)).map(|v| v.begin).min().unwrap_or(length);
            length.saturating_sub(begin) / record.max(1)
        }
    };
    let size = |d: usize| match header.dimensions[d].size {
        0 => usize::try_from(records).unwrap_or(usize::MAX),
        size => usize::try_from(size).unwrap_or(usize::MAX),
    };
    let sizes: Vec<usize> = variable.dimensions.iter().rev().map(|&d| size(d)).collect();
    let needed = counted(&sizes, kind.size()).map_err(|e| format!("variable \"{name}\" {e}"))?;
    let whole = Whole { path, length, header: &header, records, record };
    whole.check(variable, needed)?;
    let meaning = meaning(variable, kind)?;
    let mut notes = Vec::new();
    let mut axes = Vec::new();
    for &dimension in variable.dimensions.iter().rev() {
        axes.push(axis(&whole, dimension, size(dimension), &mut notes)?);
    }
    let roles: Vec<Option<Role>> = axes.iter().map(|axis: &Axis| axis.role).collect();
    if roles.iter().all(Option::is_none) && request.axes.is_none() && roles.len() <= 4 {
        let names = axes.iter().rev().map(|axis| axis.name.as_str()).collect::<Vec<_>>().join(", ");
        notes.push(format!(
            "its dimensions ({names}) say nothing of what they are; they count as time, z, y, x in this order"
        ));
    }
    let values = Bytes::new(whole.stream(variable)?, kind, false, meaning);
    let format = match header.version {
        1 => "NetCDF (CDF-1)",
        2 => "NetCDF (CDF-2)",
        _ => "NetCDF (CDF-5)",
    };
    let mut opened = Opened::new(format, axes, kind.vtk_name().to_lowercase(), Box::new(values));
    opened.has_times =
        opened.axes.iter().any(|a| a.role == Some(Role::Time) && matches!(a.positions, Positions::Listed(_)));
    opened.unit = variable.text("units").map(str::to_owned);
    opened.notes = notes;
    Ok(opened)
}

/// The variable that is asked for, or the only one with three dimensions or more.
fn choose<'a>(header: &'a Header, name: Option<&str>) -> Result<&'a Variable, String> {
    let all = &header.variables;
    let large: Vec<&Variable> = all.iter().filter(|v| v.dimensions.len() >= 3 && v.kind.is_some()).collect();
    let known = || all.iter().map(|v| v.name.as_str()).collect::<Vec<_>>().join(", ");
    match (name, large.as_slice()) {
        (Some(name), _) => all
            .iter()
            .find(|v| v.name == name)
            .ok_or_else(|| format!("has no variable \"{name}\"; there are {}", known())),
        (None, &[one]) => Ok(one),
        _ => {
            Err(format!("has {} variables with three dimensions or more; give array, one of {}", large.len(), known()))
        }
    }
}

/// The type of a variable's numbers, with `_Unsigned` heeded.
fn stored_kind(variable: &Variable) -> Result<Kind, String> {
    let kind = variable.kind.ok_or_else(|| format!("variable \"{}\" is text, not numbers", variable.name))?;
    let told = variable.text("_Unsigned").map(str::to_lowercase);
    Ok(match (told.as_deref(), kind) {
        (Some("true"), Kind::I8) => Kind::U8,
        (Some("true"), Kind::I16) => Kind::U16,
        (Some("true"), Kind::I32) => Kind::U32,
        (Some("true"), Kind::I64) => Kind::U64,
        (Some("false"), Kind::U8) => Kind::I8,
        _ => kind,
    })
}

/// Numbers of an attribute as the variable's own are understood: -1 is 255 in unsigned bytes.
fn as_stored(numbers: &Values, kind: Kind) -> Vec<f64> {
    let modulus = match (numbers.kind(), kind) {
        (Kind::I8, Kind::U8) => 256.0,
        (Kind::I16, Kind::U16) => 65536.0,
        (Kind::I32, Kind::U32) => 4294967296.0,
        (Kind::I64, Kind::U64) => 18446744073709551616.0,
        _ => 0.0,
    };
    numbers.to_f64().into_iter().map(|x| if x < 0.0 { x + modulus } else { x }).collect()
}

fn meaning(variable: &Variable, kind: Kind) -> Result<Meaning, String> {
    let mut meaning =
        Meaning::linear(variable.number("scale_factor").unwrap_or(1.0), variable.number("add_offset").unwrap_or(0.0));
    if !meaning.scale.is_finite() || !meaning.shift.is_finite() {
        return Err(format!("variable \"{}\" has a scale_factor or add_offset that is not finite", variable.name));
    }
    for name in ["_FillValue", "missing_value"] {
        meaning.missing.extend(variable.numbers(name).map(|numbers| as_stored(numbers, kind)).unwrap_or_default());
    }
    // What the library fills with if nobody says otherwise; single bytes have no number to spare for that.
    let fill = match kind {
        Kind::I16 => Some(-32767.0),
        Kind::U16 => Some(65535.0),
        Kind::I32 => Some(-2147483647.0),
        Kind::U32 => Some(4294967295.0),
        Kind::I64 => Some(-9223372036854775806i64 as f64),
        Kind::U64 => Some(18446744073709551614u64 as f64),
        Kind::F32 => Some(f64::from(9.969_21e36_f32)),
        Kind::F64 => Some(f64::from(9.969_21e36_f32)),
        Kind::I8 | Kind::U8 => None,
    };
    if variable.numbers("_FillValue").is_none() {
        // An unsigned variable that was stored as a signed one was filled as such.
        let fill = match (variable.kind, kind) {
            (Some(Kind::I16), Kind::U16) => Some(32769.0),
            (Some(Kind::I32), Kind::U32) => Some(2147483649.0),
            _ => fill,
        };
        meaning.missing.extend(fill);
    }
    let mut limit = |name: &str, at: usize, low: bool| {
        let Some(numbers) = variable.numbers(name).filter(|numbers| numbers.len() > at) else { return };
        // Limits of another type than what is stored are those of the values, after scale and shift.
        let packed = variable.number("scale_factor").is_some() || variable.number("add_offset").is_some();
        let stored = Some(numbers.kind()) == variable.kind || numbers.kind() == kind || !packed;
        let range = if stored { &mut meaning.valid } else { &mut meaning.valid_scaled };
        let bound = as_stored(numbers, kind)[at];
        if low { range.0 = range.0.max(bound) } else { range.1 = range.1.min(bound) }
    };
    limit("valid_min", 0, true);
    limit("valid_max", 0, false);
    limit("valid_range", 0, true);
    limit("valid_range", 1, false);
    Ok(meaning)
}

/// What a dimension is, and where its points are.
fn axis(file: &Whole, dimension: usize, size: usize, notes: &mut Vec<String>) -> Result<Axis, String> {
    let name = &file.header.dimensions[dimension].name;
    let own = file.header.variables.iter().find(|v| v.name == *name && v.dimensions == [dimension]);
    let mut axis = Axis::new(name, own.and_then(role).or_else(|| Role::of_name(name)), size);
    let Some(variable) = own.filter(|v| v.kind.is_some()) else { return Ok(axis) };
    axis.unit = variable.text("units").map(str::to_owned);
    let kind = stored_kind(variable)?;
    file.check(variable, counted(&[size], kind.size())?)?;
    let mut places = vec![0.0; size];
    let meaning = Meaning { missing: Vec::new(), ..meaning(variable, kind)? };
    Bytes::new(file.stream(variable)?, kind, false, meaning).read(&mut places)?;
    axis.positions = Positions::Listed(places);
    if !axis.positions.is_monotonic() {
        if axis.role == Some(Role::Channel) || axis.role.is_none() {
            axis.positions = Positions::INDICES;
        } else if size > 1 {
            return Err(format!(
                "its dimension \"{name}\" goes back and forth, or holds no numbers; drop its coordinates: ncks -C -x -v {name}"
            ));
        } else {
            notes.push(format!("its dimension \"{name}\" has one point, at no number; it counts as at 0"));
            axis.positions = Positions::INDICES;
        }
    }
    Ok(axis)
}

/// What a coordinate is, by its attributes.
fn role(variable: &Variable) -> Option<Role> {
    let text = |name: &str| variable.text(name).map(str::to_lowercase);
    match text("axis").as_deref() {
        Some("x") => return Some(Role::X),
        Some("y") => return Some(Role::Y),
        Some("z") => return Some(Role::Z),
        Some("t") => return Some(Role::Time),
        _ => {}
    }
    if let Some(role) = text("standard_name").as_deref().and_then(Role::of_name) {
        return Some(role);
    }
    if text("positive").is_some_and(|way| way == "up" || way == "down") {
        return Some(Role::Z);
    }
    let units = text("units").unwrap_or_default();
    let degrees = |way: &str| {
        ["degrees_", "degree_", "degrees", "degree", "deg_"].iter().any(|start| units.strip_prefix(start) == Some(way))
    };
    match units.as_str() {
        _ if degrees("east") || degrees("e") => Some(Role::X),
        _ if degrees("north") || degrees("n") => Some(Role::Y),
        _ if units.contains(" since ") => Some(Role::Time),
        "level" | "layer" | "sigma_level" | "pa" | "hpa" | "mbar" | "mb" | "millibar" | "millibars" | "bar" | "atm"
        | "dbar" | "decibar" => Some(Role::Z),
        _ => None,
    }
}

/// A file, and what its variables share.
struct Whole<'a> {
    path: &'a Path,
    length: u64,
    header: &'a Header,
    records: u64,
    record: u64,
}

impl Whole<'_> {
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
        let file = stream(self.path, variable.begin, Packing::None)?;
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
