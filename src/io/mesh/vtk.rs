//! VTK's legacy files, `.vtk`: an unstructured grid or polygons, as text or binary (big-endian), in the layouts of versions
//! 1 to 4 and of 5 (offsets and connectivity apart). Only points and cells are read.

use super::{Cells, FileMesh, fan};
use crate::geometry::Vector64;
use crate::volume::Kind;

pub fn read(bytes: &[u8]) -> Result<FileMesh, String> {
    let mut file = File { bytes, at: 0, binary: false };
    let version = file.line()?;
    let Some(version) = version.strip_prefix("# vtk DataFile Version ") else {
        return Err("is no .vtk file: it does not begin with \"# vtk DataFile Version\"".into());
    };
    let offsets_apart = version.trim().split('.').next().and_then(|n| n.parse::<u32>().ok()).is_some_and(|n| n >= 5);
    file.line()?;
    file.binary = match file.line()?.trim() {
        "ASCII" => false,
        "BINARY" => true,
        other => return Err(format!("is \"{other}\", neither ASCII nor BINARY")),
    };
    let (mut points, mut cells, mut polygons, mut types) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    while let Some(word) = file.word() {
        match word.to_ascii_uppercase().as_str() {
            "DATASET" => {
                let kind = file.needed()?;
                if !["UNSTRUCTURED_GRID", "POLYDATA"].contains(&kind.to_ascii_uppercase().as_str()) {
                    return Err(format!("holds {kind}; UNSTRUCTURED_GRID and POLYDATA are understood"));
                }
            }
            "POINTS" => {
                let count = file.whole()?;
                let kind = kind(&file.needed()?)?;
                points = file.numbers(count.checked_mul(3), kind)?;
            }
            "CELLS" => cells = file.cells(offsets_apart)?,
            "POLYGONS" => polygons = file.cells(offsets_apart)?,
            "VERTICES" | "LINES" | "TRIANGLE_STRIPS" => drop(file.cells(offsets_apart)?),
            "CELL_TYPES" => {
                let count = file.whole()?;
                types = file.numbers(Some(count), Kind::I32)?;
            }
            "METADATA" => {
                file.line()?;
                while !file.line()?.trim().is_empty() {}
            }
            // Points and cells come before them.
            "POINT_DATA" | "CELL_DATA" => break,
            other => return Err(format!("has \"{}\" where points or cells should be", brief(other))),
        }
    }
    if types.len() != cells.len() {
        return Err(format!("has {} cells and {} types of cells", cells.len(), types.len()));
    }
    let (mut triangles, mut tetrahedra) = (Vec::new(), Vec::new());
    for (cell, kind) in cells.iter().zip(&types) {
        match (*kind as i64, cell.as_slice()) {
            (10, &[a, b, c, d]) => tetrahedra.push([a, b, c, d]),
            (5 | 7 | 9, polygon) => triangles.extend(fan(polygon)),
            (0..=4, _) => {}
            (other, _) => return Err(format!("has a cell of type {other}, which is not understood")),
        }
    }
    polygons.iter().for_each(|polygon| triangles.extend(fan(polygon)));
    let points = points.chunks_exact(3).map(Vector64::from_column_slice).collect();
    // The triangles beside tetrahedra are their boundary.
    let cells = if tetrahedra.is_empty() { Cells::Triangles(triangles) } else { Cells::Tetrahedra(tetrahedra) };
    Ok(FileMesh { points, cells, point_arrays: Vec::new() })
}

fn kind(name: &str) -> Result<Kind, String> {
    Ok(match name.to_ascii_lowercase().as_str() {
        "char" => Kind::I8,
        "unsigned_char" => Kind::U8,
        "short" => Kind::I16,
        "unsigned_short" => Kind::U16,
        "int" => Kind::I32,
        "unsigned_int" => Kind::U32,
        "long" | "vtktypeint64" => Kind::I64,
        "unsigned_long" | "vtktypeuint64" => Kind::U64,
        "float" => Kind::F32,
        "double" => Kind::F64,
        other => return Err(format!("holds numbers of type \"{}\", which is not understood", brief(other))),
    })
}

fn brief(word: &str) -> String {
    word.chars().take(40).collect()
}

/// A file, read from the front.
struct File<'a> {
    bytes: &'a [u8],
    at: usize,
    binary: bool,
}

impl File<'_> {
    fn line(&mut self) -> Result<String, String> {
        let rest = self.bytes.get(self.at..).filter(|rest| !rest.is_empty()).ok_or("is cut off")?;
        let length = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
        self.at += length + 1;
        Ok(String::from_utf8_lossy(&rest[..length]).into_owned())
    }

    fn word(&mut self) -> Option<String> {
        let rest = self.bytes.get(self.at..)?;
        let start = rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let length = rest[start..].iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len() - start);
        self.at += start + length;
        Some(String::from_utf8_lossy(&rest[start..start + length]).into_owned())
    }

    fn needed(&mut self) -> Result<String, String> {
        self.word().ok_or_else(|| "is cut off".to_owned())
    }

    fn whole(&mut self) -> Result<usize, String> {
        let word = self.needed()?;
        word.parse().map_err(|_| format!("has \"{}\" where a whole number should be", brief(&word)))
    }

    /// So many numbers, from the next line on.
    fn numbers(&mut self, count: Option<usize>, kind: Kind) -> Result<Vec<f64>, String> {
        let left = self.bytes.len().saturating_sub(self.at);
        let size = if self.binary { kind.size() } else { 1 };
        let Some(needed) = count.and_then(|n| n.checked_mul(size)).filter(|&n| n <= left) else {
            return Err("is cut off: it declares more numbers than there are".into());
        };
        if !self.binary {
            let number = |_| {
                let word = self.needed()?;
                word.parse().map_err(|_| format!("has \"{}\" where a number should be", brief(&word)))
            };
            return (0..needed).map(number).collect();
        }
        self.line()?;
        let bytes = self.bytes.get(self.at..).and_then(|rest| rest.get(..needed)).ok_or("is cut off")?;
        self.at += needed;
        Ok(kind.decode(bytes, false).to_f64())
    }

    /// Lists of points.
    fn cells(&mut self, offsets_apart: bool) -> Result<Vec<Vec<u32>>, String> {
        let (count, size) = (self.whole()?, self.whole()?);
        let index = |x: &f64| {
            let fits = *x >= 0.0 && *x < f64::from(u32::MAX) && x.fract() == 0.0;
            if fits { Ok(*x as u32) } else { Err(format!("has {x} where a point's number should be")) }
        };
        if !offsets_apart {
            let numbers = self.numbers(Some(size), Kind::I32)?;
            let mut rest = numbers.iter().map(index).collect::<Result<Vec<u32>, _>>()?.into_iter();
            let mut cells = Vec::new();
            while let Some(length) = rest.next() {
                let cell: Vec<u32> = rest.by_ref().take(length as usize).collect();
                if cell.len() < length as usize {
                    return Err("has a last cell that is not whole".into());
                }
                cells.push(cell);
            }
            if cells.len() != count {
                return Err(format!("declares {count} cells and has {}", cells.len()));
            }
            return Ok(cells);
        }
        let mut list = |name: &str, count: usize| {
            let word = self.needed()?;
            if !word.eq_ignore_ascii_case(name) {
                return Err(format!("has \"{}\" where {name} should be", brief(&word)));
            }
            let kind = kind(&self.needed()?)?;
            self.numbers(Some(count), kind)?.iter().map(index).collect::<Result<Vec<u32>, String>>()
        };
        let (offsets, points) = (list("OFFSETS", count)?, list("CONNECTIVITY", size)?);
        let cell = |pair: &[u32]| points.get(pair[0] as usize..pair[1] as usize).map(<[u32]>::to_vec);
        offsets.windows(2).map(cell).collect::<Option<_>>().ok_or_else(|| "has offsets that make no sense".to_owned())
    }
}
