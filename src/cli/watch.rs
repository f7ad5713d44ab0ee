//! Who watches a run: a bar on a terminal, lines with `-v`, and Ctrl-C.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, Once, PoisonError};
use std::time::{Duration, Instant};

use ao4d::progress::Progress;
use ao4d::text::for_terminal;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use super::Failure;
use super::console::{self, Console};
use super::options::Form;

/// Reports to the console, and knows whether Ctrl-C was pressed.
pub struct Watch<'a> {
    console: &'a Console,
    cancelled: Arc<AtomicBool>,
    current: Arc<Mutex<Option<Current>>>,
}

/// How long work has to hear Ctrl-C by itself, as nearly all does.
const PATIENCE: Duration = Duration::from_millis(600);

/// Events of work that goes on are told no more often than this.
const PACE: Duration = Duration::from_millis(200);

struct Current {
    stage: String,
    began: Instant,
    bar: ProgressBar,
    total: u64,
    done: u64,
    /// When it was told last.
    told: Instant,
}

impl<'a> Watch<'a> {
    /// Begins to listen for Ctrl-C. The first asks the work to stop and clean up, and ends it if it doesn't in time; the
    /// second ends it at once.
    pub fn new(console: &'a Console) -> Result<Self, Failure> {
        let cancelled = Arc::new(AtomicBool::new(false));
        let current = Arc::new(Mutex::new(None));
        let (flag, bar, quiet) = (Arc::clone(&cancelled), Arc::clone(&current), console.quiet());
        let handler = move || {
            if flag.swap(true, Ordering::SeqCst) {
                end(&bar, quiet);
            }
            let bar = Arc::clone(&bar);
            std::thread::spawn(move || {
                std::thread::sleep(PATIENCE);
                end(&bar, quiet);
            });
        };
        ctrlc::set_handler(handler).map_err(|e| Failure::Failed(Box::new(e)))?;
        Ok(Watch { console, cancelled, current })
    }

    fn current(&self) -> MutexGuard<'_, Option<Current>> {
        locked(&self.current)
    }
}

fn locked(current: &Mutex<Option<Current>>) -> MutexGuard<'_, Option<Current>> {
    current.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Ends the process where the work doesn't by itself; nothing that isn't whole is left of it.
fn end(current: &Mutex<Option<Current>>, quiet: bool) -> ! {
    ao4d::io::abandon();
    if let Some(current) = locked(current).take() {
        current.bar.finish_and_clear();
    }
    tell_interrupted(quiet);
    std::process::exit(130);
}

/// Says once that Ctrl-C was pressed, whoever comes first: the work that heard it, or who ends it.
pub fn tell_interrupted(quiet: bool) {
    static TOLD: Once = Once::new();
    TOLD.call_once(|| {
        if !quiet {
            console::say_interrupted();
        }
    });
}

impl Progress for Watch<'_> {
    fn begin(&self, stage: &str, total: u64) {
        let bar = if self.console.bars() { bar(stage, total) } else { ProgressBar::hidden() };
        if self.console.form() == Form::Json {
            self.console.event(&json!({ "event": "begin", "stage": stage, "total": total }));
        }
        let began = Instant::now();
        *self.current() = Some(Current { stage: stage.to_owned(), began, bar, total, done: 0, told: began });
    }

    fn advance(&self, steps: u64) {
        if let Some(current) = self.current().as_mut() {
            current.bar.inc(steps);
            current.done += steps;
            if self.console.form() == Form::Json && current.told.elapsed() >= PACE {
                let Current { stage, done, total, .. } = &*current;
                self.console.event(&json!({ "event": "advance", "stage": stage, "done": done, "total": total }));
                current.told = Instant::now();
            }
        }
    }

    fn end(&self) {
        if let Some(Current { stage, began, bar, .. }) = self.current().take() {
            bar.finish_and_clear();
            let seconds = began.elapsed().as_secs_f64();
            match self.console.form() {
                Form::Json => self.console.event(&json!({ "event": "end", "stage": stage, "seconds": seconds })),
                _ => self.console.detail(&format!("{stage}: {seconds:.2} s")),
            }
        }
    }

    fn cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}

fn bar(stage: &str, total: u64) -> ProgressBar {
    let (bar, template) = match total {
        0 => (ProgressBar::new_spinner(), "{msg:24} {spinner}"),
        _ => (ProgressBar::new(total), "{msg:24} [{bar:32}] {percent:>3} %, {eta} left"),
    };
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = bar.with_style(style.progress_chars("=> ")).with_message(for_terminal(stage).into_owned());
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}
