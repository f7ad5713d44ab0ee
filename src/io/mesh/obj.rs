//! OBJ, through `tobj`: the faces of all objects and groups as one mesh. Polygons are cut into triangles; materials, texture
//! coordinates and normals are passed over.

use std::collections::HashMap;

use super::{Cells, FileMesh};
use crate::geometry::Vector64;
use crate::mesh::weld::weld;

pub fn read(bytes: &[u8]) -> Result<FileMesh, String> {
    let options =
        tobj::LoadOptions { triangulate: true, ignore_points: true, ignore_lines: true, ..Default::default() };
    let no_materials = |_: &std::path::Path| Ok((Vec::new(), HashMap::default()));
    let (models, _) = tobj::load_obj_buf(&mut &bytes[..], &options, no_materials)
        .map_err(|error| format!("is damaged, or no OBJ file: {error}"))?;
    let (mut points, mut triangles) = (Vec::<Vector64<3>>::new(), Vec::new());
    let several = models.len() > 1;
    for model in models {
        let start = points.len() as u32;
        points.extend(model.mesh.positions.chunks_exact(3).map(Vector64::from_column_slice));
        let corners = model.mesh.indices.chunks_exact(3);
        triangles.extend(corners.map(|c| [c[0], c[1], c[2]].map(|index| index.saturating_add(start))));
    }
    if several {
        // Objects that share points have them twice here.
        let count = points.len();
        if let Some(index) = triangles.as_flattened().iter().find(|index| **index as usize >= count) {
            return Err(format!("names point {index} of {count}"));
        }
        (points, triangles) = weld(&points, triangles);
    }
    Ok(FileMesh { points, cells: Cells::Triangles(triangles), point_arrays: Vec::new() })
}
