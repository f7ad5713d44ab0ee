//! `.pvd`: ParaView's list of the files of a time series.

use std::io::Write;

use super::Error;

/// Writes a list of files, each with its time. Paths are relative to the list.
///
/// # Errors
/// If the sink fails, or a time or a path cannot be written.
pub fn write<'a>(mut sink: impl Write, files: impl IntoIterator<Item = (f64, &'a str)>) -> Result<(), Error> {
    sink.write_all(
        b"<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\">\n",
    )?;
    sink.write_all(b"  <Collection>\n")?;
    for (time, file) in files {
        if file.is_empty() || file.chars().any(char::is_control) {
            return Err(Error::Name { what: "the file name", name: file.into() });
        }
        if !time.is_finite() {
            let (found, expected) = (time.to_string(), "a finite time".into());
            return Err(Error::Shape { array: file.into(), found, expected });
        }
        let file = super::xml::escape(file);
        writeln!(sink, "    <DataSet timestep=\"{time:?}\" group=\"\" part=\"0\" file=\"{file}\"/>")?;
    }
    sink.write_all(b"  </Collection>\n</VTKFile>\n")?;
    Ok(())
}

#[cfg(test)]
mod tests {
    #[test]
    fn one_line_a_file() {
        let mut text = Vec::new();
        super::write(&mut text, [(0.0, "a.vti"), (0.5, "b&c.vti")]).unwrap();
        let text = String::from_utf8(text).unwrap();
        let document = roxmltree::Document::parse(&text).unwrap();
        let files: Vec<_> = document.descendants().filter_map(|n| n.attribute("file")).collect();
        assert_eq!(files, ["a.vti", "b&c.vti"]);
        assert!(super::write(Vec::new(), [(f64::NAN, "a.vti")]).is_err());
    }
}
