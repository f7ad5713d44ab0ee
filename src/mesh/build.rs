//! From surfaces to a mesh.

use rayon::prelude::*;

use super::copies::Sides;
use super::corners::{self, Corners};
use super::{
    Copies, Crease, Gloss, Mesh, MeshError, Object, Orientation, Surface, identity, normals, orientation, rounding,
};
use crate::geometry::{Vector, is_degenerate, narrow};
use crate::progress::{Progress, Silent};

/// Largest magnitude of a coordinate: determinants of four of them, and their squares, stay far from overflow.
const LARGEST: f64 = 1e30;

/// Places surfaces side by side, then finds identities, orientations and normals.
#[derive(Clone, Debug, Default)]
pub struct MeshBuilder<const D: usize> {
    mesh: Mesh<D>,
    added: Vec<Added<D>>,
}

/// What there is to know of an object beside its surface.
#[derive(Clone, Debug)]
struct Added<const D: usize> {
    open: Orientation<D>,
    crease: Crease,
    normals: Option<Vec<Vector<D>>>,
}

impl<const D: usize> MeshBuilder<D> {
    /// An empty scene.
    pub fn new() -> Self {
        Self { mesh: Mesh::default(), added: Vec::new() }
    }

    /// Adds an object with one normal a vertex, and rounds it to `f32`.
    pub fn add(
        &mut self,
        name: &str,
        color: [f32; 3],
        surface: &Surface<D>,
        open: Orientation<D>,
    ) -> Result<(), MeshError> {
        self.add_creased(name, color, surface, open, Crease::Never)
    }

    /// Adds an object whose vertices are split at creases, unless it has normals of its own, and rounds it to `f32`.
    pub fn add_creased(
        &mut self,
        name: &str,
        color: [f32; 3],
        surface: &Surface<D>,
        open: Orientation<D>,
        crease: Crease,
    ) -> Result<(), MeshError> {
        let object = || name.to_owned();
        let (first_vertex, first_simplex) = (self.mesh.vertices.len(), self.mesh.simplices.len());
        for (vertex, point) in surface.vertices.iter().enumerate() {
            if let Some(&value) = point.iter().find(|x| x.is_nan() || x.abs() > LARGEST) {
                return Err(MeshError::Coordinate { object: object(), vertex, value });
            }
        }
        let count = surface.vertices.len();
        for (cell, simplex) in surface.simplices.iter().enumerate() {
            if let Some(&index) = simplex.iter().find(|&&v| v as usize >= count) {
                return Err(MeshError::Index { object: object(), cell, index, count });
            }
        }
        if let Some(found) = surface.normals.as_ref().map(Vec::len).filter(|&n| n != count) {
            return Err(MeshError::NormalCount { object: object(), found, expected: count });
        }
        for (what, total) in
            [("vertices", first_vertex + count), ("simplices", first_simplex + surface.simplices.len())]
        {
            if total >= u32::MAX as usize {
                return Err(MeshError::TooMany { what, count: total });
            }
        }
        if self.mesh.objects.len() == usize::from(u16::MAX) {
            return Err(MeshError::TooManyObjects(self.mesh.objects.len() + 1));
        }
        self.mesh.vertices.extend(surface.vertices.iter().map(narrow));
        self.mesh.simplices.extend(surface.simplices.iter().map(|s| s.map(|v| v + first_vertex as u32)));
        let turned = rounding::turned_over(surface).into_iter().map(|s| s + first_simplex as u32);
        self.mesh.turned_over.extend(turned);
        self.mesh.objects.push(Object {
            name: object(),
            color,
            opacity: 1.0,
            gloss: Gloss::default(),
            vertices: first_vertex..self.mesh.vertices.len(),
            simplices: first_simplex..self.mesh.simplices.len(),
            components: 0,
            closed_components: 0,
        });
        let normals = surface.normals.as_ref().map(|n| n.iter().map(normals::unit_if_not).collect());
        self.added.push(Added { open, crease, normals });
        Ok(())
    }

    /// Lets light pass through the object that was added last: each of its surfaces keeps this share of it, 0 to 1.
    pub fn set_opacity(&mut self, opacity: f32) {
        if let Some(object) = self.mesh.objects.last_mut() {
            object.opacity = opacity;
        }
    }

    /// Says how the object that was added last reflects lights.
    pub fn set_gloss(&mut self, gloss: Gloss) {
        if let Some(object) = self.mesh.objects.last_mut() {
            object.gloss = gloss;
        }
    }

    /// The finished mesh.
    pub fn finish(self) -> Mesh<D> {
        self.finish_watched(&Silent).unwrap_or_default()
    }

    /// The same; `None` soon after `progress` says to stop.
    pub fn finish_watched(self, progress: &dyn Progress) -> Option<Mesh<D>> {
        let mut mesh = self.mesh;
        if progress.cancelled() {
            return None;
        }
        mesh.identity = identity::identities(&mesh.vertices);
        mesh.normals = vec![Vector::zeros(); mesh.vertices.len()];
        mesh.degenerate =
            (0..mesh.simplices.len() as u32).into_par_iter().filter(|&s| is_degenerate(&mesh.corners(s))).collect();
        let flat = |s: u32| mesh.degenerate.binary_search(&s).is_ok();
        let places: Vec<[u32; D]> = (0..mesh.simplices.len() as u32).map(|s| mesh.places_of(s)).collect();
        mesh.copies = Copies::find(&places, |s| !flat(s));
        drop(places);
        for (i, added) in self.added.iter().enumerate() {
            if progress.cancelled() {
                return None;
            }
            let simplices = mesh.objects[i].simplices.clone();
            let (components, closed) = orientation::orient(&mut mesh, simplices, &added.open);
            (mesh.objects[i].components, mesh.objects[i].closed_components) = (components, closed);
        }
        let sides = Sides::find(&mesh);
        let mut splits = Vec::with_capacity(self.added.len());
        for (i, Added { crease, normals: given, .. }) in self.added.into_iter().enumerate() {
            let (vertices, simplices) = (mesh.objects[i].vertices.clone(), mesh.objects[i].simplices.clone());
            if progress.cancelled() {
                return None;
            }
            let angle = match (&given, crease) {
                (Some(_), _) => None,
                // A vertex has one normal, but not for both sides of a sheet.
                (None, Crease::Never) => sides.any_two_sided(&simplices).then_some(None),
                (None, Crease::Above(degrees)) => Some(Some(degrees)),
                (None, Crease::Rough) => Some(Some(corners::rough_angle(&mesh, simplices.clone()))),
            };
            splits.push(match angle {
                Some(degrees) => corners::split(&mesh, vertices, simplices, degrees, &sides),
                None => {
                    normals::set_vertex_normals(&mut mesh, vertices.clone(), simplices, &sides);
                    let own = given.unwrap_or_else(|| mesh.normals[vertices].to_vec());
                    Corners { sources: Vec::new(), normals: own, moved: Vec::new() }
                }
            });
        }
        corners::add(&mut mesh, splits);
        Some(mesh)
    }
}
