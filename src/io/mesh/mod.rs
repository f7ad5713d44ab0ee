//! Meshes from files: triangles from `.stl`, `.obj` and `.ply`, triangles or tetrahedra from `.vtu`, `.vtp`, `.vtk` and
//! `.msh`; from several files in one list (`.pvtu`, `.pvtp`), and from lists over time (`.pvd`, `.vtu.series`) of one step.
//!
//! Each format has a reader that takes the cells as the file has them, as VTK's model of a mesh ([`UnstructuredGrid`]): what
//! `info` tells and `compare` compares. `simplices` makes of that what a scene takes: polygons become triangles, solid cells
//! tetrahedra.
//!
//! A file is read whole, so that declared sizes can be held against its length before anything is allocated. What is not
//! needed is not parsed. Whatever a file holds, the answer is a mesh whose indices are within range and whose coordinates are
//! finite, or an error that names the file and what is wrong with it. Orientation is that of the vertices' order; normals of
//! STL, OBJ and PLY files are ignored.

mod msh;
mod obj;
mod ply;
mod polygon;
mod simplices;
mod stl;

use std::path::{Path, PathBuf};

use super::vtk::{self, DataSet, UnstructuredGrid, Wanted};
use super::{Input, InputError, series};
use crate::geometry::Vector64;

pub use simplices::simplices;

/// The endings of the names of mesh files.
pub const ENDINGS: [&str; 11] = ["stl", "obj", "ply", "msh", "vtk", "vtp", "vtu", "pvtp", "pvtu", "pvd", "series"];

/// The arrays that a scene looks for.
const ARRAYS: [&str; 2] = ["position", "normal"];

/// The arrays in which VTK marks cells that belong to a neighbouring piece.
const GHOSTS: [&str; 2] = ["vtkGhostType", "vtkGhostLevels"];

/// The files that are read besides this one: those that it names.
pub fn data_files(path: &Path) -> Vec<PathBuf> {
    if series::is_list(path) {
        let files = series::files(path).into_iter().filter(|file| !series::is_list(file));
        return files.flat_map(|file| [data_files(&file), vec![file]].concat()).collect();
    }
    match path.extension().unwrap_or_default().to_string_lossy().to_lowercase().as_str() {
        "pvtp" | "pvtu" => vtk::piece_files(path),
        _ => Vec::new(),
    }
}

/// What a file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct FileMesh {
    /// The points.
    pub points: Vec<Vector64<3>>,
    /// The simplices over them.
    pub cells: Cells,
    /// What is known at each point, of the arrays `position` and `normal`; only VTK's files carry any here.
    pub point_arrays: Vec<PointArray>,
    /// What is allowed but worth telling.
    pub notes: Vec<String>,
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
    /// Reads the mesh as simplices, by the ending of the file's name.
    pub fn read(&self) -> Result<FileMesh, InputError> {
        let mut mesh = simplices(&self.read_cells(Wanted::Named(&[ARRAYS, GHOSTS].concat()))?)
            .map_err(|message| self.wrong(message))?;
        if self.ending() == "msh" {
            // Gmsh writes the curves of its geometry beside every mesh.
            mesh.notes.clear();
        }
        check(&mesh).map_err(|message| self.wrong(message))?;
        Ok(mesh)
    }

    fn ending(&self) -> String {
        self.path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
    }

    /// Reads the mesh with its cells as the file has them, and those arrays that are wanted.
    pub fn read_cells(&self, wanted: Wanted<'_>) -> Result<UnstructuredGrid, InputError> {
        let ending = self.ending();
        if !ENDINGS.contains(&ending.as_str()) {
            if let Some(remedy) = remedy(&ending) {
                return Err(self.wrong(format!("unsupported: .{ending} files; {remedy}")));
            }
            let known = "the name must end in .stl, .obj, .ply, .msh, .vtk, .vtp, .vtu, .pvtp, .pvtu, .pvd or .series";
            return Err(self.wrong(format!("can't tell what it holds; {known}")));
        }
        let bytes = crate::input::read(&self.path).map_err(|source| self.unreadable(source))?;
        if bytes.is_empty() {
            return Err(self.wrong("is empty"));
        }
        // Some editors put this mark before a text.
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);
        if series::is_list(&self.path) {
            return self.read_list(wanted);
        }
        let grid = match ending.as_str() {
            "stl" => stl::read(bytes),
            "ply" => ply::read(bytes),
            "obj" => obj::read(bytes),
            "msh" => msh::read(bytes),
            _ => match vtk::parse_at(bytes, wanted, Some(&self.path)) {
                Ok(DataSet::Unstructured(grid)) => Ok(grid),
                Ok(DataSet::Image(_)) => Err("holds an image, where a mesh was expected".into()),
                Err(problem) => Err(problem.to_string()),
            },
        };
        let grid = grid.map_err(|message| self.wrong(message))?;
        let count = grid.points.len();
        match grid.connectivity.iter().position(|&index| index as usize >= count) {
            Some(at) => {
                let (cell, index) = (grid.offsets.partition_point(|&end| end <= at), grid.connectivity[at]);
                Err(self.wrong(format!("is damaged: its cell {cell} names point {index} of {count}")))
            }
            None => Ok(grid),
        }
    }

    /// Reads the files of a list over time, which are the parts of one mesh.
    fn read_list(&self, wanted: Wanted<'_>) -> Result<UnstructuredGrid, InputError> {
        let steps = series::read(&self.path).map_err(|message| self.wrong(message))?;
        if let [first, .., last] = steps.as_slice() {
            let (count, file) = (steps.len(), first.files[0].display());
            let times = [first, last].map(|step| step.time.map_or("no time".to_owned(), |time| time.to_string()));
            return Err(self.wrong(format!(
                "holds {count} meshes, at the times {} to {}; name the file of one of them, as {file}",
                times[0], times[1]
            )));
        }
        let mut parts = Vec::new();
        for file in steps.iter().flat_map(|step| &step.files) {
            let part = Self { key: self.key.clone(), path: file.clone() };
            if series::is_list(file) {
                return Err(self.wrong(format!("names another list, {}; name that one", file.display())));
            }
            parts.push(part.read_cells(wanted)?);
        }
        vtk::joined(parts).map_err(|problem| self.wrong(problem.to_string()))
    }
}

/// How to come from a format that isn't read, of files with this ending, to one that is.
pub fn remedy(ending: &str) -> Option<&'static str> {
    Some(match ending {
        "vtm" | "vtpd" | "vthb" | "vtkhdf" | "vtr" | "vts" | "pvtr" | "pvts" => {
            "in ParaView: Merge Blocks or Extract Surface, and save as .vtu or .vtp"
        }
        "off" | "gltf" | "glb" | "3mf" | "dae" | "fbx" | "x3d" | "wrl" | "3ds" | "blend" | "amf" => {
            "export .ply, .obj or .stl from Blender or MeshLab"
        }
        "step" | "stp" | "iges" | "igs" | "brep" => "mesh it: gmsh -2 IN -o OUT.stl, or gmsh -3 IN -o OUT.msh",
        "inp" | "bdf" | "nas" | "mesh" | "med" | "exo" | "e" | "xdmf" | "cgns" => "meshio convert IN OUT.vtu",
        _ => return None,
    })
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
