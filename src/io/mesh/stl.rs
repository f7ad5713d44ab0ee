//! STL, ascii and binary.
//!
//! An ascii file begins with `solid`, but so do some binary ones. A file is binary if its length is what the number of
//! triangles at byte 80 says; else ascii if it begins with `solid`, is text, and has a facet or an end; else binary, with
//! whatever lies behind the triangles. Normals are not read: who writes `nan` there, writes right vertices all the same. Names
//! may be in any encoding, several solids are one mesh, and text behind a solid is passed over. An ascii file whose last
//! solid does not end with `endsolid` has been cut off.

use super::polygon;
use crate::geometry::Vector64;
use crate::io::vtk::UnstructuredGrid;
use crate::io::vtk::cell::TRIANGLE;
use crate::mesh::weld::weld;

const HEADER: usize = 84;
const RECORD: usize = 50;
/// Bytes that hold no zero in a text, and hardly without one in a binary file.
const LOOK: usize = 4096;

pub fn read(bytes: &[u8]) -> Result<UnstructuredGrid, String> {
    let declared = bytes.get(80..HEADER).map(|n| u32::from_le_bytes([n[0], n[1], n[2], n[3]]) as usize);
    let needed = declared.map(|n| HEADER + RECORD * n);
    if needed != Some(bytes.len()) && is_text(bytes) {
        return ascii(bytes);
    }
    let behind = bytes.len().saturating_sub(HEADER);
    match (needed, declared) {
        (_, Some(0)) if behind > 0 && behind.is_multiple_of(RECORD) => Err(format!(
            "declares no triangles, and has room for {}: whoever wrote it didn't finish; write it again",
            behind / RECORD
        )),
        (Some(needed), _) if needed <= bytes.len() => Ok(binary(&bytes[HEADER..needed])),
        (Some(needed), Some(declared)) => Err(format!(
            "is cut off, or no STL file: it declares {declared} triangles, which take {needed} bytes, and has {}",
            bytes.len()
        )),
        _ => Err(format!("is no STL file: {} bytes, and no \"solid\" at the start", bytes.len())),
    }
}

fn is_text(bytes: &[u8]) -> bool {
    let begins = bytes.trim_ascii_start().get(..5).is_some_and(|b| b.eq_ignore_ascii_case(b"solid"));
    let text = !bytes[..bytes.len().min(LOOK)].contains(&0);
    // What is left of an ascii file cut off in its first line is still one.
    let known = |word: &[u8]| word.eq_ignore_ascii_case(b"facet") || word.eq_ignore_ascii_case(b"endsolid");
    begins && text && (bytes.len() < HEADER || words(bytes).any(known))
}

/// Takes the first word off a text.
fn next_word<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let text = rest.trim_ascii_start();
    let end = text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len());
    let (word, behind) = text.split_at(end);
    *rest = behind;
    (!word.is_empty()).then_some(word)
}

fn words(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    bytes.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

fn binary(records: &[u8]) -> UnstructuredGrid {
    let number = |at: &[u8]| f64::from(f32::from_le_bytes([at[0], at[1], at[2], at[3]]));
    let mut points = Vec::with_capacity(3 * (records.len() / RECORD));
    for record in records.chunks_exact(RECORD) {
        // The normal takes the first twelve bytes.
        let corner = |at: &[u8]| [number(at), number(&at[4..]), number(&at[8..])];
        points.extend(record[12..48].chunks_exact(12).map(corner));
    }
    let corners = (0..points.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    welded(&points, corners)
}

fn ascii(bytes: &[u8]) -> Result<UnstructuredGrid, String> {
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    let (mut facets, mut corners) = (0, Vec::<u32>::new());
    let (mut within, mut ended) = (false, false);
    let mut rest = bytes;
    while let Some(word) = next_word(&mut rest) {
        let is = |name: &[u8]| word.eq_ignore_ascii_case(name);
        if (is(b"solid") || is(b"endsolid"))
            && let Some(end) = rest.iter().position(|byte| matches!(byte, b'\n' | b'\r'))
        {
            // The rest of the line is a name, whatever its words are.
            rest = &rest[end..];
        }
        if is(b"facet") || is(b"endsolid") {
            (within, ended) = (is(b"facet"), is(b"endsolid"));
            corners.clear();
        } else if within && is(b"vertex") {
            let mut point = [0.0; 3];
            for x in &mut point {
                let word = next_word(&mut rest).ok_or("is cut off: the last vertex is not whole")?;
                let number = std::str::from_utf8(word).ok().and_then(|text| text.parse::<f32>().ok());
                let shown: String = String::from_utf8_lossy(word).chars().take(40).collect();
                *x = f64::from(
                    number.ok_or_else(|| format!("triangle {facets}: \"{shown}\" where a coordinate should be"))?,
                );
            }
            corners.push(points.len() as u32);
            points.push(point);
        } else if within && is(b"endfacet") {
            if corners.len() < 3 {
                return Err(format!("triangle {facets}: has {} vertices", corners.len()));
            }
            triangles.extend(polygon::triangles(&corners, &points));
            (within, facets) = (false, facets + 1);
        }
    }
    if !ended {
        return Err("is cut off: its last solid has no \"endsolid\"".into());
    }
    Ok(welded(&points, triangles))
}

/// The format has no shared points: equal ones become one.
fn welded(points: &[[f64; 3]], triangles: Vec<[u32; 3]>) -> UnstructuredGrid {
    let points: Vec<Vector64<3>> = points.iter().map(|&p| p.into()).collect();
    let (points, triangles) = weld(&points, triangles);
    let mut grid =
        UnstructuredGrid { points: points.into_iter().map(Into::into).collect(), ..UnstructuredGrid::default() };
    triangles.iter().for_each(|triangle| grid.push(TRIANGLE, triangle));
    grid
}
