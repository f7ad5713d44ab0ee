//! Rectilinear lattices: the points where axis-parallel planes cross, which boxes and cut cubes take their vertices from.

use crate::geometry::Vector64;
use crate::mesh::Surface;

pub use crate::mesh::weld::compact;

/// Planes along each axis, in ascending order. Point (i, j, k, l) has index `((i * n_y + j) * n_z + k) * n_w + l`: the
/// last axis runs fastest, as in a product of intervals.
#[derive(Clone, Debug, PartialEq)]
pub struct Lattice<const D: usize> {
    /// Where the planes of each axis are.
    pub planes: [Vec<f64>; D],
}

/// Points that divide an interval into equal pieces; the ends are exact. Leaves out the last one.
pub fn divide(from: f64, to: f64, pieces: u32) -> impl Iterator<Item = f64> {
    (0..pieces).map(move |i| from + (to - from) * (f64::from(i) / f64::from(pieces)))
}

impl<const D: usize> Lattice<D> {
    /// The lattice that divides a box evenly.
    pub fn even(min: &Vector64<D>, max: &Vector64<D>, pieces: [u32; D]) -> Self {
        let planes = |axis| divide(min[axis], max[axis], pieces[axis]).chain([max[axis]]).collect();
        Self { planes: std::array::from_fn(planes) }
    }

    /// The index of a point.
    pub fn index(&self, place: &[usize; D]) -> u32 {
        (0..D).fold(0, |index, axis| index * self.planes[axis].len() + place[axis]) as u32
    }

    /// Where the point with this index is.
    pub fn point(&self, index: u32) -> Vector64<D> {
        let mut rest = index as usize;
        let mut point = Vector64::zeros();
        for axis in (0..D).rev() {
            let planes = &self.planes[axis];
            point[axis] = planes[rest % planes.len()];
            rest /= planes.len();
        }
        point
    }

    /// The surface over those points that the simplices use, in the order of the lattice.
    pub fn surface(&self, simplices: Vec<[u32; D]>) -> Surface<D> {
        let (used, simplices) = compact(simplices);
        Surface { vertices: used.into_iter().map(|index| self.point(index)).collect(), simplices, normals: None }
    }
}
