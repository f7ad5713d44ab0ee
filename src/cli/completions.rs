//! `ao4d completions`: what a shell needs to complete commands, options and their values.

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use super::console::Console;
use super::{Cli, Failure, Outcome};

/// What `completions` takes.
#[derive(Args, Debug)]
#[command(after_help = "\
bash  ao4d completions bash > ~/.local/share/bash-completion/completions/ao4d
zsh   ao4d completions zsh > \"${fpath[1]}/_ao4d\"
fish  ao4d completions fish > ~/.config/fish/completions/ao4d.fish")]
pub struct Completions {
    /// The shell
    shell: Shell,
}

impl Completions {
    pub fn execute(self, console: &Console) -> Result<Outcome, Failure> {
        let mut text = Vec::new();
        clap_complete::generate(self.shell, &mut Cli::command(), "ao4d", &mut text);
        console.text(&text)?;
        Ok(Outcome::Done)
    }
}
