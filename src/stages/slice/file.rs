//! The file of a slice: its points, where they are shown, and what is known there.

use std::path::Path;

use crate::geometry::{Dimension, Vector64, narrow};
use crate::io::{self, AtomicFile, PIPELINE, vtp};
use crate::mesh::Mesh;
use crate::mesh::section::{Hyperplane, Level, Section};
use crate::mesh::stereographic::{NoImage, Stereographic};
use crate::occlusion::Estimates;
use crate::volume::Array;

/// Where a slice's points are put.
pub(super) enum Shown<const D: usize> {
    /// In the hyperplane's own coordinates.
    Plane(Hyperplane<D>),
    /// By the stereographic projection.
    Stereographic(Stereographic<D>),
}

impl<const D: usize> Shown<D> {
    /// Where the points are put; if some have no place, why, and the object they belong to.
    ///
    /// # Errors
    /// If the projection leads something to infinity, or nowhere.
    pub fn points(&self, mesh: &Mesh<D>, found: &Section) -> Result<Vec<[f32; 3]>, (NoImage, u32)> {
        let places: Vec<Vector64<D>> = found.points.iter().map(|point| point.position(mesh)).collect();
        let map = match self {
            Self::Plane(plane) => return Ok(places.iter().map(|p| plane.coordinates(p).map(|x| x as f32)).collect()),
            Self::Stereographic(map) => map,
        };
        for face in &found.faces {
            let corners: [Vector64<D>; 3] = std::array::from_fn(|i| places[face[i.min(D - 2)] as usize]);
            map.check(&corners[..D - 1]).map_err(|why| (why, found.points[face[0] as usize].object))?;
        }
        Ok(places.iter().map(|p| map.image(p).map(|x| x as f32)).collect())
    }

    /// Makes triangles face to where the level's values are larger, as seen in the image. In a hyperplane they face
    /// outwards of the body already, and lines have no side that is named.
    pub fn turn(&self, level: &dyn Level<D>, mesh: &Mesh<D>, found: &mut Section) {
        let (Self::Stereographic(map), Dimension::Four) = (self, Dimension::of::<D>()) else { return };
        // All face the same way, so the largest tells of them all.
        let area = |face: &[u32; 3]| {
            let corners = face.map(|i| found.points[i as usize].position(mesh));
            let [a, b, c] = corners.each_ref().map(|p| nalgebra::Vector3::from(map.image(p)));
            ((b - a).cross(&(c - a)), (a + b + c) / 3.0, corners[0])
        };
        let faces = found.faces.iter().map(area);
        let Some((normal, middle, like)) = faces.max_by(|a, b| a.0.norm_squared().total_cmp(&b.0.norm_squared()))
        else {
            return;
        };
        let Some(normal) = normal.try_normalize(0.0) else { return };
        let step = normal * (1e-3 * (1.0 + middle.norm()));
        let value = |image: nalgebra::Vector3<f64>| level.value(&map.preimage(image.into(), &like));
        if value(middle + step) < value(middle - step) {
            found.faces.iter_mut().for_each(|face| face.swap(0, 1));
        }
    }
}

/// Writes a slice; returns the file's length.
pub(super) fn write<const D: usize>(
    path: &Path,
    told: &str,
    mesh: &Mesh<D>,
    points: &[[f32; 3]],
    section: &Section,
    found: Option<&Estimates>,
) -> Result<u64, io::Error> {
    let places = section.points.iter().map(|point| point.position(mesh));
    let position: Vec<f32> = places.flat_map(|p| narrow(&p).iter().copied().collect::<Vec<_>>()).collect();
    let object: Vec<u16> = section.points.iter().map(|point| point.object as u16 + 1).collect();
    let mut arrays = vec![Array::new("position", D, position), Array::new("object", 1, object)];
    if let Some(found) = found {
        let values: Vec<f32> = section.points.iter().map(|point| point.value(&found.values)).collect();
        arrays.push(Array::new("ambient_occlusion", 1, values));
        // Of loaded values nothing is known.
        if found.errors.len() == found.values.len() {
            let errors: Vec<f32> = section.points.iter().map(|point| point.error(&found.errors)).collect();
            arrays.push(Array::new("occlusion_error", 1, errors));
        }
    }
    let mut file = AtomicFile::create(path)?;
    let texts = [(PIPELINE, told)];
    match Dimension::of::<D>() {
        Dimension::Three => {
            let lines: Vec<[u32; 2]> = section.faces.iter().map(|&[a, b, _]| [a, b]).collect();
            vtp::write(&mut file, points, vtp::Cells::Lines(&lines), &arrays, &[], &texts)
        }
        Dimension::Four => vtp::write(&mut file, points, vtp::Cells::Triangles(&section.faces), &arrays, &[], &texts),
    }
    .map_err(AtomicFile::name_in(path))?;
    file.commit()
}
