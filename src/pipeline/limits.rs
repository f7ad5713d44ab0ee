//! What a run needs and what the computer has, told before anything is computed.

use std::path::Path;

use super::RunError;
use super::plan::Plan;
use super::work::Stale;
use crate::export;

/// Refuses a run whose files don't fit on the disk, or one slab of whose pictures doesn't fit in memory.
///
/// # Errors
/// With the bytes that are needed and those that are left.
pub(super) fn check(plan: &Plan, stale: &Stale) -> Result<(), RunError> {
    let mut disk: u64 = 0;
    let mut memory: u64 = 0;
    for (i, write) in plan.writes.iter().enumerate() {
        let render = &plan.renders[write.render];
        let voxels = render.voxels();
        let layer = voxels / render.dimensions[2] as u64;
        let vti: u64 = write.arrays.iter().map(|a| a.bytes::<4>() as u64).sum();
        if write.vti.is_some() && stale.vti[i] {
            disk = disk.saturating_add(voxels.saturating_mul(vti));
            memory = memory.max(layer.saturating_mul(vti + 16));
        }
        if write.raw.is_some() && stale.raw[i] {
            disk = disk.saturating_add(voxels.saturating_mul(12));
            memory = memory.max(layer.saturating_mul(12 + 16));
        }
    }
    if let Some(available) = available_memory().filter(|&a| a < memory) {
        return Err(RunError::Memory { needed: memory, available });
    }
    export::check_free_space(existing(&plan.out), disk)?;
    Ok(())
}

/// The nearest folder on the way to `path` that exists, since the disk of one that doesn't can't be asked.
fn existing(path: &Path) -> &Path {
    path.ancestors().find(|p| p.exists()).unwrap_or(Path::new("."))
}

/// Bytes of memory that can be had without swapping, where the system says so.
fn available_memory() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|l| l.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kib| kib.saturating_mul(1024))
}
