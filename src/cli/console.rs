//! What is printed where.
//!
//! `println!` panics when the reader at the other end of a pipe has gone (`ao4d schema | head -1`). Here that is
//! the end of printing, and nothing else. Names and paths from outside stand in much of it, so whatever a terminal
//! would obey is shown instead.

use std::error::Error;
use std::io::{self, IsTerminal, Write};

use ao4d::text::for_terminal;

use super::Failure;
use super::options::Messages;

/// Stdout for results, stderr for the rest.
pub struct Console {
    messages: Messages,
}

impl Console {
    /// As talkative as asked for.
    pub fn new(messages: Messages) -> Self {
        Console { messages }
    }

    /// Whether details are wanted.
    pub fn verbose(&self) -> bool {
        self.messages.verbose
    }

    /// Whether moving bars may be drawn.
    pub fn bars(&self) -> bool {
        !self.messages.quiet && io::stderr().is_terminal()
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

    /// Prints a result as JSON.
    pub fn json(&self, value: &impl serde::Serialize) -> Result<(), Failure> {
        match serde_json::to_string_pretty(value) {
            Ok(text) => self.result(&text),
            Err(e) => Err(Failure::Failed(Box::new(e))),
        }
    }

    /// Prints an error and its causes, each after the one it caused.
    pub fn error(&self, error: &dyn Error) {
        let mut text = format!("error: {error}");
        let mut cause = error.source();
        while let Some(inner) = cause {
            text += &format!(": {inner}");
            cause = inner.source();
        }
        to_stderr(&text);
    }

    /// Prints a warning.
    pub fn warn(&self, warning: &dyn Error) {
        self.note(&format!("warning: {warning}"));
    }

    /// Whether notes are unwanted.
    pub fn quiet(&self) -> bool {
        self.messages.quiet
    }

    /// Prints a message, unless quiet is wanted.
    pub fn note(&self, text: &str) {
        if !self.quiet() {
            to_stderr(text);
        }
    }
}

/// A line for stderr, whatever was asked for.
pub fn to_stderr(text: &str) {
    let _ = writeln!(io::stderr(), "{}", for_terminal(text)); // nobody is left to hear of a failure
}
