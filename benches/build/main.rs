//! Building hierarchies: time and memory, on one thread and on two.
//!
//! ```text
//! cargo bench --bench build -- [--sizes 1m] [--threads 1,2] [--shapes bumpy3,soup3,bumpy4,soup4]
//! ```
//!
//! `tree` is the binary hierarchy, `wide` what it is laid out as for SIMD besides. `nodes` and `leaves` are the bytes of
//! the wide one over those of the mesh (points and simplices); its leaves hold copies of the corners.

#[path = "../occlusion/meshes.rs"]
#[allow(dead_code)]
mod meshes;

use std::sync::Arc;
use std::time::Instant;

use ao4d::accel::{Node, Tracer};
use ao4d::geometry::{Vector, Vector64};
use ao4d::mesh::{MeshBuilder, Orientation, Surface};
use rustix::time::{ClockId, clock_gettime};

fn cpu_seconds() -> f64 {
    let t = clock_gettime(ClockId::ProcessCPUTime);
    t.tv_sec as f64 + 1e-9 * t.tv_nsec as f64
}

fn list(name: &str, default: &str) -> Vec<String> {
    let given: Vec<String> = std::env::args().collect();
    let value = given.iter().position(|a| a == name).and_then(|i| given.get(i + 1));
    value.map_or(default, String::as_str).split(',').map(str::to_owned).collect()
}

fn row<const D: usize>(name: &str) {
    let Some(plain) = meshes::named(name) else { return println!("{name}: no such mesh") };
    let surface = Surface::<D> {
        vertices: plain.v.chunks(D).map(|p| Vector64::from_fn(|r, _| f64::from(p[r]))).collect(),
        simplices: plain.f.chunks(D).map(|s| std::array::from_fn(|i| s[i])).collect(),
        normals: None,
    };
    let mut builder = MeshBuilder::new();
    builder.add(name, [0.8; 3], &surface, Orientation::Input).expect("a mesh");
    let mesh = Arc::new(builder.finish());
    let bytes = mesh.vertices.len() * size_of::<Vector<D>>() + mesh.simplices.len() * size_of::<[u32; D]>();
    for threads in list("--threads", "1,2") {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.parse().expect("a number")).build();
        pool.expect("threads").install(|| {
            let mut best = [f64::INFINITY; 4];
            let mut memory = [0; 3];
            for _ in 0..5 {
                let tracer = Tracer::new(Arc::clone(&mesh));
                let (start, used) = (Instant::now(), cpu_seconds());
                tracer.prepare();
                let (tree, tree_cpu) = (start.elapsed().as_secs_f64(), cpu_seconds() - used);
                tracer.prepare_wide();
                let (all, all_cpu) = (start.elapsed().as_secs_f64(), cpu_seconds() - used);
                let found = [tree, tree_cpu, all - tree, all_cpu - tree_cpu];
                best.iter_mut().zip(found).for_each(|(best, found)| *best = best.min(found));
                memory = [
                    tracer.bvh().nodes.len() * size_of::<Node<D>>() + 4 * tracer.bvh().order.len(),
                    tracer.wide().bytes()[0],
                    tracer.wide().bytes()[1],
                ];
            }
            let [tree, tree_cpu, wide, wide_cpu] = best;
            let [binary, nodes, leaves] = memory.map(|m| m as f64 / bytes as f64);
            println!(
                "{name:10} {:>9} {threads:>7}  {tree:8.3} {tree_cpu:8.3}  {wide:8.3} {wide_cpu:8.3}   {binary:6.2} {nodes:6.2} {leaves:6.2}",
                mesh.simplices.len()
            );
        });
    }
}

fn main() {
    println!(
        "mesh       simplices threads    tree s    cpu s    wide s    cpu s   memory over the mesh's: tree, nodes, leaves"
    );
    for size in list("--sizes", "1m") {
        for shape in list("--shapes", "bumpy3,soup3,bumpy4,soup4") {
            let name = format!("{shape}_{size}");
            if shape.ends_with('3') { row::<3>(&name) } else { row::<4>(&name) }
        }
    }
}
