//! Images: which scene, which occlusion, from where, how large.

use super::resolve::Resolver;
use super::{MAX_DIMENSION, NO_SCENE, OcclusionSource, RenderPlan, StageRef, camera};
use crate::geometry::Dimension;
use crate::pipeline::error::Invalid;
use crate::pipeline::spec::{Method, RenderSpec, Shading};

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
    let published = |o: usize| match &resolver.plan.occlusions[o].source {
        OcclusionSource::Compute(computation) => computation.method == Method::AsPublished,
        OcclusionSource::Load(_) => false,
    };
    if shading == Shading::Voxel && occlusion.is_some_and(published) {
        let message = "`as_published` has values at vertices only; take `flat`, as the thesis did";
        return Err(Invalid::new(format!("{path}.shading"), message));
    }
    resolver.plan.scenes[scene].eye.get_or_insert_with(|| camera.eye.clone());
    let dimensions = dimensions(&format!("{path}.dimensions"), &spec.dimensions, dimension)?;
    let visibility = spec.visibility.unwrap_or_default();
    let (path, arrays) = (path.to_owned(), Vec::new());
    Ok(RenderPlan { id, path, scene, occlusion, camera, dimensions, shading, visibility, arrays })
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

fn dimensions(path: &str, given: &[u64], dimension: Dimension) -> Result<[usize; 3], Invalid> {
    let three = match (dimension, given) {
        (Dimension::Three, &[x, y]) | (Dimension::Three, &[x, y, 1]) => [x, y, 1],
        (Dimension::Four, &[x, y, z]) => [x, y, z],
        (Dimension::Three, _) => {
            let message = format!("expected [WIDTH, HEIGHT] for a 3D scene, found {given:?}");
            return Err(Invalid::new(path, message));
        }
        (Dimension::Four, _) => {
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

#[cfg(test)]
mod tests {
    use crate::pipeline::{Document, Pipeline};

    const SCENES: &str = "name: p
stages:
  - scene: {id: a, objects: []}
  - occlusion: {id: ao-a, file: a.f32}
  - scene: {id: b, dimension: 3, objects: []}
";

    fn pipeline(stages: &str) -> Result<Pipeline, String> {
        let document = Document::parse("p.yaml", &format!("{SCENES}{stages}")).unwrap();
        Pipeline::from_document(document, &[], None).map_err(|e| e.to_string())
    }

    /// The ids of what the last render shows and is darkened by, or the refusal without its place.
    fn resolved(stages: &str) -> String {
        match pipeline(stages) {
            Err(message) => message.split_once(": ").unwrap().1.to_owned(),
            Ok(Pipeline { plan, .. }) => {
                let render = plan.renders.last().unwrap();
                let occlusion = render.occlusion.map_or("none", |o| plan.occlusions[o].id.as_str());
                format!("{} {occlusion}", plan.scenes[render.scene].id)
            }
        }
    }

    #[test]
    fn scenes_and_occlusions_find_each_other() {
        let nearest = "stages[3].render: the nearest scene is `b`, but the nearest occlusion (`ao-a`) is of scene `a`; \
             say `occlusion: none`, or which by `input`";
        let foreign = "stages[3].render.occlusion: `ao-a` is the occlusion of scene `a`, and `input` shows scene `b`";
        for (render, expected) in [
            ("{dimensions: [2, 2]}", nearest),
            ("{dimensions: [2, 2], occlusion: none}", "b none"),
            ("{dimensions: [2, 2], input: b}", "b none"),
            ("{dimensions: [2, 2, 2], input: a}", "a ao-a"),
            ("{dimensions: [2, 2, 2], input: ao-a}", "a ao-a"),
            ("{dimensions: [2, 2, 2], occlusion: ao-a}", "a ao-a"),
            ("{dimensions: [2, 2, 2], input: ao-a, occlusion: none}", "a none"),
            ("{dimensions: [2, 2], input: b, occlusion: ao-a}", foreign),
        ] {
            assert_eq!(resolved(&format!("  - render: {render}\n")), expected, "{render}");
        }
        assert_eq!(resolved("  - occlusion: {}\n  - render: {dimensions: [2, 2, 1]}\n"), "b occlusion-2");
        assert_eq!(
            resolved("  - occlusion: {id: x, input: a}\n  - render: {dimensions: [2, 2, 2], input: a}\n"),
            "a x"
        );
    }

    #[test]
    fn a_render_gathers_what_its_files_need() {
        let plan = pipeline(
            "  - render: {id: r, input: a, dimensions: [2, 3, 4], camera: {eye: [0, 0, 0, 2]}}
  - render: {input: a, dimensions: [2, 3, 4], camera: {eye: [0, 0, 0, 3]}}
  - write: {input: r, raw: r.raw, arrays: [depth]}
  - write: {input: r, vti: r.vti, arrays: [opacity, rgba, normal]}
  - paraview: {input: r, state: vti.py}
  - paraview: {input: [r, r], state: raw.py, reader: raw}
",
        )
        .unwrap();
        let warnings: Vec<String> = plan.warnings().map(|w| w.to_string()).collect();
        let plan = plan.plan;
        let arrays: Vec<&str> = plan.renders[0].arrays.iter().map(|array| array.name()).collect();
        assert_eq!(arrays, ["rgba", "opacity", "rgb", "normal"]);
        assert_eq!((plan.figures[0].writes.as_slice(), plan.figures[1].writes.as_slice()), (&[1][..], &[0, 0][..]));
        assert_eq!(plan.scenes[0].eye, Some(vec![0.0, 0.0, 0.0, 2.0]), "the first render's");
        assert_eq!(plan.scenes[1].eye, None);
        assert_eq!(plan.writes.iter().map(|w| w.id.as_str()).collect::<Vec<_>>(), ["write", "write-2"]);
        let files: Vec<_> = plan.files().iter().map(|file| file.to_str().unwrap()).collect();
        assert_eq!(files, ["a.f32", "r.raw", "r.vti", "vti.py", "raw.py"]);
        assert!(
            warnings.iter().any(|w| w == "p.yaml:7:13: stages[4].render: no `write` stage writes this image"),
            "{warnings:?}"
        );
        assert!(warnings.iter().any(|w| w.ends_with("write.arrays: has no effect without `vti`")), "{warnings:?}");
    }
}
