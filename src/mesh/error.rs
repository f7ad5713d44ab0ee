//! What can be wrong with a surface before it becomes part of a mesh.

use thiserror::Error;

/// Why a surface can't be part of a mesh.
#[derive(Clone, Debug, Error, PartialEq)]
#[allow(missing_docs)]
pub enum MeshError {
    #[error(
        "object `{object}`: vertex {vertex} has the coordinate {value}; give finite numbers of magnitude up to 1e30"
    )]
    Coordinate { object: String, vertex: usize, value: f64 },
    #[error("object `{object}`: cell {cell} names vertex {index}, but there are only {count} (0 to {})", count.saturating_sub(1))]
    Index { object: String, cell: usize, index: u32, count: usize },
    #[error("object `{object}`: {found} normals for {expected} vertices; give one a vertex, or none")]
    NormalCount { object: String, found: usize, expected: usize },
    #[error("the scene has {count} {what}; at most {} fit", u32::MAX)]
    TooMany { what: &'static str, count: usize },
    #[error("the scene has {0} objects; at most 65535 fit")]
    TooManyObjects(usize),
}
