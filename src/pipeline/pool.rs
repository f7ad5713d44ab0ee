//! The threads of a verb: as many as were asked for, and never more than help.

use std::io::{Error, ErrorKind};

use rayon::{ThreadPool, ThreadPoolBuilder};

use super::Settings;

/// More threads than this only cost memory.
pub const MAX_THREADS: usize = 1024;
/// Bytes that a thread takes of the address space, and some more.
const STACK: usize = (2 << 20) + (1 << 18);

impl Settings {
    /// Starts the threads: `threads` of them, or as many as `RAYON_NUM_THREADS` says, or as there are cores.
    ///
    /// # Errors
    /// If the system doesn't let them start, or hasn't the memory for their stacks.
    pub fn pool(&self) -> Result<ThreadPool, Error> {
        let asked = || std::env::var("RAYON_NUM_THREADS").ok()?.parse().ok().filter(|&n: &usize| n > 0);
        let cores = || std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get);
        let threads = self.threads.map_or_else(|| asked().unwrap_or_else(cores), std::num::NonZeroUsize::get);
        let threads = threads.min(MAX_THREADS);
        // A thread that finds no room for its second, small stack ends the program; so it is asked for before.
        if threads > cores() {
            Vec::<u8>::new().try_reserve_exact(threads * STACK).map_err(|_| ErrorKind::OutOfMemory)?;
        }
        ThreadPoolBuilder::new().num_threads(threads).build().map_err(Error::other)
    }
}
