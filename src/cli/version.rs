//! `ao4d --version -v`: what a report of a fault needs to say of the program and of what it works with.

use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use ao4d::trace::opencl;

use super::console::Console;
use super::devices;
use super::{Failure, Outcome};

/// How long another program has to tell its version.
const PATIENCE: Duration = Duration::from_secs(20);

/// Prints the version of the program, of what it was built by and for, and of OpenCL and ParaView, if they are here.
pub fn print(console: &Console) -> Result<Outcome, Failure> {
    let commit = option_env!("AO4D_COMMIT").unwrap_or("not known to this build");
    let build = if cfg!(debug_assertions) { "debug" } else { "release" };
    let mut lines = vec![
        ("ao4d", env!("CARGO_PKG_VERSION").to_owned()),
        ("commit", commit.to_owned()),
        ("built for", format!("{} {}, {build}", std::env::consts::ARCH, std::env::consts::OS)),
        ("processor", devices::features().join(" ")),
    ];
    match opencl::devices() {
        Ok(found) if !found.is_empty() => {
            let one = |info: &opencl::Info| format!("{}, driver {} ({})", info.version, info.driver, info.platform);
            lines.extend(found.iter().map(|info| ("opencl", one(info))));
        }
        Ok(_) => lines.push(("opencl", "no device".to_owned())),
        Err(error) => lines.push(("opencl", error.to_string())),
    }
    lines.push(("paraview", paraview().unwrap_or_else(|| "no pvpython on the path".to_owned())));
    let text: String = lines.iter().map(|(what, value)| format!("{what:9}  {value}\n")).collect();
    console.result(&text)?;
    Ok(Outcome::Done)
}

/// What `pvpython --version` says.
fn paraview() -> Option<String> {
    let mut child = Command::new("pvpython")
        .arg("--version")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .ok()?;
    let began = Instant::now();
    while child.try_wait().ok()?.is_none() {
        if began.elapsed() > PATIENCE {
            let _ = child.kill();
            let _ = child.wait();
            return Some("pvpython doesn't answer".to_owned());
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    let output = child.wait_with_output().ok()?;
    let all = [output.stdout, output.stderr].concat();
    let text = String::from_utf8_lossy(&all);
    let line = text.lines().find(|line| line.to_lowercase().contains("version"))?;
    line.split_whitespace().last().map(str::to_owned)
}
