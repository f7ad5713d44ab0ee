//! `ao4d man`: manual pages, made of the same words as `--help`.

use std::path::PathBuf;

use clap::{Args, CommandFactory};
use clap_mangen::Man as Page;

use super::console::Console;
use super::{Cli, Failure, Outcome};

/// What `man` takes.
#[derive(Args, Debug)]
#[command(after_help = "\
read one     ao4d man run | man -l -
install all  ao4d man --out ~/.local/share/man/man1")]
pub struct Man {
    /// The command whose page is printed [default: that of ao4d itself]
    #[arg(value_name = "COMMAND", conflicts_with = "out")]
    command: Option<String>,
    /// Write all pages into this folder, as ao4d.1, ao4d-run.1, ...
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Man {
    pub fn execute(self, console: &Console) -> Result<Outcome, Failure> {
        let pages = pages().map_err(|e| Failure::Failed(Box::new(e)))?;
        if let Some(folder) = &self.out {
            for (name, text) in &pages {
                let path = folder.join(format!("{name}.1"));
                super::write(&path, text)?;
                console.tell(&format!("written: {}", path.display()));
            }
            return Ok(Outcome::Done);
        }
        let wanted = self.command.as_ref().map_or("ao4d".to_owned(), |verb| format!("ao4d-{verb}"));
        match pages.iter().find(|(name, _)| *name == wanted) {
            Some((_, text)) => console.text(text)?,
            None => {
                let known: Vec<&str> = pages.iter().filter_map(|(name, _)| name.strip_prefix("ao4d-")).collect();
                let verb = self.command.unwrap_or_default();
                return Err(Failure::refused(format!("there is no command `{verb}` (known: {})", known.join(", "))));
            }
        }
        Ok(Outcome::Done)
    }
}

/// Every page and its name.
fn pages() -> std::io::Result<Vec<(String, Vec<u8>)>> {
    let mut command = Cli::command().disable_help_subcommand(true);
    command.build();
    let of = |name: String, command: clap::Command| -> std::io::Result<_> {
        let mut text = Vec::new();
        Page::new(command).render(&mut text)?;
        Ok((name, text))
    };
    let verbs: Vec<clap::Command> = command.get_subcommands().cloned().collect();
    let mut pages = vec![of("ao4d".to_owned(), command)?];
    for verb in verbs {
        pages.push(of(format!("ao4d-{}", verb.get_name()), verb)?);
    }
    Ok(pages)
}
