//! The frame of a VTK XML file: the XML proper, the bytes appended to it, and how numbers are kept.
//!
//! A file with raw appended arrays is not XML: behind `<AppendedData encoding="raw">_` come the bytes of the arrays as
//! they are. So the file is cut there, and the head closed by hand, before an XML parser sees it.

use std::borrow::Cow;
use std::cell::Cell;

use roxmltree::Node;

use super::blocks::Compressor;
use super::{Problem, Wanted};

/// A file cut in two.
pub(super) struct Parts<'a> {
    /// The XML, complete in itself.
    pub head: Cow<'a, str>,
    /// What lies behind it.
    pub appended: Option<Appended<'a>>,
}

/// The appended bytes, from behind the `_` to the end of the file.
pub(super) enum Appended<'a> {
    /// As they are.
    Raw(&'a [u8]),
    /// In base64; up to the next tag.
    Base64(&'a [u8]),
}

/// Cuts a file into XML and appended bytes.
pub(super) fn cut(bytes: &[u8]) -> Result<Parts<'_>, Problem> {
    let text = |bytes| std::str::from_utf8(bytes).map_err(|e| Problem::Xml(format!("{e} in UTF-8 text")));
    let start = find(bytes, b"<VTKFile").filter(|_| bytes.trim_ascii_start().starts_with(b"<"));
    let Some(start) = start else {
        let found = String::from_utf8_lossy(&bytes[..bytes.len().min(24)]).into_owned();
        return Err(Problem::Foreign { found });
    };
    let Some(tag) = find(&bytes[start..], b"<AppendedData").map(|at| start + at) else {
        return Ok(Parts { head: text(bytes)?.into(), appended: None });
    };
    // The last bytes written are the closing tag; without it the file is a part of itself.
    if !bytes.trim_ascii_end().ends_with(b"</VTKFile>") {
        let what = "the end of the file, `</VTKFile>`,".to_string();
        return Err(Problem::Truncated { what, expected: 10, found: 0 });
    }
    let lacks = |lacks: &str| Problem::Missing { element: "AppendedData".into(), lacks: lacks.into() };
    let tag_end = tag + find(&bytes[tag..], b">").ok_or_else(|| lacks("its end"))?;
    let marker = find(&bytes[tag_end..], b"_").ok_or_else(|| lacks("the `_` before its bytes"))?;
    let content = &bytes[tag_end + marker + 1..];
    let tag_text = text(&bytes[tag..tag_end])?.replace('\'', "\"");
    let appended = if tag_text.contains("\"raw\"") {
        Appended::Raw(content)
    } else {
        // base64 is also what an absent attribute means.
        Appended::Base64(&content[..find(content, b"<").unwrap_or(content.len())])
    };
    let head = format!("{}</VTKFile>", text(&bytes[..tag])?);
    Ok(Parts { head: head.into(), appended: Some(appended) })
}

/// Where `needle` begins in `bytes`.
fn find(bytes: &[u8], needle: &[u8]) -> Option<usize> {
    let first = *needle.first()?;
    let mut from = 0;
    while let Some(at) = bytes[from..].iter().position(|&b| b == first) {
        if bytes[from + at..].starts_with(needle) {
            return Some(from + at);
        }
        from += at + 1;
    }
    None
}

/// A parsed file and what its root element says about how numbers are kept.
pub(super) struct Document<'a> {
    /// `ImageData`, `UnstructuredGrid`, ...
    pub kind: &'a str,
    /// The element of that name.
    pub data_set: Node<'a, 'a>,
    /// Byte order of binary numbers.
    pub little_endian: bool,
    /// Bytes of each number that tells a length, 4 or 8.
    pub header_size: usize,
    /// How blocks are compressed, if they are.
    pub compressor: Option<Compressor>,
    /// The appended bytes.
    pub appended: Option<Appended<'a>>,
    /// All offsets into them, ascending: where one array ends another begins.
    pub offsets: Vec<usize>,
    /// Which arrays are read.
    pub wanted: Wanted<'a>,
    /// Bytes of memory that its arrays may still take.
    pub budget: Cell<u64>,
}

impl<'a> Document<'a> {
    /// Reads the root element's attributes. Arrays may take so many bytes of memory.
    pub fn new(
        root: Node<'a, 'a>,
        appended: Option<Appended<'a>>,
        wanted: Wanted<'a>,
        budget: u64,
    ) -> Result<Self, Problem> {
        if root.tag_name().name() != "VTKFile" {
            return Err(Problem::Foreign { found: format!("<{}", root.tag_name().name()) });
        }
        let kind = required(root, "type")?;
        let data_set = child(root, kind)?;
        let wrong = |attribute, value: &str, expected| {
            Err(Problem::Attribute { element: "VTKFile".into(), attribute, value: value.into(), expected })
        };
        let little_endian = match root.attribute("byte_order") {
            None | Some("LittleEndian") => true,
            Some("BigEndian") => false,
            Some(other) => return wrong("byte_order", other, "LittleEndian or BigEndian"),
        };
        let header_size = match root.attribute("header_type") {
            None | Some("UInt32") => 4,
            Some("UInt64") => 8,
            Some(other) => return wrong("header_type", other, "UInt32 or UInt64"),
        };
        let compressor = match root.attribute("compressor") {
            None | Some("") => None,
            Some("vtkZLibDataCompressor") => Some(Compressor::Zlib),
            Some("vtkLZ4DataCompressor") => Some(Compressor::Lz4),
            Some("vtkLZMADataCompressor") => Some(Compressor::Lzma),
            Some(other) => {
                return wrong(
                    "compressor",
                    other,
                    "vtkZLibDataCompressor, vtkLZ4DataCompressor or vtkLZMADataCompressor",
                );
            }
        };
        let mut offsets: Vec<usize> =
            root.descendants().filter_map(|n| n.attribute("offset")?.trim().parse().ok()).collect();
        offsets.sort_unstable();
        offsets.dedup();
        let budget = Cell::new(budget);
        Ok(Self { kind, data_set, little_endian, header_size, compressor, appended, offsets, wanted, budget })
    }

    /// Takes the bytes of an array from what there is; refused, before any is asked for, where that is less.
    ///
    /// A small file may declare a lot: compression makes thousands of bytes of one, and arrays may lie in one place.
    pub fn charge(&self, array: &str, bytes: u64) -> Result<(), Problem> {
        let left = self.budget.get();
        let rest = left.checked_sub(bytes);
        let rest = rest.ok_or_else(|| Problem::Memory { array: array.into(), needed: bytes, free: left })?;
        self.budget.set(rest);
        Ok(())
    }

    /// The pieces of the data set; none if it is empty.
    pub fn pieces(&self) -> impl Iterator<Item = Node<'a, 'a>> + use<'a> {
        self.data_set.children().filter(|n| n.has_tag_name("Piece"))
    }
}

/// The child element of this name.
pub(super) fn child<'a>(node: Node<'a, 'a>, name: &str) -> Result<Node<'a, 'a>, Problem> {
    node.children()
        .find(|n| n.has_tag_name(name))
        .ok_or_else(|| Problem::Missing { element: node.tag_name().name().into(), lacks: format!("`<{name}>`") })
}

/// An attribute that must be there.
pub(super) fn required<'a>(node: Node<'a, 'a>, name: &str) -> Result<&'a str, Problem> {
    node.attribute(name).ok_or_else(|| Problem::Missing {
        element: node.tag_name().name().into(),
        lacks: format!("the attribute `{name}`"),
    })
}

/// `N` numbers in an attribute, if it is there.
pub(super) fn numbers<const N: usize, T: std::str::FromStr + Copy + Default>(
    node: Node<'_, '_>,
    attribute: &'static str,
    expected: &'static str,
) -> Result<Option<[T; N]>, Problem> {
    let Some(value) = node.attribute(attribute) else { return Ok(None) };
    let mut numbers = [T::default(); N];
    let mut words = value.split_whitespace();
    let read = numbers.iter_mut().all(|n| words.next().and_then(|w| w.parse().ok()).map(|x| *n = x).is_some());
    if read && words.next().is_none() {
        return Ok(Some(numbers));
    }
    let element = node.tag_name().name().into();
    Err(Problem::Attribute { element, attribute, value: value.into(), expected })
}
