//! STL, ascii and binary, through `stl_io`.
//!
//! An ascii file begins with `solid`, but so do some binary ones: a file is binary if its length is what the number of
//! triangles at byte 80 says, and else ascii if it begins with `solid`. The library wants lower case, a name behind the
//! first `solid`, and stops at the first `endsolid`; so those lines are normalised here, and files of several solids are
//! read as one. An ascii file that does not end with `endsolid` has been cut off.

use std::io::Cursor;

use super::{Cells, FileMesh};
use crate::geometry::Vector64;
use crate::mesh::weld::weld;

const HEADER: usize = 84;
const TRIANGLE: usize = 50;

pub fn read(bytes: &[u8]) -> Result<FileMesh, String> {
    let declared = bytes.get(80..HEADER).map(|n| u32::from_le_bytes([n[0], n[1], n[2], n[3]]) as usize);
    let needed = declared.map(|n| HEADER + TRIANGLE * n);
    let begins_with_solid = bytes.trim_ascii_start().get(..5).is_some_and(|b| b.eq_ignore_ascii_case(b"solid"));
    if begins_with_solid && needed != Some(bytes.len()) {
        return triangles(normalise(bytes)?);
    }
    match needed {
        None => Err(format!("is no STL file: {} bytes, and no \"solid\" at the start", bytes.len())),
        Some(needed) if needed > bytes.len() => Err(format!(
            "is cut off, or no STL file: it declares {} triangles, which take {needed} bytes, and has {}",
            declared.unwrap_or_default(),
            bytes.len()
        )),
        Some(needed) => triangles(bytes[..needed].to_vec()),
    }
}

fn normalise(bytes: &[u8]) -> Result<Vec<u8>, String> {
    let text = String::from_utf8_lossy(bytes).to_lowercase();
    let mut lines = String::from("solid mesh\n");
    let mut ended = false;
    for line in text.lines() {
        match line.split_whitespace().next() {
            None => {}
            Some("solid") => {}
            Some("endsolid") => ended = true,
            Some(_) => {
                ended = false;
                lines.push_str(line);
                lines.push('\n');
            }
        }
    }
    if !ended {
        return Err("is cut off: the last line is no \"endsolid\"".into());
    }
    lines.push_str("endsolid mesh\n");
    Ok(lines.into_bytes())
}

fn triangles(bytes: Vec<u8>) -> Result<FileMesh, String> {
    let mut cursor = Cursor::new(bytes);
    let mut points = Vec::new();
    for (i, triangle) in stl_io::create_stl_reader(&mut cursor).map_err(|e| e.to_string())?.enumerate() {
        let triangle = triangle.map_err(|e| format!("triangle {i}: {e}"))?;
        points.extend(triangle.vertices.map(|v| Vector64::from(v.0.map(f64::from))));
    }
    let corners = (0..points.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let (points, cells) = weld(&points, corners);
    Ok(FileMesh { points, cells: Cells::Triangles(cells), point_arrays: Vec::new() })
}
