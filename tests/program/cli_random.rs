//! Broken text must be refused, never crash: valid pipelines are cut, mutated and shuffled at random, with a fixed seed.

use std::process::Command;

use ao4d::pipeline::{Document, Pipeline};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

const PIPELINE: &str = "name: two-tetrahedra
seed: 1
stages:
  - scene:
      id: scene
      objects:
        - name: blue
          simplices:
            vertices: [[-0.4, -0.3, 0.1, -0.5], [1, 0, 0, 0], [0, 1, 0, 0], &last [0, 0, 1e-3, 0x1F]]
            cells: [[0, 1, 2, 3]]
        - simplices: {vertices: [*last], cells: []}
  - occlusion: {id: ao, method: sobol, samples: 256, file: ao.f32, max_distance: 2.5}
  - render:
      id: \"with-ao\"
      camera: {projection: perspective, eye: [0, 0, 0, 1], target: [0, 0, 0, 0], field_of_view: 90}
      dimensions: [50, 50, 50]
      shading: smooth
  - render: {id: without, occlusion: none, dimensions: [50, 50, 50], camera: {projection: parallel, height: 2}}
  - write: {input: with-ao, vti: with-ao.vti, raw: with-ao.raw, vtu: scene.vtu, arrays: [rgba, opacity, depth]}
  - write: {input: without, vti: without.vti, png: 'without.png', encoding: inline, compression: zlib}
  - paraview: {input: [with-ao, without], state: figure.py, screenshot: figure.png, cut: {plane: x, at: 0.0}}
";

/// Pieces of text that mean something to YAML or to a pipeline.
const PIECES: &[&str] = &[
    "- ",
    ": ",
    "{",
    "}",
    "[",
    "]",
    "&a ",
    "*a",
    "*last",
    "!!int ",
    "!x ",
    "'",
    "\"",
    "|",
    ">",
    "#",
    "\t",
    "\n",
    "\n\n",
    "---\n",
    "...\n",
    "%YAML 1.2\n",
    "? ",
    "~",
    ".nan",
    "-.inf",
    "1e999",
    "-1",
    "0",
    "99999999999999999999999999999999999999999999",
    "\u{0}",
    "\u{feff}",
    "ä",
    "\\x",
    "null",
    "none",
    "ao",
    "scene",
    "render",
    "id",
    "input",
    "dimension: 3",
    "..",
    "/",
    "\r",
    "  ",
    "        ",
    ",",
];

fn mutate(random: &mut ChaCha8Rng) -> String {
    let mut text: Vec<char> = PIPELINE.chars().collect();
    for _ in 0..random.random_range(1..=4) {
        let at = random.random_range(0..=text.len());
        let to = (at + random.random_range(0..24)).min(text.len());
        match random.random_range(0..6) {
            0 => text.truncate(at),
            1 => drop(text.drain(at..to)),
            2 => {
                let piece = PIECES[random.random_range(0..PIECES.len())];
                text.splice(at..at, piece.chars());
            }
            3 => {
                let piece = PIECES[random.random_range(0..PIECES.len())];
                text.splice(at..to, piece.chars());
            }
            4 => {
                let copy: Vec<char> = text[at..to].to_vec();
                let elsewhere = random.random_range(0..=text.len());
                text.splice(elsewhere..elsewhere, copy);
            }
            _ => {
                let lines: String = text.iter().collect();
                let mut lines: Vec<&str> = lines.split_inclusive('\n').collect();
                if lines.len() > 1 {
                    let (a, b) = (random.random_range(0..lines.len()), random.random_range(0..lines.len()));
                    lines.swap(a, b);
                }
                text = lines.concat().chars().collect();
            }
        }
        if text.is_empty() {
            break;
        }
    }
    text.into_iter().collect()
}

/// The library's way through, as `check` goes it.
fn load(text: &str, sets: &[String]) -> Result<(), String> {
    let pipeline = Document::parse("p.yaml", text).and_then(|d| Pipeline::from_document(d, sets, None));
    pipeline.map(|p| drop((p.plan.describe(&[]).to_string(), p.warnings().count()))).map_err(|e| e.to_string())
}

#[test]
fn cut_anywhere() {
    assert_eq!(load(PIPELINE, &[]), Ok(()));
    for (end, _) in PIPELINE.char_indices() {
        if let Err(message) = load(&PIPELINE[..end], &[]) {
            assert!(message.starts_with("p.yaml:"), "no place: {message}");
        }
    }
}

#[test]
fn mutated() {
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let (mut accepted, mut refused) = (0, 0);
    for _ in 0..8_000 {
        let text = mutate(&mut random);
        match load(&text, &[]) {
            Ok(()) => accepted += 1,
            Err(message) => {
                assert!(message.starts_with("p.yaml:"), "no place: {message}\n{text}");
                refused += 1;
            }
        }
    }
    // Both kinds must occur, or the test tests nothing.
    assert!(accepted > 100 && refused > 2_000, "{accepted} accepted, {refused} refused");
}

#[test]
fn overrides_mutated() {
    let valid = [
        "seed=3",
        "occlusion.samples=64",
        "with-ao.camera.eye[0]=2",
        "render.dimensions=[20, 20, 20]",
        "scene.objects[0].name=x",
    ];
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut refused = 0;
    for _ in 0..2_000 {
        let mut set: Vec<char> = valid[random.random_range(0..valid.len())].chars().collect();
        for _ in 0..random.random_range(0..3) {
            let at = random.random_range(0..=set.len());
            let to = (at + random.random_range(0..4)).min(set.len());
            let piece = [".", "[", "]", "=", "a", "9", "{", "-", ""].into_iter().chain(PIECES.iter().copied());
            let pieces: Vec<&str> = piece.collect();
            set.splice(at..to, pieces[random.random_range(0..pieces.len())].chars());
        }
        refused += usize::from(load(PIPELINE, &[set.into_iter().collect()]).is_err());
    }
    assert!((200..1_950).contains(&refused), "{refused} refused");
}

#[test]
fn the_program_exits_with_0_or_2() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("p.yaml");
    let mut random = ChaCha8Rng::seed_from_u64(6);
    for round in 0..100 {
        let mut bytes = mutate(&mut random).into_bytes();
        if round % 4 == 0 && !bytes.is_empty() {
            let at = random.random_range(0..bytes.len());
            bytes[at] = random.random();
        }
        std::fs::write(&file, &bytes).unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_ao4d")).arg("check").arg(&file).output().unwrap();
        assert!(matches!(output.status.code(), Some(0 | 2)), "{:?} for {:?}", output, String::from_utf8_lossy(&bytes));
    }
}
