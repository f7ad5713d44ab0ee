//! Any-hit rays per second of an OpenCL device beside the processor, and the share that the device leaves to the host:
//!
//! ```text
//! cargo bench --bench opencl [-- PLATFORM.DEVICE ...]
//! ```
//!
//! 256 scrambled Sobol rays a vertex, some thousand vertices of each mesh; the values are held against each other.

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

const SAMPLES: u32 = 256;

fn rate<T>(rays: usize, work: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = work();
    (result, rays as f64 / start.elapsed().as_secs_f64() / 1e6)
}

fn measure<const D: usize>(opencl: &OpenCl, name: &str, mesh: Mesh<D>) {
    let tracer = Arc::new(Tracer::new(mesh));
    tracer.prepare_wide();
    let mesh = tracer.mesh();
    let sampling = Sampling::new(SAMPLES, 1);
    let step = mesh.vertices.len().div_ceil(2000).max(1);
    let points: Vec<ShadingPoint<D>> = ShadingPoint::vertices(mesh).into_iter().step_by(step).collect();
    let some: Vec<ShadingPoint<D>> = points.iter().copied().step_by(8).collect();
    let rays = points.len() * SAMPLES as usize;
    let estimate = |backend: &dyn RayBackend<D>, points: &[ShadingPoint<D>]| {
        backend.open_fractions(points, &sampling, &Silent).unwrap_or_else(|error| panic!("{error}"))
    };
    let (scalar, scalar_rate) = rate(rays / 8, || estimate(&ScalarBackend::new(tracer.clone()), &some));
    let (packets, packet_rate) = rate(rays, || estimate(&CpuBackend::new(tracer.clone()), &points));
    let device = OpenClBackend::new(opencl, tracer.clone());
    estimate(&device, &points); // Some drivers compile at the first launch.
    let before = device.settled();
    let (found, device_rate) = rate(rays, || estimate(&device, &points));
    let share = (device.settled() - before) as f64 / rays as f64;
    let same = found == packets && scalar.iter().zip(packets.iter().step_by(8)).all(|(a, b)| a == b);
    println!(
        "| {name} | {} | {scalar_rate:.2} | {packet_rate:.2} | {device_rate:.2} | {:.2} | {:.2} | {:.4} % | {} |",
        mesh.simplices.len(),
        device_rate / scalar_rate,
        device_rate / packet_rate,
        share * 100.0,
        if same { "same bits" } else { "DIFFERENT" }
    );
}

fn main() {
    let place = |a: String| a.split_once('.').and_then(|(p, d)| Some((p.parse().ok()?, d.parse().ok()?)));
    let places: Vec<(usize, usize)> = std::env::args().skip(1).filter_map(place).collect();
    let opencl = match OpenCl::open(&places) {
        Ok(opencl) => opencl,
        Err(error) => {
            println!("{error}");
            return;
        }
    };
    let labels: Vec<String> = opencl.devices().map(|info| info.label()).collect();
    println!("{}, rays in millions a second\n", labels.join(" and "));
    println!("| mesh | simplices | scalar | packets | device | / scalar | / packets | left to the host | values |");
    println!("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | --- |");
    for size in ["10k", "100k"] {
        for name in ["bumpy3", "cubes3", "soup3"] {
            let name = format!("{name}_{size}");
            measure(&opencl, &name, mesh::<3>(&name));
        }
        for name in ["bumpy4", "cubes4", "soup4"] {
            let name = format!("{name}_{size}");
            measure(&opencl, &name, mesh::<4>(&name));
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
