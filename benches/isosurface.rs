//! How long marching hypercubes takes, and how much memory: spheres of 64^4 and 96^4 cells from a formula.
//!
//! `cargo bench --bench isosurface`; `RAYON_NUM_THREADS=1` for one core. The peak is that of the whole process, as Linux
//! tells it, so each size runs in a process of its own.

use std::path::Path;
use std::time::Instant;

use ao4d::mesh::Surface;
use ao4d::scene::{ObjectSpec, build_object};

fn main() {
    let cells: Option<u32> = std::env::args().skip(1).find_map(|argument| argument.parse().ok());
    match cells {
        Some(cells) => measure(cells),
        None => {
            let own = std::env::current_exe().expect("this program's path");
            for cells in ["64", "96"] {
                let status = std::process::Command::new(&own).arg(cells).status().expect("itself");
                assert!(status.success());
            }
        }
    }
}

fn measure(cells: u32) {
    let text =
        format!(r#"{{"isosurface": {{"field": {{"hypersphere": {{"radius": 1}}}}, "grid": {{"cells": {cells}}}}}}}"#);
    let spec: ObjectSpec = serde_json::from_str(&text).expect("an object");
    let mut best = f64::INFINITY;
    let mut surface = Surface::default();
    let mut peak = 0;
    for _ in 0..5 {
        drop(std::mem::take(&mut surface));
        let start = Instant::now();
        surface = build_object::<4>(&spec, Path::new(".")).expect("a surface");
        best = best.min(start.elapsed().as_secs_f64());
        // The first time, before anything is used again.
        if peak == 0 {
            peak = peak_bytes();
        }
    }
    let mesh = size_of_val(&surface.vertices[..]) + size_of_val(&surface.simplices[..]);
    println!(
        "{cells}^4 cells: {:.3} s, {} tetrahedra, mesh {} MB, peak {} MB",
        best,
        surface.simplices.len(),
        mesh / 1_000_000,
        peak / 1_000_000
    );
}

/// The most memory that this process has had, in bytes; 0 where it can't be told.
fn peak_bytes() -> u64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let number = line.and_then(|line| line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok());
    number.unwrap_or(0) * 1024
}
