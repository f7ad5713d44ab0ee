//! A pipeline as understood: its stages in order, and how they refer to each other.

use std::cmp::Ordering;
use std::fmt;
use std::marker::PhantomData;
use std::ops::Index;
use std::path::{Path, PathBuf};

use serde::{Serialize, Serializer};

use super::{Invalid, Piece, Stage, StagePlan};

/// Everything a run needs to know.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The pipeline's name, fit to be a folder's.
    pub name: String,
    /// What random numbers start from, unless a stage has its own.
    pub seed: u64,
    /// Where relative paths of inputs start.
    pub folder: PathBuf,
    /// Where the outputs go.
    pub out: PathBuf,
    /// The stages, in the order they were written.
    pub stages: Vec<Planned>,
    /// What is allowed but probably not meant.
    pub warnings: Vec<Invalid>,
    /// The piece of the run that this is the plan of, if not of all; `out` is its own folder then.
    pub piece: Option<Piece>,
}

/// A stage of a plan. Id and path are no part of any key: they name the stage, in the pipeline and in messages.
#[derive(Clone, Debug)]
pub struct Planned {
    /// Its own id, or one made up; unique.
    pub id: String,
    /// Where it is written, for complaints: `stages[0].scene`.
    pub path: String,
    /// What it does.
    pub plan: StagePlan,
    /// Whether it is the twin in 3D of the next stage, and not written itself.
    pub twin: bool,
}

/// A stage's plan taken out of the sum of all kinds.
pub trait OfKind: Sized + 'static {
    /// The plan, if it is of this kind.
    fn of_kind(stage: &StagePlan) -> Option<&Self>;

    /// The same, to be changed.
    fn of_kind_mut(stage: &mut StagePlan) -> Option<&mut Self>;
}

/// A stage of a known kind, by its place in a plan. As JSON it is its number among those of its kind.
pub struct Ref<T> {
    index: usize,
    nth: usize,
    kind: PhantomData<fn() -> T>,
}

impl<T> Ref<T> {
    /// Its place among all stages.
    pub fn index(self) -> usize {
        self.index
    }

    /// Its place among those of its kind.
    pub fn nth(self) -> usize {
        self.nth
    }
}

impl<T> Clone for Ref<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Ref<T> {}

impl<T> PartialEq for Ref<T> {
    fn eq(&self, other: &Self) -> bool {
        self.index == other.index
    }
}

impl<T> Eq for Ref<T> {}

impl<T> PartialOrd for Ref<T> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<T> Ord for Ref<T> {
    fn cmp(&self, other: &Self) -> Ordering {
        self.index.cmp(&other.index)
    }
}

impl<T> fmt::Debug for Ref<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "stages[{}]", self.index)
    }
}

impl<T> Serialize for Ref<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.nth.serialize(serializer)
    }
}

impl Plan {
    /// The stages of a kind, in order, with what refers to them.
    pub fn all<T: Stage>(&self) -> impl DoubleEndedIterator<Item = (Ref<T>, &T)> {
        let of_kind =
            self.stages.iter().enumerate().filter_map(|(index, stage)| Some((index, T::of_kind(&stage.plan)?)));
        let found: Vec<(usize, &T)> = of_kind.collect();
        let with_ref = |(nth, (index, plan))| (Ref { index, nth, kind: PhantomData }, plan);
        found.into_iter().enumerate().map(with_ref)
    }

    /// The stage at this place, if it is of this kind.
    pub fn reference<T: Stage>(&self, index: usize) -> Option<Ref<T>> {
        T::of_kind(&self.stages.get(index)?.plan)?;
        Some(self.at(index))
    }

    /// What refers to the stage at this place, of which it is known that it is of this kind.
    pub(super) fn at<T: Stage>(&self, index: usize) -> Ref<T> {
        let nth = self.stages[..index].iter().filter(|stage| T::of_kind(&stage.plan).is_some()).count();
        Ref { index, nth, kind: PhantomData }
    }

    /// A stage's plan, to be changed.
    pub(super) fn get_mut<T: Stage>(&mut self, stage: Ref<T>) -> Option<&mut T> {
        T::of_kind_mut(&mut self.stages[stage.index].plan)
    }

    /// A stage's id.
    pub fn id<T>(&self, stage: Ref<T>) -> &str {
        &self.stages[stage.index].id
    }

    /// Where a stage is written, for complaints.
    pub fn path<T>(&self, stage: Ref<T>) -> &str {
        &self.stages[stage.index].path
    }

    /// All files below `out` that a stage may write, named by the pipeline or not.
    pub fn all_files_of(&self, index: usize) -> Vec<PathBuf> {
        let named = self.files_of(index).into_iter().map(Path::to_owned);
        named.chain(self.files_beside(index)).collect()
    }

    /// The same plan for a piece of the run.
    pub fn in_piece(&self, piece: Piece) -> Self {
        Self { out: piece.folder(&self.out), piece: Some(piece), ..self.clone() }
    }

    /// Every file that the pipeline names in `out`, in the order of the stages.
    pub fn files(&self) -> Vec<&Path> {
        (0..self.stages.len()).flat_map(|index| self.files_of(index)).collect()
    }
}

impl<T: Stage> Index<Ref<T>> for Plan {
    type Output = T;

    fn index(&self, stage: Ref<T>) -> &T {
        match T::of_kind(&self.stages[stage.index].plan) {
            Some(plan) => plan,
            None => unreachable!("{stage:?} is no {}", T::KIND),
        }
    }
}
