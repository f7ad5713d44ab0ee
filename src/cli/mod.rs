//! The command line: one file a verb, and no logic that the library lacks.
//!
//! Exit codes: 0 done; 1 `compare` found a difference; 2 the command line or the pipeline is wrong, and nothing was
//! run or written; 3 the run failed; 130 after Ctrl-C. Results go to stdout, progress and messages to stderr.

mod check;
mod compare;
mod completions;
mod console;
mod devices;
mod example;
mod info;
mod man;
mod merge;
mod options;
mod page;
mod piece;
mod run;
mod schema;
mod study;
mod version;
mod watch;

use std::borrow::Cow;
use std::ffi::OsString;
use std::io::Write;
use std::path::Path;

use ao4d::io::AtomicFile;
use ao4d::pipeline::RunError;
use ao4d::text::for_terminal;
use clap::{Parser, Subcommand};

use console::Console;
use options::Messages;

/// Ambient occlusion in four dimensions, for ParaView.
#[derive(Debug, Parser)]
#[command(name = "ao4d", version, about, max_term_width = 100)]
struct Cli {
    #[command(flatten)]
    messages: Messages,
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Run a pipeline and write its files
    Run(run::Run),
    /// Make a pipeline's files of the pieces of its run
    Merge(merge::Merge),
    /// Do everything short of running: print the plan, write nothing
    Check(check::Check),
    /// Measure error against time of the occlusion methods on a pipeline's scene
    Study(study::Study),
    /// Compare two volumes, meshes or occlusion files, or two folders of them
    Compare(compare::Compare),
    /// Tell what a file holds
    Info(info::Info),
    /// List the OpenCL devices, and what this processor offers
    Devices(devices::Devices),
    /// Print the JSON Schema of a pipeline, for editors
    Schema(schema::Schema),
    /// Run a pipeline and put what it shows into one HTML file, for any browser
    Page(page::Page),
    /// Write one of the shipped pipelines, with what it reads; or list them
    Example(example::Example),
    /// Print what a shell needs to complete commands and options
    Completions(completions::Completions),
    /// Print a manual page, or write all of them
    Man(man::Man),
}

/// How a verb ended well.
pub enum Outcome {
    /// All is done.
    Done,
    /// `compare` found a difference.
    Different,
}

/// How a verb ended badly.
pub enum Failure {
    /// The command line or the pipeline is wrong; nothing was run or written.
    Refused(Box<dyn std::error::Error>),
    /// The run failed.
    Failed(Box<dyn std::error::Error>),
    /// Ctrl-C.
    Cancelled,
}

impl Failure {
    /// A refusal with a text of its own.
    fn refused(message: impl Into<String>) -> Self {
        Failure::Refused(message.into().into())
    }
}

impl From<ao4d::pipeline::Error> for Failure {
    fn from(error: ao4d::pipeline::Error) -> Self {
        Failure::Refused(Box::new(error))
    }
}

impl From<RunError> for Failure {
    fn from(error: RunError) -> Self {
        match error {
            RunError::Refused(error) => Failure::Refused(Box::new(error)),
            RunError::Pieces(error) => Failure::Refused(Box::new(error)),
            RunError::Cancelled(_) => Failure::Cancelled,
            error => Failure::Failed(Box::new(error)),
        }
    }
}

impl From<ao4d::inspect::Error> for Failure {
    fn from(error: ao4d::inspect::Error) -> Self {
        Failure::Refused(Box::new(error))
    }
}

/// Refuses a path where there is no file.
fn existing(file: &Path) -> Result<(), Failure> {
    match ao4d::input::length(file) {
        Ok(_) => Ok(()),
        Err(cause) if file.exists() && !file.is_dir() => Err(Failure::refused(format!("{}: {cause}", file.display()))),
        Err(_) => Err(Failure::refused(format!("{}: there is no such file", file.display()))),
    }
}

/// Writes a file, which appears when it is whole.
fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let written = AtomicFile::create(path).and_then(|mut file| {
        file.write_all(bytes).map_err(|cause| AtomicFile::name_in(path)(cause.into()))?;
        file.commit()
    });
    written.map(|_| ()).map_err(|e| Failure::Failed(Box::new(e)))
}

/// Whether the command line asks for the version, and for more about it; clap answers to the first alone at once.
fn asks_for_details(arguments: &[OsString]) -> bool {
    let any = |words: &[&str]| arguments.iter().any(|a| words.iter().any(|word| a == word));
    let only = |a: &OsString| ["--version", "-V", "--verbose", "-v", "-Vv", "-vV"].iter().any(|word| a == word);
    let both = any(&["--version", "-V"]) && any(&["--verbose", "-v"]) || any(&["-Vv", "-vV"]);
    both && arguments.iter().all(only)
}

/// Parses the command line, does what it says, and returns the exit code.
///
/// The first argument is the program's own name. Whoever embeds the program, such as its Python package, hands the rest in.
pub fn main(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    if asks_for_details(arguments.get(1..).unwrap_or_default()) {
        let messages = Messages { quiet: false, verbose: true, log_level: None, progress: None };
        return version::print(&Console::new(messages)).map_or(3, |_| 0);
    }
    let cli = match Cli::try_parse_from(&arguments) {
        Ok(cli) => cli,
        Err(refusal) => {
            // Help and version come this way too, with code 0. A closed pipe is no reason to fail. A refusal quotes
            // arguments, among them names of files; where a terminal would obey one, it goes without colours.
            let commands = |argument: OsString| matches!(for_terminal(&argument.to_string_lossy()), Cow::Owned(_));
            if arguments.into_iter().any(commands) {
                console::to_stderr(refusal.to_string().trim_end());
            } else {
                let _ = refusal.print();
            }
            return u8::try_from(refusal.exit_code()).unwrap_or(2);
        }
    };
    let console = Console::new(cli.messages);
    let result = match cli.verb {
        Verb::Run(run) => run.execute(&console),
        Verb::Merge(merge) => merge.execute(&console),
        Verb::Check(check) => check.execute(&console),
        Verb::Study(study) => study.execute(&console),
        Verb::Compare(compare) => compare.execute(&console),
        Verb::Info(info) => info.execute(&console),
        Verb::Devices(devices) => devices.execute(&console),
        Verb::Schema(schema) => schema.execute(&console),
        Verb::Page(page) => page.execute(&console),
        Verb::Example(example) => example.execute(&console),
        Verb::Completions(completions) => completions.execute(&console),
        Verb::Man(man) => man.execute(&console),
    };
    match result {
        Ok(Outcome::Done) => 0,
        Ok(Outcome::Different) => 1,
        Err(Failure::Refused(error)) => {
            console.error(error.as_ref());
            2
        }
        Err(Failure::Failed(error)) => {
            console.error(error.as_ref());
            3
        }
        Err(Failure::Cancelled) => {
            watch::tell_interrupted(console.quiet());
            130
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        super::Cli::command().debug_assert();
    }
}
