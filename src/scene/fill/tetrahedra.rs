//! Convex cells in tetrahedra. Each face is cut into triangles once, for both its cells; then a cell's triangles are joined to a
//! corner of it that is in none of the planes of the others, or where there is no such corner to a point in its middle.

use std::collections::HashMap;

use super::complex::Complex;
use super::exact::turn;
use crate::geometry::Vector64;

/// The tetrahedra of these cells, positively oriented, and their points.
pub fn tetrahedra(complex: &Complex, cells: &[u32], unit: i32) -> (Vec<Vector64<3>>, Vec<[u32; 4]>) {
    let mut points: Vec<Vector64<3>> = complex.points.iter().map(|point| point.rounded(unit)).collect();
    let mut cut: HashMap<u32, Vec<[u32; 3]>> = HashMap::new();
    let mut found = Vec::new();
    for &cell in cells {
        let faces = complex.faces_of(cell);
        // Triangles counterclockwise as seen from outside the cell.
        let mut skin: Vec<(u32, Vec<[u32; 3]>)> = Vec::with_capacity(faces.len());
        let mut corners: Vec<u32> = Vec::new();
        for (face, positive) in faces {
            let triangles = cut.entry(face).or_insert_with(|| triangles(complex, face));
            let turned = |&[a, b, c]: &[u32; 3]| if positive { [a, c, b] } else { [a, b, c] };
            skin.push((face, triangles.iter().map(turned).collect()));
            corners.extend(skin.last().iter().flat_map(|(_, triangles)| triangles.as_flattened()));
        }
        corners.sort_unstable();
        corners.dedup();
        let apart = |apex: u32| {
            skin.iter().all(|(face, triangles)| {
                triangles.iter().all(|triangle| triangle.contains(&apex))
                    || complex.planes[complex.plane_of(*face) as usize].side(&complex.points[apex as usize]) != 0
            })
        };
        let apex = corners.iter().copied().find(|&corner| apart(corner)).unwrap_or_else(|| {
            let sum = corners.iter().fold(Vector64::zeros(), |sum, &i| sum + points[i as usize]);
            points.push(sum / corners.len() as f64);
            points.len() as u32 - 1
        });
        let all = skin.iter().flat_map(|(_, triangles)| triangles);
        found.extend(all.filter(|triangle| !triangle.contains(&apex)).map(|&[a, b, c]| [apex, a, b, c]));
    }
    (points, found)
}

/// A face in triangles, counterclockwise as seen from its plane's positive side: corner by corner is cut off, such that
/// neither the triangle nor what is left is flat.
fn triangles(complex: &Complex, face: u32) -> Vec<[u32; 3]> {
    let mut rim = complex.corners_of(face);
    let axis = complex.planes[complex.plane_of(face) as usize].view().0;
    let bent = |a: u32, b: u32, c: u32| turn([a, b, c].map(|i| &complex.points[i as usize]), axis) != 0;
    let mut found = Vec::with_capacity(rim.len() - 2);
    while rim.len() > 3 {
        let count = rim.len();
        let around = |i: usize| (rim[(i + count - 1) % count], rim[i], rim[(i + 1) % count]);
        let ear = (0..count).find(|&i| {
            let (a, b, c) = around(i);
            let rest = (0..count).filter(|&j| j != i).map(|j| rim[j]);
            bent(a, b, c) && rest.into_iter().any(|other| other != a && other != c && bent(a, c, other))
        });
        let i = ear.unwrap_or(0);
        let (a, b, c) = around(i);
        found.push([a, b, c]);
        rim.remove(i);
    }
    found.push([rim[0], rim[1], rim[2]]);
    found
}
