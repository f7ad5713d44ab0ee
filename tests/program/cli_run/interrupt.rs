//! Ctrl-C.
#![cfg(unix)]

use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use super::{FILES, Folder, PIPELINE, names};

/// Waits until a run has ended; it is stopped after a while, so that no test waits for ever.
fn wait(child: &mut Child, limit: Duration) -> Option<i32> {
    let began = Instant::now();
    while began.elapsed() < limit {
        if let Some(status) = child.try_wait().unwrap() {
            return status.code();
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    None
}

/// Ctrl-C in the middle of each kind of work. A debug build looks for it as often, but works slowly in between.
#[test]
fn interrupted_runs_leave_nothing_behind() {
    let limit = Duration::from_secs(if cfg!(debug_assertions) { 60 } else { 2 });
    let sphere = "hypersphere: {radius: 0.5, subdivisions: 12}";
    let body = "tesseract: {size: 0.5}";
    for (what, shape, sets) in [
        ("occlusion", sphere, &["ao.samples=65536"][..]),
        ("picture", body, &["image.dimensions=[400, 400, 400]", "plain.dimensions=[400, 400, 400]", "ao.samples=1"]),
        ("voxel", body, &["image.shading=voxel", "image.dimensions=[400, 100, 100]", "ao.samples=8000"]),
    ] {
        let folder = Folder::with(&PIPELINE.replace(body, shape));
        let arguments: Vec<&str> = sets.iter().flat_map(|set| ["--set", set]).collect();
        let mut child = folder.command(&arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        std::thread::sleep(Duration::from_secs(1));
        assert!(child.try_wait().unwrap().is_none(), "{what}: ended too early to be interrupted");
        let signal = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        assert!(signal.success());
        let sent = Instant::now();
        assert_eq!(wait(&mut child, Duration::from_secs(120)), Some(130), "{what}");
        assert!(sent.elapsed() < limit, "{what}: {:?}", sent.elapsed());
        let output = child.wait_with_output().unwrap();
        let told = String::from_utf8(output.stderr).unwrap();
        assert_eq!((told.as_str(), output.stdout.len()), ("interrupted\n", 0), "{what}");
        let out = folder.path("out/small");
        let left = if out.exists() { names(&out) } else { Vec::new() };
        assert!(left.iter().all(|name| FILES.contains(&name.as_str())), "{what}: {left:?}");
        assert!(!left.contains(&"image.vti".to_owned()), "{what}: {left:?}");
        let there = |name: &str| left.contains(&name.to_owned());
        for other in ["ao.f32.yaml", "ao.error.f32"] {
            assert_eq!(there("ao.f32"), there(other), "{what}: {left:?}");
        }
    }
}

/// Whatever a command does, it ends within a second, be it work that doesn't listen: reading, sorting, building.
#[test]
fn no_work_is_too_deep_in_thought() {
    let folder = Folder::new();
    // A soup of triangles, which takes long to make out, and numbers that take long to go through.
    let count = 600_000u32;
    let mut random = 1u32;
    let mut stl = vec![0; 80];
    stl.extend(count.to_le_bytes());
    for _ in 0..count {
        stl.extend([0; 12]);
        for _ in 0..9 {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            stl.extend(((random >> 8) as f32).to_le_bytes());
        }
        stl.extend([0; 2]);
    }
    std::fs::write(folder.path("soup.stl"), stl).unwrap();
    std::fs::File::create(folder.path("zeros.raw")).unwrap().set_len(6_000_000_000).unwrap();
    let grid = "isosurface: {field: {formula: \"sin(40*x)*sin(40*y)*sin(40*z)\"}, grid: {min: [-1,-1,-1], max: [1,1,1], cells: 400}}";
    for (name, shape) in [("file", "file: soup.stl"), ("grid", grid)] {
        let text = format!(
            "name: {name}\nstages:\n  - scene: {{dimension: 3, objects: [{{{shape}}}]}}\n  - occlusion: {{samples: 4}}\n  \
             - render: {{dimensions: [4, 4]}}\n  - write: {{vti: a.vti}}\n"
        );
        std::fs::write(folder.path(&format!("{name}.yaml")), text).unwrap();
    }
    for arguments in [
        &["run", "file.yaml"][..],
        &["run", "grid.yaml", "file.yaml"],
        &["check", "grid.yaml"],
        &["study", "file.yaml"],
        &["info", "soup.stl"],
        &["info", "zeros.raw"],
        &["compare", "zeros.raw", "zeros.raw"],
    ] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_ao4d"));
        command.current_dir(folder.0.path()).args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        std::thread::sleep(Duration::from_millis(300));
        assert!(child.try_wait().unwrap().is_none(), "{arguments:?}: ended too early to be interrupted");
        assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
        let sent = Instant::now();
        assert_eq!(wait(&mut child, Duration::from_secs(60)), Some(130), "{arguments:?}");
        // Beside other tests the machine may be busy.
        assert!(sent.elapsed() < Duration::from_secs(3), "{arguments:?}: {:?}", sent.elapsed());
        assert_eq!(child.wait_with_output().unwrap().stderr, b"interrupted\n", "{arguments:?}");
        assert!(!folder.path("out").exists() || names(&folder.path("out")).is_empty(), "{arguments:?}");
    }
}
