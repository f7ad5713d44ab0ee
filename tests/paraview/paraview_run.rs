//! A whole run, opened by ParaView and by VTK: Debian's 9.2 and PyPI's newest.
//!
//! These tests need what `tests/install` installs; `tests/all` runs them, and they fail where a tool is missing.

use std::path::{Path, PathBuf};
use std::process::Command;

use ao4d::io::vtk;
use ao4d::pipeline::{Pipeline, Settings, run};
use ao4d::progress::Silent;
use ao4d::volume::Values;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// A scene without any symmetry, all arrays, odd dimensions.
const ASYMMETRIC: &str = "
name: asymmetric
stages:
  - scene:
      objects:
        - box: {min: [0.2, -0.6, 0.1, -0.8], max: [0.9, -0.2, 0.4, -0.2]}
          color: [0.9, 0.3, 0.1]
        - box: {min: [-0.9, 0.3, -0.8, -0.9], max: [-0.5, 0.8, 0.6, -0.3]}
  - occlusion: {samples: 64}
  - render: {dimensions: [30, 20, 24], supersample: 1}
  - write:
      vti: image.vti
      raw: image.raw
      vtu: mesh.vtu
      arrays: [rgba, ambient_occlusion, opacity, rgb, depth, object, normal]
";

fn run_text(text: &str, out: &Path) {
    let path = out.join("pipeline.yaml");
    std::fs::create_dir_all(out).unwrap();
    std::fs::write(&path, text).unwrap();
    let pipeline = Pipeline::load(&path, &[], Some(out.to_owned())).unwrap();
    run(&pipeline, &Settings::default(), &Silent).unwrap();
}

fn pythons() -> [PathBuf; 2] {
    let newest =
        std::env::var_os("AO4D_PYTHON").map_or_else(|| Path::new(ROOT).join(".venv/bin/python"), PathBuf::from);
    [newest, PathBuf::from("/usr/bin/python3")]
}

fn numbers(value: &serde_json::Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|n| n.as_f64().unwrap()).collect()
}

#[test]
#[ignore = "needs VTK: run tests/all"]
fn vtk_reads_a_run_as_it_was_written() {
    let folder = tempfile::tempdir().unwrap();
    run_text(ASYMMETRIC, folder.path());
    let image = vtk::read_volume(&folder.path().join("image.vti")).unwrap();
    let mesh = vtk::read_mesh(&folder.path().join("mesh.vtu")).unwrap();
    for python in pythons() {
        let script = Path::new(ROOT).join("tests/python/check_run.py");
        let output = Command::new(&python).arg(script).arg(folder.path()).output().expect("python: run tests/install");
        assert!(output.status.success(), "{}: {}", python.display(), String::from_utf8_lossy(&output.stderr));
        let read: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let vti = &read["image.vti"];
        assert_eq!(numbers(&vti["dimensions"]), [30.0, 20.0, 24.0]);
        assert_eq!(numbers(&vti["origin"]), image.grid.origin);
        assert_eq!(numbers(&vti["spacing"]), image.grid.spacing);
        let pipeline = vti["field_data"]["pipeline"].as_str().unwrap();
        assert!(pipeline.contains("\nname: asymmetric\n") && pipeline.contains("\nstages:\n"), "{pipeline}");
        assert!(vti["field_data"]["program"].as_str().unwrap().starts_with("ao4d "));
        let place = vti["place"].as_u64().unwrap() as usize;
        let point = image.grid.point(image.grid.index(place));
        assert!(numbers(&vti["point"]).iter().zip(point).all(|(a, b)| (a - b).abs() < 1e-14));
        assert_eq!(vti["arrays"].as_object().unwrap().len(), 7);
        for array in &image.arrays {
            let theirs = &vti["arrays"][&array.name];
            assert_eq!(theirs["components"], array.components, "{}", array.name);
            let all = array.values.to_f64();
            let sum: f64 = all.iter().filter(|x| x.abs() < 1e30).sum();
            assert!((theirs["sum"].as_f64().unwrap() - sum).abs() <= 1e-9 * sum.abs(), "{}", array.name);
            assert_eq!(numbers(&vti["voxel"][&array.name]), all[array.components * place..][..array.components]);
        }
        assert_eq!(numbers(&read["image.raw"]["voxel"]), numbers(&vti["voxel"]["rgb"]));
        let vtu = &read["mesh.vtu"];
        assert_eq!((vtu["points"].as_u64(), vtu["cells"].as_u64()), (Some(128), Some(96)));
        assert_eq!(vtu["kinds"], serde_json::json!([10]), "tetrahedra");
        for array in &mesh.point_arrays {
            let sum: f64 = array.values.to_f64().iter().sum();
            let theirs = vtu["arrays"][&array.name]["sum"].as_f64().unwrap();
            assert!((theirs - sum).abs() <= 1e-9 * (1.0 + sum.abs()), "{}: {theirs} {sum}", array.name);
        }
    }
}

#[test]
fn an_asymmetric_scene_comes_out_the_right_way_round() {
    let folder = tempfile::tempdir().unwrap();
    run_text(ASYMMETRIC, folder.path());
    let image = vtk::read_volume(&folder.path().join("image.vti")).unwrap();
    let Values::U16(object) = &image.array("object").unwrap().values else { panic!("type") };
    let raw = std::fs::read(folder.path().join("image.raw")).unwrap();
    for (place, &number) in object.iter().enumerate().filter(|(_, o)| **o > 0) {
        // The first box has x, z > 0 and y < 0, the second the opposite; perspective keeps signs.
        let [x, y, _] = image.grid.point(image.grid.index(place));
        assert!(if number == 1 { x > 0.0 && y < 0.0 } else { x < 0.0 && y > 0.0 }, "{number} at {x}, {y}");
        let channel = |c: usize| f32::from_le_bytes(raw[12 * place + 4 * c..][..4].try_into().unwrap());
        assert!(if number == 1 { channel(0) > 2.0 * channel(1) } else { channel(0) == channel(1) });
    }
    assert!(object.contains(&1) && object.contains(&2));
}

/// Width, height and the grey of each pixel.
fn picture(path: &Path) -> (usize, usize, Vec<u8>) {
    let decoder = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(path).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    let samples = info.color_type.samples();
    let grey = bytes.chunks_exact(samples).map(|p| p[0]).collect();
    (info.width as usize, info.height as usize, grey)
}

fn pvbatch(state: &Path) {
    let headless = Path::new(ROOT).join("paraview/headless");
    let output = Command::new(headless).arg("pvbatch").arg(state).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
#[ignore = "needs ParaView: run tests/all"]
fn the_figure_of_a_run_opens_in_paraview_wherever_the_folder_is() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("first");
    let path = Path::new(ROOT).join("pipelines/two_tetrahedra.yaml");
    let small: Vec<String> = ["with-ao", "without-ao"].map(|id| format!("{id}.dimensions=[40, 40, 40]")).into();
    let pipeline = Pipeline::load(&path, &small, Some(out.clone())).unwrap();
    run(&pipeline, &Settings::default(), &Silent).unwrap();
    let moved = folder.path().join("moved here");
    std::fs::rename(&out, &moved).unwrap();
    pvbatch(&moved.join("figure.py"));
    let (width, height, grey) = picture(&moved.join("figure.png"));
    assert!(width >= 1000 && height >= 600);
    let half = |right: bool| -> Vec<u8> {
        let start = if right { width / 2 } else { 0 };
        grey.chunks_exact(width).flat_map(|row| row[start..start + width / 2].to_vec()).collect()
    };
    let share =
        |pixels: &[u8], test: fn(u8) -> bool| pixels.iter().filter(|&&p| test(p)).count() as f64 / pixels.len() as f64;
    let (without, with) = (half(false), half(true));
    for side in [&without, &with] {
        // A white ground with something on it.
        assert!(share(side, |p| p == 255) > 0.4, "the ground isn't white: fog");
        assert!(share(side, |p| p < 230) > 0.05, "nothing is shown");
    }
    // Only with occlusion is anything dark.
    assert!(share(&with, |p| (40..110).contains(&p)) > 4.0 * share(&without, |p| (40..110).contains(&p)));
    assert!(share(&with, |p| (40..110).contains(&p)) > 0.01);
}
