//! `paraview`: a ParaView state (a Python file) that shows images and animations side by side.
//!
//! It works on files alone: which ones, and where in them the voxels are, is known without making any. A figure of
//! animations has time: ParaView plays it, and run without a display the state writes a picture a frame, and a film of them.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::ser::SerializeMap;
use serde::{Deserialize, Serialize, Serializer};

use super::animate::AnimatePlan;
use super::camera::camera;
use super::cut::{Axis, Cut};
use super::describe::Counts;
use super::range::check_length;
use super::render::RenderPlan;
use super::scene::ScenePlan;
use super::write::{Format, PROGRAM, WritePlan, write_whole};
use super::{Invalid, LeftOut, Made, OneOrMany, Plan, Ref, Resolver, Run, Stage, StageError};
use crate::geometry::Dimension;
use crate::io::paraview;
use crate::render::Aov;
use crate::text::number;
use crate::volume::Grid;

/// A ParaView state (a Python file) that shows images side by side.
#[derive(Clone, Debug, Deserialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct ParaviewSpec {
    /// A name for messages.
    pub id: Option<String>,
    /// The images, from left to right, by the id of their render or write, or of an animation (default: the nearest earlier
    /// write or animation).
    pub input: Option<OneOrMany>,
    /// The state: `NAME.py`.
    pub state: String,
    /// The picture that the state writes when it is run: `NAME.png`. Of animations it is the first frame; all of them are
    /// `NAME_0000.png`, `NAME_0001.png`, ..., and `NAME.mp4` is the film that ffmpeg makes of them, where that is installed.
    pub screenshot: Option<String>,
    /// Which files the state reads (default `vti`).
    pub reader: Option<Reader>,
    /// How the volumes are cut open (default `none`).
    pub cut: Option<Cut>,
    /// Width and height of the picture in pixels (default: 3200 across in all; with `style: voxels` 800 for each image).
    pub size: Option<Vec<u64>>,
    /// How volumes are drawn (default `surface`).
    pub style: Option<Style>,
    /// What gives the colours (default `rgba`).
    pub color_by: Option<ColorBy>,
    /// Whether a colour bar of ambient occlusion stands in the last panel (default: with `color_by: ambient_occlusion`).
    pub colorbar: Option<bool>,
}

/// How a figure draws volumes.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Style {
    /// Bodies with smooth skins, for print.
    #[default]
    Surface,
    /// Voxels as boxes, and slices below.
    Voxels,
}

/// What gives a figure its colours.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ColorBy {
    /// The image's colours, darkened by ambient occlusion.
    #[default]
    Rgba,
    /// Ambient occlusion alone, by a colour map that is even to the eye.
    AmbientOcclusion,
}

/// Which files a state reads.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reader {
    /// The `.vti`.
    #[default]
    Vti,
    /// The `.raw`, as the thesis did.
    Raw,
}

impl Reader {
    /// The format of the files that it reads.
    fn format(self) -> Format {
        match self {
            Self::Vti => Format::Vti,
            Self::Raw => Format::Raw,
        }
    }
}

/// What a panel of a figure shows. As JSON a write is its number, an animation `{animation: NUMBER}`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shown {
    /// An image.
    Image(Ref<WritePlan>),
    /// One that changes.
    Animation(Ref<AnimatePlan>),
}

impl Serialize for Shown {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Image(write) => write.serialize(serializer),
            Self::Animation(animation) => {
                let mut map = serializer.serialize_map(Some(1))?;
                map.serialize_entry("animation", animation)?;
                map.end()
            }
        }
    }
}

impl Shown {
    /// Its place among all stages.
    pub fn index(self) -> usize {
        match self {
            Self::Image(write) => write.index(),
            Self::Animation(animation) => animation.index(),
        }
    }

    /// The render that it is of.
    pub(super) fn render(self, plan: &Plan) -> Ref<RenderPlan> {
        match self {
            Self::Image(write) => plan[write].render,
            Self::Animation(animation) => plan[animation].render,
        }
    }

    /// What its files hold.
    pub(super) fn arrays(self, plan: &Plan) -> &[Aov] {
        match self {
            Self::Image(write) => &plan[write].arrays,
            Self::Animation(animation) => &plan[animation].arrays,
        }
    }

    /// How many frames it has, and how many of them a second, if it changes.
    fn frames(self, plan: &Plan) -> Option<(usize, f64)> {
        match self {
            Self::Image(_) => None,
            Self::Animation(animation) => Some((plan[animation].files.len(), plan[animation].rate)),
        }
    }
}

/// A ParaView state, as understood.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FigurePlan {
    /// What it shows, from left to right; each image has the file that `reader` reads.
    pub writes: Vec<Shown>,
    /// The state's file, below `out`.
    pub state: PathBuf,
    /// The picture's.
    pub screenshot: Option<PathBuf>,
    /// The film's, which the state makes of animations where ffmpeg is installed.
    pub film: Option<PathBuf>,
    /// Which files it reads.
    pub reader: Reader,
    /// How the volumes are cut open.
    pub cut: Cut,
    /// Width and height of the picture in pixels, where they were given.
    pub size: Option<[u32; 2]>,
    /// How it draws volumes.
    pub style: Style,
    /// What gives the colours.
    pub color_by: ColorBy,
    /// Whether it has a colour bar.
    pub colorbar: bool,
}

impl Stage for FigurePlan {
    type Spec = ParaviewSpec;
    const KIND: &'static str = "paraview";
    const LIST: &'static str = "figures";
    /// A state is made at once, and held against the file that is there: it needs no key.
    const LEFT_OUT: &'static [LeftOut] = &[];

    fn id(spec: &ParaviewSpec) -> Option<&str> {
        spec.id.as_deref()
    }

    fn resolve(spec: &ParaviewSpec, path: &str, resolver: &mut Resolver) -> Result<Self, Invalid> {
        let reader = spec.reader.unwrap_or_default();
        let writes = with_twins(shown(spec, path, reader.format(), resolver)?, resolver);
        if reader == Reader::Vti {
            for &write in &writes {
                let arrays = write.arrays(&resolver.plan);
                if !arrays.contains(&Aov::Rgba) || !arrays.contains(&Aov::Opacity) {
                    let id = &resolver.plan.stages[write.index()].id;
                    let message = format!("shows `{id}`, whose arrays lack rgba or opacity; add them to its `arrays`");
                    return Err(Invalid::new(path, message));
                }
            }
        }
        check_frames(resolver, path, reader, &writes)?;
        let (style, color_by) = (spec.style.unwrap_or_default(), spec.color_by.unwrap_or_default());
        if color_by == ColorBy::AmbientOcclusion {
            check_occlusion(resolver, path, reader, &writes)?;
        }
        if style == Style::Surface && reader == Reader::Vti {
            writes.iter().for_each(|&write| add_object(resolver, write));
        }
        let colorbar = spec.colorbar.unwrap_or(color_by == ColorBy::AmbientOcclusion);
        let state = resolver.outputs.claim(&format!("{path}.state"), &spec.state, Some("py"))?;
        let screenshot = match &spec.screenshot {
            Some(name) => Some(resolver.outputs.claim(&format!("{path}.screenshot"), name, Some("png"))?),
            None => None,
        };
        let film = match (&screenshot, writes.iter().find_map(|shown| shown.frames(&resolver.plan))) {
            (Some(picture), Some((frames, _))) => {
                let (key, stem) = (format!("{path}.screenshot"), picture.with_extension(""));
                let stem = stem.to_string_lossy();
                for i in 0..frames {
                    resolver.outputs.claim(&key, &format!("{stem}_{i:04}.png"), None)?;
                }
                Some(resolver.outputs.claim(&key, &format!("{stem}.mp4"), None)?)
            }
            _ => None,
        };
        let size = match spec.size.as_deref() {
            None => None,
            Some(&[width, height]) => {
                for (i, n) in [width, height].into_iter().enumerate() {
                    if !(16..=16_384).contains(&n) {
                        let message = format!("expected 16 to 16384 pixels, found {n}");
                        return Err(Invalid::new(format!("{path}.size[{i}]"), message));
                    }
                }
                Some([width as u32, height as u32])
            }
            Some(other) => {
                return Err(Invalid::new(format!("{path}.size"), format!("expected [WIDTH, HEIGHT], found {other:?}")));
            }
        };
        let cut = spec.cut.unwrap_or_default();
        if let Cut::Plane(plane) = cut {
            check_length(&format!("{path}.cut.at"), plane.at)?;
        }
        Ok(Self { writes, state, screenshot, film, reader, cut, size, style, color_by, colorbar })
    }

    fn works_on(&self) -> Vec<usize> {
        self.writes.iter().map(|write| write.index()).collect()
    }

    fn scene(_: Ref<Self>, _: &Plan) -> Option<Ref<ScenePlan>> {
        None
    }

    fn files(&self) -> Vec<&Path> {
        std::iter::once(&self.state).chain(&self.screenshot).map(PathBuf::as_path).collect()
    }

    /// The film.
    fn files_beside(&self) -> Vec<PathBuf> {
        self.film.iter().cloned().collect()
    }

    fn line(me: Ref<Self>, plan: &Plan, _: &[Counts]) -> String {
        let figure = &plan[me];
        let writes: Vec<&str> = figure.writes.iter().map(|shown| plan.stages[shown.index()].id.as_str()).collect();
        let picture = figure.screenshot.iter().map(|file| format!(", {}", file.display()));
        format!("{} -> {}{}", writes.join(", "), figure.state.display(), picture.collect::<String>())
    }

    /// Writes the state, if it isn't there already.
    fn run_last(me: Ref<Self>, run: &mut Run) -> Result<String, StageError> {
        let (plan, figure) = (run.plan, &run.plan[me]);
        let state = state(plan, figure)?;
        let path = plan.out.join(&figure.state);
        let unchanged = !run.force && holds(&path, state.as_bytes());
        if !unchanged {
            write_whole(&path, state.as_bytes())?;
        }
        let bytes = state.len() as u64;
        run.ledger.record(Made { file: &figure.state, bytes, notes: Vec::new(), named: true, unchanged })?;
        Ok(String::new())
    }
}

/// What is shown.
fn shown(spec: &ParaviewSpec, path: &str, format: Format, resolver: &Resolver) -> Result<Vec<Shown>, Invalid> {
    let key = format.key();
    let has_file = |write: Ref<WritePlan>| resolver.plan[write].files.get(format).is_some();
    let Some(ids) = &spec.input else {
        let message = format!("there is no earlier `write` with `{key}` to show; put one first");
        let image = resolver.nearest(has_file).map(Shown::Image);
        // Animations have no other files than `.vti`.
        let animation = resolver.nearest(|_: Ref<AnimatePlan>| format == Format::Vti).map(Shown::Animation);
        let nearest = [image, animation].into_iter().flatten().max_by_key(|shown| shown.index());
        return Ok(vec![nearest.ok_or_else(|| Invalid::new(path, message))?]);
    };
    let mut writes = Vec::new();
    for (name, index) in ids.iter() {
        let at = format!("{path}.input{index}");
        let stage = resolver.lookup(&at, name, &[RenderPlan::KIND, WritePlan::KIND, AnimatePlan::KIND])?;
        if let Some(animation) = resolver.plan.reference(stage) {
            writes.push(Shown::Animation(animation));
            continue;
        }
        let write = match resolver.plan.reference::<RenderPlan>(stage) {
            Some(render) => {
                resolver.nearest(|write: Ref<WritePlan>| resolver.plan[write].render == render && has_file(write))
            }
            None => resolver.plan.reference(stage).filter(|&write| has_file(write)),
        };
        let message = format!("`{name}` has no `{key}` file written before this stage");
        writes.push(Shown::Image(write.ok_or_else(|| Invalid::new(at, message))?));
    }
    if writes.is_empty() {
        return Err(Invalid::new(format!("{path}.input"), "the list is empty; name at least one image"));
    }
    Ok(writes)
}

/// Each image of a scene with a twin has that to its left, unless it is shown already.
fn with_twins(writes: Vec<Shown>, resolver: &Resolver) -> Vec<Shown> {
    let plan = &resolver.plan;
    let twin = |shown: Shown| -> Option<Shown> {
        let index = resolver.twin_of(shown.index())?;
        let twin = match shown {
            Shown::Image(_) => Shown::Image(plan.reference(index)?),
            Shown::Animation(_) => Shown::Animation(plan.reference(index)?),
        };
        (!writes.contains(&twin)).then_some(twin)
    };
    writes.iter().flat_map(|&shown| twin(shown).into_iter().chain([shown])).collect()
}

/// Animations in one figure are played together, from their `.vti`.
fn check_frames(resolver: &Resolver, path: &str, reader: Reader, writes: &[Shown]) -> Result<(), Invalid> {
    let mut first: Option<(usize, f64)> = None;
    for shown in writes {
        let Some(frames) = shown.frames(&resolver.plan) else { continue };
        let id = &resolver.plan.stages[shown.index()].id;
        if reader == Reader::Raw {
            let message = format!("`{id}` is an animation, whose frames are `.vti`; take `reader: vti`");
            return Err(Invalid::new(format!("{path}.reader"), message));
        }
        let (count, rate) = *first.get_or_insert(frames);
        if frames != (count, rate) {
            let message = format!(
                "animations in one figure are played together, so they need as many frames at the same rate: `{id}` has {} at \
                 {} a second, and another {count} at {}",
                frames.0,
                number(frames.1),
                number(rate)
            );
            return Err(Invalid::new(format!("{path}.input"), message));
        }
    }
    Ok(())
}

/// A figure can colour by ambient occlusion only what its files hold.
fn check_occlusion(resolver: &Resolver, path: &str, reader: Reader, writes: &[Shown]) -> Result<(), Invalid> {
    let key = format!("{path}.color_by");
    if reader == Reader::Raw {
        let message = "`.raw` files hold colours alone, no ambient occlusion; take `reader: vti`, or `color_by: rgba`";
        return Err(Invalid::new(key, message));
    }
    for &write in writes {
        if !write.arrays(&resolver.plan).contains(&Aov::AmbientOcclusion) {
            let id = &resolver.plan.stages[write.index()].id;
            return Err(Invalid::new(key, format!("`{id}` has no ambient_occlusion; add it to its `arrays`")));
        }
    }
    Ok(())
}

/// Of several objects each gets a skin of its own, so the file has to tell which voxel is whose, unless it was said what
/// it holds.
fn add_object(resolver: &mut Resolver, shown: Shown) {
    let plan = &mut resolver.plan;
    let render = shown.render(plan);
    let volume = plan[render].dimensions[2] > 1;
    let several = plan[plan[render].scene].objects.len() > 1;
    let given = match shown {
        Shown::Image(write) => plan[write].arrays_given,
        Shown::Animation(animation) => plan[animation].arrays_given,
    };
    if !volume || !several || given || shown.arrays(plan).contains(&Aov::Object) {
        return;
    }
    let write = match shown {
        Shown::Image(write) => write,
        Shown::Animation(animation) => {
            return plan.get_mut(animation).into_iter().for_each(|animation| animation.arrays.push(Aov::Object));
        }
    };
    if let Some(write) = plan.get_mut(write) {
        write.arrays.push(Aov::Object);
    }
    if let Some(render) = plan.get_mut(render)
        && !render.arrays.contains(&Aov::Object)
    {
        render.arrays.push(Aov::Object);
        render.arrays.sort_unstable();
    }
}

/// The state's text.
fn state(plan: &Plan, figure: &FigurePlan) -> Result<String, StageError> {
    let dark = |shown: Shown| plan[shown.render(plan)].is_dark();
    let twins = figure.writes.len() == 2 && plan.is_twin(figure.writes[0].index());
    let mixed = figure.writes.len() == 2 && figure.writes.iter().filter(|&&write| dark(write)).count() == 1;
    let mut panels = Vec::with_capacity(figure.writes.len());
    for &write in &figure.writes {
        let render = &plan[write.render(plan)];
        let grid: Grid = match plan[render.scene].dimension {
            Dimension::Three => camera::<3>(&render.camera)?.grid(render.dimensions),
            Dimension::Four => camera::<4>(&render.camera)?.grid(render.dimensions),
        };
        let file = match write {
            Shown::Image(write) => plan[write].files.get(figure.reader.format()).unwrap_or("".as_ref()),
            Shown::Animation(animation) => &plan[animation].list,
        };
        let caption = match (figure.writes.len(), render.is_dark()) {
            (1, _) => String::new(),
            (2, _) if twins => if plan.is_twin(write.index()) { "in 3D" } else { "in 4D" }.to_owned(),
            (2, true) if mixed => "with ambient occlusion".to_owned(),
            (2, false) if mixed => "without ambient occlusion".to_owned(),
            _ => match write {
                Shown::Image(write) => plan.id(plan[write].render),
                Shown::Animation(animation) => plan.id(animation),
            }
            .replace(['-', '_'], " "),
        };
        panels.push(paraview::Panel { file: beside(&figure.state, file), caption, grid });
    }
    let frames = figure.writes.iter().find_map(|shown| shown.frames(plan));
    Ok(paraview::state(&paraview::Figure {
        title: plan.name.clone(),
        program: PROGRAM.to_owned(),
        panels,
        source: match figure.reader {
            Reader::Vti => paraview::Source::Vti,
            Reader::Raw => paraview::Source::Raw,
        },
        cut: match figure.cut {
            Cut::None => paraview::Cut::None,
            Cut::Octant => paraview::Cut::Octant { corner: None },
            Cut::Plane(plane) => paraview::Cut::Plane {
                axis: match plane.plane {
                    Axis::X => paraview::Axis::X,
                    Axis::Y => paraview::Axis::Y,
                    Axis::Z => paraview::Axis::Z,
                },
                at: plane.at,
            },
        },
        screenshot: figure.screenshot.as_ref().map(|file| beside(&figure.state, file)),
        film: frames.map(|(frames, rate)| paraview::Film { frames, rate }),
        size: figure.size,
        style: match figure.style {
            Style::Surface => paraview::Style::Surface,
            Style::Voxels => paraview::Style::Voxels,
        },
        color_by: match figure.color_by {
            ColorBy::Rgba => paraview::ColorBy::Rgba,
            ColorBy::AmbientOcclusion => paraview::ColorBy::AmbientOcclusion,
        },
        colorbar: figure.colorbar,
    }))
}

/// The path of a file in the output folder, as a state in the same folder names it.
fn beside(state: &Path, file: &Path) -> String {
    let up = state.parent().map_or(0, |p| p.components().count());
    let mut path = "../".repeat(up);
    let names: Vec<String> = file.components().map(|c| c.as_os_str().to_string_lossy().into_owned()).collect();
    path.push_str(&names.join("/"));
    path
}

/// Whether a regular file holds just these bytes already.
fn holds(path: &Path, bytes: &[u8]) -> bool {
    crate::input::length(path).is_ok_and(|length| length == bytes.len() as u64)
        && crate::input::read(path).is_ok_and(|found| found == bytes)
}
