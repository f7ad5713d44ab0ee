//! OBJ: the vertices, and the faces of all objects and groups as one mesh, by polygons as they are written. Lines and loose
//! points are cells too.
//!
//! Only lines that begin with `v`, `f`, `l` or `p` are read. Materials, groups, colours, texture coordinates and normals are
//! passed over unread, so their names may be in any encoding, or empty. Vertices keep the order of the file, which the crate
//! `tobj` doesn't; it makes faces of lines as well, and refuses a file for a name.

use crate::io::vtk::UnstructuredGrid;
use crate::io::vtk::cell::{LINE, POLY_LINE, POLYGON, QUAD, TRIANGLE, VERTEX};

pub fn read(bytes: &[u8]) -> Result<UnstructuredGrid, String> {
    let mut grid = UnstructuredGrid::default();
    let end = if bytes.contains(&b'\n') { b'\n' } else { b'\r' };
    let mut joined: Vec<u8> = Vec::new();
    for (number, line) in bytes.split(|&b| b == end).enumerate() {
        let line = line.trim_ascii_end();
        if let Some(begun) = line.strip_suffix(b"\\") {
            joined.extend(begun);
            joined.push(b' ');
            continue;
        }
        joined.extend(line);
        element(&joined, &mut grid).map_err(|e| format!("is damaged, or no OBJ file: line {}: {e}", number + 1))?;
        joined.clear();
    }
    let count = grid.points.len();
    if let Some(&index) = grid.connectivity.iter().find(|&&index| index as usize >= count) {
        return Err(format!("is damaged, or no OBJ file: a face names vertex {} of {count}", u64::from(index) + 1));
    }
    Ok(grid)
}

/// One element of the file.
fn element(line: &[u8], grid: &mut UnstructuredGrid) -> Result<(), String> {
    let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    match words.next() {
        Some(b"v") => {
            let mut point = [0.0; 3];
            for x in &mut point {
                let word = words.next().ok_or("a vertex has three coordinates")?;
                *x = number(word).ok_or_else(|| format!("\"{}\" is no coordinate", brief(word)))?;
            }
            grid.points.push(point);
        }
        Some(kind @ (b"f" | b"fo" | b"l" | b"p")) => {
            let mut corners = Vec::new();
            for word in words.take_while(|word| !word.starts_with(b"#")) {
                corners.push(index(word, grid.points.len())?);
            }
            match (kind, corners.len()) {
                (_, 0) => {}
                (b"p", _) => corners.iter().for_each(|&corner| grid.push(VERTEX, &[corner])),
                (_, 1) => grid.push(VERTEX, &corners),
                (_, 2) => grid.push(LINE, &corners),
                (b"l", _) => grid.push(POLY_LINE, &corners),
                (_, 3) => grid.push(TRIANGLE, &corners),
                (_, 4) => grid.push(QUAD, &corners),
                _ => grid.push(POLYGON, &corners),
            }
        }
        Some(b"surf" | b"curv") => return Err("free-form surfaces are not read; export polygons".into()),
        _ => {}
    }
    Ok(())
}

/// The vertex that a corner names: before the first slash, from 1, or counted back from the vertices so far.
fn index(word: &[u8], so_far: usize) -> Result<u32, String> {
    let vertex = word.split(|&b| b == b'/').next().unwrap_or_default();
    let wrong = || format!("\"{}\" names no vertex", brief(word));
    let index: i64 = std::str::from_utf8(vertex).ok().and_then(|text| text.parse().ok()).ok_or_else(wrong)?;
    let place = if index < 0 { so_far as i64 + index } else { index - 1 };
    u32::try_from(place).map_err(|_| wrong())
}

fn number(word: &[u8]) -> Option<f64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

fn brief(word: &[u8]) -> String {
    String::from_utf8_lossy(word).chars().take(40).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_vertices_and_cells_are_read() {
        let text =
            b"mtllib \xe4.mtl\nusemtl \no \xff\nv 0 0 0 1 .5 .5 .5\nv 1. 0 +0\r\nv 1e0 1 0 # corner\nvn x y z\nvt\n\
            s off\nf 1/2/3 2//7 \\\n 3/\nf -3 -2 -1\nl 1 2 3\nl 1 2\np 1 2\nv 0 1 0\nf 1 2 3 4 # quad\ncstype bezier\n";
        let grid = read(text).unwrap();
        assert_eq!(grid.points, [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
        assert_eq!(grid.types, [TRIANGLE, TRIANGLE, POLY_LINE, LINE, VERTEX, VERTEX, QUAD]);
        assert_eq!(grid.connectivity, [0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 0, 1, 0, 1, 2, 3]);
        assert_eq!(read(b"v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3").unwrap().types, [TRIANGLE]);
    }

    #[test]
    fn what_makes_no_sense_is_named() {
        for (text, told) in [
            ("v 0 0", "line 1: a vertex has three"),
            ("\nv 0 x 0", "line 2: \"x\" is no coordinate"),
            ("v 0 0 0\nf 0 1 1", "\"0\" names no vertex"),
            ("v 0 0 0\nf -2 1 1", "\"-2\" names no vertex"),
            ("v 0 0 0\nf 1 1 2", "names vertex 2 of 1"),
            ("v 0 0 0\nsurf 0 1 0 1 1", "free-form"),
        ] {
            assert!(read(text.as_bytes()).unwrap_err().contains(told), "{text}");
        }
    }
}
