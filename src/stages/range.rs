//! Ranges of numbers that several stages share.

use super::Invalid;
use super::MAX_LENGTH;

/// A length above zero, of a sane size.
pub(super) fn positive(path: &str, x: f64) -> Result<f64, Invalid> {
    if x > 0.0 {
        check_length(path, x)
    } else {
        Err(Invalid::new(path, format!("expected a number above 0, found {x}")))
    }
}

/// A coordinate of a sane size.
pub(super) fn check_length(path: &str, x: f64) -> Result<f64, Invalid> {
    if x.abs() <= MAX_LENGTH {
        Ok(x)
    } else {
        Err(Invalid::new(path, format!("expected a number of size up to {MAX_LENGTH:e}, found {x:e}")))
    }
}
