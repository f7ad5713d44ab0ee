//! `study.svg`: error against rays, against time, and of images against time, on logarithmic axes.
//!
//! Written by hand, as there is little to draw: a line a method, with its name at its end, and a dashed line with the slope
//! of n^-1/2, which independent random rays follow. Colours are Okabe and Ito's, which the colour-blind tell apart, and
//! markers differ too.

use std::fmt::Write;

use super::Study;
use super::tables::duration;
use crate::text::for_xml;

const WIDTH: f64 = 430.0;
const HEIGHT: f64 = 400.0;
/// Around the axes: left, right, above and below.
const MARGIN: [f64; 4] = [62.0, 92.0, 54.0, 58.0];
const TITLE: f64 = 40.0;

/// What is drawn along an axis.
#[derive(Clone, Copy)]
enum Ticks {
    /// Powers of four.
    Rays,
    /// Powers of ten, with units of time.
    Time,
    /// Powers of ten.
    Error,
}

/// A line of points, and its name.
struct Line {
    name: &'static str,
    points: Vec<[f64; 2]>,
}

struct Panel {
    title: &'static str,
    across: (&'static str, Ticks),
    lines: Vec<Line>,
    /// The line that the slope of n^-1/2 is drawn beside.
    slope: Option<&'static str>,
    /// A dotted upright line, with a name: what takes this time and has no error.
    upright: Option<(f64, &'static str)>,
}

fn colour(name: &str) -> &'static str {
    match name {
        "as_published" | "flat" => "#d55e00",
        "random" | "voxel" => "#0072b2",
        "sobol" | "smooth" => "#009e73",
        "exact" => "#555555",
        "voxel+denoise" => "#56b4e9",
        "screen_space" => "#e69f00",
        _ => "#cc79a7",
    }
}

/// A marker, in paint that the surrounding group sets.
fn marker(name: &str, x: f64, y: f64) -> String {
    match name {
        "as_published" | "flat" => format!("<rect x='{:.1}' y='{:.1}' width='7' height='7'/>", x - 3.5, y - 3.5),
        "random" | "voxel" => format!("<circle cx='{x:.1}' cy='{y:.1}' r='3.8'/>"),
        "voxel+denoise" => format!("<path d='M{x:.1} {:.1}l4.8 8h-9.6z'/>", y - 5.0),
        "screen_space" => format!("<path d='M{:.1} {:.1}h3v3h3v3h-3v3h-3v-3h-3v-3h3z'/>", x - 1.5, y - 4.5),
        "auto" => format!("<path d='M{x:.1} {:.1}l4.8 -8h-9.6z'/>", y + 5.0),
        _ => format!("<path d='M{x:.1} {:.1}l4.6 4.6l-4.6 4.6l-4.6 -4.6z'/>", y - 4.6),
    }
}

/// Errors below this are rounding to `f32`, and not drawn.
const LEAST: f64 = 1e-6;

/// Lines of one panel, out of `(name, [x, error])` in order. Errors of zero can't be drawn.
fn lines(points: impl Iterator<Item = (&'static str, [f64; 2])>) -> Vec<Line> {
    let mut lines: Vec<Line> = Vec::new();
    for (name, point) in points.filter(|(_, p)| p[0] > 0.0 && p[1] > LEAST && p[1].is_finite()) {
        match lines.iter_mut().find(|line| line.name == name) {
            Some(line) => line.points.push(point),
            None => lines.push(Line { name, points: vec![point] }),
        }
    }
    lines
}

/// The whole picture.
pub(super) fn svg(study: &Study) -> String {
    let levels = || study.levels.iter();
    let mut panels = vec![
        Panel {
            title: "RMS error against rays",
            across: ("rays a vertex", Ticks::Rays),
            lines: lines(levels().map(|r| (r.method, [f64::from(r.samples), r.errors.rms]))),
            slope: Some("random"),
            upright: None,
        },
        Panel {
            title: "RMS error against time",
            across: ("time a vertex, on one thread", Ticks::Time),
            lines: lines(levels().map(|r| (r.method, [r.seconds, r.errors.rms]))),
            slope: Some("random"),
            upright: study.truth.seconds.map(|s| (s, "exact")),
        },
    ];
    if let Some(pictures) = &study.pictures {
        panels.push(Panel {
            title: "RMS error of the image against time",
            across: ("time of the whole image", Ticks::Time),
            lines: lines(pictures.rows.iter().map(|r| (r.shading, [r.seconds, r.errors.rms]))),
            slope: None,
            upright: None,
        });
    }
    let (width, height) = (WIDTH * panels.len() as f64, HEIGHT + TITLE);
    let mut text = format!(
        "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {width} {height}' width='{width}' height='{height}' \
         font-family='Helvetica, Arial, DejaVu Sans, sans-serif' font-size='12' fill='#222'>\n\
         <rect width='100%' height='100%' fill='white'/>\n\
         <text x='{}' y='28' font-size='17' font-weight='bold'>{}<tspan font-weight='normal' fill='#666' dx='12' \
         font-size='13'>{}D, {} vertices, {} simplices</tspan></text>\n",
        MARGIN[0],
        for_xml(&study.name),
        study.dimension,
        super::grouped(study.vertices as u64),
        super::grouped(study.simplices as u64),
    );
    for (i, panel) in panels.iter().enumerate() {
        let _ = writeln!(text, "<g transform='translate({} {TITLE})'>", WIDTH * i as f64);
        panel.draw(&mut text);
        text += "</g>\n";
    }
    text + "</svg>\n"
}

/// One axis: from a range of values to a range of the picture.
#[derive(Clone, Copy)]
struct Axis {
    from: f64,
    to: f64,
    start: f64,
    end: f64,
}

impl Axis {
    /// Around the values, widened by a share of their range.
    fn around(values: impl Iterator<Item = f64>, start: f64, end: f64) -> Option<Self> {
        let (low, high) = values.fold((f64::INFINITY, 0.0), |(l, h): (f64, f64), v| (l.min(v.ln()), h.max(v)));
        let high = high.ln();
        let room = (0.06 * (high - low)).max(0.2);
        (low <= high).then_some(Self { from: low - room, to: high + room, start, end })
    }

    fn place(&self, value: f64) -> f64 {
        self.start + (value.ln() - self.from) / (self.to - self.from) * (self.end - self.start)
    }

    /// Values with a line, and whether they are named too.
    fn ticks(&self, kind: Ticks) -> Vec<(f64, bool)> {
        let (base, steps): (f64, &[f64]) = match kind {
            Ticks::Rays => (4.0, &[1.0]),
            _ => (10.0, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]),
        };
        // Powers of ten alone leave a short axis without names.
        let short = (self.to - self.from) < 1.7 * base.ln();
        let first = (self.from / base.ln()).floor() as i32;
        let last = (self.to / base.ln()).ceil() as i32;
        let all = (first..=last).flat_map(|k| steps.iter().map(move |&m| (m * base.powi(k), m)));
        all.filter(|(v, _)| (self.from..=self.to).contains(&v.ln()))
            .map(|(v, m)| (v, m == 1.0 || short && (m == 2.0 || m == 5.0)))
            .collect()
    }
}

fn tick_name(value: f64, kind: Ticks) -> String {
    match kind {
        Ticks::Rays if value >= 1024.0 => format!("{}k", (value / 1024.0).round()),
        Ticks::Rays => format!("{value:.0}"),
        Ticks::Time => {
            let text = duration(value * (1.0 + 1e-9));
            let (number, unit) = text.split_once(' ').unwrap_or((&text, ""));
            let number = number.trim_end_matches(|c| number.contains('.') && c == '0').trim_end_matches('.');
            format!("{number} {unit}")
        }
        Ticks::Error => {
            let digits = (-value.log10() - 1e-9).ceil().clamp(0.0, 9.0) as usize;
            format!("{value:.digits$}")
        }
    }
}

impl Panel {
    fn draw(&self, text: &mut String) {
        let [left, right, above, below] = MARGIN;
        let (x0, x1, y0, y1) = (left, WIDTH - right, HEIGHT - below, above);
        let mut out = |arguments: std::fmt::Arguments| {
            let _ = writeln!(text, "{arguments}");
        };
        out(format_args!("<text x='{x0}' y='{}' font-weight='bold'>{}</text>", above - 22.0, self.title));
        let points = || self.lines.iter().flat_map(|line| &line.points);
        let times = points().map(|p| p[0]).chain(self.upright.map(|u| u.0));
        let (Some(x), Some(y)) = (Axis::around(times, x0, x1), Axis::around(points().map(|p| p[1]), y0, y1)) else {
            out(format_args!("<text x='{x0}' y='{}' fill='#666'>All errors are zero.</text>", (y0 + y1) / 2.0));
            return;
        };
        for (value, named) in x.ticks(self.across.1) {
            let (at, grey) = (x.place(value), if named { "#d4d4d4" } else { "#efefef" });
            out(format_args!("<path d='M{at:.1} {y0}V{y1}' stroke='{grey}'/>"));
            if named {
                let name = tick_name(value, self.across.1);
                out(format_args!("<text x='{at:.1}' y='{}' text-anchor='middle'>{name}</text>", y0 + 18.0));
            }
        }
        for (value, named) in y.ticks(Ticks::Error) {
            let (at, grey) = (y.place(value), if named { "#d4d4d4" } else { "#efefef" });
            out(format_args!("<path d='M{x0} {at:.1}H{x1}' stroke='{grey}'/>"));
            if named {
                let name = tick_name(value, Ticks::Error);
                out(format_args!("<text x='{}' y='{:.1}' text-anchor='end'>{name}</text>", x0 - 7.0, at + 4.0));
            }
        }
        out(format_args!("<path d='M{x0} {y1}V{y0}H{x1}' fill='none' stroke='#444'/>"));
        out(format_args!(
            "<text x='{}' y='{}' text-anchor='middle' fill='#444'>{}</text>",
            (x0 + x1) / 2.0,
            y0 + 40.0,
            self.across.0
        ));
        self.draw_slope(&mut out, x, y);
        if let Some((value, name)) = self.upright {
            let at = x.place(value);
            out(format_args!(
                "<path d='M{at:.1} {y0}V{y1}' stroke='{}' stroke-width='1.6' stroke-dasharray='2 4' stroke-linecap='round'/>",
                colour(name)
            ));
            out(format_args!(
                "<text x='{at:.1}' y='{}' text-anchor='middle' fill='{}'>{name}</text>",
                y1 - 5.0,
                colour(name)
            ));
        }
        self.draw_lines(&mut out, x, y);
    }

    fn draw_lines(&self, out: &mut impl FnMut(std::fmt::Arguments), x: Axis, y: Axis) {
        // The names stand at the lines' ends, moved apart where they would overlap.
        let mut names: Vec<(f64, f64, &str)> = Vec::new();
        for line in &self.lines {
            let paint = colour(line.name);
            let places: Vec<(f64, f64)> = line.points.iter().map(|p| (x.place(p[0]), y.place(p[1]))).collect();
            let path: Vec<String> = places.iter().map(|(a, b)| format!("{a:.1} {b:.1}")).collect();
            out(format_args!(
                "<path d='M{}' fill='none' stroke='{paint}' stroke-width='2' stroke-linejoin='round'/>",
                path.join("L")
            ));
            let markers: String = places.iter().map(|&(a, b)| marker(line.name, a, b)).collect();
            out(format_args!("<g fill='{paint}' stroke='white'>{markers}</g>"));
            if let Some(&(a, b)) = places.iter().max_by(|p, q| p.0.total_cmp(&q.0)) {
                names.push((a + 9.0, b + 4.0, line.name));
            }
        }
        names.sort_by(|a, b| a.1.total_cmp(&b.1));
        for i in 1..names.len() {
            if names[i].1 - names[i - 1].1 < 14.0 && (names[i].0 - names[i - 1].0).abs() < 80.0 {
                names[i].1 = names[i - 1].1 + 14.0;
            }
        }
        for (a, b, name) in names {
            // White behind the letters keeps them legible over lines.
            out(format_args!(
                "<text x='{a:.1}' y='{b:.1}' fill='{}' stroke='white' stroke-width='3' paint-order='stroke'>{name}</text>",
                colour(name)
            ));
        }
    }

    /// From a little below the first point of a line, as far as the axes go.
    fn draw_slope(&self, out: &mut impl FnMut(std::fmt::Arguments), x: Axis, y: Axis) {
        let beside = self.lines.iter().find(|line| Some(line.name) == self.slope);
        let Some([from, error]) = beside.and_then(|line| line.points.first().copied()) else { return };
        let error = error * 1.6;
        let start = from.max((x.from + 0.02 * (x.to - x.from)).exp());
        let last = beside.and_then(|line| line.points.last()).map_or(start, |p| p[0]);
        let at = |v: f64| (x.place(v), y.place(error * (from / v).sqrt()));
        let ((a, b), (c, d)) = (at(start), at(last));
        out(format_args!(
            "<path d='M{a:.1} {b:.1}L{c:.1} {d:.1}' stroke='#888' stroke-width='1.3' stroke-dasharray='6 4'/>"
        ));
        let (m, n) = ((a + c) / 2.0, (b + d) / 2.0);
        let angle = (d - b).atan2(c - a).to_degrees();
        out(format_args!(
            "<text x='{m:.1}' y='{:.1}' fill='#777' text-anchor='middle' transform='rotate({angle:.1} {m:.1} {n:.1})'>n<tspan \
             dy='-4' font-size='9'>-1/2</tspan></text>",
            n - 6.0
        ));
    }
}
