//! What goes wrong when images and meshes are read from files.

use std::path::PathBuf;

/// A file could not be taken in.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The operating system refuses.
    #[error("{}: cannot be read: {cause}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// Its reason.
        cause: std::io::Error,
    },
    /// What the file holds is not right.
    #[error("{}: {problem}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: Problem,
    },
}

/// What is wrong inside a file.
#[derive(Debug, thiserror::Error)]
pub enum Problem {
    /// No bytes.
    #[error("the file is empty; write it again")]
    Empty,
    /// Not a VTK file.
    #[error(
        "not a VTK file: it begins with {found:?}, where `<?xml`, `<VTKFile` or `# vtk DataFile Version` was expected"
    )]
    Foreign {
        /// Its first characters.
        found: String,
    },
    /// The XML part does not parse.
    #[error("its XML is damaged or cut short: {0}")]
    Xml(String),
    /// The file ends too early.
    #[error("the file is cut short: {what} needs {expected} bytes, and {found} are there; write it again")]
    Truncated {
        /// What is incomplete.
        what: String,
        /// Bytes it should have.
        expected: u64,
        /// Bytes that are left.
        found: u64,
    },
    /// A VTK file of another kind.
    #[error("holds {found}, where {expected} was expected")]
    Kind {
        /// What it holds.
        found: String,
        /// What it should hold.
        expected: &'static str,
    },
    /// An element that must be there is not.
    #[error("`<{element}>` lacks {lacks}; the file is not as VTK writes it")]
    Missing {
        /// Where it should be.
        element: String,
        /// What is missing.
        lacks: String,
    },
    /// An attribute makes no sense.
    #[error("`<{element}>` has {attribute}={value:?}; expected {expected}")]
    Attribute {
        /// The element.
        element: String,
        /// Its attribute.
        attribute: &'static str,
        /// What that says.
        value: String,
        /// What it should say.
        expected: &'static str,
    },
    /// An array does not have the length that the file declares.
    #[error("array `{array}` has {found} {unit} where {expected} are declared; the file is damaged")]
    Length {
        /// The array.
        array: String,
        /// Bytes or numbers.
        unit: &'static str,
        /// How many it should have.
        expected: u64,
        /// How many it has.
        found: u64,
    },
    /// An array's encoding is broken.
    #[error("array `{array}` is damaged: {cause}")]
    Damaged {
        /// The array.
        array: String,
        /// In which way.
        cause: String,
    },
    /// An array that memory has no room for.
    #[error(
        "array `{array}` takes {needed} bytes, and there is room for {free}; leave it out of the file, or take fewer points"
    )]
    Memory {
        /// The array.
        array: String,
        /// Bytes it takes.
        needed: u64,
        /// Bytes that there is room for.
        free: u64,
    },
    /// Pieces that don't make a whole.
    #[error("its pieces {problem}")]
    Pieces {
        /// In which way.
        problem: String,
    },
    /// A file that a list of pieces names.
    #[error("its piece {file}: {cause}")]
    Piece {
        /// The file, as the list names it.
        file: String,
        /// What is wrong with it.
        cause: String,
    },
    /// Something in a legacy file.
    #[error("{0}")]
    Legacy(String),
    /// Two arrays of one name.
    #[error("two arrays are called `{array}`; rename one of them")]
    Duplicate {
        /// The name.
        array: String,
    },
    /// Something VTK can write and this crate does not read.
    #[error("{what} cannot be read here; {remedy}")]
    Unsupported {
        /// What it is.
        what: String,
        /// What to do.
        remedy: &'static str,
    },
}
