//! PLY, ascii and binary of either byte order, through `ply-rs-bw`.
//!
//! Takes `x`, `y`, `z` of the element `vertex` and the list `vertex_indices` (or `vertex_index`) of the element `face`,
//! in whatever number type; all else is passed over. Polygons are cut into fans. Indexed points stay as they are.

use std::io::Cursor;

use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{DefaultElement, Property};

use super::{Cells, FileMesh, fan};
use crate::geometry::Vector64;

pub fn read(bytes: &[u8]) -> Result<FileMesh, String> {
    if !bytes.starts_with(b"ply") {
        return Err("is no PLY file: it does not begin with \"ply\"".into());
    }
    let mut reader = Reader::new(Cursor::new(bytes));
    let parser = Parser::<DefaultElement>::new();
    let header = parser.read_header(&mut reader).map_err(|e| one_line(&e.to_string()))?;
    for (name, element) in &header.elements {
        // Each takes a byte at least, so a count beyond the length can't be true, and must not be believed.
        if element.count > bytes.len() || element.properties.is_empty() && element.count > 0 {
            return Err(format!("is cut off, or damaged: it declares {} times \"{name}\"", element.count));
        }
    }
    let payload = parser.read_payload(&mut reader, &header).map_err(|e| one_line(&e.to_string()))?;
    let element = |name: &str| payload.get(name).ok_or_else(|| format!("has no element \"{name}\""));

    let mut points = Vec::new();
    for (i, vertex) in element("vertex")?.iter().enumerate() {
        let coordinate = |axis: &str| {
            vertex.get(axis).and_then(scalar).ok_or_else(|| format!("vertex {i} has no coordinate \"{axis}\""))
        };
        points.push(Vector64::from([coordinate("x")?, coordinate("y")?, coordinate("z")?]));
    }
    let mut triangles = Vec::new();
    for (i, face) in element("face")?.iter().enumerate() {
        let polygon = face
            .get("vertex_indices")
            .or_else(|| face.get("vertex_index"))
            .and_then(indices)
            .ok_or_else(|| format!("face {i} has no list \"vertex_indices\" of whole numbers from 0"))?;
        if polygon.len() < 3 {
            return Err(format!("face {i} has {} vertices; a polygon has 3 at least", polygon.len()));
        }
        triangles.extend(fan(&polygon));
    }
    Ok(FileMesh { points, cells: Cells::Triangles(triangles), point_arrays: Vec::new() })
}

fn one_line(message: &str) -> String {
    message.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn scalar(property: &Property) -> Option<f64> {
    match *property {
        Property::Char(x) => Some(f64::from(x)),
        Property::UChar(x) => Some(f64::from(x)),
        Property::Short(x) => Some(f64::from(x)),
        Property::UShort(x) => Some(f64::from(x)),
        Property::Int(x) => Some(f64::from(x)),
        Property::UInt(x) => Some(f64::from(x)),
        Property::Float(x) => Some(f64::from(x)),
        Property::Double(x) => Some(x),
        _ => None,
    }
}

fn indices(property: &Property) -> Option<Vec<u32>> {
    fn all<T: Copy>(list: &[T]) -> Option<Vec<u32>>
    where
        u32: TryFrom<T>,
    {
        list.iter().map(|&i| u32::try_from(i).ok()).collect()
    }
    match property {
        Property::ListChar(list) => all(list),
        Property::ListUChar(list) => all(list),
        Property::ListShort(list) => all(list),
        Property::ListUShort(list) => all(list),
        Property::ListInt(list) => all(list),
        Property::ListUInt(list) => all(list),
        _ => None,
    }
}
