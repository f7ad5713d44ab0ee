//! `<ImageData>`: a grid of voxels.

use super::Field;
use super::Problem;
use super::data_array::{attributes, field_data};
use super::document::{Document, numbers};
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

/// The image in a file.
pub(super) fn read(document: &Document<'_>) -> Result<Image, Problem> {
    let node = document.data_set;
    let wrong = |attribute, expected| Problem::Attribute {
        element: "ImageData".into(),
        attribute,
        value: node.attribute(attribute).unwrap_or_default().into(),
        expected,
    };
    let bounds = "six whole numbers, the first and last index along x, y and z";
    let extent: [i64; 6] = numbers(node, "WholeExtent", bounds)?.ok_or_else(|| wrong("WholeExtent", bounds))?;
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
    let points = grid.checked_len().ok_or_else(|| wrong("WholeExtent", "fewer points"))? as u64;
    // An axis with a single point has no thickness, and VTK counts it as one cell.
    let cells = dimensions.iter().map(|&n| (n as u64 - 1).max(1)).product();
    let piece =
        document.piece()?.ok_or_else(|| Problem::Missing { element: "ImageData".into(), lacks: "`<Piece>`".into() })?;
    let piece_extent: Option<[i64; 6]> = numbers(piece, "Extent", bounds)?;
    if piece_extent.is_some_and(|e| e != extent) {
        return Err(Problem::Unsupported {
            what: format!("a piece with extent {:?} of an image with {extent:?}", piece_extent.unwrap_or_default()),
            remedy: "save the whole image",
        });
    }
    Ok(Image {
        grid,
        direction,
        point_arrays: attributes(document, piece, "PointData", points)?,
        cell_arrays: attributes(document, piece, "CellData", cells)?,
        field_data: field_data(document)?,
    })
}
