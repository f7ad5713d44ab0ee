//! The threads of a verb: as many as were asked for, and never more than help.

use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};

use super::Settings;

/// More threads than this only cost memory.
pub const MAX_THREADS: usize = 1024;

impl Settings {
    /// Starts the threads: `threads` of them, or as many as `RAYON_NUM_THREADS` says, or as there are cores.
    ///
    /// # Errors
    /// If the system doesn't let them start.
    pub fn pool(&self) -> Result<ThreadPool, ThreadPoolBuildError> {
        let asked = || std::env::var("RAYON_NUM_THREADS").ok()?.parse().ok().filter(|&n: &usize| n > 0);
        let cores = || std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get);
        let threads = self.threads.map_or_else(|| asked().unwrap_or_else(cores), std::num::NonZeroUsize::get);
        ThreadPoolBuilder::new().num_threads(threads.min(MAX_THREADS)).build()
    }
}
