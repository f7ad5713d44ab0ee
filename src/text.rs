//! Text that came from outside, made safe for the place where it is printed; and numbers as people write them.
//!
//! Names and paths may hold any character. On a terminal some of them are commands (move the cursor, set the title), in
//! XML and Markdown some are markup, so each way out has its function here.

use std::borrow::Cow;

/// Whether a terminal obeys the character, or lets it turn the order of those around it.
pub(crate) fn is_command(c: char) -> bool {
    let control = c.is_control() && !matches!(c, '\n' | '\t');
    control || matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{feff}')
}

/// A text for a terminal: lines and tabs stay, any other control character becomes `\u001b`, which JSON reads back too.
pub fn for_terminal(text: &str) -> Cow<'_, str> {
    replaced(text, |c| is_command(c).then(|| format!("\\u{:04x}", u32::from(c))))
}

/// A text for XML, inside an element or an attribute. What XML has no way to say becomes U+FFFD.
pub fn for_xml(text: &str) -> Cow<'_, str> {
    replaced(text, |c| {
        Some(match c {
            '&' => "&amp;".into(),
            '<' => "&lt;".into(),
            '>' => "&gt;".into(),
            '"' => "&quot;".into(),
            '\'' => "&apos;".into(),
            '\n' | '\t' | '\r' => format!("&#{};", u32::from(c)),
            '\u{fffe}' | '\u{ffff}' => "\u{fffd}".into(),
            c if c.is_control() => "\u{fffd}".into(),
            _ => return None,
        })
    })
}

/// A text for a line of Markdown: nothing in it is a link, an emphasis, a heading or raw HTML.
pub fn for_markdown(text: &str) -> Cow<'_, str> {
    // Between letters an underscore is one; elsewhere it may begin an emphasis.
    let within = |parts: &[char]| matches!(parts, [a, '_', b] if a.is_alphanumeric() && b.is_alphanumeric());
    let letters: Vec<char> = text.chars().collect();
    let inner = letters.windows(3).filter(|parts| within(parts)).count();
    let underscores = inner != letters.iter().filter(|&&c| c == '_').count();
    replaced(text, |c| {
        Some(match c {
            '&' => "&amp;".into(),
            '<' => "&lt;".into(),
            '>' => "&gt;".into(),
            '_' if underscores => "\\_".into(),
            '\\' | '`' | '*' | '[' | ']' | '#' | '|' | '!' | '~' | '$' => format!("\\{c}"),
            c if c == '\n' || c == '\t' || is_command(c) => " ".into(),
            _ => return None,
        })
    })
}

/// The text, or its beginning and its end if it is longer than `most` characters.
pub fn shortened(text: &str, most: usize) -> Cow<'_, str> {
    let count = text.chars().count();
    if count <= most {
        return Cow::Borrowed(text);
    }
    let half = most / 2;
    let start: String = text.chars().take(half).collect();
    let end: String = text.chars().skip(count - half).collect();
    Cow::Owned(format!("{start} ... {end}"))
}

fn replaced(text: &str, with: impl Fn(char) -> Option<String>) -> Cow<'_, str> {
    if text.chars().all(|c| with(c).is_none()) {
        return Cow::Borrowed(text);
    }
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match with(c) {
            Some(other) => safe.push_str(&other),
            None => safe.push(c),
        }
    }
    Cow::Owned(safe)
}

/// A number with as few characters as tell it exactly: `0.25`, `1000000`, `1e300`.
pub fn number(x: f64) -> String {
    let (plain, short) = (x.to_string(), format!("{x:e}"));
    if plain.len() <= short.len().max(10) { plain } else { short }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terminals_get_no_commands() {
        assert_eq!(
            for_terminal("a\x1b]0;x\x07\x7f\u{9b}\u{202e}b\n\tc"),
            "a\\u001b]0;x\\u0007\\u007f\\u009b\\u202eb\n\tc"
        );
        assert_eq!(for_terminal("größer 4³"), "größer 4³");
    }

    #[test]
    fn xml_parses_and_reads_back() {
        let name = "a]]>b <img src='x' title=\"y\"> & \u{e4}\n\t";
        let file = format!("<a b='{0}' c=\"{0}\">{0}</a>", for_xml(&format!("{name}\u{1}\u{fffe}\u{1b}")));
        let xml = roxmltree::Document::parse(&file).unwrap();
        let found = xml.root_element();
        let expected = format!("{name}\u{fffd}\u{fffd}\u{fffd}");
        assert_eq!(
            (found.attribute("b"), found.attribute("c"), found.text()),
            (Some(&*expected), Some(&*expected), Some(&*expected))
        );
    }

    #[test]
    fn markdown_shows_what_is_written() {
        assert_eq!(for_markdown("a <b>*c*</b>\n# d [e](f)"), "a &lt;b&gt;\\*c\\*&lt;/b&gt; \\# d \\[e\\](f)");
        assert_eq!(for_markdown("two_cubes, 4D"), "two_cubes, 4D");
        assert_eq!(for_markdown("_two_cubes_"), "\\_two\\_cubes\\_");
    }

    #[test]
    fn numbers_are_short() {
        for (x, text) in [
            (0.0, "0"),
            (180.0, "180"),
            (-0.01, "-0.01"),
            (1e300, "1e300"),
            (5e-324, "5e-324"),
            (0.1 + 0.2, "0.30000000000000004"),
            (1e12, "1e12"),
            (65_536.0, "65536"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(number(x), text);
        }
    }
}
