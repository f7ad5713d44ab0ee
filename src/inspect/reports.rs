//! Comparisons for other readers: JUnit's XML, which test servers show, and Markdown, for people.

use std::fmt::Write;

use super::folders::{FileComparison, Folders};
use crate::io::xml::escape as xml_escaped;

impl Folders {
    /// As JUnit's XML: a test case a file, failed where it differs.
    pub fn junit(&self) -> String {
        let (all, failed) = (self.files.len(), self.different());
        let mut text = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
        let _ = writeln!(text, "<testsuites tests=\"{all}\" failures=\"{failed}\">");
        let _ =
            writeln!(text, "  <testsuite name=\"ao4d compare\" tests=\"{all}\" failures=\"{failed}\" errors=\"0\">");
        for FileComparison { file, comparison } in &self.files {
            let name = xml_escaped(&file.to_string_lossy());
            if comparison.same {
                let _ = writeln!(text, "    <testcase classname=\"ao4d.compare\" name=\"{name}\"/>");
                continue;
            }
            let told = comparison.to_string();
            let first = told.lines().next().unwrap_or_default().trim_start_matches("different: ");
            let _ = writeln!(text, "    <testcase classname=\"ao4d.compare\" name=\"{name}\">");
            let _ =
                writeln!(text, "      <failure message=\"{}\">{}</failure>", xml_escaped(first), xml_escaped(&told));
            text += "    </testcase>\n";
        }
        text + "  </testsuite>\n</testsuites>\n"
    }

    /// As Markdown: what it comes to, a table of what differs, and the names of what doesn't. `picture` names the picture of a file's
    /// difference, if there is one.
    pub fn markdown(&self, picture: &dyn Fn(&FileComparison) -> Option<String>) -> String {
        let (all, failed) = (self.files.len(), self.different());
        let mut text = match failed {
            0 => format!("# Same: all {all} files\n"),
            _ => format!("# Different: {failed} of {all} files\n"),
        };
        if failed > 0 {
            text += "\n| file | array | differ | largest | RMS | where |\n| --- | --- | ---: | ---: | ---: | --- |\n";
        }
        for file in self.files.iter().filter(|file| !file.comparison.same) {
            let name = cell(&file.file.to_string_lossy());
            for difference in &file.comparison.differences {
                let _ = writeln!(text, "| {name} | {} | | | | |", cell(difference));
            }
            for array in file.comparison.arrays.iter().filter(|array| !array.same) {
                let at = array.at.as_ref().map_or(String::new(), |at| match at.voxel {
                    Some([i, j, k]) => format!("voxel ({i}, {j}, {k}): {} and {}", at.a, at.b),
                    None => format!("{}: {} and {}", at.index, at.a, at.b),
                });
                let (of, largest, rms) = (array.count, array.largest, array.rms);
                let _ = writeln!(
                    text,
                    "| {name} | {} | {} of {of} | {largest:.3e} | {rms:.3e} | {at} |",
                    cell(&array.name),
                    array.different
                );
            }
        }
        for (file, picture) in self.files.iter().filter_map(|file| Some((file, picture(file)?))) {
            let name = cell(&file.file.to_string_lossy());
            let _ = writeln!(text, "\n{name}: the first, the second, and where they differ\n\n![{name}]({picture})");
        }
        let same: Vec<String> =
            self.files.iter().filter(|f| f.comparison.same).map(|f| cell(&f.file.to_string_lossy())).collect();
        if !same.is_empty() && failed > 0 {
            let _ = writeln!(text, "\nSame: {}.", same.join(", "));
        }
        text
    }
}

/// A text within a table.
fn cell(text: &str) -> String {
    let mut shown = String::new();
    for c in text.chars() {
        match c {
            '|' | '\\' | '`' | '*' | '_' | '<' | '[' | ']' => {
                shown.push('\\');
                shown.push(c);
            }
            c if c.is_control() => shown.push(' '),
            c => shown.push(c),
        }
    }
    shown
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::inspect::compare::{Comparison, Tolerance, lists};
    use crate::volume::Values;

    fn folders() -> Folders {
        let differs = lists("a|b", &Values::F32(vec![1.0, 2.0]), &Values::F32(vec![1.0, 2.5]), &Tolerance::default());
        let same = Comparison { same: true, ..Comparison::default() };
        let of = |name: &str, comparison| FileComparison { file: PathBuf::from(name), comparison };
        Folders { same: false, files: vec![of("<x>.f32", differs), of("y.f32", same)] }
    }

    #[test]
    fn junit_is_xml_that_says_what_failed() {
        let text = folders().junit();
        let document = roxmltree::Document::parse(&text).unwrap();
        let suite = document.descendants().find(|n| n.has_tag_name("testsuite")).unwrap();
        assert_eq!((suite.attribute("tests"), suite.attribute("failures")), (Some("2"), Some("1")));
        let cases: Vec<_> = document.descendants().filter(|n| n.has_tag_name("testcase")).collect();
        assert_eq!(cases[0].attribute("name"), Some("<x>.f32"));
        let failure = cases[0].first_element_child().unwrap();
        assert!(failure.text().unwrap().contains("1 of 2 numbers differ"));
        assert!(cases[1].first_element_child().is_none());
    }

    #[test]
    fn markdown_is_a_table() {
        let text = folders().markdown(&|file| (!file.comparison.same).then(|| "pictures/x.png".to_owned()));
        assert!(text.starts_with("# Different: 1 of 2 files\n"), "{text}");
        assert!(text.contains("| \\<x>.f32 | a\\|b | 1 of 2 | 5.000e-1 | 3.536e-1 | 1: 2.0 and 2.5 |\n"), "{text}");
        assert!(text.contains("![\\<x>.f32](pictures/x.png)") && text.ends_with("\nSame: y.f32.\n"), "{text}");
    }
}
