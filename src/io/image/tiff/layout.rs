//! What the pages of a TIFF are: channels, slices and times, as OME-XML, ImageJ or tifffile say in the first page's description.
//!
//! Without any of these the pages are z, or what `dimensions` and `axes` say.

use serde_json::Value;

use super::super::Request;
use super::super::axes::{Axis, Positions, Role};

/// What is known of a file before its description is read.
pub(super) struct Page<'a> {
    pub width: usize,
    pub height: usize,
    /// Numbers at each point.
    pub samples: usize,
    /// Whether they lie one behind the other, not side by side.
    pub planar: bool,
    /// How many pages there are.
    pub count: usize,
    /// Distances between points along x and y, where the resolution says it.
    pub resolution: [Option<f64>; 2],
    pub description: &'a str,
    /// The file's own name.
    pub name: String,
}

/// What the pages are.
pub(super) struct Layout {
    pub format: &'static str,
    /// Axes of a page: x and y.
    pub inner: [Axis; 2],
    /// Axes over the pages, the fastest first.
    pub outer: Vec<Axis>,
    /// Which page each plane is on, in the order of `outer`.
    pub pages: Vec<usize>,
    /// Each value times the first, plus the second.
    pub linear: (f64, f64),
    pub unit: Option<String>,
    pub has_times: bool,
    pub notes: Vec<String>,
}

impl Layout {
    fn new(format: &'static str, page: &Page, outer: Vec<Axis>) -> Self {
        let planes = outer.iter().fold(1usize, |product, axis| product.saturating_mul(axis.size));
        Self {
            format,
            inner: [Axis::new("x", Some(Role::X), page.width), Axis::new("y", Some(Role::Y), page.height)],
            outer,
            // More than there are pages is refused later.
            pages: (0..planes.min(page.count)).collect(),
            linear: (1.0, 0.0),
            unit: None,
            has_times: false,
            notes: Vec::new(),
        }
    }

    /// Sizes of the planes, multiplied.
    pub fn planes(&self) -> usize {
        self.outer.iter().fold(1usize, |product, axis| product.saturating_mul(axis.size))
    }

    /// The layout of a file, as it says or as it is asked for.
    pub fn of(page: &Page, request: &Request) -> Result<Self, String> {
        let text = page.description.trim_matches(['\0', ' ', '\n']);
        let mut layout = if text.ends_with("OME>") || text.contains("<OME ") {
            Self::ome(page, text, request)?
        } else if text.starts_with("ImageJ=") {
            Self::imagej(page, text)?
        } else if let Some(shape) = shape(text) {
            Self::shaped(page, &shape)?
        } else {
            Self::new("TIFF", page, vec![Axis::new("z", Some(Role::Z), page.count)])
        };
        layout.agree(page, request)?;
        Ok(layout)
    }

    /// Holds what is asked for against what the file says.
    fn agree(&mut self, page: &Page, request: &Request) -> Result<(), String> {
        let Some([x, y, slices, frames]) = request.dimensions else { return Ok(()) };
        if [x, y] != [page.width, page.height] {
            return Err(format!("has pages of {} x {} points, not {x} x {y}", page.width, page.height));
        }
        let size = |role: Role| self.outer.iter().find(|axis| axis.role == Some(role)).map_or(1, |axis| axis.size);
        let (told, channels) = ([size(Role::Z), size(Role::Time)], size(Role::Channel));
        if told == [slices, frames] {
            return Ok(());
        }
        if slices.checked_mul(frames).and_then(|n| n.checked_mul(channels)) != Some(self.planes()) {
            return Err(format!(
                "has {} pages, which are not {channels} channels of {slices} slices at {frames} times; \
                 give dimensions, the points along x, y, z and time",
                self.planes()
            ));
        }
        if told[0] > 1 && told[1] > 1 {
            return Err(format!(
                "says that it has {} slices at {} times, and dimensions says {slices} at {frames}; leave dimensions out, \
                 or say by axes what each axis is",
                told[0], told[1]
            ));
        }
        // One row of pages, which dimensions takes apart: z before time, or as axes says.
        let of = |role: Role, size: usize| {
            let old = self.outer.iter().find(|axis| axis.role == Some(role));
            let mut axis = old.cloned().unwrap_or_else(|| Axis::new(role.name(), Some(role), size));
            axis.size = size;
            if matches!(axis.positions, Positions::Listed(_)) {
                axis.positions = Positions::INDICES;
            }
            axis
        };
        let (slices, frames) = (of(Role::Z, slices), of(Role::Time, frames));
        let later = request.axes.as_ref().is_some_and(|axes| {
            let place = |role| axes.iter().position(|&r| r == role);
            place(Role::Time) < place(Role::Z)
        });
        let pair = if later { [frames, slices] } else { [slices, frames] };
        let channel = self.outer.iter().find(|axis| axis.role == Some(Role::Channel)).cloned();
        self.outer = channel.into_iter().chain(pair).collect();
        Ok(())
    }

    fn imagej(page: &Page, text: &str) -> Result<Self, String> {
        let told = |key: &str| {
            text.lines()
                .find_map(|line| line.strip_prefix(key)?.strip_prefix('='))
                .map(str::trim)
                .filter(|v| !v.is_empty())
        };
        let number = |key: &str| told(key).and_then(|value| value.parse::<f64>().ok()).filter(|x| x.is_finite());
        let whole = |key: &str| number(key).map_or(1, |n| n.clamp(1.0, 1e9) as usize);
        let (channels, frames) = (whole("channels"), whole("frames"));
        let images = whole("images");
        // A plain stack says how many images there are, and that all are slices by saying nothing.
        let slices = match told("slices") {
            Some(_) => whole("slices"),
            None => images.max(page.count) / (channels * frames).max(1),
        };
        let unit = told("unit").map(|unit| unit.replace("\\u00B5", "\u{b5}"));
        let axis = |role: Role, size: usize, step: Option<f64>| {
            let mut axis = Axis::new(role.name(), Some(role), size).spaced(step.map_or(1.0, f64::abs));
            axis.unit = if role == Role::Time { Some("s".to_owned()) } else { unit.clone() };
            axis
        };
        let interval = number("finterval").or_else(|| number("fps").filter(|fps| *fps > 0.0).map(|fps| 1.0 / fps));
        let mut channel = Axis::new("channel", Some(Role::Channel), channels);
        channel.unit = None;
        let mut time = axis(Role::Time, frames, interval);
        time.unit = told("tunit").map(str::to_owned).or(interval.map(|_| "sec".to_owned()));
        let outer = vec![channel, axis(Role::Z, slices, number("spacing")), time];
        let mut layout = Self::new("TIFF by ImageJ", page, outer);
        for (i, key) in ["xorigin", "yorigin"].into_iter().enumerate() {
            layout.inner[i] = axis([Role::X, Role::Y][i], [page.width, page.height][i], page.resolution[i]);
            shift(&mut layout.inner[i], number(key));
        }
        shift(&mut layout.outer[1], number("zorigin"));
        match told("cf") {
            None => {}
            // A straight line from stored numbers to values.
            Some("0") => layout.linear = (number("c1").unwrap_or(1.0), number("c0").unwrap_or(0.0)),
            Some(other) => {
                layout.notes.push(format!(
                    "its calibration by ImageJ's function {other} is not applied; its numbers are as stored"
                ));
            }
        }
        layout.unit = told("vunit").map(str::to_owned);
        Ok(layout)
    }

    fn shaped(page: &Page, told: &Value) -> Result<Self, String> {
        let shape: Vec<usize> = told["shape"]
            .as_array()
            .map(|sizes| sizes.iter().map(|n| n.as_u64().map_or(0, |n| n as usize)).collect())
            .unwrap_or_default();
        let within = shape.len().checked_sub(if page.planar { 3 } else { 1 }).and_then(|at| shape.get(at));
        let samples = usize::from(page.samples > 1 && within == Some(&page.samples));
        let planes = shape.len().saturating_sub(2 + samples);
        let inner = &shape[planes + if page.planar { samples } else { 0 }..];
        if shape.len() < 2 + samples || [inner[1], inner[0]] != [page.width, page.height] {
            let message = format!(
                "its description gives the shape {shape:?}, whose last two are not its pages' {} rows of {} points; \
                 edit the description away: tiffset -u 270",
                page.height, page.width
            );
            return Err(message);
        }
        let letters: Vec<char> = told["axes"].as_str().unwrap_or_default().chars().collect();
        let mut notes = Vec::new();
        let mut outer: Vec<Axis> = Vec::new();
        for (i, &size) in shape[..planes].iter().enumerate() {
            let axis = match letters.get(i).filter(|_| letters.len() == shape.len()) {
                Some(letter) => {
                    let role = match letter.to_ascii_uppercase() {
                        'Z' => Some(Role::Z),
                        'T' => Some(Role::Time),
                        'C' | 'S' => Some(Role::Channel),
                        _ => None,
                    };
                    Axis::new(letter.to_string(), role, size)
                }
                // Rows of numbers without names: time, z, y, x is the custom.
                None => match planes - i {
                    1 => Axis::new("z", Some(Role::Z), size),
                    2 if size > 1 => {
                        notes.push(format!(
                            "its shape {shape:?} doesn't say what its axes are; they count as time, z, y, x, if axes says \
                             nothing else"
                        ));
                        Axis::new("time", Some(Role::Time), size)
                    }
                    _ => Axis::new(format!("axis {i} of its shape"), None, size),
                },
            };
            outer.insert(0, axis);
        }
        if let Some(step) = told["spacing"].as_f64() {
            outer.iter_mut().filter(|a| a.role == Some(Role::Z)).for_each(|a| a.positions = Positions::spaced(step));
        }
        if let Some(step) = told["finterval"].as_f64() {
            outer.iter_mut().filter(|a| a.role == Some(Role::Time)).for_each(|a| a.positions = Positions::spaced(step));
        }
        let mut layout = Self::new("TIFF", page, outer);
        layout.notes = notes;
        Ok(layout)
    }

    fn ome(page: &Page, text: &str, request: &Request) -> Result<Self, String> {
        let wrong = |message: String| format!("its OME-XML {message}");
        let document = roxmltree::Document::parse(text).map_err(|e| wrong(format!("can't be read: {e}")))?;
        let named = |node: &roxmltree::Node, name: &str| node.is_element() && node.tag_name().name() == name;
        let images: Vec<_> = document.root_element().children().filter(|node| named(node, "Image")).collect();
        let title = |node: &roxmltree::Node| node.attribute("Name").or(node.attribute("ID")).unwrap_or("").to_owned();
        let titles = || images.iter().map(title).collect::<Vec<_>>().join(", ");
        let image = match (&request.array, images.as_slice()) {
            (Some(name), all) => all
                .iter()
                .find(|node| [node.attribute("Name"), node.attribute("ID")].contains(&Some(name.as_str())))
                .ok_or_else(|| wrong(format!("has no image \"{name}\"; there are {}", titles())))?,
            (None, [one]) => one,
            (None, []) => {
                let other = document.descendants().find_map(|node| node.attribute("MetadataFile"));
                return Err(other.map_or_else(
                    || wrong("has no image".into()),
                    |file| {
                        format!(
                            "unsupported: its OME-XML is in another file, {file}; save both as one: bfconvert {file} OUT.ome.tif"
                        )
                    },
                ));
            }
            (None, all) => return Err(wrong(format!("has {} images; give array, one of {}", all.len(), titles()))),
        };
        let pixels =
            image.children().find(|node| named(node, "Pixels")).ok_or_else(|| wrong("has no Pixels".into()))?;
        let whole = |node: &roxmltree::Node, name: &str| match node.attribute(name) {
            None => Ok(None),
            Some(text) => text.trim().parse::<usize>().map(Some).map_err(|_| wrong(format!("has {name}=\"{text}\""))),
        };
        let real = |node: &roxmltree::Node, name: &str| {
            node.attribute(name)?.trim().parse::<f64>().ok().filter(|x| x.is_finite())
        };
        let size = |name: &str| whole(&pixels, name)?.ok_or_else(|| wrong(format!("has no {name}")));
        let (width, height) = (size("SizeX")?, size("SizeY")?);
        if [width, height] != [page.width, page.height] {
            let (w, h) = (page.width, page.height);
            return Err(wrong(format!("says {width} x {height} points, its first page has {w} x {h}")));
        }
        let order = pixels.attribute("DimensionOrder").unwrap_or_default();
        let mut outer = Vec::new();
        for letter in order.chars().skip(2) {
            let (role, size) = match letter {
                'Z' => (Role::Z, size("SizeZ")?),
                'T' => (Role::Time, size("SizeT")?),
                'C' => (Role::Channel, size("SizeC")? / page.samples.max(1)),
                _ => return Err(wrong(format!("has the DimensionOrder \"{order}\""))),
            };
            outer.push(Axis::new(role.name(), Some(role), size));
        }
        if !order.starts_with("XY") || outer.len() != 3 {
            return Err(wrong(format!("has the DimensionOrder \"{order}\"; XY comes first, then Z, C and T")));
        }
        let channels: Vec<&str> =
            pixels.children().filter(|node| named(node, "Channel")).filter_map(|node| node.attribute("Name")).collect();
        if !channels.is_empty() {
            outer.iter_mut().filter(|a| a.role == Some(Role::Channel)).for_each(|a| a.name = channels.join(", "));
        }
        let mut layout = Self::new("OME-TIFF", page, outer);
        let [x, y] = &mut layout.inner;
        for axis in [x, y].into_iter().chain(&mut layout.outer) {
            let (step, unit, usual) = match axis.role {
                Some(Role::X) => ("PhysicalSizeX", "PhysicalSizeXUnit", "\u{b5}m"),
                Some(Role::Y) => ("PhysicalSizeY", "PhysicalSizeYUnit", "\u{b5}m"),
                Some(Role::Z) => ("PhysicalSizeZ", "PhysicalSizeZUnit", "\u{b5}m"),
                Some(Role::Time) => ("TimeIncrement", "TimeIncrementUnit", "s"),
                _ => continue,
            };
            if let Some(length) = real(&pixels, step).filter(|length| *length > 0.0) {
                axis.positions = Positions::spaced(length);
                axis.unit = Some(pixels.attribute(unit).unwrap_or(usual).to_owned());
            }
        }
        // Times of their own for the planes: those of the first channel's first slice.
        let mut times = vec![f64::NAN; size("SizeT")?.min(page.count)];
        for plane in pixels.children().filter(|node| named(node, "Plane")) {
            let at = |name: &str| whole(&plane, name).ok().flatten().unwrap_or(0);
            if let (0, 0, Some(time)) = (at("TheZ"), at("TheC"), real(&plane, "DeltaT"))
                && let Some(slot) = times.get_mut(at("TheT"))
            {
                *slot = time;
            }
        }
        let listed = Positions::Listed(times.clone());
        if times.len() > 1 && listed.is_monotonic() {
            layout.has_times = true;
            for axis in layout.outer.iter_mut().filter(|a| a.role == Some(Role::Time)) {
                axis.positions = listed.clone();
                let first = pixels.children().find(|node| named(node, "Plane"));
                axis.unit = Some(first.and_then(|plane| plane.attribute("DeltaTUnit")).unwrap_or("s").to_owned());
            }
        }
        layout.planes_of_ome(page, &document, pixels)?;
        Ok(layout)
    }

    /// Which page each plane is on, by `TiffData`.
    fn planes_of_ome(
        &mut self,
        page: &Page,
        document: &roxmltree::Document,
        pixels: roxmltree::Node,
    ) -> Result<(), String> {
        // A file that is one of several says so by its planes' files; which is looked at before they are counted.
        let planes = self.planes();
        let mut pages: Vec<Option<usize>> = vec![None; planes.min(page.count)];
        let mut any = false;
        let own = document.root_element().attribute("UUID");
        for data in pixels.children().filter(|node| node.is_element() && node.tag_name().name() == "TiffData") {
            any = true;
            let number = |name: &str| data.attribute(name).and_then(|text| text.trim().parse::<usize>().ok());
            if let Some(uuid) = data.children().find(|node| node.is_element() && node.tag_name().name() == "UUID") {
                let file = uuid.attribute("FileName").unwrap_or(&page.name);
                if uuid.text().map(str::trim) != own && file != page.name {
                    return Err(format!(
                        "unsupported: planes in another file, {file}; save it as one: bfconvert IN OUT.ome.tif"
                    ));
                }
            }
            let (mut start, mut stride) = (0usize, 1usize);
            for axis in &self.outer {
                let first = match axis.role {
                    Some(Role::Z) => number("FirstZ"),
                    Some(Role::Time) => number("FirstT"),
                    _ => number("FirstC"),
                };
                start = start.saturating_add(first.unwrap_or(0).saturating_mul(stride));
                stride = stride.saturating_mul(axis.size);
            }
            let first_page = number("IFD").unwrap_or(0);
            let count = number("PlaneCount").unwrap_or(if data.has_attribute("IFD") { 1 } else { planes });
            for i in 0..count.min(planes) {
                if let Some(slot) = pages.get_mut(start.saturating_add(i)) {
                    *slot = Some(first_page.saturating_add(i));
                }
            }
        }
        if planes > page.count {
            return Err(format!("its OME-XML says {planes} planes, and it has {} pages", page.count));
        }
        if any {
            self.pages = pages
                .into_iter()
                .enumerate()
                .map(|(plane, at)| {
                    at.filter(|&at| at < page.count).ok_or_else(|| {
                        format!("its OME-XML names no page, or none that is there, for plane {plane} of {planes}")
                    })
                })
                .collect::<Result<_, _>>()?;
        }
        Ok(())
    }
}

/// Moves an axis so that its point number `origin` lies at 0.
fn shift(axis: &mut Axis, origin: Option<f64>) {
    if let Some(origin) = origin {
        let step = axis.positions.step();
        axis.positions.map(1.0, -origin * step);
    }
}

/// tifffile's description: `{"shape": [5, 7, 8, 9], "axes": "TZYX"}`.
fn shape(text: &str) -> Option<Value> {
    let value: Value = serde_json::from_str(text).ok().filter(|_| text.starts_with('{'))?;
    value["shape"].is_array().then_some(value)
}
