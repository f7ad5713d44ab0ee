//! Triangles enter the complex, each only where it lies: a tree of splits leads it to the cells that it passes through, which
//! are split by its plane (a binary space partition; Fuchs, Kedem and Naylor 1980).
//!
//! Afterwards no triangle has points within a cell, so every cell is wholly inside the surface or wholly outside.

use super::complex::{Complex, Node};
use super::exact::{Plane, Point};

/// The most cells that are made before it is given up.
const MOST_CELLS: usize = 400_000;

/// Splits every cell that this convex polygon in the plane passes through.
pub fn insert(complex: &mut Complex, polygon: Vec<Point>, plane: &Plane) -> Result<(), String> {
    let mut number = None;
    let mut open = vec![(0u32, polygon)];
    while let Some((node, polygon)) = open.pop() {
        match complex.nodes[node as usize] {
            Node::Cell(_) => {
                let plane = *number.get_or_insert_with(|| complex.add_plane(plane.clone()));
                complex.split(node, plane);
                if complex.len() > MOST_CELLS {
                    return Err(format!("is too intricate to be filled: it takes more than {MOST_CELLS} pieces"));
                }
            }
            Node::Split { plane, sides: [negative, positive] } => {
                let plane = &complex.planes[plane as usize];
                let signs: Vec<i32> = polygon.iter().map(|point| plane.side(point)).collect();
                if signs.iter().all(|&s| s == 0) {
                    continue; // it lies between cells already
                }
                if signs.iter().all(|&s| s >= 0) {
                    open.push((positive, polygon));
                } else if signs.iter().all(|&s| s <= 0) {
                    open.push((negative, polygon));
                } else {
                    let [below, above] = clip(polygon, &signs, plane);
                    open.push((negative, below));
                    open.push((positive, above));
                }
            }
        }
    }
    Ok(())
}

/// The parts of a convex polygon on the negative and the positive side of a plane that crosses it.
fn clip(polygon: Vec<Point>, signs: &[i32], plane: &Plane) -> [Vec<Point>; 2] {
    let mut parts: [Vec<Point>; 2] = Default::default();
    for (i, point) in polygon.iter().enumerate() {
        let j = (i + 1) % polygon.len();
        if signs[i] == 0 {
            parts.iter_mut().for_each(|part| part.push(point.clone()));
        } else {
            parts[usize::from(signs[i] > 0)].push(point.clone());
        }
        if signs[i] * signs[j] < 0 {
            let crossing = Point::between(point, &polygon[j], plane);
            parts.iter_mut().for_each(|part| part.push(crossing.clone()));
        }
    }
    parts
}
