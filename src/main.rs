//! The program's door: hand the command line in, hand the exit code out.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(ao4d::cli::main(std::env::args_os()))
}
