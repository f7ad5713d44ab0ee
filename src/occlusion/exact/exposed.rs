//! How much of a region is left when holes are taken out of it.
//!
//! The region is split along a hole's lines; the piece inside them all is dropped, and each other piece goes on with
//! those holes only that reach into it. Large holes come first, as they empty most. Where many holes crowd a region
//! it is halved first, so that the lines of one hole cut only what is near: the number of pieces then grows with the
//! holes, not with their square.

use super::polygon::{Hole, Region, Relation};
use crate::progress::Progress;

/// More holes than this in one region, and it is halved.
const CROWD: usize = 10;

/// Steps of work, of about a microsecond or less each, between two looks at whether to go on.
pub(super) const LOOK: usize = 1 << 12;

/// Why the sum isn't finished.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Spent {
    /// More pieces were asked for than the budget has.
    Budget,
    /// The work was cancelled.
    Cancelled,
}

/// Counts the pieces against a budget, and the work against the patience of whoever watches.
pub(super) struct Counter<'p> {
    pieces: usize,
    budget: usize,
    /// Steps since the last look.
    steps: usize,
    progress: &'p dyn Progress,
}

impl<'p> Counter<'p> {
    /// With so many pieces to spend.
    pub fn new(budget: usize, progress: &'p dyn Progress) -> Self {
        Self { pieces: 0, budget, steps: 0, progress }
    }

    /// One more piece, with so many holes that may reach into it.
    fn count(&mut self, holes: usize) -> Result<(), Spent> {
        self.pieces += 1;
        if self.pieces > self.budget {
            return Err(Spent::Budget);
        }
        self.look(1 + holes)
    }

    /// So many more steps of work.
    pub fn look(&mut self, steps: usize) -> Result<(), Spent> {
        self.steps += steps;
        if self.steps < LOOK {
            return Ok(());
        }
        self.steps = 0;
        if self.progress.cancelled() { Err(Spent::Cancelled) } else { Ok(()) }
    }
}

/// A region with the holes that may reach into it, and how many they were before it was last made smaller.
type Task<const D: usize> = (Region<D>, Vec<u32>, usize);

/// Hands over the pieces of a region outside all holes; these are brought into order of size.
pub(super) fn exposed<const D: usize>(
    region: Region<D>,
    holes: &mut [Hole<D>],
    counter: &mut Counter,
    mut piece: impl FnMut(&Region<D>),
) -> Result<(), Spent> {
    if region.is_flat() {
        return Ok(());
    }
    holes.sort_by(|a, b| b.measure().total_cmp(&a.measure()));
    // Not by recursion: where thousands of holes meet in one point the stack would not do.
    let mut tasks: Vec<Task<D>> = vec![(region, (0..holes.len() as u32).collect(), usize::MAX)];
    while let Some((region, mut candidates, before)) = tasks.pop() {
        counter.count(candidates.len())?;
        // The corners of half a sphere all lie on a line, and can't tell on which side of it they are meant to be.
        if region.is_nearly_half()
            && let Some(line) = region.bisector()
            && let (Some(behind), Some(ahead)) = region.split(&line)
        {
            tasks.push((behind, candidates.clone(), before));
            tasks.push((ahead, candidates, before));
            continue;
        }
        let mut covered = false;
        candidates.retain(|&candidate| {
            let relation = if covered { Relation::Apart } else { holes[candidate as usize].relation(&region) };
            covered |= relation == Relation::Within;
            relation == Relation::Overlapping
        });
        if covered {
            continue;
        }
        let Some((&first, rest)) = candidates.split_first() else {
            piece(&region);
            continue;
        };
        // Halving helps where the holes part, not where all of them meet.
        if candidates.len() > CROWD
            && candidates.len() < before - before / 8
            && let Some(line) = region.bisector()
            && let (Some(behind), Some(ahead)) = region.split(&line)
        {
            let crowd = candidates.len();
            tasks.push((behind, candidates.clone(), crowd));
            tasks.push((ahead, candidates, crowd));
            continue;
        }
        let mut inside = region;
        for line in holes[first as usize].lines() {
            let (outside, remaining) = inside.split(line);
            if let Some(outside) = outside {
                tasks.push((outside, rest.to_vec(), candidates.len()));
            }
            match remaining {
                Some(remaining) => inside = remaining,
                None => break,
            }
        }
    }
    Ok(())
}
