//! The twin of an object of R^4 in R^3: what stands in its place one dimension lower.
//!
//! A twin is the body's section through the middle of its extent along w, or where there is one the regular body of the
//! same family, and stands where
//!
//! ```text
//! (x, y, z, w) -> (x, y, z + w)
//! ```
//!
//! leads its middle. So what a 4D scene has over each other, along z, and behind each other, along w, a 3D scene has behind
//! each other; the eye of the default camera, at 1 along w, comes to that of the default camera in 3D, at 1 along z. A turn
//! in a plane with w is one in the plane with z. In the plane zw nothing is left to turn.
//!
//! | in 4D | in 3D |
//! | --- | --- |
//! | `box`, `tesseract` | `box` |
//! | `cut_cube` | `cut_cube`, with the cuts that reach its middle along w |
//! | `hypersphere`, `spherinder` | `sphere` |
//! | `extrude` | the mesh, by `file` |
//! | `polytope`: 5-, 8-, 16-, 24-, 120-, 600-cell | tetrahedron, cube, octahedron, cuboctahedron, dodecahedron, icosahedron |
//! | `isosurface` of a formula | the same with w = 0 |
//! | `isosurface` of `hypersphere`, `gyroid` | the same |
//! | `isosurface` of `torisphere`, `spheritorus`, `ditorus` | of `torus` |

use super::cut_cube::{CutCubeSpec, CutSpec};
use super::hypersphere::{Base, SphereSpec};
use super::isosurface::field::{Field, TorusSpec};
use super::isosurface::{GridSpec, IsosurfaceSpec};
use super::numbers::{OneOrEach, point};
use super::transform::{RotateSpec, TransformStep};
use super::{BoxSpec, Error, ObjectSpec, PolytopeSpec, Shape};

/// What is said of a shape without a twin.
const WITHOUT: &str = "has no twin in 3D; box, tesseract, cut_cube, hypersphere, spherinder, extrude, polytope, and \
                       isosurfaces of formulas and of all named bodies but the tiger have one";

/// The object that stands in the place of one of R^4.
///
/// # Errors
/// If its shape has no counterpart in R^3, or is not one of R^4.
pub fn twin(object: &ObjectSpec) -> Result<ObjectSpec, Error> {
    let ObjectSpec { name, color, orientation, crease_angle, .. } = object.clone();
    let mut twin = ObjectSpec { name, color, orientation, crease_angle, ..ObjectSpec::default() };
    let shape = object.shape()?;
    if object.slab.is_some() {
        return Err(Error::invalid("slab", "a thick slice has no twin in 3D; take `slab` out, or `twin`"));
    }
    match shape {
        Shape::Box(spec) => {
            let (min, max) = (point::<4>("box.min", &spec.min)?, point::<4>("box.max", &spec.max)?);
            let middle = (min[3] + max[3]) / 2.0;
            let corner = |p: [f64; 4]| vec![p[0], p[1], p[2] + middle];
            let subdivisions = without_last(&spec.subdivisions);
            twin.r#box = Some(BoxSpec { min: corner(min.into()), max: corner(max.into()), subdivisions });
        }
        Shape::Tesseract(spec) => {
            let half = spec.size / 2.0;
            let subdivisions = OneOrEach::One(spec.subdivisions);
            twin.r#box = Some(BoxSpec { min: vec![-half; 3], max: vec![half; 3], subdivisions });
        }
        Shape::CutCube(spec) => twin.cut_cube = Some(cut_cube(spec)?),
        Shape::Hypersphere(spec) => {
            let center = spec.center.as_deref().map(|p| place("hypersphere.center", p)).transpose()?;
            // The 600-cell's edges are about a third as long as those of the 16-cell.
            let finer = if spec.from == Base::Cell600 { 3 } else { 1 };
            let subdivisions = spec.subdivisions.saturating_mul(finer);
            twin.sphere = Some(SphereSpec { radius: spec.radius, center, subdivisions, from: Base::Cell16 });
        }
        Shape::Spherinder(spec) => {
            let (radius, subdivisions) = (spec.radius, spec.subdivisions);
            twin.sphere = Some(SphereSpec { radius, center: None, subdivisions, from: Base::Cell16 });
        }
        Shape::Extrude(spec) => {
            twin.file = Some(spec.mesh.clone());
            // Where it is in the middle of its way.
            twin.transform = spec.motion.iter().map(|step| step.part(0.5)).collect();
            let middle = (spec.from + spec.to) / 2.0;
            let direction = spec.direction.clone().unwrap_or_else(|| vec![0.0, 0.0, 0.0, 1.0]);
            let along: Vec<f64> = place("extrude.direction", &direction)?.iter().map(|x| x * middle).collect();
            if along.iter().any(|&x| x != 0.0) {
                twin.transform.push(TransformStep { translate: Some(along), ..TransformStep::default() });
            }
        }
        Shape::Polytope(spec) => {
            let cells = match spec.cells {
                5 => 4,
                8 => 6,
                16 => 8,
                24 => 14,
                120 => 12,
                600 => 20,
                // The polytope itself is refused in a moment.
                other => other,
            };
            twin.polytope = Some(PolytopeSpec { cells, ..spec.clone() });
        }
        Shape::Isosurface(spec) => twin.isosurface = Some(isosurface(spec)?),
        Shape::Simplices(_)
        | Shape::File(_)
        | Shape::Sphere(_)
        | Shape::Spin(_)
        | Shape::Duoprism(_)
        | Shape::Duocylinder(_)
        | Shape::Cubinder(_) => return Err(Error::invalid(shape.key(), WITHOUT)),
    }
    for (i, step) in object.transform.iter().enumerate() {
        twin.transform.extend(self::step(&format!("transform.{i}"), step)?);
    }
    Ok(twin)
}

/// Where a point or a vector of R^4 comes to.
///
/// # Errors
/// If it has not four coordinates.
pub fn place(key: &str, p: &[f64]) -> Result<Vec<f64>, Error> {
    let p = point::<4>(key, p)?;
    Ok(vec![p[0], p[1], p[2] + p[3]])
}

/// What a turn in this plane is in R^3; nothing if it is in zw.
pub fn plane(name: &str) -> Option<String> {
    let name = name.replace('w', "z");
    (name != "zz").then_some(name)
}

fn step(key: &str, step: &TransformStep) -> Result<Option<TransformStep>, Error> {
    let mut twin = TransformStep::default();
    if let Some(factors) = &step.scale {
        twin.scale = Some(without_last(factors));
    }
    if let Some(rotation) = &step.rotate {
        let Some(plane) = plane(&rotation.plane) else { return Ok(None) };
        let center = rotation.center.as_deref().map(|p| place(&format!("{key}.rotate.center"), p)).transpose()?;
        twin.rotate = Some(RotateSpec { plane, degrees: rotation.degrees, center });
    }
    if let Some(displacement) = &step.translate {
        twin.translate = Some(place(&format!("{key}.translate"), displacement)?);
    }
    Ok(Some(twin))
}

/// One value an axis, without that of w.
fn without_last<T: Copy>(values: &OneOrEach<T>) -> OneOrEach<T> {
    match values {
        OneOrEach::Each(list) if list.len() == 4 => OneOrEach::Each(list[..3].to_vec()),
        other => other.clone(),
    }
}

fn cut_cube(spec: &CutCubeSpec) -> Result<CutCubeSpec, Error> {
    let (min, max) = (point::<4>("cut_cube.min", &spec.min)?, point::<4>("cut_cube.max", &spec.max)?);
    let middle = (min[3] + max[3]) / 2.0;
    let corner = |p: [f64; 4]| vec![p[0], p[1], p[2] + middle];
    let mut cuts = Vec::new();
    for (i, cut) in spec.cuts.iter().enumerate() {
        let from = point::<4>(&format!("cut_cube.cuts.{i}.from"), &cut.from)?;
        let to = point::<4>(&format!("cut_cube.cuts.{i}.to"), &cut.to)?;
        if from[3] <= middle && middle < to[3] {
            cuts.push(CutSpec { from: corner(from.into()), to: corner(to.into()) });
        }
    }
    let subdivisions = without_last(&spec.subdivisions);
    Ok(CutCubeSpec { min: corner(min.into()), max: corner(max.into()), cuts, subdivisions })
}

fn isosurface(spec: &IsosurfaceSpec) -> Result<IsosurfaceSpec, Error> {
    let field = match &spec.field {
        Field::Formula(text) => Field::Formula(with_w_zero(text)),
        Field::Hypersphere(round) => Field::Hypersphere(round.clone()),
        Field::Gyroid(gyroid) => Field::Gyroid(gyroid.clone()),
        Field::Torisphere(torus) | Field::Spheritorus(torus) => Field::Torus(torus.clone()),
        Field::Ditorus(ditorus) => Field::Torus(TorusSpec { major: ditorus.major, minor: ditorus.middle }),
        Field::Image(_) | Field::Tiger(_) | Field::Torus(_) => {
            return Err(Error::invalid(format!("isosurface.field.{}", spec.field.key()), WITHOUT));
        }
    };
    let first_three = |list: &Vec<f64>| if list.len() == 4 { list[..3].to_vec() } else { list.clone() };
    let grid = spec.grid.as_ref().map(|grid| GridSpec {
        min: grid.min.as_ref().map(first_three),
        max: grid.max.as_ref().map(first_three),
        cells: without_last(&grid.cells),
    });
    // What counts as small was said of tetrahedra.
    Ok(IsosurfaceSpec { field, grid, smallest_component: None, ..spec.clone() })
}

/// A formula in which the variable w is 0.
fn with_w_zero(formula: &str) -> String {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let mut out = String::with_capacity(formula.len());
    let mut rest = formula;
    while let Some(c) = rest.chars().next() {
        let end = if is_word(c) { rest.find(|c| !is_word(c)).unwrap_or(rest.len()) } else { c.len_utf8() };
        out.push_str(if &rest[..end] == "w" { "0" } else { &rest[..end] });
        rest = &rest[end..];
    }
    out
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn object(json: serde_json::Value) -> ObjectSpec {
        serde_json::from_value(json).unwrap()
    }

    #[test]
    fn shapes_and_places() {
        for (four, three) in [
            (
                json!({"tesseract": {"size": 0.5, "subdivisions": 3}, "name": "a", "color": 0.5}),
                json!({"box": {"min": [-0.25, -0.25, -0.25], "max": [0.25, 0.25, 0.25], "subdivisions": 3}, "name": "a", "color": 0.5}),
            ),
            (
                json!({"box": {"min": [0, 1, 2, -3], "max": [1, 2, 4, -1], "subdivisions": [1, 2, 3, 4]}}),
                json!({"box": {"min": [0, 1, 0], "max": [1, 2, 2], "subdivisions": [1, 2, 3]}}),
            ),
            (
                json!({"cut_cube": {"min": [0, 0, 0, 0], "max": [1, 1, 1, 2], "cuts": [
                    {"from": [0, 0, 0.5, 0], "to": [0.5, 1, 1, 2]}, {"from": [0, 0, 0, 1.5], "to": [1, 1, 1, 2]}]}}),
                json!({"cut_cube": {"min": [0, 0, 1], "max": [1, 1, 2], "cuts": [{"from": [0, 0, 1.5], "to": [0.5, 1, 2]}]}}),
            ),
            (
                json!({"hypersphere": {"radius": 2, "center": [1, 2, 3, 4], "subdivisions": 2, "from": "600-cell"}}),
                json!({"sphere": {"radius": 2, "center": [1, 2, 7], "subdivisions": 6}}),
            ),
            (
                json!({"spherinder": {"radius": 2, "height": 1, "subdivisions": 5}}),
                json!({"sphere": {"radius": 2, "subdivisions": 5}}),
            ),
            (json!({"extrude": {"mesh": "ant.ply", "from": -1, "to": 1}}), json!({"file": "ant.ply"})),
            (
                json!({"extrude": {"mesh": "ant.ply", "from": 0, "to": 4, "motion": [{"translate": [2, 0, 0]}]}}),
                json!({"file": "ant.ply", "transform": [{"translate": [1, 0, 0]}, {"translate": [0, 0, 2]}]}),
            ),
            (
                json!({"polytope": {"cells": 24, "subdivisions": 2}}),
                json!({"polytope": {"cells": 14, "subdivisions": 2}}),
            ),
            (
                json!({"isosurface": {"field": {"ditorus": {"major": 3, "middle": 2, "minor": 1}}, "grid": {"cells": [1, 2, 3, 4]}}}),
                json!({"isosurface": {"field": {"torus": {"major": 3, "minor": 2}}, "grid": {"cells": [1, 2, 3]}}}),
            ),
            (
                json!({"isosurface": {"field": {"formula": "w*x + pow_w + 2w"}, "grid": {"min": [0, 0, 0, 0], "max": [1, 1, 1, 1], "cells": 4}}}),
                json!({"isosurface": {"field": {"formula": "0*x + pow_w + 2w"}, "grid": {"min": [0, 0, 0], "max": [1, 1, 1], "cells": 4}}}),
            ),
            (
                json!({"tesseract": {}, "transform": [{"rotate": {"plane": "xw", "degrees": 20, "center": [1, 2, 3, 4]}},
                    {"rotate": {"plane": "zw", "degrees": 1}}, {"rotate": {"plane": "yx", "degrees": 2}}, {"scale": [1, 2, 3, 4]},
                    {"translate": [1, 2, 3, -5]}]}),
                json!({"box": {"min": [-1, -1, -1], "max": [1, 1, 1]}, "transform": [
                    {"rotate": {"plane": "xz", "degrees": 20, "center": [1, 2, 7]}}, {"rotate": {"plane": "yx", "degrees": 2}},
                    {"scale": [1, 2, 3]}, {"translate": [1, 2, -2]}]}),
            ),
        ] {
            assert_eq!(twin(&object(four.clone())).unwrap(), object(three), "{four}");
        }
    }

    #[test]
    fn what_has_none_is_refused() {
        for (shape, key) in [
            (json!({"duoprism": {"sides": [3, 4]}}), "duoprism"),
            (json!({"spin": {"mesh": "a.stl", "plane": "yw", "offset": 1, "steps": 3}}), "spin"),
            (json!({"file": "a.vtu"}), "file"),
            (
                json!({"isosurface": {"field": {"tiger": {"major": [1, 1], "minor": 0.5}}, "grid": {"cells": 4}}}),
                "isosurface.field.tiger",
            ),
        ] {
            let message = twin(&object(shape)).unwrap_err().to_string();
            assert!(message.starts_with(&format!("{key}: has no twin in 3D; box, tesseract,")), "{message}");
        }
        let message = twin(&object(json!({"box": {"min": [0, 0, 0], "max": [1, 1, 1]}}))).unwrap_err().to_string();
        assert_eq!(message, "box.min: expected 4 numbers, one an axis (x, y, z, w), found 3");
    }
}
