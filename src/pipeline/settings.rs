//! How a plan is run, as opposed to what it computes: none of this changes a byte of the results.

use std::fmt;
use std::num::NonZeroUsize;
use std::str::FromStr;

/// The settings of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Settings {
    /// What computes occlusion.
    pub backend: Backend,
    /// How many threads; none means all that there are.
    pub threads: Option<NonZeroUsize>,
    /// Whether what earlier runs left in the cache is computed again.
    pub force: bool,
}

/// What computes occlusion.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Backend {
    /// The processor.
    #[default]
    Cpu,
    /// OpenCL devices of these platforms and numbers, which share the work; if none is named, the one that fits best.
    OpenCl(Vec<(usize, usize)>),
}

/// A backend that can't be.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected cpu, opencl or opencl:PLATFORM.DEVICE (for instance opencl:0.0)")]
pub struct BackendError;

impl FromStr for Backend {
    type Err = BackendError;

    fn from_str(text: &str) -> Result<Self, BackendError> {
        let numbers = match text.split_once(':') {
            None if text == "cpu" => return Ok(Backend::Cpu),
            None if text == "opencl" => return Ok(Backend::OpenCl(Vec::new())),
            Some(("opencl", numbers)) => numbers,
            _ => return Err(BackendError),
        };
        let number = |digits: &str| digits.bytes().all(|b| b.is_ascii_digit()).then(|| digits.parse().ok()).flatten();
        let pair = |text: &str| text.split_once('.').and_then(|(p, d)| number(p).zip(number(d)));
        numbers.split('+').map(pair).collect::<Option<Vec<_>>>().map(Backend::OpenCl).ok_or(BackendError)
    }
}

impl fmt::Display for Backend {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Backend::Cpu => f.write_str("cpu"),
            Backend::OpenCl(places) if places.is_empty() => f.write_str("opencl"),
            Backend::OpenCl(places) => {
                let places: Vec<String> = places.iter().map(|(p, d)| format!("{p}.{d}")).collect();
                write!(f, "opencl:{}", places.join("+"))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn backends_round_trip() {
        for text in ["cpu", "opencl", "opencl:0.1", "opencl:12.0", "opencl:0.0+1.0+1.1"] {
            assert_eq!(text.parse::<Backend>().unwrap().to_string(), text);
        }
        for text in [
            "",
            "CPU",
            "gpu",
            "opencl:",
            "opencl:0",
            "opencl:0.",
            "opencl:+1.0",
            "opencl:0.1.2",
            "cpu:0.0",
            "opencl:0.0+",
            "opencl:0.0,1.0",
        ] {
            assert!(text.parse::<Backend>().is_err(), "{text}");
        }
    }
}
