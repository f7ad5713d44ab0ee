//! Which files of a plan have to be made, and under which keys they will be remembered.

use std::path::Path;

use super::cache::{Cache, Keys};
use super::plan::{Plan, WritePlan};

/// For each write, and for each occlusion, whether its files are to be made.
#[derive(Clone, Debug)]
pub(super) struct Stale {
    pub vti: Vec<bool>,
    pub raw: Vec<bool>,
    pub png: Vec<bool>,
    pub vtu: Vec<bool>,
    pub occlusion: Vec<bool>,
}

/// The key of one of a write's files.
pub(super) fn file_key(keys: &Keys, write: &WritePlan, kind: &str) -> String {
    match kind {
        "vti" => keys.file(write.render, kind, &(&write.arrays, write.encoding, write.compression)),
        _ => keys.file(write.render, kind, &()),
    }
}

impl Stale {
    pub fn new(plan: &Plan, keys: &Keys, cache: &Cache) -> Self {
        let of = |kind: &str, file: fn(&WritePlan) -> Option<&Path>| -> Vec<bool> {
            let stale = |w: &WritePlan| file(w).is_some_and(|f| !cache.is_fresh(f, &file_key(keys, w, kind)));
            plan.writes.iter().map(stale).collect()
        };
        Self {
            vti: of("vti", |w| w.vti.as_deref()),
            raw: of("raw", |w| w.raw.as_deref()),
            png: of("png", |w| w.png.as_deref()),
            vtu: of("vtu", |w| w.vtu.as_deref()),
            occlusion: (plan.occlusions.iter().enumerate())
                .map(|(i, o)| o.file.as_deref().is_some_and(|f| !cache.is_fresh(f, keys.occlusion(i))))
                .collect(),
        }
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
