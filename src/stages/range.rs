//! Ranges of numbers that several stages share.

use super::{Invalid, MAX_LENGTH, MIN_LENGTH};
use crate::text::number;

/// A length above zero, of a sane size.
pub(super) fn positive(path: &str, x: f64) -> Result<f64, Invalid> {
    // Below this, halves and quotients of the length would round to zero.
    if x >= MIN_LENGTH {
        check_length(path, x)
    } else if x > 0.0 {
        Err(Invalid::new(path, format!("expected a number from {MIN_LENGTH:e} on, found {}", number(x))))
    } else {
        Err(Invalid::new(path, format!("expected a number above 0, found {}", number(x))))
    }
}

/// A coordinate of a sane size.
pub(super) fn check_length(path: &str, x: f64) -> Result<f64, Invalid> {
    if x.abs() <= MAX_LENGTH {
        Ok(x)
    } else {
        Err(Invalid::new(path, format!("expected a number of size up to {MAX_LENGTH:e}, found {}", number(x))))
    }
}
