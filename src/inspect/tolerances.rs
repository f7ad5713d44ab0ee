//! Tolerances from a file: what may differ by how much, array by array, and which files of a folder are looked at.
//!
//! ```yaml
//! default: {atol: 1e-6}
//! arrays:
//!   ambient_occlusion: {atol: 0.01, max_different: 20}
//!   rgba: {atol: 2}
//! ignore: ["*.py", "figure/*"]
//! ```

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use super::Error;
use super::compare::{Limits, Tolerance};

/// The file as it is written.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    /// What holds where nothing else is said.
    #[serde(default)]
    default: Numbers,
    /// What holds for the arrays of these names; what is left out there is as by default.
    #[serde(default)]
    arrays: BTreeMap<String, Numbers>,
    /// Files of a folder that are not compared, as patterns.
    #[serde(default)]
    ignore: Vec<String>,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Numbers {
    atol: Option<f64>,
    rtol: Option<f64>,
    max_different: Option<usize>,
}

impl Numbers {
    fn over(self, below: Limits) -> Limits {
        Limits {
            atol: self.atol.unwrap_or(below.atol),
            rtol: self.rtol.unwrap_or(below.rtol),
            max_different: self.max_different.unwrap_or(below.max_different),
        }
    }
}

impl Tolerance {
    /// Adds what a file says; where it says nothing, this tolerance holds.
    ///
    /// # Errors
    /// If the file can't be read, or isn't what is expected.
    pub fn with_file(self, path: &Path) -> Result<Self, Error> {
        let text = crate::input::read_text(path).map_err(|cause| Error::Open { path: path.into(), cause })?;
        self.with_text(&text).map_err(|message| Error::Tolerances { path: path.into(), message })
    }

    fn with_text(mut self, text: &str) -> Result<Self, String> {
        let written: Written = serde_saphyr::from_str(text).map_err(|e| e.to_string())?;
        for (name, Numbers { atol, rtol, .. }) in
            written.arrays.iter().map(|(name, numbers)| (name.as_str(), numbers)).chain([("default", &written.default)])
        {
            for (key, number) in [("atol", atol), ("rtol", rtol)] {
                if number.is_some_and(|x| !x.is_finite() || x < 0.0) {
                    return Err(format!("{name}: {key}: expected a number, 0 or above"));
                }
            }
        }
        let limits = written.default.over(self.limits());
        Limits { atol: self.atol, rtol: self.rtol, max_different: self.max_different } = limits;
        self.each = written.arrays.into_iter().map(|(name, numbers)| (name, numbers.over(limits))).collect();
        for pattern in written.ignore {
            let fits = glob::Pattern::new(&pattern).map_err(|e| format!("ignore: {pattern}: {}", e.msg))?;
            self.ignore.push(fits);
        }
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_out_is_as_by_default() {
        let limits = Limits { atol: 0.5, rtol: 0.25, max_different: 3 };
        let text = "default: {rtol: 0.125}\narrays: {ao: {atol: 0.01}, rgba: {max_different: 7}}\nignore: ['*.py']\n";
        let Limits { atol, rtol, max_different } = limits;
        let tolerance = Tolerance { atol, rtol, max_different, ..Tolerance::default() }.with_text(text).unwrap();
        assert_eq!(tolerance.of("other"), Limits { atol: 0.5, rtol: 0.125, max_different: 3 });
        assert_eq!(tolerance.of("ao"), Limits { atol: 0.01, rtol: 0.125, max_different: 3 });
        assert_eq!(tolerance.of("rgba"), Limits { atol: 0.5, rtol: 0.125, max_different: 7 });
        assert!(tolerance.ignores(Path::new("a/figure.py")) && !tolerance.ignores(Path::new("a.vti")));
    }

    #[test]
    fn refusals() {
        for (text, part) in [
            ("arrays: {ao: {atl: 1}}\n", "atl"),
            ("default: {atol: -1}\n", "default: atol: expected a number, 0 or above"),
            ("arrays: {ao: {rtol: .nan}}\n", "ao: rtol: expected a number, 0 or above"),
            ("ignore: ['[']\n", "ignore: [:"),
        ] {
            let message = Tolerance::default().with_text(text).unwrap_err();
            assert!(message.contains(part), "{text}: {message}");
        }
    }
}
