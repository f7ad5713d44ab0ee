//! `.vtu`: the scene's mesh as the camera sees it; in 3D where it is.

use std::path::Path;

use super::{Content, Found, LeftOut, OutputFormat, Retell, WritePlan, copy_over};
use crate::geometry::{Dimension, Vector};
use crate::io::{AtomicFile, Error, PIPELINE, vtu};
use crate::mesh::Mesh;
use crate::render::Camera;
use crate::volume::Array;

pub(super) struct Vtu;

impl OutputFormat for Vtu {
    const CONTENT: Content = Content::Mesh;
    const LEFT_OUT: &'static [LeftOut] = &[
        LeftOut::new(
            "/arrays",
            "a `.vtu` has those of the mesh, and of these `bent_normal` only, which takes part by itself",
        ),
        LeftOut::new("/encoding", "about `.vti` only"),
        LeftOut::new("/compression", "about `.vti` only"),
    ];
    const RETELL: Option<Retell> = Some(|path: &Path, _: &WritePlan, text: &str| retell(path, text));

    fn write_mesh<const D: usize>(
        path: &Path,
        told: &str,
        mesh: &Mesh<D>,
        camera: &Camera<D>,
        found: Found<D>,
    ) -> Result<(u64, usize), Error> {
        let mut before = vec![true; mesh.vertices.len()];
        let mut points = vec![[0.0f32; 3]; mesh.vertices.len()];
        for (i, vertex) in mesh.vertices.iter().enumerate() {
            match Dimension::of::<D>() {
                Dimension::Three => points[i] = first_three(vertex),
                Dimension::Four => {
                    let (image, distance) = camera.project(vertex);
                    let image = image.map(|x| x as f32);
                    before[i] = distance > 0.0 && image.iter().all(|x| x.is_finite());
                    points[i] = if before[i] { image } else { [0.0; 3] };
                }
            }
        }
        let shown = |simplex: &[u32; D]| simplex.iter().all(|&v| before[v as usize]);
        let simplices: Vec<[u32; D]> = mesh.simplices.iter().copied().filter(shown).collect();
        let left_out = mesh.simplices.len() - simplices.len();
        Ok((write(path, told, mesh, &points, &simplices, found)?, left_out))
    }
}

/// A point's first three coordinates.
pub(in crate::stages) fn first_three<const D: usize>(point: &Vector<D>) -> [f32; 3] {
    std::array::from_fn(|axis| point[axis])
}

/// Puts another text of the pipeline into a file.
pub(in crate::stages) fn retell(path: &Path, text: &str) -> Result<u64, Error> {
    copy_over(path, |source, out| vtu::retell(source, out, (PIPELINE, text)))
}

/// Writes these simplices of a mesh, its vertices at `points`, with all that is known at the vertices; returns the file's
/// length.
pub(in crate::stages) fn write<const D: usize>(
    path: &Path,
    told: &str,
    mesh: &Mesh<D>,
    points: &[[f32; 3]],
    simplices: &[[u32; D]],
    found: Found<D>,
) -> Result<u64, Error> {
    let coordinates = |vectors: &[Vector<D>]| -> Vec<f32> { vectors.iter().flatten().copied().collect() };
    let mut object = vec![0u16; mesh.vertices.len()];
    for (i, o) in mesh.objects.iter().enumerate() {
        object[o.vertices.clone()].fill(i as u16 + 1);
    }
    let mut arrays = vec![
        Array::new("position", D, coordinates(&mesh.vertices)),
        Array::new("normal", D, coordinates(&mesh.normals)),
        Array::new("object", 1, object),
    ];
    if let Some(found) = found.values {
        arrays.push(Array::new("ambient_occlusion", 1, found.values.clone()));
        // Of loaded values nothing is known.
        if found.errors.len() == found.values.len() {
            arrays.push(Array::new("occlusion_error", 1, found.errors.clone()));
        }
    }
    if let Some(vectors) = found.vectors {
        arrays.push(Array::new("bent_normal", D, coordinates(vectors)));
    }
    let texts = [(PIPELINE, told)];
    let mut file = AtomicFile::create(path)?;
    match Dimension::of::<D>() {
        Dimension::Three => {
            let cells: Vec<[u32; 3]> = simplices.iter().map(|s| std::array::from_fn(|i| s[i])).collect();
            vtu::write_told(&mut file, points, vtu::Cells::Triangles(&cells), &arrays, &[], &texts)
        }
        Dimension::Four => {
            let cells: Vec<[u32; 4]> = simplices.iter().map(|s| std::array::from_fn(|i| s[i])).collect();
            vtu::write_told(&mut file, points, vtu::Cells::Tetrahedra(&cells), &arrays, &[], &texts)
        }
    }
    .map_err(AtomicFile::name_in(path))?;
    file.commit()
}
