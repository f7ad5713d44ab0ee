//! The camera of a render: defaults filled in, and directions that span an image.
//!
//! The default eye is at 1 along the last axis and looks back along it at the origin, with the angle of view 90
//! degrees: the image then lies in the hyperplane through the origin and covers -1 to 1 (thesis 4.6.1). `up` and
//! `over` only have to be independent of the line of sight and of each other; the renderer makes them orthogonal.
//!
//! `camera: fit`, or `fit: true` beside other keys, leaves to the program where the eye is: `stages/fit.rs` finds it once the
//! scene is known, and puts the camera that it finds in the place of the words.

use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{self, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::{Value, json};

use super::Invalid;
use super::range::{check_length, positive};
use crate::geometry::{Dimension, Vector64};
use crate::render::{self, Camera, CameraError, View};
use crate::text::number;

/// Sines of angles below this count as parallel.
const PARALLEL: f64 = 1e-6;

/// Where a scene is seen from. Vectors have as many numbers as the scene has dimensions.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct CameraSpec {
    /// `perspective` (default) or `parallel`.
    pub projection: Option<Projection>,
    /// Where the eye is (default 1 along the last axis).
    pub eye: Option<Vec<f64>>,
    /// What it looks at (default the origin).
    pub target: Option<Vec<f64>>,
    /// Perspective: the angle of view in degrees, from bottom to top (default 90).
    pub field_of_view: Option<f64>,
    /// Parallel: the extent of the image from bottom to top, in the scene's units (default 2).
    pub height: Option<f64>,
    /// The direction that is up, +y in the image (default +y).
    pub up: Option<Vec<f64>>,
    /// In 4D the direction that is over, +z in the image (default +z).
    pub over: Option<Vec<f64>>,
    /// Whether the camera is placed so that the scene just fits the image (default `false`); `camera: fit` for short. The
    /// direction from `target` to `eye`, `up`, `over` and the angle of view stay as they are; where the eye is, what it looks
    /// at, and in a parallel projection `height`, follow from the scene.
    pub fit: Option<bool>,
    /// With `fit`: the share of the image that stays empty towards its edges, 0 to below 1 (default 0.05).
    #[schemars(range(min = 0, max = 0.9))]
    pub margin: Option<f64>,
}

/// The keys of a camera, or the word `fit`.
struct FitOrKeys(CameraSpec);

/// The word for a camera that is placed by the scene.
const FIT: &str = "fit";
/// The share of the image that is left empty around a scene that fits.
const MARGIN: f64 = 0.05;

impl<'de> Deserialize<'de> for FitOrKeys {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Camera;
        impl<'de> Visitor<'de> for Camera {
            type Value = CameraSpec;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the word `fit`, or a mapping such as {eye: [0, 0, 0, 2]}")
            }

            fn visit_str<E: de::Error>(self, word: &str) -> Result<CameraSpec, E> {
                match word {
                    FIT => Ok(CameraSpec { fit: Some(true), ..CameraSpec::default() }),
                    _ => Err(E::unknown_variant(word, &[FIT])),
                }
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<CameraSpec, A::Error> {
                CameraSpec::deserialize(MapAccessDeserializer::new(map))
            }
        }
        deserializer.deserialize_any(Camera).map(FitOrKeys)
    }
}

/// Reads what is written as a camera.
pub(super) fn fit_or_keys<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<CameraSpec>, D::Error> {
    Ok(Option::<FitOrKeys>::deserialize(deserializer)?.map(|FitOrKeys(spec)| spec))
}

/// What may be written as a camera, for editors.
pub(super) fn fit_or_keys_schema(generator: &mut SchemaGenerator) -> Schema {
    let keys = generator.subschema_for::<CameraSpec>();
    json_schema!({ "anyOf": [{ "const": FIT }, keys] })
}

/// How rays leave the eye.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Projection {
    /// From one point.
    #[default]
    Perspective,
    /// All in one direction.
    Parallel,
}

/// Where a scene is seen from, every vector with as many numbers as the scene has dimensions.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct CameraPlan {
    /// How rays leave the eye.
    pub projection: ProjectionPlan,
    /// Where the eye is.
    pub eye: Vec<f64>,
    /// What it looks at; not the eye.
    pub target: Vec<f64>,
    /// Independent of the line of sight.
    pub up: Vec<f64>,
    /// In 4D, independent of the line of sight and of `up`.
    pub over: Option<Vec<f64>>,
    /// Until the scene is known: that the eye is to be placed by it, and the share of the image that is to stay empty.
    pub fit: Option<f64>,
}

/// How rays leave the eye.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ProjectionPlan {
    /// From one point.
    Perspective {
        /// Degrees from bottom to top, between 0 and 180.
        field_of_view: f64,
    },
    /// All in one direction.
    Parallel {
        /// The image's extent from bottom to top, above 0.
        height: f64,
    },
}

impl CameraPlan {
    /// What would be written for it, nothing left out.
    pub(super) fn spec(&self) -> CameraSpec {
        let (projection, field_of_view, height) = match self.projection {
            ProjectionPlan::Perspective { field_of_view } => (Projection::Perspective, Some(field_of_view), None),
            ProjectionPlan::Parallel { height } => (Projection::Parallel, None, Some(height)),
        };
        let [eye, target, up] = [&self.eye, &self.target, &self.up].map(|v| Some(v.clone()));
        let over = self.over.clone();
        CameraSpec {
            projection: Some(projection),
            eye,
            target,
            field_of_view,
            height,
            up,
            over,
            fit: None,
            margin: None,
        }
    }

    /// As it is written in a pipeline, nothing left out.
    pub(super) fn written(&self) -> Value {
        let (word, key, number) = match self.projection {
            ProjectionPlan::Perspective { field_of_view } => (Projection::Perspective, "field_of_view", field_of_view),
            ProjectionPlan::Parallel { height } => (Projection::Parallel, "height", height),
        };
        json!({
            "projection": word, key: number, "eye": self.eye, "target": self.target, "up": self.up, "over": self.over
        })
    }
}

/// Checks a camera of a scene of this dimension, written at `path`. Keys without a use in it go into `warnings`.
pub(super) fn plan(
    spec: &CameraSpec,
    path: &str,
    dimension: Dimension,
    warnings: &mut Vec<Invalid>,
) -> Result<CameraPlan, Invalid> {
    let count = dimension.get();
    let axis = |a: usize| -> Vec<f64> { (0..count).map(|i| f64::from(i == a)).collect() };
    let vector = |key: &str, given: &Option<Vec<f64>>, default: Vec<f64>| match given {
        Some(v) => check_vector(&format!("{path}.{key}"), v, count),
        None => Ok(default),
    };
    let eye = vector("eye", &spec.eye, axis(count - 1))?;
    let target = vector("target", &spec.target, vec![0.0; count])?;
    let back: Vec<f64> = eye.iter().zip(&target).map(|(e, t)| e - t).collect();
    let Some(back) = normalised(&back) else {
        let key = if spec.target.is_some() { "target" } else { "eye" };
        return Err(Invalid::new(format!("{path}.{key}"), "`eye` and `target` are the same point; move one of them"));
    };

    let up = vector("up", &spec.up, axis(1))?;
    let frame = vec![back];
    let Some(up_part) = independent(&up, &frame) else {
        return Err(dependent(path, "up", spec.up.is_some(), "the line of sight", &frame));
    };
    let frame = vec![frame[0].clone(), up_part];
    let over = match (dimension, &spec.over) {
        (Dimension::Three, None) => None,
        (Dimension::Three, Some(_)) => {
            return Err(Invalid::new(format!("{path}.over"), "a 3D scene has no direction over; take the key out"));
        }
        (Dimension::Four, _) => {
            let over = vector("over", &spec.over, axis(2))?;
            if independent(&over, &frame).is_none() {
                let plane = "the plane of the line of sight and `up`";
                return Err(dependent(path, "over", spec.over.is_some(), plane, &frame));
            }
            Some(over)
        }
    };

    let fit = fit(spec, path)?;
    let mut unused = |key: &str, given: Option<f64>, projection: &str| {
        if given.is_some() {
            let message = format!("has no use in a {projection} projection");
            warnings.push(Invalid::new(format!("{path}.{key}"), message));
        }
    };
    if fit.is_some() && spec.projection == Some(Projection::Parallel) {
        unused("height", spec.height, "fitted");
    }
    if fit.is_none() {
        unused("margin", spec.margin, "fixed");
    }
    let projection = match spec.projection.unwrap_or_default() {
        Projection::Perspective => {
            unused("height", spec.height, "perspective");
            let field_of_view = spec.field_of_view.unwrap_or(90.0);
            // The tangent of half the angle scales the image, so the bounds themselves have no image.
            if !(0.001..=179.999).contains(&field_of_view) {
                let message = format!("expected 0.001 to 179.999 degrees, found {}", number(field_of_view));
                return Err(Invalid::new(format!("{path}.field_of_view"), message));
            }
            ProjectionPlan::Perspective { field_of_view }
        }
        Projection::Parallel => {
            unused("field_of_view", spec.field_of_view, "parallel");
            let height = positive(&format!("{path}.height"), spec.height.unwrap_or(2.0))?;
            ProjectionPlan::Parallel { height }
        }
    };
    Ok(CameraPlan { projection, eye, target, up, over, fit })
}

/// The share of the image that is to stay empty, if the camera is to be placed by the scene.
fn fit(spec: &CameraSpec, path: &str) -> Result<Option<f64>, Invalid> {
    let margin = spec.margin.unwrap_or(MARGIN);
    if !(0.0..=0.9).contains(&margin) {
        return Err(Invalid::new(format!("{path}.margin"), format!("expected 0 to 0.9, found {}", number(margin))));
    }
    Ok(spec.fit.unwrap_or(false).then_some(margin))
}

/// The camera of a plan.
///
/// # Errors
/// If rounding leaves it without a frame.
pub fn camera<const D: usize>(plan: &CameraPlan) -> Result<Camera<D>, CameraError> {
    let vector = |v: &[f64]| Vector64::<D>::from_fn(|r, _| v[r]);
    Camera::new(&View {
        projection: match plan.projection {
            ProjectionPlan::Perspective { field_of_view } => render::Projection::Perspective { field_of_view },
            ProjectionPlan::Parallel { height } => render::Projection::Parallel { height },
        },
        eye: vector(&plan.eye),
        target: vector(&plan.target),
        up: vector(&plan.up),
        over: plan.over.as_deref().map_or_else(Vector64::zeros, vector),
    })
}

/// A vector of the right length, with numbers of a sane size.
pub(super) fn check_vector(path: &str, vector: &[f64], dimension: usize) -> Result<Vec<f64>, Invalid> {
    if vector.len() != dimension {
        let message = format!("expected {dimension} numbers (the scene is {dimension}D), found {}", vector.len());
        return Err(Invalid::new(path, message));
    }
    for (i, &x) in vector.iter().enumerate() {
        check_length(&format!("{path}[{i}]"), x)?;
    }
    Ok(vector.to_vec())
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn normalised(v: &[f64]) -> Option<Vec<f64>> {
    let length = dot(v, v).sqrt();
    (length > 1e-12).then(|| v.iter().map(|x| x / length).collect())
}

/// The unit part of a vector across an orthonormal frame, unless it nearly lies within that frame.
fn independent(vector: &[f64], frame: &[Vec<f64>]) -> Option<Vec<f64>> {
    let mut rest = normalised(vector)?;
    // Twice, since the first pass leaves rounding of the size of what it took away.
    for _ in 0..2 {
        for base in frame {
            let along = dot(&rest, base);
            rest.iter_mut().zip(base).for_each(|(r, b)| *r -= along * b);
        }
    }
    if dot(&rest, &rest).sqrt() < PARALLEL { None } else { normalised(&rest) }
}

/// The complaint about a direction within a frame, with an axis that would do.
fn dependent(path: &str, key: &str, given: bool, within: &str, frame: &[Vec<f64>]) -> Invalid {
    let dimension = frame.first().map_or(0, Vec::len);
    let across = |a: usize| 1.0 - frame.iter().map(|base| base[a] * base[a]).sum::<f64>();
    let best = (0..dimension).max_by(|&a, &b| across(a).total_cmp(&across(b))).unwrap_or(0);
    let axis: Vec<String> = (0..dimension).map(|i| u8::from(i == best).to_string()).collect();
    let which = if given { "this direction" } else { "the default direction" };
    let relation = if frame.len() == 1 { "is parallel to" } else { "lies in" };
    let message = format!("{which} {relation} {within} (or is zero); try `{key}: [{}]`", axis.join(", "));
    Invalid::new(format!("{path}.{key}"), message)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(yaml: &str, dimension: u64) -> Result<CameraPlan, String> {
        let spec: CameraSpec = crate::pipeline::Document::parse("c.yaml", yaml).unwrap().decode().unwrap();
        plan(&spec, "camera", Dimension::new(dimension).unwrap(), &mut Vec::new()).map_err(|e| e.to_string())
    }

    #[test]
    fn defaults_in_both_dimensions() {
        let four = camera("{}", 4).unwrap();
        assert_eq!((four.eye, four.target, four.up), (vec![0., 0., 0., 1.], vec![0.; 4], vec![0., 1., 0., 0.]));
        assert_eq!(four.over, Some(vec![0., 0., 1., 0.]));
        assert_eq!(four.projection, ProjectionPlan::Perspective { field_of_view: 90.0 });
        let three = camera("{projection: parallel}", 3).unwrap();
        assert_eq!((three.eye, three.over), (vec![0., 0., 1.], None));
        assert_eq!(three.projection, ProjectionPlan::Parallel { height: 2.0 });
    }

    #[test]
    fn refusals() {
        for (yaml, dimension, message) in [
            ("{eye: [0, 0, 1]}", 4, "camera.eye: expected 4 numbers (the scene is 4D), found 3"),
            ("{eye: [0, 0, 1, 1e13]}", 4, "camera.eye[3]: expected a number of size up to 1e12, found 1e13"),
            ("{eye: [0, 0, 0, 0]}", 4, "camera.eye: `eye` and `target` are the same point; move one of them"),
            ("{field_of_view: 180}", 4, "camera.field_of_view: expected 0.001 to 179.999 degrees, found 180"),
            ("{field_of_view: 0}", 3, "camera.field_of_view: expected 0.001 to 179.999 degrees, found 0"),
            ("{projection: parallel, height: -1}", 3, "camera.height: expected a number above 0, found -1"),
            ("{over: [0, 0, 1]}", 3, "camera.over: a 3D scene has no direction over; take the key out"),
            (
                "{eye: [0, 2, 0, 0]}",
                4,
                "camera.up: the default direction is parallel to the line of sight (or is zero); try `up: [0, 0, 0, 1]`",
            ),
            (
                "{eye: [0, 0, 2]  , up: [0, 0, 0]}",
                3,
                "camera.up: this direction is parallel to the line of sight (or is zero); try `up: [0, 1, 0]`",
            ),
            (
                "{over: [0, 2, 0, 1]}",
                4,
                "camera.over: this direction lies in the plane of the line of sight and `up` (or is zero); try `over: [0, 0, 1, 0]`",
            ),
        ] {
            assert_eq!(camera(yaml, dimension).unwrap_err(), message);
        }
    }

    #[test]
    fn a_proposed_direction_is_accepted() {
        // Along y the default `up` fails; what the message proposes must do.
        assert!(camera("{eye: [0, 2, 0, 0], up: [0, 0, 0, 1]}", 4).is_ok());
        assert!(camera("{eye: [0, 2, 0], up: [0, 0, 1]}", 3).is_ok());
    }
}
