//! Pipelines that are put together: included files, variables, sweeps, patterns, standard input; and what is told of them.

use std::io::Write;
use std::process::Stdio;

use super::*;

const SCENE: &str = "variables: {size: 40, rays: 4}
stages:
  - scene: {objects: [{name: body, tesseract: {size: $size}, transform: [{translate: [300, 0, 0, 900]}]}]}
";
const SWEPT: &str = "name: swept
include: parts/scene.yaml
x-why: to try it
variables: {rays: 8}
sweep: {occlusion.samples: [$rays, 16], render.camera.margin: [0.1, 0.3]}
stages:
  - occlusion: {id: ao, file: ao.f32}
  - render: {camera: {fit: true}, dimensions: [6, 6, 6], shading: smooth}
  - write: {vti: a.vti}
";

fn folder() -> Folder {
    let folder = Folder::with(SWEPT);
    std::fs::create_dir(folder.path("parts")).unwrap();
    std::fs::write(folder.path("parts/scene.yaml"), SCENE).unwrap();
    folder
}

fn says(folder: &Folder, arguments: &[&str], input: &str) -> (Option<i32>, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ao4d"));
    command.current_dir(folder.path("")).args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
    let _ = child.stdin.take().unwrap().write_all(input.as_bytes()); // one that reads nothing may be gone
    let output = child.wait_with_output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn a_sweep_runs_all_combinations_and_shares_what_it_can() {
    let folder = folder();
    let (code, text, told) = says(&folder, &["run", "p.yaml", "--json", "--progress", "json", "-q"], "");
    assert_eq!(code, Some(0), "{told}");
    let json: Value = serde_json::from_str(&text).unwrap();
    let all = json["pipelines"].as_array().unwrap();
    let outs: Vec<&str> = all.iter().map(|report| report["out"].as_str().unwrap()).collect();
    let names = ["8-margin-0.1", "8-margin-0.3", "16-margin-0.1", "16-margin-0.3"];
    assert_eq!(outs, names.map(|name| format!("out/swept-samples-{name}")));
    // Every line on stderr is an event; rays are traced once for each number of samples, not for each camera.
    let events: Vec<Value> = told.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let traced = events.iter().filter(|e| e["event"] == "begin" && e["stage"] == "occlusion ao").count();
    assert_eq!(traced, 2, "{told}");
    assert!(
        events.iter().all(|e| e["event"].is_string())
            && events.iter().any(|e| e["event"] == "end" && e["seconds"].is_f64())
    );
    // What is shared is what would have been made alone.
    let alone = says(
        &folder,
        &[
            "run",
            "p.yaml",
            "--set",
            "sweep=",
            "--set",
            "ao.samples=8",
            "--set",
            "render.camera.margin=0.3",
            "--out",
            "alone",
        ],
        "",
    );
    assert_eq!(alone.0, Some(0), "{}", alone.2);
    for file in ["ao.f32", "ao.error.f32"] {
        let of = |out: &str| std::fs::read(folder.path(&format!("{out}/{file}"))).unwrap();
        assert_eq!(of("alone"), of("out/swept-samples-8-margin-0.3"), "{file}");
    }
    let same = says(&folder, &["compare", "alone/a.vti", "out/swept-samples-8-margin-0.3/a.vti"], "");
    assert_eq!(same.0, Some(0), "{}", same.1);
    // All is cached; what a file tells is one pipeline, whole.
    let (_, text, _) = says(&folder, &["run", "p.yaml", "--json"], "");
    let json: Value = serde_json::from_str(&text).unwrap();
    assert!(
        json["pipelines"].as_array().unwrap().iter().all(|r| r["files"]
            .as_array()
            .unwrap()
            .iter()
            .all(|f| f["cached"] == true))
    );
    let (_, text, _) = says(&folder, &["info", "--pipeline", "alone/a.vti"], "");
    assert!(text.contains("tesseract: {size: 40,") && text.contains("samples: 8") && !text.contains("sweep"), "{text}");
    assert!(text.contains("eye: [300") && !text.contains("fit"), "{text}");
}

#[test]
fn plans_of_one_file_and_of_many_have_one_shape() {
    let folder = folder();
    let single = ["--set", "sweep=", "--set", "occlusion.samples=4"];
    let (code, text, told) = says(&folder, &[&["check", "p.yaml", "--json"], &single[..]].concat(), "");
    assert_eq!(code, Some(0), "{told}");
    let one: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(one["pipelines"][0]["name"], one["name"]);
    assert_eq!(one["pipelines"].as_array().unwrap().len(), 1);
    let (code, text, _) = says(&folder, &["check", "p.yaml", "--json"], "");
    let many: Value = serde_json::from_str(&text).unwrap();
    assert_eq!((code, many["pipelines"].as_array().unwrap().len(), &many["name"]), (Some(0), 4, &Value::Null));
    // Where the camera is, is seen there too.
    let eye = &many["pipelines"][0]["renders"][0]["camera"]["eye"];
    assert!(eye[0] == 300.0 && eye[3].as_f64().unwrap() > 900.0, "{eye}");
}

#[test]
fn pipelines_come_from_standard_input_and_from_patterns() {
    let folder = folder();
    let text = SWEPT.replace("sweep:", "x-sweep:").replace("{id: ao,", "{id: ao, samples: 4,");
    let (code, _, told) = says(&folder, &["run", "-", "--out", "piped"], &text);
    assert_eq!(code, Some(0), "{told}");
    assert!(folder.path("piped/a.vti").is_file());
    let (code, _, told) = says(&folder, &["check", "-"], &text.replace("samples", "sampels"));
    assert_eq!(code, Some(2));
    assert!(told.starts_with("error: <stdin>:7:25: stages[1].occlusion.sampels: unknown key"), "{told}");
    for (name, of) in [("q1.yaml", "one"), ("q2.yaml", "two")] {
        std::fs::write(folder.path(name), text.replace("name: swept", &format!("name: {of}"))).unwrap();
    }
    let (code, text, told) = says(&folder, &["check", "q*.yaml"], "");
    assert_eq!(code, Some(0), "{told}");
    assert!(text.starts_with("one: ") && text.contains("\ntwo: "), "{text}");
    let (code, _, told) = says(&folder, &["check", "r*.yaml"], "");
    assert_eq!((code, told.as_str()), (Some(2), "error: r*.yaml: no file fits this pattern\n"));
}

#[test]
fn complaints_name_the_file_that_is_included() {
    let folder = folder();
    std::fs::write(folder.path("parts/scene.yaml"), SCENE.replace("tesseract:", "teseract:")).unwrap();
    let (code, _, told) = says(&folder, &["check", "p.yaml"], "");
    assert_eq!(code, Some(2));
    assert!(
        told.starts_with("error: parts/scene.yaml:3:36: stages[0].scene.objects[0].teseract: unknown key"),
        "{told}"
    );
    std::fs::write(folder.path("parts/scene.yaml"), "stages: [1\n").unwrap();
    let (_, _, told) = says(&folder, &["check", "p.yaml"], "");
    assert!(told.starts_with("error: parts/scene.yaml:") && told.contains("is not YAML"), "{told}");
    let (code, _, told) = says(&folder, &["study", "p.yaml"], "");
    assert_eq!(code, Some(2), "{told}");
}

#[test]
fn what_is_said_depends_on_the_level() {
    let folder = Folder::new();
    let told =
        |level: &str| says(&folder, &["check", "p.yaml", "--log-level", level, "--set", "image.camera.height=3"], "").2;
    assert!(told("warn").starts_with("warning: ") && told("warn").contains("has no use"));
    assert_eq!(told("error"), "");
    assert!(told("debug").contains(" s\n"));
    let (code, _, told) = says(&folder, &["check", "p.yaml", "--log-level", "loud"], "");
    assert!(code == Some(2) && told.contains("[possible values: error, warn, info, debug]"), "{told}");
}

#[test]
fn a_page_holds_what_the_pipeline_shows() {
    let pipeline =
        format!("{PIPELINE}  - animate: {{id: turn, input: image, frames: 3, turn: {{plane: xw}}, vti: turn.vti}}\n");
    let folder = Folder::with(&pipeline);
    let (code, _, told) = says(&folder, &["page", "p.yaml"], "");
    assert_eq!(code, Some(0), "{told}");
    let page = std::fs::read_to_string(folder.path("out/small/page.html")).unwrap();
    assert_eq!(page.matches("id=\"data").count(), 3, "the animation and both pictures");
    for part in ["\"name\":\"turn\"", "\"name\":\"plain\"", "\"name\":\"image\"", "xw 120\u{b0}"] {
        assert!(page.contains(part), "{part}");
    }
    // The stage does the same, and what is as it was is not made again.
    std::fs::write(folder.path("p.yaml"), pipeline + "  - page: {html: page.html}\n").unwrap();
    let (made, cached, _) = folder.runs(&[]);
    assert!(made.is_empty() && cached.contains(&"page.html".to_owned()), "{made:?}");
    let (made, ..) = folder.runs(&["--set", "page.title=Another", "--set", "page.input=[turn]"]);
    assert_eq!(made, ["page.html"]);
}
