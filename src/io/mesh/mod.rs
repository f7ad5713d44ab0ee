//! Meshes from files: triangles from `.stl`, `.obj` and `.ply`, triangles or tetrahedra from `.vtu`, `.vtk` and
//! `.msh`.
//!
//! A file is read whole, so that declared sizes can be held against its length before anything is allocated. Whatever
//! it holds, the answer is a mesh whose indices are within range and whose coordinates are finite, or an error that
//! names the file and what is wrong with it. Orientation is that of the vertices' order; normals of STL files are ignored.

mod msh;
mod obj;
mod ply;
mod stl;
mod vtk;
mod vtu;

use super::{Input, InputError};
use crate::geometry::Vector64;

/// What a file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct FileMesh {
    /// The points.
    pub points: Vec<Vector64<3>>,
    /// The simplices over them.
    pub cells: Cells,
    /// What is known at each point; only `.vtu` files carry any here.
    pub point_arrays: Vec<PointArray>,
}

/// The simplices of a file, all of one kind.
#[derive(Clone, Debug, PartialEq)]
pub enum Cells {
    /// A surface.
    Triangles(Vec<[u32; 3]>),
    /// A solid.
    Tetrahedra(Vec<[u32; 4]>),
}

/// A named array of tuples, one a point.
#[derive(Clone, Debug, PartialEq)]
pub struct PointArray {
    /// Its name in the file.
    pub name: String,
    /// Numbers a point.
    pub components: usize,
    /// `components` numbers a point, point after point.
    pub values: Vec<f64>,
}

impl FileMesh {
    /// The array with this name, one vector a point, if it has D components and finite values.
    pub fn vectors<const D: usize>(&self, name: &str, input: &Input) -> Result<Option<Vec<Vector64<D>>>, InputError> {
        let Some(array) = self.point_arrays.iter().find(|array| array.name == name) else { return Ok(None) };
        if array.components != D || array.values.len() != D * self.points.len() {
            return Err(input.wrong(format!(
                "its point array \"{name}\" has {} components and {} values; expected {D} components at each of {} points",
                array.components,
                array.values.len(),
                self.points.len()
            )));
        }
        if let Some(at) = array.values.iter().position(|x| !x.is_finite()) {
            return Err(input.wrong(format!("its point array \"{name}\" is {} at point {}", array.values[at], at / D)));
        }
        Ok(Some(array.values.chunks_exact(D).map(Vector64::from_column_slice).collect()))
    }
}

impl Input {
    /// Reads the mesh, by the ending of the file's name.
    pub fn read(&self) -> Result<FileMesh, InputError> {
        let ending = self.path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let parse = match ending.as_str() {
            "stl" => stl::read,
            "ply" => ply::read,
            "vtu" => vtu::read,
            "vtk" => vtk::read,
            "obj" => obj::read,
            "msh" => msh::read,
            _ => {
                return Err(
                    self.wrong("can't tell what it holds; the name must end in .stl, .obj, .ply, .msh, .vtk or .vtu")
                );
            }
        };
        let bytes = crate::input::read(&self.path).map_err(|source| self.unreadable(source))?;
        if bytes.is_empty() {
            return Err(self.wrong("is empty"));
        }
        let mesh = parse(&bytes).map_err(|message| self.wrong(message))?;
        check(&mesh).map_err(|message| self.wrong(message))?;
        Ok(mesh)
    }
}

fn check(mesh: &FileMesh) -> Result<(), String> {
    if let Some(i) = mesh.points.iter().position(|point| point.iter().any(|x| !x.is_finite())) {
        let [x, y, z] = mesh.points[i].into();
        return Err(format!("point {i} is not finite: ({x}, {y}, {z})"));
    }
    let (indices, size, kind) = match &mesh.cells {
        Cells::Triangles(cells) => (cells.as_flattened(), 3, "triangle"),
        Cells::Tetrahedra(cells) => (cells.as_flattened(), 4, "tetrahedron"),
    };
    match indices.iter().position(|&index| index as usize >= mesh.points.len()) {
        Some(at) => Err(format!("{kind} {} names point {} of {}", at / size, indices[at], mesh.points.len())),
        None if indices.is_empty() => Err(format!("holds no {kind}")),
        None => Ok(()),
    }
}

/// A polygon as a fan of triangles around its first point: right for convex ones.
fn fan(polygon: &[u32]) -> impl Iterator<Item = [u32; 3]> + '_ {
    polygon.windows(2).skip(1).map(|edge| [polygon[0], edge[0], edge[1]])
}
