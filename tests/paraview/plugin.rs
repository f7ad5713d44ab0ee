//! ParaView's plugin, walked through as a user would: what it shows is what the program makes.

use std::path::Path;
use std::process::Command;

use ao4d::io::vtk;
use ao4d::pipeline::{Document, Pipeline, Settings, run};
use ao4d::progress::Silent;
use serde_json::Value;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Two bodies, two pictures, files that only a run of the whole would make.
const PIPELINE: &str = "
name: plugin
stages:
  - scene:
      objects:
        - {name: body, tesseract: {size: 0.8}, transform: [{rotate: {plane: xw, degrees: 30}}], color: [0.9, 0.3, 0.1]}
        - {box: {min: [-1, -1, -1, -1], max: [1, 1, 1, -0.8]}}
  - occlusion: {id: ao, samples: 32, file: all.f32}
  - render: {id: plain, occlusion: none, dimensions: [20, 20, 20]}
  - write: {vti: plain.vti}
  - render: {id: with, occlusion: ao, dimensions: [16, 12, 14]}
  - write: {vti: with.vti, vtu: mesh.vtu, arrays: [rgba, ambient_occlusion, opacity, depth]}
  - mesh: {vtu: mesh-4d.vtu}
  - paraview: {state: figure.py}
";

/// Writes the pipeline's files.
fn run_with(sets: &[&str], out: &Path) {
    let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
    let document = Document::parse("pipeline.yaml", PIPELINE).unwrap();
    let pipeline = Pipeline::from_document(document, &sets, Some(out.to_owned())).unwrap();
    run(&pipeline, &Settings::default(), &Silent).unwrap();
}

/// What the script keeps of an array: about a thousand of its numbers.
fn some(path: &Path, name: &str) -> Vec<f64> {
    let volume = vtk::read_volume(path).unwrap();
    let values = volume.array(name).unwrap().values.to_f64();
    let step = (values.len() / 1000).max(1);
    values.into_iter().step_by(step).map(|x| if x.abs() < 1e30 { x } else { -1.0 }).collect()
}

/// Numbers in single precision, as the files have them: decimal digits on the way may cost the last bit of more.
fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap_or_else(|| panic!("{value}"))
        .iter()
        .map(|n| f64::from(n.as_f64().unwrap() as f32))
        .collect()
}

fn texts(value: &Value) -> Vec<&str> {
    value.as_array().unwrap().iter().map(|n| n.as_str().unwrap()).collect()
}

/// Four images over time: a ball that grows, on a grid of 7 points an axis.
fn series(folder: &Path) {
    let mut list = String::new();
    for step in 0..4 {
        let radius = 0.5 + 0.1 * f64::from(step);
        let at = |i: usize| -1.0 + i as f64 / 3.0;
        let value = |p: usize| radius - (at(p % 7).powi(2) + at(p / 7 % 7).powi(2) + at(p / 49).powi(2)).sqrt() + 0.5;
        let values: Vec<String> = (0..343).map(|p| value(p).to_string()).collect();
        let text = format!(
            "<VTKFile type='ImageData' version='1.0'><ImageData WholeExtent='0 6 0 6 0 6' Origin='-1 -1 -1' Spacing='0.3333333 0.3333333 \
             0.3333333'><Piece Extent='0 6 0 6 0 6'><PointData Scalars='density'><DataArray type='Float64' Name='density' \
             format='ascii'>{}</DataArray></PointData></Piece></ImageData></VTKFile>",
            values.join(" ")
        );
        std::fs::write(folder.join(format!("s{step}.vti")), text).unwrap();
        list += &format!("<DataSet timestep='{step}' file='s{step}.vti'/>");
    }
    let list = format!("<VTKFile type='Collection' version='0.1'><Collection>{list}</Collection></VTKFile>");
    std::fs::write(folder.join("series.pvd"), list).unwrap();
}

#[test]
#[ignore = "needs ParaView: run tests/all"]
fn the_plugin_shows_what_the_program_makes() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("pipeline.yaml"), PIPELINE).unwrap();
    series(folder.path());
    run_with(&[], &at("own"));
    std::fs::copy(at("own/mesh-4d.vtu"), at("mesh.vtu")).unwrap();
    let output = Command::new(Path::new(ROOT).join("paraview/headless"))
        .arg("pvbatch")
        .arg(Path::new(ROOT).join("tests/python/check_plugin.py"))
        .args([Path::new(ROOT).join("paraview/ao4d_plugin.py").as_path(), folder.path()])
        .env("AO4D", env!("CARGO_BIN_EXE_ao4d"))
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && !told.contains("Traceback"), "{told}");
    let found: Value = serde_json::from_slice(&std::fs::read(at("plugin.json")).unwrap()).unwrap();

    let picture = &found["picture"];
    assert_eq!(numbers(&picture["dimensions"]), [0., 15., 0., 11., 0., 13.]);
    for name in ["rgba", "ambient_occlusion", "opacity", "depth"] {
        assert_eq!(numbers(&picture["arrays"][name]), some(&at("own/with.vti"), name), "{name}");
    }
    // An eye that a film turns by as much, twice as far away.
    run_with(
        &[
            "with.camera={eye: [-1, 0, 0, 1.7320508075688772], target: [0, 0, 0, 0], up: [0, 1, 0, 0], over: [0, 0, 1, 0]}",
        ],
        &at("turned"),
    );
    let (ours, theirs) = (numbers(&found["turned"]["opacity"]), some(&at("turned/with.vti"), "opacity"));
    let different = ours.iter().zip(&theirs).filter(|(a, b)| (*a - *b).abs() > 1e-6).count();
    assert!(different * 100 <= ours.len(), "{different} of {}: rounding of the eye decides few voxels", ours.len());
    assert_ne!(ours, numbers(&picture["arrays"]["opacity"]));
    assert_eq!(numbers(&found["plain"]["dimensions"]), [0., 5., 0., 5., 0., 5.]);
    let exact = [
        "ao.method=exact",
        "ao.samples=",
        "with.supersample=1",
        "with.tolerance=0.05",
        "with.shading=smooth",
        "with.dilate=0",
    ];
    run_with(&exact, &at("exact"));
    assert_eq!(numbers(&found["exact"]["ambient_occlusion"]), some(&at("exact/with.vti"), "ambient_occlusion"));
    // The plan was asked for when the file was opened; what is unchanged takes nothing, a turn of the camera one run.
    assert_eq!(numbers(&found["started"]), [1., 0., 1.]);

    let refused = found["refused"].as_str().unwrap();
    assert!(
        refused.contains("shadin: unknown key, did you mean `shading`?") && !refused.contains("Traceback"),
        "{refused}"
    );
    let missing = found["no program"].as_str().unwrap();
    assert!(missing.contains("there is no program /no/such/program"), "{missing}");
    let told = found["no array"].as_str().unwrap();
    assert!(told.contains("there is no point array nothing; there are "), "{told}");

    // Cutting the box from -1 to 1 at w = 0.5 meets the body only, which reaches from -0.55 to 0.55 along x.
    assert!(texts(&found["slice"]["arrays"]).contains(&"ambient_occlusion"));
    let bounds = numbers(&found["slice"]["bounds"]);
    assert!(bounds[0] > -0.6 && bounds[1] < 0.6 && (bounds[3] - 0.4).abs() < 1e-6, "{bounds:?}");
    assert_eq!(numbers(&found["film"]["times"]).len(), 4);
    let frames = numbers(&found["film"]["frames"]);
    assert!(frames.iter().all(|&seen| seen > 0.0) && frames[0] != frames[1], "{frames:?}");

    // A mesh that the program wrote has the values that the program found.
    let four = &found["four"];
    let (ours, theirs) = (numbers(&four["arrays"]["ambient_occlusion"]), numbers(&four["given"]["ambient_occlusion"]));
    assert_eq!(ours.len(), theirs.len());
    let far = ours.iter().zip(&theirs).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(far < 0.1, "64 rays against 32: {far}");
    assert!(four["arrays"].get("object").is_some());
    let three = &found["three"];
    assert!(numbers(&three["ambient_occlusion"]).iter().any(|&a| a < 0.8), "the sphere touches the box");
    assert!(three.get("Normals").is_some(), "arrays of the input are handed on: {three}");
    assert!(found["image"]["points"].as_f64().unwrap() > 3.0);
    assert!(found["spacetime cells"].as_f64().unwrap() > 100.0);
    // Time is drawn as twice its length, from 0 to 6; the ball is largest, and cut off and closed, at the end.
    let w = found["spacetime w"].as_f64().unwrap();
    assert!((6.0..8.1).contains(&w), "{w}");
}
