//! Numbers as a pipeline gives them, before the dimension is known: lists that must hold one number an axis.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Error;
use crate::geometry::{Dimension, Vector64};
use crate::text::number;

/// The axes' names, in order.
pub const AXES: [&str; 4] = ["x", "y", "z", "w"];

/// The most simplices one object may have: more would not fit into the memory of the machines this is made for.
pub const MAX_SIMPLICES: u64 = 50_000_000;

/// One value for all axes, or a list with one an axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected a number, or a list with one number an axis")]
pub enum OneOrEach<T> {
    /// The same for all axes.
    One(T),
    /// One an axis.
    Each(Vec<T>),
}

impl<T: Copy> OneOrEach<T> {
    /// The value of every axis.
    pub fn each<const D: usize>(&self, key: &str) -> Result<[T; D], Error> {
        match self {
            Self::One(value) => Ok([*value; D]),
            Self::Each(list) => {
                list.as_slice().try_into().map_err(|_| Error::invalid(key, wrong_length(D, list.len())))
            }
        }
    }
}

fn wrong_length(expected: usize, found: usize) -> String {
    format!("expected {expected} numbers, one an axis ({}), found {found}", AXES[..expected].join(", "))
}

/// A point or vector with D finite coordinates.
pub fn point<const D: usize>(key: &str, coordinates: &[f64]) -> Result<Vector64<D>, Error> {
    if coordinates.len() != D {
        return Err(Error::invalid(key, wrong_length(D, coordinates.len())));
    }
    for (axis, &x) in coordinates.iter().enumerate() {
        finite(key, x).map_err(|_| Error::invalid(key, format!("{} is {x}, but must be finite", AXES[axis])))?;
    }
    Ok(Vector64::from_column_slice(coordinates))
}

/// The number itself, if it is one.
pub fn finite(key: &str, x: f64) -> Result<f64, Error> {
    if x.is_finite() { Ok(x) } else { Err(Error::invalid(key, format!("{x} is not a finite number"))) }
}

/// A number above zero.
pub fn positive(key: &str, x: f64) -> Result<f64, Error> {
    if x.is_finite() && x > 0.0 { Ok(x) } else { Err(Error::invalid(key, format!("{} is not above 0", number(x)))) }
}

/// The lower and upper corner of a box with an inside.
pub fn bounds<const D: usize>(
    shape: &str,
    (low_key, low): (&str, &[f64]),
    (high_key, high): (&str, &[f64]),
) -> Result<(Vector64<D>, Vector64<D>), Error> {
    let (low_path, high_path) = (format!("{shape}.{low_key}"), format!("{shape}.{high_key}"));
    let (min, max) = (point::<D>(&low_path, low)?, point::<D>(&high_path, high)?);
    match (0..D).find(|&axis| min[axis] >= max[axis]) {
        None => Ok((min, max)),
        Some(axis) => Err(Error::invalid(
            high_path,
            format!("{} goes from {} to {}; {high_key} must be above {low_key}", AXES[axis], min[axis], max[axis]),
        )),
    }
}

/// Subdivisions along each axis, all at least 1.
pub fn subdivisions<const D: usize>(key: &str, given: &OneOrEach<u32>) -> Result<[u32; D], Error> {
    let each = given.each::<D>(key)?;
    if each.contains(&0) {
        return Err(Error::invalid(key, "0 subdivisions; the least is 1"));
    }
    Ok(each)
}

/// Refuses a shape, written at `key`, in scenes of the dimension that has none of it; `instead` ends the message.
pub fn only_in<const D: usize>(wanted: Dimension, key: &str, instead: &str) -> Result<(), Error> {
    if wanted == Dimension::of::<D>() {
        return Ok(());
    }
    Err(Error::invalid(key, format!("needs a scene of dimension {wanted}, not {D}{instead}")))
}

/// Refuses an object with more simplices than [`MAX_SIMPLICES`], before it is built.
pub fn check_count(key: &str, simplices: u128) -> Result<(), Error> {
    if simplices > u128::from(MAX_SIMPLICES) {
        return Err(Error::invalid(
            key,
            format!("this would make {simplices} simplices; one object may have {MAX_SIMPLICES} at most"),
        ));
    }
    Ok(())
}
