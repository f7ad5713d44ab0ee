//! The nearest right word, for whoever mistyped one.

/// The word among `known` that was probably meant, if one is near enough to be worth proposing.
///
/// Near is judged by the optimal string alignment distance (insertions, deletions, replacements and swapped neighbours
/// count one each), ignoring case and taking `-`, `_` and spaces for the same; a third of the letters may be wrong.
/// Failing that, a word that begins with what was typed, or the other way round, will do (`fov` has none).
pub fn nearest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let plain = |w: &str| w.to_lowercase().replace(['_', ' '], "-");
    let typed = plain(word);
    // Texts can be of any length, and the distance takes time and memory quadratic in it.
    if typed.is_empty() || typed.len() > 64 {
        return None;
    }
    let mut best: Option<(usize, &str)> = None;
    for candidate in known {
        let right = plain(candidate);
        let mut distance = strsim::osa_distance(&typed, &right);
        let allowed = (typed.chars().count().max(right.chars().count()) / 3).max(1);
        let prefix =
            typed.chars().count() >= 3 && (right.starts_with(&typed) || typed.starts_with(&right) && right.len() >= 3);
        if distance > allowed && prefix {
            distance = allowed; // as good as a tolerable slip
        }
        // A word of which no letter is right isn't near, however short (`w` for `x`).
        let some_right = distance < typed.chars().count().min(right.chars().count());
        if distance <= allowed && some_right && best.is_none_or(|(least, _)| distance < least) {
            best = Some((distance, candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}

/// The whole complaint: `unknown key, did you mean \`samples\`? (known: id, input, samples)`.
///
/// `what` opens it, and quotes `word` (what was typed) where the reader can't see it otherwise.
pub fn unknown<'a>(what: &str, word: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let known: Vec<&str> = known.into_iter().collect();
    let proposal =
        nearest(word, known.iter().copied()).map(|right| format!(", did you mean `{right}`?")).unwrap_or_default();
    let all = if known.is_empty() { "there are none".into() } else { format!("known: {}", known.join(", ")) };
    format!("{what}{proposal} ({all})")
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEYS: [&str; 6] = ["id", "input", "method", "samples", "max_samples", "field_of_view"];

    #[test]
    fn slips_of_the_finger() {
        for (typed, meant) in [
            ("sampels", "samples"),
            ("sample", "samples"),
            ("Samples", "samples"),
            ("max-samples", "max_samples"),
            ("fieldofview", "field_of_view"),
            ("field", "field_of_view"),
            ("di", "id"),
            ("imput", "input"),
        ] {
            assert_eq!(nearest(typed, KEYS), Some(meant), "{typed}");
        }
    }

    #[test]
    fn nothing_near() {
        for typed in ["", "fov", "colour", "x", "q", &"samples".repeat(1000)] {
            assert_eq!(nearest(typed, KEYS), None, "{typed}");
        }
    }

    #[test]
    fn one_letter_is_no_slip_of_another() {
        assert_eq!(nearest("w", ["x", "y", "z"]), None);
        assert_eq!(nearest("X", ["x", "y", "z"]), Some("x"));
    }

    #[test]
    fn message() {
        assert_eq!(
            unknown("unknown key", "sampels", ["id", "samples"]),
            "unknown key, did you mean `samples`? (known: id, samples)"
        );
        assert_eq!(unknown("no stage `x`", "x", []), "no stage `x` (there are none)");
    }
}
