//! The path of an animation: what is written of it, where it is at each frame, and what that does to a camera or an object.
//!
//! A motion turns by an angle about a centre and then moves on by a displacement,
//!
//! ```text
//! p -> R (p - c) + c + s
//! ```
//!
//! An eye that moves takes its target with it. That all objects move is the same as that the eye, and the lights, move the
//! other way: `Motion::undone`. Nothing is computed where the angle or the displacement is zero, so that such a frame is
//! the picture itself, bit for bit.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::geometry::Dimension;
use crate::scene::{RotateSpec, TransformStep, plane_of, sine_cosine};
use crate::stages::Invalid;
use crate::stages::camera::{CameraPlan, check_vector};
use crate::stages::lighting::{LightKind, LightingPlan};
use crate::stages::range::check_length;
use crate::text::number;

/// The largest angle, in degrees: a thousand turns.
const MOST_DEGREES: f64 = 360_000.0;

/// A turn in a plane.
#[derive(Clone, Debug, Deserialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct TurnSpec {
    /// Two axes, such as `xw`: the first is turned towards the second.
    pub plane: String,
    /// The angle at the first frame, in degrees (default 0).
    pub from: Option<f64>,
    /// The angle at the last frame, in degrees (default 360). After whole turns there is one step more to it, so that a film
    /// that is played again and again does not halt at the frame where it begins.
    pub to: Option<f64>,
    /// The point that stays where it is (default what the camera looks at).
    pub center: Option<Vec<f64>>,
}

/// A motion along a line.
#[derive(Clone, Debug, Deserialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct MoveSpec {
    /// How far it is moved at the first frame, one number an axis (default not at all).
    pub from: Option<Vec<f64>>,
    /// How far at the last frame.
    pub to: Vec<f64>,
}

/// A path, as understood.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PathPlan {
    /// The axes of the plane of its turn, the first turned towards the second.
    pub plane: Option<[usize; 2]>,
    /// The point that stays where it is.
    pub center: Vec<f64>,
    /// The angles at the first and the last frame, in degrees.
    pub degrees: [f64; 2],
    /// The displacements at the first and the last frame.
    pub shift: [Vec<f64>; 2],
}

/// What a stage says of a path.
pub(super) struct PathKeys<'s> {
    pub turn: Option<&'s TurnSpec>,
    pub r#move: Option<&'s MoveSpec>,
    pub scan: Option<[f64; 2]>,
}

/// Where a path is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Motion {
    /// The axes of the plane of its turn.
    pub plane: Option<[usize; 2]>,
    /// The point that stays where it is.
    pub center: Vec<f64>,
    /// The angle in degrees.
    pub degrees: f64,
    /// The displacement.
    pub shift: Vec<f64>,
}

impl PathPlan {
    /// Checks what is written at `path`; `target` is what the camera looks at.
    pub(super) fn new(
        keys: &PathKeys,
        path: &str,
        dimension: Dimension,
        target: &[f64],
        warnings: &mut Vec<Invalid>,
    ) -> Result<Self, Invalid> {
        let count = dimension.get();
        if keys.turn.is_none() && keys.r#move.is_none() && keys.scan.is_none() {
            let message = "nothing moves; give `turn`, `move` or `scan`, such as `turn: {plane: xz}`";
            return Err(Invalid::new(path, message));
        }
        let mut plan = Self {
            plane: None,
            center: target.to_vec(),
            degrees: [0.0; 2],
            shift: [vec![0.0; count], vec![0.0; count]],
        };
        if let Some(turn) = keys.turn {
            let at = format!("{path}.turn");
            plan.plane = Some(plane(&format!("{at}.plane"), &turn.plane, dimension)?);
            plan.degrees = [angle(&format!("{at}.from"), turn.from, 0.0)?, angle(&format!("{at}.to"), turn.to, 360.0)?];
            if let Some(center) = &turn.center {
                plan.center = check_vector(&format!("{at}.center"), center, count)?;
            }
        }
        if let Some(line) = keys.r#move {
            let at = format!("{path}.move");
            if let Some(from) = &line.from {
                plan.shift[0] = check_vector(&format!("{at}.from"), from, count)?;
            }
            plan.shift[1] = check_vector(&format!("{at}.to"), &line.to, count)?;
        }
        if let Some(scan) = keys.scan {
            for (i, x) in scan.into_iter().enumerate() {
                plan.shift[i][count - 1] += check_length(&format!("{path}.scan[{i}]"), x)?;
            }
        }
        if plan.degrees[0] == plan.degrees[1] && plan.shift[0] == plan.shift[1] {
            warnings.push(Invalid::new(path, "the path ends where it begins, so all frames are the same"));
        }
        Ok(plan)
    }

    /// Whether it comes back to where it begins, so that the last frame of all would be the first again.
    pub fn comes_back(&self) -> bool {
        let [from, to] = self.degrees;
        self.shift[0] == self.shift[1] && from != to && (to - from) % 360.0 == 0.0
    }

    /// Where it is at frame `i` of so many.
    pub fn at(&self, i: usize, frames: usize) -> Motion {
        let steps = if self.comes_back() { frames } else { frames.saturating_sub(1) };
        let between = |from: f64, to: f64| match i {
            0 => from,
            // The end is exact.
            _ if i == steps => to,
            _ => from + (to - from) * i as f64 / steps as f64,
        };
        let [from, to] = &self.shift;
        Motion {
            plane: self.plane,
            center: self.center.clone(),
            degrees: between(self.degrees[0], self.degrees[1]),
            shift: from.iter().zip(to).map(|(&from, &to)| between(from, to)).collect(),
        }
    }

    /// It in words.
    pub(super) fn line(&self) -> String {
        let mut words = Vec::new();
        if let Some([a, b]) = self.plane {
            let [from, to] = self.degrees.map(number);
            words.push(format!("turned in {}{} from {from} to {to} degrees", axis(a), axis(b)));
        }
        if self.shift.iter().flatten().any(|&x| x != 0.0) {
            let list = |v: &[f64]| v.iter().map(|&x| number(x)).collect::<Vec<_>>().join(", ");
            words.push(format!("moved from [{}] to [{}]", list(&self.shift[0]), list(&self.shift[1])));
        }
        words.join(" and ")
    }
}

impl Motion {
    /// A camera that is moved, its target with it.
    pub fn camera(&self, camera: &CameraPlan) -> CameraPlan {
        CameraPlan {
            eye: self.point(&camera.eye),
            target: self.point(&camera.target),
            up: self.direction(&camera.up, 1.0),
            over: camera.over.as_ref().map(|over| self.direction(over, 1.0)),
            ..camera.clone()
        }
    }

    /// What a camera sees of a scene that is moved as a whole: what it sees of the scene if it is moved the other way.
    pub fn undone(&self, camera: &CameraPlan) -> CameraPlan {
        CameraPlan {
            eye: self.point_before(&camera.eye),
            target: self.point_before(&camera.target),
            up: self.direction(&camera.up, -1.0),
            over: camera.over.as_ref().map(|over| self.direction(over, -1.0)),
            ..camera.clone()
        }
    }

    /// The same for lights, which stay where they are while the scene moves.
    pub fn undone_lights(&self, lighting: &LightingPlan) -> LightingPlan {
        let mut lighting = lighting.clone();
        for light in &mut lighting.lights {
            light.vector = match light.kind {
                LightKind::Position => self.point_before(&light.vector),
                LightKind::Direction => self.direction(&light.vector, -1.0),
            };
        }
        if let Some(gradient) = &mut lighting.sky {
            *gradient = self.direction(gradient, -1.0);
        }
        lighting
    }

    /// The steps that move an object so.
    pub fn steps(&self) -> Vec<TransformStep> {
        let mut steps = Vec::new();
        if let Some([a, b]) = self.plane.filter(|_| self.degrees != 0.0) {
            let plane = format!("{}{}", axis(a), axis(b));
            let rotate = RotateSpec { plane, degrees: self.degrees, center: Some(self.center.clone()) };
            steps.push(TransformStep { rotate: Some(rotate), ..TransformStep::default() });
        }
        if self.shift.iter().any(|&x| x != 0.0) {
            steps.push(TransformStep { translate: Some(self.shift.clone()), ..TransformStep::default() });
        }
        steps
    }

    fn point(&self, point: &[f64]) -> Vec<f64> {
        self.about_center(point, 1.0).iter().zip(&self.shift).map(|(x, s)| x + s).collect()
    }

    fn point_before(&self, point: &[f64]) -> Vec<f64> {
        let back: Vec<f64> = point.iter().zip(&self.shift).map(|(x, s)| x - s).collect();
        self.about_center(&back, -1.0)
    }

    fn about_center(&self, point: &[f64], sense: f64) -> Vec<f64> {
        if self.plane.is_none() || self.degrees == 0.0 {
            return point.to_vec();
        }
        let from_center: Vec<f64> = point.iter().zip(&self.center).map(|(x, c)| x - c).collect();
        self.direction(&from_center, sense).iter().zip(&self.center).map(|(x, c)| x + c).collect()
    }

    /// A direction that is turned; the other way with `sense` -1.
    fn direction(&self, direction: &[f64], sense: f64) -> Vec<f64> {
        let mut turned = direction.to_vec();
        if let Some([a, b]) = self.plane.filter(|_| self.degrees != 0.0) {
            let (sine, cosine) = sine_cosine(sense * self.degrees);
            turned[a] = cosine * direction[a] - sine * direction[b];
            turned[b] = sine * direction[a] + cosine * direction[b];
        }
        turned
    }
}

/// The axes of the plane of this name.
fn plane(path: &str, name: &str, dimension: Dimension) -> Result<[usize; 2], Invalid> {
    let count = dimension.get();
    if let Some((a, b)) = plane_of(name, count) {
        return Ok([a, b]);
    }
    let planes: Vec<String> = (0..count).flat_map(|b| (0..b).map(move |a| format!("{}{}", axis(a), axis(b)))).collect();
    let message = format!(
        "\"{name}\" is no plane of a {count}D scene; its planes are {}, and with their letters exchanged they turn the other way",
        planes.join(", ")
    );
    Err(Invalid::new(path, message))
}

/// An angle in degrees.
fn angle(path: &str, given: Option<f64>, default: f64) -> Result<f64, Invalid> {
    let degrees = given.unwrap_or(default);
    if degrees.abs() <= MOST_DEGREES {
        return Ok(degrees);
    }
    let message = format!("expected degrees from -{MOST_DEGREES} to {MOST_DEGREES}, found {}", number(degrees));
    Err(Invalid::new(path, message))
}

/// An axis's name.
fn axis(i: usize) -> char {
    ['x', 'y', 'z', 'w'][i]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::camera::{self, CameraSpec};

    fn path(yaml: &str, dimension: u64) -> Result<PathPlan, String> {
        #[derive(Deserialize)]
        struct Keys {
            turn: Option<TurnSpec>,
            r#move: Option<MoveSpec>,
            scan: Option<[f64; 2]>,
        }
        let keys: Keys = crate::pipeline::Document::parse("p.yaml", yaml).unwrap().decode().unwrap();
        let keys = PathKeys { turn: keys.turn.as_ref(), r#move: keys.r#move.as_ref(), scan: keys.scan };
        let dimension = Dimension::new(dimension).unwrap();
        let mut warnings = Vec::new();
        let found = PathPlan::new(&keys, "animate", dimension, &vec![0.5; dimension.get()], &mut warnings);
        assert_eq!(warnings.len(), usize::from(yaml.contains("# ends where it begins")), "{yaml}");
        found.map_err(|e| e.to_string())
    }

    #[test]
    fn a_whole_turn_does_not_repeat_its_first_frame_and_other_paths_reach_their_end() {
        let angles = |yaml: &str, frames: usize| {
            let path = path(yaml, 4).unwrap();
            (0..frames).map(|i| path.at(i, frames).degrees).collect::<Vec<_>>()
        };
        assert_eq!(angles("turn: {plane: xw}", 4), [0.0, 90.0, 180.0, 270.0]);
        assert_eq!(angles("turn: {plane: xw, from: 30, to: -690}", 2), [30.0, -330.0]);
        assert_eq!(angles("turn: {plane: xw, from: -10, to: 20}", 4), [-10.0, 0.0, 10.0, 20.0]);
        assert_eq!(angles("turn: {plane: xw, from: 7}", 1), [7.0]);
        // What moves on meanwhile does not come back.
        assert_eq!(angles("{turn: {plane: xw}, scan: [0, 1]}", 3), [0.0, 180.0, 360.0]);
        let scan = path("{scan: [-0.25, 0.5], move: {to: [3, 0, 0, 0]}}", 4).unwrap();
        assert_eq!(scan.at(0, 4).shift, [0.0, 0.0, 0.0, -0.25]);
        assert_eq!(scan.at(1, 4).shift, [1.0, 0.0, 0.0, 0.0]);
        assert_eq!(scan.at(3, 4).shift, [3.0, 0.0, 0.0, 0.5]);
        assert_eq!(scan.at(0, 1).shift, [0.0, 0.0, 0.0, -0.25]);
        assert!(path("{scan: [1, 1]} # ends where it begins", 3).is_ok());
        assert_eq!(path("{move: {to: [1, 2, 3]}, scan: [0, 4]}", 3).unwrap().at(1, 2).shift, [1.0, 2.0, 7.0]);
    }

    #[test]
    fn what_cannot_be_is_refused_by_name() {
        for (yaml, dimension, message) in [
            ("{}", 4, "animate: nothing moves; give `turn`, `move` or `scan`, such as `turn: {plane: xz}`"),
            (
                "turn: {plane: xw}",
                3,
                "animate.turn.plane: \"xw\" is no plane of a 3D scene; its planes are xy, xz, yz, and with their letters \
                 exchanged they turn the other way",
            ),
            (
                "turn: {plane: xx}",
                4,
                "animate.turn.plane: \"xx\" is no plane of a 4D scene; its planes are xy, xz, yz, xw, yw, zw, and with \
                 their letters exchanged they turn the other way",
            ),
            ("turn: {plane: xy, to: 1e12}", 4, "animate.turn.to: expected degrees from -360000 to 360000, found 1e12"),
            (
                "turn: {plane: xy, center: [0, 0, 0]}",
                4,
                "animate.turn.center: expected 4 numbers (the scene is 4D), found 3",
            ),
            ("move: {to: [0, 0]}", 3, "animate.move.to: expected 3 numbers (the scene is 3D), found 2"),
            ("scan: [0, 1e13]", 3, "animate.scan[1]: expected a number of size up to 1e12, found 1e13"),
        ] {
            assert_eq!(path(yaml, dimension).unwrap_err(), message, "{yaml}");
        }
    }

    #[test]
    fn cameras_and_scenes_move_against_each_other() {
        let spec = CameraSpec { eye: Some(vec![0.0, 0.0, 0.0, 2.0]), ..CameraSpec::default() };
        let camera = camera::plan(&spec, "camera", Dimension::Four, &mut Vec::new()).unwrap();
        let path = path("{turn: {plane: xw, center: [0, 0, 0, 0]}, move: {from: [0, 1, 0, 0], to: [0, 1, 0, 0]}}", 4);
        let path = path.unwrap();
        // A quarter of the way x goes to w, so w to -x.
        let quarter = path.at(1, 4);
        let moved = quarter.camera(&camera);
        assert_eq!((moved.eye, moved.target), (vec![-2.0, 1.0, 0.0, 0.0], vec![0.0, 1.0, 0.0, 0.0]));
        assert_eq!((moved.up, moved.over), (camera.up.clone(), camera.over.clone()));
        let undone = quarter.undone(&camera);
        assert_eq!((undone.eye, undone.target), (vec![2.0, -1.0, 0.0, 0.0], vec![0.0, -1.0, 0.0, 0.0]));
        // There and back again.
        let again = quarter.camera(&quarter.undone(&camera));
        assert_eq!(again, camera);
        // Where nothing has moved yet, no bit is another.
        let odd = CameraPlan { eye: vec![0.1, 1.0 / 3.0, 0.7, 1e-17], ..camera };
        let still = PathPlan { shift: [vec![0.0; 4], vec![1.0; 4]], ..path }.at(0, 4);
        assert_eq!((still.camera(&odd), still.undone(&odd), still.steps()), (odd.clone(), odd, Vec::new()));
    }
}
