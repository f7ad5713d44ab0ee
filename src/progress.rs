//! How long work is told, and stopped, from outside.
//!
//! Occlusion and rendering can take minutes. They report through this small trait, which the caller implements: the
//! program as a bar on a terminal, a test as a counter, most callers as [`Silent`]. The same trait carries the wish to
//! stop, so that a loop that reports progress also hears Ctrl-C, at most one batch of work later. Nothing here may
//! change a result: the bytes written are the same whoever watches.

use std::time::{Duration, Instant};

/// Who watches a piece of work. Methods take `&self` and are called from many threads at once.
pub trait Progress: Sync {
    /// A stage begins that consists of `total` steps (vertices, voxels, bytes); 0 where the number isn't known.
    fn begin(&self, stage: &str, total: u64);

    /// `steps` more steps of the current stage are done. Call it once a batch, not once a step.
    fn advance(&self, steps: u64);

    /// The current stage ended, whether done or given up.
    fn end(&self);

    /// Whether the work is to stop as soon as it can; ask once a batch.
    fn cancelled(&self) -> bool {
        false
    }
}

/// Watches nothing and never cancels.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, _steps: u64) {}
    fn end(&self) {}
}

/// Hears the wish to stop from somebody, and tells of no steps: for work that is counted elsewhere.
pub struct Uncounted<'p>(pub &'p dyn Progress);

impl Progress for Uncounted<'_> {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, _steps: u64) {}
    fn end(&self) {}

    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

/// The work was cancelled by whoever watches its progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("interrupted")]
pub struct Cancelled;

impl<'p> dyn Progress + 'p {
    /// Begins a stage that ends when what is returned is dropped, on every way out.
    pub fn stage(&'p self, stage: &str, total: u64) -> Running<'p> {
        self.begin(stage, total);
        Running { progress: self, began: Instant::now() }
    }
}

/// A stage that is being watched.
pub struct Running<'p> {
    progress: &'p (dyn Progress + 'p),
    began: Instant,
}

impl Running<'_> {
    /// Ends the stage; returns how long it took.
    pub fn end(self) -> Duration {
        self.began.elapsed()
    }
}

impl Drop for Running<'_> {
    fn drop(&mut self) {
        self.progress.end();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicI32, Ordering};

    use super::*;

    #[derive(Default)]
    struct Depth(AtomicI32);

    impl Progress for Depth {
        fn begin(&self, _: &str, _: u64) {
            self.0.fetch_add(1, Ordering::Relaxed);
        }

        fn advance(&self, _: u64) {}

        fn end(&self) {
            self.0.fetch_sub(1, Ordering::Relaxed);
        }
    }

    #[test]
    fn a_stage_ends_on_every_way_out() {
        let depth = Depth::default();
        let fails = |progress: &dyn Progress| -> Result<(), ()> {
            let _running = progress.stage("work", 0);
            assert_eq!(depth.0.load(Ordering::Relaxed), 1);
            Err(())
        };
        assert_eq!(fails(&depth), Err(()));
        (&depth as &dyn Progress).stage("more", 3).end();
        assert_eq!(depth.0.load(Ordering::Relaxed), 0);
    }
}
