//! Where the points of slices and wireframes are put: the keys `projection`, `center` and `pole`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::range::check_length;
use super::{Invalid, MIN_LENGTH, Plan, Ref, Stage, StageError};
use crate::geometry::{Dimension, Vector64};
use crate::mesh::stereographic::{NoImage, Stereographic};

/// How points come to be where they are in a file.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ProjectionWord {
    /// In the coordinates of the hyperplane (of slices).
    Plane,
    /// As the render's camera sees them (of wireframes).
    Camera,
    /// On the sphere around `center`, from its `pole`.
    Stereographic,
}

/// A stereographic projection, as understood.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StereographicPlan {
    /// The centre of the sphere.
    pub center: Vec<f64>,
    /// In which direction its pole is; not zero.
    pub pole: Vec<f64>,
}

impl StereographicPlan {
    /// What the keys say, in a scene of this dimension.
    pub(super) fn new(
        center: Option<&[f64]>,
        pole: Option<&[f64]>,
        path: &str,
        dimension: Dimension,
    ) -> Result<Self, Invalid> {
        let center = point(center, &format!("{path}.center"), dimension)?;
        let pole = direction(pole, &format!("{path}.pole"), dimension, "pole")?;
        Ok(Self { center, pole })
    }

    /// The projection. The checks before leave no pole that has none.
    pub(super) fn map<const D: usize>(&self) -> Option<Stereographic<D>> {
        let vector = |v: &[f64]| Vector64::from_fn(|r, _| v.get(r).copied().unwrap_or(0.0));
        Stereographic::new(vector(&self.center), vector(&self.pole))
    }

    /// What is said where something has no image.
    pub(super) fn complain<T: Stage>(&self, me: Ref<T>, plan: &Plan, why: NoImage, body: &str) -> StageError {
        let path = &plan.stages[me.index()].path;
        let (key, message) = match why {
            NoImage::Pole => (
                "pole",
                format!(
                    "the pole of the projection, from the centre in direction {:?}, lies on what is shown of `{body}`, whose \
                     image would reach to infinity; choose another `pole`",
                    self.pole
                ),
            ),
            NoImage::Center => (
                "center",
                format!(
                    "the centre of the projection, {:?}, lies on what is shown of `{body}`, so it is on no side of the \
                     sphere; choose another `center`",
                    self.center
                ),
            ),
        };
        Invalid::new(format!("{path}.{key}"), message).into()
    }
}

/// A point of a scene; the origin if left out.
pub(super) fn point(given: Option<&[f64]>, path: &str, dimension: Dimension) -> Result<Vec<f64>, Invalid> {
    let count = dimension.get();
    let Some(point) = given else { return Ok(vec![0.0; count]) };
    if point.len() != count {
        let message = format!("expected {count} numbers (the scene is {count}D), found {}", point.len());
        return Err(Invalid::new(path, message));
    }
    for (i, &x) in point.iter().enumerate() {
        check_length(&format!("{path}[{i}]"), x)?;
    }
    Ok(point.to_vec())
}

/// A direction in a scene, of any length but zero; along the last axis if left out.
pub(super) fn direction(
    given: Option<&[f64]>,
    path: &str,
    dimension: Dimension,
    noun: &str,
) -> Result<Vec<f64>, Invalid> {
    let count = dimension.get();
    if given.is_none() {
        return Ok((0..count).map(|axis| f64::from(axis == count - 1)).collect());
    }
    let direction = point(given, path, dimension)?;
    if direction.iter().all(|x| x.abs() < MIN_LENGTH) {
        let axis: Vec<&str> = (0..count).map(|axis| if axis == count - 1 { "1" } else { "0" }).collect();
        let what = if noun == "normal" { "no hyperplane has that" } else { "that is no direction" };
        let message = format!("the {noun} is zero, and {what}; try `{noun}: [{}]`", axis.join(", "));
        return Err(Invalid::new(path, message));
    }
    Ok(direction)
}
