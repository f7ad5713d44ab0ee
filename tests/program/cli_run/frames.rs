//! `animate`: frames that are what single renders would be, from occlusion that is computed no more often than it must be.

use std::path::Path;

use ao4d::io::series;
use ao4d::io::vtk::read_volume;
use ao4d::pipeline::Pipeline;
use ao4d::stages::animate::AnimatePlan;
use serde_json::Value;

use super::{Folder, contents, names, same};

/// Two bodies, and the picture that is animated; `{}` is for what follows.
const SCENE: &str = "name: film
seed: 1
stages:
  - scene:
      objects:
        - name: left
          tesseract: {size: 0.5, subdivisions: 2}
          transform: [{rotate: {plane: xw, degrees: 20}}, {translate: [-0.35, 0.1, 0.1, -1]}]
        - name: right
          box: {min: [0.1, -0.4, -0.3, -1.3], max: [0.5, 0.4, 0.3, -0.8]}
  - occlusion: {id: ao, samples: 16}
  - render: {id: image, dimensions: [9, 8, 7], camera: {target: [0, 0, 0, -1], field_of_view: 60}}
";

fn film(stages: &str) -> Folder {
    Folder::with(&format!("{SCENE}{stages}"))
}

/// The details of a run's stages, by their kind and id.
fn details(folder: &Folder, arguments: &[&str]) -> Vec<(String, String)> {
    let output = folder.run(&[&["--json"], arguments].concat());
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    report["stages"].as_array().unwrap().iter().map(|s| (text(&s["stage"]), text(&s["detail"]))).collect()
}

#[test]
fn a_stage_tells_its_numbers_and_its_own_time() {
    let folder = Folder::with(
        "name: p\nstages:\n  - scene: {objects: [{tesseract: {size: 1, subdivisions: 4}}]}\n  - occlusion: {samples: 64}\n  - render: \
         {dimensions: [8, 8, 8], camera: {eye: [0, 0, 0, 2]}}\n  - write: {vti: a.vti}\n",
    );
    let output = folder.run(&["--json"]);
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let [scene, occlusion, render, write] = &report["stages"].as_array().unwrap()[..] else { panic!("{report}") };
    let vertices = scene["numbers"]["vertices"].as_u64().unwrap();
    let detail = scene["detail"].as_str().unwrap().replace(',', "");
    assert_eq!(detail, format!("{vertices} vertices {} simplices", scene["numbers"]["simplices"]));
    // The render had these values computed; their time is told here all the same.
    let rays = occlusion["numbers"]["rays"].as_u64().unwrap();
    assert!(rays > 0 && rays % 64 == 0 && rays <= 64 * vertices, "of the vertices that are seen: {occlusion}");
    assert!(occlusion["numbers"]["error"].as_f64().unwrap() > 0.0);
    let seconds = |stage: &Value| stage["seconds"].as_f64().unwrap();
    let speed = occlusion["numbers"]["rays_per_second"].as_f64().unwrap();
    assert!((seconds(occlusion) * speed / rays as f64 - 1.0).abs() < 0.01, "{occlusion}");
    assert!(seconds(scene) + seconds(occlusion) + seconds(render) <= report["seconds"].as_f64().unwrap());
    assert_eq!((&render["numbers"]["voxels"], &write["numbers"]), (&512.into(), &serde_json::json!({})));
    let seen = render["numbers"]["seen"].as_u64().unwrap();
    assert!(render["detail"].as_str().unwrap().starts_with(&format!("{seen} of 512 voxels")) && seen > 0, "{render}");
    assert!(render["numbers"]["off"]["rms"].is_f64(), "{render}");
}

/// The number before the word `rays` in the detail of a stage.
fn rays(details: &[(String, String)], stage: &str) -> u64 {
    let detail = &details.iter().find(|(name, _)| name == stage).unwrap().1;
    let before = detail.split(" rays").next().unwrap();
    before.rsplit([' ']).next().unwrap().replace(',', "").parse().unwrap_or_else(|_| panic!("{stage}: {detail}"))
}

#[test]
fn frames_of_a_moving_eye_are_single_renders_and_share_their_occlusion() {
    let folder = film(
        "  - animate: {id: turn, frames: 4, turn: {plane: xw}, vti: turn.vti}
  - animate: {id: path, input: image, frames: 3, turn: {plane: yz, from: 10, to: 31}, move: {to: [0.1, 0, 0, 0]}, scan: [0, -0.2], vti: path.vti}
  - write: {input: image, vti: image.vti}
",
    );
    let told = details(&folder, &[]);
    // All vertices once, for both animations and the picture.
    let vertices = 16 * {
        let plan = Pipeline::load(&folder.path("p.yaml"), &[], None).unwrap().prepare(|_| true).unwrap();
        plan.counts()[0].vertices
    };
    assert_eq!(rays(&told, "occlusion ao"), vertices);
    assert!(
        told.iter().any(|(name, detail)| name == "animate turn" && detail.starts_with("4 of 4 frames, ")),
        "{told:?}"
    );
    assert!(same(&folder, "out/film/turn_0000.vti", "out/film/image.vti"), "the first frame is the picture itself");
    // By hand: quarter turns about the target, and whatever the plan says of the other path.
    let plan = Pipeline::load(&folder.path("p.yaml"), &[], None).unwrap().plan;
    let animations: Vec<_> = plan.all::<AnimatePlan>().map(|(_, animation)| animation).collect();
    let by_hand = ["[0, 0, 0, 1]", "[-2, 0, 0, -1]", "[0, 0, 0, -3]", "[2, 0, 0, -1]"];
    let written = |i: usize| serde_json::to_string(&animations[1].render(i, &plan).camera).unwrap();
    for (i, eye) in by_hand.iter().enumerate() {
        let set = format!("image.camera={{eye: {eye}, target: [0, 0, 0, -1], field_of_view: 60}}");
        let out = format!("turn{i}");
        folder.runs(&["--set", &set, "--out", &out]);
        assert!(same(&folder, &format!("{out}/image.vti"), &format!("out/film/turn_000{i}.vti")), "{eye}");
    }
    for i in 0..3 {
        let camera: Value = serde_json::from_str(&written(i)).unwrap();
        let (eye, target, up, over) = (&camera["eye"], &camera["target"], &camera["up"], &camera["over"]);
        let set = format!("image.camera={{eye: {eye}, target: {target}, up: {up}, over: {over}, field_of_view: 60}}");
        let out = format!("path{i}");
        folder.runs(&["--set", &set, "--out", &out]);
        assert!(same(&folder, &format!("{out}/image.vti"), &format!("out/film/path_000{i}.vti")), "{set}");
        assert!(!same(&folder, &format!("{out}/image.vti"), "out/film/image.vti"), "nothing moved: {set}");
    }
    // Our own reader, and the times of 24 frames a second.
    let steps = series::read(&folder.path("out/film/turn.pvd")).unwrap();
    let times: Vec<f64> = steps.iter().map(|step| step.time.unwrap()).collect();
    assert_eq!(times, [0.0, 1.0 / 24.0, 2.0 / 24.0, 3.0 / 24.0]);
    let files: Vec<_> = steps.iter().flat_map(|step| &step.files).cloned().collect();
    assert_eq!(files, [0, 1, 2, 3].map(|i| folder.path(&format!("out/film/turn_000{i}.vti"))));
}

#[test]
fn objects_that_move_among_others_have_occlusion_of_their_own_in_each_frame() {
    let folder = film(
        "  - animate: {id: some, moves: left, frames: 3, turn: {plane: zw, from: 0, to: 50, center: [0, 0, 0, -1]}, move: {to: [0.25, 0, 0, 0]}, vti: some.vti}
  - animate: {id: all, input: image, moves: [right, left], frames: 2, turn: {plane: xw, to: 180}, vti: all.vti}
  - write: {input: image, vti: image.vti}
",
    );
    let told = details(&folder, &[]);
    assert!(rays(&told, "animate some") > 100 && told.iter().any(|(_, detail)| detail.contains("anew in each frame")));
    let all = &told.iter().find(|(name, _)| name == "animate all").unwrap().1;
    assert!(!all.contains("anew"), "what moves as a whole takes its occlusion along: {all}");
    assert!(same(&folder, "out/film/some_0000.vti", "out/film/image.vti"));
    for (i, degrees, x) in [(1, "25", "0.125"), (2, "50", "0.25")] {
        let set = format!(
            "scene.objects[0].transform=[{{rotate: {{plane: xw, degrees: 20}}}}, {{translate: [-0.35, 0.1, 0.1, -1]}}, \
             {{rotate: {{plane: zw, degrees: {degrees}, center: [0, 0, 0, -1]}}}}, {{translate: [{x}, 0, 0, 0]}}]"
        );
        let out = format!("some{i}");
        folder.runs(&["--set", &set, "--out", &out]);
        assert!(same(&folder, &format!("{out}/image.vti"), &format!("out/film/some_000{i}.vti")), "{set}");
        assert!(!same(&folder, &format!("{out}/image.vti"), "out/film/image.vti"), "{set}");
    }
    // The scene turned by half a turn, or the eye the other way.
    let set = "image.camera={eye: [0, 0, 0, -3], target: [0, 0, 0, -1], up: [0, 1, 0, 0], field_of_view: 60}";
    folder.runs(&["--set", set, "--out", "half"]);
    assert!(same(&folder, "half/image.vti", "out/film/all_0001.vti"));
}

#[test]
fn the_sky_stands_still_while_an_eye_or_a_scene_moves_below_it() {
    let folder = film(
        "  - animate: {id: eye, frames: 3, turn: {plane: xw, to: 60}, vti: eye.vti, arrays: [light, opacity]}
  - animate: {id: scene, input: image, moves: scene, frames: 2, turn: {plane: xy, to: 90}, vti: scene.vti, arrays: [light, opacity]}
",
    );
    let text = std::fs::read_to_string(folder.path("p.yaml")).unwrap();
    let lit =
        text.replace("dimensions: [9, 8, 7],", "dimensions: [9, 8, 7], sky: {gradient: [0, 0.9, 0, 0]}, bounce: 1,");
    std::fs::write(folder.path("p.yaml"), &lit).unwrap();
    folder.runs(&[]);
    // Each frame is the picture with that frame's camera under the same sky.
    let plan = Pipeline::load(&folder.path("p.yaml"), &[], None).unwrap().plan;
    let eye = plan.all::<AnimatePlan>().map(|(_, animation)| animation).next().unwrap().render(2, &plan).camera;
    let camera = serde_json::to_value(eye).unwrap();
    let (eye, target, up, over) = (&camera["eye"], &camera["target"], &camera["up"], &camera["over"]);
    let single = "  - write: {input: image, vti: image.vti, arrays: [light, opacity]}\n";
    let before = &lit[..lit.find("  - animate").unwrap()];
    std::fs::write(folder.path("p.yaml"), format!("{before}{single}")).unwrap();
    let set = format!("image.camera={{eye: {eye}, target: {target}, up: {up}, over: {over}, field_of_view: 60}}");
    folder.runs(&["--set", &set, "--out", "moved"]);
    assert!(same(&folder, "moved/image.vti", "out/film/eye_0002.vti"));
    // A scene that turns by a right angle is lit from above all the same, as one whose objects stand so.
    let turn = "{rotate: {plane: xy, degrees: 90, center: [0, 0, 0, -1]}}";
    let turned = before
        .replace("{translate: [-0.35, 0.1, 0.1, -1]}]", &format!("{{translate: [-0.35, 0.1, 0.1, -1]}}, {turn}]"));
    let turned = turned.replace(
        "max: [0.5, 0.4, 0.3, -0.8]}",
        &format!("max: [0.5, 0.4, 0.3, -0.8]}}\n          transform: [{turn}]"),
    );
    assert_eq!(turned.matches(turn).count(), 2);
    std::fs::write(folder.path("p.yaml"), format!("{turned}{single}")).unwrap();
    folder.runs(&["--out", "turned"]);
    let light = |file: &str| read_volume(&folder.path(file)).unwrap().array("light").unwrap().values.to_f64();
    let off =
        |a: &[f64], b: &[f64]| (a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>() / a.len() as f64).sqrt();
    let (frame, by_hand) = (light("out/film/scene_0001.vti"), light("turned/image.vti"));
    let still = light("out/film/scene_0000.vti");
    assert!(off(&frame, &by_hand) < 0.02, "{}", off(&frame, &by_hand));
    assert!(off(&frame, &still) > 0.04, "{}", off(&frame, &still));
}

#[test]
fn frames_are_cached_one_by_one_and_the_same_on_any_number_of_threads() {
    let folder = film("  - animate: {id: turn, frames: 3, turn: {plane: xw, to: 40}, vti: turn.vti}\n");
    let all = ["turn.pvd", "turn_0000.vti", "turn_0001.vti", "turn_0002.vti"];
    assert_eq!(folder.runs(&[]).0, all);
    assert_eq!(folder.runs(&[]), (Vec::new(), all.map(str::to_owned).to_vec(), String::new()));
    assert_eq!(folder.runs(&["--set", "turn.rate=12"]).0, ["turn.pvd"]);
    assert_eq!(folder.runs(&["--set", "turn.turn.to=50"]).0, ["turn.pvd", "turn_0001.vti", "turn_0002.vti"]);
    // What was left is what a run from nothing makes, on one thread or on three.
    let out = folder.path("out/film");
    for threads in ["1", "3"] {
        folder.runs(&["--set", "turn.turn.to=50", "--out", threads, "--threads", threads]);
        assert!(contents(&folder.path(threads)) == contents(&out), "{threads} threads");
    }
    std::fs::remove_file(out.join("turn_0001.vti")).unwrap();
    assert_eq!(folder.runs(&["--set", "turn.turn.to=50"]).0, ["turn_0001.vti"]);
    // One frame is one picture, where the path begins.
    assert_eq!(folder.runs(&["--set", "turn.frames=1", "--out", "one"]).0, ["turn.pvd", "turn_0000.vti"]);
    assert!(same(&folder, "one/turn_0000.vti", "out/film/turn_0000.vti"));
}

#[test]
fn what_cannot_be_animated_is_refused() {
    let folder = film(
        "  - animate: {id: turn, frames: 3, turn: {plane: xw, to: 40}, vti: turn.vti}\n  - paraview: {state: f.py}\n",
    );
    for (set, words) in [
        ("turn.frames=0", "animate.frames: expected 1 to 10000 frames, found 0"),
        ("turn.frames=10001", "animate.frames: expected 1 to 10000 frames, found 10001"),
        (
            "turn.turn.plane=xv",
            "animate.turn.plane: \"xv\" is no plane of a 4D scene; its planes are xy, xz, yz, xw, yw, zw",
        ),
        (
            "turn.moves=lefd",
            "animate.moves: no object of the scene is called `lefd`, and it is neither `eye` nor `scene`, did you mean `left`?",
        ),
        ("turn.rate=0", "animate.rate: expected 0.001 to 1000 frames a second, found 0"),
        ("turn.arrays=[light]", "animate.arrays[0]: render `image` is not lit"),
        ("paraview.reader=raw", "there is no earlier `write` with `raw` to show"),
    ] {
        folder.fails(&["--set", set], 2, &[words]);
    }
    // Sequences of slices are played with others like them, not with films.
    let slices = "  - slice: {id: one, range: [-1, 0], count: 3, vtp: one.vtp}
  - slice: {id: two, range: [-1, 0], count: 4, vtp: two.vtp}
  - animate: {id: turn, frames: 3, turn: {plane: xw, to: 40}, vti: turn.vti}
  - paraview: {id: f, input: [one, two], slices: together, state: f.py, screenshot: f.png}
";
    let figures = film(slices);
    for (input, words) in [
        ("[one, two]", "they need the same `range` and `count`: `two` has others than the one before it"),
        ("[turn, one]", "`one` can't be played here: an animation has a time in seconds, and slices have their places"),
        ("[one, turn]", "`turn` can't be played here"),
    ] {
        let set = format!("f.input={input}");
        figures.fails(&["--set", &set, "--set", "f.slices=play"], 2, &[words]);
    }
    let together = figures.run(&["--set", "f.input=[turn, one, two]"]);
    assert_eq!(together.status.code(), Some(0), "{}", String::from_utf8_lossy(&together.stderr));
    let played = figures.run(&["--set", "f.input=two", "--set", "f.slices=play"]);
    assert_eq!(played.status.code(), Some(0), "{}", String::from_utf8_lossy(&played.stderr));
    let state = std::fs::read_to_string(figures.path("out/film/f.py")).unwrap();
    let panel = "{'kind': 'slices', 'file': 'two.pvd', 'files': ['two.pvd'], 'caption': ''}";
    let times = "TIMES = [-1.0, -0.6666666666666667, -0.33333333333333337, 0.0]";
    assert!(state.contains(panel) && state.contains(times) && state.contains("FRAMES = 4"), "{state:.3000}");
    let unused = figures.run(&["--set", "f.input=turn", "--set", "f.slices=play"]);
    let told = String::from_utf8_lossy(&unused.stderr).into_owned();
    assert!(told.contains("slices: has no use where no sequence of slices is shown"), "{told}");
    // Two bodies, which the file doesn't tell apart.
    let blurred = figures.run(&["--set", "f.input=turn", "--set", "turn.arrays=[rgba, opacity]"]);
    let told = String::from_utf8_lossy(&blurred.stderr).into_owned();
    assert!(told.contains("paraview: shows `turn`, whose arrays lack `object`: its bodies share one skin"), "{told}");
    // 14 bytes a voxel, as the figure wants objects told apart, in each of 10,000 frames: told before anything is computed.
    let told = format!("out/film: {} bytes are to be written, and the disk has ", 14u64 * 10_000 * 1000 * 1000 * 1000);
    folder.fails(&["--set", "turn.frames=10000", "--set", "image.dimensions=[1000, 1000, 1000]"], 3, &[&told]);
    let told = "animate turn: one layer of its picture takes ";
    folder.fails(&["--set", "turn.frames=1", "--set", "image.dimensions=[65535, 65535, 1]"], 3, &[told]);
}

/// Ctrl-C leaves frames that are whole, and no others.
#[cfg(unix)]
#[test]
fn an_interrupted_film_leaves_whole_frames() {
    let folder = film("  - animate: {id: turn, frames: 2000, turn: {plane: xw}, vti: turn.vti}\n");
    let mut child = folder.command(&[]).stdout(std::process::Stdio::null()).spawn().unwrap();
    let out = folder.path("out/film");
    let there = || if out.exists() { names(&out).iter().filter(|name| name.ends_with(".vti")).count() } else { 0 };
    let began = std::time::Instant::now();
    while there() < 3 && began.elapsed().as_secs() < 60 {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    assert!(child.try_wait().unwrap().is_none(), "ended too early to be interrupted");
    assert!(std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let left = names(&out);
    assert!(left.len() >= 3 && left.len() < 2000 && !left.contains(&"turn.pvd".to_owned()), "{left:?}");
    for name in &left {
        assert!(name.starts_with("turn_") && name.ends_with(".vti"), "{name}");
        ao4d::io::vtk::read_volume(&out.join(Path::new(name))).unwrap_or_else(|e| panic!("{name}: {e}"));
    }
}
