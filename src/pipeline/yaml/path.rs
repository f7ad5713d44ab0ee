//! Dotted paths, `stages[1].render.dimensions[0]`: how messages and `--set` name a place in a pipeline.

use std::fmt;

use super::MAX_DEPTH;

/// One step into a tree.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Segment {
    /// A mapping's key.
    Key(String),
    /// A list's item, counted from 0.
    Index(usize),
}

/// Reads `key(.key | [index])*`. The message of a refusal lacks the path, which the caller knows.
pub fn parse_path(text: &str) -> Result<Vec<Segment>, String> {
    let mut segments = Vec::new();
    let mut rest = text;
    loop {
        let end = rest.find(['.', '[', ']']).unwrap_or(rest.len());
        let (key, tail) = rest.split_at(end);
        if key.is_empty() {
            return Err("a key is missing; write KEY, KEY.KEY or KEY[0].KEY".into());
        }
        segments.push(Segment::Key(key.to_owned()));
        rest = tail;
        if segments.len() > MAX_DEPTH {
            return Err(format!("the key is more than {MAX_DEPTH} levels deep"));
        }
        while let Some(inner) = rest.strip_prefix('[') {
            let Some((index, tail)) = inner.split_once(']') else { return Err("`[` has no `]`".into()) };
            let index =
                index.parse().map_err(|_| format!("`[{index}]` isn't a position in a list; the first is [0]"))?;
            segments.push(Segment::Index(index));
            rest = tail;
            if segments.len() > MAX_DEPTH {
                return Err(format!("the key is more than {MAX_DEPTH} levels deep"));
            }
        }
        match rest.strip_prefix('.') {
            Some(tail) => rest = tail,
            None if rest.is_empty() => return Ok(segments),
            None => return Err(format!("expected `.` or `[` before `{rest}`")),
        }
    }
}

/// A path as it is printed.
pub fn show_path(segments: &[Segment]) -> String {
    Shown(segments).to_string()
}

struct Shown<'a>(&'a [Segment]);

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, segment) in self.0.iter().enumerate() {
            match segment {
                Segment::Key(key) if i == 0 => write!(f, "{}", super::shorten(key))?,
                Segment::Key(key) => write!(f, ".{}", super::shorten(key))?,
                Segment::Index(index) => write!(f, "[{index}]")?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_trip() {
        for text in ["seed", "ao.samples", "stages[1].render.dimensions[0]", "a[0][1].b"] {
            assert_eq!(show_path(&parse_path(text).unwrap()), text);
        }
    }

    #[test]
    fn malformed() {
        for text in
            ["", ".", "a.", ".a", "a..b", "a[", "a[x]", "a[-1]", "a]", "a[0]b", "[0]", "a[99999999999999999999]"]
        {
            assert!(parse_path(text).is_err(), "{text}");
        }
    }
}
