//! Whether OpenCL leaves memory behind; in a process of its own, where nothing else takes any.

use ao4d::accel::Tracer;
use ao4d::geometry::Vector64;
use ao4d::mesh::{Mesh, MeshBuilder, Orientation, Surface};
use ao4d::occlusion::opencl::{OpenCl, Point, Scene};
use ao4d::occlusion::{Sampler, Settings};
use ao4d::progress::Silent;

/// Bytes of memory that this process has.
fn resident() -> u64 {
    let text = std::fs::read_to_string("/proc/self/statm").unwrap();
    text.split(' ').nth(1).unwrap().parse::<u64>().unwrap() * 4096
}

/// Simplices along a line.
fn row() -> Mesh<4> {
    let vertices = (0..80u32).map(|i| Vector64::from_fn(|k, _| f64::from(i / 4) + f64::from(i * 7 % (5 + k as u32))));
    let simplices = (0..20u32).map(|s| std::array::from_fn(|i| 4 * s + i as u32)).collect();
    let mut builder = MeshBuilder::new();
    let surface = Surface { vertices: vertices.collect(), simplices, normals: None };
    builder.add("row", [1.0; 3], &surface, Orientation::Input).unwrap();
    builder.finish()
}

#[test]
#[ignore = "needs an OpenCL device: run tests/all"]
fn many_runs_leave_nothing_behind() {
    let opencl = OpenCl::open(&[]).unwrap();
    let mesh = row();
    let tracer = Tracer::new(&mesh);
    let points: Vec<Point<4>> = (0..80).map(Point::Vertex).collect();
    let settings = Settings { sampler: Sampler::Random, samples: 64, seed: 5, max_distance: f32::INFINITY };
    let scene = Scene::new(&opencl, &tracer).unwrap();
    let trace = |times: usize| {
        (0..times).for_each(|_| drop(scene.estimate(&points, &settings, None, &Silent).unwrap()));
    };
    let bring = |times: usize| (0..times).for_each(|_| drop(Scene::new(&opencl, &tracer).unwrap()));
    for (what, run, times, most) in
        [("rays", &trace as &dyn Fn(usize), 1000, 8 << 20), ("scenes", &bring, 50, 24 << 20)]
    {
        // What grows at the beginning and stays is no leak.
        run(times / 2);
        let before = resident();
        run(times);
        let grown = resident().saturating_sub(before);
        println!("{what}: {grown} bytes more after {times} times");
        assert!(grown < most, "{what}: {grown} bytes more after {times} times");
    }
}
