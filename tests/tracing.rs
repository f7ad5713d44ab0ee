//! The hierarchy against testing every simplex; closed surfaces against leaks; pictures against projections.

use ao4d::accel::Tracer;
use ao4d::geometry::{Cone, Expansion, Ray, Vector, Vector64};
use ao4d::mesh::{Mesh, Surface};
use ao4d::progress::Silent;
use ao4d::render::{Camera, Channel, Picture, Projection, Shading, View};
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
        let tracer = Tracer::new(&mesh);
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

fn no_leaks<const D: usize>() {
    let mesh = mesh(&cube::<D>(-0.3, 0.7));
    assert!(mesh.objects[0].is_closed());
    let tracer = Tracer::new(&mesh);
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
    let tracer = Tracer::new(&mesh);
    let camera = Camera::new(&View { projection, ..View::default() }).unwrap();
    let grid = camera.grid([40, 20, if D == 4 { 30 } else { 1 }]);
    let picture = Picture { tracer: &tracer, camera: camera.clone(), grid, shading: Shading::None, device: None };
    let channels = [Channel::Opacity, Channel::Depth, Channel::Object, Channel::Rgba, Channel::Normal];
    let arrays = picture.slab(0..grid.dimensions[2], &channels, &Silent).unwrap();
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

fn slabs<const D: usize>() {
    // A picture is the same however it is cut into slabs.
    let mut random = Random(3);
    let mesh = soup::<D>(&mut random, 30, false);
    let tracer = Tracer::new(&mesh);
    let view = View { eye: View::<D>::default().eye * 3.0, ..View::default() };
    let camera = Camera::new(&view).unwrap();
    let grid = camera.grid([9, 7, if D == 4 { 8 } else { 1 }]);
    let values: Vec<f32> = (0..mesh.vertices.len()).map(|i| (i % 10) as f32 / 10.0).collect();
    for shading in [Shading::Flat(&values), Shading::Smooth(&values)] {
        let picture = Picture { tracer: &tracer, camera: camera.clone(), grid, shading, device: None };
        let whole = picture.slab(0..grid.dimensions[2], &Channel::ALL, &Silent).unwrap();
        for k in 0..grid.dimensions[2] {
            let layer = picture.slab(k..k + 1, &[Channel::AmbientOcclusion], &Silent).unwrap();
            let (Values::F32(all), Values::F32(one)) = (&whole[1].values, &layer[0].values) else { panic!("type") };
            assert_eq!(&all[k * grid.layer_len()..(k + 1) * grid.layer_len()], &one[..]);
        }
    }
}

#[test]
fn slabs_make_up_the_picture() {
    slabs::<3>();
    slabs::<4>();
}
