//! Whether an XML text is of a shape that can be parsed quickly, found out in one pass before it is.
//!
//! The parser takes time quadratic in the attributes of an element and in the namespaces that elements inherit, so a small
//! file could keep it busy for minutes. VTK's files are flat, and their elements have some ten attributes. The
//! pass below only counts; what is wrong in other ways, the parser says better.

use super::Problem;

/// Elements inside each other; VTK nests some eight.
const DEEPEST: usize = 32;
/// Attributes of an element; VTK gives it some ten.
const MOST_ATTRIBUTES: usize = 64;

/// Refuses elements that are nested too deep, or have too many attributes.
pub(super) fn check(xml: &str) -> Result<(), Problem> {
    let mut depth = 0usize;
    let mut rest = xml;
    while let Some(at) = rest.find('<') {
        rest = &rest[at..];
        // Parts with an ending of their own, which may have any brackets inside.
        let long = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>")];
        if let Some((begin, end)) = long.into_iter().find(|(begin, _)| rest.starts_with(begin)) {
            let Some(length) = rest[begin.len()..].find(end) else { return Ok(()) };
            rest = &rest[begin.len() + length + end.len()..];
            continue;
        }
        let Tag { length, attributes, closed } = tag(rest);
        if attributes > MOST_ATTRIBUTES {
            return Err(Problem::Xml(format!("an element has more than {MOST_ATTRIBUTES} attributes")));
        }
        if rest.starts_with("</") {
            depth = depth.saturating_sub(1);
        } else if !closed && !rest.starts_with("<!") {
            depth += 1;
        }
        if depth > DEEPEST {
            return Err(Problem::Xml(format!("its elements are more than {DEEPEST} deep")));
        }
        rest = &rest[length..];
    }
    Ok(())
}

struct Tag {
    /// Bytes from `<` to behind `>`.
    length: usize,
    attributes: usize,
    /// Whether it ends in `/>`.
    closed: bool,
}

/// The tag at the beginning of a text.
fn tag(text: &str) -> Tag {
    let (mut quote, mut attributes, mut before) = (None, 0, b' ');
    for (i, &byte) in text.as_bytes().iter().enumerate() {
        match (quote, byte) {
            (None, b'>') => return Tag { length: i + 1, attributes, closed: before == b'/' },
            (None, b'=') => attributes += 1,
            (None, b'"' | b'\'') => quote = Some(byte),
            (Some(mark), _) if mark == byte => quote = None,
            _ => {}
        }
        before = byte;
    }
    Tag { length: text.len(), attributes, closed: false }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deep_and_wide_files_are_refused_before_they_are_parsed() {
        let flat = "<a><!-- <b <c --><b x='>' y=\"/>\"/><![CDATA[<c><d>]]><?p <e?></a>".repeat(1000);
        assert!(check(&flat).is_ok());
        let deep = |n: usize| format!("{}{}", "<a>".repeat(n), "</a>".repeat(n));
        assert!(check(&deep(DEEPEST)).is_ok());
        let wide = |n: usize| format!("<a{}/>", " x='1'".repeat(n));
        assert!(check(&wide(MOST_ATTRIBUTES)).is_ok());
        let spaces: String = (0..20_000).map(|i| format!("<a xmlns:n{i}='u{i}'>")).collect();
        for (text, message) in [
            (deep(DEEPEST + 1), "more than 32 deep"),
            (spaces, "more than 32 deep"),
            (wide(100_000), "more than 64 attributes"),
        ] {
            assert!(check(&text).unwrap_err().to_string().contains(message));
        }
    }

    #[test]
    fn what_is_cut_off_is_left_to_the_parser() {
        for text in ["", "<", "<a", "<a x='", "<!--", "<?x", "<![CDATA[", "</", "a > b"] {
            assert!(check(text).is_ok(), "{text}");
        }
    }
}
