//! Texts in the field data of VTK's XML files: how one is written, and how one is put in the place of another.
//!
//! A file tells in its field data what it was made by. If that changes and nothing else of the file does, its arrays need
//! not be computed again: [`retell`] copies the file with another text in its head.

use std::io::{BufRead, Write};

use super::super::Error;
use super::super::xml::escape;

/// What closes the field data, which stands in front of all arrays.
const END: &[u8] = b"</FieldData>";

/// The element that holds a text. VTK writes a string as the numbers of its bytes, and a zero.
pub(in crate::io) fn text_array(name: &str, text: &str) -> String {
    use std::fmt::Write;
    let mut element =
        format!("<Array type=\"String\" Name=\"{}\" NumberOfTuples=\"1\" format=\"ascii\">", escape(name));
    element.reserve(4 * text.len());
    for byte in text.bytes() {
        let _ = write!(element, "{byte} ");
    }
    element.push_str("0</Array>");
    element
}

/// Copies the head of a file of ours up to the end of its field data, with another text under this name, and leaves the
/// source behind it. `more` reads on, up to where the file's own writer says, and may change what comes before.
///
/// # Errors
/// If there is no such text, or reading or writing fails.
pub(in crate::io) fn retell(
    source: &mut impl BufRead,
    sink: &mut impl Write,
    (name, text): (&str, &str),
    more: impl FnOnce(&mut Vec<u8>, &mut dyn BufRead) -> std::io::Result<()>,
) -> Result<(), Error> {
    let mut head = Vec::new();
    read_to(source, END, &mut head)?;
    let opening = format!("<Array type=\"String\" Name=\"{}\"", escape(name));
    let missing = || Error::Shape { array: name.into(), found: "no such text".into(), expected: "one".into() };
    let start = find(&head, opening.as_bytes()).ok_or_else(missing)?;
    let end = start + find(&head[start..], b"</Array>").ok_or_else(missing)? + b"</Array>".len();
    head.splice(start..end, text_array(name, text).into_bytes());
    more(&mut head, source)?;
    sink.write_all(&head)?;
    std::io::copy(source, sink)?;
    Ok(sink.flush()?)
}

/// Reads tag by tag until one ends with these bytes.
pub(in crate::io) fn read_to(
    source: &mut (impl BufRead + ?Sized),
    end: &[u8],
    head: &mut Vec<u8>,
) -> std::io::Result<()> {
    while !head.ends_with(end) {
        if source.read_until(b'>', head)? == 0 {
            return Err(std::io::ErrorKind::UnexpectedEof.into());
        }
    }
    Ok(())
}

fn find(bytes: &[u8], what: &[u8]) -> Option<usize> {
    bytes.windows(what.len()).position(|window| window == what)
}
