//! The colour of an object.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Error;
use crate::text::number;

/// A colour: a grey from 0 to 1, `[red, green, blue]` from 0 to 1 each, or `"#rrggbb"`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected a grey from 0 to 1, [red, green, blue] from 0 to 1 each, or \"#rrggbb\"")]
pub enum Color {
    /// A grey: 0 is black, 1 is white.
    Grey(f64),
    /// Red, green and blue from 0 to 1 each.
    Rgb(Vec<f64>),
    /// Two hexadecimal digits each for red, green and blue, behind a `#`.
    Hex(String),
}

impl Default for Color {
    /// A light grey, so that an open surface differs from the white background.
    fn default() -> Self {
        Self::Grey(0.8)
    }
}

impl Color {
    /// Red, green and blue from 0 to 1.
    pub fn rgb(&self) -> Result<[f32; 3], Error> {
        let wrong = |message: String| Error::invalid("color", message);
        let rgb = match self {
            Self::Grey(grey) => [*grey; 3],
            Self::Rgb(list) => list
                .as_slice()
                .try_into()
                .map_err(|_| wrong(format!("expected 3 numbers (red, green, blue), found {}", list.len())))?,
            Self::Hex(text) => parse_hex(text)
                .ok_or_else(|| wrong(format!("\"{text}\" is not a colour; write \"#\" and six hexadecimal digits")))?,
        };
        match rgb.iter().find(|x| !(0.0..=1.0).contains(*x)) {
            Some(x) => Err(wrong(format!("{} is not from 0 to 1", number(*x)))),
            None => Ok(rgb.map(|x| x as f32)),
        }
    }
}

fn parse_hex(text: &str) -> Option<[f64; 3]> {
    let digits = text.strip_prefix('#')?;
    if digits.len() != 6 || !digits.bytes().all(|b| b.is_ascii_hexdigit()) {
        return None;
    }
    let value = u32::from_str_radix(digits, 16).ok()?;
    Some([16, 8, 0].map(|shift| f64::from(value >> shift & 0xff) / 255.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_read_and_refused() {
        let parse = |text: &str| serde_json::from_str::<Color>(text).unwrap().rgb();
        assert_eq!(Color::default().rgb().unwrap(), [0.8f32; 3]);
        assert_eq!(parse("1").unwrap(), [1.0; 3]);
        assert_eq!(parse("[0, 0.5, 1]").unwrap(), [0.0, 0.5, 1.0]);
        assert_eq!(parse("\"#ff0080\"").unwrap(), [1.0, 0.0, (128.0 / 255.0) as f32]);
        for (text, message) in [
            ("1.5", "color: 1.5 is not from 0 to 1"),
            ("[0, 1]", "color: expected 3 numbers (red, green, blue), found 2"),
            ("[0, -1, 0]", "color: -1 is not from 0 to 1"),
            ("\"red\"", "color: \"red\" is not a colour; write \"#\" and six hexadecimal digits"),
            ("\"#12345\u{e9}\"", "color: \"#12345\u{e9}\" is not a colour; write \"#\" and six hexadecimal digits"),
        ] {
            assert_eq!(parse(text).unwrap_err().to_string(), message);
        }
        let wrong_type = serde_json::from_str::<Color>("{}").unwrap_err().to_string();
        assert!(wrong_type.starts_with("expected a grey from 0 to 1"), "{wrong_type}");
    }
}
