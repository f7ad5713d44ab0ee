//! `.vtu`: the scene's mesh as the camera sees it; in 3D where it is.

use std::path::Path;

use super::{Content, LeftOut, OutputFormat};
use crate::geometry::{Dimension, Vector, widen};
use crate::io::{AtomicFile, Error, vtu};
use crate::mesh::Mesh;
use crate::occlusion::Estimates;
use crate::render::Camera;
use crate::volume::Array;

pub(super) struct Vtu;

impl OutputFormat for Vtu {
    const CONTENT: Content = Content::Mesh;
    const LEFT_OUT: &'static [LeftOut] = &[
        LeftOut::new("/arrays", "about `.vti` only; a `.vtu` has those of the mesh"),
        LeftOut::new("/encoding", "about `.vti` only"),
        LeftOut::new("/compression", "about `.vti` only"),
    ];

    fn write_mesh<const D: usize>(
        path: &Path,
        mesh: &Mesh<D>,
        camera: &Camera<D>,
        found: Option<&Estimates>,
    ) -> Result<(u64, usize), Error> {
        let mut before = vec![true; mesh.vertices.len()];
        let mut points = vec![[0.0f32; 3]; mesh.vertices.len()];
        for (i, vertex) in mesh.vertices.iter().enumerate() {
            match Dimension::of::<D>() {
                Dimension::Three => points[i] = std::array::from_fn(|a| vertex[a]),
                Dimension::Four => {
                    let (image, distance) = camera.project(vertex);
                    let image = image.map(|x| x as f32);
                    before[i] = distance > 0.0 && image.iter().all(|x| x.is_finite());
                    points[i] = if before[i] { image } else { [0.0; 3] };
                }
            }
        }
        let shown: Vec<usize> =
            (0..mesh.simplices.len()).filter(|&s| mesh.simplices[s].iter().all(|&v| before[v as usize])).collect();
        let coordinates = |vectors: &[Vector<D>]| -> Vec<f32> {
            vectors.iter().flat_map(|v| widen(v).iter().map(|&x| x as f32).collect::<Vec<_>>()).collect()
        };
        let mut object = vec![0u16; mesh.vertices.len()];
        for (i, o) in mesh.objects.iter().enumerate() {
            object[o.vertices.clone()].fill(i as u16 + 1);
        }
        let mut arrays = vec![
            Array::new("position", D, coordinates(&mesh.vertices)),
            Array::new("normal", D, coordinates(&mesh.normals)),
            Array::new("object", 1, object),
        ];
        if let Some(found) = found {
            arrays.push(Array::new("ambient_occlusion", 1, found.values.clone()));
            // Of loaded values nothing is known.
            if found.errors.len() == found.values.len() {
                arrays.push(Array::new("occlusion_error", 1, found.errors.clone()));
            }
        }
        let mut file = AtomicFile::create(path)?;
        match Dimension::of::<D>() {
            Dimension::Three => {
                let cells: Vec<[u32; 3]> =
                    shown.iter().map(|&s| std::array::from_fn(|i| mesh.simplices[s][i])).collect();
                vtu::write(&mut file, &points, vtu::Cells::Triangles(&cells), &arrays, &[])
            }
            Dimension::Four => {
                let cells: Vec<[u32; 4]> =
                    shown.iter().map(|&s| std::array::from_fn(|i| mesh.simplices[s][i])).collect();
                vtu::write(&mut file, &points, vtu::Cells::Tetrahedra(&cells), &arrays, &[])
            }
        }
        .map_err(AtomicFile::name_in(path))?;
        Ok((file.commit()?, mesh.simplices.len() - shown.len()))
    }
}
