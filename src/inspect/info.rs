//! The description of a file: for people as text, for programs as JSON.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::{Map, Value};

use super::image::{AxisSummary, ImageSummary};
use super::range::Short;
use super::surface::SurfaceSummary;
use super::{ArraySummary, COLOURS, Contents, Error, OCCLUSION, Range};
use crate::io::PIPELINE;
use crate::io::vtk::{Field, Image, UnstructuredGrid, cell_name};
use crate::occlusion::Sidecar;
use crate::volume::{Array, Values};

/// What a file holds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Info {
    /// The file.
    pub path: PathBuf,
    /// Its length.
    pub bytes: u64,
    /// What is in it.
    #[serde(flatten)]
    pub description: Description,
}

/// What is in a file, by the kind of file.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum Description {
    /// An image of a format of measurements, with time among its axes.
    Grid(Box<ImageSummary>),
    /// An image.
    Image {
        /// Points along x, y and z.
        dimensions: [usize; 3],
        /// The first point.
        origin: [f64; 3],
        /// The distance of neighbouring points along each axis.
        spacing: [f64; 3],
        /// The axes' directions, row by row.
        direction: [f64; 9],
        /// The same as in other formats: the axes, from the first point on, and time, where the file says at which it is.
        axes: Vec<AxisSummary>,
        /// Arrays with a tuple a point.
        point_arrays: Vec<ArraySummary>,
        /// Arrays with a tuple a cell.
        cell_arrays: Vec<ArraySummary>,
        /// What belongs to the image as a whole, by name.
        field_data: Map<String, Value>,
    },
    /// A mesh.
    Mesh {
        /// How many points there are.
        points: usize,
        /// How many cells of each kind.
        cells: BTreeMap<String, usize>,
        /// The ranges of the points' three coordinates.
        bounds: Vec<Range>,
        /// If it consists of simplices, how they hang together.
        surface: Option<Box<SurfaceSummary>>,
        /// Arrays with a tuple a point.
        point_arrays: Vec<ArraySummary>,
        /// Arrays with a tuple a cell.
        cell_arrays: Vec<ArraySummary>,
        /// What belongs to the mesh as a whole, by name.
        field_data: Map<String, Value>,
    },
    /// Ambient occlusion at vertices.
    Occlusion {
        /// The values.
        values: ArraySummary,
        /// What stands beside the file, if it does.
        sidecar: Option<Sidecar>,
    },
    /// Colours.
    Raw {
        /// Floats in the file.
        floats: usize,
        /// Voxels, at three floats each.
        voxels: usize,
        /// The colours.
        values: ArraySummary,
    },
}

impl Info {
    /// Reads a file and describes it.
    ///
    /// # Errors
    /// As [`Contents::read`].
    pub fn read(path: &Path) -> Result<Self, Error> {
        Self::read_array(path, None)
    }

    /// The same of one array, variable or image of several, where the format has such.
    ///
    /// # Errors
    /// As [`Info::read`].
    pub fn read_array(path: &Path, array: Option<&str>) -> Result<Self, Error> {
        let bytes = std::fs::metadata(path).map_err(|cause| Error::Open { path: path.into(), cause })?.len();
        let description = match crate::io::image::is_measurement(path) {
            true => Description::Grid(Box::new(ImageSummary::read(path, array)?)),
            false => match super::floats(path)? {
                Some((floats, name, 3)) => Description::raw(floats.summary(name, 3)?),
                Some((floats, name, components)) => {
                    Description::Occlusion { values: floats.summary(name, components)?, sidecar: None }
                }
                None => {
                    let contents = Contents::read(path)?;
                    if let Contents::Mesh(mesh) = &contents {
                        super::needs(path, SurfaceSummary::memory(mesh))?;
                    }
                    Description::of(&contents)
                }
            },
        };
        Ok(Self { path: path.into(), bytes, description })
    }
}

impl Description {
    /// Of these contents.
    pub fn of(contents: &Contents) -> Self {
        let list = |name: &str, components: usize, values: &Values| {
            ArraySummary::of(&Array::new(name, components, values.clone()))
        };
        match contents {
            Contents::Image(image) => Self::image(image),
            Contents::Mesh(mesh) => Self::mesh(mesh),
            Contents::Occlusion(values, sidecar) => {
                Self::Occlusion { values: list(OCCLUSION, 1, values), sidecar: sidecar.clone() }
            }
            Contents::Raw(values) => Self::raw(list(COLOURS, 3, values)),
        }
    }

    fn raw(values: ArraySummary) -> Self {
        Self::Raw { floats: 3 * values.tuples, voxels: values.tuples, values }
    }

    fn image(image: &Image) -> Self {
        Self::Image {
            dimensions: image.grid.dimensions,
            origin: image.grid.origin,
            spacing: image.grid.spacing,
            direction: image.direction,
            axes: axes(image),
            point_arrays: with_histograms(&image.point_arrays),
            cell_arrays: with_histograms(&image.cell_arrays),
            field_data: fields(&image.field_data),
        }
    }

    fn mesh(mesh: &UnstructuredGrid) -> Self {
        let mut cells = BTreeMap::new();
        for &kind in &mesh.types {
            *cells.entry(cell_name(kind)).or_insert(0) += 1;
        }
        Self::Mesh {
            points: mesh.points.len(),
            cells,
            bounds: (0..3).map(|axis| Range::of(mesh.points.iter().map(|p| p[axis]))).collect(),
            surface: SurfaceSummary::of(mesh).map(Box::new),
            point_arrays: summaries(&mesh.point_arrays),
            cell_arrays: summaries(&mesh.cell_arrays),
            field_data: fields(&mesh.field_data),
        }
    }
}

/// The axes of an image of VTK.
fn axes(image: &Image) -> Vec<AxisSummary> {
    let axis = |(a, name): (usize, &'static str)| AxisSummary {
        name: name.into(),
        role: Some(name),
        points: image.grid.dimensions[a],
        first: 0.0,
        last: (image.grid.dimensions[a] - 1) as f64 * image.grid.spacing[a],
        even: true,
        unit: None,
        direction: Some(std::array::from_fn(|row| if row < 3 { image.direction[3 * row + a] } else { 0.0 })),
    };
    let mut axes: Vec<_> = ["x", "y", "z"].into_iter().enumerate().map(axis).collect();
    axes.extend(image.time().map(|time| AxisSummary {
        name: "time".into(),
        role: Some("time"),
        points: 1,
        first: time,
        last: time,
        even: true,
        unit: None,
        direction: None,
    }));
    axes
}

fn with_histograms(arrays: &[Array]) -> Vec<ArraySummary> {
    arrays.iter().map(ArraySummary::with_histogram).collect()
}

fn summaries(arrays: &[Array]) -> Vec<ArraySummary> {
    arrays.iter().map(ArraySummary::of).collect()
}

fn fields(fields: &[Field]) -> Map<String, Value> {
    fields.iter().map(|field| (field.name().to_owned(), Value::String(field.text()))).collect()
}

impl fmt::Display for Info {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, {} bytes: {}", self.path.display(), self.bytes, self.description)
    }
}

impl fmt::Display for Description {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Grid(image) => image.fmt(f),
            Self::Image { dimensions, origin, spacing, direction, axes, point_arrays, cell_arrays, field_data } => {
                let [x, y, z] = dimensions;
                writeln!(f, "an image of {x} x {y} x {z} points")?;
                writeln!(f, "origin {}, spacing {}", Tuple(origin), Tuple(spacing))?;
                if *direction != [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0] {
                    writeln!(f, "rotated, direction {}", Tuple(direction))?;
                }
                if let Some(time) = axes.iter().find(|axis| axis.role == Some("time")) {
                    writeln!(f, "at time {}", time.first)?;
                }
                lines(f, "points", point_arrays)?;
                lines(f, "cells", cell_arrays)?;
                field_lines(f, field_data)
            }
            Self::Mesh { points, cells, bounds, surface, point_arrays, cell_arrays, field_data } => {
                let cells: Vec<String> = cells.iter().map(|(kind, n)| format!("{n} ({kind})")).collect();
                let cells = if cells.is_empty() { "none".to_owned() } else { cells.join(", ") };
                writeln!(f, "a mesh of {points} points; cells: {cells}")?;
                bounds.iter().zip(["x", "y", "z"]).try_for_each(|(range, axis)| writeln!(f, "{axis} {range}"))?;
                if let Some(surface) = surface {
                    write!(f, "{surface}")?;
                }
                lines(f, "points", point_arrays)?;
                lines(f, "cells", cell_arrays)?;
                field_lines(f, field_data)
            }
            Self::Occlusion { values, sidecar } => {
                writeln!(f, "ambient occlusion at {} vertices", values.tuples)?;
                values.ranges.iter().try_for_each(|range| writeln!(f, "{range}"))?;
                match sidecar {
                    Some(sidecar) => {
                        f.write_str(&Sidecar { pipeline: None, ..sidecar.clone() }.to_yaml())?;
                        sidecar.pipeline.iter().try_for_each(|text| writeln!(f, "pipeline: {}", Pipeline(text)))
                    }
                    None => writeln!(f, "no sidecar beside it says what they are the values of"),
                }
            }
            Self::Raw { floats, voxels, values } => {
                writeln!(f, "{floats} floats, or the colours of {voxels} voxels; it doesn't tell their arrangement")?;
                let channels = ["red", "green", "blue"].iter().zip(&values.ranges);
                channels.into_iter().try_for_each(|(channel, range)| writeln!(f, "{channel} {range}"))
            }
        }
    }
}

fn lines(f: &mut fmt::Formatter<'_>, of: &str, arrays: &[ArraySummary]) -> fmt::Result {
    if !arrays.is_empty() {
        writeln!(f, "on {of}:")?;
    }
    arrays.iter().try_for_each(|array| {
        writeln!(f, "  {array}")?;
        match array.histogram_line() {
            Some(line) => writeln!(f, "    {line}"),
            None => Ok(()),
        }
    })
}

fn field_lines(f: &mut fmt::Formatter<'_>, fields: &Map<String, Value>) -> fmt::Result {
    if !fields.is_empty() {
        writeln!(f, "field data:")?;
    }
    fields.iter().try_for_each(|(name, text)| match text.as_str().unwrap_or_default() {
        text if name == PIPELINE && text.contains("\nstages:") => writeln!(f, "  {name}: {}", Pipeline(text)),
        text => writeln!(f, "  {name}: {text}"),
    })
}

/// A pipeline's text where only that it is there is told.
struct Pipeline<'a>(&'a str);

impl fmt::Display for Pipeline<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lines = self.0.lines().collect::<Vec<_>>();
        let name = lines.iter().find_map(|line| line.strip_prefix("name: ")).unwrap_or_default();
        write!(f, "{name}, {} lines of YAML, which `ao4d info --pipeline` prints", lines.len())
    }
}

/// Numbers in parentheses.
struct Tuple<'a>(&'a [f64]);

impl fmt::Display for Tuple<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let numbers: Vec<String> = self.0.iter().map(|&x| Short(x).to_string()).collect();
        write!(f, "({})", numbers.join(", "))
    }
}
