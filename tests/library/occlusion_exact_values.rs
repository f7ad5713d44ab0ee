//! Ambient occlusion against values known in closed form, in 3D and 4D through the same lines.

use ao4d::accel::Tracer;
use ao4d::geometry::{Vector, Vector64};
use ao4d::mesh::{Mesh, MeshBuilder, Orientation, Surface};
use ao4d::occlusion::Estimator;
use ao4d::progress::Silent;
use ao4d::trace::cpu::{CpuBackend, estimate_at};
use ao4d::trace::{NOTHING, RayBackend, Sampler, Sampling, ShadingPoint};

fn sobol(samples: u32) -> Sampling {
    Sampling::new(samples, 1)
}

/// The values at all vertices.
fn at_vertices<const D: usize>(mesh: &Mesh<D>, sampling: Sampling) -> Vec<f32> {
    let backend = CpuBackend::new(Tracer::new(mesh.clone()));
    Estimator::Sampled(sampling).estimate(&backend, &ShadingPoint::vertices(mesh), None, &Silent).unwrap().values
}

/// The value at one point, by both engines.
fn at<const D: usize>(mesh: &Mesh<D>, point: ShadingPoint<D>, sampling: Sampling) -> f32 {
    let backend = CpuBackend::new(Tracer::new(mesh.clone()));
    let slow = estimate_at(backend.tracer(), &point, &sampling, &Silent).unwrap();
    let fast = Estimator::Sampled(sampling).estimate(&backend, &[point], None, &Silent).unwrap();
    assert_eq!(fast.values[0].to_bits(), slow.value.to_bits());
    slow.value
}

fn mesh<const D: usize>(surfaces: &[Surface<D>]) -> Mesh<D> {
    let mut builder = MeshBuilder::new();
    for (i, surface) in surfaces.iter().enumerate() {
        builder.add(&i.to_string(), [0.8; 3], surface, Orientation::Input).unwrap();
    }
    builder.finish()
}

/// The boundary of a D-simplex with one corner at the origin and the others on the axes.
fn corner_simplex<const D: usize>(size: f64) -> Surface<D> {
    let vertices = (0..=D).map(|i| Vector64::from_fn(|r, _| if i == r + 1 { size } else { 0.0 })).collect();
    let simplices = (0..=D)
        .map(|skip| {
            let mut corners = (0..=D as u32).filter(|&i| i as usize != skip);
            std::array::from_fn(|_| corners.next().unwrap())
        })
        .collect();
    Surface { vertices, simplices, normals: None }
}

/// The boundary of the cross-polytope: 2^D simplices around `centre`.
fn cross_polytope<const D: usize>(radius: f64, centre: Vector64<D>) -> Surface<D> {
    let vertices = (0..2 * D)
        .map(|i| {
            centre + Vector64::from_fn(|r, _| if r == i / 2 { radius * (1.0 - 2.0 * (i % 2) as f64) } else { 0.0 })
        })
        .collect();
    let simplices = (0..1u32 << D).map(|s| std::array::from_fn(|axis| 2 * axis as u32 + ((s >> axis) & 1))).collect();
    Surface { vertices, simplices, normals: None }
}

/// A half-hyperplane that ends at the fold x_1 = x_2 = 0, as two big simplices: the points `a * direction + ...`.
fn half_plane<const D: usize>(direction: usize, size: f64, flip: bool) -> Surface<D> {
    // In 3D: the fold is the z axis; the triangle (0, 0, -s), (0, 0, s), s * direction holds the origin in its edge.
    // The origin itself is made a vertex, so the fold's simplices are split there.
    let along = |axis: usize, s: f64| Vector64::<D>::from_fn(|r, _| if r == axis { s } else { 0.0 });
    let mut vertices = vec![Vector64::zeros(), along(direction, size)];
    for axis in 2..D {
        vertices.push(along(axis, size));
        vertices.push(along(axis, -size));
    }
    let mut simplices = Vec::new();
    for signs in 0..1u32 << (D - 2) {
        let mut simplex = [0u32; D];
        simplex[1] = 1;
        for axis in 2..D {
            simplex[axis] = 2 * (axis as u32 - 1) + ((signs >> (axis - 2)) & 1);
        }
        if (signs.count_ones() % 2 == 1) ^ flip {
            simplex.swap(0, 1);
        }
        simplices.push(simplex);
    }
    Surface { vertices, simplices, normals: None }
}

fn join<const D: usize>(a: Surface<D>, b: Surface<D>) -> Surface<D> {
    let shift = a.vertices.len() as u32;
    let mut joined = a;
    joined.vertices.extend(b.vertices);
    joined.simplices.extend(b.simplices.iter().map(|s| s.map(|v| v + shift)));
    joined
}

fn convex_bodies<const D: usize>() {
    let tilt = Vector64::<D>::from_fn(|r, _| 0.1 * r as f64 + 0.37);
    for surface in [corner_simplex::<D>(1.0), corner_simplex(3e-5), corner_simplex(7e5), cross_polytope(0.7, tilt)] {
        let mesh = mesh(&[surface]);
        assert!(mesh.objects[0].is_closed());
        for sampler in [Sampler::Sobol, Sampler::Random] {
            let values = at_vertices(&mesh, Sampling { sampler, ..sobol(4096) });
            assert!(values.iter().all(|&v| v == 1.0), "{values:?}");
        }
    }
}

#[test]
fn a_convex_closed_body_alone_is_open_at_every_vertex() {
    convex_bodies::<3>();
    convex_bodies::<4>();
}

fn closed_around<const D: usize>() {
    // A small simplex inside a cross-polytope: every ray of every one of its vertices is blocked, and the inner side
    // of the outer surface isn't seen as it faces outwards.
    let centre = Vector64::<D>::from_element(0.05);
    let mesh = mesh(&[corner_simplex(0.1), cross_polytope(1.0, centre)]);
    let values = at_vertices(&mesh, sobol(4096));
    assert!(values[..=D].iter().all(|&v| v == 0.0), "{values:?}");
    assert!(values[D + 1..].iter().all(|&v| v == 1.0), "{values:?}");
}

#[test]
fn a_point_inside_a_closed_surface_is_dark() {
    closed_around::<3>();
    closed_around::<4>();
}

fn right_angled_fold<const D: usize>() {
    // Two half-hyperplanes at 90 degrees; at the fold the normal halves the angle, and what is seen is the wedge of
    // 45 degrees about it on each side: A = sin 45 degrees, in any D.
    let open = join(half_plane::<D>(0, 1.0, false), half_plane::<D>(1, 1.0, true));
    let mesh = mesh(&[open]);
    let normal = mesh.normals[0];
    let sign = normal[0].signum();
    assert!((normal[0] - normal[1]).abs() < 1e-6 && normal.iter().skip(2).all(|x| x.abs() < 1e-6), "{normal}");
    let value = at(&mesh, ShadingPoint::Vertex(0), sobol(1 << 16));
    // Facing into the fold it is sin 45 degrees; facing out of it everything is open.
    let expected = if sign > 0.0 { std::f32::consts::FRAC_1_SQRT_2 } else { 1.0 };
    assert!((value - expected).abs() < 1e-3, "{D}: {value} {expected}");
    let mut inverted = mesh.clone();
    inverted.normals[0] = -normal;
    let value = at(&inverted, ShadingPoint::Vertex(0), sobol(1 << 16));
    let expected = if sign > 0.0 { 1.0 } else { std::f32::consts::FRAC_1_SQRT_2 };
    assert!((value - expected).abs() < 1e-3, "{D}: {value} {expected}");
}

#[test]
fn an_open_fold_of_90_degrees_shows_the_sine_of_45() {
    right_angled_fold::<3>();
    right_angled_fold::<4>();
}

fn fold_of_a_body<const D: usize>() {
    // A box with a notch, and the two walls of that notch alone: what the walls' own simplices hide at the fold is what
    // the whole body hides there, ray for ray.
    let corner = |x: f64| vec![x; D];
    let mut from = corner(-1.0);
    (from[0], from[1]) = (1.0, 1.0);
    let spec = serde_json::json!({ "cut_cube": {
        "min": corner(0.0), "max": corner(2.0), "cuts": [{ "from": from, "to": corner(3.0) }], "subdivisions": 4
    }});
    let spec: ao4d::scene::ObjectSpec = serde_json::from_value(spec).unwrap();
    let closed: Surface<D> = ao4d::scene::build_object(&spec, ".".as_ref()).unwrap();
    let mut open = closed.clone();
    open.simplices.retain(|s| {
        let points = s.map(|v| closed.vertices[v as usize]);
        (0..2).any(|axis| points.iter().all(|p| p[axis] == 1.0 && p[1 - axis] >= 1.0))
    });
    assert!(!open.simplices.is_empty() && open.simplices.len() < closed.simplices.len() / 2);
    let (closed, open) = (mesh(&[closed]), mesh(&[open]));
    assert!(closed.objects[0].is_closed() && !open.objects[0].is_closed());
    let values = [&closed, &open].map(|m| at_vertices(m, sobol(4096)));
    let mut folds = 0;
    for (v, p) in closed.vertices.iter().enumerate() {
        // On the fold, and not at its ends, where the body has another face.
        if p[0] == 1.0 && p[1] == 1.0 && (2..D).all(|axis| p[axis] > 0.0 && p[axis] < 2.0) {
            folds += 1;
            assert_eq!(values[0][v], values[1][v], "{D}D, at {p}");
            assert!(values[0][v] > 0.70 && values[0][v] < 0.9, "{}", values[0][v]);
        }
    }
    assert_eq!(folds, 3usize.pow(D as u32 - 2));
}

#[test]
fn a_fold_has_the_same_value_open_and_as_part_of_a_body() {
    fold_of_a_body::<3>();
    fold_of_a_body::<4>();
}

fn ball_above<const D: usize>() {
    // A tessellated ball of radius r at distance d straight above a point takes (r/d)^(D-1), bracketed by the balls
    // inside and around the tessellation.
    let (r, d) = (1.0f64, 2.5f64);
    let centre = Vector64::<D>::from_fn(|i, _| if i == D - 1 { d } else { 0.0 });
    let mut ball = cross_polytope(1.0, Vector64::zeros());
    for _ in 0..if D == 3 { 5 } else { 4 } {
        ball = bisect(ball);
    }
    let inradius = (ball.simplices.iter())
        .map(|s| {
            let points: [Vector64<D>; D] = s.map(|v| ball.vertices[v as usize]);
            let normal: Vector64<D> = ao4d::geometry::normal_of(&points);
            (normal.dot(&points[0]) / normal.norm()).abs()
        })
        .fold(f64::INFINITY, f64::min);
    ball.vertices.iter_mut().for_each(|v| *v = *v * r + centre);
    let mesh = mesh(&[ball]);
    let up = Vector::<D>::from_fn(|i, _| if i == D - 1 { 1.0 } else { 0.0 });
    let point = ShadingPoint::Inside { position: Vector::zeros(), normal: up, simplex: NOTHING, number: 3 };
    let value = f64::from(at(&mesh, point, sobol(1 << 16)));
    let power = D as i32 - 1;
    let (most, least) = ((r / d).powi(power), (r * inradius / d).powi(power));
    assert!(1.0 - value <= most + 5e-4 && 1.0 - value >= least - 5e-4, "{D}: {} in [{least}, {most}]", 1.0 - value);
    assert!(most - least < 0.02, "the bracket is too wide to mean anything: {least} {most}");
}

/// Halves the longest edge of every simplex, all of them alike, and puts the new points on the unit sphere.
fn bisect<const D: usize>(surface: Surface<D>) -> Surface<D> {
    let mut fine = surface;
    for _ in 0..D - 1 {
        let mut simplices = Vec::new();
        let mut middles = std::collections::BTreeMap::new();
        for simplex in fine.simplices.clone() {
            let length = |a: usize, b: usize| {
                (fine.vertices[simplex[a] as usize] - fine.vertices[simplex[b] as usize]).norm_squared()
            };
            let pairs = (0..D).flat_map(|a| (a + 1..D).map(move |b| (a, b)));
            let (a, b) = pairs.max_by(|&p, &q| length(p.0, p.1).total_cmp(&length(q.0, q.1))).unwrap();
            let key = (simplex[a].min(simplex[b]), simplex[a].max(simplex[b]));
            let middle = *middles.entry(key).or_insert_with(|| {
                let point = fine.vertices[key.0 as usize] + fine.vertices[key.1 as usize];
                fine.vertices.push(point.normalize());
                fine.vertices.len() as u32 - 1
            });
            for end in [a, b] {
                let mut half = simplex;
                half[end] = middle;
                simplices.push(half);
            }
        }
        fine.simplices = simplices;
    }
    fine
}

#[test]
fn a_ball_takes_its_projected_share() {
    ball_above::<3>();
    ball_above::<4>();
}

fn wall<const D: usize>() {
    // A wall at a right angle, its size 1e4 of the distance: half of the hemisphere.
    let mut wall = half_plane::<D>(0, 3e4, false);
    let other = half_plane::<D>(0, -3e4, false);
    wall = join(wall, other);
    // The wall is the hyperplane x_2 = 0; stand beside it at x_2 = 1, looking along x_1.
    let mesh = mesh(&[wall]);
    let position = Vector::<D>::from_fn(|i, _| if i == 1 { 1.0 } else { 0.25 });
    let normal = Vector::<D>::from_fn(|i, _| if i == 0 { 1.0 } else { 0.0 });
    let point = ShadingPoint::Inside { position, normal, simplex: NOTHING, number: 9 };
    let value = at(&mesh, point, sobol(1 << 16));
    assert!((value - 0.5).abs() < 1e-3, "{D}: {value}");
}

#[test]
fn a_wall_at_a_right_angle_takes_half() {
    wall::<3>();
    wall::<4>();
}

fn symmetric<const D: usize>() {
    // Two equal bodies, mirror images of each other: the values are equal up to sampling.
    let apart = Vector64::<D>::from_fn(|i, _| if i == 0 { 0.8 } else { 0.0 });
    let mesh = mesh(&[cross_polytope(0.7, apart), cross_polytope(0.7, -apart)]);
    let values = at_vertices(&mesh, sobol(1 << 14));
    let half = values.len() / 2;
    assert!(values.iter().any(|&v| v < 0.99) && values.contains(&1.0), "{values:?}");
    for (i, &value) in values[..half].iter().enumerate() {
        // The mirror exchanges the two vertices on axis 0.
        let mirrored = half + if i < 2 { 1 - i } else { i };
        assert!((value - values[mirrored]).abs() < 2e-3, "{D} {i}: {value} {}", values[mirrored]);
    }
}

#[test]
fn mirrored_scenes_have_mirrored_values() {
    symmetric::<3>();
    symmetric::<4>();
}
