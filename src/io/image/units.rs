//! Units of length: an image whose axes are told in different ones is brought to that of its first.
//!
//! A microscope's file may give x in nanometres and z in micrometres. As bare numbers they would make another body. What is no
//! length, such as degrees or hectopascals, has no common measure with one, and stays as it is.

use super::axes::{Axis, Opened, Role};

/// How many metres a unit is; none if it is no length that is known.
pub(super) fn metres(unit: &str) -> Option<f64> {
    let unit = unit.trim();
    // Symbols, in which capitals matter: megametres and millimetres.
    let symbol = match unit {
        "km" => 1e3,
        "hm" => 1e2,
        "dam" => 1e1,
        "m" => 1.0,
        "dm" => 1e-1,
        "cm" => 1e-2,
        "mm" => 1e-3,
        "um" | "\u{b5}m" | "\u{3bc}m" | "\\u00B5m" => 1e-6,
        "nm" => 1e-9,
        "pm" => 1e-12,
        "fm" => 1e-15,
        "\u{c5}" | "\u{212b}" => 1e-10,
        "Mm" => 1e6,
        "Gm" => 1e9,
        "in" | "\"" => 0.0254,
        "thou" => 2.54e-5,
        "ft" => 0.3048,
        "yd" => 0.9144,
        "mi" => 1609.344,
        _ => 0.0,
    };
    if symbol > 0.0 {
        return Some(symbol);
    }
    let word = unit.to_lowercase();
    let word = if word == "inches" { "inch" } else { word.strip_suffix('s').unwrap_or(&word) };
    match word {
        "inch" => return Some(0.0254),
        "foot" | "feet" => return Some(0.3048),
        "micron" => return Some(1e-6),
        "angstrom" | "\u{e5}ngstr\u{f6}m" => return Some(1e-10),
        _ => {}
    }
    let before = word.strip_suffix("meter").or_else(|| word.strip_suffix("metre"))?;
    Some(match before {
        "" => 1.0,
        "kilo" => 1e3,
        "deci" => 1e-1,
        "centi" => 1e-2,
        "milli" => 1e-3,
        "micro" => 1e-6,
        "nano" => 1e-9,
        "pico" => 1e-12,
        _ => return None,
    })
}

/// Whether two units say the same, be they known or not.
pub(super) fn same(one: &str, other: &str) -> bool {
    one == other || metres(one).is_some_and(|length| metres(other) == Some(length))
}

impl Opened {
    /// Brings all axes of lengths to one unit.
    pub(super) fn in_one_unit(mut self) -> Self {
        let length = |axis: &Axis| match axis.role {
            Some(Role::Time | Role::Channel) => None,
            _ => metres(axis.unit.as_deref()?),
        };
        let mut lengths: Vec<(usize, f64)> =
            self.axes.iter().enumerate().filter_map(|(i, axis)| Some((i, length(axis)?))).collect();
        // The unit of x, however the axes are stored.
        lengths.sort_by_key(|&(i, _)| self.axes[i].role.map_or(Role::Channel as usize, |role| role as usize));
        let Some(&(first, wanted)) = lengths.first() else { return self };
        let unit = self.axes[first].unit.clone();
        for (axis, length) in lengths.into_iter().filter(|(_, length)| *length != wanted) {
            let (name, common) = (self.axes[first].name.clone(), unit.clone().unwrap_or_default());
            let axis = &mut self.axes[axis];
            let own = std::mem::replace(&mut axis.unit, unit.clone()).unwrap_or_default();
            axis.positions.map(length / wanted, 0.0);
            self.notes
                .push(format!("its axis \"{}\" is in {own}; it is brought to {common}, as \"{name}\" is", axis.name));
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_known_by_their_names() {
        for (unit, length) in [
            ("mm", 1e-3),
            ("Mm", 1e6),
            (" \u{b5}m", 1e-6),
            ("\u{3bc}m", 1e-6),
            ("microns", 1e-6),
            ("Micrometer", 1e-6),
            ("metres", 1.0),
            ("inches", 0.0254),
            ("inch", 0.0254),
            ("\u{c5}", 1e-10),
        ] {
            assert_eq!(metres(unit), Some(length), "{unit}");
        }
        for unit in ["", "s", "pixel", "degrees_north", "hPa", "level", "meterstick"] {
            assert_eq!(metres(unit), None, "{unit}");
        }
        assert!(same("um", "micron") && same("hPa", "hPa") && !same("mm", "um") && !same("hPa", "mm"));
    }
}
