//! The book of a run's files: which have to be made, which were, and what is told of them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::cache::{self, Cache, MadeBy};
use super::pieces;
use super::report::{FileReport, Report};
use crate::io;
use crate::stages::scene::ScenePlan;
use crate::stages::{Keys, Ledger, Made, Output, Plan, Ref, piece};

/// What is known of a run's files.
pub(super) struct Book {
    cache: Cache,
    /// The outputs of each stage.
    outputs: Vec<Vec<Output>>,
    /// The key of each file.
    keys: BTreeMap<PathBuf, String>,
    stale: BTreeSet<PathBuf>,
    made_by: MadeBy,
    /// What is told of the scene that is worked on.
    scene_notes: Vec<String>,
    report: Report,
}

impl Book {
    /// Looks at what earlier runs left. With `force` all has to be made again.
    pub fn open(plan: &Plan, keys: &Keys, made_by: MadeBy, force: bool) -> Self {
        let outputs: Vec<_> = (0..plan.stages.len()).map(|stage| plan.left(stage, keys)).collect();
        sweep(plan, outputs.iter().flatten());
        let cache = Cache::open(&plan.out, force);
        let (mut known, mut stale) = (BTreeMap::new(), BTreeSet::new());
        for Output { file, beside, key, .. } in outputs.iter().flatten() {
            let all = || std::iter::once(file).chain(beside);
            if !all().all(|file| cache.is_fresh(file, key)) {
                stale.insert(file.clone());
            }
            known.extend(all().map(|file| (file.clone(), key.clone())));
        }
        let report = Report { out: plan.out.clone(), ..Report::default() };
        Self { cache, outputs, keys: known, stale, made_by, scene_notes: Vec::new(), report }
    }

    /// Whether any file has to be made, figures aside.
    pub fn anything(&self) -> bool {
        !self.stale.is_empty()
    }

    /// Lets those files that are as they were, but for what they tell of the pipeline, tell what it is now.
    ///
    /// # Errors
    /// If one can't be read or written.
    pub fn retell(&mut self, plan: &Plan, text: &str) -> Result<(), io::Error> {
        for (stage, outputs) in self.outputs.iter().enumerate() {
            for Output { file, key, tells, .. } in outputs.iter().filter(|output| !self.stale.contains(&output.file)) {
                if let Some(tells) = tells.as_ref().filter(|file| !self.cache.tells(file, &self.made_by.told)) {
                    plan.retell(stage, file, text)?;
                    let notes = self.cache.notes(tells).to_vec();
                    self.cache.record(tells, key, notes, &self.made_by)?;
                }
            }
        }
        Ok(())
    }

    /// Whether anything has to be made of a scene.
    pub fn needs(&self, plan: &Plan, scene: Ref<ScenePlan>) -> bool {
        let of_scene = |stage: &usize| plan.scene_of(*stage) == Some(scene);
        let mut outputs = (0..self.outputs.len()).filter(of_scene).flat_map(|stage| &self.outputs[stage]);
        outputs.any(|output| self.stale.contains(&output.file))
    }

    /// Whether any file of a stage has to be made.
    pub fn needs_stage(&self, stage: usize) -> bool {
        self.outputs[stage].iter().any(|output| self.stale.contains(&output.file))
    }

    /// From here on files are made of this scene, of which this is to be told.
    pub fn begin_scene(&mut self, notes: Vec<String>) {
        self.tell(&notes);
        self.scene_notes = notes;
    }

    /// Tells this of the run, unless it was told before.
    pub fn tell(&mut self, notes: &[String]) {
        for note in notes {
            if !self.report.notes.contains(note) {
                self.report.notes.push(note.clone());
            }
        }
    }

    /// Reports those files of a stage that are as they were, with what was told when they were made.
    pub fn tell_unchanged(&mut self, plan: &Plan, stage: usize) {
        let fresh = self.outputs[stage].iter().filter(|output| !self.stale.contains(&output.file));
        for path in fresh.map(|output| output.file.clone()).collect::<Vec<_>>() {
            let notes = self.cache.notes(&path).to_vec();
            self.tell(&notes);
            let bytes = std::fs::metadata(plan.out.join(&path)).map_or(0, |m| m.len());
            self.report.files.push(FileReport { path, bytes, cached: true });
        }
    }

    /// What was written here.
    pub fn report(self) -> Report {
        self.report
    }
}

impl Ledger for Book {
    fn is_stale(&self, file: &Path) -> bool {
        self.stale.contains(file) || self.stale.contains(&piece::stand_in(file))
    }

    fn record(&mut self, made: Made) -> Result<(), io::Error> {
        let Made { file, bytes, notes, named, unchanged } = made;
        self.tell(&notes);
        if let Some(key) = self.keys.get(file).filter(|_| !unchanged) {
            let told = self.scene_notes.iter().chain(&notes).cloned().collect();
            self.cache.record(file, key, told, &self.made_by)?;
        }
        if named {
            self.report.files.push(FileReport { path: file.to_owned(), bytes, cached: unchanged });
        }
        Ok(())
    }

    fn forget(&mut self, file: &Path) -> Result<(), io::Error> {
        self.cache.forget(file)
    }
}

/// Takes away what a run left half-written that was killed. The folder is locked, so nobody else is writing these.
fn sweep<'a>(plan: &Plan, outputs: impl Iterator<Item = &'a Output>) {
    let own = (0..plan.stages.len()).flat_map(|stage| plan.all_files_of(stage));
    let left = outputs.flat_map(|output| std::iter::once(&output.file).chain(&output.beside)).cloned();
    let mut names: BTreeMap<PathBuf, BTreeSet<String>> = BTreeMap::new();
    for file in own.chain(left).chain([PathBuf::from(cache::NAME), PathBuf::from(pieces::NAME)]) {
        let path = plan.out.join(file);
        let (Some(folder), Some(name)) = (path.parent(), path.file_name()) else { continue };
        names.entry(folder.to_owned()).or_default().insert(name.to_string_lossy().into_owned());
    }
    for (folder, names) in names {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let found = entry.file_name().to_string_lossy().into_owned();
            let inner = found.strip_prefix('.').and_then(|rest| rest.strip_suffix(".partial"));
            // The random part is behind the last dot, so that `.a.vti.x.partial` is not taken for one of `a`.
            let own = inner.and_then(|inner| inner.rsplit_once('.')).is_some_and(|(name, _)| names.contains(name));
            if own && entry.file_type().is_ok_and(|t| t.is_file()) {
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }
}
