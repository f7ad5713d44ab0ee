//! What pipelines of a sweep share: scenes with their hierarchies, and ambient occlusion at all vertices.
//!
//! A run leaves here what it made, under the keys that tell whether files are fresh, and the next run takes what has the key
//! that its own would have. So nothing can be taken for something that it isn't.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::occlusion::Estimates;
use crate::session::Session;
use crate::stages::SceneRun;
use crate::stages::occlusion::OcclusionPlan;
use crate::stages::{Keys, Plan, Ref};

/// Scenes and their values, from one run to the next.
#[derive(Debug, Default)]
pub struct Shared {
    three: BTreeMap<String, Kept<3>>,
    four: BTreeMap<String, Kept<4>>,
}

/// A scene that is kept.
#[derive(Debug)]
pub(super) struct Kept<const D: usize> {
    pub session: Session<D>,
    /// What was told of its objects.
    pub notes: Vec<String>,
    /// The values of each occlusion, by its key.
    values: BTreeMap<String, Arc<Estimates>>,
}

/// The scenes of one dimension.
pub(super) trait Scenes<const D: usize> {
    fn scenes(&mut self) -> &mut BTreeMap<String, Kept<D>>;
}

impl Scenes<3> for Shared {
    fn scenes(&mut self) -> &mut BTreeMap<String, Kept<3>> {
        &mut self.three
    }
}

impl Scenes<4> for Shared {
    fn scenes(&mut self) -> &mut BTreeMap<String, Kept<4>> {
        &mut self.four
    }
}

impl Shared {
    /// Whether a scene with this key is here.
    pub(super) fn has(&self, key: &str) -> bool {
        self.three.contains_key(key) || self.four.contains_key(key)
    }
}

/// Occlusions of a scene whose values are known at every vertex once they are computed, not only where pictures look.
fn whole<'p>(plan: &'p Plan, scene: usize) -> impl Iterator<Item = Ref<OcclusionPlan>> + 'p {
    let all = plan.all::<OcclusionPlan>().filter(move |(_, o)| o.scene.index() == scene && o.file.is_some());
    all.map(|(me, _)| me).collect::<Vec<_>>().into_iter()
}

impl<const D: usize> Kept<D> {
    /// A scene with the values that are known for this plan.
    pub fn at_work(&self, plan: &Plan, keys: &Keys, scene: usize) -> SceneRun<D> {
        let mut run = SceneRun::new(self.session.clone());
        for me in whole(plan, scene) {
            if let Some(values) = self.values.get(keys.of(me.index())) {
                run.values.insert(me, Arc::clone(values));
            }
        }
        run
    }

    /// Keeps what a run found.
    pub fn keep(
        into: &mut BTreeMap<String, Self>,
        (plan, keys, scene): (&Plan, &Keys, usize),
        run: &SceneRun<D>,
        notes: Vec<String>,
    ) {
        let blank = || Self { session: run.session.clone(), notes, values: BTreeMap::new() };
        let kept = into.entry(keys.of(scene).to_owned()).or_insert_with(blank);
        for me in whole(plan, scene) {
            if let Some(values) = run.values.get(&me) {
                kept.values.insert(keys.of(me.index()).to_owned(), Arc::clone(values));
            }
        }
    }
}
