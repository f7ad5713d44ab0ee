//! What a stage shows: a scene, and the occlusion that darkens it.

use super::occlusion::OcclusionPlan;
use super::scene::{MISSING, ScenePlan};
use super::{Invalid, Ref, Resolver, Stage};

/// The scene and the occlusion that a stage's `input` and `occlusion` mean. Named keys decide; what they leave open is the
/// nearest earlier one; and an occlusion of another scene is refused.
pub(super) fn scene_and_occlusion(
    resolver: &Resolver,
    path: &str,
    input: Option<&str>,
    occlusion: Option<&str>,
) -> Result<(Ref<ScenePlan>, Option<Ref<OcclusionPlan>>), Invalid> {
    let plan = &resolver.plan;
    let (mut of_scene, mut of_occlusion) = (None, None);
    if let Some(name) = input {
        let input = resolver.lookup(&format!("{path}.input"), name, &[ScenePlan::KIND, OcclusionPlan::KIND])?;
        (of_scene, of_occlusion) = (plan.reference::<ScenePlan>(input), plan.reference::<OcclusionPlan>(input));
    }
    let named: Option<Ref<OcclusionPlan>> = match occlusion {
        None | Some("none") => None,
        Some(name) => plan.reference(resolver.lookup(&format!("{path}.occlusion"), name, &[OcclusionPlan::KIND])?),
    };
    let scene = match (of_scene, of_occlusion.or(named)) {
        (Some(scene), _) => scene,
        (None, Some(occlusion)) => plan[occlusion].scene,
        (None, None) => resolver.nearest(|_| true).ok_or_else(|| Invalid::new(path, MISSING))?,
    };
    if let Some(occlusion) = named {
        let other = plan[occlusion].scene;
        if other != scene {
            let message = format!(
                "`{}` is the occlusion of scene `{}`, and `input` shows scene `{}`",
                plan.id(occlusion),
                plan.id(other),
                plan.id(scene)
            );
            return Err(Invalid::new(format!("{path}.occlusion"), message));
        }
        return Ok((scene, named));
    }
    if occlusion.is_some() {
        return Ok((scene, None));
    }
    if of_occlusion.is_some() {
        return Ok((scene, of_occlusion));
    }
    if of_scene.is_some() {
        return Ok((scene, resolver.nearest(|occlusion: Ref<OcclusionPlan>| plan[occlusion].scene == scene)));
    }
    match resolver.nearest(|_: Ref<OcclusionPlan>| true) {
        Some(occlusion) if plan[occlusion].scene != scene => {
            let message = format!(
                "the nearest scene is `{}`, but the nearest occlusion (`{}`) is of scene `{}`; say `occlusion: none`, or which by `input`",
                plan.id(scene),
                plan.id(occlusion),
                plan.id(plan[occlusion].scene)
            );
            Err(Invalid::new(path, message))
        }
        occlusion => Ok((scene, occlusion)),
    }
}
