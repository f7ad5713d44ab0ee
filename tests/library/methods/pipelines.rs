//! All the way from YAML to files: values known by other means, errors beside values, and what goes wrong.

use std::path::Path;
use std::process::{Command, Output};

use ao4d::io::vtk;
use ao4d::occlusion::{Sidecar, decode};
use ao4d::pipeline::{Pipeline, Settings, run};
use ao4d::progress::Silent;
use ao4d::stages::scene::AnyMesh;

fn ao4d(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ao4d")).current_dir(folder).args(arguments).output().unwrap()
}

fn floats(path: &Path) -> Vec<f32> {
    let bytes = std::fs::read(path).unwrap();
    decode(&bytes, bytes.len() / 4).unwrap()
}

/// Runs a scene with an occlusion stage, written in YAML; returns each vertex with its value.
fn values(dimension: usize, objects: &str, occlusion: &str) -> Vec<(Vec<f32>, f32)> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.yaml");
    let stages = format!(
        "  - scene: {{dimension: {dimension}, objects: [{objects}]}}\n  - occlusion: {{{occlusion}, file: ao.f32}}\n"
    );
    std::fs::write(&path, format!("name: p\nstages:\n{stages}")).unwrap();
    let pipeline = Pipeline::load(&path, &[], Some(folder.path().join("out"))).unwrap();
    run(&pipeline, &Settings::default(), &Silent).unwrap();
    let vertices: Vec<Vec<f32>> = match pipeline.prepare(|_| true).unwrap().meshes.remove(0).unwrap() {
        AnyMesh::Three(mesh) => mesh.vertices.iter().map(|v| v.iter().copied().collect()).collect(),
        AnyMesh::Four(mesh) => mesh.vertices.iter().map(|v| v.iter().copied().collect()).collect(),
    };
    vertices.into_iter().zip(floats(&folder.path().join("out/ao.f32"))).collect()
}

/// A vector of this dimension: these numbers, and then the last again and again.
fn vector(dimension: usize, numbers: &[f64]) -> String {
    let last = *numbers.last().unwrap();
    let all: Vec<f64> = (0..dimension).map(|i| *numbers.get(i).unwrap_or(&last)).collect();
    format!("{all:?}")
}

fn the_box(dimension: usize, low: f64, high: f64) -> String {
    format!("{{box: {{min: {}, max: {}}}}}", vector(dimension, &[low]), vector(dimension, &[high]))
}

#[test]
fn a_convex_body_alone_is_open() {
    for (dimension, method) in [(3, "exact"), (4, "exact"), (4, "adaptive")] {
        let found = values(dimension, &the_box(dimension, -1.0, 1.0), &format!("method: {method}"));
        // A corner has a shading point for each of its faces.
        assert_eq!(found.len(), dimension << dimension);
        assert!(found.iter().all(|(_, value)| *value == 1.0), "{found:?}");
    }
}

#[test]
fn what_is_inside_a_closed_body_is_dark() {
    for dimension in [3, 4] {
        let objects = format!("{}, {}", the_box(dimension, -3.0, 3.0), the_box(dimension, -0.5, 0.25));
        let found = values(dimension, &objects, "method: exact");
        let (outside, inside) = found.split_at(dimension << dimension);
        assert!(outside.iter().all(|(_, value)| *value == 1.0), "{outside:?}");
        assert!(inside.iter().all(|(_, value)| *value < 1e-12), "{inside:?}");
    }
}

#[test]
fn a_fold_is_the_same_open_or_closed() {
    for dimension in [3, 4] {
        // The middle of the groove's bottom, where two walls of a closed body meet at a right angle.
        let body = format!(
            "{{cut_cube: {{min: {}, max: {}, cuts: [{{from: {}, to: {}}}], subdivisions: 2}}, crease_angle: off}}",
            vector(dimension, &[-1.0]),
            vector(dimension, &[1.0]),
            vector(dimension, &[0.0, 0.0, -2.0]),
            vector(dimension, &[2.0]),
        );
        let closed = values(dimension, &body, "method: exact");
        let bottom = closed.iter().find(|(v, _)| v.iter().all(|&x| x == 0.0)).unwrap().1;
        assert_eq!(bottom, std::f32::consts::FRAC_1_SQRT_2);
        // The simplices around that point alone: walls along +x and +y, each cut in 2^(D-2) by the other axes.
        let axis = |i: usize, sign: f64| {
            let coordinates: Vec<f64> = (0..dimension).map(|k| if k == i { sign } else { 0.0 }).collect();
            format!("{coordinates:?}")
        };
        let mut vertices = vec![vector(dimension, &[0.0]), axis(0, 1.0), axis(1, 1.0)];
        (2..dimension).for_each(|i| vertices.extend([axis(i, 1.0), axis(i, -1.0)]));
        let mut cells = Vec::new();
        for wall in [1, 2] {
            for signs in 0..1usize << (dimension - 2) {
                let mut cell = vec![0, wall];
                cell.extend((2..dimension).map(|i| 2 * i - 1 + (signs >> (i - 2) & 1)));
                // Neighbours in a wall alternate; the walls face each other.
                if (signs.count_ones() % 2 == 1) ^ (wall == 1) {
                    cell.swap(0, 1);
                }
                cells.push(format!("{cell:?}"));
            }
        }
        let fold = format!("{{simplices: {{vertices: [{}], cells: [{}]}}}}", vertices.join(", "), cells.join(", "));
        let open = values(dimension, &fold, "method: exact");
        assert_eq!(open[0].1, bottom, "{dimension}");
    }
}

const PAIR: &str = "name: p
stages:
  - scene:
      objects:
        # A groove that is open to the eye, and a box beside it.
        - cut_cube:
            min: [-0.8, -0.5, -0.5, -2]
            max: [0.5, 0.5, 0.5, -1]
            cuts: [{from: [-0.6, -2, -2, -1.4], to: [0.3, 2, 2, 0]}]
            subdivisions: 1
        - box: {min: [0.55, -0.6, -0.4, -2.2], max: [1.2, 0.7, 0.8, -0.9]}
  - occlusion: {OCCLUSION, file: ao.f32}
  - render: {dimensions: [8, 8, 8], SHADING}
  - write: {vti: image.vti, vtu: scene.vtu}
";

fn pair(folder: &Path, occlusion: &str, shading: &str) {
    let text = PAIR.replace("OCCLUSION", occlusion).replace("SHADING", shading);
    std::fs::write(folder.join("p.yaml"), text).unwrap();
}

#[test]
fn visible_points_in_closed_form() {
    let folder = tempfile::tempdir().unwrap();
    let mut images = Vec::new();
    for occlusion in ["method: exact", "method: adaptive", "samples: 8192"] {
        pair(folder.path(), occlusion, "shading: voxel");
        let output = ao4d(folder.path(), &["run", "p.yaml", "-q", "--out", "out"]);
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        let image = vtk::read_volume(&folder.path().join("out/image.vti")).unwrap();
        images.push(image.array("ambient_occlusion").unwrap().values.to_f64());
    }
    assert!(images[0].iter().filter(|&&a| a < 0.95).count() > 5, "{:?}", images[0]);
    let off = |image: &[f64]| images[0].iter().zip(image).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let (adaptive, sampled) = (off(&images[1]), off(&images[2]));
    assert!(sampled > 0.0 && sampled < 5e-3 && adaptive < 0.04, "{sampled} {adaptive}");
}

#[test]
fn too_rich_for_the_budget() {
    let folder = tempfile::tempdir().unwrap();
    for shading in ["shading: smooth", "shading: voxel"] {
        pair(folder.path(), "method: exact, max_cones: 3", shading);
        let output = ao4d(folder.path(), &["run", "p.yaml", "-q"]);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(3), "{message}");
        let place = "error: ambient occlusion: vertex ";
        assert!(message.starts_with(place), "{message}");
        for part in [" simplices above the horizon of (", "more than 3 cones", "raise `max_cones`", "`method: sobol`"] {
            assert!(message.contains(part), "{message}");
        }
        assert!(!folder.path().join("out/p/ao.f32").exists());
    }
}

#[test]
fn errors_stand_beside_values() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let once = |arguments: &[&str]| {
        let mut all = vec!["run", "p.yaml", "-q", "--out", "out"];
        all.extend(arguments);
        let output = ao4d(folder.path(), &all);
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        let sidecar = Sidecar::from_yaml(&std::fs::read_to_string(out.join("ao.f32.yaml")).unwrap()).unwrap();
        let mesh = vtk::read_mesh(&out.join("scene.vtu")).unwrap();
        let error = mesh.point_array("occlusion_error").map(|a| a.values.to_f64());
        (sidecar, error)
    };
    pair(folder.path(), "target_error: 0.01, max_samples: 5000", "shading: smooth");
    let (sidecar, error) = once(&[]);
    let errors = floats(&out.join("ao.error.f32"));
    let wide = |errors: &[f32]| Some(errors.iter().map(|&e| f64::from(e)).collect::<Vec<_>>());
    assert_eq!(error, wide(&errors));
    assert_eq!((sidecar.samples, sidecar.target_error), (Some(5000), Some(0.01)));
    let mean = sidecar.mean_samples.unwrap();
    assert!(mean > 128.0 && mean < 3000.0, "{mean}");
    let rms = (errors.iter().map(|&e| f64::from(e).powi(2)).sum::<f64>() / errors.len() as f64).sqrt();
    assert!((sidecar.error_estimate - rms).abs() < 1e-6 && rms > 1e-3 && rms <= 0.01, "{rms}");
    // The mesh alone made again, from the errors that were kept.
    std::fs::remove_file(out.join("scene.vtu")).unwrap();
    assert_eq!(once(&[]).1, wide(&errors));
    // The same on any number of threads.
    once(&["--force", "--threads", "1"]);
    assert_eq!(floats(&out.join("ao.error.f32")), errors);
    pair(folder.path(), "method: exact", "shading: smooth");
    let (sidecar, error) = once(&[]);
    assert_eq!((sidecar.samples, sidecar.mean_samples, sidecar.error_estimate), (None, None, 0.0));
    assert_eq!(error, Some(vec![0.0; errors.len()]));
}
