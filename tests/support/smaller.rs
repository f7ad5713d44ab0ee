//! The shipped pipelines, and what makes them quick to run.

use std::path::{Path, PathBuf};

use ao4d::geometry::Dimension;
use ao4d::pipeline::Pipeline;
use ao4d::scene::OneOrEach;
use ao4d::stages::animate::AnimatePlan;
use ao4d::stages::occlusion::{OcclusionPlan, OcclusionSource, Samples};
use ao4d::stages::render::RenderPlan;
use ao4d::stages::scene::ScenePlan;

/// All `.yaml` files below `pipelines/`.
pub fn pipelines() -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "yaml") {
                found.push(path);
            }
        }
    }
    assert!(found.len() >= 10, "{found:?}");
    found.sort();
    found
}

/// Cells of an isosurface that is coarse enough for tests.
const CELLS: u32 = 14;

/// Overrides that make images of a pipeline smaller, its films shorter, its rays fewer and its isosurfaces coarser. Every stage still
/// does its work.
pub fn smaller(path: &Path) -> Vec<String> {
    let plan = Pipeline::load(path, &[], None).unwrap().plan;
    let mut overrides = Vec::new();
    for (stage, scene) in plan.all::<ScenePlan>() {
        for (i, object) in scene.objects.iter().enumerate() {
            let Some(isosurface) = &object.isosurface else { continue };
            let Some(OneOrEach::One(cells @ CELLS..)) = isosurface.grid.as_ref().map(|grid| &grid.cells) else {
                continue;
            };
            let coarse = if scene.dimension == Dimension::Three { cells / 2 } else { CELLS };
            let object = format!("{}.objects[{i}].isosurface", plan.path(stage));
            overrides.push(format!("{object}.grid.cells={coarse}"));
            if let Some(component) = isosurface.smallest_component {
                overrides.push(format!("{object}.smallest_component={}", component / 8));
            }
        }
    }
    for (stage, render) in plan.all::<RenderPlan>() {
        let flat = plan[render.scene].dimension == Dimension::Three;
        let most = if flat { 120 } else { 36 };
        let longest = render.dimensions.into_iter().fold(most, usize::max);
        // No axis is lost: an image of two layers keeps both.
        let [x, y, z] = render.dimensions.map(|d| (d * most / longest).max(d.min(2)));
        let dimensions = if flat { format!("[{x}, {y}]") } else { format!("[{x}, {y}, {z}]") };
        overrides.push(format!("{}.dimensions={dimensions}", plan.path(stage)));
    }
    for (stage, animation) in plan.all::<AnimatePlan>() {
        overrides.push(format!("{}.frames={}", plan.path(stage), animation.files.len().min(3)));
    }
    for (stage, occlusion) in plan.all::<OcclusionPlan>() {
        if let OcclusionSource::Compute(computation) = &occlusion.source
            && let Samples::Fixed(17..) = computation.samples
        {
            overrides.push(format!("{}.samples=16", plan.path(stage)));
        }
    }
    overrides
}
