//! The hierarchy against testing every simplex; closed surfaces against leaks; pictures against projections.

use std::sync::Arc;

use ao4d::accel::Tracer;
use ao4d::geometry::{Cone, Expansion, Ray, Vector, Vector64};
use ao4d::mesh::{Mesh, Surface};
use ao4d::occlusion::{Estimates, Estimator};
use ao4d::progress::Silent;
use ao4d::render::filters::denoise::Refine;
use ao4d::render::filters::{Dilate, denoise};
use ao4d::render::{Aov, Camera, Projection, Renderer, Shading, Slab, View};
use ao4d::trace::cpu::{CpuBackend, ScalarBackend};
use ao4d::trace::{NOTHING, RayBackend, Sampling};
use ao4d::volume::Values;

mod support;

use support::{Random, mesh};

fn soup<const D: usize>(random: &mut Random, count: usize, coarse: bool) -> Mesh<D> {
    mesh(&random.soup(count, 0.5, coarse))
}

/// The first hit by testing every simplex and comparing the distances exactly.
fn first_by_brute_force<const D: usize>(mesh: &Mesh<D>, ray: &Ray<D>) -> Option<u32> {
    let mut best: Option<(u32, Expansion, Expansion)> = None;
    for s in 0..mesh.simplices.len() as u32 {
        let cone = Cone::of_simplex(&ray.origin, &mesh.corners(s));
        if mesh.degenerate.contains(&s) || !cone.contains(&ray.direction) {
            continue;
        }
        let (n, d) = cone.exact_distance(&ray.direction);
        let nearer = |m: &Expansion, e: &Expansion| n.multiply(e).add(&m.multiply(&d).negate()).sign() < 0;
        if best.as_ref().is_none_or(|(_, m, e)| nearer(m, e)) {
            best = Some((s, n, d));
        }
    }
    best.map(|(s, ..)| s)
}

fn same_hits<const D: usize>() {
    let mut random = Random(7);
    for (count, coarse) in [(1, false), (40, false), (60, true), (150, false), (150, true)] {
        let mesh = soup::<D>(&mut random, count, coarse);
        let tracer = Tracer::new(mesh.clone());
        let mut hits = 0;
        for _ in 0..300 {
            let origin = random.point::<D>(coarse).map(|x| x as f32);
            let direction = random.point::<D>(coarse).map(|x| x as f32);
            let ray = Ray::new(origin, direction);
            if direction.amax() == 0.0 {
                continue;
            }
            let expected = first_by_brute_force(&mesh, &ray);
            hits += usize::from(expected.is_some());
            let hit = tracer.closest_hit(&ray);
            assert_eq!(hit.map(|h| h.simplex), expected);
            assert_eq!(tracer.occluded(&ray, f32::INFINITY, None), expected.is_some());
            if let Some(hit) = hit {
                let corners = mesh.corners(hit.simplex);
                let point = (0..D)
                    .fold(Vector64::zeros(), |p: Vector64<D>, i| p + corners[i].map(f64::from) * hit.barycentric[i]);
                assert!((point - ray.at(hit.t)).norm() < 1e-9 * (1.0 + hit.t));
                assert!(!tracer.occluded(&ray, (hit.t * 0.999) as f32, None) || coarse);
                assert!(tracer.occluded(&ray, (hit.t * 1.001) as f32, None));
            }
        }
        assert!(count == 1 || hits > 0, "a test without hits tests nothing");
    }
}

#[test]
fn the_hierarchy_finds_what_brute_force_finds() {
    same_hits::<3>();
    same_hits::<4>();
}

/// The boundary of a cube cut into simplices along its diagonals (Kuhn): D! simplices a facet.
fn cube<const D: usize>(low: f64, high: f64) -> Surface<D> {
    let vertices = (0..1u32 << D).map(|c| Vector64::from_fn(|r, _| if c >> r & 1 == 1 { high } else { low })).collect();
    let mut simplices = Vec::new();
    // Paths from corner 0 to the opposite one give the simplices of the solid; those of a facet leave out one end.
    let mut orders = vec![vec![]];
    for axis in 0..D {
        orders = (orders.into_iter())
            .flat_map(|o: Vec<usize>| {
                (0..=o.len()).map(move |i| {
                    let mut o = o.clone();
                    o.insert(i, axis);
                    o
                })
            })
            .collect();
    }
    for order in orders {
        let path: Vec<u32> = (0..=D).map(|n| order[..n].iter().map(|&a| 1u32 << a).sum()).collect();
        simplices.push(std::array::from_fn(|i| path[i]));
        simplices.push(std::array::from_fn(|i| path[i + 1]));
    }
    Surface { vertices, simplices, normals: None }
}

/// Layer after layer behind each other, as testing every simplex finds them; by both engines of the processor.
fn peeled<const D: usize>() {
    let mut random = Random(12);
    let mut behind = 0;
    for (count, coarse) in [(40, false), (60, true), (150, true)] {
        let mut surface = random.soup::<D>(count, 0.7, coarse);
        // Some simplices twice, which are hit at exactly the same distance.
        surface.simplices.extend_from_within(..count / 4);
        let mesh = mesh(&surface);
        let tracer = Arc::new(Tracer::new(mesh.clone()));
        let rays: Vec<Ray<D>> = (0..200)
            .map(|_| [random.point::<D>(coarse), random.point::<D>(coarse)].map(|p| p.map(|x| x as f32)))
            // Through the middle, where most simplices are.
            .map(|[origin, target]| Ray::new(origin * 2.0, target * 0.25 - origin * 2.0))
            .filter(|ray| ray.direction.amax() > 0.0)
            .collect();
        let hit = |ray: &Ray<D>, s: u32| {
            let cone = Cone::of_simplex(&ray.origin, &mesh.corners(s));
            let counts = !mesh.degenerate.contains(&s) && cone.contains(&ray.direction);
            counts.then(|| cone.exact_distance(&ray.direction))
        };
        let nearer = |a: &(Expansion, Expansion), b: &(Expansion, Expansion)| {
            a.0.multiply(&b.1).add(&b.0.multiply(&a.1).negate()).sign() < 0
        };
        let backends: [&dyn RayBackend<D>; 2] = [&CpuBackend::new(tracer.clone()), &ScalarBackend::new(tracer.clone())];
        let mut after = vec![NOTHING; rays.len()];
        for layer in 0..6 {
            let expected: Vec<u32> = (rays.iter().zip(&after))
                .map(|(ray, &after)| {
                    let bound = if after == NOTHING { None } else { hit(ray, after) };
                    let mut best: Option<(u32, (Expansion, Expansion))> = None;
                    for s in 0..mesh.simplices.len() as u32 {
                        let Some(t) = hit(ray, s) else { continue };
                        let allowed = bound.as_ref().is_none_or(|bound| nearer(bound, &t));
                        if allowed && best.as_ref().is_none_or(|(_, least)| nearer(&t, least)) {
                            best = Some((s, t));
                        }
                    }
                    best.map_or(NOTHING, |(s, _)| s)
                })
                .collect();
            for backend in backends {
                assert_eq!(backend.first_hits(&rays, Some(&after), &Silent).unwrap(), expected, "{D}D, layer {layer}");
            }
            behind += usize::from(layer > 0) * expected.iter().filter(|&&s| s != NOTHING).count();
            // Where nothing is left, another simplex that is not hit bounds nothing.
            after = expected;
        }
    }
    assert!(behind > 300, "{D}D: {behind} hits behind others");
}

#[test]
fn layers_are_peeled_exactly() {
    peeled::<3>();
    peeled::<4>();
}

fn no_leaks<const D: usize>() {
    let mesh = mesh(&cube::<D>(-0.3, 0.7));
    assert!(mesh.objects[0].is_closed());
    let tracer = Tracer::new(mesh.clone());
    let mut random = Random(99);
    for k in 0..20_000u32 {
        let origin = random.point::<D>(false).map(|x| (x * 0.25 + 0.2) as f32);
        let direction = match k % 4 {
            // Through the centre of a facet's triangulation, its edges and its corners: exactly onto shared facets.
            0 => mesh.vertices[random.0 as usize % mesh.vertices.len()] - origin,
            1 => {
                let corners = mesh.corners(random.0 % mesh.simplices.len() as u32);
                (corners[0] + corners[1]) * 0.5 - origin
            }
            _ => random.point::<D>(k % 4 == 2).map(|x| x as f32),
        };
        if direction.amax() > 0.0 {
            assert!(tracer.occluded(&Ray::new(origin, direction), f32::INFINITY, None), "{origin} {direction}");
        }
    }
}

#[test]
fn no_ray_leaves_a_closed_body() {
    no_leaks::<3>();
    no_leaks::<4>();
}

fn axes<const D: usize>(projection: Projection) {
    // A small simplex facing the camera well off the axes: only voxels around its projection see it, all others are
    // background, so no axis is mirrored or exchanged.
    let centre = Vector64::<D>::from_fn(|r, _| [0.5, -0.25, 0.7, -0.5][if r == D - 1 { 3 } else { r }]);
    let vertices: Vec<Vector64<D>> = (0..D)
        .map(|i| {
            centre
                + Vector64::from_fn(|r, _| {
                    if r == D - 1 {
                        0.0
                    } else if r == i {
                        0.3
                    } else {
                        -0.15
                    }
                })
        })
        .collect();
    let simplices = vec![std::array::from_fn(|i| i as u32)];
    let mesh = mesh(&Surface { vertices, simplices, normals: None });
    let backend: Arc<dyn RayBackend<D>> = Arc::new(CpuBackend::new(Tracer::new(mesh.clone())));
    let camera = Camera::new(&View { projection, ..View::default() }).unwrap();
    let dimensions = [40, 20, if D == 4 { 30 } else { 1 }];
    let renderer = Renderer::new(Arc::clone(&backend), camera.clone(), dimensions, Shading::None);
    let grid = renderer.grid;
    let aovs = [Aov::Opacity, Aov::Depth, Aov::Object, Aov::Rgba, Aov::Normal];
    let arrays = renderer.volume(&aovs, &Silent).unwrap().arrays;
    let [Values::F32(opacity), Values::F32(depth), Values::U16(object), Values::U8(rgba), Values::F32(normal)] =
        [0, 1, 2, 3, 4].map(|i| arrays[i].values.clone())
    else {
        panic!("types");
    };
    let (place, distance) = camera.project(&mesh.vertices.iter().sum::<Vector<D>>().map(|x| x / D as f32));
    let mut seen = 0;
    for (n, &o) in opacity.iter().enumerate() {
        let index = [n % 40, n / 40 % 20, n / 800];
        let point = grid.point(index);
        let far = (0..D - 1).map(|a| (point[a] - place[a]).abs()).fold(0.0, f64::max);
        if o == 1.0 {
            seen += 1;
            assert!(far < 0.32, "{index:?}");
            let slant = if matches!(projection, Projection::Perspective { .. }) {
                (1.0 + point[..D - 1].iter().map(|x| x * x).sum::<f64>()).sqrt()
            } else {
                1.0
            };
            assert!((f64::from(depth[n]) - distance * slant).abs() < 1e-6);
            assert_eq!((object[n], &rgba[4 * n..4 * n + 4]), (1, &[255u8, 255, 255, 255][..]));
            assert!(normal[D * n + D - 1] == 1.0);
        } else {
            assert_eq!((depth[n], object[n], &rgba[4 * n..4 * n + 4]), (f32::INFINITY, 0, &[255u8, 255, 255, 0][..]));
        }
    }
    assert!(seen > 0);
}

#[test]
fn pictures_show_things_where_they_project_to() {
    for projection in [Projection::Perspective { field_of_view: 90.0 }, Projection::Parallel { height: 2.0 }] {
        axes::<3>(projection);
        axes::<4>(projection);
    }
}

/// A picture is the same bytes however thick its slabs are, and on however many threads it is made.
fn slabs<const D: usize>() {
    let mut random = Random(3);
    let mesh = soup::<D>(&mut random, 30, false);
    let backend: Arc<dyn RayBackend<D>> = Arc::new(CpuBackend::new(Tracer::new(mesh.clone())));
    let view = View { eye: View::<D>::default().eye * 3.0, ..View::default() };
    let camera = Camera::new(&view).unwrap();
    let dimensions = [9, 7, if D == 4 { 8 } else { 1 }];
    let count = mesh.vertices.len();
    let values = (0..count).map(|i| (i % 10) as f32 / 10.0).collect();
    let estimates = Arc::new(Estimates { values, errors: vec![0.01; count], rays: 0 });
    let sobol = Estimator::Sampled(Sampling::new(16, 1));
    for (shading, filtered) in [
        (Shading::Flat(Arc::clone(&estimates)), false),
        (Shading::Smooth(Arc::clone(&estimates)), true),
        (Shading::Voxel(sobol), false),
        (Shading::Auto(Arc::clone(&estimates), sobol), true),
    ] {
        for supersample in [1, 2, 3] {
            let mut renderer = Renderer::new(Arc::clone(&backend), camera.clone(), dimensions, shading.clone());
            renderer.supersample = supersample;
            if filtered {
                renderer.filters.extend(denoise(&camera, &renderer.grid, Sampling::new(16, 1)));
                renderer.filters.push(Box::new(Refine::new(Arc::clone(&backend), Sampling::new(64, 1), 0.02)));
                renderer.filters.push(Box::new(Dilate { layers: 3 }));
            }
            let whole = renderer.volume(Aov::ALL, &Silent).unwrap().arrays;
            for (thickness, threads) in [(1, 1), (2, 3), (7, 2), (100, 1)] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let mut bytes: Vec<Vec<u8>> = vec![Vec::new(); Aov::ALL.len()];
                let add = |slab: Slab| {
                    for (bytes, array) in bytes.iter_mut().zip(&slab.arrays) {
                        array.values.extend_le_bytes(0..array.values.len(), bytes);
                    }
                    Ok::<(), ao4d::occlusion::Error>(())
                };
                pool.install(|| renderer.render(Aov::ALL, Some(thickness), &Silent, add)).unwrap();
                for (array, bytes) in whole.iter().zip(bytes) {
                    let mut expected = Vec::new();
                    array.values.extend_le_bytes(0..array.values.len(), &mut expected);
                    assert!(bytes == expected, "{D}D, {shading:?}, {}: slabs of {thickness}", array.name);
                }
            }
        }
    }
}

/// Opacity, occlusion and colour of a supersampled voxel are means over the voxels of the picture that is so much finer.
fn means<const D: usize>(supersample: usize) {
    let mut random = Random(5);
    let mut mesh = soup::<D>(&mut random, 12, false);
    // Two objects of different colours.
    let (mut front, half) = (mesh.objects[0].clone(), mesh.simplices.len() / 2);
    (mesh.objects[0].simplices, front.simplices) = (0..half, half..mesh.simplices.len());
    (mesh.objects[0].color, front.color) = ([1.0, 0.5, 0.0], [0.25, 0.75, 1.0]);
    mesh.objects.push(front);
    let backend: Arc<dyn RayBackend<D>> = Arc::new(CpuBackend::new(Tracer::new(mesh.clone())));
    // In parallel projection what is interpolated is linear in the image.
    let projection = Projection::Parallel { height: 2.0 };
    let view = View { eye: View::<D>::default().eye * 3.0, projection, ..View::default() };
    let camera = Camera::new(&view).unwrap();
    let dimensions = if D == 4 { [9, 8, 7] } else { [30, 25, 1] };
    let count = mesh.vertices.len();
    let values = (0..count).map(|i| (i % 10) as f32 / 10.0).collect();
    let estimates = Arc::new(Estimates { values, errors: vec![0.0; count], rays: 0 });
    let fine_dimensions: [usize; 3] = std::array::from_fn(|a| dimensions[a] * if a < D - 1 { supersample } else { 1 });
    let fine =
        Renderer::new(Arc::clone(&backend), camera.clone(), fine_dimensions, Shading::Smooth(Arc::clone(&estimates)));
    let mut coarse = Renderer::new(Arc::clone(&backend), camera, dimensions, Shading::Smooth(Arc::clone(&estimates)));
    coarse.supersample = supersample;
    let aovs = [Aov::Opacity, Aov::AmbientOcclusion, Aov::Rgb];
    let [fine_arrays, coarse_arrays] = [&fine, &coarse].map(|r| r.volume(&aovs, &Silent).unwrap().arrays);
    let [fine_values, coarse_values] = [fine_arrays, coarse_arrays].map(|a| [0, 1, 2].map(|i| a[i].values.to_f64()));
    let (mut partial, samples) = (0, supersample.pow(D as u32 - 1) as f64);
    let mut sums = vec![[0.0f64; 5]; coarse.grid.len()];
    for n in 0..fine.grid.len() {
        let index = fine.grid.index(n);
        let [i, j, k]: [usize; 3] = std::array::from_fn(|a| index[a] * dimensions[a] / fine_dimensions[a]);
        let sum = &mut sums[i + dimensions[0] * (j + dimensions[1] * k)];
        sum[0] += fine_values[0][n];
        sum[1] += fine_values[0][n] * fine_values[1][n];
        (0..3).for_each(|c| sum[2 + c] += fine_values[2][3 * n + c]);
    }
    for (n, [seen, occlusion, color @ ..]) in sums.into_iter().enumerate() {
        assert!((coarse_values[0][n] - seen / samples).abs() < 1e-6);
        let expected = if seen > 0.0 { occlusion / seen } else { 1.0 };
        assert!((coarse_values[1][n] - expected).abs() < 1e-5, "{} {expected}", coarse_values[1][n]);
        for (c, sum) in color.into_iter().enumerate() {
            let found = coarse_values[2][3 * n + c];
            assert!((found - sum / samples).abs() < 1e-5, "{found} {}", sum / samples);
        }
        partial += usize::from(seen > 0.0 && seen < samples);
    }
    assert!(partial > 10, "{partial} voxels at the silhouette");
}

#[test]
fn supersampled_voxels_are_means_of_what_they_show() {
    for supersample in [2, 3] {
        means::<3>(supersample);
        means::<4>(supersample);
    }
}

#[test]
fn slabs_make_up_the_picture() {
    slabs::<3>();
    slabs::<4>();
}
