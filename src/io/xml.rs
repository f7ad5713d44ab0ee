//! Text inside XML.

/// Text as it may stand in an attribute. What XML can't hold at all is left out.
pub(crate) fn escape(text: &str) -> String {
    let held = |c: &char| !c.is_control() || matches!(c, '\n' | '\r' | '\t');
    let text: String = text.chars().filter(held).collect();
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
