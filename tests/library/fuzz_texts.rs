//! Texts of users damaged at random (pipelines, overrides, formulas, sidecars): each is read or refused with a place, quickly,
//! and never a panic. How long it looks, and where: `support/fuzz.rs`.

use std::path::Path;
use std::time::{Duration, Instant};

use crate::fuzz::{self, Random, damage};
use ao4d::occlusion::Sidecar;
use ao4d::pipeline::{Document, Pipeline};
use ao4d::scene::{ObjectSpec, build_object};
use serde_json::json;

/// What has a meaning in YAML or in a formula.
const WORDS: [&str; 48] = [
    "[",
    "]",
    "{",
    "}",
    ": ",
    "- ",
    "? ",
    ",",
    "\n",
    "\n  ",
    "\t",
    "'",
    "\"",
    "|\n",
    ">\n",
    "#",
    "&a ",
    "*a",
    "<<: *a",
    "!!int ",
    "!!str ",
    "!x ",
    "---\n",
    "...\n",
    "%YAML 1.2\n",
    "~",
    ".nan",
    "-.inf",
    "1e999",
    "1e-999",
    "0x1F",
    "0o7",
    "007",
    "-1",
    "99999999999999999999",
    "true",
    "min(",
    "max(x,",
    "sqrt(",
    ")",
    "^",
    "-",
    "+",
    "x",
    "e",
    "\u{85}",
    "\u{feff}",
    "é",
];

/// Damages bytes, or puts words in.
fn mutate(text: &str, random: &mut Random) -> String {
    let mut bytes = if random.below(2) == 0 { damage(text.as_bytes(), random) } else { text.as_bytes().to_vec() };
    for _ in 0..random.below(4) {
        let word = WORDS[random.below(WORDS.len())].repeat(if random.below(50) == 0 { 3000 } else { 1 });
        let at = random.below(bytes.len() + 1);
        let end = if random.below(2) == 0 { at } else { (at + word.len()).min(bytes.len()) };
        bytes.splice(at..end, word.into_bytes());
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Gives damaged texts to a reader until the time is over, and prints how many it read and refused.
fn look<E: std::fmt::Display>(
    what: &str,
    texts: &[String],
    read: impl Fn(&str) -> Result<(), E> + std::panic::RefUnwindSafe,
) {
    let (time, mut random, start) = (fuzz::time(), fuzz::random(), Instant::now());
    let (mut taken, mut refused) = (0u32, 0u32);
    while start.elapsed() < time {
        for original in texts {
            let state = random.0;
            let (text, before) = (mutate(original, &mut random), Instant::now());
            match std::panic::catch_unwind(|| read(&text).map_err(|error| error.to_string())) {
                Ok(Ok(())) => taken += 1,
                Ok(Err(message)) => {
                    let length = message.len();
                    assert!((1..4000).contains(&length), "{what}: a message of {length} bytes; AO4D_FUZZ_SEED={state}");
                    refused += 1;
                }
                Err(_) => panic!("{what}: a panic by {text:?}; AO4D_FUZZ_SEED={state}"),
            }
            let took = before.elapsed();
            assert!(took < Duration::from_secs(20), "{what}: {took:?} for {text:?}; AO4D_FUZZ_SEED={state}");
        }
    }
    println!("{what}: {} texts in {} s, {taken} read, {refused} refused", taken + refused, start.elapsed().as_secs());
    assert!(taken > 0 && refused > 0, "{what}: {taken} read, {refused} refused");
}

/// The shipped pipelines.
fn pipelines() -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines");
    let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    files.sort();
    let texts = files.iter().filter(|f| f.extension().is_some_and(|e| e == "yaml"));
    let texts: Vec<String> = texts.map(|f| std::fs::read_to_string(f).unwrap()).filter(|t| t.len() < 5000).collect();
    assert!(texts.len() > 5, "{} pipelines", texts.len());
    texts
}

#[test]
fn damaged_pipelines_are_read_or_refused_with_a_place() {
    look("pipelines", &pipelines(), |text| {
        let document = Document::parse("p.yaml", text).inspect_err(|error| {
            assert!(error.to_string().starts_with("p.yaml:"), "{error}");
        })?;
        Pipeline::from_document(document, &[], None).map(drop).inspect_err(|error| {
            assert!(error.to_string().starts_with("p.yaml:"), "{error}");
        })
    });
}

#[test]
fn damaged_overrides_are_taken_or_refused() {
    let document = Document::parse("p.yaml", &pipelines()[0]).unwrap();
    let assignments = [
        "seed=3",
        "occlusion.samples=[64, {a: 1}]",
        "render.camera={eye: [0, 0, 0, 1], up: &a [0, 1, 0, 0]}",
        "stages[0].scene=",
        "render.dimensions[1]=7",
    ];
    look("overrides", &assignments.map(str::to_owned), |assignment| {
        Pipeline::from_document(document.clone(), &[assignment.to_owned()], None).map(drop)
    });
}

#[test]
fn damaged_formulas_are_read_or_refused() {
    let formulas = [
        "x^2 + y^2 + z^2 + w^2 - 0.5",
        "min(x, y, max(z, w), -0.2) - abs(mod(x, 0.3))",
        "sqrt(x^2 + y^2)^3 - 2*atan2(z, w)/pi",
        "-(x - 0.1)*(y + 2e-1) + exp(-w^2^2) - floor(3*z)",
        "sin(tau*x)*cos(e*y) + tanh(ln(abs(z) + 1)) - acos(w/4)",
    ];
    look("formulas", &formulas.map(str::to_owned), |formula| {
        let grid = json!({"min": [-1, -1, -1, -1], "max": [1, 1, 1, 1], "cells": 2});
        let object = json!({"isosurface": {"field": {"formula": formula}, "grid": grid}});
        let spec: ObjectSpec = serde_json::from_value(object).unwrap();
        build_object::<4>(&spec, Path::new("")).map(drop)
    });
}

#[test]
fn damaged_sidecars_are_read_or_refused() {
    let sidecar = "# What the values in the file of this name are.\ncount: 8\nmethod: sobol\nsamples: 64\nmean_samples: 812.5\nseed: 1\n\
        max_distance: 0.1\nerror_estimate: 0.0125\nmesh: 00ff\nprogram: ao4d 0.1.0\n";
    look("sidecars", &[sidecar.to_owned()], |text| Sidecar::from_yaml(text).map(drop));
}
