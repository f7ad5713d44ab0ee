//! Ambient occlusion in rays per second of one thread's time, beside Embree's on the same meshes and rays.
//!
//! ```text
//! cargo bench --bench occlusion -- [NAMES or parts of them] [--sizes 10k,100k,1m] [--rays 64,256] [--level avx2]
//!                                  [--max-rays 2e6] [--rounds 3] [--no-embree]
//! cargo bench --bench occlusion -- --visits | --once    [as above]
//! ```
//!
//! Embree (3, Debian's `libembree-dev`) is used if it and `g++` are there. Each row times
//! - `ours`: the rays that Embree gets (origins off the surface, a stratified pattern), with the mean value;
//! - `default`: what a run of the program computes (no offset, Sobol' points, the surface's own folds);
//! - `embree`: the best of its single rays, packets of eight and streams.
//!
//! `--levels` prints the levels of instructions that this processor has. `--visits` prints instead what the mean ray of *default* goes through; `--once` traces these rays once and prints nothing, so that
//! another program can count instructions.
//!
//! Above the budget of rays, evenly spread blocks of 64 vertices are traced. Times are the thread's own, medians of the
//! rounds, ours and Embree's in turn.

mod meshes;
mod rays;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use ao4d::accel::Tracer;
use ao4d::geometry::{Vector, Vector64};
use ao4d::mesh::{MeshBuilder, Orientation, Surface};
use ao4d::progress::Silent;
use ao4d::trace::cpu::{Level, PacketTracer, Visits};
use ao4d::trace::{Sampling, ShadingPoint};
use rustix::time::{ClockId, clock_gettime};

struct Options {
    names: Vec<String>,
    sizes: Vec<String>,
    rays: Vec<usize>,
    level: Level,
    max_rays: f64,
    rounds: usize,
    embree: bool,
    purpose: Purpose,
}

/// What rays are traced for.
#[derive(Clone, Copy, PartialEq)]
enum Purpose {
    Times,
    Visits,
    Nothing,
}

/// How long each timing takes at least.
const SECONDS: f64 = 0.2;

/// One timing: millions of rays per second, and the mean value.
#[derive(Clone, Copy, Default)]
struct Timing {
    rate: f64,
    mean: f64,
}

fn thread_seconds() -> f64 {
    let t = clock_gettime(ClockId::ThreadCPUTime);
    t.tv_sec as f64 + 1e-9 * t.tv_nsec as f64
}

fn median(mut timings: Vec<Timing>) -> Timing {
    timings.sort_by(|a, b| a.rate.total_cmp(&b.rate));
    timings[timings.len() / 2]
}

/// Repeats a pass over the vertices for at least [`SECONDS`].
fn time(vertices: usize, samples: usize, mut pass: impl FnMut() -> f64) -> Timing {
    let start = thread_seconds();
    let (mut passes, mut mean) = (0, 0.0);
    while passes == 0 || thread_seconds() - start < SECONDS {
        mean = pass();
        passes += 1;
    }
    let rays = (passes * vertices * samples) as f64;
    Timing { rate: rays / (thread_seconds() - start) * 1e-6, mean }
}

/// The Embree program, built here if it can be.
fn embree(folder: &Path) -> Option<PathBuf> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/embree/embree_ao.cpp");
    let program = folder.join("embree_ao");
    let built = Command::new("g++")
        .args(["-std=c++17", "-O3", "-march=native", "-ffp-contract=off"])
        .arg(source)
        .arg("-o")
        .arg(&program)
        .args(["-lembree3", "-lpthread"])
        .output();
    match built {
        Ok(output) if output.status.success() => Some(program),
        Ok(_) => {
            eprintln!("without Embree: install libembree-dev (3.x) to compare");
            None
        }
        Err(_) => {
            eprintln!("without Embree: g++ and libembree-dev (3.x) are needed to compare");
            None
        }
    }
}

/// Embree's best variant.
fn time_embree(program: &Path, mesh: &Path, pattern: &Path, samples: usize, max_rays: f64) -> Option<Timing> {
    let output = Command::new(program)
        .arg(mesh)
        .args(["--variants", "o1,o8,s1M", "--sampler", "strat", "--reps", "1", "--mintime", "0.3"])
        .args(["--n", &samples.to_string(), "--maxrays", &max_rays.to_string(), "--pattern"])
        .arg(pattern)
        .output()
        .ok()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let rows = text.lines().filter_map(|line| {
        let cells: Vec<&str> = line.split(',').collect();
        Some(Timing { rate: cells.get(12)?.parse().ok()?, mean: cells.get(14)?.parse().ok()? })
    });
    rows.max_by(|a, b| a.rate.total_cmp(&b.rate))
}

fn run<const D: usize>(name: &str, options: &Options, program: Option<&Path>, folder: &Path) -> Vec<f64> {
    let plain = meshes::named(name).unwrap();
    let mut builder = MeshBuilder::new();
    let surface = Surface::<D> {
        vertices: plain.v.chunks(D).map(|p| Vector64::from_fn(|r, _| f64::from(p[r]))).collect(),
        simplices: plain.f.chunks(D).map(|s| std::array::from_fn(|i| s[i])).collect(),
        normals: None,
    };
    builder.add(name, [0.8; 3], &surface, Orientation::Input).unwrap();
    let start = Instant::now();
    let tracer = Tracer::new(builder.finish());
    let mesh = tracer.mesh();
    tracer.prepare();
    let build = start.elapsed().as_secs_f64();
    let wide = tracer.wide();
    let collapse = start.elapsed().as_secs_f64() - build;
    tracer.incidence();
    let normals = rays::normals::<D>(&plain);
    let offset = rays::offset::<D>(&plain);
    let file = folder.join(format!("{name}.smx"));
    if program.is_some() && !file.exists() {
        plain.save(&file).unwrap();
    }
    let mut ratios = Vec::new();
    for &samples in &options.rays {
        let table = rays::pattern::<D>(samples);
        let pattern = folder.join(format!("pattern{D}_{samples}"));
        std::fs::write(
            &pattern,
            table.iter().flat_map(|p| &p[..D - 1]).flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>(),
        )
        .unwrap();
        let list = rays::work_list(mesh.vertices.len(), samples, options.max_rays);
        let sampling = Sampling::new(samples as u32, 1);
        let mut packets = PacketTracer::<D>::new(options.level);
        if options.purpose != Purpose::Times {
            let mut visits = Visits::default();
            for &v in &list {
                let point = ShadingPoint::Vertex(v);
                let _ = if options.purpose == Purpose::Visits {
                    packets.counted(&tracer, &point, &sampling, &mut visits, &Silent)
                } else {
                    packets.estimate(&tracer, &point, &sampling, &Silent)
                };
            }
            if options.purpose == Purpose::Visits {
                let a_ray = |count: u64| count as f64 / visits.rays as f64;
                println!(
                    "{name:12} {samples:4}  {:8.3} {:8.2}  {:8.3} {:8.2}  {:8.3} {:8.3}  {:8.5}",
                    a_ray(visits.set_nodes),
                    a_ray(visits.set_node_rays),
                    a_ray(visits.set_leaves),
                    a_ray(visits.set_leaf_rays),
                    a_ray(visits.single_nodes),
                    a_ray(visits.single_leaves),
                    a_ray(visits.doubts)
                );
            }
            continue;
        }
        let mut directions: Vec<Vector<D>> = Vec::new();
        let (mut ours, mut default, mut theirs) = (vec![], vec![], vec![]);
        for _ in 0..options.rounds {
            ours.push(time(list.len(), samples, || {
                let mut blocked = 0u64;
                for &v in &list {
                    let normal = normals[v as usize];
                    rays::directions(&table, v, &normal, &mut directions);
                    let origin = mesh.vertices[v as usize] + normal * offset;
                    blocked +=
                        u64::from(packets.count_occluded(&tracer, &origin, normal, &directions, f32::INFINITY, None));
                }
                1.0 - blocked as f64 / (list.len() * samples) as f64
            }));
            default.push(time(list.len(), samples, || {
                let mut at = |v| packets.estimate(&tracer, &ShadingPoint::Vertex(v), &sampling, &Silent);
                list.iter().map(|&v| at(v).map_or(0.0, |found| f64::from(found.value))).sum::<f64>() / list.len() as f64
            }));
            if let Some(program) = program.filter(|_| D == 3) {
                theirs.extend(time_embree(program, &file, &pattern, samples, options.max_rays));
            }
        }
        let (ours, default) = (median(ours), median(default));
        print!("{name:12} {samples:4}  {:7.2} {:.5}  {:7.2} {:.5}", ours.rate, ours.mean, default.rate, default.mean);
        if !theirs.is_empty() {
            let theirs = median(theirs);
            ratios.push(ours.rate / theirs.rate);
            print!("  {:7.2} {:.5}  {:5.2}", theirs.rate, theirs.mean, ours.rate / theirs.rate);
        }
        println!("   build {build:.2}+{collapse:.2} s, {} nodes {} leaves", wide.nodes, wide.leaves);
    }
    ratios
}

fn main() {
    let mut options = Options {
        names: vec![],
        sizes: vec!["10k".into(), "100k".into()],
        rays: vec![64],
        level: Level::best(),
        max_rays: 2e6,
        rounds: 3,
        embree: true,
        purpose: Purpose::Times,
    };
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().unwrap_or_default();
        match argument.as_str() {
            "--bench" => {}
            "--no-embree" => options.embree = false,
            "--visits" => options.purpose = Purpose::Visits,
            "--once" => options.purpose = Purpose::Nothing,
            "--levels" => {
                return Level::available().iter().for_each(|level| println!("{}", format!("{level:?}").to_lowercase()));
            }
            "--sizes" => options.sizes = value().split(',').map(str::to_owned).collect(),
            "--rays" => options.rays = value().split(',').filter_map(|x| x.parse().ok()).collect(),
            "--max-rays" => options.max_rays = value().parse().unwrap_or(2e6),
            "--rounds" => options.rounds = value().parse().unwrap_or(3).max(1),
            "--level" => {
                let name = value();
                let level = Level::available().into_iter().find(|l| format!("{l:?}").eq_ignore_ascii_case(&name));
                options.level = level.unwrap_or_else(|| panic!("no level {name} here: {:?}", Level::available()));
            }
            name => options.names.push(name.to_owned()),
        }
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/bench-occlusion");
    std::fs::create_dir_all(&folder).unwrap();
    let program = if options.embree && options.purpose == Purpose::Times { embree(&folder) } else { None };
    match options.purpose {
        Purpose::Times => {
            println!("{:?}; Mrays/s of one thread's time, and mean values", options.level);
            println!("mesh         rays     ours    mean  default    mean   embree    mean  ratio");
        }
        Purpose::Visits => {
            println!(
                "What the mean ray goes through: nodes and leaves by sets of rays, by itself, and leaves in doubt"
            );
            println!(
                "mesh         rays  by sets at nodes   of rays  at leaves  of rays  by itself at nodes  leaves  doubts"
            );
        }
        Purpose::Nothing => {}
    }
    let mut ratios = vec![];
    for size in &options.sizes {
        for shape in ["bumpy3", "cubes3", "knot3", "soup3", "bumpy4", "cubes4", "soup4"] {
            let name = format!("{shape}_{size}");
            if !options.names.is_empty() && !options.names.iter().any(|part| name.contains(part.as_str())) {
                continue;
            }
            ratios.extend(if shape.ends_with('3') {
                run::<3>(&name, &options, program.as_deref(), &folder)
            } else {
                run::<4>(&name, &options, program.as_deref(), &folder)
            });
        }
    }
    if !ratios.is_empty() {
        let mean = (ratios.iter().map(|r| r.ln()).sum::<f64>() / ratios.len() as f64).exp();
        println!("geometric mean of the ratios to Embree's best: {mean:.2}");
    }
}
