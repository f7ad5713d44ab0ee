//! `ao4d info` and `ao4d compare`: what they tell of every kind of file, their exit codes, and what they refuse.

use std::path::Path;
use std::process::{Command, Output};

use ao4d::inspect::surface::{Form, SurfaceSummary};
use ao4d::inspect::{Description, Info};
use ao4d::io::{raw, vti, vtu};
use ao4d::scene::{ObjectSpec, build_object};
use ao4d::volume::{Array, Grid, Volume};
use serde_json::{Value, json};

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn write(&self, name: &str, bytes: &[u8]) {
        std::fs::write(self.0.path().join(name), bytes).unwrap();
    }

    fn ao4d(&self, arguments: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_ao4d")).current_dir(self.0.path()).args(arguments).output().unwrap()
    }

    /// The exit code, and what was printed.
    fn says(&self, arguments: &[&str]) -> (i32, String) {
        let output = self.ao4d(arguments);
        let code = output.status.code().unwrap();
        let (out, err) = (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
        assert!(out.is_empty() || err.is_empty(), "results and errors at once:\n{out}\n{err}");
        assert_eq!(code == 2, out.is_empty(), "{arguments:?}: code {code}");
        (code, out + &err)
    }

    fn info(&self, name: &str) -> Description {
        Info::read(&self.0.path().join(name)).unwrap().description
    }

    fn surface(&self, name: &str) -> SurfaceSummary {
        let Description::Mesh { surface, .. } = self.info(name) else { panic!("{name} is no mesh") };
        *surface.unwrap_or_else(|| panic!("{name} is no surface"))
    }

    /// Writes an object of a scene as a mesh, with its points in `position`.
    fn write_object<const D: usize>(&self, name: &str, object: Value) {
        let object: ObjectSpec = serde_json::from_value(object).unwrap();
        let surface = build_object::<D>(&object, &meshes()).unwrap();
        let position: Vec<f32> = surface.vertices.iter().flatten().map(|&x| x as f32).collect();
        let points: Vec<[f32; 3]> = surface.vertices.iter().map(|v| std::array::from_fn(|a| v[a] as f32)).collect();
        let cells = surface.simplices.as_flattened();
        let arrays = [Array::new("position", D, position)];
        let mut bytes = Vec::new();
        let (triangles, tetrahedra) = (cells.as_chunks().0, cells.as_chunks().0);
        let cells = if D == 3 { vtu::Cells::Triangles(triangles) } else { vtu::Cells::Tetrahedra(tetrahedra) };
        vtu::write(&mut bytes, &points, cells, &arrays, &[]).unwrap();
        self.write(name, &bytes);
    }
}

fn meshes() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines/meshes")
}

fn volume(value: f32) -> Volume {
    let grid = Grid { dimensions: [2, 3, 2], origin: [-1.0, 0.0, 1.0], spacing: [0.5, 0.25, 1.0 / 3.0] };
    let mut depth = vec![f32::INFINITY; 12];
    depth[7] = value;
    let arrays = vec![Array::new("depth", 1, depth), Array::new("rgba", 4, vec![9u8; 48])];
    Volume { grid, arrays, field_data: vec![("program".into(), "a test".into())] }
}

fn vti(volume: &Volume) -> Vec<u8> {
    let settings = vti::Settings { field_data: volume.field_data.clone(), ..Default::default() };
    vti::write(std::io::Cursor::new(Vec::new()), volume, &settings).unwrap().into_inner()
}

#[test]
fn images() {
    let folder = Folder::new();
    folder.write("a.vti", &vti(&volume(2.5)));
    let (code, text) = folder.says(&["info", "a.vti"]);
    assert_eq!(code, 0);
    let bytes = std::fs::metadata(folder.0.path().join("a.vti")).unwrap().len();
    let component = "9 to 9, mean 9";
    assert_eq!(
        text,
        format!(
            "a.vti, {bytes} bytes: an image of 2 x 3 x 2 points\norigin (-1, 0, 1), spacing (0.5, 0.25, 0.333333)\n\
             on points:\n  depth, 1 x Float32: 2.5 to 2.5, mean 2.5, 11 infinite\n    \
             in 16 equal parts of this range: 1 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0\n  rgba, 4 x UInt8: {component}; {component}; {component}; {component}\nfield data:\n  program: a test\n"
        )
    );
    let (_, text) = folder.says(&["info", "a.vti", "--json"]);
    let json: Value = serde_json::from_str(&text).unwrap();
    assert_eq!((&json["kind"], &json["dimensions"]), (&json!("image"), &json!([2, 3, 2])));
    assert_eq!(json["spacing"][2], json!(1.0 / 3.0));
    assert_eq!((&json["axes"][1]["points"], &json["axes"][1]["last"]), (&json!(3), &json!(0.5)));
    assert_eq!(json["point_arrays"][0]["ranges"][0]["infinite"], json!(11));
    assert_eq!((&json["point_arrays"][1]["type"], &json["field_data"]["program"]), (&json!("u8"), &json!("a test")));
}

#[test]
fn images_compare() {
    let folder = Folder::new();
    folder.write("a.vti", &vti(&volume(2.5)));
    folder.write("b.vti", &vti(&volume(2.0)));
    folder.write("seen.vti", &vti(&volume(f32::INFINITY)));
    let (code, text) = folder.says(&["compare", "a.vti", "a.vti"]);
    assert_eq!((code, text.lines().last()), (0, Some("same")));
    let (code, text) = folder.says(&["compare", "a.vti", "b.vti"]);
    assert_eq!(code, 1);
    let line =
        "different: depth: 1 of 12 numbers differ, largest 5.000e-1, rms 1.443e-1; 2.5 and 2.0 at 7 (voxel 1, 0, 1)";
    assert_eq!(text, format!("{line}\nsame: rgba: 48 numbers, all equal\ndifferent\n"));
    for (options, code) in [
        (&["--atol", "0.5"][..], 0),
        (&["--atol", "0.49"], 1),
        (&["--rtol", "0.25"], 0),
        (&["--rtol", "0.24"], 1),
        (&["--max-different", "1"], 0),
        (&["--array", "rgba"], 0),
        (&["--array", "rgba", "--array", "depth"], 1),
    ] {
        let arguments = [&["compare", "a.vti", "b.vti"], options].concat();
        assert_eq!(folder.says(&arguments).0, code, "{options:?}");
    }
    // No tolerance makes a number out of infinity.
    assert_eq!(folder.says(&["compare", "a.vti", "seen.vti", "--atol", "1e30", "--rtol", "1e30"]).0, 1);
    let (code, text) = folder.says(&["compare", "a.vti", "b.vti", "--json"]);
    let json: Value = serde_json::from_str(&text).unwrap();
    assert_eq!((code, &json["same"], &json["arrays"][0]["at"]["voxel"]), (1, &json!(false), &json!([1, 0, 1])));
    let (code, text) = folder.says(&["compare", "a.vti", "b.vti", "--array", "opacity"]);
    assert_eq!(code, 2);
    assert_eq!(text, "error: neither a.vti nor b.vti has an array `opacity`; there is depth, rgba\n");
}

#[test]
fn folders_are_compared_file_by_file_and_reported() {
    let folder = Folder::new();
    let image = |shift: f32| {
        let grid = Grid { dimensions: [3, 2, 2], origin: [0.0; 3], spacing: [1.0; 3] };
        let occlusion: Vec<f32> = (0..12).map(|i| i as f32 / 16.0 + if i == 7 { shift } else { 0.0 }).collect();
        let opacity = vec![1.0f32; 12];
        let arrays = vec![Array::new("ambient_occlusion", 1, occlusion), Array::new("opacity", 1, opacity)];
        vti(&Volume { grid, arrays, field_data: Vec::new() })
    };
    for name in ["old", "new"] {
        std::fs::create_dir(folder.0.path().join(name)).unwrap();
        folder.write(&format!("{name}/same.vti"), &image(0.0));
    }
    folder.write("old/a.vti", &image(0.0));
    folder.write("new/a.vti", &image(0.125));
    folder.write("new/figure.py", b"1");
    let reports = ["--junit", "r/j.xml", "--markdown", "r/m.md", "--pictures", "r/p", "-q"];
    let (code, text) = folder.says(&[&["compare", "new", "old", "--json"], &reports[..]].concat());
    let json: Value = serde_json::from_str(&text).unwrap();
    assert_eq!((code, &json["same"]), (1, &json!(false)));
    let files: Vec<(&str, bool)> =
        json["files"].as_array().unwrap().iter().map(|f| (f["file"].as_str().unwrap(), f["same"] == true)).collect();
    assert_eq!(files, [("a.vti", false), ("figure.py", false), ("same.vti", true)]);
    let at = &json["files"][0]["arrays"][0]["at"];
    assert_eq!((&at["a"], &at["b"], &at["voxel"]), (&json!(0.5625), &json!(0.4375), &json!([1, 0, 1])));
    let read = |name: &str| std::fs::read_to_string(folder.0.path().join(name)).unwrap();
    assert!(read("r/j.xml").contains("<testsuite name=\"ao4d compare\" tests=\"3\" failures=\"2\""));
    let markdown = read("r/m.md");
    assert!(markdown.contains("| a.vti | ambient\\_occlusion | 1 of 12 | 1.250e-1 |"), "{markdown}");
    assert!(markdown.contains("![a.vti](p/a.vti.png)") && markdown.contains("Same: same.vti."), "{markdown}");
    let picture = std::fs::read(folder.0.path().join("r/p/a.vti.png")).unwrap();
    assert!(picture.starts_with(b"\x89PNG"));
    // Array by array, as the file says; a tolerance for another array doesn't help.
    for (tolerances, code) in [
        ("arrays: {ambient_occlusion: {atol: 0.125}}\nignore: ['*.py']\n", 0),
        ("arrays: {ambient_occlusion: {max_different: 1}}\nignore: [figure.py]\n", 0),
        ("arrays: {opacity: {atol: 0.125}}\nignore: ['*.py']\n", 1),
        ("default: {atol: 0.125}\narrays: {ambient_occlusion: {atol: 0.1}}\nignore: ['*.py']\n", 1),
        ("arrays: {ambient_occlusion: {atol: 0.125}}\n", 1),
    ] {
        folder.write("t.yaml", tolerances.as_bytes());
        assert_eq!(folder.says(&["compare", "new", "old", "--tolerances", "t.yaml"]).0, code, "{tolerances}");
    }
    folder.write("t.yaml", b"arrays: {x: {atol: 1, atoll: 2}}\n");
    let (code, text) = folder.says(&["compare", "new", "old", "--tolerances", "t.yaml"]);
    assert!(code == 2 && text.contains("t.yaml: expected tolerances") && text.contains("atoll"), "{text}");
    assert_eq!(folder.says(&["compare", "new", "old/a.vti"]).0, 2);
    // A file of its own may have tolerances and reports as well.
    folder.write("t.yaml", b"arrays: {ambient_occlusion: {atol: 0.125}}\n");
    assert_eq!(
        folder.says(&["compare", "new/a.vti", "old/a.vti", "--tolerances", "t.yaml", "--junit", "j.xml", "-q"]).0,
        0
    );
    assert!(read("j.xml").contains("failures=\"0\""));
}

#[test]
fn occlusion_files_and_raw_ones() {
    let folder = Folder::new();
    let floats = |values: &[f32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    folder.write("plain.f32", &floats(&[0.0, 0.25, 2.0]));
    let (code, text) = folder.says(&["info", "plain.f32"]);
    let told = "plain.f32, 12 bytes: ambient occlusion at 3 vertices\n0 to 2, mean 0.75\nno sidecar";
    assert!(code == 0 && text.starts_with(told), "{text}");

    let sidecar = "count: 3\nmethod: random\nsamples: 16\nseed: 7\nerror_estimate: 0.01\nmesh: 00ff\nprogram: x\n";
    folder.write("ao.f32", &floats(&[0.0, 0.25, 1.0]));
    folder.write("ao.f32.yaml", sidecar.as_bytes());
    let (_, text) = folder.says(&["info", "ao.f32", "--json"]);
    let json: Value = serde_json::from_str(&text).unwrap();
    assert_eq!((&json["kind"], &json["sidecar"]["method"]), (&json!("occlusion"), &json!("random")));
    assert_eq!(json["values"]["ranges"][0]["max"], json!(1.0));
    let (code, text) = folder.says(&["compare", "plain.f32", "ao.f32"]);
    assert!(code == 1 && text.contains("2.0 and 1.0 at 2"), "{text}");
    assert_eq!(folder.says(&["compare", "ao.f32", "ao.f32", "--array", "ambient_occlusion"]).0, 0);

    let refused = |name: &str, message: &str| {
        let (code, text) = folder.says(&["info", name]);
        assert!(code == 2 && text.contains(name) && text.contains(message), "{text}");
        let (code, text) = folder.says(&["compare", "ao.f32", name]);
        assert!(code == 2 && text.contains(name) && text.contains(message), "{text}");
    };
    folder.write("short.f32", &floats(&[0.5])[..3]);
    refused("short.f32", "holds 3 bytes, which is no multiple of 4");
    folder.write("none.f32", b"");
    refused("none.f32", "holds 0 bytes");
    for (name, values, beside, message) in [
        ("count.f32", &[0.0, 0.25][..], sidecar, "it holds 8 bytes, but 3 values take 12"),
        ("beyond.f32", &[0.0, 0.25, 1.5], sidecar, "value 2 is 1.5"),
        ("nan.f32", &[0.0, f32::NAN, 1.0], sidecar, "value 1 is NaN"),
        ("lacks.f32", &[0.0, 0.25, 1.0], "count: 3\n", "lacks `method`"),
    ] {
        folder.write(name, &floats(values));
        folder.write(&format!("{name}.yaml"), beside.as_bytes());
        refused(name, message);
    }

    let grid = volume(0.0).grid;
    let mut bytes = Vec::new();
    let mut writer = raw::RawWriter::new(std::io::Cursor::new(&mut bytes), &grid);
    writer.write_slab(0, &[0.25; 36]).unwrap();
    writer.finish().unwrap();
    folder.write("image.raw", &bytes);
    let (code, text) = folder.says(&["info", "image.raw"]);
    assert!(
        code == 0 && text.contains("36 floats, or the colours of 12 voxels") && text.contains("red 0.25"),
        "{text}"
    );
    assert_eq!(folder.says(&["compare", "image.raw", "image.raw"]).0, 0);
    folder.write("short.raw", &bytes[..140]);
    refused("short.raw", "no multiple of 12");
}

#[test]
fn surfaces_are_told_apart() {
    let folder = Folder::new();
    folder.write_object::<4>("tesseract.vtu", json!({"tesseract": {"subdivisions": 2}}));
    let closed = folder.surface("tesseract.vtu");
    assert_eq!((closed.form, closed.closed, closed.oriented, closed.manifold), (Form::SurfaceIn4d, true, true, true));
    // V = 8 n^3 + 8 n, T = 48 n^3, F = 2 T, E = V + T; and edges of length 2.
    assert_eq!(closed.f_vector, [80, 464, 768, 384]);
    assert_eq!((closed.euler_characteristic, closed.components, closed.welded), (0, 1, true));
    assert!((closed.measure - 64.0).abs() < 1e-12 && (closed.enclosed_volume.unwrap() - 16.0).abs() < 1e-12);
    let (_, text) = folder.says(&["info", "tesseract.vtu"]);
    let told = "a surface in 4D: closed, 1 piece\n  oriented\n  manifold\n  welded\n  \
                80 vertices, 464 edges, 768 triangles, 384 tetrahedra; Euler characteristic 0\n  \
                3-volume 64, encloses a 4-volume of 16; worst shape 0.755953 (cell ";
    assert!(text.contains(told), "{text}");

    // Turned inside out, by a mirror in the file itself.
    let text = String::from_utf8(ascii(&[[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])).unwrap();
    folder.write("inwards.ply", text.as_bytes());
    let inwards = folder.surface("inwards.ply");
    assert!(inwards.closed && inwards.oriented, "{inwards:?}");
    assert!((inwards.enclosed_volume.unwrap() + 1.0 / 6.0).abs() < 1e-15);
    assert!(
        folder.says(&["info", "inwards.ply"]).1.contains("encloses a 3-volume of 0.166667 (normals point inwards)")
    );

    // One triangle turned, one taken out, one there twice, one flat.
    folder.write("turned.ply", &ascii(&[[0, 2, 1], [0, 3, 1], [0, 2, 3], [1, 3, 2]]));
    let turned = folder.surface("turned.ply");
    assert_eq!((turned.closed, turned.oriented, turned.misoriented_facets), (true, false, 3));
    assert_eq!(turned.enclosed_volume, None);
    folder.write("open.ply", &ascii(&[[0, 3, 1], [0, 2, 3], [1, 3, 2]]));
    let open = folder.surface("open.ply");
    assert_eq!((open.closed, open.oriented, open.open_facets, open.euler_characteristic), (false, true, 3, 1));
    folder.write("crowded.ply", &ascii(&[[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2], [0, 1, 4]]));
    assert_eq!((folder.surface("crowded.ply").manifold, folder.surface("crowded.ply").crowded_facets), (false, 1));
    folder.write("flat.ply", &ascii(&[[0, 1, 1], [0, 3, 1]]));
    let flat = folder.surface("flat.ply");
    assert_eq!((flat.degenerate_simplices, flat.worst_quality, flat.unused_points), (1, Some(0.0), 2));

    // Two bodies, apart or one into the other.
    for (shift, crosses) in [(1.5, false), (0.1, true)] {
        let points: Vec<String> = (0..8)
            .map(|i| {
                let at = |axis: usize| f64::from(u8::from(i % 4 == axis + 1)) + if i < 4 { 0.0 } else { shift };
                format!("{} {} {}", at(0), at(1), at(2))
            })
            .collect();
        let points: Vec<&str> = points.iter().map(String::as_str).collect();
        let one = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        folder.write("two.ply", &ply(&points, &[one, one.map(|t| t.map(|i| i + 4))].concat()));
        let two = folder.surface("two.ply");
        assert_eq!((two.closed, two.crossing.is_some()), (true, crosses), "{two:?}");
        let told =
            folder.says(&["info", "two.ply"]).1.contains("passes through itself, or has bodies that overlap: the");
        assert_eq!(told, crosses);
    }

    // The same body with the points of each triangle for itself is closed all the same, but not welded.
    folder.write("loose.ply", &loose(&[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]));
    let loose = folder.surface("loose.ply");
    assert_eq!((loose.closed, loose.welded, loose.duplicate_points, loose.f_vector), (true, false, 8, vec![4, 6, 4]));
    assert!(folder.says(&["info", "loose.ply"]).1.contains("not welded: 8 points in the place of an earlier one"));
}

const POINTS: [&str; 5] = ["0 0 0", "1 0 0", "0 1 0", "0 0 1", "0 -1 -1"];

fn ply(points: &[&str], triangles: &[[usize; 3]]) -> Vec<u8> {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        points.len(),
        triangles.len()
    );
    points.iter().for_each(|p| text += &format!("{p}\n"));
    triangles.iter().for_each(|[a, b, c]| text += &format!("3 {a} {b} {c}\n"));
    text.into_bytes()
}

fn ascii(triangles: &[[usize; 3]]) -> Vec<u8> {
    ply(&POINTS, triangles)
}

fn loose(triangles: &[[usize; 3]]) -> Vec<u8> {
    let points: Vec<&str> = triangles.as_flattened().iter().map(|&i| POINTS[i]).collect();
    let own: Vec<[usize; 3]> = (0..triangles.len()).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    ply(&points, &own)
}

#[test]
fn meshes_that_ship() {
    let folder = Folder::new();
    let ship = |name: &str| meshes().join(name).display().to_string();
    let (code, text) = folder.says(&["info", &ship("nut.vtu")]);
    assert_eq!(code, 0);
    for told in
        ["a mesh of 431 points; cells: 1373 (tetrahedron)", "a solid in 3D: 1 piece", "bounded by 714 triangles"]
    {
        assert!(text.contains(told), "{told}: {text}");
    }
    // The nut has a hole, so its boundary is a torus, and it is one itself.
    assert!(text.contains("Euler characteristic 0"), "{text}");
    let (_, text) = folder.says(&["info", &ship("ant.ply")]);
    assert!(text.contains("a surface in 3D: closed, 15 pieces") && text.contains("Euler characteristic 30"), "{text}");
    let (code, text) = folder.says(&["compare", &ship("ant.ply"), &ship("nut.vtu")]);
    assert!(code == 1 && text.contains("486 and 431 points"), "{text}");
    assert_eq!(folder.says(&["compare", &ship("nut.vtu"), &ship("nut.vtu"), "--array", "points"]).0, 0);
}

#[test]
fn what_cannot_be_told_or_compared_is_refused() {
    let folder = Folder::new();
    folder.write("a.vti", &vti(&volume(2.5)));
    folder.write("a.f32", &[0; 8]);
    folder.write_object::<3>("box.vtu", json!({"box": {"min": [0, 0, 0], "max": [1, 2, 3]}}));
    folder.write("notes.txt", b"words");
    folder.write("empty.vti", b"");
    folder.write("foreign.vti", b"PK\x03\x04");
    folder.write("cut.vti", &vti(&volume(2.5))[..900]);
    folder.write("foreign.stl", b"words");
    std::fs::create_dir(folder.0.path().join("folder.vti")).unwrap();
    for (name, message) in [
        ("notes.txt", "can't tell what it holds; the name should end in .vti, .vtu,"),
        ("empty.vti", "the file is empty"),
        ("foreign.vti", "not a VTK file"),
        ("cut.vti", "cut short"),
        ("foreign.stl", "is no STL file"),
        ("missing.vti", "there is no such file"),
        ("folder.vti", "there is no such file"),
    ] {
        for arguments in [&["info", name][..], &["compare", name, "a.vti"], &["compare", "a.vti", name]] {
            let (code, text) = folder.says(arguments);
            assert_eq!(code, 2, "{arguments:?}");
            if arguments[0] == "compare" && name == "folder.vti" {
                assert_eq!(text, "error: one is a folder and the other a file; compare two of a kind\n");
                continue;
            }
            assert!(text.starts_with(&format!("error: {name}: ")) && text.contains(message), "{text}");
        }
    }
    let (code, text) = folder.says(&["compare", "a.vti", "box.vtu"]);
    assert_eq!((code, text.as_str()), (2, "error: a.vti is an image and box.vtu is a mesh; give two of a kind\n"));
    let (code, text) = folder.says(&["compare", "a.f32", "a.vti"]);
    assert_eq!(code, 2);
    assert!(text.contains("a.f32 is an occlusion file and a.vti is an image"), "{text}");
    let (_, text) = folder.says(&["info", "box.vtu"]);
    assert!(text.contains("area 22, encloses a 3-volume of 6"), "{text}");
}
