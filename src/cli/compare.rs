//! `ao4d compare`: do two files hold the same values?

use std::path::PathBuf;

use ao4d::inspect;
use ao4d::inspect::compare::Tolerance;
use ao4d::progress::Progress;
use clap::Args;

use super::console::Console;
use super::watch::Watch;
use super::{Failure, Outcome};

/// What `compare` takes. A value differs where |a - b| > ATOL + RTOL |b|.
#[derive(Args, Debug)]
pub struct Compare {
    /// A volume (.vti, .raw), a mesh (.vtu, .vtp, .stl, .ply) or an occlusion file (.f32)
    a: PathBuf,
    /// What it is compared with
    b: PathBuf,
    /// Differences up to this are none
    #[arg(long, value_name = "X", default_value_t = 0.0, value_parser = tolerance)]
    atol: f64,
    /// Differences up to this times B's value are none
    #[arg(long, value_name = "X", default_value_t = 0.0, value_parser = tolerance)]
    rtol: f64,
    /// So many values of an array may differ
    #[arg(long, value_name = "N", default_value_t = 0)]
    max_different: usize,
    /// Compare this array only; may be given several times
    #[arg(long, value_name = "NAME")]
    array: Vec<String>,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

impl Compare {
    pub fn execute(self, console: &Console) -> Result<Outcome, Failure> {
        super::existing(&self.a)?;
        super::existing(&self.b)?;
        let watch = Watch::new(console)?;
        let running = (&watch as &dyn Progress).stage("comparing", 0);
        let Self { a, b, atol, rtol, max_different, array, json } = self;
        let tolerance = Tolerance { atol, rtol, max_different, arrays: array };
        let comparison = inspect::compare(&a, &b, &tolerance)?;
        running.end();
        if json { console.json(&comparison) } else { console.result(&comparison.to_string()) }?;
        Ok(if comparison.same { Outcome::Done } else { Outcome::Different })
    }
}

fn tolerance(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|x| x.is_finite() && *x >= 0.0);
    number.ok_or_else(|| "expected a number, 0 or above".into())
}
