//! `ao4d devices`: what could compute here.

use clap::Args;
use serde::Serialize;

use super::console::Console;
use super::{Failure, Outcome};

/// What `devices` takes.
#[derive(Args, Debug)]
pub struct Devices {
    /// Print the list as JSON
    #[arg(long)]
    json: bool,
}

/// This computer's processor.
#[derive(Debug, Serialize)]
struct Processor {
    /// Its name, where the system tells it.
    name: Option<String>,
    /// Its architecture, such as `x86_64`.
    architecture: &'static str,
    /// How many threads a run uses by default.
    threads: usize,
    /// The vector instructions among those that matter here.
    features: Vec<&'static str>,
}

#[derive(Debug, Serialize)]
struct Report {
    cpu: Processor,
    /// The OpenCL devices: none, since this version computes on the processor only.
    opencl: Vec<String>,
}

impl Devices {
    pub fn execute(self, console: &Console) -> Result<Outcome, Failure> {
        let report = Report { cpu: processor(), opencl: Vec::new() };
        if self.json {
            console.json(&report)?;
            return Ok(Outcome::Done);
        }
        let Processor { name, architecture, threads, features } = report.cpu;
        let name = name.unwrap_or_else(|| "processor".into());
        let features = if features.is_empty() { String::new() } else { format!(", {}", features.join(" ")) };
        let plural = if threads == 1 { "" } else { "s" };
        console.result(&format!(
            "cpu     {name} ({architecture}), {threads} thread{plural}{features}\nopencl  not available in this version\n"
        ))?;
        Ok(Outcome::Done)
    }
}

fn processor() -> Processor {
    let name = std::fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| {
        let line = text.lines().find(|line| line.starts_with("model name"))?;
        line.split_once(':').map(|(_, name)| name.trim().to_owned())
    });
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
    Processor { name, architecture: std::env::consts::ARCH, threads, features: features() }
}

#[cfg(target_arch = "x86_64")]
fn features() -> Vec<&'static str> {
    let found = [
        ("sse4.2", is_x86_feature_detected!("sse4.2")),
        ("avx", is_x86_feature_detected!("avx")),
        ("fma", is_x86_feature_detected!("fma")),
        ("avx2", is_x86_feature_detected!("avx2")),
        ("avx512f", is_x86_feature_detected!("avx512f")),
    ];
    found.into_iter().filter_map(|(name, has)| has.then_some(name)).collect()
}

#[cfg(not(target_arch = "x86_64"))]
fn features() -> Vec<&'static str> {
    Vec::new()
}
