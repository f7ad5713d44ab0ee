//! The hierarchy against testing every simplex; closed surfaces against leaks; pictures against projections.

use std::sync::Arc;

use ao4d::accel::Tracer;
use ao4d::geometry::{Cone, Expansion, Ray, Vector, Vector64, normal_of, widen};
use ao4d::mesh::{Crease, Gloss, Mesh, MeshBuilder, Orientation, Surface};
use ao4d::occlusion::{Estimates, Estimator};
use ao4d::progress::Silent;
use ao4d::render::filters::denoise::Refine;
use ao4d::render::filters::{Dilate, ImageFilter, denoise};
use ao4d::render::tone::{to_linear, to_screen};
use ao4d::render::visibility::Method;
use ao4d::render::{
    Accuracy, Aov, Camera, DepthCue, Light, Lighting, Projection, Renderer, Shading, Slab, Source, View, Visibility,
};
use ao4d::trace::cpu::{CpuBackend, ScalarBackend};
use ao4d::trace::{NOTHING, RayBackend, Sampling, ShadingPoint};
use ao4d::volume::Values;

use crate::support::{Random, mesh};

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

/// One light far away and one at a point, a highlight and a depth cue.
fn two_lights<const D: usize>() -> Lighting<D> {
    let far = Vector64::from_fn(|r, _| [0.5, -0.25, 0.125, -1.0][if r == D - 1 { 3 } else { r }]);
    let lights = vec![
        Light { source: Source::Directional(far), strength: [0.6, 0.5, 0.4] },
        Light { source: Source::Point(Vector64::from_fn(|r, _| [0.9, 0.7, -0.4, 0.5][r])), strength: [0.1, 0.3, 0.8] },
    ];
    let depth_cue = Some(DepthCue { near: 2.0, far: 9.0, color: [0.25, 0.5, 1.0] });
    let mut lighting = Lighting::new(lights, 0.2);
    (lighting.specular, lighting.shininess, lighting.depth_cue) = (0.3, 12.0, depth_cue);
    lighting
}

/// A box floats over a floor, across the last axis; the eye is above.
const BOX: [[f64; 2]; 2] = [[-0.5, 0.5], [-0.9, -0.6]];
const FLOOR: f64 = -1.5;

fn floor_and_box<const D: usize>() -> Arc<dyn RayBackend<D>> {
    let mut builder = MeshBuilder::new();
    for (name, [across, along]) in [("floor", [[-9.0, 9.0], [-2.0, FLOOR]]), ("box", BOX)] {
        let mut surface = cube::<D>(0.0, 1.0);
        for vertex in &mut surface.vertices {
            for r in 0..D {
                let [low, high]: [f64; 2] = if r == D - 1 { along } else { across };
                vertex[r] = low + (high - low) * vertex[r];
            }
        }
        builder.add_creased(name, [1.0, 0.5, 0.25], &surface, Orientation::Input, Crease::Above(30.0)).unwrap();
    }
    Arc::new(CpuBackend::new(Tracer::new(builder.finish())))
}

/// How far a light's ray is from the edge of the box's shadow, negative inside: by where the ray from a point of the
/// floor enters and leaves the box's slabs.
fn outside_shadow<const D: usize>(point: &Vector64<D>, way: &Vector64<D>) -> f64 {
    let (mut enter, mut leave) = (0.0f64, 1.0f64);
    for r in 0..D {
        let [low, high] = BOX[usize::from(r == D - 1)].map(|x| (x - point[r]) / way[r]);
        (enter, leave) = (enter.max(low.min(high)), leave.min(low.max(high)));
    }
    enter - leave
}

/// Lambert's cosines, highlights by half the angle, falloff, shadows and depth cues on a floor, from formulas of its own.
fn lit_floor<const D: usize>(projection: Projection) {
    let backend = floor_and_box::<D>();
    let eye = View::<D>::default().eye * 3.0;
    let camera = Camera::new(&View { eye, projection, ..View::default() }).unwrap();
    let dimensions = if D == 4 { [23, 23, 23] } else { [120, 120, 1] };
    let mut renderer = Renderer::new(backend, camera, dimensions, Shading::None);
    let lighting = two_lights::<D>();
    let (lights, cue) = (lighting.lights().to_vec(), lighting.depth_cue.unwrap());
    renderer.lighting = Some(lighting);
    let aovs = [Aov::Light, Aov::Position, Aov::Object, Aov::Depth, Aov::Rgba];
    let arrays = renderer.volume(&aovs, &Silent).unwrap().arrays;
    let [light, position, object, depth, rgba] = [0, 1, 2, 3, 4].map(|a| arrays[a].values.to_f64());
    let reflectance = [1.0, 0.5, 0.25].map(to_linear);
    let (mut shadowed, mut lit) = ([0, 0], [0, 0]);
    for n in 0..renderer.grid.len() {
        for (c, &light) in light[3 * n..3 * n + 3].iter().enumerate() {
            assert!((rgba[4 * n + c] - to_screen(light) * 255.0).abs() < 0.501, "{light}");
        }
        if object[n] != 1.0 {
            continue;
        }
        let point = Vector64::<D>::from_fn(|r, _| position[D * n + r]);
        let to_eye = match projection {
            Projection::Parallel { .. } => Vector64::from_fn(|r, _| f64::from(r == D - 1)),
            Projection::Perspective { .. } => (eye - point).normalize(),
        };
        let mut sum = reflectance.map(|c| 0.2 * c);
        let mut edge = f64::INFINITY;
        for (l, light) in lights.iter().enumerate() {
            // Of a light far away: as long as the way over the box.
            let way = match light.source {
                Source::Directional(direction) => -direction * 3.0,
                Source::Point(place) => place - point,
            };
            let outside = outside_shadow(&point, &way);
            edge = edge.min(outside.abs());
            if outside < 0.0 {
                shadowed[l] += 1;
                continue;
            }
            lit[l] += 1;
            let towards = way.normalize();
            let falloff = match light.source {
                Source::Directional(_) => 1.0,
                Source::Point(_) if D == 3 => 1.0 / way.norm_squared(),
                Source::Point(_) => 1.0 / way.norm_squared().powf(1.5),
            };
            // The halfway vector has the height of both together, over twice the cosine of half their angle.
            let half = ((1.0 + towards.dot(&to_eye)) / 2.0).sqrt();
            let highlight = 0.3 * ((towards[D - 1] + to_eye[D - 1]) / (2.0 * half)).powi(12);
            for c in 0..3 {
                sum[c] += light.strength[c] * falloff * (reflectance[c] * towards[D - 1] + highlight);
            }
        }
        if edge < 1e-4 {
            continue;
        }
        let left = ((cue.far - depth[n]) / (cue.far - cue.near)).clamp(0.0, 1.0);
        for c in 0..3 {
            let expected = sum[c] * left + cue.color[c] * (1.0 - left);
            assert!((light[3 * n + c] - expected).abs() < 2e-6, "{D}D, {point}: {} {expected}", light[3 * n + c]);
        }
    }
    assert!(shadowed.into_iter().chain(lit).min() > Some(30), "{shadowed:?} {lit:?}");
    assert!(renderer.lighting.as_ref().unwrap().in_vain().is_empty());

    // What objects say of their highlights counts instead of what the picture says.
    let mut mesh = (**renderer.tracer().mesh()).clone();
    let gloss = Gloss { specular: Some(0.3), shininess: Some(12.0) };
    mesh.objects.iter_mut().for_each(|object| object.gloss = gloss);
    renderer.backend = Arc::new(CpuBackend::new(Tracer::new(mesh)));
    let mut dull = two_lights::<D>();
    (dull.specular, dull.shininess) = (0.0, 100.0);
    renderer.lighting = Some(dull);
    assert_eq!(renderer.volume(&[Aov::Light], &Silent).unwrap().arrays[0].values, arrays[0].values);

    // A light in the box reaches nothing, and what is seen is as without it.
    let inside =
        Light { source: Source::Point(Vector64::from_fn(|r, _| [0.1, -0.75][usize::from(r == D - 1)])), ..lights[0] };
    renderer.lighting = Some(Lighting::new(vec![inside, lights[0]], 0.2));
    let with = renderer.volume(&[Aov::Light], &Silent).unwrap();
    assert_eq!(renderer.lighting.as_ref().unwrap().in_vain(), [0]);
    renderer.lighting = Some(Lighting::new(vec![lights[0]], 0.2));
    assert_eq!(renderer.volume(&[Aov::Light], &Silent).unwrap(), with);
}

#[test]
fn lights_follow_their_formulas() {
    for projection in [Projection::Perspective { field_of_view: 50.0 }, Projection::Parallel { height: 3.0 }] {
        lit_floor::<3>(projection);
        lit_floor::<4>(projection);
    }
}

/// A supersampled voxel has the mean light of the voxels of the finer picture, shadows' edges included, and what is mixed is
/// light, not what a screen shows of it.
fn mean_light<const D: usize>() {
    let backend = floor_and_box::<D>();
    let projection = Projection::Parallel { height: 3.0 };
    let camera = Camera::new(&View { eye: View::<D>::default().eye * 3.0, projection, ..View::default() }).unwrap();
    let dimensions = if D == 4 { [8, 8, 8] } else { [31, 31, 1] };
    let picture = |dimensions: [usize; 3], supersample: usize| {
        let mut renderer = Renderer::new(Arc::clone(&backend), camera.clone(), dimensions, Shading::None);
        (renderer.supersample, renderer.lighting) = (supersample, Some(two_lights()));
        renderer.volume(&[Aov::Light, Aov::Rgba], &Silent).unwrap()
    };
    let fine = picture(std::array::from_fn(|a| dimensions[a] * if a < D - 1 { 3 } else { 1 }), 1);
    let coarse = picture(dimensions, 3);
    let [of_fine, of_coarse] = [&fine, &coarse].map(|volume| volume.arrays[0].values.to_f64());
    let shown = coarse.arrays[1].values.to_f64();
    let mut sums = vec![[0.0f64; 3]; coarse.grid.len()];
    for n in 0..fine.grid.len() {
        let index = fine.grid.index(n);
        let [i, j, k]: [usize; 3] = std::array::from_fn(|a| index[a] * dimensions[a] / fine.grid.dimensions[a]);
        (0..3).for_each(|c| sums[i + dimensions[0] * (j + dimensions[1] * k)][c] += of_fine[3 * n + c]);
    }
    for (n, sum) in sums.into_iter().enumerate() {
        for (c, sum) in sum.into_iter().enumerate() {
            let expected = sum / 3f64.powi(D as i32 - 1);
            assert!((of_coarse[3 * n + c] - expected).abs() < 2e-6, "{D}D: {} {expected}", of_coarse[3 * n + c]);
            assert!((shown[4 * n + c] - to_screen(expected) * 255.0).abs() < 0.501);
        }
    }
}

#[test]
fn light_is_averaged_before_the_tone_curve() {
    mean_light::<3>();
    mean_light::<4>();
}

/// A convex body throws no shadow onto itself, even where voxels see the very edges between its coplanar simplices, and
/// points are rounded.
fn no_acne<const D: usize>() {
    let mut lit = 0;
    for (step, offset) in [0.0, 0.3, 7.7, 1234.5].into_iter().enumerate() {
        let turned = |v: Vector64<D>| {
            let mut v = v;
            for axis in 0..D - 1 {
                let (sin, cos) = (0.3 + 0.4 * (step + axis) as f64).sin_cos();
                (v[axis], v[D - 1]) = (cos * v[axis] - sin * v[D - 1], sin * v[axis] + cos * v[D - 1]);
            }
            v
        };
        let centre = Vector64::<D>::repeat(offset);
        let mut surface = cube::<D>(-0.7, 0.7);
        surface.vertices.iter_mut().for_each(|v| *v = turned(*v) + centre);
        let mut builder = MeshBuilder::new();
        builder.add_creased("cube", [1.0; 3], &surface, Orientation::Input, Crease::Above(30.0)).unwrap();
        let backend: Arc<dyn RayBackend<D>> = Arc::new(CpuBackend::new(Tracer::new(builder.finish())));
        let axis = |a: usize| Vector64::from_fn(|r, _| f64::from(r == a));
        let camera = Camera::new(&View {
            projection: Projection::Parallel { height: 1.3 },
            eye: turned(axis(D - 1) * 3.0) + centre,
            target: centre,
            up: turned(axis(1)),
            over: turned(axis(2)),
        })
        .unwrap();
        let dimensions = if D == 4 { [21, 21, 21] } else { [101, 101, 1] };
        let mut renderer = Renderer::new(backend, camera, dimensions, Shading::None);
        for share in [0.01, 0.3, 4.0] {
            let towards = turned(Vector64::from_fn(|r, _| [0.8, -0.5, 0.3, share][if r == D - 1 { 3 } else { r }]));
            let light = Light { source: Source::Directional(-towards), strength: [1.0; 3] };
            renderer.lighting = Some(Lighting::new(vec![light], 0.0));
            let cosine = towards.normalize().dot(&turned(axis(D - 1)));
            for light in renderer.volume(&[Aov::Light], &Silent).unwrap().arrays[0].values.to_f64() {
                assert!((light - cosine).abs() < 1e-6 + 1e-6 * offset, "{D}D, {offset}, {share}: {light} {cosine}");
                lit += 1;
            }
        }
    }
    assert!(lit > 10_000);
}

#[test]
fn convex_bodies_throw_no_shadow_onto_themselves() {
    no_acne::<3>();
    no_acne::<4>();
}

/// A bowl so shallow that nothing in it is darker than 0.97, cut along diagonals on which lie centres of voxels.
fn shallow_bowl<const D: usize>() {
    let cells = 6usize;
    let node = |at: [usize; 3]| (0..D - 1).rev().fold(0, |n, axis| n * (cells + 1) + at[axis]) as u32;
    let places = |cells: usize| {
        let last = if D == 4 { cells } else { 1 };
        (0..last).flat_map(move |k| (0..cells).flat_map(move |j| (0..cells).map(move |i| [i, j, k])))
    };
    let vertices = places(cells + 1).map(|at| {
        let across = Vector64::<D>::from_fn(|r, _| if r < D - 1 { at[r] as f64 * 0.4 - 1.2 } else { 0.0 });
        across + Vector64::from_fn(|r, _| if r == D - 1 { 0.01 * across.norm_squared() - 0.5 } else { 0.0 })
    });
    let mut simplices = Vec::new();
    for cell in places(cells) {
        let orders: &[&[usize]] = match D {
            3 => &[&[0, 1], &[1, 0]],
            _ => &[&[0, 1, 2], &[0, 2, 1], &[1, 0, 2], &[1, 2, 0], &[2, 0, 1], &[2, 1, 0]],
        };
        for order in orders {
            let mut at = cell;
            let corners: Vec<u32> = std::iter::once(None)
                .chain(order.iter().map(Some))
                .map(|axis| {
                    axis.into_iter().for_each(|&axis| at[axis] += 1);
                    node(at)
                })
                .collect();
            simplices.push(std::array::from_fn(|corner| corners[corner]));
        }
    }
    let surface = Surface { vertices: vertices.collect(), simplices, normals: None };
    let camera = Camera::new(&View::default()).unwrap();
    let mut builder = MeshBuilder::new();
    builder.add("bowl", [1.0; 3], &surface, Orientation::Facing(camera.viewpoint())).unwrap();
    let backend: Arc<dyn RayBackend<D>> = Arc::new(CpuBackend::new(Tracer::new(builder.finish())));
    let shading = Shading::Voxel(Estimator::Sampled(Sampling::new(64, 1)));
    let mut renderer = Renderer::new(backend, camera, if D == 4 { [20, 20, 20] } else { [20, 20, 1] }, shading);
    let toward = Vector64::from_fn(|r, _| f64::from(r == D - 1));
    renderer.lighting = None;
    let volume = renderer.volume(&[Aov::AmbientOcclusion, Aov::Opacity], &Silent).unwrap();
    let [occlusion, opacity] = [0, 1].map(|array: usize| volume.arrays[array].values.to_f64());
    let seen: Vec<f64> = occlusion.iter().zip(&opacity).filter(|(_, o)| **o > 0.0).map(|(a, _)| *a).collect();
    assert!(seen.len() > 200, "{D}D: {}", seen.len());
    let darkest = seen.iter().copied().fold(1.0, f64::min);
    assert!(darkest > 0.9, "{D}D: {darkest}");
    // The light from straight above reaches them all.
    let light = Light { source: Source::Directional(-toward), strength: [1.0; 3] };
    renderer.lighting = Some(Lighting::new(vec![light], 0.0));
    let volume = renderer.volume(&[Aov::Light, Aov::Opacity], &Silent).unwrap();
    let [light, opacity] = [0, 1].map(|array: usize| volume.arrays[array].values.to_f64());
    for (light, _) in light.chunks(3).zip(&opacity).filter(|(_, o)| **o > 0.0) {
        assert!(light[0] > 0.99, "{D}D: {light:?}");
    }
}

#[test]
fn voxels_on_facets_are_not_darkened_by_neighbours() {
    shallow_bowl::<3>();
    shallow_bowl::<4>();
}

/// A picture is the same bytes however thick its slabs are, and on however many threads it is made.
fn slabs<const D: usize>(opacity: f32) {
    let mut random = Random(3);
    let mut mesh = soup::<D>(&mut random, 30, false);
    mesh.objects[0].opacity = opacity;
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
            // Every other picture is lit.
            if supersample == 2 {
                renderer.lighting = Some(two_lights());
            }
            if filtered {
                renderer.filters.extend(denoise(&camera, &renderer.grid, Sampling::new(16, 1)));
                renderer.filters.push(Box::new(Refine::new(Arc::clone(&backend), Sampling::new(64, 1), 0.02)));
                renderer.filters.push(Box::new(Dilate { layers: 3 }));
            }
            renderer.layers = 2;
            let whole = renderer.volume(Aov::ALL, &Silent).unwrap().arrays;
            for (thickness, threads) in [(1, 1), (2, 3), (7, 2), (100, 1)] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let mut bytes: Vec<Vec<u8>> = vec![Vec::new(); whole.len()];
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
    slabs::<3>(1.0);
    slabs::<4>(1.0);
    slabs::<3>(0.4);
    slabs::<4>(0.4);
}

/// A box over a floor, and what a camera sees of it.
fn seen_boxes<const D: usize>(shading: Shading, more: impl FnOnce(&mut Renderer<D>)) -> (Vec<f64>, Option<Accuracy>) {
    let backend = floor_and_box::<D>();
    let camera = Camera::new(&View { eye: View::<D>::default().eye * 3.0, ..View::default() }).unwrap();
    let mut renderer = Renderer::new(backend, camera, if D == 4 { [20, 20, 20] } else { [70, 70, 1] }, shading);
    more(&mut renderer);
    let depth = renderer.grid.dimensions[2];
    let mut values = Vec::new();
    let keep = |slab: Slab| {
        values = slab.arrays[0].values.to_f64();
        Ok::<(), ao4d::occlusion::Error>(())
    };
    let accuracy = renderer.render(&[Aov::AmbientOcclusion], Some(depth), &Silent, keep).unwrap();
    (values, accuracy)
}

fn pictures_measure_themselves<const D: usize>() {
    let vertices = floor_and_box::<D>().tracer().mesh().vertices.len();
    let constant = |value: f32| Estimates { values: vec![value; vertices], errors: vec![0.0; vertices], rays: 0 };
    let smooth = |value: f32| Shading::Smooth(Arc::new(constant(value)));
    let by_rays = |rays| Estimator::Sampled(Sampling::new(rays, 5));
    let audit = |renderer: &mut Renderer<D>| renderer.audit = Some(Sampling::new(256, 77));
    assert_eq!(seen_boxes::<D>(smooth(1.0), |_| ()).1, None, "nobody asked");
    // Held against all voxels and many rays, what 512 of them say is right to a tenth, and to 0.003, below which the noise of
    // the rays that look again is not known well enough.
    let (truth, none) = seen_boxes::<D>(Shading::Voxel(by_rays(4096)), |_| ());
    assert_eq!(none, None);
    let (covered, _) = seen_boxes::<D>(smooth(0.0), |_| ());
    let seen: Vec<usize> = (0..truth.len()).filter(|&n| covered[n] == 0.0).collect();
    let rms =
        |values: &[f64]| (seen.iter().map(|&n| (values[n] - truth[n]).powi(2)).sum::<f64>() / seen.len() as f64).sqrt();
    for (name, shading) in [
        ("open", smooth(1.0)),
        ("half", smooth(0.5)),
        ("eight rays", Shading::Voxel(by_rays(8))),
        ("many rays", Shading::Voxel(by_rays(1024))),
    ] {
        let (values, accuracy) = seen_boxes::<D>(shading, audit);
        let (found, real) = (accuracy.unwrap(), rms(&values));
        assert_eq!(found.voxels, 512.min(seen.len()));
        let room = 0.12 * real + 0.003;
        assert!((found.rms - real).abs() < room, "{D}D, {name}: measured {}, is {real}", found.rms);
        assert!(found.largest >= found.rms && found.largest <= 1.0, "{D}D, {name}: {found:?}");
    }
    // Few rays beside wrong values at vertices, denoised; and more rays where those are not enough.
    let auto = |tolerance: Option<f64>| {
        let shading = Shading::Auto(Arc::new(constant(1.0)), by_rays(4));
        seen_boxes::<D>(shading, |renderer| {
            renderer.filters.extend(denoise(&renderer.camera, &renderer.grid, Sampling::new(4, 5)));
            let most = Sampling::new(1024, 5);
            let refine = |t| Box::new(Refine::new(Arc::clone(&renderer.backend), most, t)) as Box<dyn ImageFilter<D>>;
            renderer.filters.extend(tolerance.map(refine));
        })
        .0
    };
    let [few, loose, tight] = [None, Some(0.02), Some(0.005)].map(|tolerance| rms(&auto(tolerance)));
    assert!(loose < 0.02 && tight < 0.006 && tight < 0.7 * few, "{D}D: {few} {loose} {tight}");
}

#[test]
fn pictures_tell_how_far_off_they_are_and_keep_to_a_tolerance() {
    pictures_measure_themselves::<3>();
    pictures_measure_themselves::<4>();
}

/// A simplex across the last axis, so large that it covers what a camera there sees.
fn sheet<const D: usize>(at: f64) -> Surface<D> {
    let corner = |i: usize| {
        Vector64::from_fn(|r, _| match (r, i) {
            (r, _) if r == D - 1 => at,
            (_, i) if i == D - 1 => -30.0,
            (r, i) => {
                if r == i {
                    30.0
                } else {
                    0.0
                }
            }
        })
    };
    Surface {
        vertices: (0..D).map(corner).collect(),
        simplices: vec![std::array::from_fn(|i| i as u32)],
        normals: None,
    }
}

/// A scene of surfaces, each of its own opacity and colour.
fn objects<const D: usize>(all: &[(&Surface<D>, f32, [f32; 3])]) -> Mesh<D> {
    let mut builder = MeshBuilder::new();
    for (i, (surface, opacity, color)) in all.iter().enumerate() {
        builder.add(&format!("{i}"), *color, surface, Orientation::Input).unwrap();
        builder.set_opacity(*opacity);
    }
    builder.finish()
}

/// What light passes, against what is known: sums over the same rays.
fn passing_light<const D: usize>() {
    let white = [1.0; 3];
    let mut random = Random(77);
    let ground = random.soup::<D>(12, 0.5, false);
    // A wall that each ray passes once at most, and a closed body that it passes twice.
    let wall = Surface {
        vertices: (0..D).map(|_| random.point::<D>(false) + Vector64::from_fn(|_, _| 0.4)).collect(),
        simplices: vec![std::array::from_fn(|i| i as u32)],
        normals: None,
    };
    let corners: Vec<Vector64<D>> =
        (0..=D).map(|i| Vector64::from_fn(|r, _| if i < D && r == i { 1.1 } else { -0.4 })).collect();
    let facets = (0..=D).map(|skip| {
        let mut others = (0..=D as u32).filter(|&v| v as usize != skip);
        std::array::from_fn(|_| others.next().unwrap())
    });
    let body = Surface { vertices: corners, simplices: facets.collect(), normals: None };
    let sampling = Sampling::new(256, 3);
    let values = |mesh: Mesh<D>| {
        let [packets, slow]: [Arc<dyn RayBackend<D>>; 2] = [
            Arc::new(CpuBackend::new(Tracer::new(mesh.clone()))),
            Arc::new(ScalarBackend::new(Tracer::new(mesh.clone()))),
        ];
        // Points in space, each seeing into another direction, and the vertices.
        let point = |i: u64| {
            let mut random = Random(i as u32 + 1);
            let normal = random.point::<D>(false).normalize().map(|x| x as f32);
            let position = random.point::<D>(false).map(|x| 1.5 * x as f32);
            ShadingPoint::Inside { position, normal, simplex: NOTHING, number: i }
        };
        let vertices = ShadingPoint::vertices(&mesh);
        let points: Vec<ShadingPoint<D>> = (0..200).map(point).chain(vertices.into_iter().take(12 * D)).collect();
        let found = Estimator::Sampled(sampling).estimate(&*packets, &points, None, &Silent).unwrap();
        let again = Estimator::Adaptive(sampling).estimate(&*slow, &points, None, &Silent).unwrap();
        assert!(!mesh.is_translucent() || found == again);
        found
    };
    let open = values(objects(&[(&ground, 0.0, white)]));
    assert!(open.values.iter().all(|&value| value == 1.0));
    for (occluder, surfaces) in [(&wall, 1), (&body, 2)] {
        let with = |opacity: f32| values(objects(&[(occluder, opacity, white)]));
        let (whole, half) = (with(1.0), with(0.5));
        let mut between = 0;
        for (&opaque, &half) in whole.values.iter().zip(&half.values).take(200) {
            // Where a ray starts inside the body it leaves it only.
            let let_through: &[f32] = if surfaces == 1 { &[0.5] } else { &[0.25, 0.5] };
            assert!(let_through.iter().any(|&share| half == opaque + share * (1.0 - opaque)), "{D}D: {opaque} {half}");
            between += usize::from(opaque > 0.0 && opaque < 1.0);
        }
        assert!(between > 5, "{D}D: {between}");
    }
    // Among others, and for vertices too: 0 is as good as not there, 1 is as it always was, whatever light passes elsewhere.
    let far = Surface {
        vertices: sheet::<D>(0.0).vertices.iter().map(|v| v * 1e-3 + Vector64::from_element(9e3)).collect(),
        ..sheet(0.0)
    };
    let alone = values(objects(&[(&ground, 1.0, white)]));
    let without = values(objects(&[(&ground, 1.0, white), (&body, 0.0, white), (&wall, 0.0, white)]));
    assert_eq!(alone, without);
    let all = [(&ground, 1.0, white), (&body, 1.0, white), (&wall, 1.0, white)];
    let opaque = values(objects(&all));
    assert!(opaque.values.iter().zip(&alone.values).any(|(a, b)| a < b));
    let beside = objects(&[all.to_vec(), vec![(&far, 0.5, white)]].concat());
    assert!(beside.is_translucent());
    assert_eq!(opaque, values(beside));
    // The closed form knows nothing of it, and says so.
    let mesh = objects(&[(&ground, 1.0, white), (&wall, 0.5, white)]);
    let backend = CpuBackend::new(Tracer::new(mesh.clone()));
    let exact = Estimator::Exact(Default::default()).estimate(&backend, &ShadingPoint::vertices(&mesh), None, &Silent);
    assert_eq!(exact, Err(ao4d::occlusion::Error::Translucent));
}

#[test]
fn light_passes_objects_in_the_share_they_say() {
    passing_light::<3>();
    passing_light::<4>();
}

/// Three sheets, one behind the other, and nothing behind them.
fn blended<const D: usize>() {
    let [near, middle, far] = [0.0, -0.5, -1.0].map(sheet::<D>);
    let [red, green, blue] = [[0.9, 0.2, 0.1], [0.1, 0.8, 0.3], [0.2, 0.1, 0.7]];
    let dimensions = if D == 4 { [5, 4, 3] } else { [6, 5, 1] };
    let camera = Camera::new(&View::default()).unwrap();
    let picture = |mesh: Mesh<D>, supersample: usize, lighting: Option<Lighting<D>>| {
        let backend: Arc<dyn RayBackend<D>> = Arc::new(CpuBackend::new(Tracer::new(mesh)));
        let mut renderer = Renderer::new(backend, camera.clone(), dimensions, Shading::None);
        (renderer.supersample, renderer.lighting, renderer.layers) = (supersample, lighting, 4);
        let aovs =
            [Aov::Rgba, Aov::Opacity, Aov::Coverage, Aov::Light, Aov::Rgb, Aov::Depth, Aov::Layers, Aov::LayerDepth];
        let arrays = renderer.volume(&aovs, &Silent).unwrap().arrays;
        arrays
            .into_iter()
            .map(|array| (array.name, array.values.to_f64()))
            .collect::<std::collections::BTreeMap<_, _>>()
    };
    let close = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-6, "{D}D: {found} {expected}");
    for (opacities, supersample) in
        [([0.25, 0.5, 1.0], 1), ([0.25, 0.5, 0.75], 2), ([0.0, 0.5, 0.5], 1), ([1.0, 0.5, 0.5], 3)]
    {
        let all = [(&near, opacities[0], red), (&middle, opacities[1], green), (&far, opacities[2], blue)];
        let [a, b, c] = opacities.map(f64::from);
        let weights = [a, (1.0 - a) * b, (1.0 - a) * (1.0 - b) * c];
        let opacity: f64 = weights.iter().sum();
        let plain = picture(objects(&all), supersample, None);
        let lit = picture(objects(&all), supersample, Some(Lighting::new(Vec::new(), 1.0)));
        for n in 0..dimensions.iter().product() {
            close(plain["opacity"][n], opacity);
            close(plain["coverage"][n], 1.0);
            assert_eq!(plain["layers"][n], 3.0);
            if supersample == 1 {
                assert_eq!(plain["depth"][n], plain["depth_1"][n]);
            }
            let slant = plain["depth_1"][n];
            for (name, distance) in [("depth_2", 1.5), ("depth_3", 2.0)] {
                assert!((plain[name][n] - distance * slant).abs() < 1e-5);
            }
            assert_eq!(plain["depth_4"][n], f64::INFINITY);
            for k in 0..3 {
                let mean = |curve: &dyn Fn(f64) -> f64| {
                    let colors = [red, green, blue].map(|color| curve(f64::from(color[k])));
                    colors.iter().zip(weights).map(|(color, weight)| color * weight).sum::<f64>() / opacity
                };
                close(plain["rgb"][3 * n + k], mean(&|color| color) * opacity + 1.0 - opacity);
                assert!((plain["rgba"][4 * n + k] - 255.0 * mean(&|color| color)).abs() < 0.51);
                close(lit["light"][3 * n + k], mean(&to_linear));
                close(lit["rgb"][3 * n + k], to_screen(mean(&to_linear)) * opacity + 1.0 - opacity);
            }
        }
    }
}

#[test]
fn what_is_behind_shows_through() {
    blended::<3>();
    blended::<4>();
}

/// A light behind a sheet of 0.75 lights a wall with a quarter of its strength.
fn thinned_shadow<const D: usize>() {
    let [wall, between] = [0.0, 0.5].map(sheet::<D>);
    let camera = Camera::new(&View { eye: View::<D>::default().eye * 0.25, ..View::default() }).unwrap();
    let dimensions = if D == 4 { [5, 4, 3] } else { [6, 5, 1] };
    let light = |opacity: f32| {
        let backend: Arc<dyn RayBackend<D>> =
            Arc::new(CpuBackend::new(Tracer::new(objects(&[(&wall, 1.0, [1.0; 3]), (&between, opacity, [1.0; 3])]))));
        let mut renderer = Renderer::new(backend, camera.clone(), dimensions, Shading::None);
        let down = Source::Directional(-View::<D>::default().eye);
        renderer.lighting = Some(Lighting::new(vec![Light { source: down, strength: [1.0; 3] }], 0.0));
        renderer.volume(&[Aov::Light], &Silent).unwrap().arrays[0].values.to_f64()
    };
    for (opacity, expected) in [(1.0, 0.0), (0.75, 0.25), (0.0, 1.0)] {
        assert!(light(opacity).iter().all(|&found| (found - expected).abs() < 1e-6), "{D}D: {:?}", light(opacity));
    }
}

#[test]
fn shadows_of_what_light_passes_are_thin() {
    thinned_shadow::<3>();
    thinned_shadow::<4>();
}

/// The layers of a picture with occlusion by rays: the first has the values of the picture itself.
fn shaded_layers<const D: usize>() {
    let mesh = mesh(&Random(12).soup::<D>(if D == 3 { 100 } else { 300 }, 0.9, false));
    let backend: Arc<dyn RayBackend<D>> = Arc::new(CpuBackend::new(Tracer::new(mesh.clone())));
    let camera = Camera::new(&View { eye: View::<D>::default().eye * 2.0, ..View::default() }).unwrap();
    let dimensions = if D == 4 { [9, 8, 7] } else { [30, 25, 1] };
    let estimates = Estimates {
        values: (0..mesh.vertices.len()).map(|i| (i % 10) as f32 / 10.0).collect(),
        errors: vec![0.0; mesh.vertices.len()],
        rays: 0,
    };
    let by_rays = Estimator::Sampled(Sampling::new(32, 1));
    for shading in [Shading::Smooth(Arc::new(estimates)), Shading::Voxel(by_rays)] {
        let mut renderer = Renderer::new(Arc::clone(&backend), camera.clone(), dimensions, shading.clone());
        renderer.layers = 2;
        let volume = renderer.volume(Aov::ALL, &Silent).unwrap();
        let values = |name: &str| volume.array(name).unwrap_or_else(|| panic!("{name}")).values.to_f64();
        for name in ["depth", "object", "ambient_occlusion", "normal"] {
            assert_eq!(values(name), values(&format!("{name}_1")), "{D}D, {shading:?}: {name}");
        }
        let counts = values("layers");
        assert!(counts.iter().any(|&count| count > 2.0));
        for layer in 1..=2 {
            let [depth, object, side, occlusion] =
                ["depth", "object", "side", "ambient_occlusion"].map(|name| values(&format!("{name}_{layer}")));
            for n in 0..counts.len() {
                let there = counts[n] >= f64::from(layer);
                assert_eq!((depth[n].is_finite(), object[n] > 0.0, side[n] != 0.0), (there, there, there));
                assert!(there || occlusion[n] == 1.0);
                let before = if layer > 1 { values(&format!("depth_{}", layer - 1))[n] } else { 0.0 };
                assert!(depth[n] >= before);
            }
        }
        // What a point in a later layer has is what is asked for there.
        if let Shading::Voxel(estimator) = shading {
            let (depth, side) = (values("depth_2"), values("ambient_occlusion_2"));
            let grid = renderer.grid;
            let passages = Visibility::new(Arc::clone(&backend), &camera, &grid, Method::Auto)
                .passages(0..dimensions[2], 2, &Silent)
                .unwrap();
            let n = (0..counts.len()).find(|&n| passages.of(n).len() == 2 && side[n] < 1.0).unwrap();
            let (ray, simplex) = (camera.voxel_ray(&grid, grid.index(n)), passages.of(n)[1].simplex);
            let normal = normal_of(&mesh.corners(simplex).map(|v| widen(&v)));
            let normal = normal * -normal.dot(&widen(&ray.direction)).signum() / normal.norm();
            let point = widen(&ray.origin) + widen(&ray.direction) * (depth[n] / widen(&ray.direction).norm());
            let point = ShadingPoint::Inside {
                position: point.map(|x| x as f32),
                normal: normal.map(|x| x as f32),
                simplex,
                number: (grid.len() + n) as u64,
            };
            let found = estimator.estimate(&*backend, &[point], None, &Silent).unwrap().values[0];
            assert!((f64::from(found) - side[n]).abs() <= 1.0 / 32.0, "{D}D: {found} {}", side[n]);
        }
    }
}

#[test]
fn layers_are_shaded_as_the_picture_is() {
    shaded_layers::<3>();
    shaded_layers::<4>();
}
