//! NetCDF-3, through the `netcdf3` crate: one variable over (time, z, y, x), or over the last two or three of these.
//!
//! Where a dimension has a variable of its name, that says where the points are, evenly or not. Values that are the
//! variable's `_FillValue` or `missing_value` count as no number; `scale_factor` and `add_offset` are applied.

use std::path::Path;

use netcdf3::{DataVector, FileReader, Variable};

use super::{Header, Held, Image, Request, counted, netcdf_header, room_for};

pub(super) fn open(path: &Path, length: u64, request: &Request) -> Result<Image, String> {
    let mut magic = [0; 4];
    let read = crate::input::open(path).and_then(|mut file| std::io::Read::read_exact(&mut file, &mut magic));
    if read.is_err() || !matches!(&magic, b"CDF\x01" | b"CDF\x02") {
        let what =
            if magic[1..] == *b"HDF" { "a NetCDF-4 file; convert it: nccopy -k 64-bit-offset" } else { "foreign" };
        return Err(format!("is no NetCDF-3 file but {what}"));
    }
    netcdf_header::check(path)?;
    let mut file = FileReader::open(path).map_err(|e| format!("is cut off, or damaged: {}", brief(&e)))?;
    let variable = choose(&file, request.array.as_deref())?;
    let name = variable.name().to_owned();
    let dimensions: Vec<(String, usize)> = variable.get_dims().iter().map(|d| (d.name(), d.size())).collect();
    if !(2..=4).contains(&dimensions.len()) {
        return Err(format!("variable \"{name}\" has {} dimensions; two to four are understood", dimensions.len()));
    }
    // The last one runs fastest.
    let points = std::array::from_fn(|axis| dimensions.iter().rev().nth(axis).map_or(1, |(_, size)| *size));
    if counted(points, 1)? > length {
        return Err(format!("is cut off: variable \"{name}\" has {points:?} points, the file {length} bytes"));
    }
    room_for(counted(points, 2 * size_of::<f64>())?)?;
    let attribute = |key: &str| {
        variable.get_attr(key).and_then(|attribute| {
            let numbers = attribute.get_f64().map(|v| v.to_vec());
            let numbers = numbers.or_else(|| attribute.get_f32().map(|v| v.iter().map(|&x| f64::from(x)).collect()));
            let numbers = numbers.or_else(|| attribute.get_i32().map(|v| v.iter().map(|&x| f64::from(x)).collect()));
            let numbers = numbers.or_else(|| attribute.get_i16().map(|v| v.iter().map(|&x| f64::from(x)).collect()));
            let numbers = numbers.or_else(|| attribute.get_i8().map(|v| v.iter().map(|&x| f64::from(x)).collect()));
            numbers?.first().copied()
        })
    };
    let missing = [attribute("_FillValue"), attribute("missing_value")];
    let (scale, shift) = (attribute("scale_factor").unwrap_or(1.0), attribute("add_offset").unwrap_or(0.0));

    let places: Vec<Option<Vec<f64>>> = dimensions
        .iter()
        .map(|(dimension, size)| {
            let own = file.data_set().get_var(dimension).is_some_and(|v| v.num_dims() == 1 && v.len() == *size);
            if !own || *size as u64 > length {
                return None;
            }
            file.read_var(dimension).ok().map(numbers).filter(|at| at.len() == *size)
        })
        .collect();
    let mut header = Header::even(points, [0.0; 4], [1.0; 4]);
    for (axis, places) in places.into_iter().rev().enumerate() {
        if let Some(places) = places {
            let increases = places.windows(2).all(|pair| pair[0] < pair[1]) && places.iter().all(|x| x.is_finite());
            let decreases = places.windows(2).all(|pair| pair[0] > pair[1]) && places.iter().all(|x| x.is_finite());
            if !increases && !decreases {
                let dimension = &dimensions[dimensions.len() - 1 - axis].0;
                return Err(format!("its dimension \"{dimension}\" goes back and forth; give spacing"));
            }
            header.positions[axis] = places;
        }
    }
    let read =
        file.read_var(&name).map_err(|e| format!("is cut off, or damaged: variable \"{name}\": {}", brief(&e)))?;
    let mut values = numbers(read);
    let size: usize = points.iter().product();
    if values.len() != size {
        return Err(format!("variable \"{name}\" has {} values for {size} points", values.len()));
    }
    for value in &mut values {
        *value = if missing.contains(&Some(*value)) { f64::NAN } else { *value * scale + shift };
    }
    Ok(Image { header, slices: Box::new(Held::new(values, points)) })
}

/// The variable that is asked for, or the only one with three dimensions or more.
fn choose(file: &FileReader, name: Option<&str>) -> Result<Variable, String> {
    let all = file.data_set().get_vars();
    let large: Vec<&&Variable> = all.iter().filter(|v| v.num_dims() >= 3).collect();
    let known = || all.iter().map(|v| v.name().to_owned()).collect::<Vec<_>>().join(", ");
    match (name, large.as_slice()) {
        (Some(name), _) => {
            let found = all.iter().find(|v| v.name() == name);
            found.map(|v| (*v).clone()).ok_or_else(|| format!("has no variable \"{name}\"; there are {}", known()))
        }
        (None, [one]) => Ok((**one).clone()),
        _ => {
            Err(format!("has {} variables with three dimensions or more; give array, one of {}", large.len(), known()))
        }
    }
}

/// The crate's errors say what they are only as `Debug`, and some cite the rest of the file.
fn brief(error: &impl std::fmt::Debug) -> String {
    let text = format!("{error:?}");
    let end = text.find(", invalid_bytes").unwrap_or(text.len());
    text[..end].chars().take(120).collect()
}

fn numbers(vector: DataVector) -> Vec<f64> {
    match vector {
        DataVector::I8(v) => v.into_iter().map(f64::from).collect(),
        DataVector::U8(v) => v.into_iter().map(f64::from).collect(),
        DataVector::I16(v) => v.into_iter().map(f64::from).collect(),
        DataVector::I32(v) => v.into_iter().map(f64::from).collect(),
        DataVector::F32(v) => v.into_iter().map(f64::from).collect(),
        DataVector::F64(v) => v,
    }
}
