//! The fields a pipeline can name, as formulas, and how far from the origin they reach.
//!
//! The bodies are the tori and spheres of R^4 by the names they have among those who study them; R, r are radii of circles or
//! spheres, and the field is the distance to the innermost circle or sphere less the radius of what turns around it, so
//! that an isovalue other than 0 makes a body thicker or thinner by that much.
//!
//! | body | what it is | 3-volume | 4-volume |
//! | --- | --- | --- | --- |
//! | hypersphere | | 2 pi^2 r^3 | pi^2 r^4 / 2 |
//! | tiger | circles around a product of two circles | 8 pi^3 a b r | 4 pi^3 a b r^2 |
//! | torisphere | circles around a sphere | 8 pi^2 R^2 r + 4 pi^2 r^3 | 4 pi^2 R^2 r^2 + pi^2 r^4 |
//! | spheritorus | spheres around a circle | 8 pi^2 R r^2 | 8 pi^2 R r^3 / 3 |
//! | ditorus | circles around a torus | 8 pi^3 R s r | 4 pi^3 R s r^2 |

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::Error;
use super::super::numbers::{finite, positive};
use super::image::ImageSpec;
use crate::geometry::Dimension;

/// The field whose isosurface is taken: exactly one of these.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Field {
    /// An expression in x, y, z and w, such as `x^2 + y^2 - sin(3*z) * w`. Known are + - * / ^, pi, tau, e, sqrt, abs, sin,
    /// cos, tan, asin, acos, atan, sinh, cosh, tanh, exp, ln, floor, min, max, atan2 and mod. `max(a, b)` of two bodies is
    /// what they have in common, `min(a, b)` both together, `max(a, -b)` the first without the second.
    Formula(String),
    /// A grid of values from a file.
    Image(Box<ImageSpec>),
    /// A sphere around the origin.
    Hypersphere(RoundSpec),
    /// Circles around a product of two circles, one in the plane xy and one in zw.
    Tiger(TigerSpec),
    /// Circles around a sphere in xyz.
    Torisphere(TorusSpec),
    /// Spheres around a circle in xy.
    Spheritorus(TorusSpec),
    /// Circles around a torus in xyz.
    Ditorus(DitorusSpec),
    /// A torus around the z axis, in a scene of dimension 3.
    Torus(TorusSpec),
    /// A periodic labyrinth, sin x cos y + sin y cos z + sin z cos w + sin w cos x, which parts space into two halves.
    Gyroid(GyroidSpec),
}

/// A sphere.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RoundSpec {
    /// The radius, above 0.
    pub radius: f64,
}

/// A circle or sphere, and what turns around it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TorusSpec {
    /// The radius of the circle or sphere in the middle.
    pub major: f64,
    /// The radius of the tube around it.
    pub minor: f64,
}

/// Two circles, and what turns around their product.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TigerSpec {
    /// The radii of the circles in xy and in zw.
    pub major: [f64; 2],
    /// The radius of the tube around their product.
    pub minor: f64,
}

/// A circle, circles around it, circles around those.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DitorusSpec {
    /// The radius of the circle in the middle.
    pub major: f64,
    /// The radius of the torus around it.
    pub middle: f64,
    /// The radius of the tube around that.
    pub minor: f64,
}

/// A gyroid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GyroidSpec {
    /// After which length it repeats along each axis.
    pub period: f64,
    /// Makes a wall of it: solid is where the field is within this of 0 on either side.
    #[serde(default)]
    pub wall: Option<f64>,
}

/// A field as an expression, and the extent of its body along each axis if it has one.
#[derive(Clone, Debug, PartialEq)]
pub struct Definition {
    /// In x, y, z and w.
    pub formula: String,
    /// How far the body reaches from the origin along each axis.
    pub extent: Option<[f64; 4]>,
}

impl Field {
    /// Its key in the pipeline.
    pub fn key(&self) -> &'static str {
        match self {
            Field::Formula(_) => "formula",
            Field::Image(_) => "image",
            Field::Hypersphere(_) => "hypersphere",
            Field::Tiger(_) => "tiger",
            Field::Torisphere(_) => "torisphere",
            Field::Spheritorus(_) => "spheritorus",
            Field::Ditorus(_) => "ditorus",
            Field::Torus(_) => "torus",
            Field::Gyroid(_) => "gyroid",
        }
    }

    /// The field as an expression.
    pub fn define(&self, dimension: Dimension) -> Result<Definition, Error> {
        let path = |key: &str| format!("isosurface.field.{}{}{key}", self.key(), if key.is_empty() { "" } else { "." });
        let wanted = match self {
            Field::Formula(_) | Field::Image(_) | Field::Hypersphere(_) | Field::Gyroid(_) => dimension,
            Field::Torus(_) => Dimension::Three,
            Field::Tiger(_) | Field::Torisphere(_) | Field::Spheritorus(_) | Field::Ditorus(_) => Dimension::Four,
        };
        if wanted != dimension {
            return Err(Error::invalid(path(""), format!("needs a scene of dimension {wanted}, not {dimension}")));
        }
        let radius = |key: &str, value: f64| positive(&path(key), value);
        let (formula, extent) = match self {
            Field::Formula(text) => (text.clone(), None),
            Field::Image(_) => return Err(Error::invalid(path(""), "is no formula")),
            Field::Hypersphere(RoundSpec { radius: r }) => {
                let r = radius("radius", *r)?;
                let squares = dimension.pick("x^2 + y^2 + z^2", "x^2 + y^2 + z^2 + w^2");
                (format!("sqrt({squares}) - {r}"), Some([r; 4]))
            }
            Field::Tiger(TigerSpec { major: [a, b], minor: r }) => {
                let (a, b, r) = (radius("major", *a)?, radius("major", *b)?, radius("minor", *r)?);
                let circles = format!("(sqrt(x^2 + y^2) - {a})^2 + (sqrt(z^2 + w^2) - {b})^2");
                (format!("sqrt({circles}) - {r}"), Some([a + r, a + r, b + r, b + r]))
            }
            Field::Torisphere(TorusSpec { major, minor }) => {
                let (a, r) = (radius("major", *major)?, radius("minor", *minor)?);
                (format!("sqrt((sqrt(x^2 + y^2 + z^2) - {a})^2 + w^2) - {r}"), Some([a + r, a + r, a + r, r]))
            }
            Field::Spheritorus(TorusSpec { major, minor }) => {
                let (a, r) = (radius("major", *major)?, radius("minor", *minor)?);
                (format!("sqrt((sqrt(x^2 + y^2) - {a})^2 + z^2 + w^2) - {r}"), Some([a + r, a + r, r, r]))
            }
            Field::Ditorus(DitorusSpec { major, middle, minor }) => {
                let (a, s, r) = (radius("major", *major)?, radius("middle", *middle)?, radius("minor", *minor)?);
                let torus = format!("sqrt((sqrt(x^2 + y^2) - {a})^2 + z^2) - {s}");
                (format!("sqrt(({torus})^2 + w^2) - {r}"), Some([a + s + r, a + s + r, s + r, r]))
            }
            Field::Torus(TorusSpec { major, minor }) => {
                let (a, r) = (radius("major", *major)?, radius("minor", *minor)?);
                (format!("sqrt((sqrt(x^2 + y^2) - {a})^2 + z^2) - {r}"), Some([a + r, a + r, r, r]))
            }
            Field::Gyroid(GyroidSpec { period, wall }) => {
                let k = std::f64::consts::TAU / radius("period", *period)?;
                let axes = dimension.axes();
                let term = |i: usize| format!("sin({k}*{}) * cos({k}*{})", axes[i], axes[(i + 1) % axes.len()]);
                let sum = (0..axes.len()).map(term).collect::<Vec<_>>().join(" + ");
                match wall {
                    None => (sum, None),
                    Some(wall) => (format!("abs({sum}) - {}", radius("wall", *wall)?), None),
                }
            }
        };
        if let Some(extent) = extent {
            extent.iter().try_for_each(|&x| finite(&path(""), x).map(drop))?;
        }
        Ok(Definition { formula, extent })
    }
}
