//! `shade`: ambient occlusion, and what comes of it, for an image that is there already, of which no scene is known.
//!
//! A `.vti` of whatever program, with the distance from the eye and the normal of what each voxel shows, is written again
//! with `ambient_occlusion`, looked for in screen space ([`crate::render::screen_space`]), and if wanted with where the sky is
//! open and the light of the sky and of other surfaces. The camera is what the image
//! tells itself, as those of `ao4d run` do, or what the pipeline says. An image that tells its camera may have been cut
//! out of a larger one: its grid says where it lies. Of another all is taken to be there, as a render with that camera makes
//! it.

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::camera::{self, CameraPlan, CameraSpec};
use super::describe::{Counts, grouped};
use super::lighting::{self, SkySpec};
use super::piece::Piece;
use super::screen_space::{self, ScreenSpacePlan, ScreenSpaceSpec};
use super::write::{Encoding, PROGRAM, vti as picture};
use super::{Invalid, Keys, LeftOut, Needs, Output, Plan, Ref, Resolver, Run, Stage, StageError, Told};
use crate::geometry::{Dimension, Vector, Vector64, widen};
use crate::io::{self, AtomicFile, PIPELINE, vti, vtk};
use crate::occlusion::Cancelled;
use crate::progress::Progress;
use crate::render::{Aov, DepthImage, Seen, reflectance};
use crate::volume::{Array, Kind, Volume};

/// The arrays that it can add.
const ARRAYS: [Aov; 4] = [Aov::AmbientOcclusion, Aov::BentNormal, Aov::Irradiance, Aov::Bounce];
/// The colour of what has none: that of objects without one.
const GREY: [f32; 3] = [0.8; 3];
/// What images of `ao4d run` tell of how they were made.
const SETTINGS: &str = "settings";

/// Ambient occlusion for an image that is there already.
#[derive(Clone, Debug, Deserialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct ShadeSpec {
    /// A name for later stages to refer to.
    pub id: Option<String>,
    /// The image: a `.vti` with a distance from the eye and a normal for each point, relative to the pipeline's folder.
    pub image: String,
    /// The camera that it was seen by (default: the one that the image tells, if `ao4d` made it).
    pub camera: Option<CameraSpec>,
    /// With `camera`: the dimension of the scene that is shown, 4 (default) or 3.
    #[schemars(range(min = 3, max = 4))]
    pub dimension: Option<u64>,
    /// The array of distances from the eye (default `depth`); a point whose distance is not above 0, or infinite, shows
    /// nothing.
    pub depth: Option<String>,
    /// The array of normals, as many numbers a point as the scene has dimensions (default `normal`).
    pub normal: Option<String>,
    /// How ambient occlusion is looked for.
    pub screen_space: Option<ScreenSpaceSpec>,
    /// What is added: `ambient_occlusion` (default), `bent_normal`, `irradiance`, `bounce`.
    pub arrays: Option<Vec<Aov>>,
    /// The sky, for `irradiance` and `bounce` (default: one that shines on all sides alike).
    pub sky: Option<SkySpec>,
    /// With 1, surfaces are also lit by what other surfaces reflect of the sky, once (default 0).
    #[schemars(range(min = 0, max = 1))]
    pub bounce: Option<u64>,
    /// With `bounce: 1`: the array of colours as a screen shows them, uint8 or numbers from 0 to 1, of which one or the first
    /// three count (default: a light grey of 0.8 everywhere).
    pub albedo: Option<String>,
    /// The file: `NAME.vti`, with all that the image has, and what is added.
    pub vti: String,
}

/// Ambient occlusion for an image that is there already, as understood.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ShadePlan {
    /// The image, which existed when the plan was made.
    #[serde(serialize_with = "super::describe::path")]
    pub image: PathBuf,
    /// The camera, if the pipeline says which.
    pub camera: Option<CameraPlan>,
    /// The array of distances.
    pub depth: String,
    /// The array of normals.
    pub normal: String,
    /// How occlusion is looked for.
    pub screen_space: ScreenSpacePlan,
    /// What is added.
    pub arrays: Vec<Aov>,
    /// The sky's gradient, if it has one.
    pub sky: Option<Vec<f64>>,
    /// Whether the light of other surfaces is looked for.
    pub bounce: bool,
    /// The array of colours.
    pub albedo: Option<String>,
    /// The file, below `out`.
    #[serde(serialize_with = "super::describe::path")]
    pub file: PathBuf,
}

impl Stage for ShadePlan {
    type Spec = ShadeSpec;
    const KIND: &'static str = "shade";
    const LIST: &'static str = "shades";
    const LEFT_OUT: &'static [LeftOut] = &[
        LeftOut::new("/image", "the content of the file takes part"),
        LeftOut::new("/file", "a file doesn't depend on its name"),
    ];

    fn id(spec: &ShadeSpec) -> Option<&str> {
        spec.id.as_deref()
    }

    fn resolve(spec: &ShadeSpec, path: &str, resolver: &mut Resolver) -> Result<Self, Invalid> {
        let (key, image) = (format!("{path}.image"), resolver.plan.folder.join(&spec.image));
        match crate::input::length(&image) {
            Ok(_) if !spec.image.is_empty() => {}
            Err(cause) if image.exists() => {
                return Err(Invalid::new(key, format!("can't read {}: {cause}", image.display())));
            }
            _ => return Err(Invalid::new(key, format!("there is no file {}", image.display()))),
        }
        let camera = match (&spec.camera, spec.dimension) {
            (None, None) => None,
            (None, Some(_)) => {
                resolver.warn(format!("{path}.dimension"), "has no effect without `camera`: the image tells its own");
                None
            }
            (Some(CameraSpec { fit: Some(true), .. }), _) => {
                let message = "there is no scene that it could be fitted to; say where the image was seen from";
                return Err(Invalid::new(format!("{path}.camera.fit"), message));
            }
            (Some(camera), dimension) => {
                let number = dimension.unwrap_or(4);
                let dimension = Dimension::new(number).ok_or_else(|| {
                    Invalid::new(format!("{path}.dimension"), format!("expected 3 or 4, found {number}"))
                })?;
                Some(camera::plan(camera, &format!("{path}.camera"), dimension, &mut resolver.plan.warnings)?)
            }
        };
        let name = |given: &Option<String>, default: &str| given.as_deref().unwrap_or(default).to_owned();
        let screen_space = screen_space::plan(spec.screen_space.as_ref(), &format!("{path}.screen_space"))?;
        let arrays = spec.arrays.clone().unwrap_or_else(|| vec![Aov::AmbientOcclusion]);
        let refuse = |i: usize, message: String| Err(Invalid::new(format!("{path}.arrays[{i}]"), message));
        for (i, aov) in arrays.iter().enumerate() {
            if !ARRAYS.contains(aov) {
                let known = ARRAYS.map(Aov::name).join(", ");
                return refuse(i, format!("of an image alone `{}` is not known; take of {known}", aov.name()));
            }
            if arrays[..i].contains(aov) {
                return refuse(i, format!("`{}` is there twice", aov.name()));
            }
        }
        if arrays.is_empty() {
            return Err(Invalid::new(
                format!("{path}.arrays"),
                "the list is empty; leave it out for `ambient_occlusion`",
            ));
        }
        let bounce = lighting::bounce(spec.bounce, path)?;
        if let (false, Some(i)) = (bounce, arrays.iter().position(|&aov| aov == Aov::Bounce)) {
            return refuse(i, "no light is followed from surface to surface; say `bounce: 1`".to_owned());
        }
        let is_lit = arrays.iter().any(|aov| matches!(aov, Aov::Irradiance | Aov::Bounce));
        for (key, is_given) in [("sky", spec.sky.is_some()), ("bounce", bounce)] {
            if is_given && !is_lit {
                resolver.warn(format!("{path}.{key}"), "has no effect without `irradiance` or `bounce` in `arrays`");
            }
        }
        if spec.albedo.is_some() && !bounce {
            resolver.warn(format!("{path}.albedo"), "has no effect without `bounce: 1`");
        }
        let file = resolver.outputs.claim(&format!("{path}.vti"), &spec.vti, Some("vti"))?;
        let (depth, normal) = (name(&spec.depth, "depth"), name(&spec.normal, "normal"));
        let sky = spec.sky.as_ref().map(|sky| sky.gradient.clone());
        let albedo = spec.albedo.clone();
        Ok(Self { image, camera, depth, normal, screen_space, arrays, sky, bounce, albedo, file })
    }

    fn works_on(&self) -> Vec<usize> {
        Vec::new()
    }

    fn scene(_: Ref<Self>, _: &Plan) -> Option<Ref<super::scene::ScenePlan>> {
        None
    }

    fn input_files(&self, _: &Plan) -> Vec<PathBuf> {
        std::iter::once(self.image.clone()).chain(vtk::piece_files(&self.image)).collect()
    }

    fn check_inputs(me: Ref<Self>, plan: &Plan) -> Result<(), Invalid> {
        plan[me].read().map(drop).map_err(|message| Invalid::new(format!("{}.image", plan.path(me)), message))
    }

    fn files(&self) -> Vec<&Path> {
        vec![&self.file]
    }

    fn outputs(me: Ref<Self>, plan: &Plan, keys: &Keys) -> Vec<Output> {
        vec![Output::alone(&plan[me].file, keys.of(me.index()).to_owned())]
    }

    /// One piece makes it.
    fn parts(me: Ref<Self>, plan: &Plan, keys: &Keys, piece: Piece) -> Vec<Output> {
        if piece.owns(me.nth()) { Self::outputs(me, plan, keys) } else { Vec::new() }
    }

    fn retell(_: Ref<Self>, plan: &Plan, output: &Path, text: &str) -> Result<u64, io::Error> {
        picture::retell(&plan.out.join(output), text)
    }

    fn written(me: Ref<Self>, plan: &Plan) -> Value {
        let Self { camera, depth, normal, screen_space, arrays, sky, bounce, albedo, .. } = &plan[me];
        let mut written =
            json!({ "depth": depth, "normal": normal, "screen_space": screen_space.written(), "arrays": arrays });
        if let Some(gradient) = sky {
            written["sky"] = json!({ "gradient": gradient });
        }
        if *bounce {
            written["bounce"] = 1.into();
            if let Some(name) = albedo {
                written["albedo"] = json!(name);
            }
        }
        if let Some(camera) = camera {
            (written["camera"], written["dimension"]) = (camera.written(), camera.eye.len().into());
        }
        written
    }

    /// The file and the arrays in it are in memory at once.
    fn needs(me: Ref<Self>, plan: &Plan, stale: &dyn Fn(&Path) -> bool) -> Needs {
        let Self { image, file, .. } = &plan[me];
        let bytes = if stale(file) { crate::input::length(image).unwrap_or(0) } else { 0 };
        Needs { memory: bytes.saturating_mul(2), disk: bytes, holds: "its image" }
    }

    fn line(me: Ref<Self>, plan: &Plan, _: &[Counts]) -> String {
        let Self { image, screen_space, file, .. } = &plan[me];
        let name = image.file_name().unwrap_or_default().to_string_lossy();
        format!("{name}, screen space, {} -> {}", screen_space.line(), file.display())
    }

    fn run_last(me: Ref<Self>, run: &mut Run) -> Result<Told, StageError> {
        let (plan, shade) = (run.plan, &run.plan[me]);
        if !run.is_stale(&shade.file) {
            return Ok("as it was".into());
        }
        if let Some(joined) = &run.joined {
            let (part, path) = (joined.owned(&shade.file, me.nth()), plan.out.join(&shade.file));
            let bytes = picture::take(&part, &path, Encoding::Appended, run.told)?;
            run.made(&shade.file, bytes, Vec::new())?;
            return Ok("made by one piece".into());
        }
        // It was read before, but may have changed since.
        let image = shade.read().map_err(|message| Invalid::new(format!("{}.image", plan.path(me)), message))?;
        let running = run.progress.stage(&format!("shade {}", plan.id(me)), image.volume.grid.len() as u64);
        let found = match image.dimension {
            Dimension::Three => shade.found::<3>(&image, run.progress),
            Dimension::Four => shade.found::<4>(&image, run.progress),
        }?;
        running.end();
        let mut notes = Vec::new();
        if found.seen == 0 {
            notes.push(format!(
                "{}: no point of the image shows anything; `{}` has no distance above 0",
                plan.id(me),
                shade.depth
            ));
        }
        if found.without_normal > 0 {
            notes.push(format!(
                "{}: {} of the {} points that show something have no normal, and are left open",
                plan.id(me),
                grouped(found.without_normal),
                grouped(found.seen)
            ));
        }
        let (seen, points) = (found.seen, image.volume.grid.len() as u64);
        let told = Told::new(
            format!("{} of {} points show something", grouped(seen), grouped(points)),
            json!({ "seen": seen, "points": points }),
        );
        let bytes = shade.write(&plan.out.join(&shade.file), run.told, image, found.arrays)?;
        run.made(&shade.file, bytes, notes)?;
        Ok(told)
    }
}

/// An image that can be shaded.
struct Image {
    volume: Volume,
    time: Option<f64>,
    dimension: Dimension,
    camera: CameraPlan,
}

/// What was found of an image's points.
struct Found {
    arrays: Vec<Array>,
    /// Points that show something, and those of them that have no normal.
    seen: u64,
    without_normal: u64,
}

impl ShadePlan {
    /// Reads the image; what is wrong with it, or what it lacks, otherwise.
    fn read(&self) -> Result<Image, String> {
        let name = self.image.display().to_string();
        let unusable = |cause: String| format!("can't use {name}: {cause}");
        let read = vtk::read(&self.image).map_err(|error| error.to_string())?;
        let vtk::DataSet::Image(image) = read else {
            return Err(unusable("it holds a mesh, not an image".to_owned()));
        };
        let time = image.time();
        let volume = image.into_volume().map_err(|problem| unusable(problem.to_string()))?;
        let told = self.camera.clone().map_or_else(|| told_camera(&volume), |camera| Some(Ok(camera)));
        let mut lacks = Vec::new();
        let (depth, normal) = (volume.array(&self.depth), volume.array(&self.normal));
        if depth.is_none() {
            lacks.push(format!("the array `{}` (distances from the eye)", self.depth));
        }
        if normal.is_none() {
            lacks.push(format!("the array `{}` (normals)", self.normal));
        }
        if told.is_none() {
            lacks.push("a camera in its field data (give one by `camera`)".to_owned());
        }
        let (Some(depth), Some(normal), Some(camera)) = (depth, normal, told) else {
            let has: Vec<&str> = volume.arrays.iter().map(|array| array.name.as_str()).collect();
            let has = if has.is_empty() { "no arrays".to_owned() } else { has.join(", ") };
            return Err(unusable(format!("it lacks {}; it has {has}", lacks.join(" and "))));
        };
        let camera = camera.map_err(unusable)?;
        if depth.components != 1 {
            let count = depth.components;
            return Err(unusable(format!(
                "its array `{}` has {count} numbers a point, and distances have 1",
                self.depth
            )));
        }
        let Some(dimension) = Dimension::new(normal.components as u64) else {
            let count = normal.components;
            return Err(unusable(format!(
                "its array `{}` has {count} numbers a point, and normals have 3 or 4",
                self.normal
            )));
        };
        if let Some(gradient) = &self.sky {
            let sky = SkySpec { gradient: gradient.clone() };
            lighting::gradient(&sky, "gradient", dimension).map_err(|e| unusable(format!("of its `sky` the {e}")))?;
        }
        if let Some(name) = self.albedo.as_deref().filter(|_| self.bounce)
            && volume.array(name).is_none()
        {
            return Err(unusable(format!("it lacks the array `{name}` (colours)")));
        }
        if camera.eye.len() != dimension.get() {
            let (own, needed) = (camera.eye.len(), dimension.get());
            let remedy = if self.camera.is_some() { format!("; say `dimension: {needed}`") } else { String::new() };
            return Err(unusable(format!("its normals are of a {needed}D scene, and the camera is {own}D{remedy}")));
        }
        let layers = volume.grid.dimensions[2];
        if dimension == Dimension::Three && layers > 1 {
            return Err(unusable(format!(
                "its normals are of a 3D scene, whose image has one layer, and it has {layers}"
            )));
        }
        Ok(Image { time, dimension, camera, volume })
    }

    /// What is added, for all points.
    fn found<const D: usize>(&self, image: &Image, progress: &dyn Progress) -> Result<Found, StageError> {
        let camera = camera::camera::<D>(&image.camera)?;
        let own = &image.volume.grid;
        let grid = if self.camera.is_some() { camera.grid(own.dimensions) } else { *own };
        let numbers = |name: &str| image.volume.array(name).map(|array| &array.values);
        let (Some(depth), Some(normals)) = (numbers(&self.depth), numbers(&self.normal)) else {
            return Ok(Found { arrays: Vec::new(), seen: 0, without_normal: 0 });
        };
        let distances: Vec<f32> = (0..grid.len()).into_par_iter().map(|n| depth.get(n) as f32).collect();
        let mut depth_image = DepthImage::<D>::new(&camera, &grid, distances, self.screen_space.settings());
        if self.arrays != [Aov::AmbientOcclusion] {
            depth_image = depth_image.directed();
        }
        let normal = |n: usize| Vector::<D>::from_fn(|r, _| normals.get(D * n + r) as f32);
        let look = |image: &DepthImage<D>| -> Result<Vec<Option<Option<Seen<D>>>>, StageError> {
            let mut found = vec![None; grid.len()];
            let width = grid.dimensions[0];
            found.par_chunks_mut(width).enumerate().try_for_each(|(row, found)| {
                if progress.cancelled() {
                    return Err(Cancelled);
                }
                for (i, found) in found.iter_mut().enumerate() {
                    let n = row * width + i;
                    if image.shows(n) {
                        *found = Some(image.seen_at(&normal(n), grid.index(n)));
                    }
                }
                progress.advance(width as u64);
                Ok(())
            })?;
            Ok(found)
        };
        let gradient = self.sky.as_ref().map_or_else(Vector64::zeros, |g| Vector64::<D>::from_fn(|r, _| g[r]));
        let sky = |seen: &Seen<D>| (f64::from(seen.open) + gradient.dot(&widen(&seen.vector))).max(0.0);
        let mut found = look(&depth_image)?;
        if self.bounce {
            let colors = self.albedo.as_ref().and_then(|name| image.volume.array(name));
            let light = |(n, seen): (usize, &Option<Option<Seen<D>>>)| {
                if seen.is_none() {
                    return ([0.0; 3], Vector::zeros());
                }
                // What has no normal is left open.
                let arrives = seen.as_ref().and_then(|seen| seen.as_ref()).map_or(1.0, sky);
                let light = reflectance(colors.map_or(GREY, |array| color(array, n))).map(|c| (c * arrives) as f32);
                (light, normal(n))
            };
            depth_image = depth_image.lit(found.par_iter().enumerate().map(light).collect());
            found = look(&depth_image)?;
        }
        let of_points = |value: &(dyn Fn(Option<&Seen<D>>) -> Vec<f32> + Sync)| -> Vec<f32> {
            found.par_iter().flat_map_iter(|seen| value(seen.as_ref().and_then(|seen| seen.as_ref()))).collect()
        };
        let array = |aov: &Aov| {
            let values = match aov {
                Aov::BentNormal => {
                    of_points(&|seen| seen.map_or_else(Vector::zeros, |seen| seen.vector).iter().copied().collect())
                }
                Aov::Bounce => of_points(&|seen| seen.map_or([0.0; 3], |seen| seen.bounced).to_vec()),
                Aov::Irradiance => of_points(&|seen| {
                    seen.map_or([1.0; 3], |seen| seen.bounced.map(|c| (sky(seen) + f64::from(c)) as f32)).to_vec()
                }),
                _ => of_points(&|seen| vec![seen.map_or(1.0, |seen| seen.open)]),
            };
            Array::new(aov.name(), aov.components::<D>(), values)
        };
        Ok(Found {
            seen: found.iter().flatten().count() as u64,
            without_normal: found.iter().flatten().filter(|seen| seen.is_none()).count() as u64,
            arrays: self.arrays.iter().map(array).collect(),
        })
    }

    /// Writes the image with what is added; returns the file's length.
    fn write(&self, path: &Path, told: &str, image: Image, arrays: Vec<Array>) -> Result<u64, io::Error> {
        let Image { mut volume, time, .. } = image;
        let is_new = |name: &str| arrays.iter().any(|array| array.name == name);
        let replaced = volume.array(Aov::AmbientOcclusion.name()).is_some_and(|array| is_new(&array.name));
        volume.arrays.retain(|array| !is_new(&array.name));
        volume.arrays.extend(arrays);
        let mut field_data = vec![
            ("program".to_owned(), PROGRAM.to_owned()),
            (PIPELINE.to_owned(), told.to_owned()),
            (screen_space::WORD.to_owned(), self.screen_space.written().to_string()),
        ];
        let own: Vec<String> = field_data.iter().map(|(name, _)| name.clone()).collect();
        // What is said of occlusion that is no longer there would be wrong.
        let stays = |name: &str| {
            !(own.iter().any(|o| o == name) || name == "TimeValue" || replaced && name.starts_with("occlusion_"))
        };
        field_data.extend(volume.field_data.iter().filter(|(name, _)| stays(name)).cloned());
        let settings = vti::Settings { field_data, time, ..vti::Settings::default() };
        let file = AtomicFile::create(path)?;
        vti::write(file, &volume, &settings).map_err(AtomicFile::name_in(path))?.commit()
    }
}

/// The colour of a point, each number from 0 to 1; one number is a grey.
fn color(array: &Array, point: usize) -> [f32; 3] {
    let scale = if array.values.kind() == Kind::U8 { 255.0 } else { 1.0 };
    let count = array.components;
    let number = |c: usize| {
        let value = array.values.get(count * point + if count < 3 { 0 } else { c }) / scale;
        // Also what is no number.
        if value > 0.0 { value.min(1.0) as f32 } else { 0.0 }
    };
    [number(0), number(1), number(2)]
}

/// The camera that an image of `ao4d run` tells; what is wrong with it otherwise. None if it tells none.
fn told_camera(volume: &Volume) -> Option<Result<CameraPlan, String>> {
    let (_, text) = volume.field_data.iter().find(|(name, _)| name == SETTINGS)?;
    let settings: Value = serde_json::from_str(text).ok()?;
    let told: CameraPlan = serde_json::from_value(settings.get("camera")?.clone()).ok()?;
    let dimension = Dimension::new(told.eye.len() as u64)?;
    // Whoever wrote it, it is checked as one in a pipeline is.
    let checked = camera::plan(&told.spec(), "camera", dimension, &mut Vec::new());
    Some(checked.map_err(|invalid| format!("its field data tell a camera that is none: {invalid}")))
}
