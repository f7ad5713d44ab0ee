//! Who works on whom: ids, `input`s, and the order of stages.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use super::names::{Outputs, unfit_name};
use super::{Invalid, Plan, Planned, Ref, Stage, StagePlan, StageSpec, suggest};

/// Words that stand for the pipeline's own keys where a stage is named, and for no occlusion.
const RESERVED: [&str; 5] = ["name", "seed", "stages", "none", super::screen_space::WORD];

/// A plan that grows stage by stage, with what is needed to resolve the next one.
pub struct Resolver {
    /// The stages so far.
    pub plan: Plan,
    /// The names of their files.
    pub(super) outputs: Outputs,
    /// The places of earlier stages with an id.
    ids: BTreeMap<String, usize>,
    /// The ids of all stages, to tell "later" from "unknown".
    all_ids: BTreeSet<String>,
}

impl Plan {
    /// Checks and resolves a pipeline. `folder` is where its inputs are, `out` where its outputs go (default
    /// `out/NAME`).
    ///
    /// # Errors
    /// Whatever can be refused without reading inputs.
    pub fn new(
        name: &str,
        seed: u64,
        stages: &[StageSpec],
        folder: PathBuf,
        out: Option<PathBuf>,
    ) -> Result<Plan, Invalid> {
        if let Some(reason) = unfit_name(name) {
            return Err(Invalid::new("name", format!("{reason}; the pipeline's name names its output folder")));
        }
        if stages.is_empty() {
            return Err(Invalid::new("stages", "there are no stages; begin with a `scene`"));
        }
        let out = out.unwrap_or_else(|| PathBuf::from("out").join(name));
        let plan =
            Plan { name: name.to_owned(), seed, folder, out, stages: Vec::new(), warnings: Vec::new(), piece: None };
        let (ids, all_ids) = (BTreeMap::new(), collect_ids(stages)?);
        let mut resolver = Resolver { plan, outputs: Outputs::default(), ids, all_ids };
        for (i, stage) in stages.iter().enumerate() {
            resolver.stage(format!("stages[{i}].{}", stage.kind()), stage)?;
        }
        let Resolver { mut plan, .. } = resolver;
        for index in (0..plan.stages.len()).filter(|&index| !plan.is_twin(index)).collect::<Vec<_>>() {
            if let Some(message) = plan.unused(index) {
                plan.warnings.push(Invalid::new(&plan.stages[index].path, message));
            }
        }
        Ok(plan)
    }
}

/// Every written id, checked.
fn collect_ids(stages: &[StageSpec]) -> Result<BTreeSet<String>, Invalid> {
    let mut owners: BTreeMap<&str, usize> = BTreeMap::new();
    for (i, stage) in stages.iter().enumerate() {
        let Some(id) = stage.id() else { continue };
        let path = format!("stages[{i}].{}.id", stage.kind());
        let refuse = |message: String| Err(Invalid::new(&path, message));
        if RESERVED.contains(&id) {
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
    fn stage(&mut self, path: String, stage: &StageSpec) -> Result<(), Invalid> {
        let id = self.name_for(stage);
        let plan = stage.resolve(&path, self)?;
        self.twin(&id, &path, stage, &plan)?;
        if let Some(id) = stage.id() {
            self.ids.insert(id.to_owned(), self.plan.stages.len());
        }
        self.plan.stages.push(Planned { id, path, plan, twin: false });
        Ok(())
    }

    /// Puts a stage's twin before it, if it has one.
    fn twin(&mut self, id: &str, path: &str, stage: &StageSpec, plan: &StagePlan) -> Result<(), Invalid> {
        let twin_of = |index| Some(self.plan.stages[self.twin_of(index)?].id.clone());
        let Some((id, twin)) = stage.twin(id, plan, path, twin_of)? else { return Ok(()) };
        if self.all_ids.contains(&id) || self.ids.contains_key(&id) {
            let message = format!("the stage's twin would be called `{id}`, as another is; give that another id");
            return Err(Invalid::new(path, message));
        }
        // What is to be said of the stage was said of itself.
        let warnings = self.plan.warnings.len();
        let plan = twin.resolve(path, self)?;
        self.plan.warnings.truncate(warnings);
        self.ids.insert(id.clone(), self.plan.stages.len());
        self.plan.stages.push(Planned { id, path: path.to_owned(), plan, twin: true });
        Ok(())
    }

    /// The place of the twin of the stage at a place, if it has one.
    pub(super) fn twin_of(&self, index: usize) -> Option<usize> {
        self.plan.twin_of(index)
    }

    /// The stage's id, or one made up from its kind: `render`, `render-2`, ...
    fn name_for(&self, stage: &StageSpec) -> String {
        if let Some(id) = stage.id() {
            return id.to_owned();
        }
        let kind = stage.kind();
        let own = |&index: &usize| self.plan.kind(index) == kind && !self.plan.is_twin(index);
        let earlier = (0..self.plan.stages.len()).filter(own).count();
        let numbered = |n: usize| if n == 1 { kind.to_owned() } else { format!("{kind}-{n}") };
        (earlier + 1..).map(numbered).find(|name| !self.all_ids.contains(name)).unwrap_or_default()
    }

    /// The place of the earlier stage called `id`, as the key at `path` wants it; `wanted` is what may be named there.
    ///
    /// # Errors
    /// If there is none, or one of another kind.
    pub fn lookup(&self, path: &str, id: &str, wanted: &[&str]) -> Result<usize, Invalid> {
        let fits = |index: usize| wanted.contains(&self.plan.kind(index));
        let kinds = wanted.join(" or ");
        match self.ids.get(id) {
            Some(&index) if fits(index) => Ok(index),
            Some(&index) => {
                let kind = self.plan.kind(index);
                Err(Invalid::new(path, format!("`{id}` is a stage of kind {kind}; expected {kinds}")))
            }
            None if self.all_ids.contains(id) => {
                Err(Invalid::new(path, format!("`{id}` doesn't come before this stage; move it up")))
            }
            None => {
                let fitting = self.ids.iter().filter(|(_, index)| fits(**index));
                let message = format!("no earlier {kinds} is called `{id}`");
                Err(Invalid::new(path, suggest::unknown(&message, id, fitting.map(|(name, _)| name.as_str()))))
            }
        }
    }

    /// The earlier stage of a kind that the key `input` names, or the nearest one.
    ///
    /// # Errors
    /// If it names none of that kind, or if there is none, which `missing` then says.
    pub fn input<T: Stage>(&self, path: &str, named: Option<&str>, missing: &str) -> Result<Ref<T>, Invalid> {
        let found = match named {
            Some(name) => self.plan.reference(self.lookup(&format!("{path}.input"), name, &[T::KIND])?),
            None => self.nearest(|_: Ref<T>| true),
        };
        found.ok_or_else(|| Invalid::new(path, missing))
    }

    /// The nearest earlier stage of a kind that fits.
    pub fn nearest<T: Stage>(&self, fits: impl Fn(Ref<T>) -> bool) -> Option<Ref<T>> {
        self.plan.all::<T>().rev().map(|(stage, _)| stage).find(|&stage| fits(stage))
    }

    /// Notes something allowed but probably not meant.
    pub fn warn(&mut self, path: impl Into<String>, message: impl Into<String>) {
        self.plan.warnings.push(Invalid::new(path, message));
    }
}
