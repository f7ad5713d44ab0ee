//! `ao4d study` on tiny scenes: what it writes, and that what it says is so.

use std::path::Path;
use std::process::{Command, Output};

fn study(folder: &Path, pipeline: &str, arguments: &[&str]) -> Output {
    std::fs::write(folder.join("p.yaml"), pipeline).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_ao4d"));
    command.current_dir(folder).args(["study", "p.yaml"]).args(arguments).output().unwrap()
}

/// Two tetrahedra that face each other like the sides of a groove.
const GROOVE_4D: &str = "name: groove
stages:
  - scene:
      objects:
        - simplices:
            vertices: [[-0.5, -0.5, -0.2, 0.3], [0.1, 0.6, 0, -0.2], [0.1, -0.4, 0.7, -0.3], [0.2, -0.3, -0.7, -0.3]]
            cells: [[0, 1, 2, 3]]
          orientation: eye
        - simplices:
            vertices: [[0.3, 2.2, 0.1, 0.2], [0.2, -1.3, 2, 0.1], [0.2, 0, -0.1, -0.6], [0.3, -0.9, -2, 0.2]]
            cells: [[0, 1, 2, 3]]
          orientation: eye
  - occlusion: {max_distance: 100}
  - render: {dimensions: [8, 8, 8]}
  - write: {vti: image.vti}
";

const FOLD_3D: &str = "name: fold
stages:
  - scene:
      dimension: 3
      objects:
        - simplices:
            vertices: [[0, -1, 0], [0, 1, 0], [1, 0, 1], [-1, 0.5, 0.8]]
            cells: [[0, 2, 1], [0, 1, 3]]
  - occlusion: {id: first}
  - occlusion: {id: second}
";

/// The rows of `study.csv`, by column names.
fn rows(folder: &Path) -> Vec<std::collections::BTreeMap<String, String>> {
    let text = std::fs::read_to_string(folder.join("study.csv")).unwrap();
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
    let head = lines.next().unwrap();
    assert_eq!(head.join(","), "kind,method,samples,repetitions,rmse,maximum,bias,seconds,rays_per_second");
    lines
        .map(|cells| {
            assert_eq!(cells.len(), head.len());
            head.iter().cloned().zip(cells).collect()
        })
        .collect()
}

fn check(pipeline: &str, with_image: bool) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("report");
    let output = study(folder.path(), pipeline, &["--out", "report", "--threads", "2"]);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{message}");
    let mut files: Vec<_> = std::fs::read_dir(&out).unwrap().map(|e| e.unwrap().file_name()).collect();
    files.sort();
    assert_eq!(files, ["study.csv", "study.md", "study.svg"]);
    let report = std::fs::read_to_string(out.join("study.md")).unwrap();
    assert_eq!(String::from_utf8(output.stdout).unwrap(), report);
    for part in ["| as_published | 16 |", "| random | 1,024 |", "| sobol | 65,536 |", "own simplices", "wrong in f32"] {
        assert!(report.contains(part), "{part} is not in {report}");
    }
    assert_eq!(report.contains("## Shading"), with_image);

    let found = rows(&out);
    let error = |method: &str, samples: &str| -> f64 {
        let row = found.iter().find(|r| r["method"] == method && r["samples"] == samples).unwrap();
        assert!(row["seconds"].parse::<f64>().unwrap() > 0.0);
        row["rmse"].parse().unwrap()
    };
    // Random rays follow n^-1/2, Sobol' points do better, the published algorithm stays wrong whatever the rays.
    let ratio = error("random", "16") / error("random", "4096");
    assert!((12.0..21.0).contains(&ratio), "{ratio}");
    assert!(error("sobol", "4096") < 0.6 * error("random", "4096"));
    assert!(error("sobol", "65536") < 1e-3);
    assert!(error("as_published", "4096") > 0.3);
    let of = |shading: &str| found.iter().filter(|r| r["kind"] == "image" && r["method"] == shading).count();
    let shadings = ["flat", "smooth", "voxel", "voxel+denoise", "auto", "screen_space"].map(of);
    assert_eq!(shadings, if with_image { [4, 4, 4, 4, 3, 2] } else { [0; 6] });
    if with_image {
        // Rays at each voxel converge to the truth; a filter makes much of few of them.
        let image = |shading: &str, samples: &str| -> f64 {
            let one = |r: &&std::collections::BTreeMap<String, String>| {
                r["kind"] == "image" && r["method"] == shading && r["samples"] == samples
            };
            found.iter().find(one).unwrap()["rmse"].parse().unwrap()
        };
        assert!(image("voxel", "256") < 0.3 * image("voxel", "16"));
        assert!(image("voxel+denoise", "4") < 0.8 * image("voxel", "4"));
        assert!(image("auto", "256") < image("voxel", "16"));
    }

    let svg = std::fs::read_to_string(out.join("study.svg")).unwrap();
    let picture = roxmltree::Document::parse(&svg).unwrap();
    let texts: Vec<&str> = picture.descendants().filter_map(|n| n.text()).collect();
    for name in ["as_published", "random", "sobol", "exact"] {
        assert!(texts.contains(&name), "{name}");
    }
    for name in ["flat", "smooth", "voxel", "voxel+denoise", "auto", "screen_space"] {
        assert_eq!(texts.contains(&name), with_image, "{name}");
    }
    assert!(!svg.contains("NaN") && !svg.contains("inf"));

    // The same errors on any number of threads; only times differ.
    study(folder.path(), pipeline, &["--out", "again", "--threads", "1"]);
    let again = rows(&folder.path().join("again"));
    assert_eq!(found.len(), again.len());
    for (a, b) in found.iter().zip(&again) {
        for column in ["kind", "method", "samples", "repetitions", "rmse", "maximum", "bias"] {
            assert_eq!(a[column], b[column]);
        }
    }
}

#[test]
fn studies_of_tiny_scenes() {
    check(GROOVE_4D, true);
    check(FOLD_3D, false);
}

#[test]
fn what_cannot_be_studied_is_refused() {
    let without = GROOVE_4D.replace("  - occlusion: {max_distance: 100}\n", "");
    let empty = "name: p\nstages:\n  - scene: {objects: []}\n  - occlusion: {}\n";
    let flat = "name: p\nstages:\n  - scene:\n      objects:\n        - simplices:\n            vertices: [[0, 0, 0, 0], \
                [1, 0, 0, 0], [2, 0, 0, 0], [3, 0, 0, 0]]\n            cells: [[0, 1, 2, 3]]\n  - occlusion: {}\n";
    for (pipeline, part) in [
        (without.as_str(), "there is no `occlusion` to study; add one after the scene"),
        (empty, "the scene is empty: there is no occlusion to study"),
        (flat, "the scene is empty: there is no occlusion to study"),
        ("name: [", "p.yaml:"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let output = study(folder.path(), pipeline, &["--out", "report"]);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains("p.yaml:") && message.contains(part), "{message}");
        assert!(!folder.path().join("report").exists());
    }
}
