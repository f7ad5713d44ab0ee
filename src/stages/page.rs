//! `page`: one HTML file that shows images and animations in a browser: turned, cut, sliced and compared.
//!
//! It is made of the `.vti` files that earlier stages leave, read again when they are there, so it has nothing that they
//! haven't. `ao4d page` adds this stage to a pipeline that has none.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::animate::{AnimatePlan, Motion};
use super::describe::Counts;
use super::paraview::Shown;
use super::render::RenderPlan;
use super::scene::ScenePlan;
use super::write::{Format, PROGRAM, WritePlan};
use super::{Invalid, Keys, LeftOut, OneOrMany, Output, Plan, Ref, Resolver, Run, Stage, StageError, Told};
use crate::io::AtomicFile;
use crate::io::page::{self, Palette, Series, Voxels};
use crate::io::vtk::{self, DataSet, Image};
use crate::occlusion::Cancelled;
use crate::render::Aov;
use crate::text::number;
use crate::volume::{Array, Values};

/// Frames a second of animations.
const RATE: f64 = 12.0;

/// A page for browsers: one HTML file.
#[derive(Clone, Debug, Deserialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct PageSpec {
    /// A name for later stages to refer to.
    pub id: Option<String>,
    /// What it shows, by their ids: animations, renders or the writes of renders (default: all earlier ones that leave a
    /// `.vti`). The first is what is opened.
    pub input: Option<OneOrMany>,
    /// The file.
    pub html: String,
    /// What stands above it (default the pipeline's name).
    pub title: Option<String>,
}

/// A page for browsers, as understood.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PagePlan {
    /// What it shows.
    pub shown: Vec<Shown>,
    /// The file, below `out`.
    #[serde(serialize_with = "super::describe::path")]
    pub file: PathBuf,
    /// What stands above it.
    pub title: String,
}

impl Stage for PagePlan {
    type Spec = PageSpec;
    const KIND: &'static str = "page";
    const LIST: &'static str = "pages";
    const LEFT_OUT: &'static [LeftOut] = &[
        LeftOut::new("/shown", "the keys of the files that it shows take part, with their names"),
        LeftOut::new("/file", "a file doesn't depend on its name"),
    ];

    fn id(spec: &PageSpec) -> Option<&str> {
        spec.id.as_deref()
    }

    fn resolve(spec: &PageSpec, path: &str, resolver: &mut Resolver) -> Result<Self, Invalid> {
        let shown = shown(spec, path, resolver)?;
        let file = resolver.outputs.claim(&format!("{path}.html"), &spec.html, Some("html"))?;
        let title = spec.title.clone().unwrap_or_else(|| resolver.plan.name.clone());
        Ok(Self { shown, file, title })
    }

    fn works_on(&self) -> Vec<usize> {
        self.shown.iter().map(|shown| shown.index()).collect()
    }

    fn scene(_: Ref<Self>, _: &Plan) -> Option<Ref<ScenePlan>> {
        None
    }

    fn files(&self) -> Vec<&Path> {
        vec![&self.file]
    }

    fn outputs(me: Ref<Self>, plan: &Plan, keys: &Keys) -> Vec<Output> {
        let page = &plan[me];
        let of = |shown: &Shown| {
            let outputs = plan.outputs(shown.index(), keys);
            let keys: Vec<String> = outputs.into_iter().map(|output| output.key).collect();
            (name(*shown, plan).to_owned(), keys)
        };
        let inputs: Vec<_> = page.shown.iter().map(of).collect();
        vec![Output::alone(&page.file, keys.hash(&(keys.of(me.index()), PROGRAM, inputs)))]
    }

    fn line(me: Ref<Self>, plan: &Plan, _: &[Counts]) -> String {
        let names: Vec<&str> = plan[me].shown.iter().map(|&shown| name(shown, plan)).collect();
        format!("{} -> {}", names.join(", "), plan[me].file.display())
    }

    fn run_last(me: Ref<Self>, run: &mut Run) -> Result<Told, StageError> {
        let (plan, page) = (run.plan, &run.plan[me]);
        if plan.piece.is_some() {
            return Ok("made when the pieces are joined".into());
        }
        if !run.is_stale(&page.file) {
            return Ok("as it was".into());
        }
        let frames: usize = page.shown.iter().map(|&shown| files(shown, plan).len()).sum();
        let running = run.progress.stage(&format!("page {}", plan.id(me)), 2 * frames as u64);
        let series = page.shown.iter().map(|&shown| series(shown, run)).collect::<Result<Vec<_>, _>>()?;
        running.end();
        let path = plan.out.join(&page.file);
        let mut file = AtomicFile::create(&path)?;
        page::write(&mut file, &page.title, PROGRAM, RATE, &series).map_err(AtomicFile::name_in(&path))?;
        let bytes = file.commit()?;
        run.made(&page.file, bytes, Vec::new())?;
        let noun = if frames == 1 { "frame" } else { "frames" };
        Ok(Told::new(format!("{frames} {noun}"), json!({ "frames": frames })))
    }
}

/// What a page shows.
fn shown(spec: &PageSpec, path: &str, resolver: &Resolver) -> Result<Vec<Shown>, Invalid> {
    let plan = &resolver.plan;
    let has_file = |write: Ref<WritePlan>| plan[write].files.get(Format::Vti).is_some();
    let fits = |shown: Shown| {
        let arrays = shown.arrays(plan);
        arrays.contains(&Aov::Rgba) && arrays.contains(&Aov::Opacity)
    };
    let Some(ids) = &spec.input else {
        let writes = plan.all::<WritePlan>().map(|(write, _)| write).filter(|&write| has_file(write)).map(Shown::Image);
        let animations = plan.all::<AnimatePlan>().map(|(animation, _)| Shown::Animation(animation));
        let chosen = animations.chain(writes).filter(|&s| !plan.is_twin(s.index()) && fits(s));
        let mut all: Vec<Shown> = chosen.collect();
        // What comes first is what is opened: animations, since one wants to turn something, and what ambient occlusion darkens.
        all.sort_by_key(|&shown| (matches!(shown, Shown::Image(_)), !is_dark(shown, plan)));
        return match all.is_empty() {
            true => Err(Invalid::new(
                path,
                "there is no earlier `animate`, and no `write` with `vti`, to show; put one first",
            )),
            false => Ok(all),
        };
    };
    let mut all = Vec::new();
    for (id, index) in ids.iter() {
        let at = format!("{path}.input{index}");
        let stage = resolver.lookup(&at, id, &[RenderPlan::KIND, WritePlan::KIND, AnimatePlan::KIND])?;
        let found = match (plan.reference(stage), plan.reference::<RenderPlan>(stage)) {
            (Some(animation), _) => Some(Shown::Animation(animation)),
            (_, Some(render)) => resolver
                .nearest(|write: Ref<WritePlan>| plan[write].render == render && has_file(write))
                .map(Shown::Image),
            _ => plan.reference(stage).filter(|&write| has_file(write)).map(Shown::Image),
        };
        let Some(found) = found else {
            return Err(Invalid::new(at, format!("`{id}` has no `vti` file written before this stage")));
        };
        if !fits(found) {
            let message = format!("shows `{id}`, whose arrays lack rgba or opacity; add them to its `arrays`");
            return Err(Invalid::new(at, message));
        }
        all.push(found);
    }
    if all.is_empty() {
        return Err(Invalid::new(format!("{path}.input"), "the list is empty; name at least one image"));
    }
    Ok(all)
}

/// Whether ambient occlusion darkens what is shown.
fn is_dark(shown: Shown, plan: &Plan) -> bool {
    shown.render(plan).is_some_and(|render| plan[render].is_dark())
}

/// What a picture is called: an animation by its own name, an image by that of its render.
fn name(shown: Shown, plan: &Plan) -> &str {
    match shown {
        Shown::Image(write) => plan.id(plan[write].render),
        Shown::Animation(animation) => plan.id(animation),
        Shown::Wireframe(_) | Shown::Slice(_) => "",
    }
}

/// The files of a picture, below the output folder, and what each is called.
fn files(shown: Shown, plan: &Plan) -> Vec<(PathBuf, String)> {
    match shown {
        Shown::Image(write) => {
            plan[write].files.get(Format::Vti).map(|file| (file.to_path_buf(), String::new())).into_iter().collect()
        }
        Shown::Animation(animation) => {
            let animation = &plan[animation];
            animation
                .files
                .iter()
                .enumerate()
                .map(|(i, file)| (file.clone(), moment(&animation.motion(i), i)))
                .collect()
        }
        // Lines and surfaces are no volumes, and `shown` takes none.
        Shown::Wireframe(_) | Shown::Slice(_) => Vec::new(),
    }
}

/// A frame by where its path is.
fn moment(motion: &Motion, i: usize) -> String {
    let axis = |a: usize| ["x", "y", "z", "w"].get(a).copied().unwrap_or_default();
    match motion.plane {
        Some([a, b]) => format!("{}{} {}\u{b0}", axis(a), axis(b), number((motion.degrees * 100.0).round() / 100.0)),
        None => format!("{}", i + 1),
    }
}

/// Reads a picture's files, and packs their voxels.
fn series(shown: Shown, run: &Run) -> Result<Series, StageError> {
    let plan = run.plan;
    let has_occlusion = shown.arrays(plan).contains(&Aov::AmbientOcclusion);
    let plain = |render: Ref<RenderPlan>| plan[render].lighting.is_none() && plan[render].is_dark();
    let separable = shown.render(plan).is_some_and(plain) && has_occlusion;
    let files = files(shown, plan);
    let step = || {
        run.progress.advance(1);
        if run.progress.cancelled() { Err(StageError::Cancelled(Cancelled)) } else { Ok(()) }
    };
    let mut palette = Palette::default();
    let mut grid = None;
    for (file, _) in &files {
        let image = read(&plan.out.join(file))?;
        let voxels = Frame::new(&image, separable);
        let voxels = voxels.ok_or_else(|| damaged(&plan.out.join(file)))?;
        palette.look(&voxels.of(&image));
        grid.get_or_insert(image.grid);
        step()?;
    }
    palette.choose();
    let mut frames = Vec::with_capacity(files.len());
    for (file, called) in files {
        let path = plan.out.join(&file);
        let image = read(&path)?;
        let voxels =
            Frame::new(&image, separable).filter(|_| Some(image.grid.dimensions) == grid.map(|g| g.dimensions));
        let voxels = voxels.ok_or_else(|| damaged(&path))?;
        frames.push((called, palette.pack(&voxels.of(&image)).map_err(AtomicFile::name_in(&path))?));
        step()?;
    }
    let grid = grid.ok_or_else(|| damaged(&plan.out))?;
    Ok(Series { name: name(shown, plan).to_owned(), grid, palette, separable, frames })
}

/// The arrays of an image that a page needs.
struct Frame<'i> {
    rgba: &'i [u8],
    coverage: &'i [f32],
    occlusion: Option<&'i [f32]>,
}

impl<'i> Frame<'i> {
    /// Finds them; none if the image lacks one.
    fn new(image: &'i Image, separable: bool) -> Option<Self> {
        let array = |name: &str| image.point_arrays.iter().find(|array| array.name == name);
        let floats = |name: &str| match array(name) {
            Some(Array { values: Values::F32(values), .. }) if values.len() == image.grid.len() => Some(&values[..]),
            _ => None,
        };
        let rgba = match array("rgba") {
            Some(Array { values: Values::U8(values), .. }) if values.len() == 4 * image.grid.len() => &values[..],
            _ => return None,
        };
        let occlusion = if separable { Some(floats("ambient_occlusion")?) } else { None };
        Some(Self { rgba, coverage: floats("opacity")?, occlusion })
    }

    fn of(&self, image: &Image) -> Voxels<'i> {
        Voxels { grid: image.grid, rgba: self.rgba, coverage: self.coverage, occlusion: self.occlusion }
    }
}

fn read(path: &Path) -> Result<Image, StageError> {
    match vtk::read(path) {
        Ok(DataSet::Image(image)) => Ok(image),
        _ => Err(damaged(path)),
    }
}

/// Said of a file that is not what was written there.
fn damaged(path: &Path) -> StageError {
    let what = "is no longer the image that was written there; delete it, and run again";
    StageError::Invalid(Invalid::new(path.display().to_string(), what))
}
