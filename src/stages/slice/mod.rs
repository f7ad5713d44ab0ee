//! `slice`: cross-sections of a scene's bodies by hyperplanes (Banchoff), as files that any viewer shows.
//!
//! A slice of a 4D scene is a surface of triangles in the hyperplane's own three coordinates, closed where the body is;
//! one of a 3D scene is its outline in a plane. Not the picture is cut but the mesh, exactly ([`crate::mesh::section`]).
//! One slice is one `.vtp`; a sequence of them is so many, and a `.pvd` that ParaView plays, with the place of each as its
//! time.
//!
//! A peel of a hypersphere is cut out by a torus of Hopf instead ([`crate::mesh::peel`]), and shown by the stereographic
//! projection ([`crate::mesh::stereographic`]), as slices of what lies around a centre may be too.

mod file;
mod level;

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use self::file::Shown;
pub use self::level::{LevelPlan, PeelWord};
use super::describe::Counts;
use super::names::file_names;
use super::occlusion::{self, OcclusionPlan};
use super::projection::{ProjectionWord, StereographicPlan};
use super::scene::ScenePlan;
use super::subject::scene_and_occlusion;
use super::write::vtu;
use super::{Invalid, Keys, LeftOut, Output, Plan, Ref, Resolver, Run, SceneRun, Stage, StageError, Told};
use crate::geometry::Dimension;
use crate::io::{self, AtomicFile, pvd};
use crate::mesh::section::section;
use crate::text::number;

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
    /// Instead of `normal`: `w` cuts along the fourth axis, `hopf` along the tori of Hopf.
    pub peel: Option<PeelWord>,
    /// With `peel: hopf`: the axis of Hopf's sphere that angles are measured from (default `[0, 0, 1]`).
    pub axis: Option<[f64; 3]>,
    /// The centre of the hypersphere that is peeled or projected (default: the origin).
    pub center: Option<Vec<f64>>,
    /// Where its points are put: `plane`, the hyperplane's own coordinates (default), or `stereographic` (default of
    /// Hopf's tori).
    pub projection: Option<ProjectionWord>,
    /// From where it is projected: the pole's direction from the centre (default: along the last axis).
    pub pole: Option<Vec<f64>>,
    /// Where it is: the number c in n.x = c (default 0), or the angle of a torus in degrees, above 0 and below 90 (default 45).
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
    /// What cuts.
    pub level: LevelPlan,
    /// The projection of their points, if it is not to the hyperplane.
    pub stereographic: Option<StereographicPlan>,
    /// Where they are: the number c in n.x = c of each, or the angle.
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
        let dimension = resolver.plan[scene].dimension;
        let level = LevelPlan::new(spec, path, dimension)?;
        let stereographic = stereographic(spec, path, &level, dimension)?;
        let places = level::places(spec, path)?;
        let key = format!("{path}.vtp");
        let whole = resolver.outputs.claim(&key, &spec.vtp, Some("vtp"))?;
        if places.len() == 1 {
            return Ok(Self { scene, occlusion, level, stereographic, places, files: vec![whole], list: None });
        }
        let stem = whole.with_extension("").to_string_lossy().into_owned();
        let mut claim = |name: String| resolver.outputs.claim(&key, &name, None);
        let digits = (places.len() - 1).to_string().len();
        let files: Result<_, _> = (0..places.len()).map(|i| claim(format!("{stem}-{i:0digits$}.vtp"))).collect();
        let list = claim(format!("{stem}.pvd"))?;
        Ok(Self { scene, occlusion, level, stereographic, places, files: files?, list: Some(list) })
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
        let Self { level, stereographic, places, .. } = &plan[me];
        let mut written = match level {
            LevelPlan::W => json!({}),
            LevelPlan::Across(normal) => json!({ "normal": normal }),
            LevelPlan::Hopf { center, axis } => json!({ "center": center, "axis": axis }),
        };
        if let Some(StereographicPlan { center, pole }) = stereographic {
            written["projection"] = json!(ProjectionWord::Stereographic);
            (written["center"], written["pole"]) = (json!(center), json!(pole));
        }
        if let [at] = places.as_slice() {
            written["at"] = json!(at);
        }
        written
    }

    fn line(me: Ref<Self>, plan: &Plan, _: &[Counts]) -> String {
        let Self { scene, occlusion, level, stereographic, places, files, list } = &plan[me];
        let with = occlusion.map_or("without occlusion".into(), |occlusion| format!("with {}", plan.id(occlusion)));
        let (first, last) = (number(places[0]), number(places[places.len() - 1]));
        let places = match places.len() {
            1 => format!("at {first}"),
            n => format!("{n} from {first} to {last}"),
        };
        let shown = if stereographic.is_some() { ", projected stereographically" } else { "" };
        let file = list.as_ref().unwrap_or(&files[0]);
        format!("{} {with}, {}, {places}{shown} -> {}", plan.id(*scene), level.line(), file.display())
    }

    fn run<const D: usize>(me: Ref<Self>, run: &mut Run, scene: &mut SceneRun<D>) -> Result<Told, StageError> {
        let plan = run.plan;
        let Self { occlusion, level: cut, stereographic, places, files, list, .. } = &plan[me];
        let stale: Vec<usize> = (0..files.len()).filter(|&i| run.is_stale(&files[i])).collect();
        if let Some(occlusion) = occlusion.filter(|_| !stale.is_empty()) {
            occlusion::values(occlusion, run, scene)?;
        }
        let values = occlusion.and_then(|occlusion| scene.values.get(&occlusion)).map(|values| &**values);
        let mesh = scene.session.mesh();
        let (mut faces, mut met) = (0, false);
        for &i in &stale {
            let file = &files[i];
            let shown = match stereographic {
                Some(projection) => projection.map().map(Shown::Stereographic),
                None => cut.plane(places[i]).map(Shown::Plane),
            };
            // The checks before leave nothing that lacks one of them.
            let (Some(level), Some(shown)) = (cut.level::<D>(places[i]), shown) else { continue };
            let mut found = section(mesh, &*level, values.map(|values| &*values.values));
            shown.turn(&*level, mesh, &mut found);
            let points = match (shown.points(mesh, &found), stereographic) {
                (Ok(points), _) => points,
                (Err((why, object)), Some(projection)) => {
                    return Err(projection.complain(me, plan, why, &mesh.objects[object as usize].name));
                }
                (Err(_), None) => continue,
            };
            faces += found.faces.len();
            let mut notes = Vec::new();
            met |= !found.faces.is_empty();
            // Of a sequence some may go past; where all do, the last one tells.
            let all = list.is_some() && !met && stale.len() == files.len() && i + 1 == files.len();
            if found.faces.is_empty() && (list.is_none() || all) {
                let what = match cut {
                    LevelPlan::Across(_) | LevelPlan::W if all => "no hyperplane meets anything; all files are empty",
                    LevelPlan::Across(_) | LevelPlan::W => "the hyperplane meets nothing; the file is empty",
                    LevelPlan::Hopf { .. } => {
                        "the torus meets nothing; the file is empty. Is `center` within the body?"
                    }
                };
                notes.push(format!("{}: {what}", plan.id(me)));
            }
            let bytes = file::write(&plan.out.join(file), run.told, mesh, &points, &found, values)?;
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
        Ok(match stale.is_empty() {
            true => "as it was".into(),
            false => Told::new(format!("{faces} {what}"), json!({ what: faces })),
        })
    }
}

/// The projection, if its points aren't to stay in their hyperplane.
fn stereographic(
    spec: &SliceSpec,
    path: &str,
    level: &LevelPlan,
    dimension: Dimension,
) -> Result<Option<StereographicPlan>, Invalid> {
    let refuse = |key: &str, message: &str| Err(Invalid::new(format!("{path}.{key}"), message));
    match spec.projection {
        Some(ProjectionWord::Camera) => {
            refuse("projection", "slices are shown in their own `plane`, or `stereographic`; a camera sees wireframes")
        }
        Some(ProjectionWord::Plane) if !level.is_flat() => {
            refuse("projection", "a torus of Hopf lies in no hyperplane; take `stereographic`")
        }
        Some(ProjectionWord::Plane) | None if level.is_flat() => {
            for (key, given) in [("pole", &spec.pole), ("center", &spec.center)] {
                if given.is_some() {
                    return refuse(key, "is for `projection: stereographic`; add that, or take it out");
                }
            }
            Ok(None)
        }
        _ => Ok(Some(StereographicPlan::new(spec.center.as_deref(), spec.pole.as_deref(), path, dimension)?)),
    }
}
