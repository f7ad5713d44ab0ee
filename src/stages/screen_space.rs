//! `screen_space`: how ambient occlusion is looked for in an image alone, where an image says `occlusion: screen_space`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::Invalid;
use super::range::positive;
use crate::render::{ScreenSpace, Thickness};
use crate::text::number;

/// The word that `occlusion` of a render has for it.
pub const WORD: &str = "screen_space";
/// The most slices through a point, and the most looks along a side of one.
const MOST: u64 = 1024;

/// How ambient occlusion is looked for in the depth and the normals of an image.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct ScreenSpaceSpec {
    /// Planes through each point and the line of sight that are looked into (default 32).
    #[schemars(range(min = 1, max = 1024))]
    pub slices: Option<u64>,
    /// Looks along either side of each (default 16).
    #[schemars(range(min = 1, max = 1024))]
    pub steps: Option<u64>,
    /// How far things go on behind what is seen of them, in the scene's units: `auto` (default), a part of the extent of all
    /// that is seen; or `unlimited`, which leaves plain horizons.
    pub thickness: Option<ThicknessSpec>,
    /// Occluders further away than this don't count (default: all count).
    pub max_distance: Option<f64>,
}

/// A length, `auto` or `unlimited`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected a length, auto or unlimited")]
pub enum ThicknessSpec {
    /// So far, in the scene's units.
    Given(f64),
    /// A word instead.
    Word(ThicknessWord),
}

/// `auto` or `unlimited`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ThicknessWord {
    /// A part of the extent of all that is seen.
    Auto,
    /// Without end.
    Unlimited,
}

/// How screen space is searched, as understood.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ScreenSpacePlan {
    /// Slices through each point.
    pub slices: usize,
    /// Looks along either side of each.
    pub steps: usize,
    /// How far things go on behind what is seen of them.
    pub thickness: ThicknessSpec,
    /// Occluders further away don't count.
    pub max_distance: Option<f64>,
}

/// Checks what is written at `path`; nothing written means the defaults.
///
/// # Errors
/// If a number is out of range.
pub(super) fn plan(spec: Option<&ScreenSpaceSpec>, path: &str) -> Result<ScreenSpacePlan, Invalid> {
    let blank = ScreenSpaceSpec::default();
    let spec = spec.unwrap_or(&blank);
    let standard = ScreenSpace::default();
    let count = |key: &str, given: Option<u64>, default: usize| match given {
        None => Ok(default),
        Some(n) if (1..=MOST).contains(&n) => Ok(n as usize),
        Some(n) => Err(Invalid::new(format!("{path}.{key}"), format!("expected 1 to {MOST}, found {n}"))),
    };
    let slices = count("slices", spec.slices, standard.slices)?;
    let steps = count("steps", spec.steps, standard.steps)?;
    let thickness = spec.thickness.unwrap_or(ThicknessSpec::Word(ThicknessWord::Auto));
    if let ThicknessSpec::Given(length) = thickness
        && !(0.0..=super::MAX_LENGTH).contains(&length)
    {
        let message = format!("expected a length from 0 to 1e12, `auto` or `unlimited`, found {}", number(length));
        return Err(Invalid::new(format!("{path}.thickness"), message));
    }
    let max_distance = spec.max_distance.map(|x| positive(&format!("{path}.max_distance"), x)).transpose()?;
    Ok(ScreenSpacePlan { slices, steps, thickness, max_distance })
}

impl ScreenSpacePlan {
    /// What the renderer is told.
    pub fn settings(&self) -> ScreenSpace {
        ScreenSpace {
            slices: self.slices,
            steps: self.steps,
            thickness: match self.thickness {
                ThicknessSpec::Given(length) => Thickness::Given(length as f32),
                ThicknessSpec::Word(ThicknessWord::Auto) => Thickness::Auto,
                ThicknessSpec::Word(ThicknessWord::Unlimited) => Thickness::Given(f32::INFINITY),
            },
            max_distance: self.max_distance.map_or(f32::INFINITY, |x| x as f32),
        }
    }

    /// As it is written in a pipeline, nothing left out.
    pub(super) fn written(&self) -> Value {
        json!(self)
    }

    /// `32 slices x 16 steps`.
    pub(super) fn line(&self) -> String {
        format!("{} slices x {} steps", self.slices, self.steps)
    }
}
