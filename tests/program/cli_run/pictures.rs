//! What the files hold: the same on any number of threads, one layer in 3D, background where nothing is seen.

use super::{FILES, Folder, PIPELINE, contents, info, names, same};

/// Every kind of file, and everything that could make an order of work show.
#[test]
fn the_number_of_threads_changes_no_byte() {
    let pipeline = PIPELINE.to_owned()
        + "  - occlusion: {id: noise, method: random, samples: 7, max_distance: 0.7, file: noise.f32}
  - render: {id: voxel, dimensions: [10, 8, 6], shading: voxel}
  - write: {vti: voxel.vti, arrays: [rgba, ambient_occlusion, opacity, rgb, depth, object, normal]}
  - render: {id: flat, dimensions: [9, 8, 7], shading: flat, camera: {projection: parallel, height: 2}}
  - render: {id: space, dimensions: [9, 8, 7], occlusion: screen_space, screen_space: {slices: 6, steps: 5}, supersample: 2}
  - write: {vti: space.vti, arrays: [ambient_occlusion, occlusion_error]}
  - write: {input: flat, vti: zlib.vti, compression: zlib}
  - write: {input: flat, vti: lz4.vti, compression: lz4}
  - write: {input: flat, vti: inline.vti, encoding: inline}
  - write: {input: flat, vti: inline-zlib.vti, encoding: inline, compression: zlib, raw: flat.raw, png: flat.png, vtu: flat.vtu}
";
    let folder = Folder::with(&pipeline);
    for threads in ["1", "2", "5"] {
        folder.runs(&["--threads", threads, "--out", threads]);
    }
    folder.runs(&["--out", "all"]);
    let one = contents(&folder.path("1"));
    assert_eq!(one.len(), FILES.len() + 12);
    for other in ["2", "5", "all"] {
        let other = contents(&folder.path(other));
        assert!(one.keys().eq(other.keys()));
        one.iter().for_each(|(name, bytes)| assert!(*bytes == other[name], "{name} differs"));
    }
    // The voxel picture has what it was asked for, and something to see.
    let text = info(&folder, "1/voxel.vti");
    for array in ["rgb, 3 x Float32", "depth, 1 x Float32", "object, 1 x UInt16: 0 to 2", "normal, 4 x Float32"] {
        assert!(text.contains(array), "{array}: {text}");
    }
    for name in ["zlib", "lz4", "inline", "inline-zlib"] {
        assert!(same(&folder, "1/zlib.vti", &format!("1/{name}.vti")), "{name}");
    }
}

#[test]
fn a_3d_scene_gives_one_layer() {
    let folder = Folder::with(
        "name: flat
stages:
  - scene:
      dimension: 3
      objects:
        - box: {min: [-1, -0.5, -2], max: [1, 0.5, -1]}
        - {name: lid, box: {min: [-2, 0.6, -3], max: [2, 0.7, 0]}}
  - occlusion: {samples: 16}
  - render: {dimensions: [12, 9]}
  - write: {vti: image.vti, raw: image.raw, png: image.png, vtu: scene.vtu, arrays: [rgba, opacity, normal]}
",
    );
    folder.runs(&[]);
    assert_eq!(names(&folder.path("out/flat")), ["image.png", "image.raw", "image.vti", "scene.vtu"]);
    let text = info(&folder, "out/flat/image.vti");
    assert!(text.contains("an image of 12 x 9 x 1 points") && text.contains("normal, 3 x Float32"), "{text}");
    let text = info(&folder, "out/flat/scene.vtu");
    assert!(text.contains("a surface in 3D: closed, 2 pieces") && text.contains("ambient_occlusion"), "{text}");
    let png = std::fs::read(folder.path("out/flat/image.png")).unwrap();
    assert!(png.starts_with(b"\x89PNG"));
}

#[test]
fn scenes_that_show_nothing() {
    let folder = Folder::new();
    let (made, _, told) = folder.runs(&["--set", "scene.objects=[]", "--out", "empty"]);
    assert_eq!((made.len(), told.matches("warning: ").count()), (7, 1));
    assert!(told.contains("the scene is empty; its images show background only"), "{told}");
    let text = info(&folder, "empty/image.vti");
    assert!(text.contains("opacity, 1 x Float32: 0 to 0") && text.contains("rgba, 4 x UInt8: 255 to 255"), "{text}");
    assert!(info(&folder, "empty/scene.vtu").contains("a mesh of 0 points; cells: none"));

    let camera = "image.camera={eye: [0, 0, 0, -9], target: [0, 0, 0, -10]}";
    let (made, _, told) = folder.runs(&["--set", camera, "--out", "behind"]);
    assert_eq!((made.len(), told.matches("note: ").count()), (7, 2));
    assert!(told.contains("image shows background only: the scene lies wholly behind the camera"), "{told}");
    assert!(told.contains("scene.vtu: 49 of 49 simplices are not wholly before the eye"), "{told}");
    let aside = "image.camera={eye: [50, 0, 0, 1], target: [50, 0, 0, 0]}";
    let (_, _, told) = folder.runs(&["--set", aside, "--out", "aside"]);
    assert!(told.contains("no voxel's centre sees any of the scene"), "{told}");
}

#[test]
fn simplices_of_measure_zero_are_told() {
    // The fifth point lies where the third does.
    let vertices = "[0, 0, 3, -1.3], [0, 3, -1, -1.5]]\n            cells: [[0, 1, 2, 3], [0, 1, 2, 4], [2, 4, 3, 1]]";
    let from = "[0, 0, 3, -1.3]]\n            cells: [[0, 1, 2, 3]]";
    assert_eq!(PIPELINE.matches(from).count(), 1);
    let folder = Folder::with(&PIPELINE.replace(from, vertices));
    let (_, _, told) = folder.runs(&[]);
    assert_eq!(
        told,
        "note: scene scene: 2 of 51 simplices have measure zero and are left out (the first is number 1, of wall)\n"
    );
    // They change no picture.
    std::fs::write(folder.path("p.yaml"), PIPELINE).unwrap();
    folder.runs(&["--out", "without"]);
    assert!(same(&folder, "out/small/plain.vti", "without/plain.vti"));
}
