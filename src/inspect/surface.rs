//! What kind of thing the simplices of a mesh make up: the questions that decide whether it can be traced well.
//!
//! Triangles are a surface in R^3. Tetrahedra with a `position` of four components at each point are one in R^4, as
//! this program writes them; without it they are a solid in R^3, such as `extrude` takes, and the triangles around it
//! are its boundary. Points with identical coordinates, in the `f32` that a scene rounds to, count as one, since to a
//! scene they are; how many there are in excess is told, because other programs may mind.

use std::fmt;

use serde::Serialize;

use super::range::Short;
use crate::geometry::{Vector64, is_degenerate, narrow};
use crate::io::mesh::{Cells, FileMesh, PointArray, simplices};
use crate::io::vtk::UnstructuredGrid;
use crate::mesh::crossings;
use crate::mesh::identity::identities;
use crate::mesh::topology::{
    components, corners, enclosed_volume, f_vector, facet_pairs, singular_vertices, surface_measure, worst_quality,
};

/// Beyond this coordinates are refused by scenes.
const LARGEST: f64 = 1e30;

/// The most triangles that are looked at to see whether they pass through each other.
const MOST_CROSSED: usize = 100_000;

/// What the simplices make up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Form {
    /// Triangles.
    #[serde(rename = "surface in 3D")]
    SurfaceIn3d,
    /// Tetrahedra whose points have four coordinates.
    #[serde(rename = "surface in 4D")]
    SurfaceIn4d,
    /// Tetrahedra whose points have three.
    #[serde(rename = "solid in 3D")]
    SolidIn3d,
}

/// How a simplicial mesh hangs together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SurfaceSummary {
    /// What it is.
    pub form: Form,
    /// Vertices, edges, triangles and perhaps tetrahedra, identical points counted once.
    pub f_vector: Vec<usize>,
    /// The alternating sum of those: 2 for a sphere in 3D, 0 for every closed manifold in 4D.
    pub euler_characteristic: i64,
    /// Pieces connected through facets.
    pub components: usize,
    /// Whether it has no rim. Always false for a solid, whose rim is its boundary.
    pub closed: bool,
    /// Whether neighbouring simplices agree on which side is outside.
    pub oriented: bool,
    /// Whether no facet has more than two simplices, and no vertex is one where the surface touches itself.
    pub manifold: bool,
    /// Whether no two points have the same coordinates.
    pub welded: bool,
    /// Facets of a single simplex: the rim, or a solid's boundary.
    pub open_facets: usize,
    /// Facets whose two simplices disagree.
    pub misoriented_facets: usize,
    /// Facets of more than two simplices.
    pub crowded_facets: usize,
    /// Vertices where the surface touches itself: around them it is no ball, nor at a rim half of one.
    pub singular_vertices: usize,
    /// Points whose coordinates an earlier point has.
    pub duplicate_points: usize,
    /// Points that no simplex uses.
    pub unused_points: usize,
    /// Simplices of measure zero, which nothing can hit.
    pub degenerate_simplices: usize,
    /// Area of a surface in 3D, 3-volume of one in 4D and of a solid.
    pub measure: f64,
    /// What a closed, oriented surface encloses; negative if its normals point inwards.
    pub enclosed_volume: Option<f64>,
    /// Where a closed surface in 3D passes through itself, in words; null also for those of more than 100,000 triangles, which nobody
    /// looks at.
    pub crossing: Option<String>,
    /// The worst simplex's shape: 1 if regular, 0 if flat.
    pub worst_quality: Option<f64>,
    /// Which one that is.
    pub worst_simplex: Option<usize>,
}

impl SurfaceSummary {
    /// Of a mesh, divided into simplices as a scene would, in the space that its points are in; nothing for one that can't
    /// be divided, and none where coordinates are missing, not finite or beyond what a scene takes.
    pub fn of(mesh: &UnstructuredGrid) -> Option<Self> {
        let mesh = simplices(mesh).ok()?;
        match &mesh.cells {
            Cells::Triangles(triangles) => {
                let points = positions::<3>(&mesh).unwrap_or_else(|| mesh.points.clone());
                Self::new(Form::SurfaceIn3d, &points, triangles)
            }
            Cells::Tetrahedra(tetrahedra) => match positions::<4>(&mesh) {
                Some(points) => Self::new(Form::SurfaceIn4d, &points, tetrahedra),
                None => {
                    let flat = |p: &Vector64<3>| Vector64::from([p[0], p[1], p[2], 0.0]);
                    Self::new(Form::SolidIn3d, &mesh.points.iter().map(flat).collect::<Vec<_>>(), tetrahedra)
                }
            },
        }
    }

    /// Bytes of memory that it takes to find out, about: lists of all faces of all simplices are sorted.
    pub fn memory(mesh: &UnstructuredGrid) -> u64 {
        let (points, corners) = (mesh.points.len() as u64, mesh.connectivity.len() as u64);
        points.saturating_mul(80).saturating_add(corners.saturating_mul(80))
    }

    fn new<const D: usize>(form: Form, points: &[Vector64<D>], simplices: &[[u32; D]]) -> Option<Self> {
        let out_of_range = simplices.as_flattened().iter().any(|&v| v as usize >= points.len());
        if out_of_range || points.iter().flatten().any(|x| x.is_nan() || x.abs() > LARGEST) {
            return None;
        }
        let rounded: Vec<_> = points.iter().map(narrow).collect();
        let identity = identities(&rounded);
        let welded: Vec<[u32; D]> = simplices.iter().map(|s| s.map(|v| identity[v as usize])).collect();
        let mut unused = vec![true; points.len()];
        simplices.as_flattened().iter().for_each(|&v| unused[v as usize] = false);
        let pairs = facet_pairs(&welded);
        let f_vector = f_vector(&welded);
        let singular = singular_vertices(&welded);
        let worst = worst_quality(corners(points, simplices));
        let closed = pairs.open == 0 && pairs.unbalanced == pairs.misoriented;
        Some(Self {
            form,
            euler_characteristic: f_vector.iter().rev().fold(0, |sum, &n| n as i64 - sum),
            f_vector,
            components: components(&welded),
            // What doesn't cancel may only be neighbours that disagree.
            closed,
            oriented: pairs.misoriented == 0,
            manifold: pairs.crowded == 0 && singular == 0,
            welded: identity.iter().enumerate().all(|(i, &v)| i == v as usize),
            open_facets: pairs.open,
            misoriented_facets: pairs.misoriented,
            crowded_facets: pairs.crowded,
            singular_vertices: singular,
            duplicate_points: identity.iter().enumerate().filter(|&(i, &v)| i != v as usize).count(),
            unused_points: unused.iter().filter(|&&u| u).count(),
            degenerate_simplices: (simplices.iter()).filter(|s| is_degenerate(&s.map(|v| rounded[v as usize]))).count(),
            measure: surface_measure(corners(points, simplices)),
            enclosed_volume: pairs.is_closed().then(|| enclosed_volume(corners(points, simplices))),
            crossing: if closed { crossings::told_if_few(points, &welded, MOST_CROSSED) } else { None },
            worst_quality: worst.map(|(_, quality)| quality),
            worst_simplex: worst.map(|(simplex, _)| simplex),
        })
    }
}

/// The points' coordinates from the array `position`, if there is one of D components.
fn positions<const D: usize>(mesh: &FileMesh) -> Option<Vec<Vector64<D>>> {
    let fits = |a: &&PointArray| a.name == "position" && a.components == D && a.values.len() == D * mesh.points.len();
    let array = mesh.point_arrays.iter().find(fits)?;
    Some(array.values.chunks_exact(D).map(Vector64::from_column_slice).collect())
}

impl fmt::Display for SurfaceSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let solid = self.form == Form::SolidIn3d;
        let (space, facet) = if self.form == Form::SurfaceIn3d { (3, "edge") } else { (4, "triangle") };
        let many = |count: usize, what: &str| format!("{count} {what}{}", if count == 1 { "" } else { "s" });
        if solid {
            writeln!(f, "a solid in 3D: {}", many(self.components, "piece"))?;
            writeln!(f, "  bounded by {}", many(self.open_facets, facet))?;
        } else {
            let closed = if self.closed { "closed" } else { "open" };
            writeln!(f, "a surface in {space}D: {closed}, {}", many(self.components, "piece"))?;
            if self.open_facets > 0 {
                writeln!(f, "  rim of {}", many(self.open_facets, facet))?;
            }
        }
        match (self.oriented, self.misoriented_facets) {
            (true, _) => writeln!(f, "  oriented")?,
            (false, n) => writeln!(f, "  not oriented: neighbours disagree at {}", many(n, facet))?,
        }
        match (self.crowded_facets, self.singular_vertices) {
            (0, 0) => writeln!(f, "  manifold")?,
            (0, 1) => writeln!(f, "  not manifold: it touches itself at 1 vertex")?,
            (0, n) => writeln!(f, "  not manifold: it touches itself at {n} vertices")?,
            (n, _) => writeln!(f, "  not manifold: {} with more than two neighbours", many(n, facet))?,
        }
        if let Some(crossing) = &self.crossing {
            writeln!(f, "  {crossing}")?;
        }
        match self.duplicate_points {
            0 => writeln!(f, "  welded")?,
            n => writeln!(f, "  not welded: {} in the place of an earlier one", many(n, "point"))?,
        }
        for (count, what) in
            [(self.unused_points, "point unused"), (self.degenerate_simplices, "simplex of measure zero")]
        {
            if count > 0 {
                let (noun, rest) = what.split_once(' ').unwrap_or((what, ""));
                let noun = if count == 1 { noun } else { ["points", "simplices"][usize::from(noun != "point")] };
                writeln!(f, "  {count} {noun} {rest}")?;
            }
        }
        let counts = self.f_vector.iter().zip(["vertices", "edges", "triangles", "tetrahedra"]);
        let counts: Vec<String> = counts.map(|(n, what)| format!("{n} {what}")).collect();
        writeln!(f, "  {}; Euler characteristic {}", counts.join(", "), self.euler_characteristic)?;
        let what = if self.form == Form::SurfaceIn3d { "area" } else { "3-volume" };
        write!(f, "  {} {}", if solid { "volume" } else { what }, Short(self.measure))?;
        if let Some(volume) = self.enclosed_volume {
            let inwards = if volume < 0.0 { " (normals point inwards)" } else { "" };
            write!(f, ", encloses a {space}-volume of {}{inwards}", Short(volume.abs()))?;
        }
        if let (Some(quality), Some(simplex)) = (self.worst_quality, self.worst_simplex) {
            write!(f, "; worst shape {} (cell {simplex})", Short(quality))?;
        }
        writeln!(f)
    }
}
