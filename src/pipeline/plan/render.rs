//! Images: which scene, which occlusion, from where, how large.

use super::resolve::Resolver;
use super::{MAX_DIMENSION, NO_SCENE, OcclusionSource, RenderPlan, StageRef, camera};
use crate::pipeline::error::Invalid;
use crate::pipeline::spec::{RenderSpec, Shading};

pub(super) fn render(
    resolver: &mut Resolver,
    path: &str,
    id: String,
    spec: &RenderSpec,
) -> Result<RenderPlan, Invalid> {
    let (scene, occlusion) = scene_and_occlusion(resolver, path, spec)?;
    let dimension = resolver.plan.scenes[scene].dimension;
    let blank = Default::default();
    let camera_spec = spec.camera.as_ref().unwrap_or(&blank);
    let camera = camera::plan(camera_spec, &format!("{path}.camera"), dimension, &mut resolver.plan.warnings)?;
    let shading = spec.shading.unwrap_or_default();
    let loaded = |o: usize| matches!(resolver.plan.occlusions[o].source, OcclusionSource::Load(_));
    if shading == Shading::Voxel && occlusion.is_some_and(loaded) {
        let message = "`voxel` computes occlusion at the visible points, which a loaded file has no values for";
        return Err(Invalid::new(format!("{path}.shading"), message));
    }
    resolver.plan.scenes[scene].eye.get_or_insert_with(|| camera.eye.clone());
    let dimensions = dimensions(&format!("{path}.dimensions"), &spec.dimensions, dimension)?;
    Ok(RenderPlan { id, path: path.to_owned(), scene, occlusion, camera, dimensions, shading, arrays: Vec::new() })
}

/// What a render shows, and what darkens it. Named keys decide; what they leave open is the nearest earlier one; and
/// an occlusion of another scene is refused.
fn scene_and_occlusion(resolver: &Resolver, path: &str, spec: &RenderSpec) -> Result<(usize, Option<usize>), Invalid> {
    let plan = &resolver.plan;
    let input = match &spec.input {
        Some(name) => Some(resolver.lookup(&format!("{path}.input"), name, &["scene", "occlusion"])?),
        None => None,
    };
    let without = spec.occlusion.as_deref() == Some("none");
    let named = match spec.occlusion.as_deref() {
        None | Some("none") => None,
        Some(name) => StageRef::occlusion(resolver.lookup(&format!("{path}.occlusion"), name, &["occlusion"])?),
    };
    let scene = match (input, named) {
        (Some(StageRef::Scene(scene)), _) => scene,
        (Some(StageRef::Occlusion(occlusion)), _) => plan.occlusions[occlusion].scene,
        (_, Some(occlusion)) => plan.occlusions[occlusion].scene,
        _ => resolver.nearest(StageRef::scene).ok_or_else(|| Invalid::new(path, NO_SCENE))?,
    };
    if let Some(occlusion) = named {
        if plan.occlusions[occlusion].scene != scene {
            let message = format!(
                "`{}` is the occlusion of scene `{}`, and `input` shows scene `{}`",
                plan.occlusions[occlusion].id, plan.scenes[plan.occlusions[occlusion].scene].id, plan.scenes[scene].id
            );
            return Err(Invalid::new(format!("{path}.occlusion"), message));
        }
        return Ok((scene, named));
    }
    if without {
        return Ok((scene, None));
    }
    match input {
        Some(StageRef::Occlusion(occlusion)) => Ok((scene, Some(occlusion))),
        Some(_) => {
            let of_scene = |s: StageRef| s.occlusion().filter(|&o| plan.occlusions[o].scene == scene);
            Ok((scene, resolver.nearest(of_scene)))
        }
        None => match resolver.nearest(StageRef::occlusion) {
            Some(occlusion) if plan.occlusions[occlusion].scene != scene => {
                let message = format!(
                    "the nearest scene is `{}`, but the nearest occlusion (`{}`) is of scene `{}`; say `occlusion: none`, or which by `input`",
                    plan.scenes[scene].id,
                    plan.occlusions[occlusion].id,
                    plan.scenes[plan.occlusions[occlusion].scene].id
                );
                Err(Invalid::new(path, message))
            }
            occlusion => Ok((scene, occlusion)),
        },
    }
}

fn dimensions(path: &str, given: &[u64], dimension: usize) -> Result<[usize; 3], Invalid> {
    let three = match (dimension, given) {
        (3, &[x, y]) | (3, &[x, y, 1]) => [x, y, 1],
        (4, &[x, y, z]) => [x, y, z],
        (3, _) => {
            let message = format!("expected [WIDTH, HEIGHT] for a 3D scene, found {given:?}");
            return Err(Invalid::new(path, message));
        }
        _ => {
            let message = format!("expected [WIDTH, HEIGHT, DEPTH] for a 4D scene, found {given:?}");
            return Err(Invalid::new(path, message));
        }
    };
    for (i, &n) in three.iter().enumerate() {
        if !(1..=MAX_DIMENSION).contains(&n) {
            return Err(Invalid::new(format!("{path}[{i}]"), format!("expected 1 to {MAX_DIMENSION}, found {n}")));
        }
    }
    // 48 bits of voxels at most, 46 bytes each at most: fits 64 bits. Whether it fits memory and disk is for the run.
    let three = three.map(|n| usize::try_from(n).unwrap_or(usize::MAX));
    match three.iter().try_fold(64_usize, |bytes, &n| bytes.checked_mul(n)) {
        Some(_) => Ok(three),
        None => Err(Invalid::new(path, "more voxels than this computer can address")),
    }
}
