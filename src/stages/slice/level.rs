//! What cuts: hyperplanes, or the tori of Hopf; and where each of a sequence is.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::SliceSpec;
use crate::geometry::{Dimension, Vector64};
use crate::mesh::peel::Hopf;
use crate::mesh::section::{Hyperplane, Level};
use crate::stages::projection::{direction, point};
use crate::stages::range::check_length;
use crate::stages::{Invalid, MIN_LENGTH};
use crate::text::number;

/// The most slices of a sequence.
const MOST: u64 = 10_000;

/// How a body is peeled.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PeelWord {
    /// Where w has a value: slices along the fourth axis.
    W,
    /// Where an angle of Hopf's has a value, in degrees: tori.
    Hopf,
}

/// What cuts, but for where it is.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LevelPlan {
    /// Hyperplanes across a normal, which is not zero.
    Across(Vec<f64>),
    /// Hyperplanes across the fourth axis, as peels.
    W,
    /// Tori of Hopf.
    Hopf {
        /// The point that they are about.
        center: Vec<f64>,
        /// The axis of Hopf's sphere that the angle is measured from; not zero.
        axis: [f64; 3],
    },
}

impl LevelPlan {
    /// What the keys say.
    pub(super) fn new(spec: &SliceSpec, path: &str, dimension: Dimension) -> Result<Self, Invalid> {
        let refuse = |key: &str, message: &str| Err(Invalid::new(format!("{path}.{key}"), message));
        if spec.peel.is_some() && spec.normal.is_some() {
            return refuse("normal", "`peel` says already along what it is cut; take one of the two out");
        }
        if spec.axis.is_some() && spec.peel != Some(PeelWord::Hopf) {
            return refuse("axis", "is for `peel: hopf` alone; take it out");
        }
        match (spec.peel, dimension) {
            (Some(_), Dimension::Three) => refuse(
                "peel",
                "the scene is 3D, and peels are of hyperspheres in 4D; `normal: [0, 0, 1]` slices along z",
            ),
            (Some(PeelWord::Hopf), Dimension::Four) => {
                let axis = spec.axis.unwrap_or([0.0, 0.0, 1.0]);
                for (i, &x) in axis.iter().enumerate() {
                    check_length(&format!("{path}.axis[{i}]"), x)?;
                }
                if axis.iter().all(|x| x.abs() < MIN_LENGTH) {
                    return refuse(
                        "axis",
                        "the axis is zero, and no angle is measured from that; try `axis: [0, 0, 1]`",
                    );
                }
                Ok(Self::Hopf { center: point(spec.center.as_deref(), &format!("{path}.center"), dimension)?, axis })
            }
            (Some(PeelWord::W), Dimension::Four) => Ok(Self::W),
            (None, _) => {
                let normal = direction(spec.normal.as_deref(), &format!("{path}.normal"), dimension, "normal")?;
                Ok(Self::Across(normal))
            }
        }
    }

    /// Whether they lie in hyperplanes.
    pub fn is_flat(&self) -> bool {
        !matches!(self, Self::Hopf { .. })
    }

    /// The hyperplane there, if it is one.
    pub(super) fn plane<const D: usize>(&self, at: f64) -> Option<Hyperplane<D>> {
        match self {
            Self::Across(normal) => Hyperplane::new(Vector64::from_fn(|r, _| normal[r]), at),
            Self::W => Hyperplane::new(Vector64::from_fn(|r, _| f64::from(r == D - 1)), at),
            Self::Hopf { .. } => None,
        }
    }

    /// What cuts there. The checks before leave nothing that has no such.
    pub(super) fn level<const D: usize>(&self, at: f64) -> Option<Box<dyn Level<D>>> {
        match self {
            Self::Across(_) | Self::W => Some(Box::new(self.plane::<D>(at)?)),
            Self::Hopf { center, axis } => {
                let center = Vector64::from_fn(|r, _| center[r]);
                Some(Box::new(Hopf::new(center, *axis, at)?))
            }
        }
    }

    /// What it is, for messages.
    pub(super) fn line(&self) -> String {
        let numbers = |v: &[f64]| v.iter().map(|x| number(*x)).collect::<Vec<_>>().join(", ");
        match self {
            Self::Across(normal) => format!("across [{}]", numbers(normal)),
            Self::W => "across w".to_owned(),
            Self::Hopf { center, axis } => {
                format!("Hopf's tori around [{}] about [{}]", numbers(center), numbers(axis))
            }
        }
    }
}

/// Where what cuts is: the numbers that its function has there.
pub(super) fn places(spec: &SliceSpec, path: &str) -> Result<Vec<f64>, Invalid> {
    let hopf = spec.peel == Some(PeelWord::Hopf);
    let check = |key: &str, x: f64| {
        if hopf && !(x > 0.0 && x < 90.0) {
            let message = format!(
                "expected more than 0 and less than 90 degrees, found {}; at the ends the torus is a circle",
                number(x)
            );
            return Err(Invalid::new(format!("{path}.{key}"), message));
        }
        check_length(&format!("{path}.{key}"), x)
    };
    match (spec.at, spec.range, spec.count) {
        (at, None, None) => Ok(vec![check("at", at.unwrap_or(if hopf { 45.0 } else { 0.0 }))?]),
        (None, Some([first, last]), Some(count)) => {
            check("range[0]", first)?;
            check("range[1]", last)?;
            if !(2..=MOST).contains(&count) {
                let message = format!("expected 2 to {MOST} slices, found {count}; for one, say `at` instead");
                return Err(Invalid::new(format!("{path}.count"), message));
            }
            if first == last {
                let message = format!("the range begins and ends at {}; for one slice, say `at`", number(first));
                return Err(Invalid::new(format!("{path}.range"), message));
            }
            let steps = (count - 1) as f64;
            let at = |i: u64| if i == count - 1 { last } else { first + (last - first) * i as f64 / steps };
            Ok((0..count).map(at).collect())
        }
        (Some(_), _, _) => {
            let message = "`at` is for one slice, `range` and `count` for several; take one of them out";
            Err(Invalid::new(format!("{path}.at"), message))
        }
        (None, Some(_), None) => {
            Err(Invalid::new(format!("{path}.range"), "a range needs the number of its slices: add `count`"))
        }
        (None, None, Some(_)) => {
            Err(Invalid::new(format!("{path}.count"), "so many slices need a `range: [FIRST, LAST]`"))
        }
    }
}
