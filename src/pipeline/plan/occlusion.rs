//! Scenes, and the occlusion at their vertices: ranges, defaults, what they work on.

use std::path::Path;

use super::range::positive;
use super::resolve::Resolver;
use super::{
    Computation, MAX_CONES, MAX_OBJECTS, MAX_SAMPLES, NO_SCENE, OcclusionPlan, OcclusionSource, Samples, ScenePlan,
    StageRef,
};
use crate::geometry::Dimension;
use crate::occlusion::exact;
use crate::pipeline::error::Invalid;
use crate::pipeline::spec::{Method, OcclusionSpec, SceneSpec};
use crate::text::number;

pub(super) fn scene(resolver: &mut Resolver, path: &str, id: String, spec: &SceneSpec) -> Result<ScenePlan, Invalid> {
    let number = spec.dimension.unwrap_or(4);
    let Some(dimension) = Dimension::new(number) else {
        return Err(Invalid::new(format!("{path}.dimension"), format!("expected 3 or 4, found {number}")));
    };
    let objects = format!("{path}.objects");
    if spec.objects.is_empty() {
        resolver.warn(&objects, "the scene is empty; its images show background only");
    }
    if spec.objects.len() > MAX_OBJECTS {
        let message = format!("expected at most {MAX_OBJECTS} objects, found {}", spec.objects.len());
        return Err(Invalid::new(objects, message));
    }
    let mut names = std::collections::BTreeMap::new();
    for (i, object) in spec.objects.iter().enumerate() {
        let Some(name) = &object.name else { continue };
        if let Some(first) = names.insert(name, i) {
            let message = format!("objects[{first}] is called `{name}` already");
            return Err(Invalid::new(format!("{objects}[{i}].name"), message));
        }
    }
    Ok(ScenePlan { id, path: path.to_owned(), dimension, objects: spec.objects.clone(), eye: None })
}

pub(super) fn occlusion(
    resolver: &mut Resolver,
    path: &str,
    id: String,
    spec: &OcclusionSpec,
) -> Result<OcclusionPlan, Invalid> {
    let scene = match &spec.input {
        Some(name) => StageRef::scene(resolver.lookup(&format!("{path}.input"), name, &["scene"])?),
        None => resolver.nearest(StageRef::scene),
    };
    let scene = scene.ok_or_else(|| Invalid::new(path, NO_SCENE))?;
    // Checked also beside `load`, so that taking `load` out reveals no new mistakes.
    let computation = computation(path, spec, resolver)?;
    let source = match &spec.load {
        None => OcclusionSource::Compute(computation),
        Some(name) => {
            let key = format!("{path}.load");
            let file = resolver.plan.folder.join(name);
            match crate::input::length(&file) {
                Ok(_) if !name.is_empty() => {}
                Err(cause) if file.exists() => {
                    return Err(Invalid::new(key, format!("can't read {}: {cause}", file.display())));
                }
                _ => return Err(Invalid::new(key, format!("there is no file {}", file.display()))),
            }
            let unused: Vec<&str> = written(spec).collect();
            if !unused.is_empty() {
                resolver.warn(&key, format!("the values come from the file, so {} has no effect", unused.join(", ")));
            }
            OcclusionSource::Load(file)
        }
    };
    let file = match &spec.file {
        None => None,
        Some(name) => {
            let key = format!("{path}.file");
            let file = resolver.outputs.claim(&key, name, Some("f32"))?;
            resolver.outputs.claim(&key, &format!("{name}.yaml"), None)?;
            let errors = Path::new(name).with_extension("error.f32");
            resolver.outputs.claim(&key, &errors.to_string_lossy(), None)?;
            Some(file)
        }
    };
    Ok(OcclusionPlan { id, path: path.to_owned(), scene, source, file })
}

/// The keys about computing that are written.
fn written(spec: &OcclusionSpec) -> impl Iterator<Item = &'static str> {
    [
        ("method", spec.method.is_some()),
        ("samples", spec.samples.is_some()),
        ("target_error", spec.target_error.is_some()),
        ("max_samples", spec.max_samples.is_some()),
        ("max_cones", spec.max_cones.is_some()),
        ("max_distance", spec.max_distance.is_some()),
        ("seed", spec.seed.is_some()),
    ]
    .into_iter()
    .filter_map(|(key, given)| given.then_some(key))
}

fn computation(path: &str, spec: &OcclusionSpec, resolver: &mut Resolver) -> Result<Computation, Invalid> {
    let refuse = |key: &str, message: String| Err(Invalid::new(format!("{path}.{key}"), message));
    let method = spec.method.unwrap_or_default();
    let count = |key: &str, n: u64| match n {
        1..=MAX_SAMPLES => Ok(n),
        _ => refuse(key, format!("expected 1 to {MAX_SAMPLES} samples, found {n}")).map(|_: Computation| 0),
    };
    let samples = match (spec.samples, spec.target_error) {
        (Some(_), Some(_)) => return refuse("target_error", "stands beside `samples`; give one of the two".into()),
        (Some(n), None) => Samples::Fixed(count("samples", n)?),
        (None, None) => Samples::Fixed(256),
        (None, Some(error)) => {
            if !(error > 0.0 && error < 1.0) {
                return refuse(
                    "target_error",
                    format!("expected an error above 0 and below 1, found {}", number(error)),
                );
            }
            Samples::Target { error, max_samples: count("max_samples", spec.max_samples.unwrap_or(65_536))? }
        }
    };
    if let (Some(n), Samples::Fixed(_)) = (spec.max_samples, samples) {
        count("max_samples", n)?;
        resolver.warn(format!("{path}.max_samples"), "has no effect without `target_error`");
    }
    let samples = if method == Method::Exact {
        if spec.samples.is_some() || spec.target_error.is_some() {
            resolver.warn(path, "`exact` takes no samples, so `samples` and `target_error` have no effect");
        }
        Samples::Exact
    } else {
        samples
    };
    if method == Method::AsPublished && spec.target_error.is_some() {
        return refuse("target_error", "`as_published` aims at no error, which it doesn't know; give `samples`".into());
    }
    let max_cones = match spec.max_cones {
        None => exact::Budget::default().cones as u64,
        Some(n @ 1..=MAX_CONES) => n,
        Some(n) => return refuse("max_cones", format!("expected 1 to {MAX_CONES} cones, found {n}")),
    };
    if spec.max_cones.is_some() && method != Method::Exact {
        resolver.warn(format!("{path}.max_cones"), "has no effect without `method: exact`");
    }
    if spec.max_distance.is_some() && matches!(method, Method::Exact | Method::Adaptive) {
        let method = method.as_str();
        return refuse(
            "max_distance",
            format!("`{method}` counts hits at all distances; leave this out, or use `method: sobol`"),
        );
    }
    let distance = spec.max_distance.map(|d| positive(&format!("{path}.max_distance"), d));
    let seed = spec.seed.unwrap_or(resolver.plan.seed);
    Ok(Computation { method, samples, max_cones, max_distance: distance.transpose()?, seed })
}

impl Method {
    /// As the pipeline names it.
    pub fn as_str(self) -> &'static str {
        match self {
            Method::Sobol => "sobol",
            Method::Random => "random",
            Method::Adaptive => "adaptive",
            Method::Exact => "exact",
            Method::AsPublished => "as_published",
        }
    }
}
