//! ParaView states: a figure of several volumes, ready to open.
//!
//! A state is a Python script that ParaView runs on File > Load State, and that `pvbatch` runs to write the picture.
//! Its logic is the template `paraview/state.py` with one of two looks, `paraview/surface.py` or `paraview/voxels.py`, the
//! same for every figure; here only the block of constants at its head is filled in, so that a state is read, and
//! edited, like a small program. It names its volumes relative to its
//! own folder, and is pure ASCII: some versions of ParaView decode scripts by the local code page.
//!
//! The volumes may be read from `.vti`, or from the headerless `.raw` as in the thesis (Djami, *Ambient Occlusion in
//! 4D*, 2021), where ParaView has to be told dimensions and number type, and where the background is known by its
//! white alone. Both give the same picture.

use std::fmt::Write;

use crate::volume::Grid;

/// The script, with `@NAME@` where a constant is to stand.
const TEMPLATE: &str = include_str!("../../paraview/state.py");

/// The template's part for bodies with smooth skins.
const SURFACE: &str = include_str!("../../paraview/surface.py");

/// The template's part for voxels as boxes.
const VOXELS: &str = include_str!("../../paraview/voxels.py");

/// What a state shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// The figure's name, for the comment at the head.
    pub title: String,
    /// The program that writes the state, with its version.
    pub program: String,
    /// The volumes, from left to right; the state of a figure without any stops with a message when it is opened.
    pub panels: Vec<Panel>,
    /// What kind of file the panels are.
    pub source: Source,
    /// What is taken away from the volumes, so that one can look inside. Images of one layer are shown whole.
    pub cut: Cut,
    /// The picture that is written when the state is run by `pvbatch` or `pvpython`, relative to the state's folder.
    pub screenshot: Option<String>,
    /// If panels are animations, whose files are `.pvd`: what they have in common.
    pub film: Option<Film>,
    /// Width and height of the picture in pixels; by default what the panels need, 3,200 across all of them with
    /// [`Style::Surface`], 800 across each with [`Style::Voxels`].
    pub size: Option<[u32; 2]>,
    /// How volumes are drawn.
    pub style: Style,
    /// What gives the colours.
    pub color_by: ColorBy,
    /// Whether a colour bar of ambient occlusion stands in the last panel.
    pub colorbar: bool,
    /// How edges are drawn, if there are any.
    pub tubes: Option<Tubes>,
}

/// How edges are drawn: as tubes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tubes {
    /// The array that gives them their colours; else they are dark grey. Edges without it take what they have.
    pub color_by: Option<&'static str>,
    /// How hidden parts are drawn.
    pub hidden: Hidden,
    /// Their radius; by default as fits the picture.
    pub radius: Option<f64>,
    /// How opaque the skins of bodies are that they are drawn over.
    pub skin: f64,
}

/// How hidden parts of edges are drawn, which the array `visible` tells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Hidden {
    /// Thin and pale.
    #[default]
    Thin,
    /// Not at all.
    LeaveOut,
    /// As the others.
    Same,
}

/// How long animations are.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    /// How many frames there are.
    pub frames: usize,
    /// How many of them a second.
    pub rate: f64,
    /// The times that the `.pvd` gives the frames, where these are not seconds from 0 on: of slices, where they are.
    pub times: Option<Vec<f64>>,
}

/// How volumes are drawn. Images of one layer are shown pixel by pixel either way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Style {
    /// Bodies with smooth skins, one an object where the file has an array `object`.
    #[default]
    Surface,
    /// Voxels as boxes, and slices below.
    Voxels,
}

/// What gives the colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColorBy {
    /// The colours of the file.
    #[default]
    Rgba,
    /// A colour map of the file's array `ambient_occlusion`.
    AmbientOcclusion,
}

/// What a panel shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kind {
    /// A volume.
    #[default]
    Volume,
    /// Lines, as tubes.
    Edges,
    /// Surfaces.
    Slices,
}

/// One panel of a figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// What it shows.
    pub kind: Kind,
    /// The files, relative to the state's folder; of a volume one.
    pub files: Vec<String>,
    /// What stands above it; may be empty.
    pub caption: String,
    /// Dimensions and place of a volume, or of the volume that its edges belong to. One layer along z makes it an image,
    /// shown straight on.
    pub grid: Option<Grid>,
    /// The edges that are drawn over a volume.
    pub edges: Option<String>,
}

/// Which files a state reads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Source {
    /// VTK's image files with an array `rgba` or `rgb`, and `opacity` if they have it.
    #[default]
    Vti,
    /// Triples of little-endian float32, x fastest, without a header; voxels of pure white are background.
    Raw,
}

/// How the volumes are cut open. The image of a closed body is a filled solid of voxels; uncut it shows its skin only.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Cut {
    /// Not at all.
    #[default]
    None,
    /// The octant of largest x, y and z goes, which faces the viewer.
    Octant {
        /// Where it begins; by default such that half of the opaque voxels lie on either side along each axis.
        corner: Option<[f64; 3]>,
    },
    /// The side of larger coordinates goes, which faces the viewer.
    Plane {
        /// The axis that the plane is perpendicular to.
        axis: Axis,
        /// Where the plane meets it.
        at: f64,
    },
}

/// An axis of the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// To the right.
    X,
    /// Up.
    Y,
    /// Towards the viewer.
    Z,
}

/// The text of a state.
pub fn state(figure: &Figure) -> String {
    let mut text = String::with_capacity(TEMPLATE.len() + VOXELS.len() + SURFACE.len() + 200 * figure.panels.len());
    let mut rest = TEMPLATE;
    // One pass, so that an `@SIZE@` in a caption stays what it is.
    while let Some((before, name, after)) = next_placeholder(rest) {
        text.push_str(before);
        text.push_str(&constant(figure, name));
        rest = after;
    }
    text.push_str(rest);
    text
}

/// What stands before the next `@NAME@`, the name, and what comes after.
fn next_placeholder(text: &str) -> Option<(&str, &str, &str)> {
    let (before, rest) = text.split_once('@')?;
    let (name, after) = rest.split_once('@')?;
    Some((before, name, after))
}

/// The Python expression for a placeholder.
fn constant(figure: &Figure, name: &str) -> String {
    match name {
        "TITLE" => escaped(&figure.title),
        "PROGRAM" => escaped(&figure.program),
        "PANELS" => panels(&figure.panels),
        "SOURCE" => match figure.source {
            Source::Vti => "'vti'".into(),
            Source::Raw => "'raw'".into(),
        },
        "CUT" => match figure.cut {
            Cut::None => "None".into(),
            Cut::Octant { corner: None } => "('octant', None)".into(),
            Cut::Octant { corner: Some(corner) } => format!("('octant', {})", numbers(&corner)),
            Cut::Plane { axis, at } => format!("('plane', {}, {})", axis as usize, number(at)),
        },
        "SCREENSHOT" => figure.screenshot.as_deref().map_or("None".into(), quoted),
        "FRAMES" => figure.film.as_ref().map_or("None".into(), |film| film.frames.to_string()),
        "RATE" => figure.film.as_ref().map_or("None".into(), |film| number(film.rate)),
        "TIMES" => match figure.film.as_ref().and_then(|film| film.times.as_deref()) {
            None => "None".into(),
            Some(times) => numbers(times),
        },
        "LOOK" => match figure.style {
            Style::Surface => SURFACE.into(),
            Style::Voxels => VOXELS.into(),
        },
        "COLOR_BY" => match figure.color_by {
            ColorBy::Rgba => "'rgba'".into(),
            ColorBy::AmbientOcclusion => "'ambient_occlusion'".into(),
        },
        "COLORBAR" => if figure.colorbar { "True" } else { "False" }.into(),
        "TUBES" => figure.tubes.map_or("None".into(), |tubes| {
            let color_by = tubes.color_by.map_or("None".into(), quoted);
            let hidden = match tubes.hidden {
                Hidden::Thin => "'thin'",
                Hidden::LeaveOut => "'leave_out'",
                Hidden::Same => "'same'",
            };
            let radius = tubes.radius.map_or("None".into(), number);
            format!(
                "{{'color_by': {color_by}, 'hidden': {hidden}, 'radius': {radius}, 'skin': {}}}",
                number(tubes.skin)
            )
        }),
        "SIZE" => figure.size.map_or("None".into(), |[width, height]| format!("[{width}, {height}]")),
        other => format!("@{other}@"),
    }
}

/// The list of volumes, one a line.
fn panels(panels: &[Panel]) -> String {
    let mut text = String::from("[\n");
    for Panel { kind, files, caption, grid, edges } in panels {
        let caption = quoted(caption);
        let file = files.first().map_or("''".into(), |file| quoted(file));
        // Writing to a `String` can't fail.
        let _ = match kind {
            Kind::Volume => write!(text, "    {{'file': {file}, 'caption': {caption}"),
            Kind::Edges => write!(text, "    {{'kind': 'edges', 'file': {file}, 'caption': {caption}"),
            Kind::Slices => {
                let files: Vec<String> = files.iter().map(|file| quoted(file)).collect();
                let files = files.join(", ");
                write!(text, "    {{'kind': 'slices', 'file': {file}, 'files': [{files}], 'caption': {caption}")
            }
        };
        if let Some(edges) = edges {
            let _ = write!(text, ", 'edges': {}", quoted(edges));
        }
        if let Some(grid) = grid {
            let (dimensions, origin, spacing) = (grid.dimensions, numbers(&grid.origin), numbers(&grid.spacing));
            let _ = write!(text, ",\n     'dimensions': {dimensions:?}, 'origin': {origin}, 'spacing': {spacing}");
        }
        text.push_str("},\n");
    }
    text.push(']');
    text
}

/// A Python list of floats.
fn numbers(values: &[f64]) -> String {
    format!("[{}]", values.iter().map(|&v| number(v)).collect::<Vec<_>>().join(", "))
}

/// A Python float, with the digits that bring back the very same number.
fn number(value: f64) -> String {
    if value.is_finite() { format!("{value:?}") } else { format!("float('{value}')") }
}

/// A Python string.
fn quoted(text: &str) -> String {
    format!("'{}'", escaped(text))
}

/// Text within Python's quotes, or a comment: one line of ASCII.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        let _ = match (c, u32::from(c)) {
            ('\\' | '\'', _) => write!(out, "\\{c}"),
            (' '..='~', _) => write!(out, "{c}"),
            (_, code @ 0..=0xff) => write!(out, "\\x{code:02x}"),
            (_, code @ 0x100..=0xffff) => write!(out, "\\u{code:04x}"),
            (_, code) => write!(out, "\\U{code:08x}"),
        };
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure() -> Figure {
        let grid = Grid { dimensions: [50, 40, 30], origin: [-0.98, -0.5, 1.0 / 3.0], spacing: [0.04, 1e-7, 2.0] };
        let panel = |file: &str, caption: &str| Panel {
            kind: Kind::Volume,
            files: vec![file.into()],
            caption: caption.into(),
            grid: Some(grid),
            edges: None,
        };
        Figure {
            title: "two".into(),
            program: "ao4d 0.1.0".into(),
            panels: vec![panel("with.vti", "with"), panel("without.vti", "")],
            source: Source::Vti,
            cut: Cut::None,
            screenshot: Some("figure.png".into()),
            film: None,
            size: None,
            style: Style::Surface,
            color_by: ColorBy::Rgba,
            colorbar: false,
            tubes: None,
        }
    }

    /// The line of a state that sets a constant.
    fn line(state: &str, name: &str) -> String {
        state.lines().find(|line| line.starts_with(&format!("{name} = "))).expect("the constant is set").to_owned()
    }

    #[test]
    fn constants_are_python() {
        let mut figure = figure();
        let text = state(&figure);
        assert!(text.contains("    {'file': 'with.vti', 'caption': 'with',\n"));
        let grid =
            "'dimensions': [50, 40, 30], 'origin': [-0.98, -0.5, 0.3333333333333333], 'spacing': [0.04, 1e-7, 2.0]}";
        assert_eq!(text.matches(grid).count(), 2);
        assert_eq!(line(&text, "SOURCE"), "SOURCE = 'vti'");
        assert_eq!(line(&text, "CUT"), "CUT = None");
        assert_eq!(line(&text, "SCREENSHOT"), "SCREENSHOT = 'figure.png'");
        assert_eq!(line(&text, "SIZE"), "SIZE = None");
        assert_eq!(line(&text, "TUBES"), "TUBES = None");
        assert_eq!((line(&text, "FRAMES"), line(&text, "RATE")), ("FRAMES = None".into(), "RATE = None".into()));
        assert_eq!(line(&text, "COLOR_BY"), "COLOR_BY = 'rgba'");
        assert_eq!(line(&text, "COLORBAR"), "COLORBAR = False");
        // The cut is a clip of ParaView's, and the other look isn't there.
        assert!(text.contains(": cut', Input=bodies)") && !text.contains("RELIEF"));

        figure.film = Some(Film { frames: 72, rate: 24.0, times: None });
        let text = state(&figure);
        assert_eq!((line(&text, "FRAMES"), line(&text, "RATE")), ("FRAMES = 72".into(), "RATE = 24.0".into()));
        assert_eq!(line(&text, "TIMES"), "TIMES = None");
        figure.film = Some(Film { frames: 2, rate: 8.0, times: Some(vec![0.5, -0.25]) });
        assert_eq!(line(&state(&figure), "TIMES"), "TIMES = [0.5, -0.25]");
        figure.film = None;
        figure.source = Source::Raw;
        figure.cut = Cut::Plane { axis: Axis::Z, at: 0.25 };
        figure.screenshot = None;
        figure.size = Some([640, 480]);
        figure.style = Style::Voxels;
        figure.color_by = ColorBy::AmbientOcclusion;
        figure.colorbar = true;
        let text = state(&figure);
        assert_eq!(line(&text, "COLOR_BY"), "COLOR_BY = 'ambient_occlusion'");
        assert_eq!(line(&text, "COLORBAR"), "COLORBAR = True");
        assert!(text.contains("RELIEF") && !text.contains(": cut', Input=bodies)"));
        assert_eq!(line(&text, "SOURCE"), "SOURCE = 'raw'");
        assert_eq!(line(&text, "CUT"), "CUT = ('plane', 2, 0.25)");
        assert_eq!(line(&text, "SCREENSHOT"), "SCREENSHOT = None");
        assert_eq!(line(&text, "SIZE"), "SIZE = [640, 480]");

        let edges = Panel { kind: Kind::Edges, files: vec!["e.vtp".into()], grid: None, ..figure.panels[1].clone() };
        let files = vec!["a.vtp".into(), "b.vtp".into()];
        let slices = Panel { kind: Kind::Slices, files, edges: None, ..edges.clone() };
        figure.panels[0].edges = Some("e.vtp".into());
        figure.panels.extend([edges, slices]);
        figure.tubes = Some(Tubes { color_by: Some("w"), hidden: Hidden::LeaveOut, radius: None, skin: 0.5 });
        let text = state(&figure);
        assert!(text.contains("{'file': 'with.vti', 'caption': 'with', 'edges': 'e.vtp',\n     'dimensions'"));
        assert!(text.contains("    {'kind': 'edges', 'file': 'e.vtp', 'caption': ''},\n"));
        assert!(
            text.contains("    {'kind': 'slices', 'file': 'a.vtp', 'files': ['a.vtp', 'b.vtp'], 'caption': ''},\n")
        );
        let tubes = "TUBES = {'color_by': 'w', 'hidden': 'leave_out', 'radius': None, 'skin': 0.5}";
        assert_eq!(line(&text, "TUBES"), tubes);

        figure.cut = Cut::Octant { corner: None };
        assert_eq!(line(&state(&figure), "CUT"), "CUT = ('octant', None)");
        figure.cut = Cut::Octant { corner: Some([0.0, f64::NAN, -1e300]) };
        assert_eq!(line(&state(&figure), "CUT"), "CUT = ('octant', [0.0, float('NaN'), -1e300])");
    }

    #[test]
    fn nothing_is_left_to_fill_in() {
        for style in [Style::Surface, Style::Voxels] {
            let text = state(&Figure { style, ..figure() });
            assert!(!text.contains('@'), "a placeholder without a constant");
        }
    }

    #[test]
    fn strange_names_stay_strings() {
        let mut figure = figure();
        figure.title = "a\nimport os".into();
        figure.panels[0].files[0] = "it's \\ \"x\".vti".into();
        figure.panels[0].caption = "@SIZE@ \u{e9} \u{3b1} \u{1f600}\n".into();
        let text = state(&figure);
        assert!(text.is_ascii());
        assert!(text.starts_with("# a\\x0aimport os\n"));
        assert!(text.contains(r#"'it\'s \\ "x".vti'"#));
        assert!(text.contains(r"'@SIZE@ \xe9 \u03b1 \U0001f600\x0a'"));
    }
}
