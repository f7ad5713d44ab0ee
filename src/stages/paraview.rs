//! `paraview`: a ParaView state (a Python file) that shows images and animations side by side, and beside or over them
//! wireframes as tubes, and slices.
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
use super::piece;
use super::range::{check_length, positive};
use super::render::RenderPlan;
use super::scene::ScenePlan;
use super::slice::SlicePlan;
use super::wireframe::WireframePlan;
use super::write::{Format, PROGRAM, WritePlan, write_whole};
use super::{Invalid, LeftOut, Made, OneOrMany, Plan, Ref, Resolver, Run, Stage, StageError, Told};
use crate::geometry::Dimension;
use crate::io::paraview::{self, Film};
use crate::render::Aov;
use crate::text::number;
use crate::volume::Grid;

/// How opaque skins are below tubes, where nothing else is said.
const SKIN: f64 = 0.3;

/// How many slices of a sequence a film has a second.
const SLICES_A_SECOND: f64 = 8.0;

/// A ParaView state (a Python file) that shows images side by side.
#[derive(Clone, Debug, Deserialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct ParaviewSpec {
    /// A name for messages.
    pub id: Option<String>,
    /// What it shows, from left to right: images, by the id of their render or write, animations, wireframes and slices
    /// (default: the nearest earlier write or animation).
    pub input: Option<OneOrMany>,
    /// How the edges of wireframes are drawn, and which are drawn over images.
    pub edges: Option<EdgesSpec>,
    /// How a sequence of slices is shown (default `together`).
    pub slices: Option<Sequence>,
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

/// How a figure draws the edges of wireframes: as tubes.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct EdgesSpec {
    /// The wireframe that is drawn over the images of its render, by its id; `none` draws none there (default: the nearest
    /// earlier one, unless `input` has a wireframe).
    pub over: Option<String>,
    /// What gives tubes their colour (default `depth`, or what there is).
    pub color_by: Option<EdgeColor>,
    /// How parts are drawn that something hides (default `thin`).
    pub hidden: Option<HiddenEdges>,
    /// The radius of tubes, in the units of the image (default: as fits the picture).
    pub radius: Option<f64>,
    /// How opaque the skins of bodies are that tubes are drawn over, 0 to 1 (default 0.3; only with `style: surface`).
    #[schemars(range(min = 0, max = 1))]
    pub skin: Option<f64>,
}

/// What gives tubes their colour.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum EdgeColor {
    /// The distance from the eye: what is near is dark.
    #[default]
    Depth,
    /// The fourth coordinate.
    W,
    /// Nothing: all are dark grey.
    None,
}

/// How parts of edges are drawn that something hides.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum HiddenEdges {
    /// Thin and pale.
    #[default]
    Thin,
    /// Not at all.
    LeaveOut,
    /// As the others.
    Same,
}

/// How edges are drawn, as understood.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct EdgesPlan {
    /// What is drawn over images.
    pub over: Option<Ref<WireframePlan>>,
    /// What gives them their colour.
    pub color_by: EdgeColor,
    /// How hidden parts are drawn.
    pub hidden: HiddenEdges,
    /// The radius of tubes, where it was given.
    pub radius: Option<f64>,
    /// How opaque the skins below are.
    pub skin: f64,
}

/// How a figure shows a sequence of slices.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Sequence {
    /// All at once, each in a colour, cut open as `cut` says.
    #[default]
    Together,
    /// One after the other, as ParaView plays time; the film has eight a second.
    Play,
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

/// What a panel of a figure shows. As JSON a write is its number, another `{KIND: NUMBER}`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shown {
    /// An image.
    Image(Ref<WritePlan>),
    /// One that changes.
    Animation(Ref<AnimatePlan>),
    /// Edges alone.
    Wireframe(Ref<WireframePlan>),
    /// Slices alone; those of a sequence together.
    Slice(Ref<SlicePlan>),
}

impl Serialize for Shown {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = match self {
            Self::Image(write) => return write.serialize(serializer),
            _ => serializer.serialize_map(Some(1))?,
        };
        match self {
            Self::Image(_) => {}
            Self::Animation(animation) => map.serialize_entry("animation", animation)?,
            Self::Wireframe(wireframe) => map.serialize_entry("wireframe", wireframe)?,
            Self::Slice(slice) => map.serialize_entry("slice", slice)?,
        }
        map.end()
    }
}

impl Shown {
    /// Its place among all stages.
    pub fn index(self) -> usize {
        match self {
            Self::Image(write) => write.index(),
            Self::Animation(animation) => animation.index(),
            Self::Wireframe(wireframe) => wireframe.index(),
            Self::Slice(slice) => slice.index(),
        }
    }

    /// The render that it is an image of.
    pub(super) fn render(self, plan: &Plan) -> Option<Ref<RenderPlan>> {
        match self {
            Self::Image(write) => Some(plan[write].render),
            Self::Animation(animation) => Some(plan[animation].render),
            Self::Wireframe(_) | Self::Slice(_) => None,
        }
    }

    /// What its files hold.
    pub(super) fn arrays(self, plan: &Plan) -> &[Aov] {
        match self {
            Self::Image(write) => &plan[write].arrays,
            Self::Animation(animation) => &plan[animation].arrays,
            Self::Wireframe(_) | Self::Slice(_) => &[],
        }
    }

    /// Its frames, if it changes.
    fn film(self, plan: &Plan, slices: Sequence) -> Option<Film> {
        match self {
            Self::Animation(animation) => {
                Some(Film { frames: plan[animation].files.len(), rate: plan[animation].rate, times: None })
            }
            Self::Slice(slice) if slices == Sequence::Play && plan[slice].list.is_some() => {
                let places = plan[slice].places.clone();
                Some(Film { frames: places.len(), rate: SLICES_A_SECOND, times: Some(places) })
            }
            Self::Image(_) | Self::Wireframe(_) | Self::Slice(_) => None,
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
    /// How it draws edges; none if it has none.
    pub edges: Option<EdgesPlan>,
    /// How it shows sequences of slices.
    pub slices: Sequence,
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
            for &write in writes.iter().filter(|shown| shown.render(&resolver.plan).is_some()) {
                let arrays = write.arrays(&resolver.plan);
                if !arrays.contains(&Aov::Rgba) || !arrays.contains(&Aov::Opacity) {
                    let id = &resolver.plan.stages[write.index()].id;
                    let message = format!("shows `{id}`, whose arrays lack rgba or opacity; add them to its `arrays`");
                    return Err(Invalid::new(path, message));
                }
            }
        }
        let slices = spec.slices.unwrap_or_default();
        let first = check_frames(resolver, path, reader, &writes, slices)?;
        let played = first.as_ref().is_some_and(|film| film.times.is_some());
        if slices == Sequence::Play && !played {
            resolver.warn(format!("{path}.slices"), "has no use where no sequence of slices is shown");
        }
        let edges = edges(spec, path, &writes, resolver)?;
        let (style, color_by) = (spec.style.unwrap_or_default(), spec.color_by.unwrap_or_default());
        if color_by == ColorBy::AmbientOcclusion {
            check_occlusion(resolver, path, reader, &writes)?;
        }
        if style == Style::Surface && reader == Reader::Vti {
            writes.iter().for_each(|&write| add_object(resolver, path, write));
        }
        let colorbar = spec.colorbar.unwrap_or(color_by == ColorBy::AmbientOcclusion);
        let state = resolver.outputs.claim(&format!("{path}.state"), &spec.state, Some("py"))?;
        let screenshot = match &spec.screenshot {
            Some(name) => Some(resolver.outputs.claim(&format!("{path}.screenshot"), name, Some("png"))?),
            None => None,
        };
        let film = match (&screenshot, first) {
            (Some(picture), Some(Film { frames, .. })) => {
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
        Ok(Self { writes, state, screenshot, film, edges, slices, reader, cut, size, style, color_by, colorbar })
    }

    fn works_on(&self) -> Vec<usize> {
        let over = self.edges.and_then(|edges| edges.over).map(Ref::index);
        self.writes.iter().map(|write| write.index()).chain(over).collect()
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
    fn run_last(me: Ref<Self>, run: &mut Run) -> Result<Told, StageError> {
        let (plan, figure) = (run.plan, &run.plan[me]);
        // Of pieces the first shows the parts of all, where parts are listed.
        if plan.piece.is_some_and(|piece| piece.index() > 0 || !figure.has_parts()) {
            return Ok("made when the pieces are joined".into());
        }
        let state = state(plan, figure)?;
        let path = plan.out.join(&figure.state);
        let unchanged = !run.force && holds(&path, state.as_bytes());
        if !unchanged {
            write_whole(&path, state.as_bytes())?;
        }
        let bytes = state.len() as u64;
        run.ledger.record(Made { file: &figure.state, bytes, notes: Vec::new(), named: true, unchanged })?;
        Ok(Told::default())
    }
}

impl FigurePlan {
    /// Whether it can show the parts of a run's pieces: lists are those of images, and what is drawn of the scene is made later.
    fn has_parts(&self) -> bool {
        let drawn_over = self.edges.is_some_and(|edges| edges.over.is_some());
        let images = self.writes.iter().all(|shown| matches!(shown, Shown::Image(_)));
        self.reader == Reader::Vti && images && !drawn_over
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
        let kinds = [RenderPlan::KIND, WritePlan::KIND, AnimatePlan::KIND, WireframePlan::KIND, SlicePlan::KIND];
        let stage = resolver.lookup(&at, name, &kinds)?;
        let wireframe = resolver.plan.reference(stage).map(Shown::Wireframe);
        if let Some(shown) = wireframe.or(resolver.plan.reference(stage).map(Shown::Slice)) {
            writes.push(shown);
            continue;
        }
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
            Shown::Wireframe(_) => Shown::Wireframe(plan.reference(index)?),
            Shown::Slice(_) => return None,
        };
        (!writes.contains(&twin)).then_some(twin)
    };
    writes.iter().flat_map(|&shown| twin(shown).into_iter().chain([shown])).collect()
}

/// How edges are drawn, and which are drawn over images; none if there are none.
fn edges(
    spec: &ParaviewSpec,
    path: &str,
    shown: &[Shown],
    resolver: &mut Resolver,
) -> Result<Option<EdgesPlan>, Invalid> {
    let path = format!("{path}.edges");
    let alone = shown.iter().any(|shown| matches!(shown, Shown::Wireframe(_)));
    let Some(given) = &spec.edges else {
        let usual =
            EdgesPlan { over: None, color_by: EdgeColor::Depth, hidden: HiddenEdges::Thin, radius: None, skin: SKIN };
        return Ok(alone.then_some(usual));
    };
    let plan = &resolver.plan;
    let seen = |wireframe: Ref<WireframePlan>| plan[wireframe].render();
    let over: Option<Ref<WireframePlan>> = match given.over.as_deref() {
        Some("none") => None,
        Some(name) => plan.reference(resolver.lookup(&format!("{path}.over"), name, &[WireframePlan::KIND])?),
        None if alone => None,
        None => {
            let message = "there is no earlier `wireframe` that a camera sees; put one first";
            Some(resolver.nearest(|w| seen(w).is_some()).ok_or_else(|| Invalid::new(&path, message))?)
        }
    };
    if let Some(wireframe) = over {
        let key = format!("{path}.over");
        let id = plan.id(wireframe);
        let Some(render) = seen(wireframe) else {
            let message = format!("`{id}` is projected stereographically, as no image is; name it in `input`");
            return Err(Invalid::new(key, message));
        };
        if !shown.iter().any(|&shown| matches!(shown, Shown::Image(_)) && shown.render(plan) == Some(render)) {
            let message = format!(
                "`{id}` is seen by `{}`, of which no image is shown here; add that to `input`",
                plan.id(render)
            );
            return Err(Invalid::new(key, message));
        }
    }
    let drawn = shown.iter().filter_map(|shown| match shown {
        Shown::Wireframe(wireframe) => Some(*wireframe),
        _ => None,
    });
    let drawn: Vec<Ref<WireframePlan>> = drawn.chain(over).collect();
    if drawn.is_empty() {
        resolver.warn(path, "has no use where no edges are drawn");
        return Ok(None);
    }
    // Twins have no w, and are drawn in one colour then.
    let flat = |w: &Ref<WireframePlan>| plan[plan[*w].scene].dimension == Dimension::Three && !plan.is_twin(w.index());
    if given.color_by == Some(EdgeColor::W)
        && let Some(wireframe) = drawn.iter().find(|w| flat(w))
    {
        let message = format!("`{}` is of a 3D scene, which has no w; take `depth` or `none`", plan.id(*wireframe));
        return Err(Invalid::new(format!("{path}.color_by"), message));
    }
    if given.color_by == Some(EdgeColor::Depth)
        && let Some(wireframe) = drawn.iter().find(|w| seen(**w).is_none())
    {
        let message =
            format!("`{}` is projected stereographically and has no depth; take `w` or `none`", plan.id(*wireframe));
        return Err(Invalid::new(format!("{path}.color_by"), message));
    }
    let radius = given.radius.map(|radius| positive(&format!("{path}.radius"), radius)).transpose()?;
    let skin = given.skin.unwrap_or(SKIN);
    if !(0.0..=1.0).contains(&skin) {
        let message = format!("expected a number from 0 to 1, found {}", number(skin));
        return Err(Invalid::new(format!("{path}.skin"), message));
    }
    let (color_by, hidden) = (given.color_by.unwrap_or_default(), given.hidden.unwrap_or_default());
    Ok(Some(EdgesPlan { over, color_by, hidden, radius, skin }))
}

/// Animations in one figure are played together, from their `.vti`, and so are sequences of slices, from their `.vtp`.
/// Returns the first of them.
fn check_frames(
    resolver: &Resolver,
    path: &str,
    reader: Reader,
    writes: &[Shown],
    slices: Sequence,
) -> Result<Option<Film>, Invalid> {
    let mut first: Option<Film> = None;
    for shown in writes {
        let Some(film) = shown.film(&resolver.plan, slices) else { continue };
        let id = &resolver.plan.stages[shown.index()].id;
        if reader == Reader::Raw && film.times.is_none() {
            let message = format!("`{id}` is an animation, whose frames are `.vti`; take `reader: vti`");
            return Err(Invalid::new(format!("{path}.reader"), message));
        }
        let message = match &first {
            None => {
                first = Some(film);
                continue;
            }
            Some(other) if *other == film => continue,
            Some(other) if other.times.is_some() != film.times.is_some() => format!(
                "`{id}` can't be played here: an animation has a time in seconds, and slices have their places for it; make two \
                 figures, or show `slices: together`"
            ),
            Some(other) if other.times.is_some() => format!(
                "sequences of slices in one figure are played together, so they need the same `range` and `count`: `{id}` has \
                 others than the one before it"
            ),
            Some(other) => format!(
                "animations in one figure are played together, so they need as many frames at the same rate: `{id}` has {} at \
                 {} a second, and another {} at {}",
                film.frames,
                number(film.rate),
                other.frames,
                number(other.rate)
            ),
        };
        return Err(Invalid::new(format!("{path}.input"), message));
    }
    Ok(first)
}

/// A figure can colour by ambient occlusion only what its files hold.
fn check_occlusion(resolver: &Resolver, path: &str, reader: Reader, writes: &[Shown]) -> Result<(), Invalid> {
    let key = format!("{path}.color_by");
    if reader == Reader::Raw {
        let message = "`.raw` files hold colours alone, no ambient occlusion; take `reader: vti`, or `color_by: rgba`";
        return Err(Invalid::new(key, message));
    }
    for &write in writes.iter().filter(|shown| shown.render(&resolver.plan).is_some()) {
        if !write.arrays(&resolver.plan).contains(&Aov::AmbientOcclusion) {
            let id = &resolver.plan.stages[write.index()].id;
            return Err(Invalid::new(key, format!("`{id}` has no ambient_occlusion; add it to its `arrays`")));
        }
    }
    Ok(())
}

/// Of several objects each gets a skin of its own, so the file has to tell which voxel is whose. Where it was said what the
/// file holds, that is warned of.
fn add_object(resolver: &mut Resolver, path: &str, shown: Shown) {
    let plan = &mut resolver.plan;
    let Some(render) = shown.render(plan) else { return };
    let volume = plan[render].dimensions[2] > 1;
    let several = plan[plan[render].scene].objects.len() > 1;
    let given = match shown {
        Shown::Image(write) => plan[write].arrays_given,
        Shown::Animation(animation) => plan[animation].arrays_given,
        Shown::Wireframe(_) | Shown::Slice(_) => return,
    };
    if !volume || !several || shown.arrays(plan).contains(&Aov::Object) {
        return;
    }
    if given {
        let message = format!(
            "shows `{}`, whose arrays lack `object`: its bodies share one skin, and their colours run together where they \
             meet; add it to its `arrays`",
            plan.stages[shown.index()].id
        );
        return resolver.warn(path, message);
    }
    let write = match shown {
        Shown::Image(write) => write,
        Shown::Animation(animation) => {
            return plan.get_mut(animation).into_iter().for_each(|animation| animation.arrays.push(Aov::Object));
        }
        Shown::Wireframe(_) | Shown::Slice(_) => return,
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
    let dark = |shown: Shown| shown.render(plan).is_some_and(|render| plan[render].is_dark());
    let images = figure.writes.iter().all(|shown| shown.render(plan).is_some());
    let twins = figure.writes.len() == 2 && plan.is_twin(figure.writes[0].index());
    let mixed = images && figure.writes.len() == 2 && figure.writes.iter().filter(|&&write| dark(write)).count() == 1;
    let over = figure.edges.and_then(|edges| edges.over);
    let mut panels = Vec::with_capacity(figure.writes.len());
    for &write in &figure.writes {
        let view = match (write, write.render(plan)) {
            (Shown::Wireframe(wireframe), _) => plan[wireframe].render(),
            (_, render) => render,
        };
        let grid: Option<Grid> = match view.map(|render| &plan[render]) {
            None => None,
            Some(render) => Some(match plan[render.scene].dimension {
                Dimension::Three => camera::<3>(&render.camera)?.grid(render.dimensions),
                Dimension::Four => camera::<4>(&render.camera)?.grid(render.dimensions),
            }),
        };
        let kind = match write {
            Shown::Image(_) | Shown::Animation(_) => paraview::Kind::Volume,
            Shown::Wireframe(_) => paraview::Kind::Edges,
            Shown::Slice(_) => paraview::Kind::Slices,
        };
        let files: Vec<&Path> = match write {
            Shown::Image(write) => vec![plan[write].files.get(figure.reader.format()).unwrap_or("".as_ref())],
            Shown::Animation(animation) => vec![&plan[animation].list],
            Shown::Wireframe(wireframe) => vec![&plan[wireframe].file],
            Shown::Slice(slice) => match &plan[slice].list {
                Some(list) if figure.slices == Sequence::Play => vec![list],
                _ => plan[slice].files.iter().map(PathBuf::as_path).collect(),
            },
        };
        let caption = match (figure.writes.len(), dark(write)) {
            (1, _) => String::new(),
            (2, _) if twins => if plan.is_twin(write.index()) { "in 3D" } else { "in 4D" }.to_owned(),
            (2, true) if mixed => "with ambient occlusion".to_owned(),
            (2, false) if mixed => "without ambient occlusion".to_owned(),
            _ => match write {
                Shown::Image(write) => plan.id(plan[write].render),
                other => &plan.stages[other.index()].id,
            }
            .replace(['-', '_'], " "),
        };
        // Of pieces a figure shows the lists of all parts.
        let shown = |file: &Path| plan.piece.map_or_else(|| file.to_owned(), |_| piece::list_of(file));
        let files = files.into_iter().map(|file| beside(&figure.state, &shown(file))).collect();
        let fits = |wireframe: &Ref<WireframePlan>| {
            matches!(write, Shown::Image(_)) && plan[*wireframe].render().is_some_and(|render| Some(render) == view)
        };
        let twin = over.and_then(|over| plan.reference(plan.twin_of(over.index())?));
        let edges = [over, twin].into_iter().flatten().find(fits);
        let edges = edges.map(|wireframe| beside(&figure.state, &plan[wireframe].file));
        panels.push(paraview::Panel { kind, files, caption, grid, edges });
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
        film: figure.writes.iter().find_map(|shown| shown.film(plan, figure.slices)),
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
        tubes: figure.edges.map(|edges| paraview::Tubes {
            color_by: match edges.color_by {
                EdgeColor::Depth => Some("depth"),
                EdgeColor::W => Some("w"),
                EdgeColor::None => None,
            },
            hidden: match edges.hidden {
                HiddenEdges::Thin => paraview::Hidden::Thin,
                HiddenEdges::LeaveOut => paraview::Hidden::LeaveOut,
                HiddenEdges::Same => paraview::Hidden::Same,
            },
            radius: edges.radius,
            skin: edges.skin,
        }),
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
