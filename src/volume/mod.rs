//! Images: a regular grid of voxels, as VTK's `ImageData` means it, the arrays on it.
//!
//! Point (i, j, k) of the grid is at `origin + (i, j, k) * spacing`, and its flat index is `i + W (j + H k)`: x runs
//! fastest. A 2D image is a volume of one layer.

mod array;
mod memory;

pub use array::{Array, Kind, Values};
pub use memory::available_memory;

/// Dimensions and placement of an image. Voxel centres are the grid's points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Points along x, y and z; each at least 1.
    pub dimensions: [usize; 3],
    /// The point with index (0, 0, 0).
    pub origin: [f64; 3],
    /// Distance between neighbouring points along each axis; above zero.
    pub spacing: [f64; 3],
}

impl Grid {
    /// The number of points.
    pub fn len(&self) -> usize {
        self.dimensions.iter().product()
    }

    /// The number of points, unless it exceeds what a `usize` counts.
    pub fn checked_len(&self) -> Option<usize> {
        self.dimensions.iter().try_fold(1usize, |n, &d| n.checked_mul(d))
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The number of points of one z layer.
    pub fn layer_len(&self) -> usize {
        self.dimensions[0] * self.dimensions[1]
    }

    /// Where the point (i, j, k) is.
    pub fn point(&self, index: [usize; 3]) -> [f64; 3] {
        std::array::from_fn(|a| self.origin[a] + index[a] as f64 * self.spacing[a])
    }

    /// The index (i, j, k) of the point with this flat index.
    pub fn index(&self, flat: usize) -> [usize; 3] {
        let [w, h, _] = self.dimensions.map(|n| n.max(1));
        [flat % w, flat / w % h, flat / w / h]
    }
}

/// A whole image in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Volume {
    /// Its points.
    pub grid: Grid,
    /// What is known at each point.
    pub arrays: Vec<Array>,
    /// Named strings that belong to the image as a whole (VTK's field data).
    pub field_data: Vec<(String, String)>,
}

impl Volume {
    /// The array of this name.
    pub fn array(&self, name: &str) -> Option<&Array> {
        self.arrays.iter().find(|a| a.name == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flat_index_and_index_agree() {
        let grid = Grid { dimensions: [3, 4, 5], origin: [0.0; 3], spacing: [1.0; 3] };
        for flat in 0..grid.len() {
            let [i, j, k] = grid.index(flat);
            assert_eq!(i + 3 * (j + 4 * k), flat);
        }
    }
}
