//! The kinds of cells that VTK knows, by number: their names, dimensions, and the order of their points.
//!
//! VTK's pixels and voxels list their points row by row, quads and hexahedra go round; [`around`] and [`faces`] hide that.

/// VTK's number for a single point.
pub const VERTEX: u8 = 1;
/// VTK's number for several points.
pub const POLY_VERTEX: u8 = 2;
/// VTK's number for a line of two points.
pub const LINE: u8 = 3;
/// VTK's number for a line of any number of points.
pub const POLY_LINE: u8 = 4;
/// VTK's number for a triangle.
pub const TRIANGLE: u8 = 5;
/// VTK's number for a strip of triangles.
pub const STRIP: u8 = 6;
/// VTK's number for a polygon.
pub const POLYGON: u8 = 7;
/// VTK's number for an axis-parallel rectangle.
pub const PIXEL: u8 = 8;
/// VTK's number for a quadrilateral.
pub const QUAD: u8 = 9;
/// VTK's number for a tetrahedron.
pub const TETRAHEDRON: u8 = 10;
/// VTK's number for an axis-parallel box.
pub const VOXEL: u8 = 11;
/// VTK's number for a hexahedron.
pub const HEXAHEDRON: u8 = 12;
/// VTK's number for a wedge.
pub const WEDGE: u8 = 13;
/// VTK's number for a pyramid.
pub const PYRAMID: u8 = 14;
/// VTK's number for a prism over a pentagon.
pub const PENTAGONAL_PRISM: u8 = 15;
/// VTK's number for a prism over a hexagon.
pub const HEXAGONAL_PRISM: u8 = 16;
/// VTK's number for a polyhedron, whose faces lie in further arrays.
pub const POLYHEDRON: u8 = 42;

/// What VTK calls cells of this kind; the number for those that are rare.
pub fn cell_name(kind: u8) -> String {
    let names = [
        "empty cell",
        "vertex",
        "poly-vertex",
        "line",
        "poly-line",
        "triangle",
        "triangle strip",
        "polygon",
        "pixel",
        "quad",
        "tetrahedron",
        "voxel",
        "hexahedron",
        "wedge",
        "pyramid",
        "pentagonal prism",
        "hexagonal prism",
    ];
    let curved = |name: &str| format!("curved {name} (VTK type {kind})");
    match kind {
        21 | 35 | 68 | 75 => curved("line"),
        22 | 34 | 69 | 76 => curved("triangle"),
        23 | 28 | 30 | 70 | 77 => curved("quad"),
        24 | 71 | 78 => curved("tetrahedron"),
        25 | 29 | 33 | 72 | 79 => curved("hexahedron"),
        26 | 31 | 32 | 73 | 80 => curved("wedge"),
        27 | 37 | 74 | 81 => curved("pyramid"),
        POLYHEDRON => "polyhedron".to_owned(),
        _ => names.get(usize::from(kind)).map_or_else(|| format!("VTK type {kind}"), |&name| name.to_owned()),
    }
}

/// How many dimensions cells of this kind have; three for all that is not known to have fewer.
pub fn dimension(kind: u8) -> usize {
    match kind {
        0..=2 => 0,                          // nothing, one vertex, several
        3 | 4 | 21 | 35 | 68 | 75 => 1,      // lines, straight and curved
        5..=9 | 22 | 23 | 28 | 30 | 34 => 2, // triangles, strips, polygons, pixels, quadrilaterals, and curved ones
        36 | 69 | 70 | 76 | 77 => 2,         // curved polygons, Lagrange, Bezier
        _ => 3,
    }
}

/// How many points each cell of this kind has; none for those that may have any number.
pub fn points_of(kind: u8) -> Option<usize> {
    Some(match kind {
        VERTEX => 1,
        LINE => 2,
        TRIANGLE => 3,
        PIXEL | QUAD | TETRAHEDRON => 4,
        VOXEL | HEXAHEDRON => 8,
        WEDGE => 6,
        PYRAMID => 5,
        PENTAGONAL_PRISM => 10,
        HEXAGONAL_PRISM => 12,
        _ => return None,
    })
}

/// The points of a flat cell in the order in which they go round it.
pub fn around(kind: u8, points: &[u32]) -> Vec<u32> {
    match (kind, points) {
        (PIXEL, &[a, b, c, d]) => vec![a, b, d, c],
        _ => points.to_vec(),
    }
}

/// The faces of a solid cell with straight edges, as places in its list of points; none if it is of another kind.
pub fn faces(kind: u8) -> &'static [&'static [usize]] {
    match kind {
        TETRAHEDRON => &[&[0, 1, 2], &[0, 1, 3], &[0, 2, 3], &[1, 2, 3]],
        VOXEL => &[&[0, 1, 3, 2], &[4, 5, 7, 6], &[0, 1, 5, 4], &[2, 3, 7, 6], &[0, 2, 6, 4], &[1, 3, 7, 5]],
        HEXAHEDRON => &[&[0, 1, 2, 3], &[4, 5, 6, 7], &[0, 1, 5, 4], &[1, 2, 6, 5], &[2, 3, 7, 6], &[3, 0, 4, 7]],
        WEDGE => &[&[0, 1, 2], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]],
        PYRAMID => &[&[0, 1, 2, 3], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]],
        PENTAGONAL_PRISM => &[
            &[0, 1, 2, 3, 4],
            &[5, 6, 7, 8, 9],
            &[0, 1, 6, 5],
            &[1, 2, 7, 6],
            &[2, 3, 8, 7],
            &[3, 4, 9, 8],
            &[4, 0, 5, 9],
        ],
        HEXAGONAL_PRISM => &[
            &[0, 1, 2, 3, 4, 5],
            &[6, 7, 8, 9, 10, 11],
            &[0, 1, 7, 6],
            &[1, 2, 8, 7],
            &[2, 3, 9, 8],
            &[3, 4, 10, 9],
            &[4, 5, 11, 10],
            &[5, 0, 6, 11],
        ],
        _ => &[],
    }
}

/// The kind of a cell of PolyData, by the element that it stands in and how many points it has.
pub fn flat_kind(element: &str, points: usize) -> u8 {
    match (element, points) {
        ("Verts", 1) => VERTEX,
        ("Verts", _) => POLY_VERTEX,
        ("Lines", 2) => LINE,
        ("Lines", _) => POLY_LINE,
        ("Polys", 3) => TRIANGLE,
        ("Polys", 4) => QUAD,
        ("Polys", _) => POLYGON,
        _ => STRIP,
    }
}
