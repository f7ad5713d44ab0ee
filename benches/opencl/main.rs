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

use ao4d::accel::Tracer;
use ao4d::geometry::Vector64;
use ao4d::mesh::{Incidence, Mesh, MeshBuilder, Orientation, Surface};
use ao4d::occlusion::opencl::{OpenCl, Point, Scene};
use ao4d::occlusion::{Sampler, Settings, Site, Stream, estimate_at};
use ao4d::progress::Silent;
use rayon::prelude::*;

const SAMPLES: u32 = 256;

fn rate<T>(rays: usize, work: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = work();
    (result, rays as f64 / start.elapsed().as_secs_f64() / 1e6)
}

fn measure<const D: usize>(opencl: &OpenCl, name: &str, mesh: &Mesh<D>) {
    let tracer = Tracer::new(mesh);
    tracer.prepare_wide();
    let incidence = Incidence::new(mesh);
    let settings = Settings { sampler: Sampler::Sobol, samples: SAMPLES, seed: 1, max_distance: f32::INFINITY };
    let step = mesh.vertices.len().div_ceil(2000).max(1);
    let vertices: Vec<u32> = (0..mesh.vertices.len() as u32).step_by(step).collect();
    let rays = vertices.len() * SAMPLES as usize;
    let (scalar, scalar_rate) = rate(rays / 8, || -> Vec<f32> {
        let some = vertices.par_iter().with_max_len(8).step_by(8);
        some.map(|&v| estimate_at(&tracer, &Site::at_vertex(&tracer, &incidence, v), &settings, None, v.into()).value)
            .collect()
    });
    let (stream, stream_rate) = rate(rays, || -> Vec<f32> {
        let at = |stream: &mut Stream<D>, &v: &u32| stream.at_vertex(&tracer, &incidence, &settings, v);
        vertices.par_iter().map_init(Stream::default, at).collect()
    });
    let scene = Scene::new(opencl, &tracer).unwrap_or_else(|error| panic!("{error}"));
    let points: Vec<Point<D>> = vertices.iter().map(|&v| Point::Vertex(v)).collect();
    let estimate = || scene.estimate(&points, &settings, None, &Silent).unwrap_or_else(|error| panic!("{error}"));
    estimate(); // Some drivers compile at the first launch.
    let before = scene.settled();
    let (found, device_rate) = rate(rays, estimate);
    let share = (scene.settled() - before) as f64 / rays as f64;
    let same = found.iter().zip(&stream).all(|(e, &v)| e.value == v);
    let same = same && scalar.iter().zip(stream.iter().step_by(8)).all(|(a, b)| a == b);
    println!(
        "| {name} | {} | {scalar_rate:.2} | {stream_rate:.2} | {device_rate:.2} | {:.2} | {:.2} | {:.4} % | {} |",
        mesh.simplices.len(),
        device_rate / scalar_rate,
        device_rate / stream_rate,
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
    println!("| mesh | simplices | scalar | streams | device | / scalar | / streams | left to the host | values |");
    println!("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | --- |");
    for size in ["10k", "100k"] {
        for name in ["bumpy3", "cubes3", "soup3"] {
            let name = format!("{name}_{size}");
            measure(&opencl, &name, &mesh::<3>(&name));
        }
        for name in ["bumpy4", "cubes4", "soup4"] {
            let name = format!("{name}_{size}");
            measure(&opencl, &name, &mesh::<4>(&name));
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
