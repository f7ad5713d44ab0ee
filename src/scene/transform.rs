//! Placing an object: scaling, rotation in a plane, translation, applied in the order in which they are listed.
//!
//! A rotation of R^D turns one coordinate plane into itself and leaves all other axes alone. `xw` turns x towards w;
//! `wx` turns the other way. Sines and cosines come from a library, not from the platform, and multiples of 90 degrees
//! are exact, so a pipeline places its objects on the same bits everywhere.
//!
//! A scaling with an odd number of negative factors is a mirror and would turn the surface inside out; the vertices of
//! each simplex are exchanged then, so that what faced outwards still does.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Error;
use super::numbers::{AXES, OneOrEach, finite, point};
use crate::geometry::Vector64;
use crate::mesh::Surface;

/// One step of placing an object: exactly one of its keys.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TransformStep {
    /// A factor, or a list with one an axis; none may be 0. Scales about the origin.
    #[serde(default)]
    pub scale: Option<OneOrEach<f64>>,
    /// A rotation in a coordinate plane.
    #[serde(default)]
    pub rotate: Option<RotateSpec>,
    /// A displacement, one number an axis.
    #[serde(default)]
    pub translate: Option<Vec<f64>>,
}

/// A rotation in a coordinate plane.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RotateSpec {
    /// Two axes, such as `xw`: the first is turned towards the second.
    pub plane: String,
    /// The angle in degrees.
    pub degrees: f64,
    /// The point that stays where it is, one number an axis; the origin if left out.
    #[serde(default)]
    pub center: Option<Vec<f64>>,
}

impl TransformStep {
    /// A share of the step, from 0 (nothing) to 1 (all of it).
    pub fn part(&self, share: f64) -> Self {
        let factor = |factor: &f64| 1.0 + (factor - 1.0) * share;
        Self {
            scale: self.scale.as_ref().map(|factors| match factors {
                OneOrEach::One(one) => OneOrEach::One(factor(one)),
                OneOrEach::Each(list) => OneOrEach::Each(list.iter().map(factor).collect()),
            }),
            rotate: self.rotate.as_ref().map(|r| RotateSpec { degrees: r.degrees * share, ..r.clone() }),
            translate: self.translate.as_ref().map(|list| list.iter().map(|x| x * share).collect()),
        }
    }
}

/// Applies the steps, which are at this key, to the surface, in order.
///
/// # Errors
/// Whatever is wrong with a step.
pub fn apply<const D: usize>(key: &str, steps: &[TransformStep], surface: &mut Surface<D>) -> Result<(), Error> {
    for (i, step) in steps.iter().enumerate() {
        let key = format!("{key}.{i}");
        match (&step.scale, &step.rotate, &step.translate) {
            (Some(factors), None, None) => scale(surface, factors.each(&format!("{key}.scale"))?, &key)?,
            (None, Some(rotation), None) => rotate(surface, rotation, &format!("{key}.rotate"))?,
            (None, None, Some(displacement)) => {
                let displacement: Vector64<D> = point(&format!("{key}.translate"), displacement)?;
                surface.vertices.iter_mut().for_each(|vertex| *vertex += displacement);
            }
            (None, None, None) => {
                return Err(Error::invalid(key, "does nothing; give one of scale, rotate, translate"));
            }
            _ => {
                return Err(Error::invalid(
                    key,
                    "holds more than one of scale, rotate, translate; make it several steps",
                ));
            }
        }
    }
    Ok(())
}

fn scale<const D: usize>(surface: &mut Surface<D>, factors: [f64; D], key: &str) -> Result<(), Error> {
    let key = format!("{key}.scale");
    for factor in factors {
        if finite(&key, factor)? == 0.0 {
            return Err(Error::invalid(key, "a factor of 0 flattens the object; give another"));
        }
    }
    let factors = Vector64::from(factors);
    surface.vertices.iter_mut().for_each(|vertex| vertex.component_mul_assign(&factors));
    // Normals go with the inverse transposed matrix, which keeps them on their side of the surface.
    for normal in surface.normals.iter_mut().flatten() {
        normal.component_div_assign(&factors);
    }
    if factors.iter().filter(|factor| **factor < 0.0).count() % 2 == 1 {
        surface.simplices.iter_mut().for_each(|simplex| simplex.swap(D - 2, D - 1));
    }
    Ok(())
}

fn rotate<const D: usize>(surface: &mut Surface<D>, rotation: &RotateSpec, key: &str) -> Result<(), Error> {
    let (from, to) = plane::<D>(&rotation.plane).ok_or_else(|| {
        let axes = AXES[..D].join(", ");
        Error::invalid(format!("{key}.plane"), format!("\"{}\" is not a plane; write two of {axes}", rotation.plane))
    })?;
    let (sine, cosine) = sine_cosine(finite(&format!("{key}.degrees"), rotation.degrees)?);
    let center: Vector64<D> = match &rotation.center {
        Some(center) => point(&format!("{key}.center"), center)?,
        None => Vector64::zeros(),
    };
    let turn = |v: &mut Vector64<D>| {
        (v[from], v[to]) = (cosine * v[from] - sine * v[to], sine * v[from] + cosine * v[to]);
    };
    for vertex in &mut surface.vertices {
        *vertex -= center;
        turn(vertex);
        *vertex += center;
    }
    surface.normals.iter_mut().flatten().for_each(turn);
    Ok(())
}

fn plane<const D: usize>(name: &str) -> Option<(usize, usize)> {
    plane_of(name, D)
}

/// The two axes, among so many, of a plane such as `xw`: the first is turned towards the second.
pub fn plane_of(name: &str, axes: usize) -> Option<(usize, usize)> {
    let axis = |letter: char| AXES[..axes].iter().position(|axis| axis.starts_with(letter));
    let mut letters = name.chars();
    let (from, to) = (axis(letters.next()?)?, axis(letters.next()?)?);
    (letters.next().is_none() && from != to).then_some((from, to))
}

/// Sine and cosine of an angle; exact for multiples of 90 degrees.
pub fn sine_cosine(degrees: f64) -> (f64, f64) {
    let turn = degrees.rem_euclid(360.0);
    // The remainder can round up to 360 itself.
    let quarter = (turn / 90.0).floor();
    let (sine, cosine) = match turn - 90.0 * quarter {
        0.0 => (0.0, 1.0),
        rest => libm::sincos(rest.to_radians()),
    };
    match quarter as i32 % 4 {
        0 => (sine, cosine),
        1 => (cosine, -sine),
        2 => (-sine, -cosine),
        _ => (-cosine, sine),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles() {
        assert_eq!(sine_cosine(0.0), (0.0, 1.0));
        assert_eq!(sine_cosine(90.0), (1.0, -0.0));
        assert_eq!(sine_cosine(-90.0), (-1.0, 0.0));
        assert_eq!(sine_cosine(540.0), (-0.0, -1.0));
        assert_eq!(sine_cosine(-1e-300), (0.0, 1.0));
        for degrees in [-1234.5, -30.0, 10.0, 100.0, 200.0, 300.0, 1e6 + 0.25] {
            let (sine, cosine) = sine_cosine(degrees);
            let expected = degrees.to_radians().sin_cos();
            assert!((sine - expected.0).abs() < 1e-9 && (cosine - expected.1).abs() < 1e-9, "{degrees}");
        }
    }

    #[test]
    fn planes() {
        assert_eq!(plane::<4>("xw"), Some((0, 3)));
        assert_eq!(plane::<4>("wx"), Some((3, 0)));
        assert_eq!(plane::<3>("zy"), Some((2, 1)));
        for wrong in ["", "x", "xx", "xyz", "xv", "x w", "XY"] {
            assert_eq!(plane::<4>(wrong), None, "{wrong}");
        }
        assert_eq!(plane::<3>("xw"), None);
    }
}
