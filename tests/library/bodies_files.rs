//! Isosurfaces of images from files: every format gives the surface that the formula gives, and what is wrong is told.

use std::io::Write;
use std::path::Path;

use ao4d::geometry::normal_of;
use ao4d::mesh::Surface;
use ao4d::mesh::topology::{corners, enclosed_volume, facet_pairs};
use ao4d::scene::{ObjectSpec, build_object, build_object_with_notes};
use serde_json::{Value, json};

fn try_build<const D: usize>(folder: &Path, image: Value, isovalue: f64) -> Result<Surface<D>, String> {
    let object = json!({"isosurface": {"field": {"image": image}, "isovalue": isovalue}});
    let spec: ObjectSpec = serde_json::from_value(object.clone()).unwrap_or_else(|error| panic!("{object}: {error}"));
    build_object(&spec, folder).map_err(|error| error.to_string())
}

fn build<const D: usize>(folder: &Path, image: Value, isovalue: f64) -> Surface<D> {
    try_build(folder, image.clone(), isovalue).unwrap_or_else(|error| panic!("{image}: {error}"))
}

fn volume<const D: usize>(surface: &Surface<D>) -> f64 {
    enclosed_volume(corners(&surface.vertices, &surface.simplices))
}

const POINTS: [usize; 4] = [13, 12, 11, 10];

/// A ball that fades towards its border, in whole numbers, x fastest.
fn ball() -> Vec<u16> {
    let mut values = Vec::new();
    for i in 0..POINTS.iter().product() {
        let mut rest: usize = i;
        let mut square = 0.0;
        for points in POINTS {
            square += ((rest % points) as f64 - (points - 1) as f64 / 2.0).powi(2);
            rest /= points;
        }
        values.push((1000.0 - 150.0 * square.sqrt()).max(0.0) as u16);
    }
    values
}

const ISOVALUE: f64 = 480.5;

fn little(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn nifti(values: &[u16]) -> Vec<u8> {
    let mut bytes = vec![0u8; 352];
    bytes[..4].copy_from_slice(&348i32.to_le_bytes());
    for (i, n) in [4u16, 13, 12, 11, 10, 1, 1, 1].into_iter().enumerate() {
        bytes[40 + 2 * i..][..2].copy_from_slice(&n.to_le_bytes());
    }
    bytes[70..72].copy_from_slice(&512i16.to_le_bytes());
    bytes[72..74].copy_from_slice(&16i16.to_le_bytes());
    for i in 0..8 {
        bytes[76 + 4 * i..][..4].copy_from_slice(&1f32.to_le_bytes());
    }
    bytes[108..112].copy_from_slice(&352f32.to_le_bytes());
    bytes[344..348].copy_from_slice(b"n+1\0");
    bytes.extend(little(values));
    bytes
}

fn tiff(values: &[u16], imagej: bool) -> Vec<u8> {
    let mut file = std::io::Cursor::new(Vec::new());
    let mut encoder = tiff::encoder::TiffEncoder::new(&mut file).unwrap();
    for (i, page) in values.chunks(13 * 12).enumerate() {
        let mut image = encoder.new_image::<tiff::encoder::colortype::Gray16>(13, 12).unwrap();
        if i == 0 && imagej {
            let text = "ImageJ=1.11a\nimages=110\nslices=11\nframes=10\nhyperstack=true\n";
            image.encoder().write_tag(tiff::tags::Tag::ImageDescription, text).unwrap();
        }
        image.write_data(page).unwrap();
    }
    file.into_inner()
}

fn netcdf(path: &Path, values: &[u16], name: &str) {
    let mut data_set = netcdf3::DataSet::new();
    for (dimension, size) in [("time", 10), ("z", 11), ("y", 12), ("x", 13)] {
        data_set.add_fixed_dim(dimension, size).unwrap();
    }
    data_set.add_var_f64("z", &["z"]).unwrap();
    data_set.add_var_f32(name, &["time", "z", "y", "x"]).unwrap();
    data_set.add_var_attr_f32(name, "missing_value", vec![-99.0]).unwrap();
    let mut file = netcdf3::FileWriter::open(path).unwrap();
    file.set_def(&data_set, netcdf3::Version::Classic, 0).unwrap();
    file.write_var_f64("z", &(0..11).map(f64::from).collect::<Vec<_>>()).unwrap();
    file.write_var_f32(name, &values.iter().map(|&v| f32::from(v)).collect::<Vec<_>>()).unwrap();
    file.close().unwrap();
}

fn vti(values: &[u16]) -> String {
    let numbers: Vec<String> = values.iter().map(u16::to_string).collect();
    format!(
        "<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\"><ImageData WholeExtent=\"0 12 0 11 0 10\" \
         Origin=\"0 0 0\" Spacing=\"1 1 1\"><Piece Extent=\"0 12 0 11 0 10\"><PointData><DataArray type=\"UInt16\" \
         Name=\"density\" format=\"ascii\">{}</DataArray></PointData></Piece></ImageData></VTKFile>",
        numbers.join(" ")
    )
}

fn raw_image(file: &str) -> Value {
    json!({"file": file, "dimensions": POINTS, "type": "uint16"})
}

#[test]
fn all_formats_give_one_surface() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let values = ball();
    std::fs::write(at("ball.raw"), little(&values)).unwrap();
    let expected = build::<4>(folder.path(), raw_image("ball.raw"), ISOVALUE);
    let pairs = facet_pairs(&expected.simplices);
    assert!(pairs.is_closed() && pairs.is_manifold(), "{pairs:?}");
    let radius: f64 = (1000.0 - ISOVALUE) / 150.0;
    let there = std::f64::consts::PI.powi(2) / 2.0 * radius.powi(4);
    // Only three and a half points from the middle to the surface: it misses a tenth.
    assert!((0.88..0.95).contains(&(volume(&expected) / there)), "{}", volume(&expected) / there);

    let mut big: Vec<u8> = b"some header".to_vec();
    big.extend(values.iter().flat_map(|v| f64::from(*v).to_be_bytes()));
    std::fs::write(at("big.raw"), big).unwrap();
    std::fs::write(at("ball.nii"), nifti(&values)).unwrap();
    std::fs::write(at("ball.nii.gz"), gzip(&nifti(&values))).unwrap();
    std::fs::write(at("imagej.tif"), tiff(&values, true)).unwrap();
    std::fs::write(at("plain.tif"), tiff(&values, false)).unwrap();
    netcdf(&at("ball.nc"), &values, "density");
    let header = "NRRD0004\n# made by hand\ntype: unsigned short\ndimension: 4\nsizes: 13 12 11 10\nendian: little\n";
    let whole = [format!("{header}encoding: raw\n\n").as_bytes(), &little(&values)].concat();
    std::fs::write(at("ball.nrrd"), whole).unwrap();
    let whole = [format!("{header}encoding: gzip\nspacings: 1 1 1 1\n\n").as_bytes(), &gzip(&little(&values))].concat();
    std::fs::write(at("gzip.nrrd"), whole).unwrap();
    std::fs::write(at("ball.nhdr"), format!("{header}encoding: raw\ndata file: ball.raw\n")).unwrap();
    for (time, frame) in values.chunks(13 * 12 * 11).enumerate() {
        std::fs::write(at(&format!("{time}.vti")), vti(frame)).unwrap();
    }
    let frames: Vec<String> = (0..10).map(|time| format!("{time}.vti")).collect();
    for image in [
        json!({"file": "big.raw", "dimensions": POINTS, "type": "float64", "byte_order": "big", "offset": 11}),
        json!({"file": "ball.nii"}),
        json!({"file": "ball.nii.gz"}),
        json!({"file": "imagej.tif"}),
        json!({"file": "plain.tif", "dimensions": POINTS}),
        json!({"file": "ball.nc"}),
        json!({"file": "ball.nc", "array": "density"}),
        json!({"file": "ball.nrrd"}),
        json!({"file": "gzip.nrrd"}),
        json!({"file": "ball.nhdr"}),
        json!({"files": frames}),
        json!({"files": frames, "array": "density"}),
    ] {
        assert!(build::<4>(folder.path(), image.clone(), ISOVALUE) == expected, "{image}");
    }
    // One step of time is an image in 3D, from whatever file.
    let frame = build::<3>(folder.path(), json!({"file": "4.vti"}), ISOVALUE);
    assert!(facet_pairs(&frame.simplices).is_manifold());
    for image in [json!({"file": "ball.nii", "frame": 4}), json!({"file": "imagej.tif", "frame": 4})] {
        assert!(build::<3>(folder.path(), image, ISOVALUE) == frame);
    }
}

#[test]
fn placing_cropping_downsampling_smoothing() {
    let folder = tempfile::tempdir().unwrap();
    let values = ball();
    std::fs::write(folder.path().join("ball.raw"), little(&values)).unwrap();
    let with = |extra: Value| {
        let mut image = raw_image("ball.raw");
        image.as_object_mut().unwrap().extend(extra.as_object().unwrap().clone());
        image
    };
    let plain = build::<4>(folder.path(), raw_image("ball.raw"), ISOVALUE);
    let placed = build::<4>(folder.path(), with(json!({"spacing": [2, 1, 0.5, 3], "origin": [-1, 0, 2, 5]})), ISOVALUE);
    assert_eq!(placed.simplices, plain.simplices);
    for (a, b) in placed.vertices.iter().zip(&plain.vertices) {
        let there = [b[0] * 2.0 - 1.0, b[1], b[2] * 0.5 + 2.0, b[3] * 3.0 + 5.0];
        assert!((0..4).all(|axis| (a[axis] - there[axis]).abs() < 1e-12), "{a} {b}");
    }
    // What is cropped away held nothing: the same surface, on the same coordinates.
    let cropped =
        build::<4>(folder.path(), with(json!({"crop": {"from": [1, 1, 1, 0], "to": [12, 11, 10, 10]}})), ISOVALUE);
    assert!((volume(&cropped) / volume(&plain) - 1.0).abs() < 1e-12);
    let half =
        build::<4>(folder.path(), with(json!({"crop": {"from": [6, 0, 0, 0], "to": [13, 12, 11, 10]}})), ISOVALUE);
    assert!(facet_pairs(&half.simplices).is_manifold());
    assert!((volume(&half) / volume(&plain) - 0.5).abs() < 0.02);
    assert!(half.vertices.iter().all(|v| v[0] >= 6.0 - 0.0201));
    let coarse = build::<4>(folder.path(), with(json!({"downsample": [2, 2, 1, 2]})), ISOVALUE);
    assert!(facet_pairs(&coarse.simplices).is_closed());
    assert!((0.6..0.95).contains(&(volume(&coarse) / volume(&plain))), "{}", volume(&coarse) / volume(&plain));
    // The mean of 2 x 2 x 1 x 2 points is where their middle is.
    let middle =
        |surface: &Surface<4>| surface.vertices.iter().map(|v| v[0]).sum::<f64>() / surface.vertices.len() as f64;
    assert!((middle(&coarse) - middle(&plain)).abs() < 0.2);
    // Smoothing along one axis spreads a single bright point by the Gaussian, and keeps the sum.
    let mut point = vec![0u16; POINTS.iter().product()];
    point[6 + 13 * (6 + 12 * (5 + 11 * 5))] = 10_000;
    std::fs::write(folder.path().join("ball.raw"), little(&point)).unwrap();
    for (axis, middle) in [6.0, 6.0, 5.0, 5.0].into_iter().enumerate() {
        let mut sigma = [0.0; 4];
        sigma[axis] = 1.0;
        let total: f64 = (-3..=3).map(|i: i32| (-0.5 * f64::from(i * i)).exp()).sum();
        let expected = |distance: f64| 10_000.0 / total * (-0.5 * distance * distance).exp();
        let isovalue = expected(2.0) - 1.0;
        let smoothed = build::<4>(folder.path(), with(json!({"smooth": sigma})), isovalue);
        // From 2 points away, where it is 1 above the isovalue, it falls to what it is at 3.
        let reach = 2.0 + (1.0 / (expected(2.0) - expected(3.0))).max(0.02);
        let (low, high) =
            smoothed.vertices.iter().fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v[axis]), high.max(v[axis])));
        assert!(
            (high - middle - reach).abs() < 1e-3 && (middle - low - reach).abs() < 1e-3,
            "{axis}: {low} {high} {reach}"
        );
    }
}

#[test]
fn values_that_are_no_numbers_are_outside() {
    let folder = tempfile::tempdir().unwrap();
    let mut values: Vec<f32> = ball().into_iter().map(f32::from).collect();
    values[6 + 13 * (6 + 12 * (5 + 11 * 5))] = f32::NAN;
    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    std::fs::write(folder.path().join("holed.raw"), bytes).unwrap();
    let image = json!({"file": "holed.raw", "dimensions": POINTS, "type": "float32"});
    let surface = build::<4>(folder.path(), image.clone(), ISOVALUE);
    let pairs = facet_pairs(&surface.simplices);
    assert!(pairs.is_manifold(), "{pairs:?}");
    let mut smooth = image;
    smooth["smooth"] = json!(0.7);
    assert!(facet_pairs(&build::<4>(folder.path(), smooth, ISOVALUE).simplices).is_closed());
    std::fs::write(folder.path().join("ball.raw"), little(&ball())).unwrap();
    let whole = build::<4>(folder.path(), raw_image("ball.raw"), ISOVALUE);
    // The hole is a 16-cell of radius 0.98.
    let hole = 0.98f64.powi(4) * 16.0 / 24.0;
    let found = volume(&whole) - volume(&surface);
    assert!((found - hole).abs() < 1e-6, "{found} {hole}");
}

/// The surface, and what is told of it.
fn build_with_notes(folder: &Path, isosurface: Value) -> (Surface<4>, Vec<String>) {
    let spec: ObjectSpec = serde_json::from_value(json!({"isosurface": isosurface})).unwrap();
    let mut notes = Vec::new();
    let surface = build_object_with_notes(&spec, folder, &mut notes).unwrap_or_else(|e| panic!("{isosurface}: {e}"));
    (surface, notes)
}

#[test]
fn values_that_are_no_numbers_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let mut values: Vec<f32> = ball().into_iter().map(f32::from).collect();
    values[6 + 13 * (6 + 12 * (5 + 11 * 5))] = f32::NAN;
    values[0] = f32::NAN;
    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    std::fs::write(folder.path().join("holed.raw"), bytes).unwrap();
    let mut image = json!({"file": "holed.raw", "dimensions": POINTS, "type": "float32"});
    let notes =
        |image: &Value| build_with_notes(folder.path(), json!({"field": {"image": image}, "isovalue": ISOVALUE})).1;
    assert_eq!(notes(&image), ["isosurface.field: 2 of 17160 values are no numbers; they count as outside"]);
    image["downsample"] = json!([2, 2, 1, 2]);
    assert_eq!(notes(&image), ["isosurface.field: 2 of 15840 values are no numbers; they count as outside"]);
    image["crop"] = json!({"from": [1, 0, 0, 0], "to": [13, 12, 11, 10]});
    image["downsample"] = json!(1);
    assert_eq!(notes(&image), ["isosurface.field: 1 of 15840 values are no numbers; they count as outside"]);
    let grid = json!({"min": [-1, -1, -1, -1], "max": [1, 1, 1, 1], "cells": 4});
    let (half, notes) =
        build_with_notes(folder.path(), json!({"field": {"formula": "sqrt(x) - 2"}, "isovalue": 0, "grid": grid}));
    assert_eq!(notes, ["isosurface.field: 250 of 625 values are no numbers; they count as outside"]);
    assert!(half.vertices.iter().all(|v| v[0] > -0.5) && facet_pairs(&half.simplices).is_manifold());
}

#[test]
fn an_isovalue_beyond_all_values_gives_nothing_and_is_told() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("ball.raw"), little(&ball())).unwrap();
    let build = |isovalue: f64, pad: bool| {
        let field = json!({"image": raw_image("ball.raw")});
        build_with_notes(folder.path(), json!({"field": field, "isovalue": isovalue, "pad": pad}))
    };
    let highest = ball().into_iter().max().unwrap();
    let range = format!("its values go from 0 to {highest}");
    let (nothing, notes) = build(5000.0, true);
    assert!(nothing == Surface::default());
    let told = "isosurface.isovalue: the field is outside everywhere";
    assert_eq!(notes, [format!("{told}: {range}, and the isovalue is 5000; there is no surface")]);
    let told = "isosurface.isovalue: the field is inside everywhere";
    let (border, notes) = build(-1.0, true);
    assert!(facet_pairs(&border.simplices).is_manifold() && facet_pairs(&border.simplices).is_closed());
    assert!((volume(&border) / (12.0 * 11.0 * 10.0 * 9.0) - 1.0).abs() < 0.02);
    assert_eq!(notes, [format!("{told}: {range}, and the isovalue is -1; the surface is that of the grid")]);
    let (nothing, notes) = build(-1.0, false);
    assert!(nothing == Surface::default());
    assert_eq!(notes, [format!("{told}: {range}, and the isovalue is -1; there is no surface")]);
}

#[test]
fn a_scene_without_a_surface_runs_to_an_empty_image() {
    let folder = tempfile::tempdir().unwrap();
    let text = "
name: nothing
stages:
  - scene:
      id: void
      objects:
        - isosurface: {field: {formula: x + y}, isovalue: -7, grid: {min: [-1, -1, -1, -1], max: [1, 1, 1, 1], cells: 4}}
  - occlusion: {samples: 16, file: ao.f32}
  - render: {dimensions: [5, 5, 5]}
  - write: {vti: image.vti, vtu: scene.vtu}
";
    let path = folder.path().join("nothing.yaml");
    std::fs::write(&path, text).unwrap();
    let out = folder.path().join("out");
    let pipeline = ao4d::pipeline::Pipeline::load(&path, &[], Some(out.clone())).unwrap();
    let report = ao4d::pipeline::run(&pipeline, &Default::default(), &ao4d::progress::Silent).unwrap();
    let told = "scene void, object 1: isosurface.isovalue: the field is outside everywhere: its values go from -2 to 2";
    assert!(report.notes.len() == 1 && report.notes[0].starts_with(told), "{:?}", report.notes);
    let opacity = ao4d::io::vtk::read_volume(&out.join("image.vti")).unwrap().array("opacity").unwrap().values.to_f64();
    assert!(opacity.len() == 125 && opacity.iter().all(|&o| o == 0.0));
    assert_eq!(std::fs::metadata(out.join("ao.f32")).unwrap().len(), 0);
}

#[test]
fn empty_files_of_every_kind_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    for ending in ["vti", "raw", "nii", "nii.gz", "tif", "nc", "nrrd"] {
        let name = format!("nothing.{ending}");
        std::fs::write(folder.path().join(&name), b"").unwrap();
        let message = try_build::<4>(folder.path(), json!({"file": name}), 1.0).unwrap_err();
        assert!(message.ends_with(&format!("{name}: is empty")), "{message}");
    }
    for ending in ["stl", "obj", "ply", "msh", "vtu"] {
        let name = format!("nothing.{ending}");
        std::fs::write(folder.path().join(&name), b"").unwrap();
        let spec: ObjectSpec = serde_json::from_value(json!({"extrude": {"mesh": name, "from": 0, "to": 1}})).unwrap();
        let message = build_object::<4>(&spec, folder.path()).unwrap_err().to_string();
        assert!(message.ends_with(&format!("{name}: is empty")), "{message}");
    }
}

#[test]
fn a_grid_too_large_to_go_over_is_refused_before_it_is_read() {
    let folder = tempfile::tempdir().unwrap();
    // Sparse: it takes no room on the disk.
    let file = std::fs::File::create(folder.path().join("large.raw")).unwrap();
    file.set_len(1024 * 1024 * 256 * 4).unwrap();
    let image = json!({"file": "large.raw", "dimensions": [1024, 1024, 256, 4], "type": "uint8"});
    let message = try_build::<4>(folder.path(), image, 1.0).unwrap_err();
    assert!(
        message.starts_with("isosurface.field.image: the grid has 1073741824 points, 268435456 in a layer"),
        "{message}"
    );
}

#[test]
fn wrong_images_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let values = ball();
    std::fs::write(at("ball.raw"), little(&values)).unwrap();
    std::fs::write(at("short.raw"), &little(&values)[..5000]).unwrap();
    std::fs::write(at("empty.nii"), b"").unwrap();
    std::fs::write(at("ball.nii"), nifti(&values)).unwrap();
    std::fs::write(at("short.nii"), &nifti(&values)[..5000]).unwrap();
    std::fs::write(at("short.nii.gz"), &gzip(&nifti(&values))[..1500]).unwrap();
    std::fs::write(at("plain.tif"), tiff(&values, false)).unwrap();
    std::fs::write(at("hdf.nc"), b"\x89HDF\r\n\x1a\n").unwrap();
    std::fs::write(at("text.nrrd"), b"hello").unwrap();
    std::fs::write(at("ball.png"), b"hello").unwrap();
    std::fs::write(at("a.vti"), vti(&values[..13 * 12 * 11])).unwrap();
    let mut wide = vti(&values[..13 * 12 * 11]).replace("0 12 0 11 0 10", "0 11 0 12 0 10");
    std::fs::write(at("b.vti"), &wide).unwrap();
    wide.truncate(900);
    std::fs::write(at("c.vti"), wide).unwrap();
    let raw = |extra: Value| {
        let mut image = raw_image("ball.raw");
        image.as_object_mut().unwrap().extend(extra.as_object().unwrap().clone());
        image
    };
    for (image, isovalue, parts) in [
        (json!({"file": "ball.raw"}), 1.0, ["isosurface.field.image.file", "give dimensions"]),
        (json!({"file": "ball.raw", "dimensions": POINTS}), 1.0, ["ball.raw", "give type, such as uint8"]),
        (raw(json!({"type": "uint8"})), 1.0, ["ball.raw", "has 34320 bytes, but 17160 numbers of 1 bytes"]),
        (raw(json!({"dimensions": [usize::MAX, 2, 2, 2]})), 1.0, ["ball.raw", "more than can be"]),
        (raw_image("short.raw"), 1.0, ["short.raw", "has 5000 bytes, but 17160 numbers of 2 bytes"]),
        (json!({"file": "empty.nii"}), 1.0, ["empty.nii", "is empty"]),
        (json!({"file": "none.nii"}), 1.0, ["can't read", "none.nii"]),
        (json!({"file": "short.nii"}), 1.0, ["short.nii", "is cut off: 34320 bytes of values from byte 352 on"]),
        (
            json!({"file": "short.nii.gz"}),
            1.0,
            ["isosurface.field.image.file", "is cut off: its values end after the first"],
        ),
        (json!({"file": "plain.tif"}), 1.0, ["isosurface.field.image", "one step of time only"]),
        (
            json!({"file": "plain.tif", "dimensions": [13, 12, 5, 5]}),
            1.0,
            ["plain.tif", "has 110 pages, which are not 1 channels of 5 slices at 5 times"],
        ),
        (json!({"file": "plain.tif", "dimensions": POINTS, "channel": 1}), 1.0, ["plain.tif", "there is no channel 1"]),
        (json!({"file": "hdf.nc"}), 1.0, ["hdf.nc", "its HDF5 can't be read"]),
        (json!({"file": "text.nrrd"}), 1.0, ["text.nrrd", "is no NRRD file"]),
        (json!({"file": "ball.png"}), 1.0, ["ball.png", "must end in one of .vti"]),
        (json!({"files": ["a.vti", "b.vti"]}), 1.0, ["b.vti: has [12, 13, 11, 1] points", "unlike the first file"]),
        (json!({"files": ["a.vti", "c.vti"]}), 1.0, ["isosurface.field.image.files", "c.vti"]),
        (json!({"files": ["a.vti", "a.vti"], "array": "mass"}), 1.0, ["no array \"mass\"", "there are density"]),
        (json!({}), 1.0, ["isosurface.field.image", "give one of file and files"]),
        (
            raw(json!({"crop": {"from": [0, 0, 0, 0], "to": [13, 12, 12, 10]}})),
            1.0,
            ["image.crop", "z goes from 0 to 12; there are 11 points"],
        ),
        (raw(json!({"downsample": 11})), 1.0, ["image.downsample", "10 points along w don't make one of 11"]),
        (raw(json!({"smooth": -1})), 1.0, ["image.smooth", "-1 is not from 0 to 100"]),
        (raw(json!({"spacing": [1, 1, 0, 1]})), 1.0, ["image.spacing", "0 is not above 0"]),
        (raw(json!({"frame": 3})), 1.0, ["image.frame", "only a scene of dimension 3"]),
    ] {
        let message = try_build::<4>(folder.path(), image.clone(), isovalue).expect_err(&image.to_string());
        assert!(parts.iter().all(|part| message.contains(part)), "{image}: {message}");
    }
    let message = try_build::<3>(folder.path(), raw_image("ball.raw"), 1.0).unwrap_err();
    assert!(message.contains("the image has 10 steps of time; say which one"), "{message}");
}

#[test]
fn droplet() {
    // A real microscope's image sequence, as it ships with the program.
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines/data");
    let surface = build::<4>(&folder, json!({"file": "droplet.tif"}), 60.5);
    assert_eq!(surface.simplices.len(), 133_707);
    assert!(facet_pairs(&surface.simplices).is_closed());
    // Most walls run along time, but many are slanted: the droplet deforms.
    let slanted = corners(&surface.vertices, &surface.simplices)
        .filter(|simplex| {
            let normal = normal_of(simplex);
            normal[3].abs() > 0.1 * normal.norm() && normal[3].abs() < 0.9 * normal.norm()
        })
        .count();
    assert!(slanted > 10_000, "{slanted}");
}

#[test]
fn damaged_images_are_refused_or_read_but_never_a_panic() {
    let folder = tempfile::tempdir().unwrap();
    let values = ball();
    netcdf(&folder.path().join("ball.nc"), &values, "density");
    let header = "NRRD0004\ntype: ushort\ndimension: 4\nsizes: 13 12 11 10\nendian: little\nencoding: raw\n\n";
    let files: [(&str, Vec<u8>); 5] = [
        ("x.nii", nifti(&values)),
        ("x.nii.gz", gzip(&nifti(&values))),
        ("x.tif", tiff(&values, true)),
        ("x.nc", std::fs::read(folder.path().join("ball.nc")).unwrap()),
        ("x.nrrd", [header.as_bytes(), &little(&values)].concat()),
    ];
    let mut state = 12_345u64;
    let mut random = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    let (mut read, mut refused) = (0, 0);
    for (name, original) in files {
        for round in 0..60 {
            let mut bytes = original.clone();
            if round % 3 == 0 {
                bytes.truncate(random(original.len()));
            }
            // Headers are where damage matters: TIFF's directories lie anywhere, the others' at the start.
            let reach = if round % 2 == 0 || name == "x.tif" { bytes.len() } else { bytes.len().min(400) };
            for _ in 0..random(8) {
                if reach > 0 {
                    let at = random(reach);
                    bytes[at] = random(256) as u8;
                }
            }
            std::fs::write(folder.path().join(name), bytes).unwrap();
            match try_build::<4>(folder.path(), json!({"file": name}), ISOVALUE) {
                Ok(_) => read += 1,
                Err(_) => refused += 1,
            }
        }
    }
    assert!(read > 20 && refused > 60, "{read} {refused}");
}
