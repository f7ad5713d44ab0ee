//! What is printed where.
//!
//! `println!` panics when the reader at the other end of a pipe has gone (`ao4d schema | head -1`). Here that is
//! the end of printing, and nothing else. Names and paths from outside stand in much of it, so whatever a terminal
//! would obey is shown instead.

use std::error::Error;
use std::fmt::Display;
use std::io::{self, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};

use ao4d::text::for_terminal;
use serde_json::json;

use super::Failure;
use super::options::{Form, Level, Messages};

/// Whether messages are lines of JSON, for whoever has no console at hand.
static JSON: AtomicBool = AtomicBool::new(false);

/// Says that Ctrl-C was pressed.
pub fn say_interrupted() {
    to_stderr(if JSON.load(Ordering::Relaxed) { r#"{"event":"interrupted"}"# } else { "interrupted" });
}

/// Stdout for results, stderr for the rest.
pub struct Console {
    messages: Messages,
}

impl Console {
    /// As talkative as asked for.
    pub fn new(messages: Messages) -> Self {
        let console = Console { messages };
        JSON.store(console.form() == Form::Json, Ordering::Relaxed);
        console
    }

    /// Whether details are wanted.
    pub fn verbose(&self) -> bool {
        self.messages.level() >= Level::Debug
    }

    /// Whether moving bars may be drawn.
    pub fn bars(&self) -> bool {
        self.form() == Form::Bar && !self.quiet() && io::stderr().is_terminal()
    }

    /// How the course of work is told.
    pub fn form(&self) -> Form {
        self.messages.progress.unwrap_or_default()
    }

    /// Prints a result.
    pub fn result(&self, text: &str) -> Result<(), Failure> {
        let mut out = io::stdout().lock();
        let newline = if text.ends_with('\n') { "" } else { "\n" };
        match write!(out, "{}{newline}", for_terminal(text)).and_then(|()| out.flush()) {
            Err(e) if e.kind() != io::ErrorKind::BrokenPipe => {
                Err(Failure::Failed(format!("cannot write to stdout: {e}").into()))
            }
            _ => Ok(()),
        }
    }

    /// Prints a text made for other programs, as it is.
    pub fn text(&self, text: &[u8]) -> Result<(), Failure> {
        let mut out = io::stdout().lock();
        match out.write_all(text).and_then(|()| out.flush()) {
            Err(e) if e.kind() != io::ErrorKind::BrokenPipe => {
                Err(Failure::Failed(format!("cannot write to stdout: {e}").into()))
            }
            _ => Ok(()),
        }
    }

    /// Prints what there is to say of each pipeline as JSON: an object with the list `pipelines`. Where there is one pipeline,
    /// what is said of it stands beside the list too, since that is all there once was.
    pub fn pipelines(&self, all: &[impl serde::Serialize]) -> Result<(), Failure> {
        let values = all.iter().map(serde_json::to_value).collect::<Result<Vec<_>, _>>();
        let values = values.map_err(|e| Failure::Failed(Box::new(e)))?;
        let mut whole = match &values[..] {
            [serde_json::Value::Object(one)] => one.clone(),
            _ => serde_json::Map::new(),
        };
        whole.insert("pipelines".to_owned(), values.into());
        self.json(&whole)
    }

    /// Prints a result as JSON.
    pub fn json(&self, value: &impl serde::Serialize) -> Result<(), Failure> {
        match serde_json::to_string_pretty(value) {
            Ok(text) => self.result(&text),
            Err(e) => Err(Failure::Failed(Box::new(e))),
        }
    }

    /// Prints an error and its causes, each after the one it caused.
    pub fn error(&self, error: &dyn Error) {
        let mut text = error.to_string();
        let mut cause = error.source();
        while let Some(inner) = cause {
            text += &format!(": {inner}");
            cause = inner.source();
        }
        self.say("error", &text);
    }

    /// Prints a warning.
    pub fn warn(&self, warning: &dyn Display) {
        if self.messages.level() >= Level::Warn {
            self.say("warning", &warning.to_string());
        }
    }

    /// Prints what was done, unless quiet is wanted.
    pub fn tell(&self, text: &str) {
        if !self.quiet() {
            self.say("", text);
        }
    }

    /// Whether notes are unwanted.
    pub fn quiet(&self) -> bool {
        self.messages.level() < Level::Info
    }

    /// Prints a note, unless quiet is wanted.
    pub fn note(&self, text: &str) {
        if !self.quiet() {
            self.say("note", text);
        }
    }

    /// Prints what a step took, if details are wanted.
    pub fn detail(&self, text: &str) {
        if self.verbose() {
            self.say("", text);
        }
    }

    /// A message on stderr.
    fn say(&self, kind: &str, text: &str) {
        match (self.form(), kind) {
            (Form::Json, _) => {
                self.event(&json!({ "event": if kind.is_empty() { "detail" } else { kind }, "message": text }))
            }
            (_, "") => to_stderr(text),
            _ => to_stderr(&format!("{kind}: {text}")),
        }
    }

    /// A line of JSON on stderr.
    pub fn event(&self, event: &serde_json::Value) {
        to_stderr(&event.to_string());
    }
}

/// A line for stderr, whatever was asked for.
pub fn to_stderr(text: &str) {
    let _ = writeln!(io::stderr(), "{}", for_terminal(text)); // nobody is left to hear of a failure
}
