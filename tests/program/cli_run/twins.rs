//! `twin: true`: beside a 4D scene stands what one would write by hand for 3D.

use super::{Folder, names, same};

const FOUR: &str = "name: four
seed: 1
stages:
  - scene:
      twin: true
      objects:
        - name: cube
          tesseract: {size: 0.5, subdivisions: 2}
          transform: [{rotate: {plane: xw, degrees: 20}}, {rotate: {plane: zw, degrees: 50}}, {translate: [-0.35, 0.1, 0.1, -1]}]
        - {name: octahedron, polytope: {cells: 16, subdivisions: 2}, transform: [{scale: 0.3}, {translate: [0.4, 0, 0, -1]}]}
        - {name: floor, box: {min: [-1, -0.6, -0.5, -1.5], max: [1, -0.5, 0.5, -0.5], subdivisions: [4, 1, 2, 2]}, color: [0.5, 0.6, 1]}
  - occlusion: {id: ao, samples: 16, file: ao.f32}
  - render:
      id: image
      dimensions: [9, 8, 7]
      supersample: 2
      camera: {eye: [0.1, 0.2, 0.3, 1], target: [0, 0, 0, -1], field_of_view: 50}
      lights: [{position: [1, 2, 0, 1]}, {direction: [0, -1, 0.5, -1], intensity: 0.5}]
  - write: {vti: image.vti, png: image.png}
  - wireframe: {id: edges, angle: 20, vtp: edges.vtp}
  - render: {id: plain, occlusion: none, dimensions: [5, 4, 3]}
  - write: {vti: plain.vti}
  - animate: {id: turn, input: image, frames: 2, turn: {plane: xw, to: 30}, scan: [0, -0.5], vti: turn.vti}
  - paraview: {input: [image], state: figure.py}
  - paraview: {input: turn, state: film.py}
  - paraview: {input: [image, edges], edges: {over: edges, color_by: w}, state: edges.py}
";

const THREE: &str = "name: three
seed: 1
stages:
  - scene:
      dimension: 3
      objects:
        - name: cube
          box: {min: [-0.25, -0.25, -0.25], max: [0.25, 0.25, 0.25], subdivisions: 2}
          transform: [{rotate: {plane: xz, degrees: 20}}, {translate: [-0.35, 0.1, -0.9]}]
        - {name: octahedron, polytope: {cells: 8, subdivisions: 2}, transform: [{scale: 0.3}, {translate: [0.4, 0, -1]}]}
        - {name: floor, box: {min: [-1, -0.6, -1.5], max: [1, -0.5, -0.5], subdivisions: [4, 1, 2]}, color: [0.5, 0.6, 1]}
  - occlusion: {id: ao, samples: 16, file: ao.f32}
  - render:
      id: image
      dimensions: [36, 32]
      supersample: 2
      camera: {eye: [0.1, 0.2, 1.3], target: [0, 0, -1], field_of_view: 50}
      lights: [{position: [1, 2, 1]}, {direction: [0, -1, -0.5], intensity: 0.5}]
  - write: {vti: image.vti, png: image.png}
  - wireframe: {id: edges, angle: 20, vtp: edges.vtp}
  - render: {id: plain, occlusion: none, dimensions: [20, 16]}
  - write: {vti: plain.vti}
  - animate: {id: turn, input: image, frames: 2, turn: {plane: xz, to: 30}, scan: [0, -0.5], vti: turn.vti}
";

#[test]
fn a_twin_is_what_one_would_write_by_hand() {
    let folder = Folder::with(FOUR);
    let (made, _, told) = folder.runs(&[]);
    assert_eq!(told, "");
    assert_eq!(made.iter().filter(|name| name.contains("-3d")).count(), 8, "{made:?}");
    let hand = Folder::with(THREE);
    hand.runs(&[]);
    for name in names(&hand.path("out/three")) {
        if name.ends_with(".pvd") || name.ends_with(".yaml") || name.ends_with(".png") {
            continue;
        }
        // `turn_0000.vti` is a frame of `turn-3d.vti`, and `ao.error.f32` stands beside `ao-3d.f32`.
        let twin = match name.split_once(['_', '.']) {
            Some((stem, rest)) => format!("{stem}-3d{}{rest}", &name[stem.len()..=stem.len()]),
            None => panic!("{name}"),
        };
        let (twin, by_hand) = (folder.path(&format!("out/four/{twin}")), hand.path(&format!("out/three/{name}")));
        assert!(same(&folder, twin.to_str().unwrap(), by_hand.to_str().unwrap()), "{name}");
    }
    // The figure has the twin to the left.
    let state = |name: &str| std::fs::read_to_string(folder.path(&format!("out/four/{name}"))).unwrap();
    let panel = |text: &str, file: &str, caption: &str| {
        text.find(&format!("{{'file': '{file}', 'caption': '{caption}'")).unwrap_or_else(|| panic!("{file}: {text}"))
    };
    for (name, files) in [("figure.py", ["image-3d.vti", "image.vti"]), ("film.py", ["turn-3d.pvd", "turn.pvd"])] {
        let text = state(name);
        assert!(panel(&text, files[0], "in 3D") < panel(&text, files[1], "in 4D"));
    }
    // Edges are drawn over each image and beside it.
    let text = state("edges.py");
    let found: Vec<usize> = [
        "image-3d.vti', 'caption': 'image 3d', 'edges': 'edges-3d.vtp'",
        "image.vti', 'caption': 'image', 'edges': 'edges.vtp'",
    ]
    .into_iter()
    .chain(["'edges', 'file': 'edges-3d.vtp'", "'edges', 'file': 'edges.vtp'"])
    .map(|panel| text.find(panel).unwrap_or_else(|| panic!("{panel}: {text:.3000}")))
    .collect();
    assert!(found.is_sorted(), "{found:?}");
    // A second run has nothing to do, and one without the twin leaves the 4D files as they are.
    assert_eq!(folder.runs(&[]).0, Vec::<String>::new());
    let (made, cached, _) = folder.runs(&["--set", "scene.twin=false"]);
    assert!(made.iter().all(|name| name.ends_with(".py")), "{made:?}");
    assert!(cached.contains(&"image.vti".to_owned()) && !cached.iter().any(|name| name.contains("-3d")), "{cached:?}");
}

#[test]
fn what_has_no_twin_is_refused() {
    let folder = Folder::with(FOUR);
    std::fs::write(folder.path("v.f32"), "").unwrap();
    for (set, words) in [
        (
            "scene.objects[0]={duocylinder: {subdivisions: 3}}",
            "stages[0].scene.objects[0].duocylinder: has no twin in 3D; box, tesseract,",
        ),
        (
            "scene.objects[0]={isosurface: {field: {tiger: {major: [1, 1], minor: 0.5}}, grid: {cells: 4}}}",
            "isosurface.field.tiger: has no twin in 3D; box,",
        ),
        ("scene.dimension=3", "scene.twin: a twin is a 3D scene beside a 4D one"),
        ("ao.load=v.f32", "occlusion.load: the file has the values of the 4D scene, and none of its twin"),
        ("plain.id=image-3d", "the stage's twin would be called `image-3d`, as another is"),
    ] {
        folder.fails(&["--set", set], 2, &[words]);
    }
}
