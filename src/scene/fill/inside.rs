//! Which cells are inside: from the box's border inwards, over the faces between cells. A face that lies on a triangle of the
//! surface has the outside on the side that the triangle faces. Where that contradicts what is known from elsewhere, the
//! surface passes through itself.

use std::collections::HashMap;

use super::complex::Complex;
use super::exact::{Plane, Point, turn};

/// The triangles of one plane, by their corners.
pub struct Flush {
    /// Corners, and whether the triangle faces the plane's positive side.
    pub triangles: Vec<([u32; 3], bool)>,
}

/// The cells inside the surface, given the corners of its triangles and which triangles lie in each plane.
pub fn inside(
    complex: &Complex,
    corners: &[Point],
    flush: &HashMap<Plane, Flush>,
    unit: i32,
) -> Result<Vec<u32>, String> {
    // Both sides of every face: the cell on the plane's negative and on its positive side.
    let mut beside: HashMap<u32, [Option<u32>; 2]> = HashMap::new();
    let faces: Vec<Vec<(u32, bool)>> = (0..complex.len() as u32).map(|cell| complex.faces_of(cell)).collect();
    for (cell, faces) in faces.iter().enumerate() {
        for &(face, positive) in faces {
            beside.entry(face).or_default()[usize::from(positive)] = Some(cell as u32);
        }
    }
    let mut is_inside: Vec<Option<bool>> = vec![None; complex.len()];
    let mut open: Vec<u32> = Vec::new();
    for (cell, faces) in faces.iter().enumerate() {
        if faces.iter().any(|(face, _)| beside[face].contains(&None)) {
            is_inside[cell] = Some(false);
            open.push(cell as u32);
        }
    }
    while let Some(cell) = open.pop() {
        let Some(here) = is_inside[cell as usize] else { continue };
        for &(face, positive) in &faces[cell as usize] {
            let Some(other) = beside[&face][usize::from(!positive)] else { continue };
            let there = match facing(complex, face, corners, flush)? {
                None => here,
                // Outside is where the triangle faces.
                Some(up) if (up == positive) == here => return Err(crossed(complex, face, unit)),
                Some(_) => !here,
            };
            match is_inside[other as usize] {
                Some(known) if known != there => return Err(crossed(complex, face, unit)),
                Some(_) => {}
                None => {
                    is_inside[other as usize] = Some(there);
                    open.push(other);
                }
            }
        }
    }
    Ok((0..complex.len() as u32).filter(|&cell| is_inside[cell as usize] == Some(true)).collect())
}

fn crossed(complex: &Complex, face: u32, unit: i32) -> String {
    let [x, y, z] = complex.points[complex.corners_of(face)[0] as usize].rounded(unit).into();
    format!(
        "passes through itself, or some of its triangles face the wrong way, near ({x:.6}, {y:.6}, {z:.6}); repair it, \
         or write caps: false for walls only"
    )
}

/// Whether a face lies on a triangle, and if so whether that faces the positive side of the face's plane.
fn facing(
    complex: &Complex,
    face: u32,
    corners: &[Point],
    flush: &HashMap<Plane, Flush>,
) -> Result<Option<bool>, String> {
    let (plane, turned) = complex.planes[complex.plane_of(face) as usize].clone().upwards();
    let Some(Flush { triangles }) = flush.get(&plane) else { return Ok(None) };
    let axis = plane.view().0;
    let rim = complex.corners_of(face);
    let at = |i: usize| &complex.points[rim[i] as usize];
    let bent = (1..rim.len() - 1).find(|&i| turn([at(0), at(i), at(i + 1)], axis) != 0).unwrap_or(1);
    let middle = Point::middle([at(0), at(bent), at(bent + 1)]);
    let covers = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|i| &corners[i as usize]);
        let turns = [turn([a, b, &middle], axis), turn([b, c, &middle], axis), turn([c, a, &middle], axis)];
        turns.iter().all(|&t| t > 0) || turns.iter().all(|&t| t < 0)
    };
    let mut covering = triangles.iter().filter(|(triangle, _)| covers(triangle));
    match (covering.next(), covering.next()) {
        (None, _) => Ok(None),
        (Some((_, up)), None) => Ok(Some(*up != turned)),
        _ => Err("has triangles that lie on each other; repair it, or write caps: false for walls only".to_owned()),
    }
}
