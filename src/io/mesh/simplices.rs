//! From cells of any kind to simplices: polygons into triangles, solid cells into tetrahedra.
//!
//! Where a mesh holds cells of several dimensions, those of the highest count: meshers add the boundary's triangles to a
//! solid. Of that dimension every cell is taken in, or the mesh is refused.
//!
//! A solid cell is coned from that of its points with the lowest index, over the faces that it doesn't lie on; each of these
//! is divided from its own lowest point. So every face is divided from its lowest point, whichever cell it is seen from, and
//! neighbours agree (Dompierre, Labbé, Vallet and Camarero 1999).

use super::polygon;
use super::{ARRAYS, Cells, FileMesh, GHOSTS, PointArray};
use crate::io::vtk::UnstructuredGrid;
use crate::io::vtk::cell::{self, POLYGON, QUAD, STRIP, TETRAHEDRON, TRIANGLE, cell_name, dimension};
use crate::volume::Array;

/// A cell that belongs to another piece, in `vtkGhostType`.
const DUPLICATE: i128 = 1;
/// A cell that isn't to be seen.
const HIDDEN: i128 = 32;

/// The mesh's simplices.
///
/// # Errors
/// If a cell that counts is of a kind that can't be divided.
pub fn simplices(grid: &UnstructuredGrid) -> Result<FileMesh, String> {
    let own = without_ghosts(grid);
    let grid = own.as_ref().unwrap_or(grid);
    let highest = grid.types.iter().map(|&kind| dimension(kind)).max().unwrap_or(0);
    let cells = match highest {
        3 => Cells::Tetrahedra(tetrahedra(grid)?),
        2 => Cells::Triangles(triangles(grid)?),
        _ if grid.types.is_empty() => return Err(format!("holds no triangle, only {} points", grid.points.len())),
        _ => return Err(format!("holds no triangle, only {} vertices and lines", grid.types.len())),
    };
    let mut notes = Vec::new();
    let lines = grid.types.iter().filter(|&&kind| dimension(kind) == 1).count();
    if lines > 0 {
        notes.push(format!("{lines} lines in it have no surface, and are left out"));
    }
    let points = grid.points.iter().map(|&point| point.into()).collect();
    let point_arrays = (grid.point_arrays.iter().filter(|array| ARRAYS.contains(&array.name.as_str())))
        .map(|a| PointArray { values: a.values.to_f64(), name: a.name.clone(), components: a.components })
        .collect();
    Ok(FileMesh { points, cells, point_arrays, notes })
}

/// The mesh without the cells that stand for those of a neighbouring piece, or are to be hidden; none if all of them count.
fn without_ghosts(grid: &UnstructuredGrid) -> Option<UnstructuredGrid> {
    // Of the older array every level but 0 is a copy; of the newer one two bits count.
    let ghost = |array: &Array, i: usize| match array.name.as_str() {
        "vtkGhostType" => array.values.integer(i).is_some_and(|bits| bits & (DUPLICATE | HIDDEN) != 0),
        name => GHOSTS.contains(&name) && array.values.get(i) != 0.0,
    };
    let marks: Vec<&Array> = grid.cell_arrays.iter().filter(|a| a.values.len() == grid.types.len()).collect();
    let ghosts: Vec<bool> = (0..grid.types.len()).map(|i| marks.iter().any(|array| ghost(array, i))).collect();
    if !ghosts.contains(&true) {
        return None;
    }
    let mut own = UnstructuredGrid {
        points: grid.points.clone(),
        point_arrays: grid.point_arrays.clone(),
        ..UnstructuredGrid::default()
    };
    grid.cells().zip(ghosts).filter(|(_, ghost)| !ghost).for_each(|((kind, points), _)| own.push(kind, points));
    Some(own)
}

fn triangles(grid: &UnstructuredGrid) -> Result<Vec<[u32; 3]>, String> {
    let mut triangles = Vec::with_capacity(grid.types.len());
    for (i, (kind, points)) in grid.cells().enumerate().filter(|(_, (kind, _))| dimension(*kind) == 2) {
        match kind {
            TRIANGLE => triangles.push(exactly(i, kind, points)?),
            STRIP => triangles.extend(strip(points)),
            POLYGON | QUAD | cell::PIXEL => {
                triangles.extend(polygon::triangles(&cell::around(kind, points), &grid.points));
            }
            _ => return Err(refused(i, kind)),
        }
    }
    Ok(triangles)
}

/// Every second triangle of a strip is turned.
fn strip(points: &[u32]) -> impl Iterator<Item = [u32; 3]> {
    points.windows(3).enumerate().map(|(i, t)| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] })
}

fn tetrahedra(grid: &UnstructuredGrid) -> Result<Vec<[u32; 4]>, String> {
    let mut tetrahedra = Vec::with_capacity(grid.types.len());
    for (i, (kind, points)) in grid.cells().enumerate().filter(|(_, (kind, _))| dimension(*kind) == 3) {
        if kind == TETRAHEDRON {
            tetrahedra.push(exactly(i, kind, points)?);
            continue;
        }
        let faces = cell::faces(kind);
        if faces.is_empty() {
            return Err(refused(i, kind));
        }
        if cell::points_of(kind) != Some(points.len()) {
            return Err(format!("cell {i} is a {} of {} points", cell_name(kind), points.len()));
        }
        divide(faces, points, &mut tetrahedra);
    }
    Ok(tetrahedra)
}

/// Cones a cell from its lowest point. Faces that have shrunk to an edge, as in hexahedra that serve as wedges, vanish.
fn divide(faces: &[&[usize]], points: &[u32], tetrahedra: &mut Vec<[u32; 4]>) {
    let Some(&apex) = points.iter().min() else { return };
    for face in faces {
        let mut corners: Vec<u32> = face.iter().map(|&i| points[i]).collect();
        corners.dedup();
        while corners.len() > 1 && corners.first() == corners.last() {
            corners.pop();
        }
        if corners.len() < 3 || corners.contains(&apex) {
            continue;
        }
        let lowest = (0..corners.len()).min_by_key(|&i| corners[i]).unwrap_or(0);
        corners.rotate_left(lowest);
        tetrahedra.extend(corners.windows(2).skip(1).map(|edge| [apex, corners[0], edge[0], edge[1]]));
    }
}

fn exactly<const N: usize>(i: usize, kind: u8, points: &[u32]) -> Result<[u32; N], String> {
    points.try_into().map_err(|_| format!("cell {i} is a {} of {} points", cell_name(kind), points.len()))
}

fn refused(i: usize, kind: u8) -> String {
    let (name, tool) = (cell_name(kind), if dimension(kind) == 2 { "Triangulate" } else { "Tetrahedralize" });
    format!(
        "cell {i} is a {name}, which is not understood; ParaView's {tool} divides it, and a mesher's order 1 avoids it"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Vector64, determinant};
    use crate::io::vtk::cell::{HEXAGONAL_PRISM, HEXAHEDRON, PENTAGONAL_PRISM, PYRAMID, VOXEL, WEDGE};
    use crate::mesh::topology::facet_pairs;

    fn volume(points: &[Vector64<3>], tetrahedra: &[[u32; 4]]) -> f64 {
        let volume = |t: &[u32; 4]| {
            let [a, b, c, d] = t.map(|i| points[i as usize]);
            determinant(&[b - a, c - a, d - a]).abs() / 6.0
        };
        tetrahedra.iter().map(volume).sum()
    }

    fn read(points: &[[f64; 3]], cells: &[(u8, &[u32])]) -> (Vec<Vector64<3>>, Vec<[u32; 4]>) {
        let mut grid = UnstructuredGrid { points: points.to_vec(), ..Default::default() };
        cells.iter().for_each(|(kind, points)| grid.push(*kind, points));
        let mesh = simplices(&grid).unwrap();
        let Cells::Tetrahedra(tetrahedra) = mesh.cells else { panic!("no solid") };
        (mesh.points, tetrahedra)
    }

    #[test]
    fn each_kind_keeps_its_volume() {
        let prism = |n: usize| -> Vec<[f64; 3]> {
            let angle = |i: usize| std::f64::consts::TAU * i as f64 / n as f64;
            (0..2 * n).map(|i| [angle(i % n).cos(), angle(i % n).sin(), (i / n) as f64]).collect()
        };
        let area = |n: f64| n / 2.0 * (std::f64::consts::TAU / n).sin();
        let pyramid = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let voxel: Vec<[f64; 3]> = (0..8).map(|i| [i % 2, i / 2 % 2, i / 4].map(f64::from)).collect();
        for (kind, points, right, pieces) in [
            (WEDGE, prism(3), area(3.0), 3),
            (HEXAHEDRON, prism(4), area(4.0), 6),
            (PENTAGONAL_PRISM, prism(5), area(5.0), 9),
            (HEXAGONAL_PRISM, prism(6), area(6.0), 12),
            (PYRAMID, pyramid.to_vec(), 1.0 / 3.0, 2),
            (VOXEL, voxel, 1.0, 6),
        ] {
            // Every place of the lowest index.
            for shift in 0..points.len() {
                let n = points.len();
                let cell: Vec<u32> = (0..n).map(|i| ((i + shift) % n) as u32).collect();
                let mut placed = points.clone();
                placed.rotate_right(shift);
                let (points, tetrahedra) = read(&placed, &[(kind, &cell)]);
                let found = volume(&points, &tetrahedra);
                assert!((found - right).abs() < 1e-12, "{kind} {shift}: {found}, not {right}");
                assert_eq!(tetrahedra.len(), pieces, "{kind} {shift}");
            }
        }
    }

    #[test]
    fn neighbours_divide_a_face_alike() {
        // 3 x 3 x 3 hexahedra with points numbered crosswise; a pyramid and wedges would meet their faces alike.
        let place = |i: u32| [i % 4, i / 4 % 4, i / 16].map(f64::from);
        let shuffled: Vec<u32> = (0..64).map(|i| i * 37 % 64).collect();
        let mut points = vec![[0.0; 3]; 64];
        (0..64).for_each(|i| points[shuffled[i as usize] as usize] = place(i));
        let mut cells = Vec::new();
        for (x, y, z) in (0..27).map(|i| (i % 3, i / 3 % 3, i / 9)) {
            let corner = |a: u32, b: u32, c: u32| shuffled[(x + a + 4 * (y + b) + 16 * (z + c)) as usize];
            cells.push([(0, 0), (1, 0), (1, 1), (0, 1)].map(|(a, b)| corner(a, b, 0)).to_vec());
            let upper = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(a, b)| corner(a, b, 1));
            cells.last_mut().unwrap().extend(upper);
        }
        let cells: Vec<(u8, &[u32])> = cells.iter().map(|c| (HEXAHEDRON, c.as_slice())).collect();
        let (points, mut tetrahedra) = read(&points, &cells);
        assert!((volume(&points, &tetrahedra) - 27.0).abs() < 1e-12);
        for t in &mut tetrahedra {
            let [a, b, c, d] = t.map(|i| points[i as usize]);
            if determinant(&[b - a, c - a, d - a]) < 0.0 {
                t.swap(2, 3);
            }
        }
        // The border of 9 squares a side, two triangles each, and nothing open or crowded within.
        let pairs = facet_pairs(&tetrahedra);
        assert_eq!((pairs.open, pairs.crowded, pairs.misoriented), (6 * 9 * 2, 0, 0));
    }

    #[test]
    fn cells_of_a_neighbouring_piece_do_not_count() {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0; 3]];
        let mut grid = UnstructuredGrid { points: points.to_vec(), ..Default::default() };
        [[0, 1, 2, 3], [1, 2, 3, 4], [0, 1, 2, 4]].iter().for_each(|cell| grid.push(TETRAHEDRON, cell));
        let kept = |name: &str, marks: [u8; 3]| {
            let marked = UnstructuredGrid { cell_arrays: vec![Array::new(name, 1, marks.to_vec())], ..grid.clone() };
            let Cells::Tetrahedra(tetrahedra) = simplices(&marked).unwrap().cells else { panic!("no solid") };
            tetrahedra.len()
        };
        // Copies and hidden cells; 2 marks a cell that others refine, in grids that can't be read here.
        assert_eq!((kept("vtkGhostType", [0, 1, 32]), kept("vtkGhostType", [0, 2, 33])), (1, 2));
        assert_eq!((kept("vtkGhostLevels", [0, 1, 2]), kept("levels", [0, 1, 2])), (1, 3));
    }

    #[test]
    fn a_hexahedron_that_serves_as_a_wedge() {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
        let (points, tetrahedra) = read(&points, &[(HEXAHEDRON, &[0, 1, 2, 2, 3, 4, 5, 5])]);
        assert!((volume(&points, &tetrahedra) - 0.5).abs() < 1e-15, "{tetrahedra:?}");
    }
}
