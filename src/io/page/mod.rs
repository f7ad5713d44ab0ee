//! A page: one HTML file with volumes in it and the program that shows them, for anybody with a browser.
//!
//! Nothing is fetched: style, program and pictures stand in the file, and its security policy forbids everything else. A
//! picture's voxels are packed (`pack`) and written in base64, a line a frame, so that the browser unpacks only those
//! that are looked at. `page.js` unpacks them and draws: it is the other half of this module.

mod pack;

use std::io::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::json;

use super::Error;
use crate::volume::Grid;

pub use pack::{Palette, Voxels};

const HTML: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// Pictures of one grid that follow each other, or a single one.
#[derive(Debug)]
pub struct Series {
    /// What it is called.
    pub name: String,
    /// Where its voxels are in the image.
    pub grid: Grid,
    /// The colours that its voxels have.
    pub palette: Palette,
    /// Whether shades are ambient occlusion, so that a picture without them is one without it.
    pub separable: bool,
    /// Each frame: what it is called, and its voxels, packed.
    pub frames: Vec<(String, Vec<u8>)>,
}

/// Writes a page. The same series make the same bytes.
///
/// # Errors
/// If writing fails.
pub fn write(sink: &mut impl Write, title: &str, program: &str, rate: f64, series: &[Series]) -> Result<(), Error> {
    let described: Vec<_> = series
        .iter()
        .map(|series| {
            json!({
                "name": series.name,
                "dimensions": series.grid.dimensions,
                "origin": series.grid.origin,
                "spacing": series.grid.spacing,
                "separable": series.separable,
                "palette": series.palette.colours(),
                "frames": series.frames.iter().map(|(name, _)| name).collect::<Vec<_>>(),
            })
        })
        .collect();
    let page = json!({ "program": program, "rate": rate, "shades": pack::SHADES, "series": described });
    // In a script nothing may look like the script's end.
    let page = page.to_string().replace('<', "\\u003c");
    let title = super::xml::escape(title);
    let mut rest = HTML;
    while let Some(at) = rest.find('%') {
        write!(sink, "{}", &rest[..at])?;
        let (word, after) = rest[at + 1..].split_once('%').unwrap_or((&rest[at + 1..], ""));
        match word {
            "TITLE" => write!(sink, "{title}")?,
            "STYLE" => write!(sink, "{STYLE}")?,
            "SCRIPT" => write!(sink, "{SCRIPT}")?,
            "PAGE" => write!(sink, "{page}")?,
            _ => {
                for (i, series) in series.iter().enumerate() {
                    writeln!(sink, "<script type=\"text/plain\" id=\"data{i}\">")?;
                    for (_, bytes) in &series.frames {
                        writeln!(sink, "{}", STANDARD.encode(bytes))?;
                    }
                    writeln!(sink, "</script>")?;
                }
            }
        }
        rest = after;
    }
    Ok(write!(sink, "{rest}")?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_holds_all_of_itself_and_no_name_can_break_it() {
        let grid = Grid { dimensions: [1, 1, 1], origin: [0.0; 3], spacing: [1.0; 3] };
        let name = "</script><b>".to_owned();
        let frames = vec![("first".to_owned(), vec![1, 2, 3])];
        let series = Series { name: name.clone(), grid, palette: Palette::default(), separable: true, frames };
        let mut page = Vec::new();
        write(&mut page, &name, "ao4d", 24.0, &[series]).unwrap();
        let text = String::from_utf8(page).unwrap();
        assert!(text.contains("<title>&lt;/script&gt;&lt;b&gt;</title>") && !text.contains(&name));
        assert_eq!(text.matches("</script>").count(), 3, "the page, the data, the program");
        assert!(text.contains("id=\"data0\">\nAQID\n</script>") && !text.contains("%PAGE%"));
        // Whoever opens the file asks nobody for anything.
        for word in ["http://", "https://", "src=", "@import", "url(", "fetch(", "XMLHttpRequest"] {
            assert!(!text.contains(word), "{word}");
        }
        assert!(text.contains("default-src 'none'"));
    }
}
