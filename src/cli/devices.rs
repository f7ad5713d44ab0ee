//! `ao4d devices`: what could compute here.

use ao4d::trace::opencl;
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
    /// The OpenCL devices.
    opencl: Vec<Device>,
    /// Why there are none.
    #[serde(skip_serializing_if = "Option::is_none")]
    missing: Option<String>,
}

/// An OpenCL device.
#[derive(Debug, Serialize)]
struct Device {
    /// What `--backend` takes.
    backend: String,
    name: String,
    platform: String,
    version: String,
    driver: String,
    compute_units: u32,
    /// Bytes.
    memory: u64,
    /// Bytes that it takes in one piece.
    largest_piece: u64,
    double_precision: bool,
    usable: bool,
    /// Whether `--backend opencl` takes this one.
    preferred: bool,
}

impl Devices {
    pub fn execute(self, console: &Console) -> Result<Outcome, Failure> {
        let (opencl, missing) = match opencl::devices() {
            Ok(found) => (devices(&found), None),
            Err(error) => (Vec::new(), Some(error.to_string())),
        };
        let report = Report { cpu: processor(), opencl, missing };
        if self.json {
            console.json(&report)?;
            return Ok(Outcome::Done);
        }
        let Processor { name, architecture, threads, features } = &report.cpu;
        let name = name.as_deref().unwrap_or("processor");
        let features = if features.is_empty() { String::new() } else { format!(", {}", features.join(" ")) };
        let plural = if *threads == 1 { "" } else { "s" };
        let mut text = format!("cpu         {name} ({architecture}), {threads} thread{plural}{features}\n");
        for device in &report.opencl {
            text += &device.line();
        }
        if let Some(missing) = &report.missing {
            text += &format!("opencl      {missing}\n");
        }
        console.result(&text)?;
        Ok(Outcome::Done)
    }
}

impl Device {
    fn line(&self) -> String {
        let Device { backend, name, platform, version, driver, compute_units, .. } = self;
        let gib = |bytes: u64| bytes as f64 / f64::from(1 << 30);
        format!(
            "{backend}  {name}, {compute_units} compute units, {:.1} GiB ({:.1} GiB in one piece), {}{}{}\n            \
             {platform}, {version}, driver {driver}\n",
            gib(self.memory),
            gib(self.largest_piece),
            if self.double_precision { "double precision" } else { "no double precision" },
            if self.usable { "" } else { ", can't be used: not there now, or without a compiler" },
            if self.preferred { "; what --backend opencl takes" } else { "" },
        )
    }
}

fn devices(found: &[opencl::Info]) -> Vec<Device> {
    let preferred = opencl::preferred(found).map(|info| info.place);
    found
        .iter()
        .map(|info| Device {
            backend: format!("opencl:{}.{}", info.place.0, info.place.1),
            name: info.name.clone(),
            platform: info.platform.clone(),
            version: info.version.clone(),
            driver: info.driver.clone(),
            compute_units: info.units,
            memory: info.memory,
            largest_piece: info.largest,
            double_precision: info.double,
            usable: info.usable,
            preferred: preferred == Some(info.place),
        })
        .collect()
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
pub fn features() -> Vec<&'static str> {
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
pub fn features() -> Vec<&'static str> {
    Vec::new()
}
