//! What a run needs and what the computer has, told before anything is computed.

use std::collections::BTreeSet;

use super::RunError;
use super::plan::{Plan, RenderPlan, WritePlan};
use super::spec::{Compression, Encoding};
use super::work::Stale;
use crate::geometry::Dimension;
use crate::io;
use crate::render::{Aov as Channel, Columns};
use crate::volume::available_memory;

/// Refuses a run whose files don't fit on the disk, or one layer of whose pictures doesn't fit in memory.
///
/// # Errors
/// With the bytes that are needed and those that are left.
pub(super) fn check(plan: &Plan, stale: &Stale) -> Result<(), RunError> {
    let memory = (0..plan.renders.len()).map(|render| (layer_memory(plan, stale, render), render)).max();
    if let (Some((needed, render)), Some(available)) = (memory, available_memory())
        && needed > available
    {
        return Err(RunError::Memory { render: plan.renders[render].id.clone(), needed, available });
    }
    let disk = (0..plan.writes.len()).map(|write| disk(plan, stale, write)).fold(0, u64::saturating_add);
    io::check_free_space(&plan.out, disk)?;
    Ok(())
}

/// Bytes that a picture takes at once when it is made in slabs of one layer: what is seen, its shade, and the arrays
/// of the files that have to be made.
fn layer_memory(plan: &Plan, stale: &Stale, index: usize) -> u64 {
    let render = &plan.renders[index];
    let mut channels = BTreeSet::new();
    for (w, write) in plan.writes.iter().enumerate().filter(|(_, write)| write.render == index) {
        channels.extend(write.arrays.iter().filter(|_| stale.vti[w]));
        channels.extend(stale.raw[w].then_some(Channel::Rgb));
        channels.extend(stale.png[w].then_some(Channel::Rgba));
    }
    if channels.is_empty() {
        return 0;
    }
    let arrays: u64 = channels.iter().map(|&channel| bytes(plan, render, channel)).sum();
    let columns = channels.iter().fold(Columns::SIMPLEX, |all, channel| all | channel.columns());
    let voxel = size_of::<u32>() as u64 + columns.bytes::<4>() as u64 + arrays;
    (render.voxels() / render.dimensions[2] as u64).saturating_mul(voxel)
}

/// Bytes that a write's large files take. How far compression gets is not known before, so compressed files count as
/// nothing here, and are refused by the disk itself if it comes to that.
fn disk(plan: &Plan, stale: &Stale, index: usize) -> u64 {
    let write: &WritePlan = &plan.writes[index];
    let render = &plan.renders[write.render];
    let mut voxel = 0;
    if stale.vti[index] && write.compression == Compression::None {
        let arrays: u64 = write.arrays.iter().map(|&channel| bytes(plan, render, channel)).sum();
        voxel += match write.encoding {
            Encoding::Appended => arrays,
            // Four bytes of text for three, and the arrays themselves, which are kept aside until all are whole.
            Encoding::Inline => arrays + (4 * arrays).div_ceil(3),
        };
    }
    if stale.raw[index] {
        voxel += 12;
    }
    render.voxels().saturating_mul(voxel)
}

/// Bytes that a voxel takes in this array.
fn bytes(plan: &Plan, render: &RenderPlan, channel: Channel) -> u64 {
    let bytes = match plan.scenes[render.scene].dimension {
        Dimension::Three => channel.bytes::<3>(),
        Dimension::Four => channel.bytes::<4>(),
    };
    bytes as u64
}
