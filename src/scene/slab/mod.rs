//! Thick slices: the part of a body between two parallel hyperplanes (Banchoff), a closed body itself.
//!
//! Simplices that a hyperplane crosses are divided where it crosses their edges, and the part beyond goes. In which simplices a
//! part is divided follows from the order of its vertices, so neighbours agree on the facet that they share. A vertex in the
//! hyperplane itself, within single precision, belongs to what goes; crossings on its edges meet in it, and what
//! collapses by that is left out. So of a closed surface nothing is left open but what lies in the hyperplane.
//!
//! That rim is the boundary of a cap: in 3D polygons, in 4D a solid within triangles, which [`super::fill`] cuts into
//! tetrahedra. Where it has to divide triangles of the rim itself, as in solids that no point inside sees all of, the simplices
//! on the other side are divided likewise ([`rim`]).

mod rim;

use std::collections::HashMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Error;
use super::fill::{self, Faces, Unfilled};
use super::numbers::{finite, point};
use crate::geometry::{Dimension, Vector64, determinant, normal_of};
use crate::mesh::Surface;
use crate::mesh::facets::{has_double, sorted_facets};
use crate::mesh::section::Hyperplane;
use crate::mesh::topology::is_closed;
use crate::mesh::weld::{compact, weld};
use crate::progress::Progress;
use crate::text::number;

/// What is nearer to a hyperplane than this, in terms of the body's reach, lies in it: about a step of single precision.
const WITHIN: f64 = 1e-7;

/// Two parallel hyperplanes. What lies between them is kept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SlabSpec {
    /// Their normal n, of any length but zero (default: along the last axis).
    #[serde(default)]
    pub normal: Option<Vec<f64>>,
    /// What has n.x below this goes; nothing if left out.
    #[serde(default)]
    pub from: Option<f64>,
    /// What has n.x above this goes; nothing if left out.
    #[serde(default)]
    pub to: Option<f64>,
}

impl SlabSpec {
    /// What is left of a surface.
    pub fn cut<const D: usize>(&self, surface: Surface<D>, progress: &dyn Progress) -> Result<Surface<D>, Error> {
        let normal = match &self.normal {
            Some(normal) => point::<D>("slab.normal", normal)?,
            None => Vector64::from_fn(|r, _| f64::from(r == D - 1)),
        };
        if normal.norm() < 1e-12 {
            return Err(Error::invalid("slab.normal", "the normal is zero, and no hyperplane has that"));
        }
        for (key, given) in [("slab.from", self.from), ("slab.to", self.to)] {
            given.map(|x| finite(key, x)).transpose()?;
        }
        match (self.from, self.to) {
            (None, None) => {
                let message = "a slab lies between two hyperplanes: give it `from`, `to`, or both";
                return Err(Error::invalid("slab", message));
            }
            (Some(from), Some(to)) if from >= to => {
                let message = format!("expected a number above `from`, {}, found {}", number(from), number(to));
                return Err(Error::invalid("slab.to", message));
            }
            _ => {}
        }
        let (vertices, simplices) = weld(&surface.vertices, surface.simplices);
        let mut left = Surface { vertices, simplices, normals: None };
        let closed = is_closed(&left.simplices);
        for (key, sign, at) in [("slab.to", 1.0, self.to), ("slab.from", -1.0, self.from)] {
            let Some(at) = at else { continue };
            left = below(&left, &(normal * sign), at * sign, closed, key, progress)?;
        }
        if left.simplices.is_empty() {
            let (from, to) = (self.from.map(number), self.to.map(number));
            let message = format!(
                "the body has no part between {} and {}",
                from.as_deref().unwrap_or("-infinity"),
                to.as_deref().unwrap_or("infinity")
            );
            return Err(Error::invalid("slab", message));
        }
        Ok(left)
    }
}

/// The part with n.x below c, closed by a cap if the surface is closed.
fn below<const D: usize>(
    surface: &Surface<D>,
    normal: &Vector64<D>,
    at: f64,
    closed: bool,
    key: &str,
    progress: &dyn Progress,
) -> Result<Surface<D>, Error> {
    let reach = surface.vertices.iter().map(|v| v.component_mul(normal).abs().sum()).fold(at.abs(), f64::max);
    let height = |v: &Vector64<D>| {
        let height = v.dot(normal) - at;
        if height.abs() <= WITHIN * reach { 0.0 } else { height }
    };
    let heights: Vec<f64> = surface.vertices.iter().map(height).collect();
    let mut cut = Cut { heights, vertices: surface.vertices.clone(), crossings: HashMap::new() };
    let mut simplices: Vec<[u32; D]> = surface.simplices.iter().flat_map(|simplex| cut.keep(simplex)).collect();
    let mut vertices = cut.vertices;
    let rim = if closed { rim(&simplices) } else { Vec::new() };
    if !rim.is_empty() {
        let plane = Hyperplane::new(*normal, at)
            .ok_or_else(|| Error::invalid(key, "no hyperplane has such a normal and place"))?;
        let foot = normal * (at / normal.norm_squared());
        let blame = |message: String| Error::invalid(key, format!("the section there can't be filled: it {message}"));
        let mut cap = match Dimension::of::<D>() {
            Dimension::Three => flat_cap(&plane, &vertices, &rim).map_err(blame)?,
            Dimension::Four => {
                let solid = solid_cap(&plane, &foot, &mut vertices, &rim, progress).map_err(|error| match error {
                    Unfilled::Cancelled => Error::Cancelled,
                    Unfilled::Refused(message) => blame(message),
                })?;
                rim::divide(&mut vertices, &mut simplices, &rim, &solid);
                solid
            }
        };
        for simplex in &mut cap {
            if normal_of(&simplex.map(|v| vertices[v as usize])).dot(normal) < 0.0 {
                simplex.swap(0, 1);
            }
        }
        simplices.append(&mut cap);
        if !is_closed(&simplices) {
            return Err(blame("has parts too thin for double precision; move the hyperplane a little".to_owned()));
        }
    }
    let (used, simplices) = compact(simplices);
    Ok(Surface { vertices: used.into_iter().map(|v| vertices[v as usize]).collect(), simplices, normals: None })
}

/// A cut in the making.
struct Cut<const D: usize> {
    heights: Vec<f64>,
    vertices: Vec<Vector64<D>>,
    crossings: HashMap<(u32, u32), u32>,
}

impl<const D: usize> Cut<D> {
    /// What is kept of a simplex, in the same orientation.
    fn keep(&mut self, simplex: &[u32; D]) -> Vec<[u32; D]> {
        let is_kept = |i: &usize| self.heights[simplex[*i] as usize] < 0.0;
        let (mut kept, mut gone): (Vec<usize>, Vec<usize>) = (0..D).partition(is_kept);
        if gone.is_empty() {
            return vec![*simplex];
        }
        let order = |list: &mut Vec<usize>| list.sort_unstable_by_key(|&i| simplex[i]);
        order(&mut kept);
        order(&mut gone);
        // Corners of parts: a corner of the simplex (twice), or the crossing of the edge between two.
        let [k, g] = [&kept, &gone].map(|list| |i: usize| list[i]);
        let (own, on) = (|i: usize| (k(i), k(i)), |i: usize, j: usize| (k(i), g(j)));
        let parts: Vec<Vec<(usize, usize)>> = match (kept.len(), D) {
            (0, _) => Vec::new(),
            (1, 3) => vec![vec![own(0), on(0, 0), on(0, 1)]],
            (1, _) => vec![vec![own(0), on(0, 0), on(0, 1), on(0, 2)]],
            (2, 3) => vec![vec![own(0), own(1), on(1, 0)], vec![own(0), on(1, 0), on(0, 0)]],
            // Prisms, each quadrilateral cut from the corner of lower index to the crossing of the higher one.
            (2, _) => vec![
                vec![own(0), on(0, 0), on(0, 1), on(1, 1)],
                vec![own(0), on(0, 0), on(1, 0), on(1, 1)],
                vec![own(0), own(1), on(1, 0), on(1, 1)],
            ],
            (_, _) => vec![
                vec![own(0), own(1), own(2), on(2, 0)],
                vec![own(0), own(1), on(1, 0), on(2, 0)],
                vec![own(0), on(0, 0), on(1, 0), on(2, 0)],
            ],
        };
        let turned = |part: &[(usize, usize)]| {
            let column =
                |&(a, b): &(usize, usize)| Vector64::<D>::from_fn(|r, _| 0.5 * (f64::from(r == a) + f64::from(r == b)));
            determinant::<D>(&std::array::from_fn(|i| column(&part[i]))) < 0.0
        };
        let made = parts.into_iter().map(|part| {
            let mut made: [u32; D] = std::array::from_fn(|i| {
                let (a, b) = part[i];
                if a == b { simplex[a] } else { self.crossing(simplex[a], simplex[b]) }
            });
            if turned(&part) {
                made.swap(0, 1);
            }
            made
        });
        made.filter(|made| !has_double(made)).collect()
    }

    /// Where the hyperplane crosses the edge from a vertex that is kept to one that goes.
    fn crossing(&mut self, kept: u32, gone: u32) -> u32 {
        let [low, high] = [kept, gone].map(|v| self.heights[v as usize]);
        if high == 0.0 {
            return gone;
        }
        let vertices = &mut self.vertices;
        *self.crossings.entry((kept, gone)).or_insert_with(|| {
            let [a, b] = [kept, gone].map(|v| vertices[v as usize]);
            vertices.push(a + (b - a) * (low / (low - high)));
            vertices.len() as u32 - 1
        })
    }
}

/// The facets that are left open, each as often as it is, so that they run against the simplices that have them; in 3D
/// the last index means nothing.
fn rim<const D: usize>(simplices: &[[u32; D]]) -> Vec<[u32; 3]> {
    let mut rim = Vec::new();
    for equal in sorted_facets(simplices).chunk_by(|a, b| a.corners == b.corners) {
        let turned = equal.iter().filter(|facet| facet.turned).count();
        let (more, surplus) = (2 * turned > equal.len(), (2 * turned).abs_diff(equal.len()));
        let mut corners = equal[0].corners;
        if !more {
            corners.swap(0, 1);
        }
        rim.extend(std::iter::repeat_n(corners, surplus));
    }
    rim
}

/// The triangles of the polygons within edges, in 3D.
fn flat_cap<const D: usize>(
    plane: &Hyperplane<D>,
    vertices: &[Vector64<D>],
    rim: &[[u32; 3]],
) -> Result<Vec<[u32; D]>, String> {
    let edges: Vec<[u32; 2]> = rim.iter().map(|&[a, b, _]| [a, b]).collect();
    let (used, edges) = compact(edges);
    let flat: Vec<[f64; 2]> = used
        .iter()
        .map(|&v| {
            let [x, y, _] = plane.coordinates(&vertices[v as usize]);
            [x, y]
        })
        .collect();
    // Of the two ways round the edges may run, one has the region on the left.
    let area: f64 =
        edges.iter().map(|[a, b]| (flat[*a as usize], flat[*b as usize])).map(|(p, q)| p[0] * q[1] - p[1] * q[0]).sum();
    let edges: Vec<[u32; 2]> = if area < 0.0 { edges.iter().map(|&[a, b]| [b, a]).collect() } else { edges };
    let triangles = fill::section::triangles(&flat, &edges)
        .map_err(|at| format!("passes through itself near {:?}", flat[at as usize]))?;
    Ok(triangles.into_iter().map(|t| std::array::from_fn(|i| used[t[i.min(2)] as usize])).collect())
}

/// The tetrahedra of the solid within triangles, in 4D; their own new points are added to the vertices.
fn solid_cap<const D: usize>(
    plane: &Hyperplane<D>,
    foot: &Vector64<D>,
    vertices: &mut Vec<Vector64<D>>,
    rim: &[[u32; 3]],
    progress: &dyn Progress,
) -> Result<Vec<[u32; D]>, Unfilled> {
    let (used, triangles) = compact(rim.to_vec());
    let points: Vec<Vector64<3>> = used.iter().map(|&v| plane.coordinates(&vertices[v as usize]).into()).collect();
    let bits = |p: &Vector64<3>| -> [u64; 3] { std::array::from_fn(|i| p[i].to_bits()) };
    let mut numbers: HashMap<[u64; 3], u32> = points.iter().map(bits).zip(used).collect();
    let ((found, tetrahedra), _) = fill::fill(&points, &triangles, Faces::Kept, progress)?;
    for point in &found {
        numbers.entry(bits(point)).or_insert_with(|| {
            vertices.push(foot + plane.point((*point).into()));
            vertices.len() as u32 - 1
        });
    }
    let number = |i: u32| numbers[&bits(&found[i as usize])];
    Ok(tetrahedra.into_iter().map(|t| std::array::from_fn(|i| number(t[i]))).collect())
}
