//! How a render is lit: `lights`, `ambient`, `sky`, `bounce`, `specular`, `shininess` and `depth_cue`, checked and filled in.
//!
//! A render with none of these keys isn't lit: it shows colour times ambient occlusion, as it is.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::Invalid;
use super::camera::check_vector;
use super::range::check_length;
use crate::geometry::{Dimension, Vector64};
use crate::render::tone::to_linear;
use crate::render::{DepthCue, Light, Lighting, Skylight, Source};
use crate::scene::Color;
use crate::session::Session;
use crate::text::number;

/// The most lights of a render.
const MOST_LIGHTS: usize = 256;
/// The largest strength of a light.
const STRONGEST: f64 = 1e12;
/// The ambient light beside lights, and without.
const AMBIENT: [f64; 2] = [0.3, 1.0];
/// The exponent of highlights, unless it is said otherwise.
const SHININESS: f64 = 30.0;

/// A light: one far away has a `direction`, one at a point a `position`.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct LightSpec {
    /// The direction in which the light of a far lamp goes, as that of the sun; of any length.
    pub direction: Option<Vec<f64>>,
    /// Where the lamp is. Its light falls off with the distance r as 1/r^2 in 3D and as 1/r^3 in 4D.
    pub position: Option<Vec<f64>>,
    /// Its colour (default 1, white).
    pub color: Option<Color>,
    /// Its strength, of a lamp at a position that at distance 1 (default 1): 1 shows a white surface that faces the light as
    /// white.
    #[schemars(range(min = 0))]
    pub intensity: Option<f64>,
}

/// A sky that is not equally bright on all sides.
#[derive(Clone, Debug, Deserialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct SkySpec {
    /// Where the sky is brighter, and by how much: from the direction w comes the light 1 + gradient . w, times `ambient`. At
    /// most of length 1, with which the opposite side is black.
    pub gradient: Vec<f64>,
}

/// What is far from the eye takes on a colour, evenly from one distance to another.
#[derive(Clone, Debug, Deserialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct DepthCueSpec {
    /// Up to this distance nothing changes.
    pub near: f64,
    /// From this distance on only the colour is left; more than `near`.
    pub far: f64,
    /// The colour (default 1, the white of the background).
    pub color: Option<Color>,
}

/// The keys of a render that say how it is lit.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LightingKeys<'s> {
    pub lights: Option<&'s [LightSpec]>,
    pub ambient: Option<f64>,
    pub sky: Option<&'s SkySpec>,
    pub bounce: Option<u64>,
    pub specular: Option<f64>,
    pub shininess: Option<f64>,
    pub depth_cue: Option<&'s DepthCueSpec>,
    /// Whether objects of the scene have highlights of their own.
    pub is_glossy: bool,
}

/// What light from the sky and from other surfaces a picture needs.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightAsked<'a> {
    /// How it is lit, if it is.
    pub lighting: Option<&'a LightingPlan>,
    /// Whether it matters where the sky is open.
    pub directions: bool,
    /// Whether other surfaces send light.
    pub bounce: bool,
    /// Whether each voxel looks for itself.
    pub at_voxels: bool,
}

/// How a render is lit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LightingPlan {
    /// The lights.
    pub lights: Vec<LightPlan>,
    /// The ambient light where all is open.
    pub ambient: f64,
    /// The sky's gradient, one number a dimension; none if it shines on all sides alike.
    pub sky: Option<Vec<f64>>,
    /// Whether the light of other surfaces is added, once reflected.
    pub bounce: bool,
    /// The share of lights that is reflected in highlights.
    pub specular: f64,
    /// The exponent of highlights.
    pub shininess: f64,
    /// What distance does, if anything.
    pub depth_cue: Option<DepthCuePlan>,
}

/// A light.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LightPlan {
    /// Whether it is at a point, or far away.
    pub kind: LightKind,
    /// Where it is, or in which direction its light goes.
    pub vector: Vec<f64>,
    /// Its colour as a screen shows it.
    pub color: [f32; 3],
    /// Its strength.
    pub intensity: f64,
}

/// Where light comes from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LightKind {
    /// From far away.
    Direction,
    /// From a point.
    Position,
}

/// What distance does.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DepthCuePlan {
    /// Up to this distance nothing.
    pub near: f64,
    /// From this distance on only the colour is left.
    pub far: f64,
    /// The colour as a screen shows it.
    pub color: [f32; 3],
}

/// How the render at `path` is lit, if it is.
pub(super) fn plan(
    keys: LightingKeys,
    path: &str,
    dimension: Dimension,
    warnings: &mut Vec<Invalid>,
) -> Result<Option<LightingPlan>, Invalid> {
    let given = keys.lights.unwrap_or_default();
    let mut lights = Vec::new();
    for (i, light) in given.iter().enumerate() {
        let place = format!("{path}.lights[{i}]");
        if i == MOST_LIGHTS {
            let message = format!("expected at most {MOST_LIGHTS} lights, found {}", given.len());
            return Err(Invalid::new(format!("{path}.lights"), message));
        }
        lights.push(light_plan(light, &place, dimension)?);
    }
    let [beside_lights, without] = AMBIENT;
    let ambient = if lights.is_empty() { without } else { beside_lights };
    let ambient = within(&format!("{path}.ambient"), keys.ambient, ambient, 0.0, 1e6)?;
    let sky = keys.sky.map(|sky| gradient(sky, &format!("{path}.sky.gradient"), dimension)).transpose()?;
    let bounce = bounce(keys.bounce, path)?;
    let specular = within(&format!("{path}.specular"), keys.specular, 0.0, 0.0, 1.0)?;
    let shininess = within(&format!("{path}.shininess"), keys.shininess, SHININESS, 1.0, 1e6)?;
    let depth_cue = keys.depth_cue.map(|cue| depth_cue(cue, &format!("{path}.depth_cue"))).transpose()?;
    let is_glossy = specular > 0.0 || keys.is_glossy;
    let mut unused = |key: &str, message: &str| warnings.push(Invalid::new(format!("{path}.{key}"), message));
    if keys.lights.is_some() && lights.is_empty() {
        unused("lights", "has no light; without any, leave the key out");
    }
    if keys.specular.is_some() && lights.is_empty() {
        unused("specular", "has no effect without `lights`: ambient light makes no highlights");
    }
    if keys.shininess.is_some() && (lights.is_empty() || !is_glossy) {
        unused("shininess", "has no effect without `lights` and `specular`");
    }
    let is_lit = !lights.is_empty() || keys.ambient.is_some() || depth_cue.is_some() || sky.is_some() || bounce;
    Ok(is_lit.then_some(LightingPlan { lights, ambient, sky, bounce, specular, shininess, depth_cue }))
}

/// Whether the light of other surfaces is followed.
pub(super) fn bounce(given: Option<u64>, path: &str) -> Result<bool, Invalid> {
    match given {
        None | Some(0) => Ok(false),
        Some(1) => Ok(true),
        Some(n) => {
            let message = format!("expected 0 or 1, found {n}: light is followed over one reflection, not over more");
            Err(Invalid::new(format!("{path}.bounce"), message))
        }
    }
}

/// A sky's gradient, checked.
pub(super) fn gradient(spec: &SkySpec, path: &str, dimension: Dimension) -> Result<Vec<f64>, Invalid> {
    let gradient = check_vector(path, &spec.gradient, dimension.get())?;
    let length = gradient.iter().map(|x| x * x).sum::<f64>().sqrt();
    // As near as rounding of what is written.
    if length > 1.0 + 1e-9 {
        let found = number((length * 1e3).round() / 1e3);
        let message = format!(
            "expected a vector of length 1 at most, found one of length {found}: the darkest side of the sky would be \
             darker than black; make it shorter, and `ambient` larger if the picture is to be brighter"
        );
        return Err(Invalid::new(path, message));
    }
    Ok(gradient)
}

fn light_plan(spec: &LightSpec, path: &str, dimension: Dimension) -> Result<LightPlan, Invalid> {
    let (kind, key, given) = match (&spec.direction, &spec.position) {
        (Some(direction), None) => (LightKind::Direction, "direction", direction),
        (None, Some(position)) => (LightKind::Position, "position", position),
        (given, _) => {
            let message = if given.is_some() {
                "a light has a `direction` or a `position`, not both; make it two lights"
            } else {
                "a light needs a `direction`, in which it shines from far away, or a `position`"
            };
            return Err(Invalid::new(path, message));
        }
    };
    let vector = check_vector(&format!("{path}.{key}"), given, dimension.get())?;
    if kind == LightKind::Direction && vector.iter().all(|&x| x == 0.0) {
        let message = "the direction is zero, so the light goes nowhere; write where it shines to, such as";
        let down: Vec<&str> = (0..dimension.get()).map(|axis| if axis == 1 { "-1" } else { "0" }).collect();
        return Err(Invalid::new(format!("{path}.{key}"), format!("{message} [{}] for down", down.join(", "))));
    }
    let intensity = within(&format!("{path}.intensity"), spec.intensity, 1.0, 0.0, STRONGEST)?;
    Ok(LightPlan { kind, vector, color: color(path, spec.color.as_ref())?, intensity })
}

fn depth_cue(spec: &DepthCueSpec, path: &str) -> Result<DepthCuePlan, Invalid> {
    let near = within(&format!("{path}.near"), Some(spec.near), 0.0, 0.0, f64::MAX)?;
    let far = check_length(&format!("{path}.far"), spec.far)?;
    if far <= near {
        let message = format!("expected a distance above `near` ({}), found {}", number(near), number(far));
        return Err(Invalid::new(format!("{path}.far"), message));
    }
    Ok(DepthCuePlan { near, far, color: color(path, spec.color.as_ref())? })
}

/// A colour, white by default.
fn color(path: &str, given: Option<&Color>) -> Result<[f32; 3], Invalid> {
    let refuse = |error: crate::scene::Error| {
        let message = error.to_string();
        Invalid::new(format!("{path}.color"), message.strip_prefix("color: ").unwrap_or(&message).to_owned())
    };
    given.map_or(Ok([1.0; 3]), |color| color.rgb().map_err(refuse))
}

fn within(path: &str, given: Option<f64>, default: f64, least: f64, most: f64) -> Result<f64, Invalid> {
    match given {
        None => Ok(default),
        Some(x) if x.is_finite() && (least..=most).contains(&x) => Ok(x),
        Some(x) if most == f64::MAX => {
            Err(Invalid::new(path, format!("expected a number from {} on, found {}", number(least), number(x))))
        }
        Some(x) => {
            let [least, most, x] = [least, most, x].map(number);
            Err(Invalid::new(path, format!("expected a number from {least} to {most}, found {x}")))
        }
    }
}

impl LightingPlan {
    /// The lighting itself.
    pub fn lighting<const D: usize>(&self) -> Lighting<D> {
        let linear = |color: [f32; 3]| color.map(|c| to_linear(f64::from(c)));
        let light = |light: &LightPlan| {
            let vector = Vector64::<D>::from_fn(|r, _| light.vector[r]);
            let source = match light.kind {
                LightKind::Direction => Source::Directional(vector),
                LightKind::Position => Source::Point(vector),
            };
            Light { source, strength: linear(light.color).map(|c| c * light.intensity) }
        };
        let mut lighting = Lighting::new(self.lights.iter().map(light).collect(), self.ambient);
        (lighting.specular, lighting.shininess) = (self.specular, self.shininess);
        let cue = |cue: &DepthCuePlan| DepthCue { near: cue.near, far: cue.far, color: linear(cue.color) };
        lighting.depth_cue = self.depth_cue.as_ref().map(cue);
        lighting
    }

    /// The sky's gradient.
    pub fn gradient<const D: usize>(&self) -> Vector64<D> {
        self.sky.as_ref().map_or_else(Vector64::zeros, |gradient| Vector64::from_fn(|r, _| gradient[r]))
    }

    /// As it is written in a pipeline, nothing left out that has an effect.
    pub(super) fn written(&self) -> Map<String, Value> {
        let light = |light: &LightPlan| {
            let key = match light.kind {
                LightKind::Direction => "direction",
                LightKind::Position => "position",
            };
            serde_json::json!({ key: light.vector, "color": light.color, "intensity": light.intensity })
        };
        let mut written = Map::from_iter([("ambient".to_owned(), self.ambient.into())]);
        if let Some(gradient) = &self.sky {
            written.insert("sky".to_owned(), serde_json::json!({ "gradient": gradient }));
        }
        if self.bounce {
            written.insert("bounce".to_owned(), 1.into());
        }
        if !self.lights.is_empty() {
            written.insert("lights".to_owned(), self.lights.iter().map(light).collect());
            written.insert("specular".to_owned(), self.specular.into());
            // Objects may have highlights that follow it.
            if self.specular > 0.0 || self.shininess != SHININESS {
                written.insert("shininess".to_owned(), self.shininess.into());
            }
        }
        if let Some(cue) = &self.depth_cue {
            written.insert("depth_cue".to_owned(), serde_json::json!(cue));
        }
        written
    }
}

/// What to tell of lights that reached nothing.
pub(super) fn in_vain<const D: usize>(lighting: &Lighting<D>) -> Vec<String> {
    let mut notes = Vec::new();
    for i in lighting.in_vain() {
        let light = &lighting.lights()[i];
        let why = match light.source {
            _ if light.strength == [0.0; 3] => "its intensity or its color is 0",
            Source::Point(_) => "it is inside a body or behind one, or what is seen turns its back to it",
            Source::Directional(_) => "what is seen turns its back to it, or lies in the shadow of something",
        };
        notes.push(format!("lights[{i}] reaches nothing that is seen: {why}"));
    }
    notes
}

/// What was found of the light of the sky and of other surfaces for a picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightFound {
    /// Rays that met other surfaces.
    pub hits: u64,
    /// How many of them met one from behind.
    pub behind: u64,
    /// Whether the processor traced them although OpenCL devices trace the others.
    beside_opencl: bool,
}

impl LightFound {
    pub fn new<const D: usize>(light: &Skylight<D>, session: &Session<D>) -> Self {
        let (hits, behind) = light.seen();
        Self { hits, behind, beside_opencl: session.is_on_opencl() && light.in_image.is_none() }
    }

    /// What to tell of it; `rays` says how many meet surfaces from behind.
    pub fn notes(&self, rays: &str) -> Vec<String> {
        let behind = || {
            format!(
                "{rays} that look for light of other surfaces see one from behind, and were told the light of its front; turn \
                 that object by `orientation`, or close it"
            )
        };
        let beside = || {
            "open directions and the light of other surfaces were traced on the processor, as OpenCL devices tell whether \
             rays hit something, not what"
                .to_owned()
        };
        (self.behind > 0).then(behind).into_iter().chain(self.beside_opencl.then(beside)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::render::RenderSpec;

    fn lighting(keys: &str, dimension: u64) -> Result<(Option<LightingPlan>, Vec<String>), String> {
        let yaml = format!("dimensions: [1, 1]\n{keys}\n");
        let document = crate::pipeline::Document::parse("r.yaml", &yaml).unwrap();
        let spec: RenderSpec = document.decode().map_err(|e| e.to_string())?;
        let mut warnings = Vec::new();
        let keys = spec.lighting_keys();
        let plan = plan(keys, "render", Dimension::new(dimension).unwrap(), &mut warnings);
        Ok((plan.map_err(|e| e.to_string())?, warnings.iter().map(ToString::to_string).collect()))
    }

    #[test]
    fn defaults_and_warnings() {
        assert_eq!(lighting("", 4).unwrap(), (None, vec![]));
        let (plan, _) = lighting("lights: [{direction: [0, -1, 0]}]", 3).unwrap();
        let plan = plan.unwrap();
        assert_eq!((plan.ambient, plan.specular, plan.lights[0].color), (0.3, 0.0, [1.0; 3]));
        let (plan, warnings) =
            lighting("depth_cue: {near: 1, far: 2}\nspecular: 0.5\nshininess: 3\nlights: []", 4).unwrap();
        assert_eq!(plan.unwrap().ambient, 1.0);
        assert_eq!(warnings.len(), 3, "{warnings:?}");
        assert_eq!(lighting("bounce: 0", 3).unwrap(), (None, vec![]));
        let plan = lighting("bounce: 1\nsky: {gradient: [0, 1, 0]}", 3).unwrap().0.unwrap();
        assert!(plan.bounce && plan.ambient == 1.0 && plan.gradient::<3>().as_slice() == [0.0, 1.0, 0.0]);
    }

    #[test]
    fn refusals() {
        for (keys, message) in [
            (
                "lights: [{}]",
                "render.lights[0]: a light needs a `direction`, in which it shines from far away, or a `position`",
            ),
            (
                "lights: [{direction: [0, 1, 0, 0], position: [0, 0, 0, 1]}]",
                "render.lights[0]: a light has a `direction` or a `position`, not both; make it two lights",
            ),
            (
                "lights: [{direction: [0, 1, 0]}]",
                "render.lights[0].direction: expected 4 numbers (the scene is 4D), found 3",
            ),
            (
                "lights: [{direction: [0, 0, 0, 0]}]",
                "render.lights[0].direction: the direction is zero, so the light goes nowhere; write where it shines to, such as [0, -1, 0, 0] for down",
            ),
            (
                "lights: [{position: [0, 0, 0, 1], intensity: -1}]",
                "render.lights[0].intensity: expected a number from 0 to 1e12, found -1",
            ),
            ("lights: [{position: [0, 0, 0, 1], color: -0.5}]", "render.lights[0].color: -0.5 is not from 0 to 1"),
            ("sky: {gradient: [0, 1, 0]}", "render.sky.gradient: expected 4 numbers (the scene is 4D), found 3"),
            (
                "sky: {gradient: [0, 1, 0, 0.5]}",
                "render.sky.gradient: expected a vector of length 1 at most, found one of length 1.118: the darkest side of the \
                 sky would be darker than black; make it shorter, and `ambient` larger if the picture is to be brighter",
            ),
            (
                "bounce: 2",
                "render.bounce: expected 0 or 1, found 2: light is followed over one reflection, not over more",
            ),
            ("ambient: -1", "render.ambient: expected a number from 0 to 1000000, found -1"),
            ("specular: 2", "render.specular: expected a number from 0 to 1, found 2"),
            ("shininess: 0", "render.shininess: expected a number from 1 to 1000000, found 0"),
            ("depth_cue: {near: -1, far: 2}", "render.depth_cue.near: expected a number from 0 on, found -1"),
            ("depth_cue: {near: 2, far: 2}", "render.depth_cue.far: expected a distance above `near` (2), found 2"),
            (
                "depth_cue: {near: 0, far: 1e13}",
                "render.depth_cue.far: expected a number of size up to 1e12, found 1e13",
            ),
        ] {
            assert_eq!(lighting(keys, 4).unwrap_err(), message);
        }
        let many = format!("lights: [{}]", vec!["{direction: [1, 0, 0, 0]}"; 257].join(", "));
        assert_eq!(lighting(&many, 4).unwrap_err(), "render.lights: expected at most 256 lights, found 257");
    }
}
