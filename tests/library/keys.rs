//! Keys can't be forgotten: every key that a pipeline can have changes the key of some file, or stands on a list that says
//! why not.
//!
//! The list of all keys is the JSON Schema's, so that a new one fails here until a change to it is written down below.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use ao4d::pipeline::{Document, Pipeline, schema};
use ao4d::stages::key::without;
use ao4d::stages::{Keys, Plan};
use serde_json::Value;

/// Every key of every stage is there but for `max_samples` and `target_error` beside `samples`.
const PIPELINE: &str = "name: p
seed: 1
stages:
  - scene: {id: s, dimension: 4, objects: [
      {name: one, tesseract: {size: 0.5}, color: [1, 0, 0], orientation: eye, transform: [{translate: [0, 0, 0, -1]}]}]}
  - scene: {id: other, objects: []}
  - occlusion: {id: o, input: s, method: sobol, samples: 4, max_distance: 3, file: o.f32, seed: 2}
  - occlusion: {id: o2, input: s, samples: 8}
  - occlusion: {id: loaded, input: s, load: v.f32}
  - occlusion: {id: exact, input: s, method: exact, max_cones: 1000, file: e.f32}
  - render: {id: r, input: s, occlusion: o, dimensions: [3, 4, 5], shading: smooth, visibility: ray_cast, camera: {projection: perspective, eye: [0, 0, 0, 2], target: [0, 0, 0, 0], field_of_view: 60, up: [0, 1, 0, 0], over: [0, 0, 1, 0]}}
  - render: {id: parallel, occlusion: o2, dimensions: [3, 4, 5], shading: voxel, supersample: 1, layers: 2, dilate: 1, lights: [{direction: [0, -1, 0, 0]}, {position: [0, 2, 0, 0], color: 1, intensity: 2}], ambient: 0.2, sky: {gradient: [0, 0.5, 0, 0]}, bounce: 1, specular: 0.1, shininess: 10, depth_cue: {near: 1, far: 5, color: 1}, camera: {projection: parallel, height: 2}}
  - render: {id: mended, occlusion: o2, dimensions: [3, 4, 5], shading: auto}
  - write: {id: w, input: r, vti: a.vti, raw: a.raw, vtu: a.vtu, png: a.png, arrays: [rgba, opacity], encoding: appended, compression: none}
  - write: {id: w2, input: parallel, vti: b.vti}
  - write: {id: w3, input: mended, vti: c.vti}
  - mesh: {id: m, input: s, occlusion: none, vtu: m.vtu}
  - slice: {id: c, input: s, occlusion: none, normal: [0, 0, 0, 1], at: 0.1, vtp: c.vtp}
  - slice: {id: cs, input: s, occlusion: none, range: [0, 1], count: 3, vtp: cs.vtp}
  - slice: {id: h, input: s, occlusion: none, peel: hopf, axis: [0, 0, 1], center: [0, 0, 0, -1], projection: stereographic, pole: [0, 0, 0, 1], vtp: h.vtp}
  - slice: {id: w1, input: s, occlusion: none, projection: plane, vtp: w1.vtp}
  - wireframe: {id: wire, input: r, edges: feature, angle: 20, near: 0.1, hidden: mark, vtp: wire.vtp}
  - wireframe: {id: arcs, input: s, projection: stereographic, center: [0, 0, 0, -1], pole: [0, 0, 0, 1], vtp: arcs.vtp}
  - animate: {id: an, input: r, frames: 3, moves: scene, turn: {plane: xw, from: 0, to: 90, center: [0, 0, 0, -1]}, move: {from: [0, 0, 0, 0], to: [0, 0, 0, 1]}, scan: [0, 0.1], rate: 24, vti: an.vti, arrays: [rgba, opacity], encoding: appended, compression: none}
  - render: {id: space, occlusion: screen_space, screen_space: {slices: 8, steps: 8, thickness: 1, max_distance: 2}, dimensions: [3, 4, 5], input: s}
  - write: {id: w4, input: space, vti: d.vti}
  - shade: {id: sh, image: v.vti, depth: depth, normal: normal, dimension: 4, camera: {field_of_view: 80}, screen_space: {slices: 4}, arrays: [irradiance], sky: {gradient: [0, 0.5, 0, 0]}, bounce: 1, albedo: rgba, vti: s.vti}
  - page: {id: pg, input: [w, an], html: p.html, title: One}
  - paraview: {id: f, input: w, state: a.py, screenshot: b.png, reader: vti, cut: none, size: [100, 100]}
";

/// A change to each key of the stages: the key as the schema has it, and what is set to change it. Those without a change
/// say why they need none.
const CHANGES: &[(&str, Result<&str, &str>)] = &[
    ("PipelineSpec.name", Ok("name=q")),
    ("PipelineSpec.seed", Ok("seed=3")),
    ("PipelineSpec.program", Err("tells who wrote the pipeline, and warns")),
    ("PipelineSpec.folder", Err("where inputs are; their content takes part")),
    ("PipelineSpec.variables", Err("are in their places before anything is understood")),
    ("PipelineSpec.include", Err("are in their places before anything is understood")),
    ("PipelineSpec.sweep", Err("makes pipelines, each with keys of its own")),
    ("PipelineSpec.inputs", Err("what inputs must be; what they are takes part")),
    ("PipelineSpec.stages", Err("the stages follow")),
    ("SceneSpec.id", Err("a name for other stages")),
    ("SceneSpec.dimension", Err("changes what everything else may be; see `a_scene_s_dimension_counts`")),
    ("SceneSpec.twin", Err("adds stages, whose files have keys of their own")),
    ("SceneSpec.objects", Ok("s.objects[0].tesseract.size=0.6")),
    ("OcclusionSpec.id", Err("a name for other stages")),
    ("OcclusionSpec.input", Err("`loaded_values_and_other_scenes_count`")),
    ("OcclusionSpec.method", Ok("o.method=random")),
    ("OcclusionSpec.samples", Ok("o.samples=5")),
    ("OcclusionSpec.target_error", Err("`loaded_values_and_other_scenes_count`")),
    ("OcclusionSpec.max_samples", Err("`loaded_values_and_other_scenes_count`")),
    ("OcclusionSpec.max_cones", Err("a bound on the work: within it values don't depend on it")),
    ("OcclusionSpec.max_distance", Ok("o.max_distance=4")),
    ("OcclusionSpec.file", Err("values don't depend on where they are kept")),
    ("OcclusionSpec.load", Err("`loaded_values_and_other_scenes_count`")),
    ("OcclusionSpec.seed", Ok("o.seed=3")),
    ("RenderSpec.id", Err("a name for other stages")),
    ("RenderSpec.input", Err("`loaded_values_and_other_scenes_count`")),
    ("RenderSpec.occlusion", Ok("r.occlusion=o2")),
    ("RenderSpec.screen_space", Err("its keys follow")),
    ("ScreenSpaceSpec.slices", Ok("space.screen_space.slices=9")),
    ("ScreenSpaceSpec.steps", Ok("space.screen_space.steps=9")),
    ("ScreenSpaceSpec.thickness", Ok("space.screen_space.thickness=unlimited")),
    ("ScreenSpaceSpec.max_distance", Ok("space.screen_space.max_distance=3")),
    ("RenderSpec.camera", Err("its keys follow")),
    ("RenderSpec.dimensions", Ok("r.dimensions=[3, 4, 6]")),
    ("RenderSpec.shading", Ok("r.shading=flat")),
    ("RenderSpec.denoise", Ok("parallel.denoise=false")),
    ("RenderSpec.tolerance", Ok("mended.tolerance=0.03")),
    ("RenderSpec.supersample", Ok("parallel.supersample=2")),
    ("RenderSpec.layers", Ok("parallel.layers=3")),
    ("RenderSpec.dilate", Ok("parallel.dilate=2")),
    ("RenderSpec.lights", Err("its keys follow")),
    ("LightSpec.direction", Ok("parallel.lights[0].direction=[0, -1, 0, 1]")),
    ("LightSpec.position", Ok("parallel.lights[1].position=[0, 3, 0, 0]")),
    ("LightSpec.color", Ok("parallel.lights[1].color=[1, 1, 0]")),
    ("LightSpec.intensity", Ok("parallel.lights[1].intensity=3")),
    ("RenderSpec.ambient", Ok("parallel.ambient=0.1")),
    ("RenderSpec.sky", Err("its keys follow")),
    ("SkySpec.gradient", Ok("parallel.sky.gradient=[0, 0.4, 0, 0]")),
    ("RenderSpec.bounce", Ok("parallel.bounce=0")),
    ("RenderSpec.specular", Ok("parallel.specular=0.2")),
    ("RenderSpec.shininess", Ok("parallel.shininess=11")),
    ("RenderSpec.depth_cue", Err("its keys follow")),
    ("DepthCueSpec.near", Ok("parallel.depth_cue.near=2")),
    ("DepthCueSpec.far", Ok("parallel.depth_cue.far=6")),
    ("DepthCueSpec.color", Ok("parallel.depth_cue.color=0")),
    ("RenderSpec.visibility", Err("changes the time, never the image")),
    ("CameraSpec.projection", Ok("r.camera.projection=parallel")),
    ("CameraSpec.eye", Ok("r.camera.eye=[0, 0, 0, 3]")),
    ("CameraSpec.target", Ok("r.camera.target=[0, 0, 0, 0.5]")),
    ("CameraSpec.field_of_view", Ok("r.camera.field_of_view=61")),
    ("CameraSpec.height", Ok("parallel.camera.height=3")),
    ("CameraSpec.up", Ok("r.camera.up=[1, 1, 0, 0]")),
    ("CameraSpec.over", Ok("r.camera.over=[1, 0, 1, 0]")),
    ("CameraSpec.fit", Ok("r.camera.fit=true")),
    ("CameraSpec.margin", Err("with `fit` it decides where the eye is; see `a_fitted_camera_s_margin_counts`")),
    ("PageSpec.id", Err("a name for other stages")),
    ("PageSpec.input", Ok("pg.input=[w]")),
    ("PageSpec.html", Err("a file doesn't depend on its name")),
    ("PageSpec.title", Ok("pg.title=Two")),
    ("WriteSpec.id", Err("a name for other stages")),
    ("WriteSpec.input", Ok("w.input=parallel")),
    ("WriteSpec.vti", Err("a file doesn't depend on its name")),
    ("WriteSpec.raw", Err("a file doesn't depend on its name")),
    ("WriteSpec.vtu", Err("a file doesn't depend on its name")),
    ("WriteSpec.png", Err("a file doesn't depend on its name")),
    ("WriteSpec.arrays", Ok("w.arrays=[opacity, rgba]")),
    ("WriteSpec.encoding", Ok("w.encoding=inline")),
    ("WriteSpec.compression", Ok("w.compression=zlib")),
    ("MeshSpec.id", Err("a name for other stages")),
    ("MeshSpec.input", Ok("m.input=other")),
    ("MeshSpec.occlusion", Ok("m.occlusion=o2")),
    ("MeshSpec.vtu", Err("a file doesn't depend on its name")),
    ("SliceSpec.id", Err("a name for other stages")),
    ("SliceSpec.input", Ok("c.input=other")),
    ("SliceSpec.occlusion", Ok("c.occlusion=o2")),
    ("SliceSpec.normal", Ok("c.normal=[0, 0, 1, 1]")),
    ("SliceSpec.peel", Ok("w1.peel=w")),
    ("SliceSpec.axis", Ok("h.axis=[1, 0, 1]")),
    ("SliceSpec.center", Ok("h.center=[0, 0, 0, -1.1]")),
    ("SliceSpec.projection", Ok("w1.projection=stereographic")),
    ("SliceSpec.pole", Ok("h.pole=[0, 0, 1, 1]")),
    ("SliceSpec.at", Ok("c.at=0.2")),
    ("SliceSpec.range", Ok("cs.range=[0, 2]")),
    ("SliceSpec.count", Err("changes which files there are; each file's key has its own place")),
    ("SliceSpec.vtp", Err("a file doesn't depend on its name")),
    ("WireframeSpec.id", Err("a name for other stages")),
    ("WireframeSpec.input", Ok("wire.input=parallel")),
    ("WireframeSpec.edges", Ok("wire.edges=all")),
    ("WireframeSpec.angle", Ok("wire.angle=21")),
    ("WireframeSpec.near", Ok("wire.near=0.2")),
    ("WireframeSpec.hidden", Ok("wire.hidden=leave_out")),
    ("WireframeSpec.projection", Err("another projection has other keys; the view as a whole takes part")),
    ("WireframeSpec.center", Ok("arcs.center=[0, 0, 0, -1.1]")),
    ("WireframeSpec.pole", Ok("arcs.pole=[0, 0, 1, 1]")),
    ("WireframeSpec.vtp", Err("a file doesn't depend on its name")),
    ("AnimateSpec.id", Err("a name for other stages")),
    ("AnimateSpec.input", Ok("an.input=parallel")),
    ("AnimateSpec.frames", Err("changes which files there are; each frame's key has where the path is")),
    ("AnimateSpec.moves", Ok("an.moves=eye")),
    ("AnimateSpec.turn", Err("its keys follow")),
    ("TurnSpec.plane", Ok("an.turn.plane=yw")),
    ("TurnSpec.from", Ok("an.turn.from=1")),
    ("TurnSpec.to", Ok("an.turn.to=91")),
    ("TurnSpec.center", Ok("an.turn.center=[0, 0, 0, -2]")),
    ("AnimateSpec.move", Err("its keys follow")),
    ("MoveSpec.from", Ok("an.move.from=[0, 0, 1, 0]")),
    ("MoveSpec.to", Ok("an.move.to=[0, 0, 1, 1]")),
    ("AnimateSpec.scan", Ok("an.scan=[0, 0.2]")),
    ("AnimateSpec.rate", Ok("an.rate=25")),
    ("AnimateSpec.vti", Err("a file doesn't depend on its name")),
    ("AnimateSpec.arrays", Ok("an.arrays=[opacity, rgba]")),
    ("AnimateSpec.encoding", Ok("an.encoding=inline")),
    ("AnimateSpec.compression", Ok("an.compression=zlib")),
    ("ShadeSpec.id", Err("a name for other stages")),
    ("ShadeSpec.image", Err("`loaded_values_and_other_scenes_count`")),
    ("ShadeSpec.camera", Ok("sh.camera.field_of_view=81")),
    ("ShadeSpec.dimension", Err("how many numbers the camera's vectors have")),
    ("ShadeSpec.depth", Ok("sh.depth=z")),
    ("ShadeSpec.normal", Ok("sh.normal=n")),
    ("ShadeSpec.screen_space", Ok("sh.screen_space.slices=5")),
    ("ShadeSpec.arrays", Ok("sh.arrays=[bounce]")),
    ("ShadeSpec.sky", Ok("sh.sky.gradient=[0, 0.4, 0, 0]")),
    ("ShadeSpec.bounce", Ok("sh.bounce=0")),
    ("ShadeSpec.albedo", Ok("sh.albedo=rgb")),
    ("ShadeSpec.vti", Err("a file doesn't depend on its name")),
    ("ParaviewSpec.id", Err("a state is held against the file that is there, whole")),
    ("ParaviewSpec.input", Err("a state is held against the file that is there, whole")),
    ("ParaviewSpec.edges", Err("a state is held against the file that is there, whole")),
    ("ParaviewSpec.slices", Err("a state is held against the file that is there, whole")),
    ("ParaviewSpec.state", Err("a state is held against the file that is there, whole")),
    ("ParaviewSpec.screenshot", Err("a state is held against the file that is there, whole")),
    ("ParaviewSpec.reader", Err("a state is held against the file that is there, whole")),
    ("ParaviewSpec.cut", Err("a state is held against the file that is there, whole")),
    ("ParaviewSpec.size", Err("a state is held against the file that is there, whole")),
    ("ParaviewSpec.style", Err("a state is held against the file that is there, whole")),
    ("ParaviewSpec.color_by", Err("a state is held against the file that is there, whole")),
    ("ParaviewSpec.colorbar", Err("a state is held against the file that is there, whole")),
];

/// The plan of a pipeline in a folder with a file of values.
fn plan(folder: &Path, text: &str, sets: &[&str]) -> Plan {
    for input in ["v.f32", "v.vti"].map(|name| folder.join(name)) {
        if !input.exists() {
            std::fs::write(input, "").unwrap();
        }
    }
    let document = Document::parse(folder.join("p.yaml").to_str().unwrap(), text).unwrap();
    let sets: Vec<String> = sets.iter().map(|set| set.to_string()).collect();
    Pipeline::from_document(document, &sets, None).unwrap_or_else(|e| panic!("{sets:?}: {e}")).plan
}

/// The key of each file of a pipeline.
fn keys(folder: &Path, text: &str, sets: &[&str]) -> BTreeMap<String, String> {
    let plan = plan(folder, text, sets);
    let keys = Keys::new(&plan);
    let outputs = (0..plan.stages.len()).flat_map(|stage| plan.outputs(stage, &keys));
    outputs.map(|output| (output.file.to_str().unwrap().to_owned(), output.key)).collect()
}

/// The files whose keys differ.
fn differing(a: &BTreeMap<String, String>, b: &BTreeMap<String, String>) -> BTreeSet<String> {
    assert!(a.keys().eq(b.keys()));
    a.iter().filter(|(file, key)| b[*file] != **key).map(|(file, _)| file.clone()).collect()
}

#[test]
fn every_key_counts_or_has_a_reason() {
    let schema = schema();
    let mut known: BTreeSet<String> = BTreeSet::new();
    let mut add = |name: &str, definition: &Value| {
        let properties = definition["properties"].as_object().unwrap();
        known.extend(properties.keys().map(|key| format!("{name}.{key}")));
    };
    add("PipelineSpec", &schema);
    for (name, definition) in schema["$defs"].as_object().unwrap() {
        let of_stage = [
            "SceneSpec",
            "OcclusionSpec",
            "RenderSpec",
            "CameraSpec",
            "WriteSpec",
            "ParaviewSpec",
            "LightSpec",
            "DepthCueSpec",
            "SkySpec",
            "TurnSpec",
            "MoveSpec",
            "ScreenSpaceSpec",
        ];
        // Of a new stage nothing is known here yet.
        let kinds = schema["$defs"]["StageSpec"].to_string();
        if of_stage.contains(&name.as_str()) || kinds.contains(&format!("#/$defs/{name}\"")) {
            add(name, definition);
        }
    }
    let listed: BTreeSet<String> = CHANGES.iter().map(|(key, _)| key.to_string()).collect();
    assert_eq!(known, listed, "every key needs a change, or a reason why it needs none");

    let folder = tempfile::tempdir().unwrap();
    let before = keys(folder.path(), PIPELINE, &[]);
    assert_eq!(before, keys(folder.path(), PIPELINE, &[]), "the same twice");
    for (key, change) in CHANGES {
        match change {
            Ok(set) => {
                let changed = differing(&before, &keys(folder.path(), PIPELINE, &[set]));
                assert!(!changed.is_empty(), "{key}: {set} changes no key");
            }
            Err(reason) => assert!(!reason.is_empty(), "{key}"),
        }
    }
    for set in ["r.visibility=rasterize", "exact.max_cones=2000"] {
        assert!(differing(&before, &keys(folder.path(), PIPELINE, &[set])).is_empty(), "{set}");
    }
}

#[test]
fn every_object_s_field_counts() {
    let folder = tempfile::tempdir().unwrap();
    let before = keys(folder.path(), PIPELINE, &[]);
    // But for an image that is there already.
    let all: BTreeSet<String> = before.keys().filter(|file| *file != "s.vti").cloned().collect();
    for set in [
        "s.objects[0].name=two",
        "s.objects[0].color=[1, 0, 0.5]",
        "s.objects[0].specular=0.5",
        "s.objects[0].shininess=8",
        "s.objects[0].orientation=input",
        "s.objects[0].transform=[{translate: [0, 0, 0, -1.1]}]",
        "s.objects[0].tesseract.size=0.51",
        "s.objects[0].slab={to: 0.1}",
    ] {
        assert_eq!(differing(&before, &keys(folder.path(), PIPELINE, &[set])), all, "{set}");
    }
    // The closed form and skies know opaque objects only.
    let even = PIPELINE.replace("sky: {gradient: [0, 0.5, 0, 0]}, bounce: 1, ", "");
    assert_ne!(even, PIPELINE);
    let opaque = keys(folder.path(), &even, &["exact.method=sobol"]);
    let open = keys(folder.path(), &even, &["exact.method=sobol", "s.objects[0].opacity=0.5"]);
    assert_eq!(differing(&opaque, &open), all);
    // What faces the eye depends on where the first camera is.
    let moved = differing(&before, &keys(folder.path(), PIPELINE, &["r.camera.eye=[0, 0, 0, 3]"]));
    assert_eq!(moved, all);
}

#[test]
fn a_scene_s_dimension_counts() {
    let folder = tempfile::tempdir().unwrap();
    let text = "name: p\nstages:\n  - scene: {dimension: 4, objects: []}\n  - occlusion: {file: a.f32}\n";
    let (four, three) = (keys(folder.path(), text, &[]), keys(folder.path(), text, &["scene.dimension=3"]));
    assert_eq!(differing(&four, &three).len(), 1);
}

#[test]
fn a_fitted_camera_s_margin_counts() {
    let folder = tempfile::tempdir().unwrap();
    let text = "name: p\nstages:\n  - scene: {objects: [{tesseract: {size: 1}}]}\n  - render: {camera: {fit: true}, dimensions: [3, 3, 3]}\n  - write: {raw: a.raw}\n";
    let before = keys(folder.path(), text, &[]);
    assert_eq!(before, keys(folder.path(), text, &["render.camera=fit"]));
    assert_eq!(before, keys(folder.path(), text, &["render.camera.margin=0.05"]));
    assert_eq!(differing(&before, &keys(folder.path(), text, &["render.camera.margin=0.2"])).len(), 1);
    assert_eq!(differing(&before, &keys(folder.path(), text, &["scene.objects[0].tesseract.size=2"])).len(), 1);
}

#[test]
fn loaded_values_and_other_scenes_count() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    let text = "name: p
stages:
  - scene: {id: a, objects: [{tesseract: {size: 1}}]}
  - scene: {id: b, objects: [{tesseract: {size: 2}}]}
  - occlusion: {id: o, input: a, load: v.f32, file: o.f32}
  - occlusion: {id: t, input: a, target_error: 0.1, max_samples: 100, file: t.f32}
  - render: {id: r, input: a, occlusion: none, dimensions: [2, 2, 2]}
  - write: {raw: r.raw}
  - shade: {image: v.vti, vti: s.vti}
";
    write("v.f32", b"1234");
    write("v.vti", b"an image");
    let mut before = keys(folder.path(), text, &[]);
    let mut check = |sets: &[&str], file: &str| {
        let after = keys(folder.path(), text, sets);
        assert_eq!(differing(&before, &after), BTreeSet::from([file.to_owned()]), "{sets:?}");
        if sets.is_empty() {
            before = after;
        }
    };
    check(&["o.input=b"], "o.f32");
    check(&["t.target_error=0.2"], "t.f32");
    check(&["t.max_samples=101"], "t.f32");
    check(&["r.input=b"], "r.raw");
    write("v.vti", b"another");
    check(&[], "s.vti");
    // The file, and what may stand beside it.
    for name in ["v.f32", "v.f32.yaml", "v.error.f32"] {
        write(name, b"4321");
        check(&[], "o.f32");
    }
    std::fs::rename(folder.path().join("v.f32"), folder.path().join("w.f32")).unwrap();
    write("v.f32", b"4322");
    check(&["o.load=w.f32", "o.load=v.f32"], "o.f32");
}

/// The places of all numbers, words and empty lists in a value.
fn leaves(value: &Value, at: &str, found: &mut Vec<String>) {
    match value {
        Value::Object(map) if !map.is_empty() => {
            map.iter().for_each(|(key, inner)| leaves(inner, &format!("{at}/{key}"), found));
        }
        Value::Array(items) if !items.is_empty() => {
            items.iter().enumerate().for_each(|(i, inner)| leaves(inner, &format!("{at}/{i}"), found));
        }
        _ => found.push(at.to_owned()),
    }
}

#[test]
fn every_field_of_every_plan_counts_or_has_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(folder.path(), PIPELINE, &[]);
    let (mut changed, mut reasons) = (0, BTreeMap::new());
    for stage in 0..plan.stages.len() {
        let (fields, left_out) = (plan.fields(stage), plan.left_out(stage));
        for field in left_out {
            assert!(field.reason.len() > 10, "{field:?}");
            *reasons.entry((plan.kind(stage), field.field)).or_insert(false) |= fields.pointer(field.field).is_some();
        }
        let mut places = Vec::new();
        leaves(&fields, "", &mut places);
        for place in places {
            let mut other = fields.clone();
            *other.pointer_mut(&place).unwrap() = "something else".into();
            let same = without(other, left_out) == without(fields.clone(), left_out);
            let has_reason = left_out.iter().any(|f| place == f.field || place.starts_with(&format!("{}/", f.field)));
            assert_eq!(same, has_reason, "{} {place}", plan.kind(stage));
            changed += usize::from(!same);
        }
    }
    assert!(changed > 60, "{changed}");
    let stale: Vec<_> = reasons.iter().filter(|(_, found)| !**found).map(|(field, _)| field).collect();
    assert!(stale.is_empty(), "reasons for fields that no plan has: {stale:?}");
}

#[test]
fn no_plan_hides_a_field() {
    // What is skipped when a plan is serialised takes part in no key, and needs no reason: so nothing may be.
    let mut open = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("src/stages")];
    let mut files = 0;
    while let Some(path) = open.pop() {
        if path.is_dir() {
            open.extend(std::fs::read_dir(path).unwrap().map(|e| e.unwrap().path()));
            continue;
        }
        files += 1;
        for line in std::fs::read_to_string(&path).unwrap().lines() {
            let hides = line.trim_start().starts_with("#[serde(") && line.contains("skip");
            assert!(!hides, "{}: {line}", path.display());
        }
    }
    assert!(files > 15, "{files}");
}
