//! Numbers without a header, which the pipeline describes: x fastest, then y, z, time, unless `axes` says otherwise.

use std::path::Path;

use super::axes::{Axis, Opened, Role};
use super::numbers::{Bytes, Meaning, Packing, stream};
use super::{ByteOrder, Request, counted};

pub(super) fn open(path: &Path, length: u64, request: &Request) -> Result<Opened, String> {
    let points = request.dimensions.ok_or("is a raw file, which doesn't say its sizes: give dimensions")?;
    let kind = request.number.ok_or("is a raw file, which doesn't say its numbers: give type, such as uint8")?.kind();
    let needed = counted(&points, kind.size())?;
    let there = length.saturating_sub(request.offset);
    let roles = request.axes.clone().unwrap_or_else(|| Role::GRID.to_vec());
    let channels = match roles.contains(&Role::Channel) {
        true if there.is_multiple_of(needed) => (there / needed).max(1),
        _ => 1,
    };
    if needed.checked_mul(channels).and_then(|all| request.offset.checked_add(all)) != Some(length) {
        return Err(format!(
            "has {length} bytes, but {} numbers of {} bytes after {} bytes take {}; check dimensions, type and offset",
            needed / kind.size() as u64,
            kind.size(),
            request.offset,
            request.offset.saturating_add(needed)
        ));
    }
    let size = |role: Role| points.get(role as usize).copied().unwrap_or(channels as usize);
    let axes: Vec<Axis> = roles.iter().map(|&role| Axis::new(role.name(), Some(role), size(role))).collect();
    if let Some(role) = Role::GRID.into_iter().find(|&role| size(role) > 1 && !roles.contains(&role)) {
        return Err(format!("axes doesn't name {}, along which dimensions has {} points", role.name(), size(role)));
    }
    let reader = stream(path, request.offset, Packing::None)?;
    let values = Bytes::new(reader, kind, request.byte_order == ByteOrder::Little, Meaning::default());
    Ok(Opened::new("raw numbers", axes, kind.vtk_name().to_lowercase(), Box::new(values)))
}
