//! PLY, ascii and binary of either byte order.
//!
//! Of the element `vertex` the coordinates `x`, `y`, `z` are taken, of the element `face` the list `vertex_indices` (or
//! `vertex_index`), of the element `tristrips` its list, in which -1 ends a strip; in whatever number type. All else is
//! passed over without being understood: other properties may hold words that are no numbers, comments may be in any
//! encoding. A file takes no more memory than the points and polygons that its bytes can hold.

use crate::io::vtk::UnstructuredGrid;
use crate::io::vtk::cell::{POLYGON, QUAD, STRIP, TRIANGLE};
use crate::volume::Kind;

pub fn read(bytes: &[u8]) -> Result<UnstructuredGrid, String> {
    let (header, body) = Header::read(bytes)?;
    let mut body = Body { rest: body, format: header.format };
    let mut grid = UnstructuredGrid::default();
    let mut known = false;
    for element in &header.elements {
        // Each takes a byte at least, so a count beyond the length can't be true, and must not be believed.
        if element.count > body.rest.len() as u64 || element.properties.is_empty() && element.count > 0 {
            return Err(format!("is cut off, or damaged: it declares {} times \"{}\"", element.count, element.name));
        }
        match element.name.as_str() {
            "vertex" => {
                known = true;
                vertices(element, &mut body, &mut grid)?;
            }
            "face" => faces(element, &mut body, &mut grid)?,
            "tristrips" => strips(element, &mut body, &mut grid)?,
            _ => {
                for i in 0..element.count {
                    element.each(i, &mut body, |_, _| Ok(()))?;
                }
            }
        }
    }
    if !known {
        return Err("has no element \"vertex\"".into());
    }
    if !header.elements.iter().any(|e| e.name == "face" || e.name == "tristrips") {
        return Err(format!("has no element \"face\": it holds no triangle, only {} points", grid.points.len()));
    }
    Ok(grid)
}

fn vertices(element: &Element, body: &mut Body<'_>, grid: &mut UnstructuredGrid) -> Result<(), String> {
    let mut places = [0; 3];
    for (place, axis) in places.iter_mut().zip(["x", "y", "z"]) {
        let at = element.properties.iter().position(|p| p.name == axis && p.count.is_none());
        *place = at.ok_or_else(|| format!("vertex 0 has no coordinate \"{axis}\""))?;
    }
    for i in 0..element.count {
        let mut point = [0.0; 3];
        element.each(i, body, |property, item| {
            if let Some(axis) = places.iter().position(|&place| place == property) {
                point[axis] = item.number()?;
            }
            Ok(())
        })?;
        grid.points.push(point);
    }
    Ok(())
}

/// Which property lists an element's vertices.
fn list(element: &Element) -> Result<usize, String> {
    let is_list = |p: &Property| p.count.is_some() && ["vertex_indices", "vertex_index"].contains(&p.name.as_str());
    element.properties.iter().position(is_list).ok_or_else(|| {
        format!("{} 0 has no list \"vertex_indices\" of whole numbers from 0", element.name.trim_end_matches('s'))
    })
}

fn faces(element: &Element, body: &mut Body<'_>, grid: &mut UnstructuredGrid) -> Result<(), String> {
    if element.count == 0 {
        return Ok(());
    }
    let wanted = list(element)?;
    let mut polygon: Vec<u32> = Vec::new();
    for i in 0..element.count {
        polygon.clear();
        element.each(i, body, |property, item| {
            if property == wanted {
                let index = item.whole()?;
                polygon.push(u32::try_from(index).map_err(|_| {
                    format!("has no list \"vertex_indices\" of whole numbers from 0: {index} is in it")
                })?);
            }
            Ok(())
        })?;
        let kind = match polygon.len() {
            n @ 0..3 => return Err(format!("face {i} has {n} vertices; a polygon has 3 at least")),
            3 => TRIANGLE,
            4 => QUAD,
            _ => POLYGON,
        };
        grid.push(kind, &polygon);
    }
    Ok(())
}

fn strips(element: &Element, body: &mut Body<'_>, grid: &mut UnstructuredGrid) -> Result<(), String> {
    if element.count == 0 {
        return Ok(());
    }
    let wanted = list(element)?;
    for i in 0..element.count {
        let mut indices = Vec::new();
        element.each(i, body, |property, item| {
            if property == wanted {
                indices.push(item.whole()?);
            }
            Ok(())
        })?;
        for strip in indices.split(|&index| index == -1).filter(|strip| strip.len() > 2) {
            let strip: Result<Vec<u32>, _> = strip.iter().map(|&index| u32::try_from(index)).collect();
            grid.push(STRIP, &strip.map_err(|_| "has a strip with a vertex below 0")?);
        }
    }
    Ok(())
}

#[derive(Clone, Copy, PartialEq)]
enum Format {
    Ascii,
    Little,
    Big,
}

struct Property {
    name: String,
    kind: Kind,
    /// The type of the number in front of a list.
    count: Option<Kind>,
}

struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

impl Element {
    /// Hands out the numbers of one element, each with the place of its property.
    fn each(
        &self,
        i: u64,
        body: &mut Body<'_>,
        mut take: impl FnMut(usize, Item<'_>) -> Result<(), String>,
    ) -> Result<(), String> {
        let told = |e: String| format!("{} {i} {e}", self.name);
        for (place, property) in self.properties.iter().enumerate() {
            let length = match property.count {
                None => 1,
                Some(kind) => {
                    let length = body.item(kind)?.whole().map_err(told)?;
                    u64::try_from(length).map_err(|_| told(format!("has a list of length {length}")))?
                }
            };
            for _ in 0..length {
                take(place, body.item(property.kind)?).map_err(told)?;
            }
        }
        Ok(())
    }
}

/// A number where it stands.
struct Item<'a> {
    bytes: &'a [u8],
    kind: Kind,
    format: Format,
}

impl Item<'_> {
    fn number(&self) -> Result<f64, String> {
        if self.format != Format::Ascii {
            return Ok(self.decode());
        }
        let text = std::str::from_utf8(self.bytes).ok();
        // What is declared as single precision is meant so.
        let number = text.and_then(|text| match self.kind {
            Kind::F32 => text.parse::<f32>().map(f64::from).ok(),
            _ => text.parse::<f64>().ok(),
        });
        number.ok_or_else(|| {
            let shown: String = String::from_utf8_lossy(self.bytes).chars().take(40).collect();
            format!("has \"{shown}\" where a number should be")
        })
    }

    fn decode(&self) -> f64 {
        let mut bytes = [0; 8];
        let length = self.bytes.len().min(8);
        bytes[..length].copy_from_slice(&self.bytes[..length]);
        if self.format == Format::Big {
            bytes[..length].reverse();
        }
        let [a, b, c, d, ..] = bytes;
        match self.kind {
            Kind::I8 => f64::from(a as i8),
            Kind::U8 => f64::from(a),
            Kind::I16 => f64::from(i16::from_le_bytes([a, b])),
            Kind::U16 => f64::from(u16::from_le_bytes([a, b])),
            Kind::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Kind::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Kind::I64 => i64::from_le_bytes(bytes) as f64,
            Kind::U64 => u64::from_le_bytes(bytes) as f64,
            Kind::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Kind::F64 => f64::from_le_bytes(bytes),
        }
    }

    fn whole(&self) -> Result<i64, String> {
        let number = self.number()?;
        let whole = number.fract() == 0.0 && number.abs() < 9e15;
        if whole { Ok(number as i64) } else { Err(format!("has {number} where a whole number should be")) }
    }
}

/// What lies behind the header.
struct Body<'a> {
    rest: &'a [u8],
    format: Format,
}

impl<'a> Body<'a> {
    fn item(&mut self, kind: Kind) -> Result<Item<'a>, String> {
        let cut = || "is cut off: it ends within its elements".to_owned();
        let length = if self.format == Format::Ascii {
            self.rest = self.rest.trim_ascii_start();
            self.rest.iter().position(u8::is_ascii_whitespace).unwrap_or(self.rest.len())
        } else {
            kind.size()
        };
        let (bytes, rest) = self.rest.split_at_checked(length).filter(|_| length > 0).ok_or_else(cut)?;
        self.rest = rest;
        Ok(Item { bytes, kind, format: self.format })
    }
}

struct Header {
    format: Format,
    elements: Vec<Element>,
}

impl Header {
    /// The header, and what lies behind it.
    fn read(bytes: &[u8]) -> Result<(Self, &[u8]), String> {
        if !bytes.starts_with(b"ply") {
            return Err("is no PLY file: it does not begin with \"ply\"".into());
        }
        // Lines end as the first one does.
        let end: &[u8] = match bytes.get(3..) {
            Some([b'\r', b'\n', ..]) => b"\r\n",
            Some([b'\r', ..]) => b"\r",
            _ => b"\n",
        };
        let (mut format, mut elements) = (None, Vec::<Element>::new());
        let mut rest = bytes;
        loop {
            let length = rest.windows(end.len()).position(|b| b == end).ok_or("is cut off: its header has no end")?;
            let line = String::from_utf8_lossy(&rest[..length]).into_owned();
            rest = &rest[length + end.len()..];
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            let wrong = || format!("has a header with the line \"{}\"", line.chars().take(80).collect::<String>());
            match words.as_slice() {
                [] | ["ply" | "comment" | "obj_info", ..] => {}
                ["format", name, ..] => {
                    format = Some(match *name {
                        "ascii" => Format::Ascii,
                        "binary_little_endian" => Format::Little,
                        "binary_big_endian" => Format::Big,
                        _ => return Err(wrong()),
                    });
                }
                ["element", name, count] => {
                    let count = count.parse().map_err(|_| wrong())?;
                    elements.push(Element { name: (*name).to_owned(), count, properties: Vec::new() });
                }
                ["property", "list", count, kind, name] => {
                    let (count, kind) = (kind_of(count).ok_or_else(wrong)?, kind_of(kind).ok_or_else(wrong)?);
                    let property = Property { name: (*name).to_owned(), kind, count: Some(count) };
                    elements.last_mut().ok_or_else(wrong)?.properties.push(property);
                }
                ["property", kind, name] => {
                    let property =
                        Property { name: (*name).to_owned(), kind: kind_of(kind).ok_or_else(wrong)?, count: None };
                    elements.last_mut().ok_or_else(wrong)?.properties.push(property);
                }
                ["end_header"] => break,
                _ => return Err(wrong()),
            }
        }
        let format = format.ok_or("has a header without a format")?;
        Ok((Self { format, elements }, rest))
    }
}

fn kind_of(name: &str) -> Option<Kind> {
    Some(match name {
        "char" | "int8" => Kind::I8,
        "uchar" | "uint8" => Kind::U8,
        "short" | "int16" => Kind::I16,
        "ushort" | "uint16" => Kind::U16,
        "int" | "int32" => Kind::I32,
        "uint" | "uint32" => Kind::U32,
        "int64" | "longlong" => Kind::I64,
        "uint64" | "ulonglong" => Kind::U64,
        "float" | "float32" => Kind::F32,
        "double" | "float64" => Kind::F64,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_needed_is_not_understood() {
        let text = b"ply\r\nformat ascii 1.0\r\ncomment Ger\xe4t\r\nelement vertex 4\r\nproperty float quality\r\n\
            property double x\r\nproperty list uchar float weights\r\nproperty int y\r\nproperty float z\r\n\
            element edge 1\r\nproperty int a\r\nelement face 1\r\nproperty uchar flags\r\nproperty list uchar int vertex_index\r\n\
            element tristrips 1\r\nproperty list int int vertex_indices\r\nend_header\r\n\
            nan(ind) .5 2 x y 1 +1.\r\n1,5 1e0 0 2.0 0\r\n- 0 0 0 0\r\n. 0 0 0 1 -\r\n? 4 0 1 2 3\r\n8 0 1 2 -1 1 2 3 0\r\n";
        let grid = read(text).unwrap();
        assert_eq!(grid.points, [[0.5, 1.0, 1.0], [1.0, 2.0, 0.0], [0.0; 3], [0.0, 0.0, 1.0]]);
        assert_eq!(grid.types, [QUAD, STRIP, STRIP]);
        assert_eq!(grid.connectivity, [0, 1, 2, 3, 0, 1, 2, 1, 2, 3, 0]);
    }

    #[test]
    fn lists_that_lie_are_cut_off() {
        let mut bytes = b"ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty uchar x\nproperty uchar y\n\
            property uchar z\nelement face 1\nproperty list uint int vertex_indices\nend_header\n\0\0\0"
            .to_vec();
        bytes.extend([255, 255, 255, 255, 0, 0, 0, 0]);
        assert!(read(&bytes).unwrap_err().contains("is cut off"));
    }
}
