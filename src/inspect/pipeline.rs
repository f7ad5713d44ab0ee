//! The pipeline that a file tells it was made by.

use std::ffi::OsString;
use std::path::Path;

use super::Error;
use super::compare::text_of;
use crate::io::vtk::{self, DataSet, Wanted};
use crate::io::{PIPELINE, png};
use crate::occlusion::Sidecar;

/// What a file has to say where others would tell.
const NOTHING: &str = "it was not made by `ao4d run`, or by a version that did not write it yet";

/// The text of the pipeline that made a file, as YAML: from the field data of a `.vti`, `.vtu` or `.vtp`, the text of a `.png`,
/// or what stands beside a `.f32`.
///
/// # Errors
/// If the file can't be read, or tells of none.
pub fn pipeline(path: &Path) -> Result<String, Error> {
    let none = |message: &str| Error::Pipeline { path: path.into(), message: message.into() };
    let open = |path: &Path| crate::input::read(path).map_err(|cause| Error::Open { path: path.into(), cause });
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    let text = match ending.as_str() {
        "vti" | "vtu" | "vtp" => {
            let problem = |problem| vtk::Error::File { path: path.into(), problem };
            let fields = match vtk::parse_wanted(&open(path)?, Wanted::Named(&[PIPELINE])).map_err(problem)? {
                DataSet::Image(image) => image.field_data,
                DataSet::Unstructured(mesh) => mesh.field_data,
            };
            text_of(&fields, PIPELINE)
        }
        "png" => png::text(&open(path)?, PIPELINE).map_err(|cause| none(&format!("it is damaged: {cause}")))?,
        "f32" | "yaml" => {
            let mut beside = OsString::from(path);
            if ending == "f32" {
                beside.push(".yaml");
            }
            let text =
                String::from_utf8(open(Path::new(&beside))?).map_err(|_| none("what stands beside it is no text"))?;
            Sidecar::from_yaml(&text).map_err(|cause| none(&cause.to_string()))?.pipeline
        }
        _ => return Err(none("its format has no place for one; ask a .vti, .vtu, .png or .f32 of the same run")),
    };
    // Files of earlier versions have its name there.
    text.filter(|text| text.contains("\nstages:")).ok_or_else(|| none(NOTHING))
}
