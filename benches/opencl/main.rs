//! Any-hit rays per second of an OpenCL device beside the processor, and the share that the device leaves to the host:
//!
//! ```text
//! cargo bench --bench opencl [-- PLATFORM.DEVICE ...] [--sizes 10k,100k] [--rays 256] [--points 2000] [--rounds 3]
//! ```
//!
//! Scrambled Sobol rays from some vertices of each mesh, so many a vertex; the values are held against each other. *Device* is the whole
//! way from shading points to values, with preparations, transfers and what the host settles; *kernels* the device's own
//! time. Medians of the rounds. A GPU wants more points than the default (`--points 1000000` takes all).

#[allow(dead_code)]
#[path = "../occlusion/meshes.rs"]
mod meshes;

use std::time::Instant;

use std::sync::Arc;

use ao4d::accel::Tracer;
use ao4d::geometry::Vector64;
use ao4d::mesh::{Mesh, MeshBuilder, Orientation, Surface};
use ao4d::progress::Silent;
use ao4d::trace::cpu::{CpuBackend, ScalarBackend};
use ao4d::trace::opencl::{OpenCl, OpenClBackend};
use ao4d::trace::{RayBackend, Sampling, ShadingPoint};

struct Options {
    places: Vec<(usize, usize)>,
    sizes: Vec<String>,
    rays: Vec<u32>,
    points: usize,
    rounds: usize,
}

impl Options {
    fn new(arguments: impl Iterator<Item = String>) -> Self {
        let mut arguments = arguments.filter(|a| a != "--bench");
        let list = |text: &str| text.split(',').map(str::to_owned).collect::<Vec<_>>();
        let mut found = Self { places: vec![], sizes: list("10k,100k"), rays: vec![256], points: 2000, rounds: 3 };
        while let Some(argument) = arguments.next() {
            let mut value = || arguments.next().expect("a value");
            match argument.as_str() {
                "--sizes" => found.sizes = list(&value()),
                "--rays" => found.rays = list(&value()).iter().map(|n| n.parse().expect("a number")).collect(),
                "--points" => found.points = value().parse().expect("a number"),
                "--rounds" => found.rounds = value().parse().expect("a number"),
                place => {
                    let (platform, device) = place.split_once('.').expect("PLATFORM.DEVICE");
                    found.places.push((platform.parse().expect("a number"), device.parse().expect("a number")));
                }
            }
        }
        found
    }
}

/// What it makes, and the median of how many millions of something it does in a second.
fn rate<T>(count: usize, rounds: usize, mut work: impl FnMut() -> T) -> (T, f64) {
    let mut times = Vec::new();
    loop {
        let start = Instant::now();
        let result = work();
        times.push(start.elapsed().as_secs_f64());
        if times.len() >= rounds {
            times.sort_by(f64::total_cmp);
            return (result, count as f64 / times[times.len() / 2] / 1e6);
        }
    }
}

fn measure<const D: usize>(opencl: &OpenCl, name: &str, mesh: Mesh<D>, options: &Options) {
    let tracer = Arc::new(Tracer::new(mesh));
    tracer.prepare_wide();
    let mesh = tracer.mesh();
    let step = mesh.vertices.len().div_ceil(options.points).max(1);
    let points: Vec<ShadingPoint<D>> = ShadingPoint::vertices(mesh).into_iter().step_by(step).collect();
    let stride = points.len().div_ceil(250);
    let some: Vec<ShadingPoint<D>> = points.iter().copied().step_by(stride).collect();
    for &samples in &options.rays {
        let sampling = Sampling::new(samples, 1);
        let rays = points.len() * samples as usize;
        let estimate = |backend: &dyn RayBackend<D>, points: &[ShadingPoint<D>]| {
            backend.open_fractions(points, &sampling, &Silent).unwrap_or_else(|error| panic!("{error}"))
        };
        let (scalar, scalar_rate) =
            rate(some.len() * samples as usize, 1, || estimate(&ScalarBackend::new(tracer.clone()), &some));
        let (packets, packet_rate) = rate(rays, options.rounds, || estimate(&CpuBackend::new(tracer.clone()), &points));
        let device = OpenClBackend::new(opencl, tracer.clone());
        let makes = device.makes_directions().unwrap_or_else(|error| panic!("{error}"));
        estimate(&device, &points); // Some drivers compile at the first launch.
        let (settled, busy) = (device.settled(), device.busy());
        let (found, device_rate) = rate(rays, options.rounds, || estimate(&device, &points));
        let all = (rays * options.rounds) as f64;
        let share = (device.settled() - settled) as f64 / all;
        let kernels = all / (device.busy() - busy).as_secs_f64() / 1e6;
        let same = found == packets && scalar.iter().zip(packets.iter().step_by(stride)).all(|(a, b)| a == b);
        println!(
            "| {name} | {} | {samples} | {scalar_rate:.2} | {packet_rate:.2} | {device_rate:.2} | {kernels:.2} | {:.2} | {:.2} | {:.4} % | {}{} |",
            mesh.simplices.len(),
            device_rate / scalar_rate,
            device_rate / packet_rate,
            share * 100.0,
            if same { "same bits" } else { "DIFFERENT" },
            if makes { "" } else { ", directions made here" },
        );
    }
}

fn main() {
    let options = Options::new(std::env::args().skip(1));
    let opencl = match OpenCl::open(&options.places) {
        Ok(opencl) => opencl,
        Err(error) => {
            println!("{error}");
            return;
        }
    };
    let labels: Vec<String> = opencl.devices().map(|info| info.label()).collect();
    println!("{}, rays in millions a second\n", labels.join(" and "));
    println!(
        "| mesh | simplices | rays a point | scalar | packets | device | kernels | / scalar | / packets | left to the host | values |"
    );
    println!("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | --- |");
    for size in &options.sizes {
        for name in ["bumpy3", "cubes3", "soup3"] {
            let name = format!("{name}_{size}");
            measure(&opencl, &name, mesh::<3>(&name), &options);
        }
        for name in ["bumpy4", "cubes4", "soup4"] {
            let name = format!("{name}_{size}");
            measure(&opencl, &name, mesh::<4>(&name), &options);
        }
    }
}

fn mesh<const D: usize>(name: &str) -> Mesh<D> {
    let plain = meshes::named(name).expect("a mesh of this name");
    let surface = Surface::<D> {
        vertices: plain.v.chunks(D).map(|p| Vector64::from_fn(|r, _| f64::from(p[r]))).collect(),
        simplices: plain.f.chunks(D).map(|s| std::array::from_fn(|i| s[i])).collect(),
        normals: None,
    };
    let mut builder = MeshBuilder::new();
    builder.add(name, [0.8; 3], &surface, Orientation::Input).expect("a mesh without faults");
    builder.finish()
}
