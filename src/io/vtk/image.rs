//! `<ImageData>`: a grid of voxels.

use roxmltree::Node;

use super::data_array::{attributes, field_data};
use super::document::{Document, numbers};
use super::pieces::{self, Piece};
use super::{Field, Problem};
use crate::volume::{Array, Grid, Volume};

/// Axes that are not rotated.
const IDENTITY: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];

/// An image with all that VTK's files can say about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Its points. The origin is that of the first point, wherever the file's extent begins.
    pub grid: Grid,
    /// The axes' directions, row by row.
    pub direction: [f64; 9],
    /// Arrays with a tuple a point.
    pub point_arrays: Vec<Array>,
    /// Arrays with a tuple a cell.
    pub cell_arrays: Vec<Array>,
    /// What belongs to the image as a whole.
    pub field_data: Vec<Field>,
}

impl Image {
    /// An image that is not rotated.
    pub(super) fn new(grid: Grid, point_arrays: Vec<Array>, cell_arrays: Vec<Array>, field_data: Vec<Field>) -> Self {
        Self { grid, direction: IDENTITY, point_arrays, cell_arrays, field_data }
    }

    /// At what time it is, if its field data say so.
    pub fn time(&self) -> Option<f64> {
        let time = self.field_data.iter().find_map(|field| match field {
            Field::Numbers(array) if array.name == "TimeValue" && !array.values.is_empty() => Some(array.values.get(0)),
            _ => None,
        });
        time.filter(|time| time.is_finite())
    }

    /// The image as a [`Volume`], if that loses nothing.
    ///
    /// # Errors
    /// If the axes are rotated or there are arrays on cells.
    pub fn into_volume(self) -> Result<Volume, Problem> {
        if self.direction != IDENTITY {
            return Err(Problem::Unsupported {
                what: format!("an image with rotated axes (Direction {:?})", self.direction),
                remedy: "resample it to an axis-aligned image first (in ParaView: Resample To Image)",
            });
        }
        if let Some(array) = self.cell_arrays.first() {
            return Err(Problem::Unsupported {
                what: format!("array `{}`, which lies on cells,", array.name),
                remedy: "move it to the points first (in ParaView: Cell Data to Point Data)",
            });
        }
        let field_data = self.field_data.iter().map(|f| (f.name().into(), f.text())).collect();
        Ok(Volume { grid: self.grid, arrays: self.point_arrays, field_data })
    }
}

impl From<Volume> for Image {
    fn from(volume: Volume) -> Self {
        let field_data = volume.field_data.into_iter().map(|(name, text)| Field::Text(name, vec![text])).collect();
        Self::new(volume.grid, volume.arrays, Vec::new(), field_data)
    }
}

/// What an extent should be.
pub(super) const BOUNDS: &str = "six whole numbers, the first and last index along x, y and z";

/// What an image says of itself as a whole.
pub(super) struct Head {
    /// The first and last index along x, y and z.
    pub extent: [i64; 6],
    pub grid: Grid,
    direction: [f64; 9],
}

/// The attributes of `<ImageData>` or `<PImageData>`.
pub(super) fn head(node: Node<'_, '_>) -> Result<Head, Problem> {
    let wrong = |attribute, expected| Problem::Attribute {
        element: node.tag_name().name().into(),
        attribute,
        value: node.attribute(attribute).unwrap_or_default().into(),
        expected,
    };
    let extent: [i64; 6] = numbers(node, "WholeExtent", BOUNDS)?.ok_or_else(|| wrong("WholeExtent", BOUNDS))?;
    let origin: [f64; 3] = numbers(node, "Origin", "three numbers")?.unwrap_or_default();
    let spacing: [f64; 3] = numbers(node, "Spacing", "three numbers")?.unwrap_or([1.0; 3]);
    let direction: [f64; 9] = numbers(node, "Direction", "nine numbers")?.unwrap_or(IDENTITY);
    let mut dimensions = [0usize; 3];
    for a in 0..3 {
        let count = extent[2 * a + 1].checked_sub(extent[2 * a]).and_then(|n| n.checked_add(1));
        dimensions[a] = count
            .and_then(|n| usize::try_from(n).ok())
            .filter(|n| (1..=1 << 31).contains(n))
            .ok_or_else(|| wrong("WholeExtent", "at least one point along each axis, and at most 2^31"))?;
    }
    if !origin.iter().all(|x| x.is_finite()) {
        return Err(wrong("Origin", "finite numbers"));
    }
    if !spacing.iter().all(|&x| x.is_finite() && x > 0.0) {
        return Err(wrong("Spacing", "finite numbers above 0"));
    }
    // VTK rotates about the origin, so the first point's place follows from the extent through the rotation.
    let steps: [f64; 3] = std::array::from_fn(|a| extent[2 * a] as f64 * spacing[a]);
    let first = std::array::from_fn(|a| {
        let shift =
            if direction == IDENTITY { steps[a] } else { (0..3).map(|b| direction[3 * a + b] * steps[b]).sum() };
        origin[a] + shift
    });
    let grid = Grid { dimensions, origin: first, spacing };
    grid.checked_len().ok_or_else(|| wrong("WholeExtent", "fewer points"))?;
    Ok(Head { extent, grid, direction })
}

/// The pieces of a file; one that doesn't say where it lies is the whole.
pub(super) fn pieces(document: &Document<'_>, whole: [i64; 6]) -> Result<Vec<Piece>, Problem> {
    let mut pieces = Vec::new();
    for node in document.pieces() {
        let extent: [i64; 6] = numbers(node, "Extent", BOUNDS)?.unwrap_or(whole);
        // Those of VTK that hold nothing end before they begin.
        if (0..3).any(|a| extent[2 * a + 1] < extent[2 * a]) {
            continue;
        }
        let (mut points, mut cells) = (1u64, 1u64);
        for a in 0..3 {
            let count = extent[2 * a + 1].checked_sub(extent[2 * a]).and_then(|n| u64::try_from(n).ok());
            let more = |product: u64, n: u64| product.checked_mul(n).filter(|&n| n < 1 << 62);
            // An axis with a single point has no thickness, and VTK counts it as one cell.
            let counts = count.and_then(|n| Some((more(points, n.checked_add(1)?)?, more(cells, n.max(1))?)));
            (points, cells) = counts.ok_or_else(|| Problem::Attribute {
                element: "Piece".into(),
                attribute: "Extent",
                value: format!("{extent:?}"),
                expected: "fewer points",
            })?;
        }
        pieces.push(Piece {
            extent,
            point_arrays: attributes(document, node, "PointData", points)?,
            cell_arrays: attributes(document, node, "CellData", cells)?,
        });
    }
    Ok(pieces)
}

impl Head {
    /// The image that these pieces make.
    pub fn image(self, document: &Document<'_>, pieces: Vec<Piece>, field_data: Vec<Field>) -> Result<Image, Problem> {
        if pieces.is_empty() {
            return Err(Problem::Missing { element: document.kind.into(), lacks: "`<Piece>`".into() });
        }
        let charge = |array: &str, bytes: u64| document.charge(array, bytes);
        let (point_arrays, cell_arrays) = pieces::image(self.extent, pieces, charge)?;
        Ok(Image { grid: self.grid, direction: self.direction, point_arrays, cell_arrays, field_data })
    }
}

/// The image in a file.
pub(super) fn read(document: &Document<'_>) -> Result<Image, Problem> {
    let head = head(document.data_set)?;
    let pieces = pieces(document, head.extent)?;
    head.image(document, pieces, field_data(document)?)
}
