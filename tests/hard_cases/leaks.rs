//! Rays from inside closed bodies: none may get out, by the packet tracer, at any level of instructions, or ray by ray.

use ao4d::accel::Tracer;
use ao4d::geometry::{Ray, Vector, Vector64, narrow};
use ao4d::mesh::{Mesh, Surface};
use ao4d::progress::Silent;
use ao4d::trace::cpu::{Level, PacketTracer};
use ao4d::trace::{Sampler, Sampling, ShadingPoint};
use rand::{RngExt, rngs::ChaCha8Rng};

use crate::bodies::{Body, distorted, mesh, nut, plain, random, sphere, vector};
use crate::many;

/// A direction of a length between 1/2 and 1, exactly parallel to `v`.
fn scaled<const D: usize>(v: Vector<D>) -> Vector<D> {
    let exponent = v.map(f64::from).norm().log2().floor() + 1.0;
    v.map(|x| (f64::from(x) * (-exponent).exp2()) as f32)
}

/// Directions of every kind: anywhere; at vertices, edges, triangles and facets, exactly so where coordinates are on a
/// lattice; along axes, or all but along them.
fn direction<const D: usize>(mesh: &Mesh<D>, origin: &Vector<D>, random: &mut ChaCha8Rng, kind: usize) -> Vector<D> {
    let corners = mesh.corners(random.random_range(0..mesh.simplices.len() as u32));
    let towards = |count: usize| {
        // The middle of the first corners, times their number.
        let sum = corners[..count].iter().fold(Vector::zeros(), |sum: Vector<D>, c| sum + (c - origin));
        if sum.amax() > 0.0 { scaled(sum) } else { Vector::from_element(0.5) }
    };
    match kind % 8 {
        0 => towards(1),
        1 => towards(2),
        2 => towards(D - 1),
        3 => towards(D),
        4 => {
            // On an edge at other places, by powers of two.
            let share = [1.0, 0.25, 0.125, 1.0 / 1024.0][kind / 8 % 4];
            scaled((corners[0] - origin) * (1.0 - share) + (corners[1] - origin) * share + Vector::zeros())
        }
        5 => {
            let tiny = [0.0, 1e-40, 1e-20, 1e-12, 1e-7][kind / 8 % 5];
            let axis = random.random_range(0..D);
            let sign = if random.random() { 1.0 } else { -1.0 };
            Vector::from_fn(|i, _| if i == axis { sign } else { (random.random::<f32>() - 0.5) * tiny })
        }
        _ => narrow(&vector::<D>(random).normalize()),
    }
}

/// Whether every facet belongs to an even number of simplices. Where rounding made corners one, a surface may touch itself:
/// then more than two simplices share a facet, but there still is no way out.
fn bounds_a_solid<const D: usize>(mesh: &Mesh<D>) -> bool {
    let mut around = std::collections::BTreeMap::new();
    for simplex in &mesh.simplices {
        let corners = simplex.map(|v| mesh.identity[v as usize]);
        if (0..D).any(|i| corners[i + 1..].contains(&corners[i])) {
            continue;
        }
        for opposite in 0..D {
            let mut facet: Vec<u32> = (0..D).filter(|&i| i != opposite).map(|i| corners[i]).collect();
            facet.sort_unstable();
            *around.entry(facet).or_insert(0) += 1;
        }
    }
    !around.is_empty() && around.values().all(|n| n % 2 == 0)
}

/// Counts the rays that get out of the body: by packets, and a sixteenth of them ray by ray.
fn leaks<const D: usize>(body: &Body<D>, rays: usize) -> [usize; 2] {
    let mesh = mesh(&[&body.surface]);
    assert!(bounds_a_solid(&mesh), "{}", body.name);
    let tracer = Tracer::new(mesh);
    let mesh = tracer.mesh();
    let mut random = random(1);
    let per_point = rays.div_ceil(body.inside.len()).next_multiple_of(8);
    let mut found = [0; 2];
    for origin in &body.inside {
        let directions: Vec<Vector<D>> =
            (0..per_point).map(|kind| direction(mesh, origin, &mut random, kind)).collect();
        for level in Level::available() {
            // The other levels on a part of them.
            let part = if level == Level::best() { &directions[..] } else { &directions[..per_point / 8] };
            let hit =
                PacketTracer::new(level).count_occluded(&tracer, origin, Vector::zeros(), part, f32::INFINITY, None);
            found[0] += part.len() - hit as usize;
        }
        // Eight of every 128, so that all kinds are among them.
        found[1] += (directions.chunks(128).flat_map(|block| &block[..8.min(block.len())]))
            .filter(|direction| {
                let ray = Ray::new(*origin, **direction);
                !tracer.occluded(&ray, f32::INFINITY, None) || tracer.closest_hit(&ray).is_none()
            })
            .count();
    }
    println!(
        "{D}D, {}: {} simplices, {} rays from {} points: {} and {} leaks",
        body.name,
        mesh.simplices.len(),
        per_point * body.inside.len(),
        body.inside.len(),
        found[0],
        found[1]
    );
    found
}

fn sum(found: impl IntoIterator<Item = [usize; 2]>) -> [usize; 2] {
    found.into_iter().fold([0; 2], |a, b| [a[0] + b[0], a[1] + b[1]])
}

fn out_of_plain_bodies<const D: usize>(rays: usize) {
    assert_eq!(sum(plain::<D>().iter().map(|body| leaks(body, rays))), [0, 0]);
}

#[test]
fn no_ray_leaves_a_closed_body_3d() {
    out_of_plain_bodies::<3>(many(450_000));
}

#[test]
fn no_ray_leaves_a_closed_body_4d() {
    out_of_plain_bodies::<4>(many(450_000));
    assert_eq!(leaks(&nut(), many(450_000)), [0, 0]);
}

fn out_of_distorted_bodies<const D: usize>(rays: usize) {
    assert_eq!(sum(distorted::<D>().iter().map(|body| leaks(body, rays))), [0, 0]);
}

#[test]
fn no_ray_leaves_a_distorted_body() {
    out_of_distorted_bodies::<3>(many(100_000));
    out_of_distorted_bodies::<4>(many(100_000));
}

/// Every body at every scale; far from the origin its vertices fall onto a coarse lattice, many of them onto each other.
fn out_of_placed_bodies<const D: usize>(rays: usize) {
    let places = [(1e-6, 0.0), (1e6, 0.0), (1e-30, 0.0), (1e25, 0.0), (1.0, 1e5), (1e-3, 1.0), (0.04, 1e5)];
    let bodies: Vec<Body<D>> = plain().into_iter().filter(|body| !body.name.contains("cut")).collect();
    let mut found = [0; 2];
    for (factor, offset) in places {
        for body in &bodies {
            // Only the middle stays safely inside where rounding is as large as the body.
            let mut body = body.placed(factor, offset);
            body.inside.truncate(1);
            found = sum([found, leaks(&body, rays)]);
        }
    }
    for body in distorted::<D>() {
        found = sum([found, leaks(&body.placed(3.0e-6, 0.0), rays), leaks(&body.placed(3.0e6, 0.0), rays)]);
    }
    assert_eq!(found, [0, 0]);
}

#[test]
fn no_ray_leaves_at_any_scale_or_place() {
    out_of_placed_bodies::<3>(many(25_000));
    out_of_placed_bodies::<4>(many(25_000));
}

/// Points within a closed body, and the vertices of a cavity, see nothing: not one ray of theirs escapes.
fn darkness<const D: usize>(samples: u32) {
    let mut random = random(4);
    let mut bright = 0;
    let mut points = 0;
    let mut check = |name: &str, mesh: &Mesh<D>, first: usize| {
        let tracer = Tracer::new(mesh.clone());
        for (sampler, max_distance) in [(Sampler::Sobol, f32::INFINITY), (Sampler::Random, 1e30)] {
            let sampling = Sampling { sampler, max_distance, ..Sampling::new(samples, 3) };
            for level in Level::available() {
                let mut packets = PacketTracer::new(level);
                let values: Vec<f32> = (first..mesh.vertices.len())
                    .map(|v| ShadingPoint::Vertex(v as u32))
                    .map(|point| packets.estimate(&tracer, &point, &sampling, &Silent).unwrap().value)
                    .collect();
                let wrong = values.iter().filter(|&&v| v != 0.0).count();
                points += values.len();
                bright += wrong;
                assert!(wrong == 0, "{D}D, {name}, {level:?}, {sampler:?}: {wrong} of {} are bright", values.len());
            }
        }
    };
    for body in plain::<D>().iter().chain(&distorted::<D>()) {
        let probes = Surface {
            vertices: body.inside.iter().map(|p| p.map(f64::from)).collect(),
            simplices: Vec::new(),
            normals: Some(body.inside.iter().map(|_| vector(&mut random)).collect()),
        };
        // What is folded flat has two sides, and vertices of their own for one of them behind the body's.
        let both = mesh(&[&body.surface, &probes]);
        check(&body.name, &both, both.objects[1].vertices.start);
    }
    for n in [1, 5] {
        for cavity in [sphere::<D>(0.5, n), crate::bodies::cuboid(0.3, n)] {
            let mut hollow = sphere::<D>(1.0, 4);
            let first = hollow.vertices.len();
            hollow.vertices.extend(&cavity.vertices);
            hollow.simplices.extend(cavity.simplices.iter().map(|s| s.map(|v| v + first as u32)));
            check("cavity", &mesh(&[&hollow]), first);
        }
    }
    println!("{D}D: {bright} of {points} points see light through a closed surface");
}

#[test]
fn closed_surfaces_are_dark_inside() {
    darkness::<3>(many(1_000) as u32);
    darkness::<4>(many(1_000) as u32);
}

/// Rays aimed exactly at a vertex, an edge or a facet of a lattice hit the first of the simplices that meet there.
fn ties<const D: usize>() {
    let mesh = mesh(&[&crate::bodies::cuboid::<D>(1.0, 4)]);
    let tracer = Tracer::new(mesh);
    let mesh = tracer.mesh();
    let mut random = random(2);
    let (mut wrong, count) = (0, many(100_000));
    for kind in 0..count {
        let origin: Vector<D> = narrow(&crate::bodies::round_to(&(vector::<D>(&mut random) * 0.9), 1.0 / 32.0));
        let simplex = mesh.simplices[random.random_range(0..mesh.simplices.len())];
        let aim = &simplex[..1 + kind % D];
        let target: Vector64<D> = aim.iter().map(|&v| mesh.vertices[v as usize].map(f64::from)).sum();
        let ray = Ray::new(origin, scaled(narrow(&(target - origin.map(f64::from) * aim.len() as f64))));
        let expected = (0..).find(|&s| aim.iter().all(|v| mesh.simplices[s as usize].contains(v)));
        wrong += usize::from(tracer.closest_hit(&ray).map(|hit| hit.simplex) != expected);
    }
    println!("{D}D: {wrong} of {count} rays at exact ties hit another simplex than the first");
    assert_eq!(wrong, 0);
}

#[test]
fn ties_go_to_the_first() {
    ties::<3>();
    ties::<4>();
}
