//! One object's surface as a generator or a reader makes it: `f64` points and simplices over them.

use crate::geometry::Vector64;

/// A hypersurface of R^D as a list of simplices over shared vertices, closed or open.
///
/// The order of a simplex's vertices is its orientation: its normal is [`crate::geometry::normal_of`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface<const D: usize> {
    /// The points, in the scene's units.
    pub vertices: Vec<Vector64<D>>,
    /// D indices into `vertices` each.
    pub simplices: Vec<[u32; D]>,
    /// One normal a vertex, of any length, where the input brings its own; they win over computed ones.
    pub normals: Option<Vec<Vector64<D>>>,
}
