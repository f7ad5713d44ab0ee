//! Simplices as the pipeline lists them, vertex by vertex.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Error;
use super::numbers::point;
use crate::geometry::Dimension;
use crate::mesh::Surface;

/// Vertices and simplices over them: tetrahedra in 4D, triangles in 3D.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SimplicesSpec {
    /// The points, one number an axis each.
    pub vertices: Vec<Vec<f64>>,
    /// The simplices: four indices of vertices each in 4D, three in 3D, counted from 0. Their order is the orientation.
    pub cells: Vec<Vec<u32>>,
}

impl SimplicesSpec {
    /// The simplices.
    pub fn build<const D: usize>(&self) -> Result<Surface<D>, Error> {
        let vertices = self
            .vertices
            .iter()
            .enumerate()
            .map(|(i, vertex)| point(&format!("simplices.vertices.{i}"), vertex))
            .collect::<Result<Vec<_>, _>>()?;
        let simplices = self
            .cells
            .iter()
            .enumerate()
            .map(|(i, cell)| {
                check(cell, vertices.len()).map_err(|message| Error::invalid(format!("simplices.cells.{i}"), message))
            })
            .collect::<Result<Vec<_>, _>>()?;
        Ok(Surface { vertices, simplices, normals: None })
    }
}

fn check<const D: usize>(cell: &[u32], vertices: usize) -> Result<[u32; D], String> {
    let cell: [u32; D] = cell.try_into().map_err(|_| {
        let kind = Dimension::of::<D>().simplex();
        format!("expected the {D} vertices of a {kind}, found {}", cell.len())
    })?;
    for (i, &vertex) in cell.iter().enumerate() {
        if vertex as usize >= vertices {
            return Err(format!("vertex {vertex} does not exist; there are {vertices}, counted from 0"));
        }
        if cell[..i].contains(&vertex) {
            return Err(format!("names vertex {vertex} twice"));
        }
    }
    Ok(cell)
}
