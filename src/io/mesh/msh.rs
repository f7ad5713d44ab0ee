//! Gmsh's `.msh`, versions 2.2 and 4.1, as text or binary in either byte order: the nodes, and the elements over them.
//!
//! Gmsh writes the boundary's triangles, lines and points beside a solid; all are cells here. Nodes have tags, which need not
//! be in order nor without gaps. The crate `mshio` reads 4.1 only, and drops the tags of blocks that it takes for consecutive.

use std::collections::HashMap;

use crate::io::vtk::UnstructuredGrid;
use crate::io::vtk::cell::{HEXAHEDRON, LINE, PYRAMID, QUAD, TETRAHEDRON, TRIANGLE, VERTEX, WEDGE};

pub fn read(bytes: &[u8]) -> Result<UnstructuredGrid, String> {
    let mut file = File { bytes, at: 0, form: Form::Text };
    file.seek("MeshFormat").map_err(|_| "is no .msh file: it has no $MeshFormat")?;
    let version = file.word()?.to_owned();
    let binary = file.word()? == "1";
    let size = file.word()?.to_owned();
    let old = match version.as_str() {
        "2.2" | "2.1" | "2" | "2.0" => true,
        "4.1" => false,
        other => {
            let remedy = "gmsh -save -format msh41 converts it";
            return Err(format!("is of version {other}; 2.2 and 4.1 are understood, and {remedy}"));
        }
    };
    if binary {
        if size != "8" {
            return Err(format!("is binary with numbers of {size} bytes; 8 are understood"));
        }
        file.skip_line();
        file.form = match file.take::<4>()? {
            [1, 0, 0, 0] => Form::Binary { little: true },
            [0, 0, 0, 1] => Form::Binary { little: false },
            _ => return Err("is damaged: its byte order can't be told".into()),
        };
    }
    let mut mesh = Mesh::default();
    if old {
        mesh.version_2(&mut file)?
    } else {
        mesh.version_4(&mut file)?
    }
    Ok(mesh.grid)
}

/// How numbers are kept.
#[derive(Clone, Copy, PartialEq)]
enum Form {
    Text,
    Binary { little: bool },
}

/// A file, read from the front.
struct File<'a> {
    bytes: &'a [u8],
    at: usize,
    form: Form,
}

impl<'a> File<'a> {
    /// Goes behind the line that opens a section.
    fn seek(&mut self, section: &str) -> Result<(), String> {
        let name = format!("${section}");
        let mut from = self.at;
        while let Some(found) = self.bytes[from..].iter().position(|&b| b == b'$') {
            let start = from + found;
            let begins = start == 0 || self.bytes[start - 1].is_ascii_whitespace();
            let rest = &self.bytes[start..];
            if begins && rest.starts_with(name.as_bytes()) && rest.get(name.len()).is_some_and(u8::is_ascii_whitespace)
            {
                self.at = start + name.len();
                self.skip_line();
                return Ok(());
            }
            from = start + 1;
        }
        Err(format!("is cut off: it has no ${section}"))
    }

    fn skip_line(&mut self) {
        let rest = &self.bytes[self.at..];
        self.at += rest.iter().position(|&b| b == b'\n').map_or(rest.len(), |n| n + 1);
    }

    fn word(&mut self) -> Result<&'a str, String> {
        let rest = &self.bytes[self.at..];
        let start = rest.iter().position(|b| !b.is_ascii_whitespace()).ok_or("is cut off")?;
        let length = rest[start..].iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len() - start);
        self.at += start + length;
        std::str::from_utf8(&rest[start..start + length]).map_err(|_| "has bytes that are no text".into())
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let bytes = self.bytes.get(self.at..).and_then(|rest| rest.first_chunk::<N>()).ok_or("is cut off")?;
        self.at += N;
        Ok(*bytes)
    }

    /// A number of one line of text, in either form.
    fn line_number(&mut self) -> Result<u64, String> {
        let number = self.text_whole()?;
        if self.form != Form::Text {
            self.skip_line();
        }
        Ok(number)
    }

    fn text_whole(&mut self) -> Result<u64, String> {
        let word = self.word()?;
        word.parse().map_err(|_| format!("has \"{}\" where a whole number should be", brief(word)))
    }

    /// Gmsh's `int`. Entities may have tags below 0, which nothing here needs.
    fn int(&mut self) -> Result<u64, String> {
        let Form::Binary { little } = self.form else {
            let word = self.word()?;
            let number: i64 =
                word.parse().map_err(|_| format!("has \"{}\" where a whole number should be", brief(word)))?;
            return Ok(number.unsigned_abs());
        };
        let bytes = self.take::<4>()?;
        let number = if little { i32::from_le_bytes(bytes) } else { i32::from_be_bytes(bytes) };
        Ok(u64::from(number.unsigned_abs()))
    }

    /// Gmsh's `size_t`.
    fn size(&mut self) -> Result<u64, String> {
        let Form::Binary { little } = self.form else { return self.text_whole() };
        let bytes = self.take::<8>()?;
        Ok(if little { u64::from_le_bytes(bytes) } else { u64::from_be_bytes(bytes) })
    }

    fn double(&mut self) -> Result<f64, String> {
        let Form::Binary { little } = self.form else {
            let word = self.word()?;
            return word.parse().map_err(|_| format!("has \"{}\" where a coordinate should be", brief(word)));
        };
        let bytes = self.take::<8>()?;
        Ok(if little { f64::from_le_bytes(bytes) } else { f64::from_be_bytes(bytes) })
    }

    fn point(&mut self) -> Result<[f64; 3], String> {
        Ok([self.double()?, self.double()?, self.double()?])
    }
}

fn brief(word: &str) -> String {
    word.chars().take(40).collect()
}

#[derive(Default)]
struct Mesh {
    grid: UnstructuredGrid,
    /// From tags to points.
    places: HashMap<u64, u32>,
}

impl Mesh {
    fn node(&mut self, tag: u64, point: [f64; 3]) {
        self.places.insert(tag, self.grid.points.len() as u32);
        self.grid.points.push(point);
    }

    /// An element whose nodes come next.
    fn element(&mut self, kind: u64, tags: impl Iterator<Item = Result<u64, String>>) -> Result<(), String> {
        let mut points = Vec::new();
        for tag in tags {
            let tag = tag?;
            let place = self.places.get(&tag).copied();
            points.push(place.ok_or_else(|| format!("has an element with node {tag}, which is not there"))?);
        }
        self.grid.push(vtk_kind(kind)?.0, &points);
        Ok(())
    }

    fn version_2(&mut self, file: &mut File<'_>) -> Result<(), String> {
        file.seek("Nodes")?;
        for _ in 0..file.line_number()? {
            let tag = file.int()?;
            let point = file.point()?;
            self.node(tag, point);
        }
        file.seek("Elements")?;
        let count = file.line_number()?;
        let mut read = 0;
        while read < count {
            // As text each element says what it is; in binary files a head says it of all that follow.
            let (kind, following, tags) = if file.form == Form::Text {
                let _tag = file.int()?;
                (file.int()?, 1, file.int()?)
            } else {
                (file.int()?, file.int()?, file.int()?)
            };
            let nodes = vtk_kind(kind)?.1;
            if following == 0 {
                return Err("is damaged: it has a block of no elements".into());
            }
            for _ in 0..following {
                let skipped = tags + u64::from(file.form != Form::Text);
                for _ in 0..skipped {
                    file.int()?;
                }
                self.element(kind, (0..nodes).map(|_| file.int()))?;
            }
            read += following;
        }
        Ok(())
    }

    fn version_4(&mut self, file: &mut File<'_>) -> Result<(), String> {
        file.seek("Nodes")?;
        let [blocks, _, _, _] = [file.size()?, file.size()?, file.size()?, file.size()?];
        for _ in 0..blocks {
            let (dimension, _entity, parametric, count) = (file.int()?, file.int()?, file.int()?, file.size()?);
            let mut tags = Vec::new();
            for _ in 0..count {
                tags.push(file.size()?);
            }
            for tag in tags {
                let point = file.point()?;
                for _ in 0..if parametric == 0 { 0 } else { dimension } {
                    file.double()?;
                }
                self.node(tag, point);
            }
        }
        file.seek("Elements")?;
        let [blocks, _, _, _] = [file.size()?, file.size()?, file.size()?, file.size()?];
        for _ in 0..blocks {
            let (_dimension, _entity, kind, count) = (file.int()?, file.int()?, file.int()?, file.size()?);
            let nodes = vtk_kind(kind)?.1;
            for _ in 0..count {
                let _tag = file.size()?;
                self.element(kind, (0..nodes).map(|_| file.size()))?;
            }
        }
        Ok(())
    }
}

/// VTK's number for an element of Gmsh's kind, and how many nodes that has. Those of higher order are named, and so refused
/// with their name where they count.
fn vtk_kind(kind: u64) -> Result<(u8, u64), String> {
    Ok(match kind {
        15 => (VERTEX, 1),
        1 => (LINE, 2),
        2 => (TRIANGLE, 3),
        3 => (QUAD, 4),
        4 => (TETRAHEDRON, 4),
        5 => (HEXAHEDRON, 8),
        6 => (WEDGE, 6),
        7 => (PYRAMID, 5),
        8 => (21, 3),
        9 => (22, 6),
        10 => (28, 9),
        11 => (24, 10),
        12 => (29, 27),
        13 => (32, 18),
        14 => (37, 14),
        16 => (23, 8),
        17 => (25, 20),
        18 => (26, 15),
        19 => (27, 13),
        20 => (69, 9),
        21 => (69, 10),
        26 => (68, 4),
        27 => (68, 5),
        28 => (68, 6),
        other => return Err(format!("holds elements of Gmsh's kind {other}, which are not understood")),
    })
}
