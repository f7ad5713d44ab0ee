//! `.vtu`: the scene's mesh as the camera sees it; in 3D where it is.

use std::path::Path;

use super::{Content, Found, LeftOut, MeshPart, OutputFormat, Retell, WritePlan, copy_over};
use crate::geometry::{Dimension, Vector};
use crate::io::{AtomicFile, Error, PIPELINE, parts, vtu};
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
    const LISTED: bool = true;
    const RETELL: Option<Retell> = Some(|path: &Path, _: &WritePlan, text: &str| retell(path, text));

    fn write_mesh<const D: usize>(
        path: &Path,
        told: &str,
        mesh: &Mesh<D>,
        camera: &Camera<D>,
        found: Found<D>,
        part: Option<MeshPart>,
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
        Ok((write(path, told, mesh, &points, &simplices, found, part)?, left_out))
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

/// Writes these simplices of a mesh, its vertices at `points`, with all that is known at the vertices; of a part its own, and
/// the list of parts if it has one. Returns the file's length.
pub(in crate::stages) fn write<const D: usize>(
    path: &Path,
    told: &str,
    mesh: &Mesh<D>,
    points: &[[f32; 3]],
    simplices: &[[u32; D]],
    found: Found<D>,
    part: Option<MeshPart>,
) -> Result<u64, Error> {
    let Some(part) = part else {
        let arrays = arrays(mesh, found, 0..mesh.vertices.len());
        return write_arrays(path, told, points, simplices, &arrays);
    };
    let own: Vec<&[u32; D]> = simplices.iter().filter(|simplex| part.has(simplex)).collect();
    // The vertices that it shows, in the mesh's order, with numbers of their own.
    let mut used: Vec<u32> = own.iter().flat_map(|simplex| simplex.iter().copied()).collect();
    used.sort_unstable();
    used.dedup();
    let number = |vertex: u32| used.binary_search(&vertex).unwrap_or_default() as u32;
    let own: Vec<[u32; D]> = own.into_iter().map(|simplex| simplex.map(number)).collect();
    let points: Vec<[f32; 3]> = used.iter().map(|&v| points[v as usize]).collect();
    let arrays = arrays(mesh, found, used.iter().map(|&v| v as usize));
    if let Some((list, parts)) = part.list {
        let path = path.with_file_name(list.file_name().unwrap_or_default());
        let mut file = AtomicFile::create(&path)?;
        parts::mesh(&mut file, &arrays, parts.iter().map(String::as_str)).map_err(AtomicFile::name_in(&path))?;
        file.commit()?;
    }
    write_arrays(path, told, &points, &own, &arrays)
}

/// What is known at these vertices of a mesh.
fn arrays<const D: usize>(
    mesh: &Mesh<D>,
    found: Found<D>,
    vertices: impl Iterator<Item = usize> + Clone,
) -> Vec<Array> {
    let coordinates = |vectors: &[Vector<D>]| -> Vec<f32> {
        vertices.clone().flat_map(move |v| vectors[v].iter().copied()).collect()
    };
    let numbers = |numbers: &[f32]| -> Vec<f32> { vertices.clone().map(|v| numbers[v]).collect() };
    let mut object = vec![0u16; mesh.vertices.len()];
    for (i, o) in mesh.objects.iter().enumerate() {
        object[o.vertices.clone()].fill(i as u16 + 1);
    }
    let mut arrays = vec![
        Array::new("position", D, coordinates(&mesh.vertices)),
        Array::new("normal", D, coordinates(&mesh.normals)),
        Array::new("object", 1, vertices.clone().map(|v| object[v]).collect::<Vec<u16>>()),
    ];
    if let Some(found) = found.values {
        arrays.push(Array::new("ambient_occlusion", 1, numbers(&found.values)));
        // Of loaded values nothing is known.
        if found.errors.len() == found.values.len() {
            arrays.push(Array::new("occlusion_error", 1, numbers(&found.errors)));
        }
    }
    if let Some(vectors) = found.vectors {
        arrays.push(Array::new("bent_normal", D, coordinates(vectors)));
    }
    arrays
}

/// Writes simplices between points that have these arrays.
fn write_arrays<const D: usize>(
    path: &Path,
    told: &str,
    points: &[[f32; 3]],
    simplices: &[[u32; D]],
    arrays: &[Array],
) -> Result<u64, Error> {
    let texts = [(PIPELINE, told)];
    let mut file = AtomicFile::create(path)?;
    match Dimension::of::<D>() {
        Dimension::Three => {
            let cells: Vec<[u32; 3]> = simplices.iter().map(|s| std::array::from_fn(|i| s[i])).collect();
            vtu::write_told(&mut file, points, vtu::Cells::Triangles(&cells), arrays, &[], &texts)
        }
        Dimension::Four => {
            let cells: Vec<[u32; 4]> = simplices.iter().map(|s| std::array::from_fn(|i| s[i])).collect();
            vtu::write_told(&mut file, points, vtu::Cells::Tetrahedra(&cells), arrays, &[], &texts)
        }
    }
    .map_err(AtomicFile::name_in(path))?;
    file.commit()
}
