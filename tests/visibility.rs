//! Scan conversion against ray casting: the same simplex in every voxel, however little a facet, a sliver or an edge-on
//! simplex leaves between yes and no; and the same on any number of threads.

use std::path::Path;
use std::sync::Arc;

use ao4d::accel::Tracer;
use ao4d::geometry::Vector64;
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

mod support;

use support::{Random, mesh};

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
    // Two thousand tetrahedra all around, each of which covers much.
    let soup = mesh(&Random(1).soup::<4>(2000, 2.0, false));
    assert_eq!(pick(&soup, 0.3, [16, 16, 16]), Method::RayCast);
}
