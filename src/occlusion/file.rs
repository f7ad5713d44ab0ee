//! Occlusion files: `NAME.f32`, little-endian float32, one value a vertex in the mesh's vertex order and nothing else;
//! and beside it `NAME.f32.yaml`, which says what they are the values of.

use std::fmt::Write;

use serde::{Deserialize, Serialize};
use serde_saphyr::Error;

/// What stands beside an occlusion file.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Sidecar {
    /// Values in the file.
    pub count: usize,
    /// The method's name in the pipeline.
    pub method: String,
    /// Rays a vertex, at most so many if there is a target; none for methods without.
    pub samples: Option<u32>,
    /// The standard error that was aimed at, if one was.
    pub target_error: Option<f64>,
    /// Rays that were asked for a vertex, on average, where that is known.
    pub mean_samples: Option<f64>,
    /// The pipeline's seed.
    pub seed: u64,
    /// Distance beyond which hits don't count; infinite if all do.
    #[serde(default = "infinite")]
    pub max_distance: f32,
    /// Root mean square over the vertices of the standard error of each value.
    pub error_estimate: f64,
    /// The mesh's content hash.
    pub mesh: String,
    /// Name and version of the program.
    pub program: String,
    /// The pipeline that the values were computed by, as YAML.
    pub pipeline: Option<String>,
}

/// Why an occlusion file isn't one, or not that of this mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs)]
pub enum FileError {
    #[error("it holds {found} bytes, but {count} values take {expected}; it is truncated, or belongs to another scene")]
    Length { found: usize, expected: usize, count: usize },
    #[error("value {index} is {value}; an ambient occlusion lies between 0 and 1")]
    Value { index: usize, value: f32 },
    #[error("its sidecar lacks `{0}`")]
    Sidecar(&'static str),
    #[error("its sidecar can't be read: {}", crate::text::shortened(.0, 1000))]
    SidecarText(String),
    #[error(
        "it was computed for another mesh ({found} instead of {expected}); compute it again, or load it into the scene it belongs to"
    )]
    Mesh { found: String, expected: String },
}

/// The bytes of an occlusion file.
pub fn encode(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// The values in an occlusion file for a mesh of `count` vertices.
///
/// # Errors
/// If the length doesn't fit, or a value is not within [0, 1].
pub fn decode(bytes: &[u8], count: usize) -> Result<Vec<f32>, FileError> {
    if bytes.len() != 4 * count {
        return Err(FileError::Length { found: bytes.len(), expected: 4 * count, count });
    }
    let values: Vec<f32> = bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    match values.iter().position(|v| !(0.0..=1.0).contains(v)) {
        Some(index) => Err(FileError::Value { index, value: values[index] }),
        None => Ok(values),
    }
}

impl Sidecar {
    /// As YAML: some lines of `key: value`, with as many digits as mean something.
    pub fn to_yaml(&self) -> String {
        let mut text = String::from("# What the values in the file of this name are.\n");
        let mut line = |key: &str, value: &dyn std::fmt::Display| {
            let _ = writeln!(text, "{key}: {value}");
        };
        line("count", &self.count);
        line("method", &self.method);
        if let Some(samples) = self.samples {
            line("samples", &samples);
        }
        if let Some(error) = self.target_error {
            line("target_error", &error);
        }
        if let Some(mean) = self.mean_samples {
            line("mean_samples", &format!("{mean:.1}"));
        }
        line("seed", &self.seed);
        if self.max_distance.is_finite() {
            line("max_distance", &self.max_distance);
        }
        line("error_estimate", &format!("{:.6}", self.error_estimate));
        line("mesh", &self.mesh);
        line("program", &self.program);
        if let Some(pipeline) = &self.pipeline {
            text.push_str("pipeline: |\n");
            pipeline.lines().for_each(|line| text.extend(["  ", line, "\n"]));
        }
        text
    }

    /// Reads what [`Self::to_yaml`] writes.
    ///
    /// # Errors
    /// If a key is missing, or the text is no YAML of this kind.
    pub fn from_yaml(text: &str) -> Result<Self, FileError> {
        serde_saphyr::from_str(text).map_err(|error| match error.without_snippet() {
            Error::SerdeMissingField { field, .. } => FileError::Sidecar(field),
            other => FileError::SidecarText(other.to_string()),
        })
    }

    /// Refuses a file that belongs to another mesh.
    pub fn check(&self, mesh_hash: &str, vertices: usize) -> Result<(), FileError> {
        if self.count != vertices || self.mesh != mesh_hash {
            return Err(FileError::Mesh { found: short(&self.mesh), expected: short(mesh_hash) });
        }
        Ok(())
    }
}

fn infinite() -> f32 {
    f32::INFINITY
}

fn short(hash: &str) -> String {
    hash.chars().take(12).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sidecars_read_back_and_name_what_is_missing() {
        let sidecar = Sidecar {
            count: 8,
            method: "sobol".into(),
            samples: Some(65_536),
            target_error: Some(0.005),
            mean_samples: Some(812.5),
            seed: u64::MAX,
            max_distance: 0.1,
            error_estimate: 0.0125,
            mesh: "00ff".into(),
            program: "ao4d 0.1.0".into(),
            pipeline: None,
        };
        let text = sidecar.to_yaml();
        assert_eq!(Sidecar::from_yaml(&text), Ok(sidecar.clone()));
        let told = "program: ao4d 0.1.0\nname: \"# p\"\nstages:\n  - scene: {objects: []}\n";
        let telling = Sidecar { pipeline: Some(told.into()), ..sidecar.clone() };
        assert_eq!(Sidecar::from_yaml(&telling.to_yaml()), Ok(telling));
        let plain = Sidecar {
            samples: None,
            target_error: None,
            mean_samples: None,
            max_distance: f32::INFINITY,
            ..sidecar.clone()
        };
        assert_eq!(Sidecar::from_yaml(&plain.to_yaml()), Ok(plain));
        for key in ["count", "method", "seed", "error_estimate", "mesh", "program"] {
            let without: String = text.lines().filter(|l| !l.starts_with(key)).map(|l| format!("{l}\n")).collect();
            assert_eq!(Sidecar::from_yaml(&without), Err(FileError::Sidecar(key)));
        }
        // A hash that looks like a number is text all the same.
        for mesh in ["1".repeat(64), "12e5".into(), "0x1f".into()] {
            assert_eq!(Sidecar::from_yaml(&text.replace("00ff", &mesh)).unwrap().mesh, mesh);
        }
        for (wrong, line) in [(text.replace("count: 8", "count: -8"), 2), (text.replace("seed: ", "seed: [") + "]", 7)]
        {
            let error = Sidecar::from_yaml(&wrong).unwrap_err().to_string();
            assert!(
                error.starts_with("its sidecar can't be read: ") && error.contains(&format!("line {line}")),
                "{error}"
            );
        }
        assert!(sidecar.check("00ff", 8).is_ok());
        assert!(sidecar.check("00fe", 8).is_err());
        assert!(sidecar.check("00ff", 9).is_err());
    }

    #[test]
    fn files_read_back_or_are_refused() {
        let bytes = encode(&[0.0, 0.25, 1.0]);
        assert_eq!(decode(&bytes, 3), Ok(vec![0.0, 0.25, 1.0]));
        for length in 0..bytes.len() {
            assert!(matches!(decode(&bytes[..length], 3), Err(FileError::Length { .. })));
        }
        assert!(matches!(decode(&encode(&[0.5, f32::NAN]), 2), Err(FileError::Value { index: 1, .. })));
    }
}
