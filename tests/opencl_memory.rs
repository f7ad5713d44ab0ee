//! Whether OpenCL leaves memory behind; in a process of its own, where nothing else takes any.

use std::sync::Arc;

use ao4d::accel::Tracer;
use ao4d::geometry::Vector64;
use ao4d::mesh::{Mesh, MeshBuilder, Orientation, Surface};
use ao4d::progress::Silent;
use ao4d::trace::opencl::{OpenCl, OpenClBackend};
use ao4d::trace::{RayBackend, Sampling, ShadingPoint};

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
    let tracer = Arc::new(Tracer::new(row()));
    let points: Vec<ShadingPoint<4>> = (0..80).map(ShadingPoint::Vertex).collect();
    let sampling = Sampling::random(64, 5);
    let device = OpenClBackend::new(&opencl, tracer.clone());
    let trace = |times: usize| {
        (0..times).for_each(|_| drop(device.open_fractions(&points, &sampling, &Silent).unwrap()));
    };
    let bring = |times: usize| (0..times).for_each(|_| OpenClBackend::new(&opencl, tracer.clone()).prepare().unwrap());
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
