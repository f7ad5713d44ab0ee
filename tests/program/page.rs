//! A page in a real browser: it is drawn, nothing is complained of, and what is asked for is seen.
//!
//! The browser is Chromium without a window, whose WebGL2 is computed by the processor (SwiftShader).

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use serde_json::Value;

/// Two bodies of two colours, one of which is nearer to the eye and darkens what the other shows beside it.
const PIPELINE: &str = "name: cubes
stages:
  - scene:
      objects:
        - {name: red, color: [0.9, 0.1, 0.1], box: {min: [-0.8, -0.5, -0.5, -0.3], max: [-0.05, 0.5, 0.5, 0.3], subdivisions: 8}}
        - {name: blue, color: [0.1, 0.2, 0.9], box: {min: [0.05, -0.5, -0.5, -0.3], max: [0.8, 0.9, 0.5, 0.9]}}
  - occlusion: {samples: 16, file: ao.f32}
  - render: {id: both, camera: {fit: true, projection: parallel}, dimensions: [24, 24, 24], shading: smooth}
  - animate: {id: turn, frames: 4, turn: {plane: xw}, vti: turn.vti}
  - write: {input: both, vti: both.vti}
";

/// How long the browser has, on a machine that does other things too.
const PATIENCE: Duration = Duration::from_secs(120);

fn browser() -> Command {
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let found = |name: &&&str| Command::new(name).arg("--version").output().is_ok_and(|output| output.status.success());
    let name = names.iter().find(found).expect("a browser is needed, Chromium; tests/install installs it");
    let mut command = Command::new(name);
    command.args(["--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]);
    command.args(["--hide-scrollbars", "--window-size=900,600", "--enable-logging=stderr", "--no-first-run"]);
    command
}

/// The page in a folder of its own.
fn page(folder: &Path) -> PathBuf {
    std::fs::write(folder.join("p.yaml"), PIPELINE).unwrap();
    let output =
        Command::new(env!("CARGO_BIN_EXE_ao4d")).current_dir(folder).args(["page", "p.yaml"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    folder.join("out/cubes/page.html")
}

/// A screenshot of the page in a state: pixels of red, green and blue, and the width.
fn seen(folder: &Path, page: &Path, state: &str) -> (Vec<[u8; 3]>, usize) {
    let picture = folder.join("seen.png");
    let mut command = browser();
    command.arg(format!("--user-data-dir={}", folder.join("profile").display())).arg("--virtual-time-budget=20000");
    command.arg(format!("--screenshot={}", picture.display())).arg(format!("file://{}#{state}", page.display()));
    let output = command.output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!told.contains("CONSOLE"), "the page complains:\n{told}");
    let mut reader =
        png::Decoder::new(BufReader::new(std::fs::File::open(&picture).expect(&told))).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    let samples = info.color_type.samples();
    (bytes.chunks_exact(samples).map(|p| [p[0], p[1], p[2]]).collect(), info.width as usize)
}

/// How many pixels of the picture, left of the controls, are more of one colour than of the other two.
fn count(seen: &(Vec<[u8; 3]>, usize), main: usize) -> usize {
    let is = |p: &[u8; 3]| (0..3).all(|c| c == main || u32::from(p[main]) > u32::from(p[c]) + 60);
    let rows = seen.0.chunks_exact(seen.1).skip(60);
    // Neither the axes in the corner, nor the controls.
    rows.flat_map(|row| &row[100..600]).filter(|p| is(p)).count()
}

#[test]
fn what_ambient_occlusion_darkens_is_opened_first() {
    let folder = tempfile::tempdir().unwrap();
    let plain = "  - render: {id: plain, occlusion: none, dimensions: [4, 4, 4]}\n  - write: {vti: plain.vti}\n";
    let whole = PIPELINE.replace("  - render", &format!("{plain}  - render"));
    for (text, order) in [
        (format!("{whole}  - page: {{html: page.html}}\n"), "turn, both, plain -> page.html"),
        (format!("{whole}  - page: {{html: page.html, input: [plain, both]}}\n"), "plain, both -> page.html"),
    ] {
        std::fs::write(folder.path().join("p.yaml"), text).unwrap();
        let command =
            Command::new(env!("CARGO_BIN_EXE_ao4d")).current_dir(folder.path()).args(["check", "p.yaml"]).output();
        let told = String::from_utf8(command.unwrap().stdout).unwrap();
        assert!(told.contains(order), "{told}");
    }
}

#[test]
#[ignore = "needs Chromium: tests/install"]
fn a_browser_shows_the_page() {
    let folder = tempfile::tempdir().unwrap();
    let page = page(folder.path());
    let whole = seen(folder.path(), &page, "series=1");
    let (red, blue) = (count(&whole, 0), count(&whole, 2));
    assert!(red > 3000 && blue > 3000, "both bodies: {red} and {blue} pixels");
    // The half towards the eye, x above 0, goes, and with it the blue body.
    let cut = seen(folder.path(), &page, "series=1&cut=half&axis=0");
    assert!(count(&cut, 0) > 3000 && count(&cut, 2) < 200, "{} and {}", count(&cut, 0), count(&cut, 2));
    // A thin slice across y shows less of both.
    let slice = seen(folder.path(), &page, "series=1&cut=slice&axis=1");
    assert!((200..red).contains(&count(&slice, 0)), "{}", count(&slice, 0));
    // Without occlusion nothing is darker than the colours themselves.
    let dark = |seen: &(Vec<[u8; 3]>, usize)| {
        let rows = seen.0.chunks_exact(seen.1).skip(60);
        rows.flat_map(|row| &row[100..600]).filter(|p| p[0] > 60 && p[0] < 205 && p[1] < 60 && p[2] < 60).count()
    };
    let open = seen(folder.path(), &page, "series=1&occlusion=false");
    assert!(dark(&whole) > 20 * (dark(&open) + 1), "{} and {}", dark(&whole), dark(&open));
    // A volume is seen through.
    let volume = seen(folder.path(), &page, "series=1&volume=true&density=0.3");
    assert_ne!(volume.0, whole.0);
}

#[test]
#[ignore = "needs Chromium: tests/install"]
fn frames_follow_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let page = page(folder.path());
    let mut command = browser();
    command.arg(format!("--user-data-dir={}", folder.path().join("profile").display()));
    command.arg(format!("file://{}#measure=4", page.display()));
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let (send, lines) = mpsc::channel();
    let stderr = child.stderr.take().unwrap();
    std::thread::spawn(move || {
        BufReader::new(stderr).lines().map_while(Result::ok).try_for_each(|line| send.send(line))
    });
    let (began, mut measured) = (Instant::now(), None);
    while let (None, Some(left)) = (&measured, PATIENCE.checked_sub(began.elapsed())) {
        let Ok(line) = lines.recv_timeout(left) else { break };
        let told = line.split_once("measured ").map(|(_, rest)| rest.to_owned());
        assert!(told.is_some() || !line.contains("CONSOLE"), "the page complains: {line}");
        measured = told;
    }
    let _ = child.kill();
    let _ = child.wait();
    let told = measured.expect("the page tells how long its frames take");
    let json: Value = serde_json::from_str(&told[..=told.rfind('}').unwrap()]).unwrap();
    let [draw, frame] = ["draw", "frame"].map(|key| json[key].as_f64().unwrap());
    println!(
        "a view takes {draw:.0} ms, another frame {frame:.0} ms, of {} x {} pixels",
        json["width"], json["height"]
    );
    assert!(draw > 0.0 && frame > 0.0);
}
