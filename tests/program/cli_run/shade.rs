//! `shade`: images that are there already get their occlusion, or are refused with the names of what they lack.

use ao4d::io::vti::{Settings, write};
use ao4d::io::vtk::read_volume;
use ao4d::volume::{Array, Grid, Volume};

use super::{Folder, PIPELINE, info, names};

/// Pictures that tell depth and normals, by both projections and in both dimensions.
const PICTURES: &str = "
  - render: {id: near, input: scene, occlusion: screen_space, dimensions: [14, 12, 10], dilate: 0, supersample: 1}
  - write: {vti: near.vti, arrays: [depth, normal, opacity, ambient_occlusion]}
  - render: {id: far, input: scene, occlusion: screen_space, dimensions: [14, 12, 10], dilate: 0, supersample: 1, camera: {projection: parallel, height: 3}}
  - write: {vti: far.vti, arrays: [depth, normal, opacity, ambient_occlusion]}
  - scene: {id: flat, dimension: 3, objects: [{box: {min: [-1, -1, -2], max: [1, 1, -1]}}, {box: {min: [-0.4, -0.4, -1], max: [0.4, 0.4, -0.5]}}]}
  - render: {id: flat-image, input: flat, occlusion: screen_space, dimensions: [60, 50], supersample: 1}
  - write: {vti: flat.vti, arrays: [depth, normal, opacity, ambient_occlusion]}
";

/// A folder with those pictures in `made`, and a pipeline that shades one.
fn folder() -> Folder {
    let folder = Folder::with(
        &(PIPELINE.replace("- scene:\n", "- scene:\n      id: scene\n") + PICTURES.trim_start_matches('\n')),
    );
    folder.runs(&["--out", "made"]);
    std::fs::write(folder.path("p.yaml"), "name: again\nstages:\n  - shade: {image: made/near.vti, vti: shaded.vti}\n")
        .unwrap();
    folder
}

fn occlusion(folder: &Folder, file: &str) -> Vec<f64> {
    read_volume(&folder.path(file)).unwrap().array("ambient_occlusion").unwrap().values.to_f64()
}

#[test]
fn an_image_that_tells_its_camera_gets_the_occlusion_that_a_render_finds() {
    let folder = folder();
    for name in ["near", "far", "flat"] {
        let (image, out) = (format!("shade.image=made/{name}.vti"), format!("out-{name}"));
        let (made, _, told) = folder.runs(&["--set", &image, "--out", &out]);
        assert_eq!((made, told.as_str()), (vec!["shaded.vti".to_owned()], ""));
        let (_, left, _) = folder.runs(&["--set", &image, "--out", &out]);
        assert_eq!(left, ["shaded.vti"]);
        let (before, after) = (format!("made/{name}.vti"), format!("{out}/shaded.vti"));
        let (a, b) = (occlusion(&folder, &before), occlusion(&folder, &after));
        assert!(a.iter().any(|&open| open < 0.9), "{name}: nothing is dark");
        // The point is known from a rounded distance, so now and then another sector counts.
        let off = a.iter().zip(&b).filter(|(a, b)| (*a - *b).abs() > 1e-3).count();
        assert!(off * 20 < a.len() && a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 0.05), "{name}: {off} differ");
        // All else stays, and is told.
        let (own, other) = (read_volume(&folder.path(&before)).unwrap(), read_volume(&folder.path(&after)).unwrap());
        assert_eq!(own.grid, other.grid);
        for array in ["depth", "normal", "opacity"] {
            assert_eq!(own.array(array).unwrap().values.len(), other.array(array).unwrap().values.len());
        }
        let text = info(&folder, &after);
        assert!(text.contains("ambient_occlusion") && text.contains("screen_space"), "{text}");
        let fields: Vec<&str> = other.field_data.iter().map(|(name, _)| name.as_str()).collect();
        assert!(fields.contains(&"settings") && !fields.contains(&"occlusion_rms_error"), "{fields:?}");
    }
    // What is cut out of it lies where it lay: with the same camera the same but for what it no longer shows.
    let whole = read_volume(&folder.path("made/flat.vti")).unwrap();
    let part = cut(&whole, 10..50);
    write_volume(&folder, "part.vti", &part);
    folder.runs(&["--set", "shade.image=part.vti", "--out", "part"]);
    let (a, b) = (
        cut(&whole, 10..50).array("ambient_occlusion").unwrap().values.to_f64(),
        occlusion(&folder, "part/shaded.vti"),
    );
    let rms = (a.iter().zip(&b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>() / a.len() as f64).sqrt();
    assert!(rms < 0.03, "{rms}");
}

#[test]
fn an_image_gets_the_light_that_a_render_finds_in_it() {
    let lit = "
  - render: {id: lit, input: scene, occlusion: screen_space, dimensions: [14, 12, 10], dilate: 0, supersample: 1, sky: {gradient: [0, 0.5, 0, 0]}, bounce: 1}
  - write: {vti: lit.vti, arrays: [depth, normal, bent_normal, irradiance, bounce, bounce_error]}
";
    let folder =
        Folder::with(&(PIPELINE.replace("- scene:\n", "- scene:\n      id: scene\n") + lit.trim_start_matches('\n')));
    folder.runs(&["--out", "made"]);
    let stage = "shade: {image: made/lit.vti, vti: shaded.vti, sky: {gradient: [0, 0.5, 0, 0]}, bounce: 1, arrays: [bent_normal, irradiance, bounce]}";
    std::fs::write(folder.path("p.yaml"), format!("name: again\nstages:\n  - {stage}\n")).unwrap();
    folder.runs(&["--out", "out"]);
    let (before, after) =
        ["made/lit.vti", "out/shaded.vti"].map(|file| read_volume(&folder.path(file)).unwrap()).into();
    assert!(after.array("ambient_occlusion").is_none());
    for name in ["bent_normal", "irradiance", "bounce"] {
        let [a, b] = [&before, &after].map(|volume| volume.array(name).unwrap().values.to_f64());
        let rms = (a.iter().zip(&b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>() / a.len() as f64).sqrt();
        let size = (a.iter().map(|a| a * a).sum::<f64>() / a.len() as f64).sqrt();
        assert!(a.len() == b.len() && rms < 0.01 && size > 0.003, "{name}: {rms} of {size}");
    }
    for (sets, message) in [
        (
            "shade.arrays=[light]",
            "of an image alone `light` is not known; take of ambient_occlusion, bent_normal, irradiance, bounce",
        ),
        ("shade.arrays=[bounce, bounce]", "`bounce` is there twice"),
        ("shade.bounce=0", "no light is followed from surface to surface; say `bounce: 1`"),
        ("shade.bounce=2", "expected 0 or 1, found 2"),
        ("shade.albedo=paint", "it lacks the array `paint` (colours)"),
        ("shade.sky.gradient=[0, 0.5, 0]", "expected 4 numbers"),
        ("shade.sky.gradient=[0, 5, 0, 0]", "expected a vector of length 1 at most"),
    ] {
        let output = folder.run(&["--set", sets, "--out", "bad"]);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && text.contains(message), "{sets}: {text}");
    }
}

/// Some columns of a picture.
fn cut(volume: &Volume, columns: std::ops::Range<usize>) -> Volume {
    let width = volume.grid.dimensions[0];
    let mut grid = volume.grid;
    grid.dimensions[0] = columns.len();
    grid.origin[0] += columns.start as f64 * grid.spacing[0];
    let arrays = volume.arrays.iter().map(|array| {
        let (n, all) = (array.components, array.values.to_f64());
        let kept = (0..all.len()).filter(|i| columns.contains(&(i / n % width))).map(|i| all[i] as f32);
        Array::new(&array.name, n, kept.collect::<Vec<f32>>())
    });
    Volume { grid, arrays: arrays.collect(), field_data: volume.field_data.clone() }
}

fn write_volume(folder: &Folder, name: &str, volume: &Volume) {
    let settings = Settings { field_data: volume.field_data.clone(), ..Settings::default() };
    let settings = Settings {
        field_data: settings.field_data.into_iter().filter(|(n, _)| n != "TimeValue").collect(),
        ..Settings::default()
    };
    let bytes = write(std::io::Cursor::new(Vec::new()), volume, &settings).unwrap().into_inner();
    std::fs::write(folder.path(name), bytes).unwrap();
}

/// An image of a wedge between two walls, with nothing in its first voxel, as another program may have written it.
fn foreign(dimension: usize) -> Volume {
    let dimensions = if dimension == 4 { [8, 8, 8] } else { [20, 20, 1] };
    let grid = Grid { dimensions, origin: [5.0, 5.0, 5.0], spacing: [1.0; 3] };
    let across = |n: usize| (2 * grid.index(n)[0] + 1) as f64 / dimensions[0] as f64 - 1.0;
    let mut depth: Vec<f64> = (0..grid.len()).map(|n| 2.0 - across(n).abs()).collect();
    depth[0] = f64::NAN;
    let normal = (0..grid.len()).flat_map(|n| {
        (0..dimension).map(move |r| if r == 0 { -across(n).signum() } else { f64::from(u8::from(r == dimension - 1)) })
    });
    let arrays = vec![Array::new("z", 1, depth), Array::new("Normals", dimension, normal.collect::<Vec<f64>>())];
    Volume { grid, arrays, field_data: Vec::new() }
}

#[test]
fn a_foreign_image_is_shaded_by_the_camera_that_the_pipeline_says() {
    let folder = Folder::with(
        "name: p\nstages:\n  - shade: {image: a.vti, depth: z, normal: Normals, vti: s.vti, camera: {projection: parallel, height: 2}}\n",
    );
    for dimension in [4, 3] {
        write_volume(&folder, "a.vti", &foreign(dimension));
        let (set, out) = (format!("shade.dimension={dimension}"), format!("out{dimension}"));
        let (made, _, told) = folder.runs(&["--set", &set, "--out", &out]);
        assert_eq!((made, told.as_str()), (vec!["s.vti".to_owned()], ""));
        let open = occlusion(&folder, &format!("{out}/s.vti"));
        let (width, darkest) = (foreign(dimension).grid.dimensions[0], open.iter().copied().fold(1.0, f64::min));
        // Half at the corner, more towards the edge; what shows nothing is open.
        assert!((0.4..0.62).contains(&darkest) && open[0] == 1.0, "{darkest}");
        assert!(open[width / 2] < open[width - 1], "{open:?}");
    }
    // Points without a normal are told; and an image that shows nothing.
    let mut without = foreign(4);
    without.arrays[1] = Array::new("Normals", 4, vec![0.0f32; 4 * 512]);
    write_volume(&folder, "a.vti", &without);
    let (_, _, told) = folder.runs(&["--out", "without"]);
    assert!(told.contains("511 of the 511 points that show something have no normal"), "{told}");
    without.arrays[0] = Array::new("z", 1, vec![0.0f32; 512]);
    write_volume(&folder, "a.vti", &without);
    let (_, _, told) = folder.runs(&["--out", "nothing"]);
    assert!(told.contains("no point of the image shows anything; `z` has no distance above 0"), "{told}");
}

#[test]
fn images_that_cannot_be_shaded_are_refused() {
    let folder = Folder::with("name: p\nstages:\n  - shade: {image: a.vti, vti: s.vti}\n");
    let with = |arrays: Vec<Array>| Volume { arrays, ..foreign(4) };
    let scalars = |name: &str, n: usize| Array::new(name, n, vec![1.0f32; n * 512]);
    let camera = "shade.camera={}";
    let all = |fields: &[(&str, &str)]| Volume {
        field_data: fields.iter().map(|(name, text)| (name.to_string(), text.to_string())).collect(),
        ..with(vec![scalars("depth", 1), scalars("normal", 4)])
    };
    for (volume, sets, words) in [
        (
            foreign(4),
            vec![],
            "it lacks the array `depth` (distances from the eye) and the array `normal` (normals) and a camera in its field data (give one by `camera`); it has z, Normals",
        ),
        (with(vec![scalars("depth", 1)]), vec![camera], "it lacks the array `normal` (normals); it has depth"),
        (with(vec![]), vec![camera], "it has no arrays"),
        (all(&[]), vec![], "it lacks a camera in its field data"),
        (all(&[("settings", "{\"camera\": 3}")]), vec![], "it lacks a camera in its field data"),
        (
            all(&[(
                "settings",
                "{\"camera\": {\"projection\": {\"perspective\": {\"field_of_view\": 200}}, \"eye\": [0,0,0,1], \"target\": [0,0,0,0], \"up\": [0,1,0,0], \"over\": [0,0,1,0]}}",
            )]),
            vec![],
            "its field data tell a camera that is none: camera.field_of_view: expected 0.001 to 179.999 degrees, found 200",
        ),
        (
            with(vec![scalars("depth", 3), scalars("normal", 4)]),
            vec![camera],
            "`depth` has 3 numbers a point, and distances have 1",
        ),
        (
            with(vec![scalars("depth", 1), scalars("normal", 2)]),
            vec![camera],
            "`normal` has 2 numbers a point, and normals have 3 or 4",
        ),
        (
            with(vec![scalars("depth", 1), scalars("normal", 3)]),
            vec![camera],
            "its normals are of a 3D scene, and the camera is 4D; say `dimension: 3`",
        ),
        (
            with(vec![scalars("depth", 1), scalars("normal", 3)]),
            vec![camera, "shade.dimension=3"],
            "image has one layer, and it has 8",
        ),
    ] {
        write_volume(&folder, "a.vti", &volume);
        let arguments: Vec<&str> = sets.iter().flat_map(|set| ["--set", set]).collect();
        folder.fails(&arguments, 2, &["p.yaml:3:20: stages[0].shade.image: can't use ", words]);
    }
    for (bytes, words) in [(&b"no image"[..], "a.vti"), (b"", "a.vti"), (b"<VTKFile type=\"PolyData\"/>", "a.vti")] {
        std::fs::write(folder.path("a.vti"), bytes).unwrap();
        folder.fails(&[], 2, &["stages[0].shade.image", words]);
    }
    std::fs::remove_file(folder.path("a.vti")).unwrap();
    folder.fails(&[], 2, &["stages[0].shade.image: there is no file a.vti"]);
    // It never takes the place of its own input.
    write_volume(&folder, "s.vti", &all(&[]));
    folder.fails(&["--set", "shade.image=s.vti", "--set", camera, "--out", "."], 2, &["would replace an input"]);
    assert_eq!(names(folder.0.path()), ["p.yaml", "s.vti"]);
}
