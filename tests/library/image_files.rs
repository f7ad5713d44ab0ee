//! What image files mean: axes by name and kind, placement by origin and direction, numbers by their conventions.
//!
//! One body, an ellipsoid with another extent along each axis, is written in many ways. Wherever it comes from, its surface must
//! span the same box, scaled and moved as the file says; or the file is refused, with the key that helps.

use std::path::Path;

use ao4d::geometry::Vector64;
use ao4d::mesh::Surface;
use ao4d::mesh::topology::{corners, enclosed_volume, facet_pairs};
use ao4d::scene::{ObjectSpec, build_object_with_notes};
use serde_json::{Value, json};

const POINTS: [usize; 4] = [9, 8, 7, 5];

/// How far inside a point is.
fn depth(at: [usize; 4]) -> f64 {
    let (middle, half) = ([4.2, 3.4, 2.9, 1.8], [3.0, 2.5, 2.73, 1.58]);
    1.0 - (0..4).map(|k| ((at[k] as f64 - middle[k]) / half[k]).powi(2)).sum::<f64>().sqrt()
}

/// Its values, with the axes in another order: `order[0]` is the one that runs fastest.
fn values(order: [usize; 4]) -> Vec<f32> {
    let count: usize = POINTS.iter().product();
    let value = |i: usize| {
        let (mut rest, mut at) = (i, [0; 4]);
        for axis in order {
            at[axis] = rest % POINTS[axis];
            rest /= POINTS[axis];
        }
        depth(at) as f32
    };
    (0..count).map(value).collect()
}

const USUAL: [usize; 4] = [0, 1, 2, 3];

fn little(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn big(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_be_bytes()).collect()
}

/// As single bytes: 150 at the surface.
fn bytes(order: [usize; 4]) -> Vec<u8> {
    values(order).into_iter().map(|v| (150.0 + 60.0 * v).clamp(0.0, 255.0) as u8).collect()
}

fn try_build<const D: usize>(folder: &Path, image: Value, isovalue: f64) -> Result<(Surface<D>, Vec<String>), String> {
    let object = json!({"isosurface": {"field": {"image": image}, "isovalue": isovalue}});
    let spec: ObjectSpec = serde_json::from_value(object).map_err(|error| error.to_string())?;
    let mut notes = Vec::new();
    let surface = build_object_with_notes(&spec, folder, &mut notes).map_err(|error| error.to_string())?;
    Ok((surface, notes))
}

/// The box of a surface, closed and with its outside outside.
fn extent(folder: &Path, image: Value, isovalue: f64) -> ([[f64; 2]; 4], f64) {
    let (surface, _) =
        try_build::<4>(folder, image.clone(), isovalue).unwrap_or_else(|error| panic!("{image}: {error}"));
    let pairs = facet_pairs(&surface.simplices);
    assert!(pairs.is_closed() && pairs.is_manifold(), "{image}: {pairs:?}");
    let volume = enclosed_volume(corners(&surface.vertices, &surface.simplices));
    assert!(volume > 0.0, "{image}: turned inside out, {volume}");
    (bounds(&surface.vertices), volume)
}

fn bounds(vertices: &[Vector64<4>]) -> [[f64; 2]; 4] {
    std::array::from_fn(|k| {
        vertices.iter().fold([f64::MAX, f64::MIN], |[low, high], v| [low.min(v[k]), high.max(v[k])])
    })
}

/// The box and the volume of the values as they are.
fn plain(folder: &Path, isovalue: f64) -> ([[f64; 2]; 4], f64) {
    let (name, kind) = if isovalue == 0.0 { ("plain.raw", "float32") } else { ("bytes.raw", "uint8") };
    let content = if isovalue == 0.0 { little(&values(USUAL)) } else { bytes(USUAL) };
    std::fs::write(folder.join(name), content).unwrap();
    extent(folder, json!({"file": name, "dimensions": POINTS, "type": kind}), isovalue)
}

/// Holds an image against the plain one, scaled and moved.
#[track_caller]
fn is_placed(folder: &Path, image: Value, isovalue: f64, scale: [f64; 4], shift: [f64; 4]) {
    let ((expected, volume), (found, its)) = (plain(folder, isovalue), extent(folder, image.clone(), isovalue));
    for k in 0..4 {
        let mut there = expected[k].map(|x| x * scale[k] + shift[k]);
        there.sort_by(f64::total_cmp);
        let close = (0..2).all(|end| (found[k][end] - there[end]).abs() < 1e-5 * (1.0 + there[end].abs()));
        assert!(close, "{image}: axis {k} from {:?}, not {there:?}", found[k]);
    }
    let larger: f64 = scale.iter().product::<f64>().abs();
    assert!((its / volume / larger - 1.0).abs() < 1e-5, "{image}: volume {its}, not {volume} times {larger}");
}

#[track_caller]
fn is_refused(folder: &Path, image: Value, parts: &[&str]) {
    let message = try_build::<4>(folder, image.clone(), 0.0).err().unwrap_or_else(|| panic!("{image} is taken"));
    parts.iter().for_each(|part| assert!(message.contains(part), "{message}\nlacks {part}"));
}

fn nrrd(header: &str, content: &[u8]) -> Vec<u8> {
    [format!("NRRD0005\nendian: little\nencoding: raw\n{header}\n\n").as_bytes(), content].concat()
}

#[test]
fn nrrd_axes_and_places() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let write =
        |name: &str, header: &str, content: &[u8]| std::fs::write(at.join(name), nrrd(header, content)).unwrap();
    let usual = "type: float\ndimension: 4\nsizes: 9 8 7 5\n";
    let content = little(&values(USUAL));

    let vectors = "space dimension: 4\nspace directions: (0.5, 0, 0, 0) (0, 1, 0, 0) (0, 0, 2, 0) (0, 0, 0, 3)\n";
    write("spaces.nrrd", &format!("{usual}{vectors}space origin: (100, 200, 300, 0)"), &content);
    is_placed(at, json!({"file": "spaces.nrrd"}), 0.0, [0.5, 1.0, 2.0, 3.0], [100.0, 200.0, 300.0, 0.0]);
    is_placed(at, json!({"file": "spaces.nrrd", "placement": "stored"}), 0.0, [0.5, 1.0, 2.0, 3.0], [0.0; 4]);
    is_placed(
        at,
        json!({"file": "spaces.nrrd", "origin": [1, 2, 3, 4]}),
        0.0,
        [0.5, 1.0, 2.0, 3.0],
        [1.0, 2.0, 3.0, 4.0],
    );

    // Axes that run along others of the world, and backwards; time without a vector.
    let turned = "space: left-posterior-superior\nspace directions: (0,0,2) (-1,0,0) (0,0.5,0) none\nkinds: domain domain domain time\n\
                  space origin: (10,20,30)";
    write("turned.nrrd", &format!("{usual}{turned}"), &content);
    let (box_, _) = plain(at, 0.0);
    let (found, _) = extent(at, json!({"file": "turned.nrrd"}), 0.0);
    let expected = [
        [10.0 - box_[1][1], 10.0 - box_[1][0]],
        [20.0 + 0.5 * box_[2][0], 20.0 + 0.5 * box_[2][1]],
        [30.0 + 2.0 * box_[0][0], 30.0 + 2.0 * box_[0][1]],
        box_[3],
    ];
    let close = |a: [[f64; 2]; 4], b: [[f64; 2]; 4]| {
        a.as_flattened().iter().zip(b.as_flattened()).all(|(x, y)| (x - y).abs() < 1e-9)
    };
    assert!(close(found, expected), "{found:?} {expected:?}");
    let (flipped, _) = extent(at, json!({"file": "turned.nrrd", "space": "RAS"}), 0.0);
    let negative = |[low, high]: [f64; 2]| [-high, -low];
    assert!(close(flipped, [negative(expected[0]), negative(expected[1]), expected[2], expected[3]]), "{flipped:?}");

    // Labels and kinds in another order.
    let other = "type: float\ndimension: 4\nsizes: 5 9 8 7\nkinds: list domain domain domain\nlabels: \"frame\" \"x\" \"y\" \"z\"";
    write("first.nrrd", other, &little(&values([3, 0, 1, 2])));
    is_placed(at, json!({"file": "first.nrrd"}), 0.0, [1.0; 4], [0.0; 4]);
    write("unnamed.nrrd", &other[..other.find("labels").unwrap() - 1], &little(&values([3, 0, 1, 2])));
    is_refused(at, json!({"file": "unnamed.nrrd"}), &["\"list\"", "5 values", "channel", "axes"]);
    is_placed(at, json!({"file": "unnamed.nrrd", "axes": ["time", "x", "y", "z"]}), 0.0, [1.0; 4], [0.0; 4]);
    is_refused(at, json!({"file": "unnamed.nrrd", "axes": ["time", "x"]}), &["axes names 2 axes", "there are 4"]);

    // A vector at each point: refused by name, chosen by channel.
    let three: Vec<f32> = values(USUAL).into_iter().flat_map(|v| [-1.0, v, 7.0]).collect();
    write(
        "vector.nrrd",
        "type: float\ndimension: 5\nsizes: 3 9 8 7 5\nkinds: vector domain domain domain time",
        &little(&three),
    );
    is_refused(at, json!({"file": "vector.nrrd"}), &["\"vector\"", "3 values", "channel, from 0 to 2"]);
    is_placed(at, json!({"file": "vector.nrrd", "channel": 1}), 0.0, [1.0; 4], [0.0; 4]);
    is_refused(at, json!({"file": "vector.nrrd", "channel": 3}), &["no channel 3"]);
    let apart: Vec<f32> = [vec![7.0; 2520], values(USUAL)].concat();
    write(
        "apart.nrrd",
        "type: float\ndimension: 5\nsizes: 9 8 7 5 2\nkinds: domain domain domain time vector",
        &little(&apart),
    );
    is_placed(
        at,
        json!({"file": "apart.nrrd", "channel": 1, "crop": {"from": [1, 0, 0, 0], "to": [9, 8, 7, 5]}}),
        0.0,
        [1.0; 4],
        [0.0; 4],
    );

    // One unit for all axes, be they told for those of the file or those of the world.
    for units in [
        "spacings: 0.5 1 2 3\nunits: \"cm\" \"mm\" \"m\" \"s\"",
        "space dimension: 4\nspace directions: (0.5,0,0,0) (0,1,0,0) (0,0,2,0) (0,0,0,3)\nspace units: \"cm\" \"mm\" \"m\" \"s\"",
    ] {
        write("units.nrrd", &format!("{usual}{units}"), &content);
        is_placed(at, json!({"file": "units.nrrd"}), 0.0, [0.5, 0.1, 200.0, 3.0], [0.0; 4]);
    }
    // What is listed of axes is listed of all of them.
    for (field, message) in [
        ("kinds: domain domain", "2 kinds for 4 axes"),
        ("spacings: 1 2 3", "3 spacings for 4 axes"),
        ("axis mins: 1 2 3 4 5", "5 axis mins for 4 axes"),
        ("space directions: (1,0,0) (0,1,0) (0,0,1)", "3 space directions for 4 axes"),
    ] {
        write("short.nrrd", &format!("{usual}{field}"), &content);
        is_refused(at, json!({"file": "short.nrrd"}), &[message]);
    }
    write("short.nrrd", "type: float\ndimension: 4\nsizes: 9 8 35", &content);
    is_refused(at, json!({"file": "short.nrrd"}), &["the dimension 4, and 3 sizes"]);
    write("capitals.nrrd", "Type: FLOAT\nDimension: 4\nSizes: 9 8 7 5", &content);
    is_placed(at, json!({"file": "capitals.nrrd"}), 0.0, [1.0; 4], [0.0; 4]);

    // Centres of cells.
    write(
        "cells.nrrd",
        &format!("{usual}axis mins: 0 0 0 0\naxis maxs: 18 8 7 5\ncenterings: cell node cell cell"),
        &content,
    );
    is_placed(at, json!({"file": "cells.nrrd"}), 0.0, [2.0, 8.0 / 7.0, 1.0, 1.0], [1.0, 0.0, 0.5, 0.5]);
}

#[test]
fn nrrd_data_where_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let usual = "type: float\ndimension: 4\nsizes: 9 8 7 5\n";
    let content = little(&values(USUAL));
    let write =
        |name: &str, header: &str, content: &[u8]| std::fs::write(at.join(name), nrrd(header, content)).unwrap();
    let good = |name: &str| is_placed(at, json!({"file": name}), 0.0, [1.0; 4], [0.0; 4]);
    write("lines.nrrd", &format!("{usual}byte skip: 0\nline skip: 2"), &[b"one\ntwo\n".as_slice(), &content].concat());
    good("lines.nrrd");
    write("both.nrrd", &format!("{usual}line skip: 1\nbyte skip: 3"), &[b"one\nabc".as_slice(), &content].concat());
    good("both.nrrd");
    write("end.nhdr", &format!("{usual}byte skip: -1\ndata file: long.bin"), b"");
    std::fs::write(at.join("long.bin"), [vec![9; 352], content.clone()].concat()).unwrap();
    good("end.nhdr");
    write("long.nhdr", &format!("{usual}data file: long.bin"), b"");
    is_refused(at, json!({"file": "long.nhdr"}), &["long.bin", "10432 bytes", "10080", "byte skip"]);
    // Packed, its length shows only at the end.
    for (name, more) in [("exact", 0), ("more", 2)] {
        let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        std::io::Write::write_all(&mut packed, &[content.clone(), vec![0; more]].concat()).unwrap();
        std::fs::write(at.join(format!("{name}.gz")), packed.finish().unwrap()).unwrap();
        let header = format!("NRRD0005\nendian: little\n{usual}encoding: gzip\ndata file: {name}.gz\n");
        std::fs::write(at.join(format!("{name}.nhdr")), header).unwrap();
    }
    good("exact.nhdr");
    is_refused(at, json!({"file": "more.nhdr"}), &["a data file holds more values than"]);
    for (i, frame) in content.chunks(2016).enumerate() {
        std::fs::write(at.join(format!("t{:02}.bin", i + 1)), frame).unwrap();
    }
    write("many.nhdr", &format!("{usual}datafile: t%02d.bin 1 5 1"), b"");
    good("many.nhdr");
    write("list.nhdr", &format!("{usual}data file: LIST\nt01.bin\nt02.bin\nt03.bin\nt04.bin\nt05.bin"), b"");
    good("list.nhdr");
    let text: Vec<String> = values(USUAL).iter().map(f32::to_string).collect();
    std::fs::write(at.join("text.nrrd"), format!("NRRD0005\n{usual}encoding: text\n\n{}\n", text.join(" "))).unwrap();
    good("text.nrrd");
    std::fs::write(at.join("bzip.nrrd"), format!("NRRD0005\n{usual}encoding: bzip2\n\nBZ")).unwrap();
    is_refused(at, json!({"file": "bzip.nrrd"}), &["unsupported: the encoding bzip2", "unu save"]);
    // All of these files are read from.
    let spec: ObjectSpec =
        serde_json::from_value(json!({"isosurface": {"field": {"image": {"file": "many.nhdr"}}}})).unwrap();
    assert_eq!(spec.shape().unwrap().input_files(at).len(), 6);
}

#[test]
fn sizes_that_ask_for_too_much_take_no_memory() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // A long axis in a small file.
    let noise: Vec<u8> = (0..1u32 << 20).map(|i| (i.wrapping_mul(2654435761) >> 24) as u8).collect();
    let header = "NRRD0004\ntype: uint8\nencoding: gzip\n";
    std::fs::write(
        at.join("lie.nrrd"),
        [format!("{header}dimension: 1\nsizes: 1000000000\n\n").as_bytes(), &noise].concat(),
    )
    .unwrap();
    let message = try_build::<3>(at, json!({"file": "lie.nrrd"}), 0.5).unwrap_err();
    assert!(message.contains("1000000000 points"), "{message}");
    // A slice larger than what is wanted of it.
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    for _ in 0..100 {
        std::io::Write::write_all(&mut packed, &[0; 1_000_000]).unwrap();
    }
    let packed = packed.finish().unwrap();
    std::fs::write(
        at.join("wide.nrrd"),
        [format!("{header}dimension: 3\nsizes: 10000 10000 1\n\n").as_bytes(), &packed].concat(),
    )
    .unwrap();
    let image = json!({"file": "wide.nrrd", "crop": {"from": [0, 0, 0], "to": [8, 8, 1]}});
    let (surface, notes) = try_build::<3>(at, image, 0.5).unwrap();
    assert!(surface.simplices.is_empty() && notes.len() == 1, "{notes:?}");
}

/// A NIfTI file: `form` says how it is placed.
enum Form {
    Sform([[f32; 4]; 3]),
    Qform { quaternion: [f32; 3], offset: [f32; 3], handed: f32 },
}

fn nifti(two: bool, form: &Form, pixdim: [f32; 4], content: &[u8]) -> Vec<u8> {
    let (size, at): (usize, fn(usize, usize) -> usize) = if two { (544, |_, two| two) } else { (352, |one, _| one) };
    let mut bytes = vec![0u8; size];
    let mut put = |place: usize, content: &[u8]| bytes[place..place + content.len()].copy_from_slice(content);
    let real = |x: f32| if two { f64::from(x).to_le_bytes().to_vec() } else { x.to_le_bytes().to_vec() };
    let code = |x: i16| if two { i32::from(x).to_le_bytes().to_vec() } else { x.to_le_bytes().to_vec() };
    let (wide, narrow) = (if two { 8 } else { 4 }, if two { 8 } else { 2 });
    put(0, &(if two { 540i32 } else { 348 }).to_le_bytes());
    for (i, n) in [4i16, 9, 8, 7, 5, 1, 1, 1].into_iter().enumerate() {
        let n = if two { i64::from(n).to_le_bytes().to_vec() } else { n.to_le_bytes().to_vec() };
        put(at(40, 16) + narrow * i, &n);
    }
    put(at(70, 12), &16i16.to_le_bytes());
    put(at(72, 14), &32i16.to_le_bytes());
    let handed = if let Form::Qform { handed, .. } = form { *handed } else { 1.0 };
    for (i, x) in [handed].into_iter().chain(pixdim).enumerate() {
        put(at(76, 104) + wide * i, &real(x));
    }
    put(at(108, 168), &if two { 544i64.to_le_bytes().to_vec() } else { 352f32.to_le_bytes().to_vec() });
    match form {
        Form::Sform(rows) => {
            put(at(254, 348), &code(1));
            for (i, x) in rows.as_flattened().iter().enumerate() {
                put(at(280, 400) + wide * i, &real(*x));
            }
        }
        Form::Qform { quaternion, offset, .. } => {
            put(at(252, 344), &code(1));
            for (i, x) in quaternion.iter().chain(offset).enumerate() {
                put(at(256, 352) + wide * i, &real(*x));
            }
        }
    }
    put(at(344, 4), if two { b"n+2\0\r\n\x1a\n" } else { b"n+1\0" });
    bytes.extend(content);
    bytes
}

#[test]
fn nifti_lies_where_its_forms_say() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let content = little(&values(USUAL));
    for two in [false, true] {
        let write =
            |form: Form| std::fs::write(at.join("a.nii"), nifti(two, &form, [2.0, 3.0, 4.0, 1.5], &content)).unwrap();
        write(Form::Sform([[-2.0, 0.0, 0.0, 90.0], [0.0, 3.0, 0.0, -126.0], [0.0, 0.0, 4.0, -72.0]]));
        is_placed(at, json!({"file": "a.nii"}), 0.0, [-2.0, 3.0, 4.0, 1.5], [90.0, -126.0, -72.0, 0.0]);
        is_placed(at, json!({"file": "a.nii", "space": "LPS"}), 0.0, [2.0, -3.0, 4.0, 1.5], [-90.0, 126.0, -72.0, 0.0]);
        is_placed(at, json!({"file": "a.nii", "placement": "stored"}), 0.0, [2.0, 3.0, 4.0, 1.5], [0.0; 4]);
        // Half a turn about x, and the third axis turned round.
        write(Form::Qform { quaternion: [1.0, 0.0, 0.0], offset: [10.0, 20.0, 30.0], handed: -1.0 });
        is_placed(at, json!({"file": "a.nii"}), 0.0, [2.0, -3.0, 4.0, 1.5], [10.0, 20.0, 30.0, 0.0]);
        // A quarter of a turn about z: x goes along y, y against x.
        let half = std::f32::consts::FRAC_1_SQRT_2;
        write(Form::Qform { quaternion: [0.0, 0.0, half], offset: [0.0; 3], handed: 1.0 });
        let ((box_, _), (found, _)) = (plain(at, 0.0), extent(at, json!({"file": "a.nii"}), 0.0));
        let close = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).abs() < 1e-5 && (a[1] - b[1]).abs() < 1e-5;
        assert!(close(found[1], box_[0].map(|x| 2.0 * x)), "{found:?}");
        assert!(close(found[0], [-3.0 * box_[1][1], -3.0 * box_[1][0]]), "{found:?}");
        assert!(close(found[2], box_[2].map(|x| 4.0 * x)), "{found:?}");
        // Oblique: the volume is that of the determinant.
        let rows = [[2.0, 0.5, 0.0, 1.0], [-0.5, 3.0, 0.3, 2.0], [0.0, 0.2, 4.0, 3.0]];
        write(Form::Sform(rows));
        let m = nalgebra::Matrix3::from_fn(|r, c| f64::from(rows[r][c]));
        let ((_, volume), (_, its)) = (plain(at, 0.0), extent(at, json!({"file": "a.nii"}), 0.0));
        assert!((its / volume / (m.determinant() * 1.5) - 1.0).abs() < 1e-6, "{its}");
    }
    // A flat image, whose third step is 0: by the qform that counts as 1, and by the sform nothing lies along it.
    for form in [
        Form::Qform { quaternion: [0.0; 3], offset: [0.0; 3], handed: 1.0 },
        Form::Sform([[2.0, 0.0, 0.0, 0.0], [0.0, 3.0, 0.0, 0.0], [0.0; 4]]),
    ] {
        let mut flat = nifti(false, &form, [2.0, 3.0, 0.0, 1.5], &content);
        for (i, n) in [4u8, 9, 8, 1, 35].into_iter().enumerate() {
            flat[40 + 2 * i] = n;
        }
        std::fs::write(at.join("flat.nii"), flat).unwrap();
        let opened = ao4d::io::image::open("", at, &["flat.nii".into()], &Default::default()).unwrap();
        let ends = opened.axes.each_ref().map(|axis| axis.positions.at(axis.size - 1));
        assert_eq!((opened.frame.is_none(), ends), (true, [16.0, 21.0, 0.0, 51.0]));
    }
    // A pair of files, and complex numbers.
    let mut pair =
        nifti(false, &Form::Sform([[1.0, 0.0, 0.0, 5.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]), [1.0; 4], &[]);
    pair[344..348].copy_from_slice(b"ni1\0");
    pair[108..112].copy_from_slice(&0f32.to_le_bytes());
    std::fs::write(at.join("pair.hdr"), &pair).unwrap();
    std::fs::write(at.join("pair.img"), &content).unwrap();
    is_placed(at, json!({"file": "pair.hdr"}), 0.0, [1.0; 4], [5.0, 0.0, 0.0, 0.0]);
    pair[70..72].copy_from_slice(&32i16.to_le_bytes());
    std::fs::write(at.join("pair.hdr"), &pair).unwrap();
    is_refused(at, json!({"file": "pair.hdr"}), &["unsupported: complex numbers"]);
}

/// A variable of a NetCDF file, or a coordinate.
struct Variable<'a> {
    name: &'a str,
    dimensions: &'a [usize],
    kind: u32,
    /// Name, type, and bytes of each attribute.
    attributes: Vec<(&'a str, u32, Vec<u8>)>,
    content: Vec<u8>,
}

/// A NetCDF file of the classic kinds, without a growing dimension.
fn netcdf(version: u8, dimensions: &[(&str, usize)], variables: &[Variable]) -> Vec<u8> {
    let count =
        |n: usize| if version == 5 { (n as u64).to_be_bytes().to_vec() } else { (n as u32).to_be_bytes().to_vec() };
    let padded = |bytes: &[u8]| [bytes, &vec![0; bytes.len().next_multiple_of(4) - bytes.len()]].concat();
    let name = |text: &str| [count(text.len()), padded(text.as_bytes())].concat();
    let list = |tag: u32, n: usize| {
        if n == 0 { [vec![0; 4], count(0)].concat() } else { [tag.to_be_bytes().to_vec(), count(n)].concat() }
    };
    let size = |kind: u32| [0, 1, 1, 2, 4, 4, 8, 1, 2, 4, 8, 8][kind as usize];
    let header = |begins: &[usize]| {
        let mut all = [b"CDF".as_slice(), &[version], &count(0), &list(10, dimensions.len())].concat();
        dimensions.iter().for_each(|(text, n)| all.extend([name(text), count(*n)].concat()));
        all.extend(list(12, 0));
        all.extend(list(11, variables.len()));
        for (variable, begin) in variables.iter().zip(begins) {
            all.extend([name(variable.name), count(variable.dimensions.len())].concat());
            variable.dimensions.iter().for_each(|d| all.extend(count(*d)));
            all.extend(list(12, variable.attributes.len()));
            for (text, kind, bytes) in &variable.attributes {
                all.extend(
                    [name(text), kind.to_be_bytes().to_vec(), count(bytes.len() / size(*kind)), padded(bytes)].concat(),
                );
            }
            all.extend(variable.kind.to_be_bytes());
            all.extend(count(variable.content.len().next_multiple_of(4)));
            all.extend(if version == 1 {
                (*begin as u32).to_be_bytes().to_vec()
            } else {
                (*begin as u64).to_be_bytes().to_vec()
            });
        }
        all
    };
    let mut begin = header(&vec![0; variables.len()]).len();
    let begins: Vec<usize> = variables
        .iter()
        .map(|variable| {
            let here = begin;
            begin += variable.content.len().next_multiple_of(4);
            here
        })
        .collect();
    let mut all = header(&begins);
    variables.iter().for_each(|variable| all.extend(padded(&variable.content)));
    all
}

fn doubles(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_be_bytes()).collect()
}

#[test]
fn netcdf_axes_by_name_and_attribute() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let field = |dimensions, order| Variable {
        name: "f",
        dimensions,
        kind: 5,
        attributes: vec![],
        content: big(&values(order)),
    };
    let write = |file: &[u8]| std::fs::write(at.join("a.nc"), file).unwrap();
    let named = [("x", 9), ("y", 8), ("z", 7), ("time", 5)];
    for version in [1, 2, 5] {
        // f(x, y, z, time): the last runs fastest.
        write(&netcdf(version, &named, &[field(&[0, 1, 2, 3], [3, 2, 1, 0])]));
        is_placed(at, json!({"file": "a.nc"}), 0.0, [1.0; 4], [0.0; 4]);
    }
    // As a weather model names them.
    let named = [("west_east", 9), ("south_north", 8), ("bottom_top", 7), ("Time", 5)];
    write(&netcdf(1, &named, &[field(&[1, 3, 0, 2], [2, 0, 3, 1])]));
    is_placed(at, json!({"file": "a.nc"}), 0.0, [1.0; 4], [0.0; 4]);
    // By attributes of coordinates, whose names say nothing; latitudes go down.
    let unnamed = [("a", 9), ("b", 8), ("c", 7), ("d", 5)];
    let text = |key: &'static str, value: &str| (key, 2, value.as_bytes().to_vec());
    let coordinate = |name: &'static str, dimension: &'static [usize], attribute, values: Vec<f64>| Variable {
        name,
        dimensions: dimension,
        kind: 6,
        attributes: vec![attribute],
        content: doubles(&values),
    };
    let places = |n: usize, start: f64, step: f64| (0..n).map(|i| start + i as f64 * step).collect::<Vec<_>>();
    let variables = |julian: f64| {
        [
            coordinate("a", &[0], text("units", "degrees_east"), places(9, 10.0, 2.0)),
            coordinate("b", &[1], text("standard_name", "latitude"), places(8, 60.0, -1.0)),
            coordinate("c", &[2], text("positive", "down"), places(7, 0.0, 0.5)),
            coordinate("d", &[3], text("units", "days since -4712-01-01"), places(5, julian, 0.25)),
            field(&[2, 0, 3, 1], [1, 3, 0, 2]),
        ]
    };
    write(&netcdf(1, &unnamed, &variables(3.0)));
    is_placed(at, json!({"file": "a.nc"}), 0.0, [2.0, -1.0, 0.5, 0.25], [10.0, 60.0, 0.0, 3.0]);
    // Places that single precision can't tell apart are told, and can be moved without loss.
    write(&netcdf(1, &unnamed, &variables(2_459_000.5)));
    let (_, notes) = try_build::<4>(at, json!({"file": "a.nc"}), 0.0).unwrap();
    assert!(notes.iter().any(|note| note.contains("along w are 0.25 apart") && note.contains("origin")), "{notes:?}");
    is_placed(
        at,
        json!({"file": "a.nc", "origin": [10, 60, 0, 0]}),
        0.0,
        [2.0, -1.0, 0.5, 0.25],
        [10.0, 60.0, 0.0, 0.0],
    );
    // Lengths in several units, by an attribute that alone says what the axes are.
    let units = ["m", "km", "micrometers", "s"].map(|unit| text("units", unit));
    let mut mixed: Vec<Variable> = unnamed
        .iter()
        .zip([&[0], &[1], &[2], &[3usize]])
        .zip(units)
        .map(|(((name, size), dimension), unit)| coordinate(name, dimension, unit, places(*size, 0.0, 2.0)))
        .collect();
    for (variable, axis) in mixed.iter_mut().zip(["X", "y", "Z", "T"]) {
        variable.attributes.push(text("axis", axis));
    }
    mixed.push(field(&[3, 1, 0, 2], [2, 0, 1, 3]));
    write(&netcdf(2, &unnamed, &mixed));
    is_placed(at, json!({"file": "a.nc"}), 0.0, [2.0, 2e3, 2e-6, 2.0], [0.0; 4]);
    let (_, notes) = try_build::<4>(at, json!({"file": "a.nc"}), 0.0).unwrap();
    assert!(notes.iter().any(|note| note.contains("\"b\" is in km; it is brought to m, as \"a\" is")), "{notes:?}");
    // An axis that is nothing of these.
    let band = [("z", 7), ("band", 5), ("y", 8), ("x", 9)];
    write(&netcdf(1, &band, &[field(&[0, 1, 2, 3], [0, 1, 3, 2])]));
    is_refused(at, json!({"file": "a.nc"}), &["\"band\"", "channel", "axes"]);
    is_placed(at, json!({"file": "a.nc", "axes": ["x", "y", "time", "z"]}), 0.0, [1.0; 4], [0.0; 4]);
    let odd = [("z", 7), ("plume", 5), ("y", 8), ("x", 9)];
    write(&netcdf(1, &odd, &[field(&[0, 1, 2, 3], [0, 1, 3, 2])]));
    is_refused(at, json!({"file": "a.nc"}), &["\"plume\" of 5 points", "axes"]);
    std::fs::write(at.join("a.nc"), b"\x89HDF\r\n\x1a\n").unwrap();
    is_refused(at, json!({"file": "a.nc"}), &["its HDF5 can't be read"]);
    std::fs::write(at.join("a.nc"), b"\x0e\x03\x13\x01").unwrap();
    is_refused(at, json!({"file": "a.nc"}), &["unsupported: an HDF4 file", "h4tonccf"]);
}

#[test]
fn netcdf_numbers_by_their_conventions() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let named = [("time", 5), ("z", 7), ("y", 8), ("x", 9)];
    let write = |kind, attributes, content| {
        let variable = Variable { name: "f", dimensions: &[0, 1, 2, 3], kind, attributes, content };
        std::fs::write(at.join("a.nc"), netcdf(5, &named, &[variable])).unwrap();
    };
    let missing = |isovalue: f64| {
        let (_, notes) = try_build::<4>(at, json!({"file": "a.nc"}), isovalue).unwrap();
        let note = notes.iter().find(|note| note.contains("no numbers")).cloned().unwrap_or_default();
        note.split(' ').nth(1).and_then(|n| n.parse::<usize>().ok()).unwrap_or(0)
    };
    write(1, vec![("_Unsigned", 2, b"true".to_vec())], bytes(USUAL));
    is_placed(at, json!({"file": "a.nc"}), 150.0, [1.0; 4], [0.0; 4]);
    write(7, vec![], bytes(USUAL));
    is_placed(at, json!({"file": "a.nc"}), 150.0, [1.0; 4], [0.0; 4]);
    // A fill value of -1 is 255 there.
    let mut filled = bytes(USUAL);
    filled[..3].fill(255);
    write(1, vec![("_Unsigned", 2, b"true".to_vec()), ("_FillValue", 1, vec![255])], filled);
    assert_eq!(missing(150.0), 3);
    // Never written, and outside of what is valid.
    let mut never = values(USUAL);
    never[..4].fill(9.969_21e36);
    write(5, vec![], big(&never));
    assert_eq!(missing(0.0), 4);
    let mut odd = values(USUAL);
    (odd[0], odd[1], odd[2], odd[3]) = (-50.0, 50.0, 77.0, 78.0);
    let two = |a: f32, b: f32| [a.to_be_bytes(), b.to_be_bytes()].concat();
    write(5, vec![("valid_range", 5, two(-10.0, 80.0)), ("missing_value", 5, two(77.0, 78.0))], big(&odd));
    assert_eq!(missing(0.0), 3);
    write(
        5,
        vec![("valid_min", 5, (-10f32).to_be_bytes().to_vec()), ("valid_max", 5, 10f32.to_be_bytes().to_vec())],
        big(&odd),
    );
    assert_eq!(missing(0.0), 4);
    // What should be a number, but isn't, is told.
    write(5, vec![("scale_factor", 2, b"0.5".to_vec())], big(&values(USUAL)));
    let (_, notes) = try_build::<4>(at, json!({"file": "a.nc"}), 0.0).unwrap();
    assert!(notes.iter().any(|note| note.contains("its attribute scale_factor is the text \"0.5\"")), "{notes:?}");
    // Scale and offset, with limits of the numbers as they are stored.
    let stored: Vec<u8> = values(USUAL).iter().flat_map(|v| ((v * 1000.0) as i16).to_be_bytes()).collect();
    let scaled = vec![
        ("scale_factor", 6, doubles(&[0.001])),
        ("add_offset", 6, doubles(&[150.0])),
        ("valid_max", 3, vec![0x7f, 0xff]),
    ];
    write(3, scaled, stored);
    let ((expected, _), (found, _)) = (plain(at, 0.0), extent(at, json!({"file": "a.nc"}), 150.0));
    assert!((0..4).all(|k| (found[k][0] - expected[k][0]).abs() < 0.01), "{found:?}");
    assert_eq!(missing(150.0), 0);
}

/// How a TIFF is written.
#[derive(Clone)]
struct Pages<'a> {
    bits: u16,
    photometric: u16,
    compression: u16,
    samples: u16,
    description: &'a str,
    /// Points per unit.
    resolution: u32,
}

const GREY: Pages = Pages { bits: 8, photometric: 1, compression: 1, samples: 1, description: "", resolution: 0 };

/// A little-endian TIFF of 9 x 8 points with these pages; `behind` comes after the last.
fn tiff(how: &Pages, pages: &[Vec<u8>], behind: &[u8]) -> Vec<u8> {
    let mut file = b"II\x2a\0\0\0\0\0".to_vec();
    let mut link = 4;
    for (i, page) in pages.iter().enumerate() {
        let (start, text) = (file.len(), [how.description.as_bytes(), b"\0"].concat());
        file.extend(page);
        if i + 1 == pages.len() {
            file.extend(behind);
        }
        let words = file.len();
        file.extend(&text);
        file.resize(file.len().next_multiple_of(4) + 4, 0);
        let ratio = file.len();
        file.extend([how.resolution.to_le_bytes(), 1u32.to_le_bytes()].concat());
        let table = file.len();
        file.extend([0u8; 2 * 3 * 256]);
        let bits = file.len();
        file.extend([how.bits.to_le_bytes(); 4].concat());
        let place = file.len();
        file[link..link + 4].copy_from_slice(&(place as u32).to_le_bytes());
        let mut entries: Vec<(u16, u16, u32, u32)> = vec![
            (256, 4, 1, 9),
            (257, 4, 1, 8),
            (258, 3, how.samples.into(), if how.samples < 3 { u32::from(how.bits) * 65537 } else { bits as u32 }),
            (259, 3, 1, how.compression.into()),
            (262, 3, 1, how.photometric.into()),
            (273, 4, 1, start as u32),
            (277, 3, 1, how.samples.into()),
            (278, 4, 1, 8),
            (279, 4, 1, page.len() as u32),
        ];
        if i == 0 && text.len() > 4 {
            entries.push((270, 2, text.len() as u32, words as u32));
        }
        if how.resolution > 0 {
            entries.extend([(282, 5, 1, ratio as u32), (283, 5, 1, ratio as u32)]);
        }
        if how.photometric == 3 {
            entries.push((320, 3, 768, table as u32));
        }
        entries.sort();
        file.extend((entries.len() as u16).to_le_bytes());
        for (tag, kind, count, value) in entries {
            file.extend(
                [&tag.to_le_bytes()[..], &kind.to_le_bytes(), &count.to_le_bytes(), &value.to_le_bytes()].concat(),
            );
        }
        link = file.len();
        file.extend([0; 4]);
    }
    file
}

fn pages(order: [usize; 4]) -> Vec<Vec<u8>> {
    bytes(order).chunks(72).map(<[u8]>::to_vec).collect()
}

#[test]
fn tiff_pages_are_what_their_description_says() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let write = |how: &Pages, pages: &[Vec<u8>]| std::fs::write(at.join("a.tif"), tiff(how, pages, b"")).unwrap();
    let good = |scale| is_placed(at, json!({"file": "a.tif"}), 150.0, scale, [0.0; 4]);
    let ome = |order: &str, rest: &str, inner: &str| {
        format!(
            "<?xml version=\"1.0\"?><OME UUID=\"urn:1\"><Image ID=\"Image:0\" Name=\"a\"><Pixels DimensionOrder=\"{order}\" Type=\"uint8\" \
             SizeX=\"9\" SizeY=\"8\" SizeC=\"1\" SizeZ=\"7\" SizeT=\"5\" {rest}>{inner}</Pixels></Image></OME>"
        )
    };
    let text = ome(
        "XYCZT",
        "PhysicalSizeX=\"0.5\" PhysicalSizeY=\"1\" PhysicalSizeZ=\"2\" TimeIncrement=\"3\"",
        "<TiffData IFD=\"0\" PlaneCount=\"35\"/>",
    );
    write(&Pages { description: &text, ..GREY }, &pages(USUAL));
    good([0.5, 1.0, 2.0, 3.0]);
    // Lengths in units of their own.
    let text = ome(
        "XYZTC",
        "PhysicalSizeX=\"500\" PhysicalSizeXUnit=\"nm\" PhysicalSizeY=\"1\" PhysicalSizeZ=\"0.002\" PhysicalSizeZUnit=\"mm\" \
         TimeIncrement=\"3\" TimeIncrementUnit=\"ms\"",
        "",
    );
    write(&Pages { description: &text, ..GREY }, &pages(USUAL));
    good([500.0, 1000.0, 2000.0, 3.0]);
    // Descriptions that are elsewhere, and planes that are.
    let text = "<OME UUID=\"urn:1\"><BinaryOnly MetadataFile=\"a.companion.ome\" UUID=\"urn:2\"/></OME>";
    write(&Pages { description: text, ..GREY }, &pages(USUAL));
    is_refused(at, json!({"file": "a.tif"}), &["unsupported: its OME-XML is in another file, a.companion.ome"]);
    let text = ome(
        "XYZCT",
        "",
        "<TiffData FirstT=\"0\" IFD=\"0\" PlaneCount=\"7\"/><TiffData FirstT=\"1\" PlaneCount=\"28\"><UUID FileName=\"b.tif\">urn:3</UUID></TiffData>",
    );
    write(&Pages { description: &text, ..GREY }, &pages(USUAL)[..7]);
    is_refused(at, json!({"file": "a.tif"}), &["unsupported: planes in another file, b.tif"]);
    // Time fastest over the pages, whatever dimensions are asked for.
    let text = ome("XYCTZ", "", "");
    write(&Pages { description: &text, ..GREY }, &pages([0, 1, 3, 2]));
    good([1.0; 4]);
    is_placed(at, json!({"file": "a.tif", "dimensions": POINTS}), 150.0, [1.0; 4], [0.0; 4]);
    is_refused(at, json!({"file": "a.tif", "dimensions": [9, 8, 5, 7]}), &["7 slices at 5 times", "dimensions"]);
    // Pages in an order of their own, and times that are not even.
    let data: String = (0..35)
        .map(|i| format!("<TiffData FirstZ=\"{}\" FirstT=\"{}\" IFD=\"{}\" PlaneCount=\"1\"/>", i % 7, i / 7, 34 - i))
        .collect();
    let times: String =
        (0..5).map(|t| format!("<Plane TheZ=\"0\" TheC=\"0\" TheT=\"{t}\" DeltaT=\"{}\"/>", 1 << t)).collect();
    let text = ome("XYZCT", "", &(data + &times));
    write(&Pages { description: &text, ..GREY }, &pages(USUAL).into_iter().rev().collect::<Vec<_>>());
    let ((box_, _), (found, _)) = (plain(at, 150.0), extent(at, json!({"file": "a.tif"}), 150.0));
    let warped = |t: f64| (1 << t as usize) as f64 * (1.0 + t.fract());
    assert!(
        (0..3).all(|k| found[k] == box_[k]) && (0..2).all(|end| (found[3][end] - warped(box_[3][end])).abs() < 1e-9),
        "{found:?}"
    );
    // ImageJ: channels fastest, then slices, then frames; or all planes behind the only page.
    let text = "ImageJ=1.54\nimages=70\nchannels=2\nslices=7\nframes=5\nhyperstack=true\nunit=micron\nspacing=3.0\nfinterval=4.0\n";
    let two: Vec<Vec<u8>> = pages(USUAL).into_iter().flat_map(|page| [vec![0; 72], page]).collect();
    write(&Pages { description: text, resolution: 2, ..GREY }, &two);
    is_placed(at, json!({"file": "a.tif", "channel": 1}), 150.0, [0.5, 0.5, 3.0, 4.0], [0.0; 4]);
    let (nothing, notes) = try_build::<4>(at, json!({"file": "a.tif"}), 150.0).unwrap();
    assert!(nothing.simplices.is_empty() && notes[0].contains("the first of 2 channels"), "{notes:?}");
    let text = "ImageJ=1.11a\nimages=35\nslices=7\nframes=5\nhyperstack=true\n";
    let all = pages(USUAL);
    std::fs::write(at.join("a.tif"), tiff(&Pages { description: text, ..GREY }, &all[..1], &all[1..].concat()))
        .unwrap();
    good([1.0; 4]);
    // tifffile.
    for text in ["{\"shape\": [5, 7, 8, 9]}", "{\"shape\": [5, 7, 8, 9], \"axes\": \"TZYX\"}"] {
        write(&Pages { description: text, ..GREY }, &pages(USUAL));
        good([1.0; 4]);
    }
    write(&Pages { description: "{\"shape\": [7, 5, 8, 9], \"axes\": \"ZTYX\"}", ..GREY }, &pages([0, 1, 3, 2]));
    good([1.0; 4]);
    // Nothing said: z, unless dimensions and axes say otherwise.
    write(&GREY, &pages([0, 1, 3, 2]));
    let image = json!({"file": "a.tif", "dimensions": POINTS, "axes": ["x", "y", "time", "z"]});
    is_placed(at, image, 150.0, [1.0; 4], [0.0; 4]);
}

#[test]
fn tiff_numbers_are_read_as_stored() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let write = |how: &Pages, pages: &[Vec<u8>]| std::fs::write(at.join("a.tif"), tiff(how, pages, b"")).unwrap();
    let image = || json!({"file": "a.tif", "dimensions": POINTS});
    for photometric in [0, 1, 3] {
        write(&Pages { photometric, ..GREY }, &pages(USUAL));
        is_placed(at, image(), 150.0, [1.0; 4], [0.0; 4]);
    }
    // Zstandard: a frame with one block that is not packed.
    let frame = |page: &Vec<u8>| {
        let block = (page.len() as u32) << 3 | 1;
        [&[0x28, 0xb5, 0x2f, 0xfd, 0x20, page.len() as u8], &block.to_le_bytes()[..3], page].concat()
    };
    write(&Pages { compression: 50000, ..GREY }, &pages(USUAL).iter().map(frame).collect::<Vec<_>>());
    is_placed(at, image(), 150.0, [1.0; 4], [0.0; 4]);
    // Single bits, rows of which begin with a byte of their own.
    let bits = |page: &Vec<u8>| -> Vec<u8> {
        let row = |row: &[u8]| {
            let mut packed = [0u8; 2];
            row.iter()
                .enumerate()
                .filter(|(_, value)| **value > 150)
                .for_each(|(x, _)| packed[x / 8] |= 0x80 >> (x % 8));
            packed
        };
        page.chunks(9).flat_map(row).collect()
    };
    write(&Pages { bits: 1, ..GREY }, &pages(USUAL).iter().map(bits).collect::<Vec<_>>());
    let mask: Vec<u8> = bytes(USUAL).into_iter().map(|v| u8::from(v > 150)).collect();
    std::fs::write(at.join("mask.raw"), mask).unwrap();
    let mask = json!({"file": "mask.raw", "dimensions": POINTS, "type": "uint8"});
    assert_eq!(extent(at, image(), 0.5), extent(at, mask, 0.5));
    // Colours: one of them.
    let colours = |page: &Vec<u8>| page.iter().flat_map(|&v| [0, v, 9]).collect::<Vec<u8>>();
    write(&Pages { samples: 3, photometric: 2, ..GREY }, &pages(USUAL).iter().map(colours).collect::<Vec<_>>());
    is_refused(at, image(), &["\"sample\" holds 3 values", "channel"]);
    let mut green = image();
    green["channel"] = json!(1);
    is_placed(at, green, 150.0, [1.0; 4], [0.0; 4]);
    write(&Pages { compression: 34712, ..GREY }, &pages(USUAL));
    is_refused(at, image(), &["unsupported: "]);
}

#[test]
fn files_of_a_sequence_share_one_grid() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let all = values(USUAL);
    let write = |i: usize, attributes: &str, time: Option<f64>| {
        let numbers: Vec<String> = all.chunks(504).nth(i).unwrap().iter().map(f32::to_string).collect();
        let field = time.map_or(String::new(), |time| {
            format!("<FieldData><DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"ascii\">{time}</DataArray></FieldData>")
        });
        let text = format!(
            "<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\"><ImageData WholeExtent=\"0 8 0 7 0 6\" {attributes}>\
             {field}<Piece Extent=\"0 8 0 7 0 6\"><PointData><DataArray type=\"Float32\" Name=\"f\" format=\"ascii\">{}</DataArray>\
             </PointData></Piece></ImageData></VTKFile>",
            numbers.join(" ")
        );
        std::fs::write(at.join(format!("a{i}.vti")), text).unwrap();
    };
    let files = json!({"files": ["a0.vti", "a1.vti", "a2.vti", "a3.vti", "a4.vti"]});
    (0..5).for_each(|i| write(i, "Origin=\"10 20 30\" Spacing=\"2 1 0.5\"", Some(7.0 + 3.0 * i as f64)));
    is_placed(at, files.clone(), 0.0, [2.0, 1.0, 0.5, 3.0], [10.0, 20.0, 30.0, 7.0]);
    let mut counted = files.clone();
    counted["spacing"] = json!([2, 1, 0.5, 1]);
    is_placed(at, counted, 0.0, [2.0, 1.0, 0.5, 1.0], [10.0, 20.0, 30.0, 7.0]);
    write(3, "Origin=\"10 20 30\" Spacing=\"2 1 1\"", Some(16.0));
    is_refused(at, files.clone(), &["a3.vti", "along z", "a0.vti"]);
    // What nobody asks for may be of any kind, and may be damaged.
    let odd = [
        ("<Array type=\"String\" Name=\"s\" format=\"ascii\">65 0</Array>", true),
        ("<DataArray type=\"Int8\" Name=\"m\" format=\"ascii\">1</DataArray>", false),
    ];
    for (array, without_name) in odd {
        let text = std::fs::read_to_string(at.join("a0.vti"))
            .unwrap()
            .replace("</PointData>", &format!("{array}</PointData>"));
        std::fs::write(at.join("odd.vti"), text).unwrap();
        try_build::<3>(at, json!({"file": "odd.vti", "array": "f"}), 0.0).unwrap();
        assert_eq!(try_build::<3>(at, json!({"file": "odd.vti"}), 0.0).is_ok(), without_name, "{array}");
        is_refused(
            at,
            json!({"file": "odd.vti", "array": "g"}),
            &[if without_name { "there are f" } else { "array `m`" }],
        );
    }
    // Values of cells lie at their middles.
    let cells = std::fs::read_to_string(at.join("a0.vti")).unwrap().replace("0 8 0 7 0 6", "0 9 0 8 0 7");
    let text = "<Array type=\"String\" Name=\"s\" format=\"ascii\">65 0</Array><DataArray type=\"Int8\" Name=\"m\" format=\"ascii\">1</DataArray>";
    let cells = cells.replace("PointData>", "CellData>").replace("<FieldData>", &format!("<FieldData>{text}"));
    std::fs::write(at.join("cells.vti"), cells).unwrap();
    let opened = ao4d::io::image::open("", at, &["cells.vti".into()], &Default::default()).unwrap();
    assert_eq!(
        opened.axes.each_ref().map(|axis| (axis.size, axis.positions.at(0))),
        [(9, 11.0), (8, 20.5), (7, 30.25), (1, 7.0)]
    );
    // Points that are hidden, or lie outside of what was resampled, have no value.
    let whole = std::fs::read_to_string(at.join("a0.vti")).unwrap();
    for (name, usual, odd) in [("vtkGhostType", "1", "3"), ("vtkValidPointMask", "1", "0")] {
        let marks: Vec<&str> = (0..504).map(|i| if i < 5 { odd } else { usual }).collect();
        let array =
            format!("<DataArray type=\"UInt8\" Name=\"{name}\" format=\"ascii\">{}</DataArray>", marks.join(" "));
        std::fs::write(at.join("marked.vti"), whole.replace("</PointData>", &(array + "</PointData>"))).unwrap();
        let opened = ao4d::io::image::open("", at, &["marked.vti".into()], &Default::default());
        let mut opened = opened.unwrap();
        let mut values = vec![0.0; 504];
        opened.values.read(&mut values).unwrap();
        assert!(values.iter().enumerate().all(|(i, value)| value.is_nan() == (i < 5)), "{name}");
        assert!(opened.notes[0].contains("5 of its points are marked"), "{:?}", opened.notes);
    }
    write(3, "Origin=\"10 20 30\" Spacing=\"2 1 0.5\"", Some(1.0));
    is_refused(at, files.clone(), &["times don't go on", "7.0, 10.0, 13.0, 1.0"]);
    // In units of one kind.
    for (i, unit) in ["mm", "millimeter", "um"].into_iter().enumerate() {
        let header = format!(
            "type: float\ndimension: 3\nsizes: 9 8 7\nspacings: 1 1 1\nunits: \"{unit}\" \"{unit}\" \"{unit}\""
        );
        std::fs::write(at.join(format!("u{i}.nrrd")), nrrd(&header, &little(&all[504 * i..504 * (i + 1)]))).unwrap();
    }
    try_build::<4>(at, json!({"files": ["u0.nrrd", "u1.nrrd"]}), 0.0).unwrap();
    is_refused(
        at,
        json!({"files": ["u0.nrrd", "u1.nrrd", "u2.nrrd"]}),
        &["u2.nrrd: is in um along x, not in mm", "u0.nrrd"],
    );
    // A quarter of a turn about z.
    (0..5).for_each(|i| write(i, "Direction=\"0 -1 0 1 0 0 0 0 1\"", None));
    let ((box_, _), (found, _)) = (plain(at, 0.0), extent(at, files, 0.0));
    assert_eq!(found[1], box_[0]);
    assert_eq!(found[0], [-box_[1][1], -box_[1][0]]);
}
