//! `slice`: cross-sections of a scene's bodies by hyperplanes (Banchoff), as files that any viewer shows.
//!
//! A slice of a 4D scene is a surface of triangles in the hyperplane's own three coordinates, closed where the body is;
//! one of a 3D scene is its outline in a plane. Not the picture is cut but the mesh, exactly ([`crate::mesh::section`]).
//! One slice is one `.vtp`; a sequence of them is so many, and a `.pvd` that ParaView plays, with the place of each as its
//! time.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::describe::Counts;
use super::names::file_names;
use super::occlusion::{self, OcclusionPlan};
use super::range::check_length;
use super::scene::ScenePlan;
use super::subject::scene_and_occlusion;
use super::write::vtu;
use super::{Invalid, Keys, LeftOut, Output, Plan, Ref, Resolver, Run, SceneRun, Stage, StageError};
use crate::geometry::{Dimension, Vector64, narrow};
use crate::io::{self, AtomicFile, PIPELINE, pvd, vtp};
use crate::mesh::Mesh;
use crate::mesh::section::{Hyperplane, Section, section};
use crate::occlusion::Estimates;
use crate::text::number;
use crate::volume::Array;

/// The most slices of a sequence.
const MOST: u64 = 10_000;

/// Cross-sections of a scene's bodies by hyperplanes.
#[derive(Clone, Debug, Deserialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct SliceSpec {
    /// A name for later stages to refer to.
    pub id: Option<String>,
    /// The scene, or the occlusion (and with it its scene), by its id.
    pub input: Option<String>,
    /// The occlusion that is shown on it, by its id; `none` shows none (default: the nearest earlier one, if any).
    pub occlusion: Option<String>,
    /// The hyperplane's normal n, of any length but zero (default: along the last axis).
    pub normal: Option<Vec<f64>>,
    /// Where it is: the number c in n.x = c (default 0).
    pub at: Option<f64>,
    /// Instead of `at`, for a sequence: the first c and the last.
    pub range: Option<[f64; 2]>,
    /// How many slices are in the range, from 2 on.
    #[schemars(range(min = 2, max = 10_000))]
    pub count: Option<u64>,
    /// The file: `NAME.vtp`. A sequence goes into `NAME-0.vtp`, `NAME-1.vtp`, ... and `NAME.pvd`.
    pub vtp: String,
}

/// Cross-sections, as understood.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SlicePlan {
    /// The scene whose bodies are cut.
    pub scene: Ref<ScenePlan>,
    /// The occlusion that is shown on them.
    pub occlusion: Option<Ref<OcclusionPlan>>,
    /// The hyperplanes' normal; not zero.
    pub normal: Vec<f64>,
    /// Where they are: the number c in n.x = c of each.
    pub places: Vec<f64>,
    /// The file of each, below `out`.
    pub files: Vec<PathBuf>,
    /// The list of the files, if they are a sequence.
    pub list: Option<PathBuf>,
}

impl Stage for SlicePlan {
    type Spec = SliceSpec;
    const KIND: &'static str = "slice";
    const LIST: &'static str = "slices";
    const LEFT_OUT: &'static [LeftOut] = &[
        LeftOut::new("/scene", "the key of the scene itself takes part"),
        LeftOut::new("/occlusion", "the key of the occlusion itself takes part"),
        LeftOut::new("/files", "a slice doesn't depend on its file's name; the list of them has its own key"),
        LeftOut::new("/list", "a file doesn't depend on its name"),
    ];

    fn id(spec: &SliceSpec) -> Option<&str> {
        spec.id.as_deref()
    }

    fn resolve(spec: &SliceSpec, path: &str, resolver: &mut Resolver) -> Result<Self, Invalid> {
        let (scene, occlusion) = scene_and_occlusion(resolver, path, spec.input.as_deref(), spec.occlusion.as_deref())?;
        let normal = normal(spec.normal.as_deref(), &format!("{path}.normal"), resolver.plan[scene].dimension)?;
        let places = places(spec, path)?;
        let key = format!("{path}.vtp");
        let whole = resolver.outputs.claim(&key, &spec.vtp, Some("vtp"))?;
        if places.len() == 1 {
            return Ok(Self { scene, occlusion, normal, places, files: vec![whole], list: None });
        }
        let stem = whole.with_extension("").to_string_lossy().into_owned();
        let mut claim = |name: String| resolver.outputs.claim(&key, &name, None);
        let digits = (places.len() - 1).to_string().len();
        let files: Result<_, _> = (0..places.len()).map(|i| claim(format!("{stem}-{i:0digits$}.vtp"))).collect();
        let list = claim(format!("{stem}.pvd"))?;
        Ok(Self { scene, occlusion, normal, places, files: files?, list: Some(list) })
    }

    fn works_on(&self) -> Vec<usize> {
        std::iter::once(self.scene.index()).chain(self.occlusion.map(Ref::index)).collect()
    }

    fn scene(me: Ref<Self>, plan: &Plan) -> Option<Ref<ScenePlan>> {
        Some(plan[me].scene)
    }

    fn wants_values(&self, occlusion: usize) -> bool {
        self.occlusion.is_some_and(|own| own.index() == occlusion)
    }

    fn files(&self) -> Vec<&Path> {
        self.files.iter().chain(&self.list).map(PathBuf::as_path).collect()
    }

    fn outputs(me: Ref<Self>, plan: &Plan, keys: &Keys) -> Vec<Output> {
        let Self { places, files, list, .. } = &plan[me];
        let key = keys.of(me.index());
        let slice = |(file, at): (&PathBuf, &f64)| {
            let key = keys.hash(&(key, at));
            Output::alone(file, key)
        };
        let list = list.iter().map(|file| {
            let key = keys.hash(&(key, file_names(files)));
            Output { beside: Vec::new(), key, tells: None, file: file.clone() }
        });
        files.iter().zip(places).map(slice).chain(list).collect()
    }

    fn retell(_: Ref<Self>, plan: &Plan, output: &Path, text: &str) -> Result<u64, io::Error> {
        vtu::retell(&plan.out.join(output), text)
    }

    fn written(me: Ref<Self>, plan: &Plan) -> Value {
        let Self { normal, places, .. } = &plan[me];
        match places.as_slice() {
            [at] => json!({ "normal": normal, "at": at }),
            _ => json!({ "normal": normal }),
        }
    }

    fn line(me: Ref<Self>, plan: &Plan, _: &[Counts]) -> String {
        let Self { scene, occlusion, normal, places, files, list } = &plan[me];
        let with = occlusion.map_or("without occlusion".into(), |occlusion| format!("with {}", plan.id(occlusion)));
        let normal: Vec<String> = normal.iter().map(|x| number(*x)).collect();
        let (first, last) = (number(places[0]), number(places[places.len() - 1]));
        let places = match places.len() {
            1 => format!("at {first}"),
            n => format!("{n} from {first} to {last}"),
        };
        let file = list.as_ref().unwrap_or(&files[0]);
        format!("{} {with}, across [{}], {places} -> {}", plan.id(*scene), normal.join(", "), file.display())
    }

    fn run<const D: usize>(me: Ref<Self>, run: &mut Run, scene: &mut SceneRun<D>) -> Result<String, StageError> {
        let plan = run.plan;
        let Self { occlusion, normal, places, files, list, .. } = &plan[me];
        let stale: Vec<usize> = (0..files.len()).filter(|&i| run.is_stale(&files[i])).collect();
        if let Some(occlusion) = occlusion.filter(|_| !stale.is_empty()) {
            occlusion::values(occlusion, run, scene)?;
        }
        let values = occlusion.and_then(|occlusion| scene.values.get(&occlusion)).map(|values| &**values);
        let mesh = scene.session.mesh();
        let mut faces = 0;
        for &i in &stale {
            let file = &files[i];
            let normal = Vector64::<D>::from_fn(|r, _| normal[r]);
            // The checks before leave no normal that has no hyperplane.
            let Some(plane) = Hyperplane::new(normal, places[i]) else { continue };
            let found = section(mesh, &plane, values.map(|values| &*values.values));
            faces += found.faces.len();
            let mut notes = Vec::new();
            if found.faces.is_empty() && list.is_none() {
                notes.push(format!("{}: the hyperplane meets nothing; the file is empty", plan.id(me)));
            }
            let bytes = write(&plan.out.join(file), run.told, mesh, &plane, &found, values)?;
            run.made(file, bytes, notes)?;
        }
        if let Some(list) = list.as_ref().filter(|list| run.is_stale(list)) {
            let path = plan.out.join(list);
            let mut file = AtomicFile::create(&path)?;
            let names = file_names(files);
            let dated = places.iter().copied().zip(names.iter().map(String::as_str));
            pvd::write(&mut file, dated).map_err(AtomicFile::name_in(&path))?;
            let bytes = file.commit()?;
            run.made(list, bytes, Vec::new())?;
        }
        let what = match Dimension::of::<D>() {
            Dimension::Three => "lines",
            Dimension::Four => "triangles",
        };
        Ok(if stale.is_empty() { "as it was".to_owned() } else { format!("{faces} {what}") })
    }
}

/// The normal, checked.
fn normal(given: Option<&[f64]>, path: &str, dimension: Dimension) -> Result<Vec<f64>, Invalid> {
    let count = dimension.get();
    let Some(normal) = given else { return Ok((0..count).map(|axis| f64::from(axis == count - 1)).collect()) };
    if normal.len() != count {
        let message = format!("expected {count} numbers (the scene is {count}D), found {}", normal.len());
        return Err(Invalid::new(path, message));
    }
    for (i, &x) in normal.iter().enumerate() {
        check_length(&format!("{path}[{i}]"), x)?;
    }
    if normal.iter().all(|x| x.abs() < super::MIN_LENGTH) {
        let axis: Vec<&str> = (0..count).map(|axis| if axis == count - 1 { "1" } else { "0" }).collect();
        let message = format!("the normal is zero, and no hyperplane has that; try `normal: [{}]`", axis.join(", "));
        return Err(Invalid::new(path, message));
    }
    Ok(normal.to_vec())
}

/// Where the hyperplanes are.
fn places(spec: &SliceSpec, path: &str) -> Result<Vec<f64>, Invalid> {
    match (spec.at, spec.range, spec.count) {
        (at, None, None) => Ok(vec![check_length(&format!("{path}.at"), at.unwrap_or(0.0))?]),
        (None, Some([first, last]), Some(count)) => {
            check_length(&format!("{path}.range[0]"), first)?;
            check_length(&format!("{path}.range[1]"), last)?;
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

/// Writes a slice; returns the file's length.
fn write<const D: usize>(
    path: &Path,
    told: &str,
    mesh: &Mesh<D>,
    plane: &Hyperplane<D>,
    section: &Section,
    found: Option<&Estimates>,
) -> Result<u64, io::Error> {
    let places: Vec<Vector64<D>> = section.points.iter().map(|point| point.position(mesh)).collect();
    let points: Vec<[f32; 3]> = places.iter().map(|p| plane.coordinates(p).map(|x| x as f32)).collect();
    let position: Vec<f32> = places.iter().flat_map(|p| narrow(p).iter().copied().collect::<Vec<_>>()).collect();
    let object: Vec<u16> = section.points.iter().map(|point| point.object as u16 + 1).collect();
    let mut arrays = vec![Array::new("position", D, position), Array::new("object", 1, object)];
    if let Some(found) = found {
        let values: Vec<f32> = section.points.iter().map(|point| point.value(&found.values)).collect();
        arrays.push(Array::new("ambient_occlusion", 1, values));
        // Of loaded values nothing is known.
        if found.errors.len() == found.values.len() {
            let errors: Vec<f32> = section.points.iter().map(|point| point.error(&found.errors)).collect();
            arrays.push(Array::new("occlusion_error", 1, errors));
        }
    }
    let mut file = AtomicFile::create(path)?;
    let texts = [(PIPELINE, told)];
    match Dimension::of::<D>() {
        Dimension::Three => {
            let lines: Vec<[u32; 2]> = section.faces.iter().map(|&[a, b, _]| [a, b]).collect();
            vtp::write(&mut file, &points, vtp::Cells::Lines(&lines), &arrays, &[], &texts)
        }
        Dimension::Four => vtp::write(&mut file, &points, vtp::Cells::Triangles(&section.faces), &arrays, &[], &texts),
    }
    .map_err(AtomicFile::name_in(path))?;
    file.commit()
}
