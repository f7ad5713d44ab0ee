//! `mesh`: a scene's mesh without a camera, whole, and fit to be a scene again.

use super::{Folder, info, names, same};

/// Bodies around the eye, which no image shows whole, one of them creased.
const AROUND: &str = "name: around
stages:
  - scene:
      objects:
        - {name: ball, hypersphere: {radius: 0.5, subdivisions: 1}, transform: [{translate: [0, 0, 0, 0.8]}]}
        - {name: box, box: {min: [-2, -1, -1, -2], max: [2, 1, 1, -1], subdivisions: [2, 1, 1, 1]}, color: [1, 0, 0]}
  - occlusion: {id: ao, samples: 4, file: ao.f32}
  - render: {dimensions: [4, 4, 4]}
  - write: {vtu: seen.vtu}
  - mesh: {vtu: whole.vtu}
  - mesh: {id: bare, occlusion: none, vtu: bare.vtu}
";

/// The same from the file, with the values of the other.
const AGAIN: &str = "name: again
stages:
  - scene: {objects: [{file: whole.vtu}]}
  - occlusion: {load: ao.f32}
  - mesh: {vtu: again.vtu}
";

#[test]
fn all_simplices_are_there_and_tell_what_they_are_in_4d() {
    let folder = Folder::with(AROUND);
    let (_, _, told) = folder.runs(&[]);
    assert!(told.contains("seen.vtu: ") && told.contains("are left out") && !told.contains("whole.vtu"), "{told}");
    let (seen, whole) = (info(&folder, "out/around/seen.vtu"), info(&folder, "out/around/whole.vtu"));
    assert!(seen.contains("a surface in 4D: open"), "{seen}");
    for part in ["a surface in 4D: closed, 2 pieces", "\n  oriented\n", "\n  manifold\n", "encloses a 4-volume"] {
        assert!(whole.contains(part), "{part} is not in {whole}");
    }
    for array in ["position, 4 x", "normal, 4 x", "object, 1 x UInt16: 1 to 2", "ambient_occlusion", "occlusion_error"]
    {
        assert!(whole.contains(array), "{array} is not in {whole}");
    }
    let bare = info(&folder, "out/around/bare.vtu");
    assert!(bare.contains("closed, 2 pieces") && !bare.contains("ambient_occlusion"), "{bare}");
    // Without `file`, which wants all values, none is left out either.
    let dark = AROUND.replace(", file: ao.f32", "");
    std::fs::write(folder.path("p.yaml"), dark).unwrap();
    folder.runs(&["--out", "dark"]);
    assert!(same(&folder, "dark/whole.vtu", "out/around/whole.vtu"));
}

#[test]
fn it_is_read_back_unchanged() {
    let open = "name: open
stages:
  - scene:
      objects:
        - simplices: {vertices: [[0, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0.5], [0, 0, 1, 0.3], [1, 1, 1, -1]], cells: [[0, 1, 2, 3], [1, 2, 3, 4]]}
          orientation: eye
  - occlusion: {samples: 4, file: ao.f32}
  - render: {dimensions: [2, 2, 2]}
  - mesh: {vtu: whole.vtu}
";
    let flat = "name: flat
stages:
  - scene:
      dimension: 3
      objects:
        - {box: {min: [0, 0, 0], max: [1, 0.7, 0.3], subdivisions: 2}, transform: [{rotate: {plane: xy, degrees: 20}}]}
        - {sphere: {radius: 0.3, subdivisions: 1}, crease_angle: off, transform: [{translate: [3, 0, 0]}]}
  - occlusion: {samples: 4, file: ao.f32}
  - mesh: {vtu: whole.vtu}
";
    for (first, dimension) in [(AROUND, 4), (open, 4), (flat, 3)] {
        let folder = Folder::with(first);
        folder.runs(&["--out", "first"]);
        let again = AGAIN.replace("{objects:", &format!("{{dimension: {dimension}, objects:"));
        let place = |name: &str| format!("first/{name}");
        let again = again
            .replace("whole.vtu", &place("whole.vtu"))
            .replace("load: ao.f32", &format!("load: {}", place("ao.f32")));
        std::fs::write(folder.path("p.yaml"), again).unwrap();
        // Values are loaded into the very mesh that they are of, and no other.
        folder.runs(&["--out", "second"]);
        assert_eq!(names(&folder.path("second")), ["again.vtu"]);
        let compare = |array: &str| {
            let mut compare = std::process::Command::new(env!("CARGO_BIN_EXE_ao4d"));
            let files = [folder.path("first/whole.vtu"), folder.path("second/again.vtu")];
            let output = compare.arg("compare").args(files).args(["--array", array]).output().unwrap();
            assert_eq!(output.status.code(), Some(0), "{array}: {}", String::from_utf8_lossy(&output.stdout));
        };
        ["points", "position", "normal", "ambient_occlusion", "occlusion_error"].into_iter().for_each(compare);
    }
}
