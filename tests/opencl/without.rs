//! Without OpenCL, or with less of it than was asked for.

use std::path::Path;
use std::process::Command;

use super::ao4d;

const PIPELINE: &str = "name: p
stages:
  - scene: {objects: [{tesseract: {size: 1}}]}
  - occlusion: {samples: 4, file: ao.f32}
";

/// The program where the loader finds no platform.
fn without_platforms(folder: &Path, arguments: &[&str]) -> std::process::Output {
    let vendors = folder.join("no-vendors");
    std::fs::create_dir_all(&vendors).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_ao4d"));
    command.current_dir(folder).args(arguments).env("OCL_ICD_VENDORS", &vendors).env_remove("OCL_ICD_FILENAMES");
    command.output().unwrap()
}

#[test]
fn what_is_missing_is_told() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("p.yaml"), PIPELINE).unwrap();
    for verb in ["run", "check"] {
        for backend in ["opencl", "opencl:0.0"] {
            let output = without_platforms(folder.path(), &[verb, "p.yaml", "--backend", backend]);
            let told = String::from_utf8(output.stderr).unwrap();
            assert_eq!(output.status.code(), Some(3), "{told}");
            for part in ["error: there is no OpenCL here", "pocl-opencl-icd", "ocl-icd-libopencl1", "--backend cpu"] {
                assert!(told.contains(part), "{told}");
            }
            assert!(!folder.path().join("out").exists());
        }
    }
    // The processor doesn't need it.
    let output = without_platforms(folder.path(), &["run", "p.yaml"]);
    assert_eq!(output.status.code(), Some(0));
    let output = without_platforms(folder.path(), &["devices"]);
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success() && said.starts_with("cpu") && said.contains("there is no OpenCL here"), "{said}");
    let output = without_platforms(folder.path(), &["devices", "--json"]);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["opencl"], serde_json::json!([]));
    assert!(report["missing"].as_str().unwrap().contains("pocl-opencl-icd"));
}

#[test]
fn studies_stay_on_the_processor() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("p.yaml"), PIPELINE).unwrap();
    let output = ao4d(folder.path(), &["study", "p.yaml", "--backend", "opencl"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8(output.stderr).unwrap().contains("use --backend cpu"));
}

#[test]
#[ignore = "needs an OpenCL device: run tests/all"]
fn devices_are_listed_and_chosen_by_number() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("p.yaml"), PIPELINE).unwrap();
    let output = ao4d(folder.path(), &["devices", "--json"]);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let devices = report["opencl"].as_array().unwrap();
    assert!(!devices.is_empty() && report["missing"].is_null(), "{report}");
    assert_eq!(devices.iter().filter(|d| d["preferred"] == true).count(), 1);
    for device in devices {
        assert!(device["memory"].as_u64().unwrap() > 0 && device["double_precision"].is_boolean(), "{device}");
        let backend = device["backend"].as_str().unwrap();
        let output = ao4d(folder.path(), &["check", "p.yaml", "--backend", backend]);
        assert!(output.status.success(), "{backend}");
    }
    let output = ao4d(folder.path(), &["run", "p.yaml", "--backend", "opencl:7.3"]);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(3), "{told}");
    assert!(told.contains("there is no OpenCL device 7.3") && told.contains("0.0 "), "{told}");
}
