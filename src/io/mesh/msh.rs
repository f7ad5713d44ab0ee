//! Gmsh's `.msh`, versions 2.2 and 4.1, as text: the nodes, and the triangles or tetrahedra over them.
//!
//! Gmsh writes the boundary's triangles, lines and points beside a solid's tetrahedra; the highest dimension counts. Nodes
//! have tags, which need not be in order nor without gaps. The crate `mshio` reads 4.1 only and drops the tags of blocks
//! that it takes for consecutive; binary files are refused with the way to save them as text.

use std::collections::HashMap;

use super::{Cells, FileMesh};
use crate::geometry::Vector64;

/// Gmsh's numbers for the simplices with straight edges.
const TRIANGLE: u64 = 2;
const TETRAHEDRON: u64 = 4;

/// Gmsh's other elements, as far as they would be of the dimension of a surface or a solid.
const OTHER_SURFACES: [u64; 6] = [3, 9, 10, 16, 20, 21];
const OTHER_SOLIDS: [u64; 10] = [5, 6, 7, 11, 12, 13, 14, 17, 18, 19];

pub fn read(bytes: &[u8]) -> Result<FileMesh, String> {
    let text = String::from_utf8_lossy(bytes);
    let mut words = Words(text.split_ascii_whitespace());
    words.seek("$MeshFormat").map_err(|_| "is no .msh file: it has no $MeshFormat")?;
    let version: String = words.next()?.to_owned();
    if words.next()? != "0" {
        return Err("is binary; save it as text (in Gmsh: Save As, Version 4 ASCII)".into());
    }
    let mut mesh = Reading::default();
    match version.as_str() {
        "2.2" | "2.1" | "2" | "2.0" => mesh.version_2(&mut words)?,
        "4.1" => mesh.version_4(&mut words)?,
        other => return Err(format!("is of version {other}; 2.2 and 4.1 are understood")),
    }
    mesh.finish()
}

struct Words<'a>(std::str::SplitAsciiWhitespace<'a>);

impl<'a> Words<'a> {
    fn next(&mut self) -> Result<&'a str, String> {
        self.0.next().ok_or_else(|| "is cut off".to_owned())
    }

    fn seek(&mut self, section: &str) -> Result<(), String> {
        self.0.find(|word| *word == section).map(drop).ok_or_else(|| format!("is cut off: it has no {section}"))
    }

    fn whole(&mut self) -> Result<u64, String> {
        let word = self.next()?;
        word.parse().map_err(|_| format!("has \"{word}\" where a whole number should be"))
    }

    fn skip(&mut self, count: u64) -> Result<(), String> {
        (0..count).try_for_each(|_| self.next().map(drop))
    }

    fn point(&mut self) -> Result<Vector64<3>, String> {
        let mut number = || {
            let word = self.next()?;
            word.parse::<f64>().map_err(|_| format!("has \"{word}\" where a coordinate should be"))
        };
        Ok(Vector64::from([number()?, number()?, number()?]))
    }
}

#[derive(Default)]
struct Reading {
    points: Vec<Vector64<3>>,
    /// From tags to points.
    places: HashMap<u64, u32>,
    triangles: Vec<[u32; 3]>,
    tetrahedra: Vec<[u32; 4]>,
    other_surfaces: u64,
    other_solids: u64,
}

impl Reading {
    fn node(&mut self, tag: u64, point: Vector64<3>) {
        self.places.insert(tag, self.points.len() as u32);
        self.points.push(point);
    }

    /// An element whose nodes come next; `false` if this kind's number of nodes is not known here.
    fn element(&mut self, kind: u64, words: &mut Words<'_>) -> Result<bool, String> {
        let mut node = || {
            let tag = words.whole()?;
            self.places.get(&tag).copied().ok_or_else(|| format!("has an element with node {tag}, which is not there"))
        };
        match kind {
            TRIANGLE => self.triangles.push([node()?, node()?, node()?]),
            TETRAHEDRON => self.tetrahedra.push([node()?, node()?, node()?, node()?]),
            _ => {
                self.other_surfaces += u64::from(OTHER_SURFACES.contains(&kind));
                self.other_solids += u64::from(OTHER_SOLIDS.contains(&kind));
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn version_2(&mut self, words: &mut Words<'_>) -> Result<(), String> {
        words.seek("$Nodes")?;
        for _ in 0..words.whole()? {
            let tag = words.whole()?;
            let point = words.point()?;
            self.node(tag, point);
        }
        words.seek("$Elements")?;
        for _ in 0..words.whole()? {
            let (_tag, kind, tags) = (words.whole()?, words.whole()?, words.whole()?);
            words.skip(tags)?;
            if !self.element(kind, words)? {
                words.skip(nodes_of(kind)?)?;
            }
        }
        Ok(())
    }

    fn version_4(&mut self, words: &mut Words<'_>) -> Result<(), String> {
        words.seek("$Nodes")?;
        let blocks = words.whole()?;
        words.skip(3)?;
        for _ in 0..blocks {
            let (dimension, _entity, parametric, count) =
                (words.whole()?, words.next()?, words.whole()?, words.whole()?);
            let mut tags = Vec::new();
            for _ in 0..count {
                tags.push(words.whole()?);
            }
            for tag in tags {
                let point = words.point()?;
                words.skip(if parametric == 0 { 0 } else { dimension })?;
                self.node(tag, point);
            }
        }
        words.seek("$Elements")?;
        let blocks = words.whole()?;
        words.skip(3)?;
        for _ in 0..blocks {
            let (_dimension, _entity, kind, count) = (words.whole()?, words.next()?, words.whole()?, words.whole()?);
            for _ in 0..count {
                words.skip(1)?;
                if !self.element(kind, words)? {
                    words.skip(nodes_of(kind)?)?;
                }
            }
        }
        Ok(())
    }

    fn finish(self) -> Result<FileMesh, String> {
        let (solids, surfaces) = (self.other_solids, self.other_surfaces);
        let cells = if solids > 0 {
            return Err(format!(
                "holds {solids} solid elements that are no tetrahedra; mesh it with tetrahedra of order 1"
            ));
        } else if !self.tetrahedra.is_empty() {
            Cells::Tetrahedra(self.tetrahedra)
        } else if surfaces > 0 {
            return Err(format!("holds {surfaces} faces that are no triangles; mesh it with triangles of order 1"));
        } else {
            Cells::Triangles(self.triangles)
        };
        Ok(FileMesh { points: self.points, cells, point_arrays: Vec::new() })
    }
}

/// The nodes of an element, by Gmsh's number for its kind.
fn nodes_of(kind: u64) -> Result<u64, String> {
    Ok(match kind {
        15 => 1,
        1 => 2,
        8 => 3,
        3 | 26 => 4,
        7 | 27 => 5,
        6 | 9 | 28 => 6,
        5 | 16 => 8,
        10 | 20 => 9,
        11 | 21 => 10,
        14 => 14,
        13 => 18,
        12 => 27,
        17 => 20,
        18 => 15,
        19 => 13,
        other => return Err(format!("holds elements of Gmsh's kind {other}, which are not understood")),
    })
}
