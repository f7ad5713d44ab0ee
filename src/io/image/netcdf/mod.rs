//! NetCDF of the classic kinds (CDF-1, -2 and -5) and NetCDF-4: one variable over some of x, y, z and time, in any order.
//!
//! `classic` and `hdf5` know where numbers are kept; what they mean is the same in both, and known here.
//!
//! What a dimension is follows from its coordinate variable, the one of its name: `axis`, `standard_name`, `units` and
//! `positive`, as CF and COARDS have them, or from its own name; where its points are, from that variable's values. Stored numbers
//! become values as the attributes say: `_Unsigned`, `_FillValue`, `missing_value`, `valid_*`, `scale_factor`, `add_offset`; a
//! number that the library fills unwritten places with is none.

mod classic;
mod hdf5;
mod header;

use std::path::Path;

use super::axes::{Axis, Opened, Positions, Role};
use super::numbers::{Meaning, Numbers};
use super::{Request, counted};
use crate::volume::{Kind, Values};

use self::header::{Header, Variable};

/// A file of one of the kinds.
trait Container {
    /// What kind.
    fn format(&self) -> &'static str;

    /// Its lists.
    fn header(&self) -> &Header;

    /// The points along a dimension, by its number.
    fn size(&self, dimension: usize) -> usize;

    /// The values of a variable whose numbers are of this type; refused where the file can't hold them.
    fn numbers(&self, variable: &Variable, kind: Kind, meaning: Meaning) -> Result<Box<dyn Numbers>, String>;
}

pub(super) fn open(path: &Path, length: u64, request: &Request) -> Result<Opened, String> {
    let file: Box<dyn Container> = match hdf5::begins(path) {
        true => Box::new(hdf5::Hdf5::open(path, length)?),
        false => Box::new(classic::Classic::open(path, length)?),
    };
    let header = file.header();
    let variable = choose(header, request.array.as_deref())?;
    let kind = stored_kind(variable)?;
    let sizes: Vec<usize> = variable.dimensions.iter().rev().map(|&d| file.size(d)).collect();
    counted(&sizes, kind.size()).map_err(|e| format!("variable \"{}\" {e}", variable.name))?;
    let mut notes = Vec::new();
    let values = file.numbers(variable, kind, meaning(variable, kind)?)?;
    let mut axes = Vec::new();
    for &dimension in variable.dimensions.iter().rev() {
        axes.push(axis(&*file, dimension, &mut notes)?);
    }
    let roles: Vec<Option<Role>> = axes.iter().map(|axis: &Axis| axis.role).collect();
    if roles.iter().all(Option::is_none) && request.axes.is_none() && roles.len() <= 4 {
        let names = axes.iter().rev().map(|axis| axis.name.as_str()).collect::<Vec<_>>().join(", ");
        notes.push(format!(
            "its dimensions ({names}) say nothing of what they are; they count as time, z, y, x in this order"
        ));
    }
    let mut opened = Opened::new(file.format(), axes, kind.vtk_name().to_lowercase(), values);
    opened.has_times =
        opened.axes.iter().any(|a| a.role == Some(Role::Time) && matches!(a.positions, Positions::Listed(_)));
    opened.unit = variable.text("units").map(str::to_owned);
    for name in ["scale_factor", "add_offset", "_FillValue", "missing_value", "valid_min", "valid_max", "valid_range"] {
        if let Some(text) = variable.text(name) {
            notes.push(format!("its attribute {name} is the text \"{text}\", not a number, and is not heeded"));
        }
    }
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
    let kind = variable
        .kind
        .ok_or_else(|| format!("variable \"{}\" is text, or of a type of its own, not numbers", variable.name))?;
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
fn axis(file: &dyn Container, dimension: usize, notes: &mut Vec<String>) -> Result<Axis, String> {
    let (header, size) = (file.header(), file.size(dimension));
    let path = &header.dimensions[dimension].name;
    let own = header.variables.iter().find(|v| v.name == *path && v.dimensions == [dimension]);
    // Of a dimension in a group its own name counts.
    let name = path.rsplit('/').next().unwrap_or_default();
    let mut axis = Axis::new(name, own.and_then(role).or_else(|| Role::of_name(name)), size);
    let Some(variable) = own.filter(|v| v.kind.is_some()) else { return Ok(axis) };
    axis.unit = variable.text("units").map(str::to_owned);
    let kind = stored_kind(variable)?;
    counted(&[size], kind.size())?;
    let meaning = Meaning { missing: Vec::new(), ..meaning(variable, kind)? };
    let mut values = file.numbers(variable, kind, meaning)?;
    let mut places = vec![0.0; size];
    values.read(&mut places)?;
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
