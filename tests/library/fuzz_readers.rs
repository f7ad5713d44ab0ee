//! Files cut off and damaged at random, in every format that a scene reads: each is read or refused, and never a panic.
//!
//! How long it looks, and where: `support/fuzz.rs`.

use std::io::Write;
use std::path::Path;
use std::time::Instant;

use crate::fuzz::{self, damage};
use ao4d::scene::{ObjectSpec, build_object};
use serde_json::{Value, json};

const POINTS: [usize; 4] = [4, 3, 3, 2];

fn values() -> Vec<u8> {
    (0..72).map(|i| if [16, 17, 18, 19, 52, 53].contains(&i) { 200 } else { (i * 7 % 50) as u8 }).collect()
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn nifti() -> Vec<u8> {
    let mut bytes = vec![0u8; 352];
    bytes[..4].copy_from_slice(&348i32.to_le_bytes());
    for (i, n) in [4u16, 4, 3, 3, 2, 1, 1, 1].into_iter().enumerate() {
        bytes[40 + 2 * i..][..2].copy_from_slice(&n.to_le_bytes());
    }
    bytes[70..72].copy_from_slice(&2i16.to_le_bytes());
    bytes[72..74].copy_from_slice(&8i16.to_le_bytes());
    for i in 0..8 {
        bytes[76 + 4 * i..][..4].copy_from_slice(&1f32.to_le_bytes());
    }
    bytes[108..112].copy_from_slice(&352f32.to_le_bytes());
    bytes[344..348].copy_from_slice(b"n+1\0");
    bytes.extend(values());
    bytes
}

fn tiff() -> Vec<u8> {
    let mut file = std::io::Cursor::new(Vec::new());
    let mut encoder = tiff::encoder::TiffEncoder::new(&mut file).unwrap();
    for (i, page) in values().chunks(12).enumerate() {
        let mut image = encoder.new_image::<tiff::encoder::colortype::Gray8>(4, 3).unwrap();
        if i == 0 {
            let text = "ImageJ=1.11a\nimages=6\nslices=3\nframes=2\nhyperstack=true\n";
            image.encoder().write_tag(tiff::tags::Tag::ImageDescription, text).unwrap();
        }
        image.write_data(page).unwrap();
    }
    file.into_inner()
}

fn netcdf(folder: &Path) -> Vec<u8> {
    let mut data_set = netcdf3::DataSet::new();
    for (dimension, size) in [("time", 2), ("z", 3), ("y", 3), ("x", 4)] {
        data_set.add_fixed_dim(dimension, size).unwrap();
    }
    data_set.add_var_f64("z", &["z"]).unwrap();
    data_set.add_var_f32("density", &["time", "z", "y", "x"]).unwrap();
    data_set.add_var_attr_f32("density", "missing_value", vec![-99.0]).unwrap();
    let path = folder.join("original.nc");
    let mut file = netcdf3::FileWriter::open(&path).unwrap();
    file.set_def(&data_set, netcdf3::Version::Classic, 0).unwrap();
    file.write_var_f64("z", &[0.0, 1.0, 3.0]).unwrap();
    file.write_var_f32("density", &values().into_iter().map(f32::from).collect::<Vec<_>>()).unwrap();
    file.close().unwrap();
    std::fs::read(path).unwrap()
}

fn vti() -> String {
    let numbers: Vec<String> = values().iter().map(u8::to_string).collect();
    format!(
        "<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\"><ImageData WholeExtent=\"0 3 0 2 0 5\" \
         Origin=\"0 0 0\" Spacing=\"1 1 1\"><Piece Extent=\"0 3 0 2 0 5\"><PointData><DataArray type=\"UInt8\" \
         Name=\"density\" format=\"ascii\">{}</DataArray></PointData></Piece></ImageData></VTKFile>",
        numbers.join(" ")
    )
}

/// An image of two pieces along z, the files of which are one and the same; and a mesh of two.
fn pvti() -> String {
    "<VTKFile type='PImageData'><PImageData WholeExtent='0 3 0 2 0 10' Origin='0 0 0' Spacing='1 1 1' GhostLevel='0'>\
     <Piece Extent='0 3 0 2 0 5' Source='part.vti'/><Piece Extent='0 3 0 2 5 10' Source='part.vti'/></PImageData></VTKFile>"
        .into()
}

fn pvtu() -> String {
    "<VTKFile type='PUnstructuredGrid'><PUnstructuredGrid GhostLevel='0'><Piece Source='part.vtu'/>\
     <Piece Source='beyond.vtu'/></PUnstructuredGrid></VTKFile>"
        .into()
}

/// Lists of two files over time.
fn collection(first: &str, second: &str) -> String {
    format!(
        "<VTKFile type='Collection'><Collection><DataSet timestep='0' part='0' file='{first}'/>\
         <DataSet timestep='1' part='1' file='{second}'/></Collection></VTKFile>"
    )
}

fn series() -> String {
    r#"{"file-series-version": "1.0", "files": [{"name": "part.vti", "time": 0}, {"name": "part.vti", "time": 2.5}]}"#
        .into()
}

/// The corner tetrahedron's four triangles.
const TRIANGLES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
const CORNERS: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

fn binary_stl() -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend(4u32.to_le_bytes());
    for triangle in TRIANGLES {
        bytes.extend([0u8; 12]);
        triangle.iter().flat_map(|&i| CORNERS[i]).for_each(|x| bytes.extend(x.to_le_bytes()));
        bytes.extend([0u8; 2]);
    }
    bytes
}

fn ascii_stl() -> String {
    let mut text = String::from("solid corner\n");
    for triangle in TRIANGLES {
        text += "facet normal 0 0 0\nouter loop\n";
        triangle
            .iter()
            .for_each(|&i| text += &format!("vertex {} {} {}\n", CORNERS[i][0], CORNERS[i][1], CORNERS[i][2]));
        text += "endloop\nendfacet\n";
    }
    text + "endsolid corner\n"
}

fn ply(format: &str) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat {format} 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
         element face 4\nproperty list uchar int vertex_indices\nend_header\n"
    )
    .into_bytes();
    if format == "ascii" {
        CORNERS.iter().for_each(|[x, y, z]| bytes.extend(format!("{x} {y} {z}\n").bytes()));
        TRIANGLES.iter().for_each(|[a, b, c]| bytes.extend(format!("3 {a} {b} {c}\n").bytes()));
    } else {
        CORNERS.iter().flatten().for_each(|x| bytes.extend(x.to_be_bytes()));
        for triangle in TRIANGLES {
            bytes.push(3);
            triangle.iter().for_each(|&i| bytes.extend((i as i32).to_be_bytes()));
        }
    }
    bytes
}

fn obj() -> String {
    let mut text = String::from("# corner\no a\n");
    CORNERS.iter().for_each(|[x, y, z]| text += &format!("v {x} {y} {z}\n"));
    TRIANGLES.iter().for_each(|[a, b, c]| text += &format!("f {}//1 {} {}\n", a + 1, b + 1, c + 1));
    text + "g b\nf -4 -3 -2 -1\n"
}

const MSH_2: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n7 0 0 0\n3 1 0 0\n12 0 1 0\n5 0 0 1\n$EndNodes\n\
    $Elements\n3\n1 15 2 0 1 7\n2 2 2 0 1 7 3 12\n9 4 2 0 1 7 3 12 5\n$EndElements\n";
const MSH_4: &str = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n0 0 0 1\n1 0 0 0 1 1 1 0 0\n$EndEntities\n\
    $Nodes\n2 4 3 12\n0 1 0 1\n7\n0 0 0\n3 1 0 3\n3\n12\n5\n1 0 0\n0 1 0\n0 0 1\n$EndNodes\n\
    $Elements\n2 2 1 9\n0 1 15 1\n1 7\n3 1 4 1\n9 7 3 12 5\n$EndElements\n";

const VTU: &str = "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\
    <UnstructuredGrid><Piece NumberOfPoints=\"4\" NumberOfCells=\"1\">\
    <Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">0 0 0 1 0 0 0 1 0 0 0 1</DataArray></Points>\
    <Cells><DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">0 1 2 3</DataArray>\
    <DataArray type=\"Int64\" Name=\"offsets\" format=\"ascii\">4</DataArray>\
    <DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">10</DataArray></Cells></Piece></UnstructuredGrid></VTKFile>";

/// The corner tetrahedron as a legacy file: as text in the old layout, or binary in the new one.
fn vtk(binary: bool) -> Vec<u8> {
    if !binary {
        return b"# vtk DataFile Version 3.0\nc\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\n\
            CELLS 2 9\n4 0 1 2 3\n3 0 1 2\nCELL_TYPES 2\n10 5\n"
            .to_vec();
    }
    let mut bytes = b"# vtk DataFile Version 5.1\nc\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 double\n".to_vec();
    CORNERS.iter().flatten().for_each(|x| bytes.extend(f64::from(*x).to_be_bytes()));
    bytes.extend(b"\nMETADATA\nINFORMATION 0\n\nCELLS 2 4\nOFFSETS vtktypeint64\n");
    [0i64, 4].iter().for_each(|x| bytes.extend(x.to_be_bytes()));
    bytes.extend(b"\nCONNECTIVITY vtktypeint64\n");
    [0i64, 1, 2, 3].iter().for_each(|x| bytes.extend(x.to_be_bytes()));
    bytes.extend(b"\nCELL_TYPES 1\n");
    bytes.extend(10i32.to_be_bytes());
    bytes.extend(b"\nCELL_DATA 1\n");
    bytes
}

#[test]
fn damaged_files_are_read_or_refused() {
    let (time, mut random) = (fuzz::time(), fuzz::random());
    let folder = tempfile::tempdir().unwrap();
    let meshes = Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines/meshes");
    let nrrd = "NRRD0004\n# c\ntype: uint8\ndimension: 4\nsizes: 4 3 3 2\nspacings: 1 1 2 1\n";
    let image = |name: &str, extra: Value| {
        let mut image = json!({"file": name});
        image.as_object_mut().unwrap().extend(extra.as_object().unwrap().clone());
        json!({"isosurface": {"field": {"image": image}, "isovalue": 100}})
    };
    let extruded = |name: &str| json!({"extrude": {"mesh": name, "from": 0, "to": 1}});
    let raw = json!({"dimensions": POINTS, "type": "uint8"});
    // What lists name, and isn't damaged itself.
    std::fs::write(folder.path().join("part.vti"), vti()).unwrap();
    std::fs::write(folder.path().join("part.vtu"), VTU).unwrap();
    let beyond = VTU.replace("0 0 0 1 0 0 0 1 0 0 0 1<", "10 0 0 11 0 0 10 1 0 10 0 1<");
    std::fs::write(folder.path().join("beyond.vtu"), beyond).unwrap();
    let netcdf4 = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/support/netcdf4.nc");
    let files: Vec<(&str, Vec<u8>, Value)> = vec![
        ("x.raw", values(), image("x.raw", raw)),
        ("x.nii", nifti(), image("x.nii", json!({}))),
        ("x.nii.gz", gzip(&nifti()), image("x.nii.gz", json!({}))),
        ("x.tif", tiff(), image("x.tif", json!({}))),
        ("y.tif", std::fs::read(meshes.join("../data/droplet.tif")).unwrap(), image("y.tif", json!({}))),
        ("x.nc", netcdf(folder.path()), image("x.nc", json!({}))),
        (
            "x.nrrd",
            [format!("{nrrd}encoding: raw\n\n").as_bytes(), &values()].concat(),
            image("x.nrrd", json!({"smooth": 0.5})),
        ),
        (
            "z.nrrd",
            [format!("{nrrd}encoding: gzip\n\n").as_bytes(), &gzip(&values())].concat(),
            image("z.nrrd", json!({"downsample": [2, 1, 1, 1]})),
        ),
        (
            "x.vti",
            vti().into_bytes(),
            json!({"isosurface": {"field": {"image": {"files": ["x.vti", "x.vti"]}}, "isovalue": 100}}),
        ),
        (
            "x.pvti",
            pvti().into_bytes(),
            json!({"isosurface": {"field": {"image": {"files": ["x.pvti", "x.pvti"]}}, "isovalue": 100}}),
        ),
        ("x.pvd", collection("part.vti", "part.vti").into_bytes(), image("x.pvd", json!({}))),
        ("x.vti.series", series().into_bytes(), image("x.vti.series", json!({}))),
        (
            "part.pvd",
            collection("part.vtu", "beyond.vtu").replace("timestep='1'", "timestep='0'").into_bytes(),
            extruded("part.pvd"),
        ),
        ("x.pvtu", pvtu().into_bytes(), extruded("x.pvtu")),
        ("x4.nc", std::fs::read(netcdf4).unwrap(), image("x4.nc", json!({"array": "density"}))),
        ("x.stl", binary_stl(), extruded("x.stl")),
        ("y.stl", ascii_stl().into_bytes(), extruded("y.stl")),
        ("x.ply", ply("ascii"), extruded("x.ply")),
        ("y.ply", ply("binary_big_endian"), extruded("y.ply")),
        (
            "z.ply",
            std::fs::read(meshes.join("ant.ply")).unwrap(),
            json!({"spin": {"mesh": "z.ply", "offset": 20, "steps": 3}}),
        ),
        ("x.obj", obj().into_bytes(), extruded("x.obj")),
        ("x.msh", MSH_2.as_bytes().to_vec(), extruded("x.msh")),
        ("y.msh", MSH_4.as_bytes().to_vec(), extruded("y.msh")),
        ("x.vtk", vtk(false), extruded("x.vtk")),
        ("y.vtk", vtk(true), extruded("y.vtk")),
        ("x.vtu", VTU.as_bytes().to_vec(), extruded("x.vtu")),
        ("y.vtu", std::fs::read(meshes.join("nut.vtu")).unwrap(), extruded("y.vtu")),
    ];
    let build = |name: &str, bytes: &[u8], object: &Value| {
        std::fs::write(folder.path().join(name), bytes).unwrap();
        let spec: ObjectSpec = serde_json::from_value(object.clone()).unwrap();
        build_object::<4>(&spec, folder.path()).map_err(|error| error.to_string())
    };
    for (name, original, object) in &files {
        build(name, original, object).unwrap_or_else(|error| panic!("{name} as it should be: {error}"));
    }
    let start = Instant::now();
    let (mut read, mut refused) = (vec![0u32; files.len()], vec![0u32; files.len()]);
    while start.elapsed() < time {
        for (i, (name, original, object)) in files.iter().enumerate() {
            // The large ones are slow to build; they come less often.
            if original.len() > 14_000 && random.below(20) > 0 {
                continue;
            }
            let state = random.0;
            let bytes = damage(original, &mut random);
            let outcome = std::panic::catch_unwind(|| build(name, &bytes, object));
            match outcome {
                Ok(Ok(surface)) => {
                    let count = surface.vertices.len();
                    let indices = surface.simplices.as_flattened();
                    assert!(indices.iter().all(|&v| (v as usize) < count), "{name}: AO4D_FUZZ_SEED={state}");
                    assert!(surface.vertices.iter().flatten().all(|x| x.is_finite()), "{name}: AO4D_FUZZ_SEED={state}");
                    read[i] += 1;
                }
                Ok(Err(message)) => {
                    assert!(message.len() < 2000 && !message.is_empty(), "{name}: {message}");
                    refused[i] += 1;
                }
                Err(_) => {
                    let kept = std::env::temp_dir().join(format!("ao4d-fuzz-{state}-{name}"));
                    std::fs::write(&kept, &bytes).unwrap();
                    panic!("{name}: a panic; the file is kept as {}", kept.display());
                }
            }
        }
    }
    println!("{} files in {} s", read.iter().chain(&refused).sum::<u32>(), start.elapsed().as_secs());
    for (i, (name, original, _)) in files.iter().enumerate() {
        println!("{name}: {} read, {} refused", read[i], refused[i]);
        assert!(original.len() > 14_000 || refused[i] > 0, "{name} was never refused");
    }
}
