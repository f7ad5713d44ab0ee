//! Reading VTK's XML files: `.vti`, `.vtu` and `.vtp`.
//!
//! VTK's XML files keep their arrays in many ways: as text, as base64 inside the XML, or appended behind it, raw or
//! in base64; whole or in compressed blocks (zlib, LZ4, LZMA); with lengths of 32 or 64 bits, in either byte order.
//! All of them are read here, from VTK, ParaView and this crate alike.
//!
//! Why not by the `vtkio` crate, which writes the meshes: it keeps an image's origin and spacing in single precision,
//! reads no raw appended arrays, which is how ParaView saves, and drops in silence compressed arrays whose length is a
//! multiple of the block size. Here every array comes back or the file is refused. Legacy `.vtk` files are refused too:
//! a reader that stops at the first attribute it does not know, as `vtkio`'s does, cannot tell a whole file from a
//! part of one.
//!
//! How a file becomes numbers: `document` cuts the XML off the appended bytes and parses it; `data_array` turns
//! one `<DataArray>` into numbers, `blocks` undoing compression; `image` and `mesh` know what the elements mean.
//! A file is never trusted: sizes are checked against the bytes at hand before memory is asked for.

mod blocks;
mod data_array;
mod document;
mod error;
mod image;
mod mesh;
mod nesting;

use std::path::Path;

pub use error::{Error, Problem};
pub use image::Image;
pub use mesh::UnstructuredGrid;

use crate::volume::{Array, Volume};

/// VTK's number for a triangle.
pub const TRIANGLE: u8 = 5;
/// VTK's number for a tetrahedron.
pub const TETRAHEDRON: u8 = 10;

/// What VTK calls cells of this type; the number for those that are rare.
pub fn cell_name(kind: u8) -> String {
    let names = [
        "empty cell",
        "vertex",
        "poly-vertex",
        "line",
        "poly-line",
        "triangle",
        "triangle strip",
        "polygon",
        "pixel",
        "quad",
        "tetrahedron",
        "voxel",
        "hexahedron",
        "wedge",
        "pyramid",
    ];
    names.get(usize::from(kind)).map_or_else(|| format!("VTK type {kind}"), |&name| name.to_owned())
}

/// What a VTK file holds.
#[derive(Clone, Debug, PartialEq)]
pub enum DataSet {
    /// Voxels.
    Image(Image),
    /// Points and cells.
    Unstructured(UnstructuredGrid),
}

/// An entry of the field data: what belongs to the data set as a whole.
#[derive(Clone, Debug, PartialEq)]
pub enum Field {
    /// Strings under a name.
    Text(String, Vec<String>),
    /// Numbers under a name.
    Numbers(Array),
}

impl Field {
    /// Its name.
    pub fn name(&self) -> &str {
        match self {
            Field::Text(name, _) => name,
            Field::Numbers(array) => &array.name,
        }
    }

    /// Its content as text: strings a line each, numbers with spaces between.
    pub fn text(&self) -> String {
        match self {
            Field::Text(_, lines) => lines.join("\n"),
            Field::Numbers(a) => (0..a.values.len()).map(|i| a.values.format(i)).collect::<Vec<_>>().join(" "),
        }
    }
}

/// Reads a VTK file of any kind known here; what it holds is told from its content, not from its name.
///
/// # Errors
/// If it cannot be read, is damaged, cut short, or foreign.
pub fn read(path: &Path) -> Result<DataSet, Error> {
    let bytes = crate::input::read(path).map_err(|cause| Error::Open { path: path.into(), cause })?;
    parse(&bytes).map_err(|problem| Error::File { path: path.into(), problem })
}

/// Reads a mesh: a `.vtu` or `.vtp` file.
///
/// # Errors
/// As [`read`], and if the file holds an image.
pub fn read_mesh(path: &Path) -> Result<UnstructuredGrid, Error> {
    match read(path)? {
        DataSet::Unstructured(grid) => Ok(grid),
        DataSet::Image(_) => Err(Error::File {
            path: path.into(),
            problem: Problem::Kind { found: "an image".into(), expected: "a mesh" },
        }),
    }
}

/// Reads an image from a `.vti` file.
///
/// # Errors
/// If it cannot be read, is damaged or something else, or carries what a [`Volume`] cannot: arrays on cells, or a
/// rotated grid. Nothing is left out in silence; [`read`] takes such files too.
pub fn read_volume(path: &Path) -> Result<Volume, Error> {
    let in_file = |problem| Error::File { path: path.into(), problem };
    match read(path)? {
        DataSet::Image(image) => image.into_volume().map_err(in_file),
        DataSet::Unstructured(_) => Err(in_file(Problem::Kind { found: "a mesh".into(), expected: "an image" })),
    }
}

/// The data set in the bytes of a VTK file.
///
/// # Errors
/// As [`read`].
pub fn parse(bytes: &[u8]) -> Result<DataSet, Problem> {
    if bytes.is_empty() {
        return Err(Problem::Empty);
    }
    if bytes.starts_with(b"# vtk DataFile") {
        return Err(Problem::Unsupported {
            what: "a legacy `.vtk` file".into(),
            remedy: "save it as `.vti` or `.vtu` (in ParaView: Save Data)",
        });
    }
    let parts = document::cut(bytes)?;
    nesting::check(&parts.head)?;
    let xml = roxmltree::Document::parse(&parts.head).map_err(|e| Problem::Xml(e.to_string()))?;
    let document = document::Document::new(xml.root_element(), parts.appended)?;
    match document.kind {
        "ImageData" => image::read(&document).map(DataSet::Image),
        "UnstructuredGrid" | "PolyData" => mesh::read(&document).map(DataSet::Unstructured),
        other => Err(Problem::Kind { found: other.into(), expected: "ImageData, UnstructuredGrid or PolyData" }),
    }
}
