//! `camera: fit`: from where a scene just fits its image.
//!
//! Let the camera's frame be given (right, up, over, back) and m_a half the extent of the image along its axis a, at distance
//! 1 before the eye. A point with the coordinates u_a and d = back . p is in the image of a perspective camera at (e_a, e_d)
//! where |u_a - e_a| <= m_a (e_d - d), which is
//!
//! ```text
//!  e_a + m_a e_d >= S+ = max(u_a + m_a d)
//! -e_a + m_a e_d >= S- = max(-u_a + m_a d)
//! ```
//!
//! So the nearest eye has e_d = max over the axes of (S+ + S-) / 2 m_a, and e_a = (S+ - S-) / 2 in the middle of what is
//! left: a closed form over the vertices, the same bits on every run. In a parallel projection the extents themselves
//! are what the height must cover. Where a turn moves the eye or the scene, all that may come into sight lies in the ball around the
//! middle, and that is fitted instead.

use super::animate::AnimatePlan;
use super::camera::{self, CameraPlan, ProjectionPlan};
use super::render::RenderPlan;
use super::scene::{Bodies, ScenePlan};
use super::{Invalid, Plan, Ref};
use crate::geometry::{Dimension, Vector64};
use crate::mesh::Mesh;
use crate::progress::Progress;

/// A render whose camera was placed by its scene.
pub(crate) struct Fitted {
    /// Where the camera is written: `stages[2].render.camera`.
    pub path: String,
    /// As it would have been written.
    pub camera: serde_json::Value,
}

impl Plan {
    /// Places the cameras that are to fit their scenes: those that are `known`, or else they are built for that. Twins take
    /// those of the stages they belong to.
    ///
    /// # Errors
    /// Whatever is wrong with an object or a file; a scene with nothing in it.
    pub(crate) fn fit(&self, known: Vec<Points>, progress: &dyn Progress) -> Result<Vec<Fitted>, Invalid> {
        let mut scenes: Vec<Option<Points>> = known.into_iter().map(Some).collect();
        scenes.resize_with(scenes.len().max(self.all::<ScenePlan>().count()), || None);
        let mut found = Vec::new();
        for (me, render) in self.all::<RenderPlan>().filter(|(me, _)| !self.is_twin(me.index())) {
            let Some(margin) = render.camera.fit else { continue };
            let scene = &mut scenes[render.scene.nth()];
            let points = match scene {
                Some(points) => points,
                None => scene.insert(Points::of(self, render.scene, progress)?),
            };
            let turns = self.all::<AnimatePlan>().any(|(_, a)| a.render == me && a.path.plane.is_some());
            let path = format!("{}.camera", self.path(me));
            let shape = Image { dimensions: render.dimensions, margin, turns };
            let camera = match points {
                Points::Three(points) => fitted(&render.camera, points, &shape),
                Points::Four(points) => fitted(&render.camera, points, &shape),
            };
            let camera = camera.map_err(|message| Invalid::new(&path, message))?;
            found.push(Fitted { path, camera: camera.written() });
        }
        Ok(found)
    }
}

/// The vertices of a scene that simplices use.
pub(crate) enum Points {
    Three(Vec<Vector64<3>>),
    Four(Vec<Vector64<4>>),
}

impl Points {
    /// Those of a mesh.
    pub(crate) fn of_mesh<const D: usize>(mesh: &Mesh<D>) -> Self {
        let mut used = vec![false; mesh.vertices.len()];
        mesh.simplices.iter().flatten().for_each(|&v| used[v as usize] = true);
        let points = mesh.vertices.iter().zip(&used).filter(|(_, used)| **used).map(|(point, _)| point);
        match Dimension::of::<D>() {
            Dimension::Three => Self::Three(points.map(|p| Vector64::from_fn(|r, _| p[r].into())).collect()),
            Dimension::Four => Self::Four(points.map(|p| Vector64::from_fn(|r, _| p[r].into())).collect()),
        }
    }

    fn of(plan: &Plan, scene: Ref<ScenePlan>, progress: &dyn Progress) -> Result<Self, Invalid> {
        Ok(match plan[scene].dimension {
            Dimension::Three => Self::Three(Bodies::build(plan, scene, progress)?.used_points()),
            Dimension::Four => Self::Four(Bodies::build(plan, scene, progress)?.used_points()),
        })
    }
}

/// What a scene is fitted into.
struct Image {
    dimensions: [usize; 3],
    /// The share that stays empty.
    margin: f64,
    /// Whether the scene turns, or the eye around it.
    turns: bool,
}

/// The camera from which the points fit the image.
fn fitted<const D: usize>(asked: &CameraPlan, points: &[Vector64<D>], image: &Image) -> Result<CameraPlan, String> {
    if points.is_empty() {
        return Err(
            "there is nothing in the scene that could fit the image; add an object, or say where the eye is".into()
        );
    }
    // Its own frame may be had without knowing where it is.
    let frame = camera::camera::<D>(asked).map_err(|e| e.to_string())?.axes();
    let (across, back) = (&frame[..D - 1], &frame[D - 1]);
    let range = |axis: &Vector64<D>| {
        let along = points.iter().map(|p| axis.dot(p));
        along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
    };
    let ranges: Vec<[f64; 2]> = across.iter().map(range).collect();
    let [near, far] = {
        let [low, high] = range(back);
        [high, low]
    };
    let middle: Vec<f64> = ranges.iter().map(|[low, high]| 0.5 * (low + high)).collect();
    let depth = 0.5 * (near + far);
    let centre = compose(&frame, &middle, depth);
    let radius = points.iter().map(|p| (p - centre).norm()).fold(0.0, f64::max);
    if !radius.is_finite() {
        return Err("the scene is too large to be fitted into an image".into());
    }
    // A scene that is a single point is seen from the distance 1.
    let least = if radius > 0.0 { 0.01 * radius } else { 1.0 };
    // Half the image's extent along an axis, where half its height is 1.
    let wide = image.dimensions[0] as f64 / image.dimensions[1] as f64;
    let share = |axis: usize| (1.0 - image.margin) * if axis == 0 { wide } else { 1.0 };
    let (eye, projection) = match asked.projection {
        ProjectionPlan::Parallel { .. } => {
            let half = |axis: usize| if image.turns { radius } else { 0.5 * (ranges[axis][1] - ranges[axis][0]) };
            let height = (0..D - 1).map(|axis| 2.0 * half(axis) / share(axis)).fold(0.0, f64::max);
            let height = if height > 0.0 { height } else { 2.0 * least };
            let before = if image.turns { depth + radius } else { near };
            (compose(&frame, &middle, before + least.max(0.5 * radius)), ProjectionPlan::Parallel { height })
        }
        ProjectionPlan::Perspective { field_of_view } => {
            let half = libm::tan(field_of_view.to_radians() / 2.0);
            let m: Vec<f64> = (0..D - 1).map(|axis| half * share(axis)).collect();
            let eye = if image.turns {
                // A ball of radius r at distance d is seen within the sine r / d.
                let distance = m.iter().map(|m| radius * (1.0 + m * m).sqrt() / m).fold(radius + least, f64::max);
                compose(&frame, &middle, depth + distance)
            } else {
                let largest = |f: &dyn Fn(&Vector64<D>) -> f64| points.iter().map(f).fold(f64::NEG_INFINITY, f64::max);
                let bounds: Vec<[f64; 2]> = (0..D - 1)
                    .map(|a| [1.0, -1.0].map(|s| largest(&|p| s * across[a].dot(p) + m[a] * back.dot(p))))
                    .collect();
                let distance = bounds.iter().zip(&m).map(|([plus, minus], m)| (plus + minus) / (2.0 * m));
                let distance = distance.fold(near + least, f64::max);
                let sideways: Vec<f64> = bounds.iter().map(|[plus, minus]| 0.5 * (plus - minus)).collect();
                compose(&frame, &sideways, distance)
            };
            (eye, ProjectionPlan::Perspective { field_of_view })
        }
    };
    let distance = back.dot(&(eye - centre));
    let target = eye - back * distance;
    // Digits that no image could show would only be noise to a reader.
    let size = distance.max(radius);
    let short = |v: Vector64<D>| v.iter().map(|&x| rounded(x, size)).collect::<Vec<_>>();
    let projection = match projection {
        ProjectionPlan::Parallel { height } => ProjectionPlan::Parallel { height: rounded(height, height) },
        other => other,
    };
    Ok(CameraPlan { projection, eye: short(eye), target: short(target), fit: None, ..asked.clone() })
}

/// The point with these coordinates along the axes of a frame, the last of which is `back`.
fn compose<const D: usize>(frame: &[Vector64<D>; D], across: &[f64], back: f64) -> Vector64<D> {
    let sum = frame.iter().zip(across).fold(Vector64::zeros(), |sum, (axis, x)| sum + axis * *x);
    sum + frame[D - 1] * back
}

/// A number to a hundred-thousandth of a size.
fn rounded(x: f64, size: f64) -> f64 {
    let places = (5.0 - libm::log10(size).floor()).clamp(0.0, 30.0) as usize;
    // Through text, so that what is written is what is meant. No negative zero.
    format!("{x:.places$}").parse::<f64>().map_or(x, |x| x + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::narrow;
    use crate::stages::camera::CameraSpec;

    /// Where the points come to lie, as shares of half the image along each axis: the largest of each axis.
    fn reach<const D: usize>(spec: &CameraSpec, points: &[Vector64<D>], image: &Image) -> Vec<f64> {
        let dimension = Dimension::of::<D>();
        let asked = camera::plan(spec, "camera", dimension, &mut Vec::new()).unwrap();
        let found = fitted(&asked, points, image).unwrap();
        let camera = camera::camera::<D>(&found).unwrap();
        let grid = camera.grid(image.dimensions);
        let half: Vec<f64> = (0..D - 1).map(|a| 0.5 * grid.spacing[a] * grid.dimensions[a] as f64).collect();
        let mut most = vec![0.0f64; D - 1];
        for point in points {
            let (at, distance) = camera.project(&narrow(point));
            assert!(distance > 0.0, "{found:?}");
            (0..D - 1).for_each(|a| most[a] = most[a].max(at[a].abs() / half[a]));
        }
        most
    }

    /// A lopsided cloud, far from the origin, in millimetres.
    fn cloud<const D: usize>() -> Vec<Vector64<D>> {
        (0..200)
            .map(|i| {
                Vector64::from_fn(|r, _| {
                    let x = f64::from(i * 7919 % 1009 * [31, 17, 53, 71][r] % 997) / 997.0;
                    [350.0, -40.0, 12.0, 5.0][r] + [90.0, 20.0, 55.0, 35.0][r] * x * x
                })
            })
            .collect()
    }

    fn fits<const D: usize>() {
        let points = cloud::<D>();
        let eyes = [vec![0.0, 0.0, 0.0, 1.0], vec![1.0, 2.0, -0.5, 3.0]];
        let dimensions = [[40, 40, 40], [90, 30, 30], [20, 60, 60]];
        for (eye, dimensions) in eyes.iter().flat_map(|eye| dimensions.map(|d| (eye, d))) {
            for projection in [camera::Projection::Perspective, camera::Projection::Parallel] {
                for (field_of_view, margin) in [(90.0, 0.05), (30.0, 0.0), (150.0, 0.5)] {
                    let spec = CameraSpec {
                        projection: Some(projection),
                        eye: Some(eye[4 - D..].to_vec()),
                        field_of_view: Some(field_of_view),
                        fit: Some(true),
                        margin: Some(margin),
                        ..CameraSpec::default()
                    };
                    let image = Image { dimensions, margin, turns: false };
                    let reach = reach(&spec, &points, &image);
                    let most = reach.iter().copied().fold(0.0, f64::max);
                    assert!((most - (1.0 - margin)).abs() < 1e-3, "{spec:?} {dimensions:?}: {reach:?}");
                }
            }
        }
    }

    #[test]
    fn the_scene_touches_the_margin_and_no_more() {
        fits::<3>();
        fits::<4>();
    }

    #[test]
    fn a_turning_scene_fits_at_every_angle() {
        let points = cloud::<4>();
        let middle = |r: usize| {
            let along = || points.iter().map(|p| p[r]);
            0.5 * (along().fold(f64::INFINITY, f64::min) + along().fold(f64::NEG_INFINITY, f64::max))
        };
        let image = Image { dimensions: [50, 50, 50], margin: 0.05, turns: true };
        let spec = CameraSpec { fit: Some(true), ..CameraSpec::default() };
        let asked = camera::plan(&spec, "camera", Dimension::Four, &mut Vec::new()).unwrap();
        let found = fitted(&asked, &points, &image).unwrap();
        assert!((0..4).all(|r| (found.target[r] - middle(r)).abs() < 1e-2), "{found:?}");
        let mut most = 0.0f64;
        for step in 0..60 {
            let (sin, cos) = libm::sincos(f64::from(step) * std::f64::consts::TAU / 60.0);
            let turned = points.iter().map(|p| {
                let q = Vector64::<4>::from_fn(|r, _| p[r] - middle(r));
                let (x, w) = (q[0] * cos - q[3] * sin, q[0] * sin + q[3] * cos);
                Vector64::<4>::from([middle(0) + x, p[1], p[2], middle(3) + w])
            });
            let camera = camera::camera::<4>(&found).unwrap();
            for point in turned {
                let (at, distance) = camera.project(&narrow(&point));
                assert!(distance > 0.0);
                most = at.iter().fold(most, |most, x| most.max(x.abs()));
            }
        }
        assert!(most < 0.951 && most > 0.6, "{most}");
    }

    #[test]
    fn scenes_of_no_extent() {
        let image = Image { dimensions: [9, 9, 9], margin: 0.05, turns: false };
        let asked = camera::plan(&CameraSpec::default(), "camera", Dimension::Four, &mut Vec::new()).unwrap();
        let point = Vector64::<4>::from([3.0, 2.0, 1.0, 7.0]);
        let found = fitted(&asked, &[point], &image).unwrap();
        assert_eq!((found.eye, found.target), (vec![3.0, 2.0, 1.0, 8.0], vec![3.0, 2.0, 1.0, 7.0]));
        assert!(fitted::<4>(&asked, &[], &image).unwrap_err().contains("nothing in the scene"));
    }
}
