//! Where ambient occlusion is asked for: at a vertex of the mesh, or at a point inside one of its simplices.

use crate::accel::Tracer;
use crate::geometry::Vector;
use crate::mesh::Mesh;

/// A point at which ambient occlusion is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ShadingPoint<const D: usize> {
    /// A vertex of the mesh, with its normal. The simplices around it hide what lies behind them ([`super::Surroundings`]).
    Vertex(u32),
    /// A visible point inside a simplex, on the side that the normal points to. That simplex hides nothing, and neither
    /// does another that lies in the same hyperplane there.
    Inside {
        /// Where it is.
        position: Vector<D>,
        /// The middle of the hemisphere; of length 1.
        normal: Vector<D>,
        /// The simplex; [`super::NOTHING`] if it is inside none.
        simplex: u32,
        /// Tells points apart: each number has its own rays.
        number: u64,
    },
}

impl<const D: usize> ShadingPoint<D> {
    /// All vertices of a mesh.
    pub fn vertices(mesh: &Mesh<D>) -> Vec<Self> {
        (0..mesh.vertices.len() as u32).map(Self::Vertex).collect()
    }

    /// Where it is.
    #[inline]
    pub fn position(&self, mesh: &Mesh<D>) -> Vector<D> {
        match self {
            Self::Vertex(vertex) => mesh.vertices[*vertex as usize],
            Self::Inside { position, .. } => *position,
        }
    }

    /// The middle of its hemisphere; zero for a vertex that belongs to no simplex.
    #[inline]
    pub fn normal(&self, mesh: &Mesh<D>) -> Vector<D> {
        match self {
            Self::Vertex(vertex) => mesh.normals[*vertex as usize],
            Self::Inside { normal, .. } => *normal,
        }
    }

    /// The simplices that hide nothing: what is underfoot of a point inside one, else none.
    #[inline]
    pub fn ignored(&self, tracer: &Tracer<D>) -> Vec<u32> {
        match self {
            Self::Vertex(_) => Vec::new(),
            Self::Inside { simplex, position, .. } => tracer.underfoot(*simplex, position),
        }
    }

    /// What tells its rays from those of other points.
    #[inline]
    pub fn number(&self) -> u64 {
        match self {
            Self::Vertex(vertex) => u64::from(*vertex),
            Self::Inside { number, .. } => *number,
        }
    }
}
