//! `<UnstructuredGrid>` and `<PolyData>`: points and cells of any kind over them.

use roxmltree::Node;

use super::Field;
use super::Problem;
use super::cell::{self, POLYHEDRON, TETRAHEDRON, TRIANGLE};
use super::data_array::{array, attributes, field_data};
use super::document::{Document, child, required};
use super::pieces;
use crate::volume::{Array, Values};

/// Points, and cells that are lists of points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct UnstructuredGrid {
    /// Where the points are.
    pub points: Vec<[f64; 3]>,
    /// The point indices of all cells, cell after cell.
    pub connectivity: Vec<u32>,
    /// Where each cell ends in `connectivity`; it begins where the one before ends.
    pub offsets: Vec<usize>,
    /// VTK's number for each cell's kind.
    pub types: Vec<u8>,
    /// Arrays with a tuple a point.
    pub point_arrays: Vec<Array>,
    /// Arrays with a tuple a cell.
    pub cell_arrays: Vec<Array>,
    /// What belongs to the mesh as a whole.
    pub field_data: Vec<Field>,
}

impl UnstructuredGrid {
    /// The kind and the points of each cell.
    pub fn cells(&self) -> impl Iterator<Item = (u8, &[u32])> {
        let starts = std::iter::once(0).chain(self.offsets.iter().copied());
        let ranges = starts.zip(&self.offsets).map(|(start, &end)| &self.connectivity[start..end]);
        self.types.iter().copied().zip(ranges)
    }

    /// Appends a cell of this kind over these points.
    pub fn push(&mut self, kind: u8, points: &[u32]) {
        self.connectivity.extend_from_slice(points);
        self.offsets.push(self.connectivity.len());
        self.types.push(kind);
    }

    /// The point array of this name.
    pub fn point_array(&self, name: &str) -> Option<&Array> {
        self.point_arrays.iter().find(|a| a.name == name)
    }

    /// All cells as simplices of `N` points: triangles for 3, tetrahedra for 4.
    ///
    /// # Errors
    /// If there is a cell of another kind.
    pub fn simplices<const N: usize>(&self) -> Result<Vec<[u32; N]>, Problem> {
        let (wanted, remedy) = match N {
            3 => (TRIANGLE, "turn all cells into triangles (in ParaView: Extract Surface, Triangulate)"),
            _ => (TETRAHEDRON, "turn all cells into tetrahedra (in ParaView: Tetrahedralize)"),
        };
        let simplex = |(i, (kind, points)): (usize, (u8, &[u32]))| {
            let simplex = points.try_into().ok().filter(|_| kind == wanted);
            simplex.ok_or_else(|| Problem::Unsupported {
                what: format!(
                    "cell {i}, of VTK type {kind} with {} points where type {wanted} is needed,",
                    points.len()
                ),
                remedy,
            })
        };
        self.cells().enumerate().map(simplex).collect()
    }

    /// Checks that cells refer to points that exist, each kind by as many as it has.
    pub(super) fn validate(&self) -> Result<(), Problem> {
        let damaged = |array: &str, cause: String| Problem::Damaged { array: array.into(), cause };
        let mut before = 0;
        for (i, &end) in self.offsets.iter().enumerate() {
            if end < before || end > self.connectivity.len() {
                return Err(damaged("offsets", format!("cell {i} ends at {end}, of {}", self.connectivity.len())));
            }
            before = end;
        }
        if before != self.connectivity.len() {
            let cause = format!("the cells end at {before}, `connectivity` at {}", self.connectivity.len());
            return Err(damaged("offsets", cause));
        }
        if let Some(p) = self.connectivity.iter().find(|&&p| p as usize >= self.points.len()) {
            return Err(damaged("connectivity", format!("point {p} of {} does not exist", self.points.len())));
        }
        if self.types.len() != self.offsets.len() {
            return Err(damaged("types", format!("{} kinds for {} cells", self.types.len(), self.offsets.len())));
        }
        if self.types.contains(&POLYHEDRON) {
            return Err(Problem::Unsupported {
                what: "a mesh with polyhedra".into(),
                remedy: "turn them into tetrahedra (in ParaView: Tetrahedralize)",
            });
        }
        Ok(())
    }
}

/// The mesh in a file.
pub(super) fn read(document: &Document<'_>) -> Result<UnstructuredGrid, Problem> {
    let pieces = document.pieces().map(|piece| read_piece(document, piece)).collect::<Result<_, _>>()?;
    let mut grid = joined(pieces)?;
    grid.field_data = field_data(document)?;
    Ok(grid)
}

/// One mesh of several, which follow each other; points on their seams stay two.
pub(super) fn joined(given: Vec<UnstructuredGrid>) -> Result<UnstructuredGrid, Problem> {
    let mut parts: Vec<_> = given.into_iter().filter(|p| !p.points.is_empty() || !p.types.is_empty()).collect();
    if parts.len() < 2 {
        return Ok(parts.pop().unwrap_or_default());
    }
    let points: usize = parts.iter().map(|piece| piece.points.len()).sum();
    if u32::try_from(points).is_err() {
        return Err(Problem::Pieces { problem: format!("have {points} points together, more than can be numbered") });
    }
    let first = &parts[0];
    for piece in &parts {
        pieces::alike(&first.point_arrays, &piece.point_arrays)?;
        pieces::alike(&first.cell_arrays, &piece.cell_arrays)?;
    }
    let mut whole = UnstructuredGrid {
        point_arrays: concatenated(&parts, |piece| &piece.point_arrays),
        cell_arrays: concatenated(&parts, |piece| &piece.cell_arrays),
        field_data: first.field_data.clone(),
        ..Default::default()
    };
    for piece in parts {
        let (shift, base) = (whole.points.len() as u32, whole.connectivity.len());
        whole.points.extend(piece.points);
        whole.connectivity.extend(piece.connectivity.iter().map(|&p| p.saturating_add(shift)));
        whole.offsets.extend(piece.offsets.iter().map(|&end| end.saturating_add(base)));
        whole.types.extend(piece.types);
    }
    Ok(whole)
}

/// Arrays of pieces that are known to be alike, one behind the other.
fn concatenated(pieces: &[UnstructuredGrid], arrays: impl Fn(&UnstructuredGrid) -> &Vec<Array>) -> Vec<Array> {
    let first = pieces.first().map(&arrays);
    let mut joined = Vec::new();
    for (k, array) in first.into_iter().flatten().enumerate() {
        let total = pieces.iter().map(|piece| arrays(piece)[k].values.len()).sum();
        let mut values = array.values.kind().zeros(total);
        let mut at = 0;
        for piece in pieces {
            let from = &arrays(piece)[k].values;
            let placed = values.place(at, from, 0, from.len());
            debug_assert!(placed, "pieces are alike, and there is room for all of them");
            at += from.len();
        }
        joined.push(Array { values, ..array.clone_head() });
    }
    joined
}

/// One piece of it.
fn read_piece(document: &Document<'_>, piece: Node<'_, '_>) -> Result<UnstructuredGrid, Problem> {
    let mut grid = UnstructuredGrid::default();
    let points = count(piece, "NumberOfPoints")?;
    let nodes = child(piece, "Points")?.children().find(Node::is_element);
    match nodes {
        Some(node) => grid.points = positions(&array(document, node, Some(points))?)?,
        None if points == 0 => {}
        None => return Err(Problem::Missing { element: "Points".into(), lacks: "`<DataArray>`".into() }),
    }
    let mut cells = 0u64;
    if document.kind == "UnstructuredGrid" {
        cells = count(piece, "NumberOfCells")?;
        let node = child(piece, "Cells")?;
        push_cells(document, node, cells, &mut grid)?;
        if cells > 0 {
            let types = array(document, named(node, "types")?, Some(cells))?;
            grid.types = indices(&types, "types", u8::MAX.into())?.into_iter().map(|n| n as u8).collect();
        }
    } else {
        // In the order in which VTK numbers the cells.
        for (element, number) in [
            ("Verts", "NumberOfVerts"),
            ("Lines", "NumberOfLines"),
            ("Polys", "NumberOfPolys"),
            ("Strips", "NumberOfStrips"),
        ] {
            let n = if piece.has_attribute(number) { count(piece, number)? } else { 0 };
            if n == 0 {
                continue;
            }
            let before = grid.offsets.len();
            push_cells(document, child(piece, element)?, n, &mut grid)?;
            for i in before..grid.offsets.len() {
                let start = if i == 0 { 0 } else { grid.offsets[i - 1] };
                grid.types.push(cell::flat_kind(element, grid.offsets[i].saturating_sub(start)));
            }
            cells += n;
        }
    }
    grid.point_arrays = attributes(document, piece, "PointData", points)?;
    grid.cell_arrays = attributes(document, piece, "CellData", cells)?;
    grid.validate()?;
    Ok(grid)
}

/// Appends the cells of one element to the grid.
fn push_cells(
    document: &Document<'_>,
    node: Node<'_, '_>,
    cells: u64,
    grid: &mut UnstructuredGrid,
) -> Result<(), Problem> {
    if cells == 0 {
        return Ok(());
    }
    let offsets = indices(&array(document, named(node, "offsets")?, Some(cells))?, "offsets", usize::MAX as u64)?;
    let connectivity = array(document, named(node, "connectivity")?, offsets.last().copied())?;
    let base = grid.connectivity.len();
    let connectivity = indices(&connectivity, "connectivity", u32::MAX.into())?;
    grid.connectivity.extend(connectivity.into_iter().map(|p| p as u32));
    grid.offsets.extend(offsets.into_iter().map(|n| (n as usize).saturating_add(base)));
    Ok(())
}

fn named<'a>(node: Node<'a, 'a>, name: &str) -> Result<Node<'a, 'a>, Problem> {
    node.children()
        .find(|n| n.attribute("Name") == Some(name))
        .ok_or_else(|| Problem::Missing { element: node.tag_name().name().into(), lacks: format!("array `{name}`") })
}

fn count(piece: Node<'_, '_>, attribute: &'static str) -> Result<u64, Problem> {
    let text = required(piece, attribute)?;
    // Above 2^48 no file can hold the points, and sums of such counts stay clear of overflow.
    text.trim().parse().ok().filter(|&n: &u64| n < 1 << 48).ok_or_else(|| Problem::Attribute {
        element: "Piece".into(),
        attribute,
        value: text.into(),
        expected: "a whole number",
    })
}

/// Triples of coordinates.
pub(super) fn positions(array: &Array) -> Result<Vec<[f64; 3]>, Problem> {
    if array.components != 3 {
        let cause = format!("points have {} coordinates instead of 3", array.components);
        return Err(Problem::Damaged { array: array.name.clone(), cause });
    }
    let points = array.values.len() / 3;
    Ok((0..points).map(|i| std::array::from_fn(|a| array.values.get(3 * i + a))).collect())
}

/// Whole numbers from 0 to `most`.
fn indices(array: &Array, name: &str, most: u64) -> Result<Vec<u64>, Problem> {
    let wrong = |i: usize| Problem::Damaged {
        array: name.into(),
        cause: format!(
            "number {i} is {}, and should be whole, not negative and at most {most}",
            array.values.format(i)
        ),
    };
    match &array.values {
        // The usual kinds without a detour through wider ones.
        Values::U8(v) => Ok(v.iter().map(|&n| n.into()).collect()),
        Values::I64(v) => {
            let check = |(i, &n): (usize, &i64)| u64::try_from(n).ok().filter(|&n| n <= most).ok_or_else(|| wrong(i));
            v.iter().enumerate().map(check).collect()
        }
        values => (0..values.len())
            .map(|i| {
                values.integer(i).and_then(|n| u64::try_from(n).ok()).filter(|&n| n <= most).ok_or_else(|| wrong(i))
            })
            .collect(),
    }
}
