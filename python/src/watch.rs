//! Work on a thread of its own, while Python's own thread listens for Ctrl-C and tells of progress.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use ao4d::pipeline::Settings;
use ao4d::progress::Progress;
use pyo3::prelude::*;
use pyo3::types::PyAny;

use crate::WorkError;

/// How often Python is asked whether Ctrl-C was pressed.
const PERIOD: Duration = Duration::from_millis(50);

/// What work tells, and the wish that it stops.
#[derive(Default)]
struct State {
    stage: Mutex<(String, u64)>,
    done: AtomicU64,
    cancelled: AtomicBool,
}

impl Progress for State {
    fn begin(&self, stage: &str, total: u64) {
        *self.stage.lock().unwrap_or_else(PoisonError::into_inner) = (stage.to_owned(), total);
        self.done.store(0, Ordering::Relaxed);
    }

    fn advance(&self, steps: u64) {
        self.done.fetch_add(steps, Ordering::Relaxed);
    }

    fn end(&self) {}

    fn cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}

impl State {
    /// Lets Python handle signals, and tells the watcher `(stage, done, total)`.
    fn tell(&self, py: Python<'_>, watch: Option<&Py<PyAny>>) -> PyResult<()> {
        py.check_signals()?;
        if let Some(watch) = watch {
            let (stage, total) = self.stage.lock().unwrap_or_else(PoisonError::into_inner).clone();
            if !stage.is_empty() {
                watch.call1(py, (stage, self.done.load(Ordering::Relaxed), total))?;
            }
        }
        Ok(())
    }
}

/// Does the work without holding the interpreter. An exception that Ctrl-C or the watcher raises stops the work, and is raised.
///
/// # Errors
/// That exception, or that threads can't be started.
pub fn watched<T: Send>(
    py: Python<'_>,
    settings: &Settings,
    watch: Option<Py<PyAny>>,
    work: impl FnOnce(&dyn Progress) -> T + Send,
) -> PyResult<T> {
    let pool = settings.pool().map_err(|error| WorkError::new_err(format!("can't start the threads: {error}")))?;
    let state = State::default();
    let (state, pool) = (&state, &pool);
    let (done, raised) = py.detach(move || {
        let (sender, receiver) = channel();
        std::thread::scope(|scope| {
            let worker = scope.spawn(move || {
                let done = pool.install(|| work(state));
                let _ = sender.send(()); // somebody waits for it
                done
            });
            let mut raised = None;
            while let Err(RecvTimeoutError::Timeout) = receiver.recv_timeout(PERIOD) {
                if raised.is_none() {
                    raised = Python::attach(|py| state.tell(py, watch.as_ref()).err());
                    state.cancelled.store(raised.is_some(), Ordering::Relaxed);
                }
            }
            (worker.join(), raised)
        })
    });
    match (done, raised) {
        (_, Some(raised)) => Err(raised),
        (Ok(done), None) => Ok(done),
        (Err(panic), None) => std::panic::resume_unwind(panic),
    }
}
