//! `.vti`, VTK's images, one array of numbers on the points.

use std::path::Path;

use super::{Header, Held, Image, Request, room_for};
use crate::io::vtk;
use crate::volume;

pub(super) fn open(path: &Path, length: u64, request: &Request) -> Result<Image, String> {
    room_for(length.saturating_mul(2))?;
    let image = vtk::read_volume(path).map_err(|error| {
        // The error names the file, as whoever asked does.
        let text = error.to_string();
        text.strip_prefix(&format!("{}: ", path.display())).map_or(text.clone(), str::to_owned)
    })?;
    let scalars: Vec<&volume::Array> = image.arrays.iter().filter(|array| array.components == 1).collect();
    let known = || image.arrays.iter().map(|array| array.name.clone()).collect::<Vec<_>>().join(", ");
    let array = match (&request.array, scalars.as_slice()) {
        (Some(name), _) => scalars
            .iter()
            .find(|array| array.name == *name)
            .ok_or_else(|| format!("has no array \"{name}\" of one number a point; there are {}", known()))?,
        (None, [one]) => one,
        (None, several) => {
            let count = several.len();
            return Err(format!("has {count} arrays of one number a point; give array, one of {}", known()));
        }
    };
    let volume::Grid { dimensions: [x, y, z], origin, spacing } = image.grid;
    let points = [x, y, z, 1];
    let values = array.values.to_f64();
    if values.len() != x * y * z {
        return Err(format!("its array \"{}\" has {} values for {} points", array.name, values.len(), x * y * z));
    }
    let header =
        Header::even(points, [origin[0], origin[1], origin[2], 0.0], [spacing[0], spacing[1], spacing[2], 1.0]);
    Ok(Image { header, slices: Box::new(Held::new(values, points)) })
}
