//! The fast engine against the slow one: the same bits at every level of instructions, on scenes that are easy, and on
//! scenes full of coincidences.

use crate::on_rays::{on_rays, stars_on_rays};
use ao4d::accel::Tracer;
use ao4d::geometry::{Ray, Vector, Vector64};
use ao4d::mesh::{Mesh, Surface};
use ao4d::occlusion::{Estimates, Estimator};
use ao4d::progress::Silent;
use ao4d::trace::cpu::{CpuBackend, Level, PacketTracer, ScalarBackend, Visits};
use ao4d::trace::{RayBackend, Sampler, Sampling, ShadingPoint, Target};

use crate::support::{Random, mesh};

fn soup<const D: usize>(seed: u32, count: usize, size: f64, coarse: bool) -> Surface<D> {
    Random(seed).soup(count, size, coarse)
}

/// The graph of `height` over a grid of n^(D-1) cells, each cut along its diagonals (Kuhn).
fn graph<const D: usize>(n: u32, height: impl Fn(&[f64]) -> f64) -> Surface<D> {
    let side = n + 1;
    let vertices = (0..side.pow(D as u32 - 1))
        .map(|index| {
            let mut point = Vector64::<D>::from_fn(|r, _| f64::from(index / side.pow(r as u32) % side) / f64::from(n));
            point[D - 1] = height(&point.as_slice()[..D - 1]);
            point
        })
        .collect();
    let orders: &[&[usize]] = if D == 3 {
        &[&[0, 1], &[1, 0]]
    } else {
        &[&[0, 1, 2], &[1, 2, 0], &[2, 0, 1], &[0, 2, 1], &[2, 1, 0], &[1, 0, 2]]
    };
    let mut simplices = Vec::new();
    for cell in 0..n.pow(D as u32 - 1) {
        let low: u32 = (0..D as u32 - 1).map(|r| cell / n.pow(r) % n * side.pow(r)).sum();
        for (k, order) in orders.iter().enumerate() {
            let mut simplex = [low; D];
            for corner in 1..D {
                simplex[corner] = simplex[corner - 1] + side.pow(order[corner - 1] as u32);
            }
            // Half of the orders are odd permutations; so is moving the last axis before three others.
            if (k >= orders.len() / 2) ^ (D == 4) {
                simplex.swap(0, 1);
            }
            simplices.push(simplex);
        }
    }
    Surface { vertices, simplices, normals: None }
}

fn moved<const D: usize>(mut surface: Surface<D>, factor: f64, by: f64) -> Surface<D> {
    surface.vertices.iter_mut().for_each(|v| *v = v.map(|x| x * factor + by));
    surface
}

fn sampling(sampler: Sampler, samples: u32, max_distance: f32) -> Sampling {
    Sampling { sampler, max_distance, ..Sampling::new(samples, 5) }
}

/// Points inside the simplices, and some off them, with normals that look anywhere.
fn visible_points<const D: usize>(mesh: &Mesh<D>, random: &mut Random) -> Vec<ShadingPoint<D>> {
    let count = mesh.simplices.len().min(60) as u32;
    let point = |n: u32| {
        let simplex = n * mesh.simplices.len() as u32 / count;
        let corners = mesh.corners(simplex);
        let weights: [f32; D] = std::array::from_fn(|_| random.point::<D>(false)[0].abs() as f32 + 0.01);
        let total: f32 = weights.iter().sum();
        let inside = (0..D).fold(Vector::zeros(), |sum: Vector<D>, i| sum + corners[i] * (weights[i] / total));
        let normal = random.point::<D>(false).map(|x| x as f32).normalize();
        let off = if n % 9 == 8 { 3.0 } else { 1.0 };
        ShadingPoint::Inside { position: inside * off, normal, simplex, number: u64::from(n) * 7 }
    };
    (0..count).map(point).collect()
}

/// Values and errors by rays.
fn estimate<const D: usize>(backend: &dyn RayBackend<D>, points: &[ShadingPoint<D>], sampling: &Sampling) -> Estimates {
    Estimator::Sampled(*sampling).estimate(backend, points, None, &Silent).unwrap()
}

/// The values of all levels and the slow ones are the same, at vertices and at visible points.
fn check<const D: usize>(name: &str, surface: &Surface<D>, sampling: &Sampling) -> Vec<f32> {
    let tracer = std::sync::Arc::new(Tracer::new(mesh(surface)));
    let vertices = ShadingPoint::vertices(tracer.mesh());
    let points = [vertices.clone(), visible_points(tracer.mesh(), &mut Random(11))].concat();
    let mut values = Vec::new();
    let fine = (sampling.samples > 1000).then_some(0.012);
    for target in [None, Some(0.04)].into_iter().chain([fine]).map(|error| error.map(|error| Target { error })) {
        let sampling = Sampling { target, ..*sampling };
        let slow = estimate(&ScalarBackend::new(tracer.clone()), &points, &sampling);
        for level in Level::available() {
            let fast = estimate(&CpuBackend::with_level(tracer.clone(), level), &points, &sampling);
            assert_eq!(fast.rays, slow.rays, "{name}, D = {D}, {level:?}");
            for (i, point) in points.iter().enumerate() {
                let [found, expected] = [&fast, &slow].map(|e| (e.values[i].to_bits(), e.errors[i].to_bits()));
                assert_eq!(found, expected, "{name}, D = {D}, {level:?}, {target:?}, {point:?}");
            }
        }
        values.push(slow.values);
    }
    values[0][..vertices.len()].to_vec()
}

fn scenes<const D: usize>() {
    let sobol = sampling(Sampler::Sobol, 64, f32::INFINITY);
    let few = if D == 3 { 12 } else { 5 };
    let bumps = |x: &[f64]| x.iter().map(|x| 0.2 * (9.0 * x).sin()).sum();
    let fold = |x: &[f64]| (x[0] - 0.5).abs();
    let crease = |x: &[f64]| -2.0 * (x[0] - 0.5).abs().min((x[1] - 0.5).abs());
    let step = |x: &[f64]| if x[0] > 0.5 { 0.3 } else { 0.0 };
    let tilt = |x: &[f64]| x.iter().sum::<f64>() * 0.3;
    let dark = |name: &str, surface: &Surface<D>, sampling: &Sampling| {
        let values = check(name, surface, sampling);
        let rays = values.len() as f64 * f64::from(sampling.samples);
        let visible = values.iter().map(|&v| f64::from(v) * f64::from(sampling.samples)).sum::<f64>();
        let blocked = rays - visible;
        assert!(visible > 100.0 && blocked > 100.0, "{name}: {visible} and {blocked} rays: nothing is tested");
    };
    dark("soup", &soup(1, 300, 0.3, false), &sobol);
    dark("dense soup", &soup(1, 100, 1.0, false), &sampling(Sampler::Sobol, 100, f32::INFINITY));
    dark("coarse soup", &soup(2, 60, 0.5, true), &sobol);
    dark("coarse soup", &soup(3, 70, 0.5, true), &sampling(Sampler::Random, 77, f32::INFINITY));
    // Blocks of neighbours: sixteen, four and one at a time, and the rest.
    for samples in [256, 320, 1024, 1700] {
        dark("small soup", &soup(1, 30, 0.4, false), &sampling(Sampler::Sobol, samples, f32::INFINITY));
    }
    dark("bumps", &graph(few, bumps), &sobol);
    dark("bumps", &graph(few, bumps), &sampling(Sampler::Sobol, 200, f32::INFINITY));
    dark("fold", &graph(few, fold), &sobol);
    dark("crease", &graph(few, crease), &sobol);
    dark("step", &graph(few, step), &sobol);
    check::<D>("flat", &graph(few, |_| 0.0), &sobol);
    check::<D>("tilted", &graph(few, tilt), &sobol);
    dark("far soup", &moved(soup(1, 200, 0.3, false), 1.0, 1000.0), &sobol);
    dark("far bumps", &moved(graph(few, bumps), 1.0, 3e4), &sobol);
    dark("tiny soup", &moved(soup(1, 100, 0.3, false), 1e-20, 0.0), &sobol);
    dark("huge soup", &moved(soup(1, 100, 0.3, false), 1e29, 0.0), &sobol);
    // Slivers: one axis shrunk to nearly nothing.
    let mut slivers = soup::<D>(4, 100, 0.3, false);
    slivers.vertices.iter_mut().for_each(|v| v[1] = v[1].mul_add(1e-6, v[0]));
    check("slivers", &slivers, &sobol);
    // Limited distance.
    dark("near only", &soup(1, 200, 0.3, false), &sampling(Sampler::Sobol, 64, 0.4));
    dark("near only, coarse", &soup(2, 60, 0.5, true), &sampling(Sampler::Sobol, 64, 0.5));
    // A speck in a large scene, whose products vanish in single precision.
    let mut speck = soup::<D>(6, 40, 0.5, false);
    let small = moved(soup::<D>(7, 40, 0.5, false), 1e-13, 0.0);
    let shift = speck.vertices.len() as u32;
    speck.vertices.extend(small.vertices);
    speck.simplices.extend(small.simplices.iter().map(|s| s.map(|v| v + shift)));
    dark("speck", &speck, &sobol);
    // Something far away, and a floor that reaches as far: what lies together is met as without them.
    for far in [1e6, 1e12, 1e25] {
        for floor in [false, true] {
            let mut scene = soup::<D>(1, 60, 0.6, false);
            let mut other = soup::<D>(9, 2, 1.0, false);
            if floor {
                other = soup::<D>(9, 1, 1.0, false);
                // To all sides, nearly level, 2 below the middle of the scene.
                other.vertices.iter_mut().for_each(|v| *v = v.map(|x| x * far));
                other.vertices.iter_mut().for_each(|v| v[D - 1] = v[D - 1].mul_add(1e-3 / far, -2.0));
            }
            let shift = scene.vertices.len() as u32;
            let by = if floor { 0.0 } else { far };
            scene.vertices.extend(other.vertices.iter().map(|v| v.add_scalar(by)));
            scene.simplices.extend(other.simplices.iter().map(|s| s.map(|v| v + shift)));
            dark(&format!("apart by {far}, floor {floor}"), &scene, &sobol);
            let tracer = Tracer::new(mesh(&scene));
            let served = tracer.mesh().vertices.iter().filter(|v| tracer.wide().serves(v)).count();
            assert!(served >= shift as usize, "{far} {floor}: {served}");
        }
    }
}

#[test]
fn all_levels_give_the_slow_values_in_3d() {
    scenes::<3>();
}

#[test]
fn all_levels_give_the_slow_values_in_4d() {
    scenes::<4>();
}

fn close_calls<const D: usize>() {
    // From the coarse to the fine: few rays and large simplices, and nets of several blocks.
    for (points, simplices, samples, offset) in [
        (4000, 2, 64, 0.0),
        (300, 4, 64, 0.0),
        (100, 30, 64, 0.0),
        (100, 10, 320, 0.0),
        (40, 20, 1024, 0.0),
        (200, 6, 64, 700.0),
    ] {
        let sampling = sampling(Sampler::Sobol, samples, f32::INFINITY);
        let (mesh, points) = on_rays::<D>(points, simplices, offset, &sampling);
        all_levels_agree(mesh, &points, &sampling);
    }
}

/// Vertices, too, whose rays all but touch what the simplices around them hide.
fn close_calls_of_stars<const D: usize>() {
    for (vertices, samples, offset) in [(4000, 64, 0.0), (300, 1024, 0.0), (500, 64, 700.0)] {
        let sampling = sampling(Sampler::Sobol, samples, f32::INFINITY);
        let (mesh, points) = stars_on_rays::<D>(vertices, offset, &sampling);
        all_levels_agree(mesh, &points, &sampling);
    }
}

fn all_levels_agree<const D: usize>(mesh: Mesh<D>, points: &[ShadingPoint<D>], sampling: &Sampling) {
    let tracer = std::sync::Arc::new(Tracer::new(mesh));
    let slow = ScalarBackend::new(tracer.clone()).open_fractions(points, sampling, &Silent).unwrap();
    for level in Level::available() {
        let fast = CpuBackend::with_level(tracer.clone(), level).open_fractions(points, sampling, &Silent).unwrap();
        assert!(fast == slow, "{D}D, {} points of {} rays, {level:?}", points.len(), sampling.samples);
    }
    let open: f32 = slow.iter().map(|e| e.value).sum::<f32>() / slow.len() as f32;
    assert!((0.02..0.98).contains(&open), "{open}");
}

#[test]
fn rays_that_all_but_miss_a_corner_are_those_of_the_slow_twin() {
    close_calls::<3>();
    close_calls::<4>();
}

#[test]
fn rays_that_all_but_touch_a_star_are_those_of_the_slow_twin() {
    close_calls_of_stars::<3>();
    close_calls_of_stars::<4>();
}

#[test]
fn counting_visits_changes_nothing() {
    let tracer = Tracer::new(mesh(&soup::<3>(1, 3000, 0.1, false)));
    let sampling = sampling(Sampler::Sobol, 256, f32::INFINITY);
    let (mut packets, mut visits) = (PacketTracer::default(), Visits::default());
    for vertex in 0..100 {
        let point = ShadingPoint::Vertex(vertex);
        let counted = packets.counted(&tracer, &point, &sampling, &mut visits, &Silent).unwrap();
        assert_eq!(counted, packets.estimate(&tracer, &point, &sampling, &Silent).unwrap());
    }
    // A ray is blocked before, or goes through the root and, if it escapes, through no less.
    assert!((12_800..=25_600).contains(&visits.rays), "{visits:?}");
    assert!(visits.set_node_rays >= visits.rays && visits.set_node_rays <= 64 * visits.set_nodes, "{visits:?}");
    assert!(visits.set_leaf_rays >= visits.set_leaves && visits.single_leaves > visits.doubts, "{visits:?}");
    assert!(visits.single_nodes > 0 && visits.set_leaves > 0, "{visits:?}");
}

fn any_rays<const D: usize>() {
    // From anywhere, in any direction, ignoring a simplex.
    let mut random = Random(3);
    for coarse in [false, true] {
        let mesh = mesh(&soup::<D>(8, 80, 0.6, coarse));
        let tracer = Tracer::new(mesh);
        let mut all = 0;
        for n in 0..200 {
            let origin = random.point::<D>(coarse).map(|x| x as f32) * if n % 10 == 0 { 5.0 } else { 1.0 };
            let directions: Vec<Vector<D>> = (0..90)
                .map(|_| random.point::<D>(coarse).map(|x| x as f32))
                .filter(|d| d.amax() > 0.0)
                .map(|d| d.normalize())
                .collect();
            let limit = if n % 3 == 0 { 0.7 } else { f32::INFINITY };
            let ignored = Some(random.0 % 80);
            let rays = directions.iter().map(|d| Ray::new(origin, *d));
            let expected = rays.filter(|ray| tracer.occluded(ray, limit, ignored)).count() as u32;
            all += expected;
            for level in Level::available() {
                let found = PacketTracer::new(level).count_occluded(
                    &tracer,
                    &origin,
                    directions[0],
                    &directions,
                    limit,
                    ignored,
                );
                assert_eq!(found, expected, "{level:?} {n}");
            }
        }
        assert!(all > 1000);
    }
}

#[test]
fn any_rays_from_anywhere() {
    any_rays::<3>();
    any_rays::<4>();
}

#[test]
fn no_simplices_and_no_vertices() {
    let empty = mesh::<4>(&Surface { vertices: vec![], simplices: vec![], normals: None });
    let sobol = sampling(Sampler::Sobol, 64, f32::INFINITY);
    assert_eq!(estimate(&CpuBackend::new(Tracer::new(empty)), &[], &sobol), Estimates::default());
    let points =
        mesh::<3>(&Surface { vertices: vec![Vector64::zeros(); 3], simplices: vec![[0, 1, 2]], normals: None });
    let vertices = ShadingPoint::vertices(&points);
    assert_eq!(estimate(&CpuBackend::new(Tracer::new(points)), &vertices, &sobol).values, vec![1.0; 3]);
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let backend = CpuBackend::new(Tracer::new(mesh(&soup::<4>(9, 400, 0.3, false))));
    let mesh = backend.tracer().mesh();
    let points = [ShadingPoint::vertices(mesh), visible_points(mesh, &mut Random(2))].concat();
    let sobol = sampling(Sampler::Sobol, 64, f32::INFINITY);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| estimate(&backend, &points, &sobol))
    };
    assert_eq!(with(1), with(3));
}
