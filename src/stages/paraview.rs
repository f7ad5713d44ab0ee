//! `paraview`: a ParaView state (a Python file) that shows images side by side.
//!
//! It works on files alone: which ones, and where in them the voxels are, is known without making any.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
use crate::volume::Grid;

/// A ParaView state (a Python file) that shows images side by side.
#[derive(Clone, Debug, Deserialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct ParaviewSpec {
    /// A name for messages.
    pub id: Option<String>,
    /// The images, from left to right, by the id of their render or write (default: the nearest earlier write).
    pub input: Option<OneOrMany>,
    /// The state: `NAME.py`.
    pub state: String,
    /// The picture that the state writes when it is run: `NAME.png`.
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

/// A ParaView state, as understood.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FigurePlan {
    /// The images' files, from left to right; each has the file that `reader` reads.
    pub writes: Vec<Ref<WritePlan>>,
    /// The state's file, below `out`.
    pub state: PathBuf,
    /// The picture's.
    pub screenshot: Option<PathBuf>,
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
        let writes = shown(spec, path, reader.format(), resolver)?;
        if reader == Reader::Vti {
            for &write in &writes {
                let arrays = &resolver.plan[write].arrays;
                if !arrays.contains(&Aov::Rgba) || !arrays.contains(&Aov::Opacity) {
                    let id = resolver.plan.id(write);
                    let message = format!("shows `{id}`, whose arrays lack rgba or opacity; add them to its `arrays`");
                    return Err(Invalid::new(path, message));
                }
            }
        }
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
        Ok(Self { writes, state, screenshot, reader, cut, size, style, color_by, colorbar })
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

    fn line(me: Ref<Self>, plan: &Plan, _: &[Counts]) -> String {
        let figure = &plan[me];
        let writes: Vec<&str> = figure.writes.iter().map(|&write| plan.id(write)).collect();
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

/// The writes whose files are shown.
fn shown(spec: &ParaviewSpec, path: &str, format: Format, resolver: &Resolver) -> Result<Vec<Ref<WritePlan>>, Invalid> {
    let key = format.key();
    let has_file = |write: Ref<WritePlan>| resolver.plan[write].files.get(format).is_some();
    let Some(ids) = &spec.input else {
        let message = format!("there is no earlier `write` with `{key}` to show; put one first");
        return Ok(vec![resolver.nearest(has_file).ok_or_else(|| Invalid::new(path, message))?]);
    };
    let mut writes = Vec::new();
    for (name, index) in ids.iter() {
        let at = format!("{path}.input{index}");
        let stage = resolver.lookup(&at, name, &[RenderPlan::KIND, WritePlan::KIND])?;
        let write = match resolver.plan.reference::<RenderPlan>(stage) {
            Some(render) => {
                resolver.nearest(|write: Ref<WritePlan>| resolver.plan[write].render == render && has_file(write))
            }
            None => resolver.plan.reference(stage).filter(|&write| has_file(write)),
        };
        let message = format!("`{name}` has no `{key}` file written before this stage");
        writes.push(write.ok_or_else(|| Invalid::new(at, message))?);
    }
    if writes.is_empty() {
        return Err(Invalid::new(format!("{path}.input"), "the list is empty; name at least one image"));
    }
    Ok(writes)
}

/// A figure can colour by ambient occlusion only what its files hold.
fn check_occlusion(resolver: &Resolver, path: &str, reader: Reader, writes: &[Ref<WritePlan>]) -> Result<(), Invalid> {
    let key = format!("{path}.color_by");
    if reader == Reader::Raw {
        let message = "`.raw` files hold colours alone, no ambient occlusion; take `reader: vti`, or `color_by: rgba`";
        return Err(Invalid::new(key, message));
    }
    for &write in writes {
        if !resolver.plan[write].arrays.contains(&Aov::AmbientOcclusion) {
            let id = resolver.plan.id(write);
            return Err(Invalid::new(key, format!("`{id}` has no ambient_occlusion; add it to its `arrays`")));
        }
    }
    Ok(())
}

/// Of several objects each gets a skin of its own, so the file has to tell which voxel is whose, unless it was said what
/// it holds.
fn add_object(resolver: &mut Resolver, write: Ref<WritePlan>) {
    let plan = &mut resolver.plan;
    let render = plan[write].render;
    let volume = plan[render].dimensions[2] > 1;
    let several = plan[plan[render].scene].objects.len() > 1;
    if !volume || !several || plan[write].arrays_given || plan[write].arrays.contains(&Aov::Object) {
        return;
    }
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
    let dark = |write: Ref<WritePlan>| plan[plan[write].render].is_dark();
    let mixed = figure.writes.len() == 2 && figure.writes.iter().filter(|&&write| dark(write)).count() == 1;
    let mut panels = Vec::with_capacity(figure.writes.len());
    for &write in &figure.writes {
        let render = &plan[plan[write].render];
        let grid: Grid = match plan[render.scene].dimension {
            Dimension::Three => camera::<3>(&render.camera)?.grid(render.dimensions),
            Dimension::Four => camera::<4>(&render.camera)?.grid(render.dimensions),
        };
        let file = plan[write].files.get(figure.reader.format()).unwrap_or("".as_ref());
        let caption = match (figure.writes.len(), render.is_dark()) {
            (1, _) => String::new(),
            (2, true) if mixed => "with ambient occlusion".to_owned(),
            (2, false) if mixed => "without ambient occlusion".to_owned(),
            _ => plan.id(plan[write].render).replace(['-', '_'], " "),
        };
        panels.push(paraview::Panel { file: beside(&figure.state, file), caption, grid });
    }
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
