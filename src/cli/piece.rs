//! `--piece K/N`: which share of a run this process makes.

use ao4d::pipeline::Launched;
use ao4d::stages::Piece;
use clap::Args;

use super::Failure;
use super::console::Console;

/// Which piece of a run is made.
#[derive(Args, Debug)]
pub struct PieceOptions {
    /// Make piece K of N, counted from 0, in the folder pieces-N/K; none: make the whole [default: what mpirun, srun or a
    /// Slurm array says in the environment, else none]
    #[arg(long, value_name = "K/N", value_parser = wanted)]
    piece: Option<Wanted>,
}

/// What was asked for.
#[derive(Clone, Copy, Debug)]
enum Wanted {
    Whole,
    Piece(Piece),
}

impl PieceOptions {
    /// The piece that is asked for, by the command line or else by whoever launched the process; none for the whole run.
    pub fn piece(&self, console: &Console) -> Result<Option<Piece>, Failure> {
        match self.piece {
            Some(Wanted::Whole) => Ok(None),
            Some(Wanted::Piece(piece)) => Ok(Some(piece)),
            None => {
                let variable = |name: &str| std::env::var_os(name).map(|value| value.to_string_lossy().into_owned());
                let Launched { piece, note } = Launched::from_environment(variable).map_err(Failure::refused)?;
                note.iter().for_each(|note| console.note(note));
                Ok(piece)
            }
        }
    }
}

fn wanted(text: &str) -> Result<Wanted, String> {
    if text == "none" { Ok(Wanted::Whole) } else { text.parse().map(Wanted::Piece) }
}
