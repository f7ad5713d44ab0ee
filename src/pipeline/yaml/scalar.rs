//! What a plain (unquoted) scalar means: YAML 1.2's core schema, section 10.3.2.
//!
//! So `yes`, `on` and `1:30` are text, `0x1F` and `0o17` are numbers, and a float may be `.inf` or `.nan` (which the
//! decoder then refuses, by name, instead of taking it for text).

use super::Value;

/// The value of a plain scalar.
pub fn resolve_plain(text: &str) -> Value {
    match text {
        "" | "~" | "null" | "Null" | "NULL" => return Value::Null,
        "true" | "True" | "TRUE" => return Value::Bool(true),
        "false" | "False" | "FALSE" => return Value::Bool(false),
        ".inf" | ".Inf" | ".INF" | "+.inf" | "+.Inf" | "+.INF" => return Value::Float(f64::INFINITY),
        "-.inf" | "-.Inf" | "-.INF" => return Value::Float(f64::NEG_INFINITY),
        ".nan" | ".NaN" | ".NAN" => return Value::Float(f64::NAN),
        _ => {}
    }
    let radix = |digits: &str, base| match digits.starts_with(['+', '-']) {
        true => None, // Rust would take a sign here, YAML doesn't
        false => i128::from_str_radix(digits, base).ok().map(Value::Integer),
    };
    let number = if let Some(digits) = text.strip_prefix("0x") {
        radix(digits, 16)
    } else if let Some(digits) = text.strip_prefix("0o") {
        radix(digits, 8)
    } else {
        decimal(text)
    };
    number.unwrap_or_else(|| Value::Text(text.to_owned()))
}

/// `[-+]? (digits | digits with a point) ([eE] [-+]? digits)?`. Rust's own parser also takes `inf` and `nan`, hence
/// the look at the characters first.
fn decimal(text: &str) -> Option<Value> {
    let numeric = text.bytes().all(|b| matches!(b, b'0'..=b'9' | b'+' | b'-' | b'.' | b'e' | b'E'));
    let unsigned = text.trim_start_matches(['+', '-']);
    if !numeric || !unsigned.starts_with(|c: char| c.is_ascii_digit() || c == '.') {
        return None;
    }
    // A whole number too long for 128 bits is still a number, and too large for whatever it was meant for.
    text.parse().map(Value::Integer).or_else(|_| text.parse().map(Value::Float)).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(text: &str) -> String {
        format!("{:?}", resolve_plain(text))
    }

    #[test]
    fn core_schema() {
        for (text, value) in [
            ("~", "Null"),
            ("True", "Bool(true)"),
            ("12", "Integer(12)"),
            ("-3", "Integer(-3)"),
            ("+7", "Integer(7)"),
            ("0x1F", "Integer(31)"),
            ("0o17", "Integer(15)"),
            ("1.", "Float(1.0)"),
            (".5", "Float(0.5)"),
            ("-1e-3", "Float(-0.001)"),
            ("-.inf", "Float(-inf)"),
            (".NaN", "Float(NaN)"),
        ] {
            assert_eq!(shown(text), value, "{text}");
        }
    }

    #[test]
    fn text_that_looks_like_numbers() {
        for text in
            ["inf", "nan", "yes", "1:30", "1_000", "e5", "-", ".", "+", "0x", "0x-1", "--1", "1e", "infinity", "1.2.3"]
        {
            assert_eq!(shown(text), format!("Text({text:?})"));
        }
    }

    #[test]
    fn huge_whole_numbers_stay_numbers() {
        assert!(matches!(resolve_plain(&"9".repeat(60)), Value::Float(x) if x > 1e59));
    }
}
