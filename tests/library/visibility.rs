//! Scan conversion against ray casting: the same simplex in every voxel, however little a facet, a sliver or an edge-on
//! simplex leaves between yes and no; and the same on any number of threads.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use ao4d::accel::Tracer;
use ao4d::geometry::{Ray, Vector64, normal_of, widen};
use ao4d::mesh::{Mesh, MeshBuilder, Orientation, Surface};
use ao4d::pipeline::Pipeline;
use ao4d::progress::Silent;
use ao4d::render::visibility::Method;
use ao4d::render::{Camera, NOTHING, Projection, View, Visibility};
use ao4d::scene::{ObjectSpec, build_object};
use ao4d::stages::Ref;
use ao4d::stages::camera::camera;
use ao4d::stages::render::RenderPlan;
use ao4d::stages::scene::{AnyMesh, ScenePlan};
use ao4d::trace::RayBackend;
use ao4d::trace::cpu::CpuBackend;
use serde_json::{Value, json};

use crate::support::{Random, mesh};

const PERSPECTIVE: Projection = Projection::Perspective { field_of_view: 90.0 };

fn object<const D: usize>(description: Value) -> Surface<D> {
    let spec: ObjectSpec = serde_json::from_value(description).unwrap();
    build_object(&spec, Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap()
}

fn several<const D: usize>(surfaces: &[Surface<D>]) -> Mesh<D> {
    let mut builder = MeshBuilder::new();
    for (i, surface) in surfaces.iter().enumerate() {
        builder.add(&format!("{i}"), [1.0; 3], surface, Orientation::Input).unwrap();
    }
    builder.finish()
}

fn moved<const D: usize>(surface: &Surface<D>, factor: f64, by: f64) -> Surface<D> {
    Surface { vertices: surface.vertices.iter().map(|v| v.map(|x| x * factor + by)).collect(), ..surface.clone() }
}

fn vector<const D: usize>(numbers: [f64; 4]) -> Vector64<D> {
    Vector64::from_fn(|r, _| numbers[if r == D - 1 { 3 } else { r }])
}

fn backend<const D: usize>(mesh: &Mesh<D>) -> Arc<dyn RayBackend<D>> {
    Arc::new(CpuBackend::new(Tracer::new(mesh.clone())))
}

/// Voxels that the two ways agree on, of those that see something; fails where they don't.
fn agree<const D: usize>(name: &str, mesh: &Mesh<D>, camera: &Camera<D>, dimensions: [usize; 3]) -> usize {
    let backend = backend(mesh);
    let grid = camera.grid(dimensions);
    let [cast, raster] = [Method::RayCast, Method::Rasterize].map(|method| {
        let visibility = Visibility::new(backend.clone(), camera, &grid, method);
        assert_eq!(visibility.method(), method);
        visibility.first_hits(0..dimensions[2], &Silent).unwrap()
    });
    for (n, (a, b)) in cast.iter().zip(&raster).enumerate() {
        assert_eq!(a, b, "{D}D, {name}, voxel {:?}, {camera:?}", grid.index(n));
    }
    if grid.len() > 4096 {
        return cast.iter().filter(|&&s| s != NOTHING).count();
    }
    let [passed, rastered] = [Method::RayCast, Method::Rasterize].map(|method| {
        Visibility::new(backend.clone(), camera, &grid, method).passages(0..dimensions[2], usize::MAX, &Silent).unwrap()
    });
    for (n, &first) in cast.iter().enumerate() {
        let at = || format!("{D}D, {name}, voxel {:?}, {camera:?}", grid.index(n));
        assert_eq!(passed.of(n), rastered.of(n), "{}", at());
        assert_eq!(passed.of(n).first().map_or(NOTHING, |passage| passage.simplex), first, "{}", at());
    }
    assert_eq!(passed, rastered);
    cast.iter().filter(|&&s| s != NOTHING).count()
}

/// Cameras from outside and inside a scene of this size around this place, straight on and slanted, from narrow to wide.
fn cameras<const D: usize>(size: f64, middle: f64) -> Vec<Camera<D>> {
    let place = |numbers: [f64; 4]| vector::<D>(numbers.map(|x| x * size + middle));
    let eyes = [
        place([0.0, 0.0, 0.0, 2.5]),
        place([0.0, 0.0, 0.0, 1.0]),
        place([1.9, -0.7, 0.4, 1.1]),
        place([0.11, -0.23, 0.31, 0.17]),
        place([0.5, 0.0, -0.5, 0.0]),
    ];
    let projections = [
        PERSPECTIVE,
        Projection::Perspective { field_of_view: 25.0 },
        Projection::Perspective { field_of_view: 172.0 },
        Projection::Perspective { field_of_view: 179.999_99 },
        Projection::Parallel { height: 2.0 * size },
        Projection::Parallel { height: 0.3 * size },
    ];
    let mut cameras = Vec::new();
    for eye in eyes {
        for projection in projections {
            cameras.push(Camera::new(&View { projection, eye, target: place([0.0; 4]), ..View::default() }).unwrap());
        }
    }
    cameras
}

fn dimensions<const D: usize>() -> [usize; 3] {
    if D == 3 { [53, 40, 1] } else { [17, 12, 14] }
}

fn all_cameras<const D: usize>(name: &str, mesh: &Mesh<D>, size: f64, middle: f64) {
    let cameras = cameras::<D>(size, middle);
    let seen: usize = cameras.iter().map(|camera| agree(name, mesh, camera, dimensions::<D>())).sum();
    let voxels = cameras.len() * dimensions::<D>().iter().product::<usize>();
    println!("{D}D, {name}: {seen} of {voxels} voxels see something");
    assert!(seen > voxels / 2000, "{D}D, {name}: {seen} of {voxels}: nothing is tested");
}

fn soups<const D: usize>() {
    for (count, size, coarse) in
        [(40, 0.5, false), (300, 0.3, false), (60, 1.0, true), (150, 0.5, true), (30, 3.0, false)]
    {
        let soup = Random(count as u32).soup::<D>(count, size, coarse);
        all_cameras(&format!("soup of {count}, {size}, {coarse}"), &mesh(&soup), 1.0, 0.0);
    }
    let soup = Random(5).soup::<D>(80, 0.5, false);
    for (factor, offset) in [(1e-20, 0.0), (1e-3, 1.0), (1e20, 0.0), (1e9, 0.0), (1.0, 1e4)] {
        all_cameras(&format!("soup by {factor}, {offset}"), &mesh(&moved(&soup, factor, offset)), factor, offset);
    }
}

#[test]
fn soups_at_every_scale() {
    soups::<3>();
    soups::<4>();
}

fn bodies<const D: usize>() {
    let n = if D == 3 { 12 } else { 4 };
    let sphere = object::<D>(json!({"hypersphere": {"radius": 0.9, "subdivisions": n}}));
    all_cameras("sphere", &mesh(&sphere), 1.0, 0.0);
    let cuboid = object::<D>(json!({"box": {"min": vec![-0.5; D], "max": vec![0.5; D], "subdivisions": n}}));
    all_cameras("box", &mesh(&cuboid), 1.0, 0.0);
    // The same again, in places, and another that touches it: all is at the same distance as something else.
    let beside = object::<D>(json!({"box": {"min": vec![-0.5; D], "max": vec![0.25; D], "subdivisions": 3}}));
    all_cameras("boxes on boxes", &several(&[cuboid.clone(), beside, cuboid]), 1.0, 0.0);
    // All but flat, along an axis and askew.
    let mut slivers = Random(4).soup::<D>(100, 0.6, false);
    slivers.vertices.iter_mut().for_each(|v| v[1] = v[1].mul_add(1e-6, v[0]));
    all_cameras("slivers", &mesh(&slivers), 1.0, 0.0);
    let mut needles = Random(6).soup::<D>(100, 0.6, false);
    for (i, v) in needles.vertices.iter_mut().enumerate() {
        *v = v.map(|x| if i % D < 2 { x } else { x * 1e-3 });
    }
    all_cameras("needles", &mesh(&needles), 1.0, 0.0);
}

#[test]
fn bodies_slivers_and_coincident_simplices() {
    bodies::<3>();
    bodies::<4>();
}

/// Voxel centres on vertices, edges, facets, and hyperplanes seen edge-on: all coordinates are small multiples of a power
/// of two, and so are the rays'.
fn exactly_on<const D: usize>() {
    let n = 16;
    for pieces in [7, 8] {
        let size = 0.125 * f64::from(pieces);
        let cuboid = object::<D>(json!({"box": {"min": vec![-size; D], "max": vec![size; D], "subdivisions": pieces}}));
        let mut mesh = mesh(&cuboid);
        for distance in [1.0, 2.0, 0.25] {
            for projection in [PERSPECTIVE, Projection::Parallel { height: 4.0 }] {
                let eye = View::<D>::default().eye * distance;
                let camera = Camera::new(&View { projection, eye, ..View::default() }).unwrap();
                let dimensions = [n, n, if D == 4 { n } else { 1 }];
                agree("box on voxels", &mesh, &camera, dimensions);
                // Not a closed surface: every second simplex.
                let all = mesh.simplices.clone();
                let mut keep = 0..;
                mesh.simplices.retain(|_| keep.next().unwrap() % 2 == 0);
                assert!(agree("half a box on voxels", &mesh, &camera, dimensions) > 0 || distance == 0.25);
                mesh.simplices = all;
            }
        }
    }
}

#[test]
fn voxel_centres_exactly_on_facets() {
    exactly_on::<3>();
    exactly_on::<4>();
}

/// How often the rays of an image pass surfaces: how many rays so many times.
fn times<const D: usize>(
    mesh: &Mesh<D>,
    camera: &Camera<D>,
    dimensions: [usize; 3],
    outside: bool,
) -> BTreeMap<usize, usize> {
    let (backend, grid) = (backend(mesh), camera.grid(dimensions));
    let passages = Visibility::new(backend.clone(), camera, &grid, Method::Rasterize)
        .passages(0..dimensions[2], usize::MAX, &Silent)
        .unwrap();
    let mut times = BTreeMap::new();
    for n in 0..passages.voxels() {
        let (ray, of_voxel) = (camera.voxel_ray(&grid, grid.index(n)), passages.of(n));
        let inwards: i32 = of_voxel.iter().map(|p| if p.enters { 1 } else { -1 }).sum();
        // From outside closed bodies are left as often as they are entered.
        assert!(inwards <= 0 && (inwards == 0 || !outside), "{D}D, {ray:?}: {of_voxel:?}");
        for pair in of_voxel.windows(2) {
            let order = backend.tracer().order(&ray, pair[0].simplex, pair[1].simplex);
            let [a, b] = [pair[0], pair[1]].map(|p| distance(mesh, &ray, p.simplex));
            assert!(a <= b * (1.0 + 1e-5), "{D}D, {ray:?}: {a} before {b}");
            assert!(order.is_le() || (a - b).abs() <= 1e-5 * b, "{D}D, {ray:?}: {pair:?}");
        }
        *times.entry(of_voxel.len()).or_insert(0) += 1;
    }
    times
}

/// How far away a simplex's hyperplane is along a ray, by plain arithmetic.
fn distance<const D: usize>(mesh: &Mesh<D>, ray: &Ray<D>, simplex: u32) -> f64 {
    let corners = mesh.corners(simplex).map(|v| widen(&v));
    let normal = normal_of(&corners);
    normal.dot(&(corners[0] - widen(&ray.origin))) / normal.dot(&widen(&ray.direction))
}

/// Rays through vertices, edges and facets, along faces, and through the places where they meet: a convex body is passed
/// twice or never from outside, once from inside, and any closed one in and out in turn.
fn closed_bodies<const D: usize>() {
    let n = 16;
    let dimensions = [n, n, if D == 4 { n } else { 1 }];
    for pieces in [7, 8] {
        let size = 0.125 * f64::from(pieces);
        let cuboid = object::<D>(json!({"box": {"min": vec![-size; D], "max": vec![size; D], "subdivisions": pieces}}));
        // A quarter of it cut away, so that rays graze inner edges too; and a smaller one inside of it.
        let cut = json!({"from": vec![0.0; D], "to": vec![2.0 * size; D]});
        let cut = json!({"cut_cube": {"min": vec![-size; D], "max": vec![size; D], "cuts": [cut]}});
        let (cut, inner) = (object::<D>(cut), moved(&cuboid, 0.5, 0.0));
        for distance in [1.0, 2.0, 0.25] {
            for projection in [PERSPECTIVE, Projection::Parallel { height: 4.0 }] {
                let eye = View::<D>::default().eye * distance;
                let from = eye.amax();
                if [size, 0.5 * size].contains(&from) {
                    continue; // on the surface itself, that one is not seen
                }
                let camera = Camera::new(&View { projection, eye, ..View::default() }).unwrap();
                let convex = times(&mesh(&cuboid), &camera, dimensions, from > size);
                let perspective = matches!(projection, Projection::Perspective { .. });
                println!("{D}D, {pieces} pieces from {distance}: {convex:?}");
                for &count in convex.keys() {
                    let right = if from > size {
                        count == 0 || count == 2
                    } else if perspective {
                        count == 1
                    } else {
                        count <= 2
                    };
                    assert!(right, "{D}D, {pieces} pieces from {distance}, {projection:?}: {convex:?}");
                }
                for surfaces in [vec![cut.clone()], vec![cuboid.clone(), inner.clone()], vec![cuboid.clone(); 2]] {
                    let found = times(&several(&surfaces), &camera, dimensions, from > size);
                    let odd = found.keys().any(|count| count % 2 == 1);
                    assert!(from < size || !odd, "{D}D, {pieces} pieces from {distance}, {projection:?}: {found:?}");
                }
            }
        }
    }
}

#[test]
fn closed_bodies_are_entered_and_left() {
    closed_bodies::<3>();
    closed_bodies::<4>();
}

/// All simplices in turn, solved as a linear system each: what a ray passes where it comes near no boundary.
fn all_in_turn<const D: usize>(mesh: &Mesh<D>, ray: &Ray<D>) -> Option<Vec<(u32, bool)>> {
    let mut found: Vec<(f64, u32, bool)> = Vec::new();
    for simplex in 0..mesh.simplices.len() as u32 {
        let corners = mesh.corners(simplex).map(|v| widen(&v));
        // origin + t direction = sum of b_i v_i, sum of b_i = 1.
        let matrix = nalgebra::DMatrix::from_fn(D + 1, D + 1, |r, c| match (r, c) {
            (r, c) if r == D => f64::from(u8::from(c < D)),
            (r, c) if c == D => -f64::from(ray.direction[r]),
            (r, c) => corners[c][r],
        });
        let right = nalgebra::DVector::from_fn(D + 1, |r, _| if r == D { 1.0 } else { f64::from(ray.origin[r]) });
        let Some(solved) = matrix.lu().solve(&right) else { continue };
        let least = solved.iter().take(D).copied().fold(f64::INFINITY, f64::min);
        if least.abs() < 1e-9 || solved[D].abs() < 1e-9 {
            return None;
        }
        if least > 0.0 && solved[D] > 0.0 {
            let enters = normal_of(&corners).dot(&widen(&ray.direction)) < 0.0;
            found.push((solved[D], simplex, enters));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let apart = found.windows(2).all(|pair| pair[1].0 - pair[0].0 > 1e-9);
    apart.then(|| found.into_iter().map(|(_, simplex, enters)| (simplex, enters)).collect())
}

fn as_all_in_turn<const D: usize>() {
    let (count, size) = if D == 3 { (60, 0.7) } else { (250, 0.9) };
    let soup = Random(31).soup::<D>(count, size, false);
    let sphere = object::<D>(json!({"hypersphere": {"radius": 0.6, "subdivisions": 3}}));
    let mesh = several(&[soup, sphere]);
    for projection in [PERSPECTIVE, Projection::Parallel { height: 2.5 }] {
        let eye = View::<D>::default().eye * 1.7;
        let camera = Camera::new(&View { projection, eye, ..View::default() }).unwrap();
        let dimensions = if D == 3 { [61, 43, 1] } else { [11, 13, 9] };
        let grid = camera.grid(dimensions);
        let visibility = Visibility::new(backend(&mesh), &camera, &grid, Method::Rasterize);
        let passages = visibility.passages(0..dimensions[2], usize::MAX, &Silent).unwrap();
        let first = visibility.passages(0..dimensions[2], 2, &Silent).unwrap();
        let (mut compared, mut most) = (0, 0);
        for n in 0..passages.voxels() {
            let found: Vec<(u32, bool)> = passages.of(n).iter().map(|p| (p.simplex, p.enters)).collect();
            assert_eq!(first.of(n), &passages.of(n)[..found.len().min(2)]);
            assert_eq!((first.count(n), passages.count(n)), (found.len() as u32, found.len() as u32));
            if let Some(expected) = all_in_turn(&mesh, &camera.voxel_ray(&grid, grid.index(n))) {
                assert_eq!(found, expected, "{D}D, voxel {:?}", grid.index(n));
                compared += 1;
                most = most.max(found.len());
            }
        }
        println!("{D}D: {compared} of {} voxels, up to {most} surfaces", passages.voxels());
        assert!(compared * 10 > passages.voxels() * 9 && most > 4);
    }
}

#[test]
fn passages_are_those_of_all_simplices_in_turn() {
    as_all_in_turn::<3>();
    as_all_in_turn::<4>();
}

fn sliced<const D: usize>() {
    let mesh = mesh(&Random(8).soup::<D>(200, 0.4, true));
    let backend = backend(&mesh);
    let view = View { eye: View::<D>::default().eye * 2.0, ..View::default() };
    let camera = Camera::new(&view).unwrap();
    let grid = camera.grid(if D == 3 { [31, 23, 1] } else { [13, 7, 11] });
    let visibility = Visibility::new(backend, &camera, &grid, Method::Rasterize);
    let with = |threads: usize, thick: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let layers = (0..grid.dimensions[2]).step_by(thick);
        let slab = |k: usize| visibility.first_hits(k..grid.dimensions[2].min(k + thick), &Silent).unwrap();
        pool.install(|| layers.flat_map(slab).collect::<Vec<_>>())
    };
    let passed = |threads: usize, thick: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let layers = (0..grid.dimensions[2]).step_by(thick);
        let slab = |k: usize| {
            let passages = visibility.passages(k..grid.dimensions[2].min(k + thick), 4, &Silent).unwrap();
            (0..passages.voxels()).map(|n| (passages.count(n), passages.of(n).to_vec())).collect::<Vec<_>>()
        };
        pool.install(|| layers.flat_map(slab).collect::<Vec<_>>())
    };
    assert_eq!(passed(1, grid.dimensions[2]), passed(3, 2));
    let whole = with(1, grid.dimensions[2]);
    assert!(whole.iter().any(|&s| s != NOTHING));
    for (threads, thick) in [(3, 11), (1, 1), (2, 3), (5, 2)] {
        assert_eq!(whole, with(threads, thick), "{threads} threads, {thick} layers");
    }
}

#[test]
fn neither_threads_nor_slabs_change_anything() {
    sliced::<3>();
    sliced::<4>();
}

fn pipeline_scene<const D: usize>(name: &str, pipeline: &Pipeline, scene: Ref<ScenePlan>, mesh: &Mesh<D>) -> usize {
    let renders = pipeline.plan.all::<RenderPlan>().filter(|(_, r)| r.scene == scene);
    renders
        .map(|(stage, render)| {
            let dimensions = render.dimensions.map(|n| n.min(if D == 3 { 90 } else { 36 }));
            let seen = agree(name, mesh, &camera(&render.camera).unwrap(), dimensions);
            println!("{name}, {}: {seen} voxels see something", pipeline.plan.id(stage));
            seen
        })
        .sum()
}

#[test]
fn every_pipelines_pictures() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines");
    let mut files = Vec::new();
    for folder in [folder.clone(), folder.join("thesis")] {
        let entries = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
        files.extend(entries.filter(|p| p.extension().is_some_and(|e| e == "yaml")));
    }
    assert!(files.len() > 8);
    for file in files {
        let name = file.file_name().unwrap().to_string_lossy();
        let pipeline = Pipeline::load(&file, &[], None).unwrap();
        if pipeline.plan.all::<RenderPlan>().next().is_none() {
            continue;
        }
        let mut seen = 0;
        for (scene, _) in pipeline.plan.all::<ScenePlan>() {
            seen += match AnyMesh::build(&pipeline.plan, scene, &mut Vec::new(), &Silent).unwrap() {
                AnyMesh::Three(mesh) => pipeline_scene(&name, &pipeline, scene, &mesh),
                AnyMesh::Four(mesh) => pipeline_scene(&name, &pipeline, scene, &mesh),
            };
        }
        assert!(seen > 0, "{name}");
    }
}

#[test]
fn the_cheaper_way_is_chosen() {
    let pick = |mesh: &Mesh<4>, distance: f64, dimensions: [usize; 3]| {
        let camera = Camera::new(&View { eye: vector([0.0, 0.0, 0.0, distance]), ..View::default() }).unwrap();
        Visibility::new(backend(mesh), &camera, &camera.grid(dimensions), Method::Auto).method()
    };
    let sphere = mesh(&object::<4>(json!({"hypersphere": {"radius": 1.0, "subdivisions": 6}})));
    assert_eq!(pick(&sphere, 3.0, [64, 64, 64]), Method::Rasterize);
    // An eye among many small ones, some of which reach behind it.
    let fine = mesh(&object::<4>(json!({"hypersphere": {"radius": 1.0, "subdivisions": 10}})));
    assert_eq!(pick(&fine, 0.3, [96, 96, 96]), Method::Rasterize);
    // Four thousand tetrahedra, each of which covers much.
    let soup = mesh(&Random(1).soup::<4>(4000, 2.0, false));
    assert_eq!(pick(&soup, 3.6, [12, 12, 12]), Method::RayCast);
}
