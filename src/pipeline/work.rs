//! Which files of a plan have to be made.

use std::path::Path;

use super::cache::{Cache, Keys};
use super::occlude::errors_file;
use super::plan::{Plan, WritePlan};
use super::prepare::sidecar_path;

/// For each write, and for each occlusion, whether its files are to be made.
#[derive(Clone, Debug)]
pub(super) struct Stale {
    pub vti: Vec<bool>,
    pub raw: Vec<bool>,
    pub png: Vec<bool>,
    pub vtu: Vec<bool>,
    pub occlusion: Vec<bool>,
}

impl Stale {
    pub fn new(plan: &Plan, keys: &Keys, cache: &Cache) -> Self {
        let of = |kind: &str, file: fn(&WritePlan) -> Option<&Path>| -> Vec<bool> {
            let stale = |w: &WritePlan| file(w).is_some_and(|f| !cache.is_fresh(f, &keys.file(w, kind)));
            plan.writes.iter().map(stale).collect()
        };
        // An occlusion file is whole with what stands beside it.
        let kept = |f: &Path, key: &str| cache.is_fresh(f, key) && cache.is_fresh(&sidecar_path(f), key);
        Self {
            vti: of("vti", |w| w.vti.as_deref()),
            raw: of("raw", |w| w.raw.as_deref()),
            png: of("png", |w| w.png.as_deref()),
            vtu: of("vtu", |w| w.vtu.as_deref()),
            occlusion: (plan.occlusions.iter().enumerate())
                .map(|(i, o)| {
                    let key = keys.occlusion(i);
                    o.file.as_deref().is_some_and(|f| !kept(f, key))
                        || errors_file(o).is_some_and(|f| !cache.is_fresh(&f, key))
                })
                .collect(),
        }
    }

    /// Whether any file has to be made, figures aside.
    pub fn anything(&self) -> bool {
        [&self.vti, &self.raw, &self.png, &self.vtu, &self.occlusion].into_iter().flatten().any(|&stale| stale)
    }

    /// Whether a render has to be made for the sake of some file.
    pub fn render(&self, plan: &Plan, render: usize) -> bool {
        let picture = |w: usize| self.vti[w] || self.raw[w] || self.png[w];
        (0..plan.writes.len()).any(|w| plan.writes[w].render == render && picture(w))
    }

    /// Whether anything has to be made of a scene.
    pub fn scene(&self, plan: &Plan, scene: usize) -> bool {
        let write = |w: usize| self.vti[w] || self.raw[w] || self.png[w] || self.vtu[w];
        (0..plan.writes.len()).any(|w| plan.renders[plan.writes[w].render].scene == scene && write(w))
            || (0..plan.occlusions.len()).any(|o| plan.occlusions[o].scene == scene && self.occlusion[o])
    }
}
