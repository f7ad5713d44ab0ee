//! One `<DataArray>`: its name, its type, and its numbers wherever they are kept.

use std::borrow::Cow;

use base64::Engine;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use roxmltree::Node;

use super::Field;
use super::Problem;
use super::Wanted;
use super::blocks::{declared, decompress};
use super::document::{Appended, Document, required};
use crate::volume::{Array, Kind, Values};

/// base64 without its closing `=`, which [`base64_bytes`] looks after.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &base64::alphabet::STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::RequireNone)
        .with_decode_allow_trailing_bits(true),
);

/// The arrays in `<PointData>` or `<CellData>`, each of `tuples` tuples; none if there is no such element.
pub(super) fn attributes(
    document: &Document<'_>,
    piece: Node<'_, '_>,
    element: &str,
    tuples: u64,
) -> Result<Vec<Array>, Problem> {
    let mut arrays: Vec<Array> = Vec::new();
    for parent in piece.children().filter(|n| n.has_tag_name(element)) {
        let asked = |node: &Node<'_, '_>| is_wanted(document, node);
        for node in parent.children().filter(Node::is_element).filter(asked) {
            let array = array(document, node, Some(tuples))?;
            if arrays.iter().any(|a| a.name == array.name) {
                return Err(Problem::Duplicate { array: array.name });
            }
            arrays.push(array);
        }
    }
    Ok(arrays)
}

/// The entries of `<FieldData>`, which belong to the data set as a whole.
pub(super) fn field_data(document: &Document<'_>) -> Result<Vec<Field>, Problem> {
    let mut fields = Vec::new();
    let children = document.data_set.children().filter(|n| n.has_tag_name("FieldData"));
    let asked = |node: &Node<'_, '_>| is_wanted(document, node);
    for node in children.flat_map(|n| n.children()).filter(Node::is_element).filter(asked) {
        fields.push(if node.attribute("type") == Some("String") {
            Field::Text(name(node)?, strings(document, node)?)
        } else {
            Field::Numbers(array(document, node, declared_tuples(node)?)?)
        });
    }
    Ok(fields)
}

/// Whether an array is to be read.
fn is_wanted(document: &Document<'_>, node: &Node<'_, '_>) -> bool {
    let known = |kind: &str| kind == "Bit" || Kind::from_vtk_name(kind).is_some();
    node.attribute("Name").is_none_or(|name| document.wanted.takes(name))
        && (document.wanted != Wanted::Numbers || node.attribute("type").is_none_or(known))
}

/// The array of a `<DataArray>`; `tuples` is how many it must have, where that is known.
pub(super) fn array(document: &Document<'_>, node: Node<'_, '_>, tuples: Option<u64>) -> Result<Array, Problem> {
    let name = name(node)?;
    if node.attribute("TimeStep").is_some_and(|s| s.trim() != "0") {
        return Err(Problem::Unsupported {
            what: format!("several time steps of array `{name}` in one file"),
            remedy: "save one file a time step",
        });
    }
    let components: u64 = match node.attribute("NumberOfComponents") {
        None => 1,
        Some(text) => text.trim().parse().ok().filter(|&n| n > 0).ok_or_else(|| Problem::Attribute {
            element: "DataArray".into(),
            attribute: "NumberOfComponents",
            value: text.into(),
            expected: "a whole number above 0",
        })?,
    };
    let too_large = || Problem::Length { array: name.clone(), unit: "tuples", expected: tuples.unwrap_or(0), found: 0 };
    let count = tuples.map(|n| n.checked_mul(components).ok_or_else(too_large)).transpose()?;
    let kind_name = required(node, "type")?;
    let values = if kind_name == "Bit" {
        bits(document, node, &name, count)?
    } else {
        let kind = Kind::from_vtk_name(kind_name).ok_or_else(|| Problem::Unsupported {
            what: format!("array `{name}` of type {kind_name}"),
            remedy: "convert it to numbers, or save without it",
        })?;
        if is_text(node) {
            let text = text(node);
            let found = text.split_ascii_whitespace().count() as u64;
            check_length(&name, "numbers", count, found)?;
            kind.parse(text.split_ascii_whitespace()).map_err(|word| Problem::Damaged {
                array: name.clone(),
                cause: format!("{word:?} is no {}", kind.vtk_name()),
            })?
        } else {
            let expected = count.map(|n| n.checked_mul(kind.size() as u64).ok_or_else(too_large)).transpose()?;
            let bytes = bytes(document, node, &name, expected)?;
            document.charge(&name, bytes.len() as u64)?;
            if !bytes.len().is_multiple_of(kind.size()) {
                let cause = format!("{} bytes are no whole number of {}", bytes.len(), kind.vtk_name());
                return Err(Problem::Damaged { array: name, cause });
            }
            kind.decode(&bytes, document.little_endian)
        }
    };
    if !(values.len() as u64).is_multiple_of(components) {
        let cause = format!("{} numbers are no whole number of tuples of {components}", values.len());
        return Err(Problem::Damaged { array: name, cause });
    }
    let components = usize::try_from(components).map_err(|_| too_large())?;
    Ok(Array { name, components, values })
}

/// The array's name. The points' own array needs none: VTK finds it by its place, and some programs don't name it.
fn name(node: Node<'_, '_>) -> Result<String, Problem> {
    let of_points = node.parent().is_some_and(|parent| parent.has_tag_name("Points"));
    if of_points && !node.has_attribute("Name") {
        return Ok("Points".into());
    }
    required(node, "Name").map(Into::into)
}

fn declared_tuples(node: Node<'_, '_>) -> Result<Option<u64>, Problem> {
    let Some(text) = node.attribute("NumberOfTuples") else { return Ok(None) };
    text.trim().parse().map(Some).map_err(|_| Problem::Attribute {
        element: "DataArray".into(),
        attribute: "NumberOfTuples",
        value: text.into(),
        expected: "a whole number",
    })
}

fn check_length(array: &str, unit: &'static str, expected: Option<u64>, found: u64) -> Result<(), Problem> {
    match expected {
        Some(expected) if expected != found => Err(Problem::Length { array: array.into(), unit, expected, found }),
        _ => Ok(()),
    }
}

fn is_text(node: Node<'_, '_>) -> bool {
    node.attribute("format").is_none_or(|f| f.eq_ignore_ascii_case("ascii"))
}

/// The text of an element; VTK puts `<InformationKey>` elements among it.
fn text<'a>(node: Node<'a, 'a>) -> Cow<'a, str> {
    let mut texts = node.children().filter(Node::is_text).filter_map(|n| n.text()).filter(|t| !t.trim().is_empty());
    let Some(first) = texts.next() else { return "".into() };
    match texts.next() {
        None => first.into(),
        Some(second) => [first, second].into_iter().chain(texts).collect::<Vec<_>>().join(" ").into(),
    }
}

/// Strings, each ended by a zero byte; as text, the bytes are written as numbers.
fn strings(document: &Document<'_>, node: Node<'_, '_>) -> Result<Vec<String>, Problem> {
    let name = name(node)?;
    let bytes = if is_text(node) {
        let text = text(node);
        let byte = |word: &str| word.parse::<i16>().ok().filter(|n| (-128..256).contains(n)).map(|n| n as u8);
        let damaged = |w: &str| Problem::Damaged { array: name.clone(), cause: format!("{w:?} is no character code") };
        text.split_ascii_whitespace().map(|w| byte(w).ok_or_else(|| damaged(w))).collect::<Result<Vec<_>, _>>()?
    } else {
        bytes(document, node, &name, None)?.into_owned()
    };
    let mut strings: Vec<String> = bytes.split(|&b| b == 0).map(|s| String::from_utf8_lossy(s).into_owned()).collect();
    // What follows the last zero is no string unless the zero is missing.
    strings.pop_if(|s| s.is_empty());
    check_length(&name, "strings", declared_tuples(node)?, strings.len() as u64)?;
    Ok(strings)
}

/// A `Bit` array, eight a byte with the highest bit first, as numbers 0 and 1.
fn bits(document: &Document<'_>, node: Node<'_, '_>, name: &str, count: Option<u64>) -> Result<Values, Problem> {
    if is_text(node) {
        let text = text(node);
        let damaged = |w: &str| Problem::Damaged { array: name.into(), cause: format!("{w:?} is no bit") };
        let values = Kind::U8.parse(text.split_ascii_whitespace()).map_err(damaged)?;
        check_length(name, "bits", count, values.len() as u64)?;
        return Ok(values);
    }
    let bytes = bytes(document, node, name, count.map(|n| n.div_ceil(8)))?;
    let count = count.unwrap_or(8 * bytes.len() as u64) as usize;
    Ok(Values::U8((0..count).map(|i| bytes[i / 8] >> (7 - i % 8) & 1).collect()))
}

/// The bytes of an array in binary, decoded and decompressed; `expected` is how many there must be.
fn bytes<'a>(
    document: &Document<'a>,
    node: Node<'_, '_>,
    name: &str,
    expected: Option<u64>,
) -> Result<Cow<'a, [u8]>, Problem> {
    let damaged = |cause: String| Problem::Damaged { array: name.into(), cause };
    let stream: Cow<'a, [u8]> = match node.attribute("format") {
        Some("binary") => base64_bytes(text(node).as_bytes()).map_err(damaged)?.into(),
        Some("appended") => {
            let offset = required(node, "offset")?;
            let offset: usize = offset.trim().parse().map_err(|_| Problem::Attribute {
                element: "DataArray".into(),
                attribute: "offset",
                value: offset.into(),
                expected: "a whole number",
            })?;
            let beyond = |found: usize| Problem::Truncated {
                what: format!("array `{name}`"),
                expected: (offset as u64).saturating_add(document.header_size as u64),
                found: found as u64,
            };
            match document.appended {
                None => return Err(Problem::Missing { element: "VTKFile".into(), lacks: "`<AppendedData>`".into() }),
                Some(Appended::Raw(all)) => all.get(offset..).ok_or_else(|| beyond(all.len()))?.into(),
                Some(Appended::Base64(all)) => {
                    let next = document.offsets.partition_point(|&o| o <= offset);
                    let end = document.offsets.get(next).map_or(all.len(), |&o| o.min(all.len()));
                    let text = all.get(offset..end).ok_or_else(|| beyond(all.len()))?;
                    base64_bytes(text).map_err(damaged)?.into()
                }
            }
        }
        other => {
            return Err(Problem::Attribute {
                element: "DataArray".into(),
                attribute: "format",
                value: other.unwrap_or_default().into(),
                expected: "ascii, binary or appended",
            });
        }
    };
    let size = document.header_size;
    let header = |bytes: &[u8]| {
        let fold = |n: u64, &b: &u8| n << 8 | u64::from(b);
        if document.little_endian { bytes.iter().rev().fold(0, fold) } else { bytes.iter().fold(0, fold) }
    };
    if stream.is_empty() && expected.is_none_or(|n| n == 0) {
        return Ok(stream);
    }
    if let Some(compressor) = document.compressor {
        let unpacked = declared(&stream, header, size);
        document.charge(name, unpacked)?;
        return decompress(&stream, header, size, compressor, expected).map(Cow::from).map_err(damaged);
    }
    let truncated =
        |expected: u64| Problem::Truncated { what: format!("array `{name}`"), expected, found: stream.len() as u64 };
    let length = stream.get(..size).map(header).ok_or_else(|| truncated(size as u64))?;
    check_length(name, "bytes", expected, length)?;
    let end = length.checked_add(size as u64).filter(|&end| end <= stream.len() as u64);
    let end = end.ok_or_else(|| truncated(length.saturating_add(size as u64)))? as usize;
    Ok(match stream {
        Cow::Borrowed(b) => b[size..end].into(),
        Cow::Owned(mut b) => {
            b.truncate(end);
            b.drain(..size);
            b.into()
        }
    })
}

/// What base64 text stands for. VTK encodes the lengths and the content of a compressed array each by itself, so `=`
/// may stand in the middle: each stretch up to one is decoded alone.
fn base64_bytes(text: &[u8]) -> Result<Vec<u8>, String> {
    let text: Vec<u8> = text.iter().copied().filter(|b| !b.is_ascii_whitespace()).collect();
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    for stretch in text.split(|&b| b == b'=').filter(|s| !s.is_empty()) {
        BASE64.decode_vec(stretch, &mut bytes).map_err(|e| format!("its base64 is broken: {e}"))?;
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::base64_bytes;

    #[test]
    fn base64_in_stretches() {
        assert_eq!(base64_bytes(b" YQ==\n YmM=ZGVm ").unwrap(), b"abcdef");
        assert_eq!(base64_bytes(b"").unwrap(), b"");
        assert!(base64_bytes(b"YQ==!").is_err());
        assert!(base64_bytes(b"YQ==Z").is_err());
    }
}
