//! Who works on whom: ids, `input`s, and the order of stages.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use super::outputs::{Outputs, unfit_name};
use super::{Plan, StageRef, occlusion, render, write};
use crate::pipeline::error::Invalid;
use crate::pipeline::overrides::TOP_KEYS;
use crate::pipeline::spec::{PipelineSpec, StageSpec};
use crate::pipeline::suggest;

/// A plan that grows stage by stage, with what is needed to resolve the next one.
pub(super) struct Resolver {
    pub plan: Plan,
    pub outputs: Outputs,
    /// The ids of earlier stages.
    ids: BTreeMap<String, StageRef>,
    /// The ids of all stages, to tell "later" from "unknown".
    all_ids: BTreeSet<String>,
}

pub(super) fn resolve(spec: &PipelineSpec, folder: PathBuf, out: Option<PathBuf>) -> Result<Plan, Invalid> {
    if let Some(reason) = unfit_name(&spec.name) {
        return Err(Invalid::new("name", format!("{reason}; the pipeline's name names its output folder")));
    }
    if spec.stages.is_empty() {
        return Err(Invalid::new("stages", "there are no stages; begin with a `scene`"));
    }
    let plan = Plan {
        name: spec.name.clone(),
        seed: spec.seed.unwrap_or(0),
        folder,
        out: out.unwrap_or_else(|| PathBuf::from("out").join(&spec.name)),
        order: Vec::new(),
        scenes: Vec::new(),
        occlusions: Vec::new(),
        renders: Vec::new(),
        writes: Vec::new(),
        figures: Vec::new(),
        warnings: Vec::new(),
    };
    let mut resolver =
        Resolver { plan, outputs: Outputs::default(), ids: BTreeMap::new(), all_ids: collect_ids(&spec.stages)? };
    for (i, stage) in spec.stages.iter().enumerate() {
        resolver.stage(&format!("stages[{i}].{}", stage.kind()), stage)?;
    }
    write::finish(&mut resolver.plan);
    Ok(resolver.plan)
}

/// Every written id, checked.
fn collect_ids(stages: &[StageSpec]) -> Result<BTreeSet<String>, Invalid> {
    let mut owners: BTreeMap<&str, usize> = BTreeMap::new();
    for (i, stage) in stages.iter().enumerate() {
        let Some(id) = stage.id() else { continue };
        let path = format!("stages[{i}].{}.id", stage.kind());
        let refuse = |message: String| Err(Invalid::new(&path, message));
        if id == "none" || TOP_KEYS.contains(&id) {
            return refuse(format!("`{id}` has a meaning of its own; choose another id"));
        }
        let plain = |c: char| c.is_alphanumeric() || c == '-' || c == '_';
        if id.is_empty() || id.len() > 100 || !id.chars().all(plain) {
            return refuse("an id is made of letters, digits, `-` and `_`, so that `--set` can name it".into());
        }
        if let Some(first) = owners.insert(id, i) {
            return refuse(format!("stages[{first}] is called `{id}` already"));
        }
    }
    Ok(owners.into_keys().map(str::to_owned).collect())
}

impl Resolver {
    fn stage(&mut self, path: &str, stage: &StageSpec) -> Result<(), Invalid> {
        let id = self.name_for(stage);
        let reference = match stage {
            StageSpec::Scene(spec) => {
                let scene = occlusion::scene(self, path, id, spec)?;
                push(&mut self.plan.scenes, scene, StageRef::Scene)
            }
            StageSpec::Occlusion(spec) => {
                let occlusion = occlusion::occlusion(self, path, id, spec)?;
                push(&mut self.plan.occlusions, occlusion, StageRef::Occlusion)
            }
            StageSpec::Render(spec) => {
                let render = render::render(self, path, id, spec)?;
                push(&mut self.plan.renders, render, StageRef::Render)
            }
            StageSpec::Write(spec) => {
                let write = write::write(self, path, id, spec)?;
                push(&mut self.plan.writes, write, StageRef::Write)
            }
            StageSpec::Paraview(spec) => {
                let figure = write::figure(self, path, id, spec)?;
                push(&mut self.plan.figures, figure, StageRef::Figure)
            }
        };
        self.plan.order.push(reference);
        if let Some(id) = stage.id() {
            self.ids.insert(id.to_owned(), reference);
        }
        Ok(())
    }

    /// The stage's id, or one made up from its kind: `render`, `render-2`, ...
    fn name_for(&self, stage: &StageSpec) -> String {
        if let Some(id) = stage.id() {
            return id.to_owned();
        }
        let kind = stage.kind();
        let earlier = self.plan.order.iter().filter(|s| s.kind() == kind).count();
        let numbered = |n: usize| if n == 1 { kind.to_owned() } else { format!("{kind}-{n}") };
        (earlier + 1..).map(numbered).find(|name| !self.all_ids.contains(name)).unwrap_or_default()
    }

    /// The earlier stage called `id`, as the key at `path` wants it; `wanted` is what may be named there.
    pub fn lookup(&self, path: &str, id: &str, wanted: &[&str]) -> Result<StageRef, Invalid> {
        match self.ids.get(id) {
            Some(stage) if wanted.contains(&stage.kind()) => Ok(*stage),
            Some(stage) => {
                let kinds = wanted.join(" or ");
                Err(Invalid::new(path, format!("`{id}` is a stage of kind {}; expected {kinds}", stage.kind())))
            }
            None if self.all_ids.contains(id) => {
                Err(Invalid::new(path, format!("`{id}` doesn't come before this stage; move it up")))
            }
            None => {
                let fitting = self.ids.iter().filter(|(_, stage)| wanted.contains(&stage.kind()));
                let message = format!("no earlier {} is called `{id}`", wanted.join(" or "));
                Err(Invalid::new(path, suggest::unknown(&message, id, fitting.map(|(name, _)| name.as_str()))))
            }
        }
    }

    /// The nearest earlier stage that `pick` takes.
    pub fn nearest(&self, pick: impl Fn(StageRef) -> Option<usize>) -> Option<usize> {
        self.plan.order.iter().rev().find_map(|&stage| pick(stage))
    }

    /// Notes something allowed but probably not meant.
    pub fn warn(&mut self, path: impl Into<String>, message: impl Into<String>) {
        self.plan.warnings.push(Invalid::new(path, message));
    }
}

fn push<T>(list: &mut Vec<T>, item: T, reference: fn(usize) -> StageRef) -> StageRef {
    list.push(item);
    reference(list.len() - 1)
}

impl StageSpec {
    /// The kind, as the pipeline's text names it.
    pub fn kind(&self) -> &'static str {
        match self {
            StageSpec::Scene(_) => "scene",
            StageSpec::Occlusion(_) => "occlusion",
            StageSpec::Render(_) => "render",
            StageSpec::Write(_) => "write",
            StageSpec::Paraview(_) => "paraview",
        }
    }

    /// The id, where one is written.
    pub fn id(&self) -> Option<&str> {
        match self {
            StageSpec::Scene(spec) => spec.id.as_deref(),
            StageSpec::Occlusion(spec) => spec.id.as_deref(),
            StageSpec::Render(spec) => spec.id.as_deref(),
            StageSpec::Write(spec) => spec.id.as_deref(),
            StageSpec::Paraview(spec) => spec.id.as_deref(),
        }
    }
}
