//! VTK's files as one model: an image, or points and cells, with arrays on them and field data; read from the XML formats
//! `.vti`, `.vtu` and `.vtp`, from lists of their pieces (`.pvti`, `.pvtu`, `.pvtp`), and from legacy `.vtk`.
//!
//! VTK's XML files keep their arrays in many ways: as text, as base64 inside the XML, or appended behind it, raw or
//! in base64; whole or in compressed blocks (zlib, LZ4, LZMA); with lengths of 32 or 64 bits, in either byte order.
//! All of them are read here, from VTK, ParaView and this crate alike.
//!
//! Why not by the `vtkio` crate: it keeps an image's origin and spacing in single precision, reads no raw appended arrays,
//! which is how ParaView saves, drops in silence compressed arrays whose length is a multiple of the block size, and stops at
//! the first attribute of a legacy file that it does not know. Here every array that is asked for comes back or the file is
//! refused. Tests hold the legacy reader against it.
//!
//! How a file becomes numbers: `document` cuts the XML off the appended bytes and parses it; `data_array` turns
//! one `<DataArray>` into numbers, `blocks` undoing compression; `image` and `mesh` know what the elements mean; `pieces` joins
//! what is stored in several, `parallel` finds those in files of their own; `legacy` is the other format; [`cell`] knows the kinds of cells.
//! A file is never trusted: sizes are checked against the bytes at hand, and against the memory there is, before memory is
//! asked for.

mod blocks;
pub mod cell;
mod data_array;
mod document;
mod error;
mod image;
mod legacy;
mod mesh;
mod nesting;
mod parallel;
mod pieces;
pub(in crate::io) mod text;

use std::path::{Path, PathBuf};

pub use cell::{TETRAHEDRON, TRIANGLE, cell_name};
pub use error::{Error, Problem};
pub use image::Image;
pub use mesh::UnstructuredGrid;

use crate::volume::{Array, Volume, available_memory};

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

/// Which arrays of a file are read. What is not asked for is not decoded, so it can't be wrong either.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted<'a> {
    /// All of them.
    All,
    /// All whose numbers are of a type known here.
    Numbers,
    /// Those of these names, on points, on cells, or of the data set.
    Named(&'a [&'a str]),
}

impl Wanted<'_> {
    /// Whether the array of this name is.
    pub fn takes(&self, name: &str) -> bool {
        match self {
            Wanted::All | Wanted::Numbers => true,
            Wanted::Named(names) => names.contains(&name),
        }
    }
}

/// Reads a VTK file of any kind known here; what it holds is told from its content, not from its name.
///
/// # Errors
/// If it cannot be read, is damaged, cut short, or foreign.
pub fn read(path: &Path) -> Result<DataSet, Error> {
    read_wanted(path, Wanted::All)
}

/// The same with only those arrays that are wanted.
///
/// # Errors
/// As [`read`].
pub fn read_wanted(path: &Path, wanted: Wanted<'_>) -> Result<DataSet, Error> {
    let bytes = crate::input::read(path).map_err(|cause| Error::Open { path: path.into(), cause })?;
    parse_at(&bytes, wanted, Some(path)).map_err(|problem| Error::File { path: path.into(), problem })
}

/// The files of the pieces that a `.pvti`, `.pvtu` or `.pvtp` names; none of any other, or of one that can't be read.
pub fn piece_files(path: &Path) -> Vec<PathBuf> {
    let bytes = crate::input::read(path).unwrap_or_default();
    with_document(&bytes, Wanted::All, 0, |document| Ok(parallel::files(document, path))).unwrap_or_default()
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
    parse_wanted(bytes, Wanted::All)
}

/// The same with only those arrays that are wanted.
///
/// # Errors
/// As [`read`]; and if it only names the files of its pieces, for which [`read_wanted`] must know where it lies.
pub fn parse_wanted(bytes: &[u8], wanted: Wanted<'_>) -> Result<DataSet, Problem> {
    parse_at(bytes, wanted, None)
}

/// The same of a file that lies here.
pub(super) fn parse_at(bytes: &[u8], wanted: Wanted<'_>, path: Option<&Path>) -> Result<DataSet, Problem> {
    if bytes.is_empty() {
        return Err(Problem::Empty);
    }
    if bytes.starts_with(legacy::MAGIC) {
        return legacy::read(bytes, wanted);
    }
    let budget = available_memory().unwrap_or(u64::MAX) / 2;
    with_document(bytes, wanted, budget, |document| match (document.kind, path) {
        ("ImageData", _) => image::read(document).map(DataSet::Image),
        ("UnstructuredGrid" | "PolyData", _) => mesh::read(document).map(DataSet::Unstructured),
        ("PImageData" | "PUnstructuredGrid" | "PPolyData", Some(path)) => parallel::read(document, path),
        (other, _) => Err(Problem::Kind {
            found: other.into(),
            expected: "ImageData, UnstructuredGrid or PolyData, whole or in pieces,",
        }),
    })
}

/// Meshes as one, where they have the same arrays.
pub(super) fn joined(parts: Vec<UnstructuredGrid>) -> Result<UnstructuredGrid, Problem> {
    mesh::joined(parts)
}

/// Refuses XML whose shape would keep a parser busy for ever.
pub(super) fn check_nesting(xml: &str) -> Result<(), Problem> {
    nesting::check(xml)
}

/// Opens an XML file whose arrays may take so many bytes of memory.
fn with_document<T>(
    bytes: &[u8],
    wanted: Wanted<'_>,
    budget: u64,
    then: impl FnOnce(&document::Document<'_>) -> Result<T, Problem>,
) -> Result<T, Problem> {
    let parts = document::cut(bytes)?;
    nesting::check(&parts.head)?;
    let xml = roxmltree::Document::parse(&parts.head).map_err(|e| Problem::Xml(e.to_string()))?;
    then(&document::Document::new(xml.root_element(), parts.appended, wanted, budget)?)
}
