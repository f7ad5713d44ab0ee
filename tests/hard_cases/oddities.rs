//! Simplices that coincide, overlap, differ by an ulp, have no measure, or hold the ray in their own hyperplane.

use ao4d::accel::Tracer;
use ao4d::geometry::{Cone, Ray, Vector, Vector64, narrow, widen};
use ao4d::mesh::Surface;
use ao4d::trace::cpu::{Level, PacketTracer};
use rand::{RngExt, rngs::ChaCha8Rng};

use crate::bodies::{cuboid, mesh, random, round_to, sphere, vector};
use crate::many;

fn joined<const D: usize>(parts: &[Surface<D>]) -> Surface<D> {
    let mut all = Surface::default();
    for part in parts {
        let first = all.vertices.len() as u32;
        all.vertices.extend(&part.vertices);
        all.simplices.extend(part.simplices.iter().map(|s| s.map(|v| v + first)));
    }
    all
}

fn nudged<const D: usize>(surface: &Surface<D>, random: &mut ChaCha8Rng) -> Surface<D> {
    crate::bodies::map(surface, |p| {
        narrow(p).map(|x| f64::from([x.next_down(), x, x.next_up()][random.random_range(0..3)]))
    })
}

/// Simplices with a vertex on an edge, or all vertices in one, or in one point.
fn without_measure<const D: usize>(surface: &Surface<D>) -> Surface<D> {
    let mut flat = surface.clone();
    for (i, s) in flat.simplices.iter_mut().enumerate() {
        let keep = 1 + i % (D - 1);
        for k in keep..D {
            s[k] = s[k - keep];
        }
    }
    flat
}

/// The first hit by asking every simplex, comparing exact distances.
fn first<const D: usize>(mesh: &ao4d::mesh::Mesh<D>, ray: &Ray<D>) -> Option<u32> {
    let mut best: Option<(u32, [ao4d::geometry::Expansion; 2])> = None;
    for s in 0..mesh.simplices.len() as u32 {
        let cone = Cone::of_simplex(&ray.origin, &mesh.corners(s));
        if cone.contains(&ray.direction) {
            let (n, d) = cone.exact_distance(&ray.direction);
            let nearer = |[m, e]: &[_; 2]| n.multiply(e).add(&d.multiply(m).negate()).sign() < 0;
            if best.as_ref().is_none_or(|(_, other)| nearer(other)) {
                best = Some((s, [n, d]));
            }
        }
    }
    best.map(|(s, _)| s)
}

fn doubled_surfaces<const D: usize>() {
    let mut random = random(21);
    let body = sphere::<D>(1.0, 3);
    let lattice = crate::bodies::map(&body, |p| round_to(p, 1.0 / 64.0));
    let brick = cuboid::<D>(0.75, 2);
    let scenes = [
        ("twice the same", joined(&[lattice.clone(), lattice.clone()])),
        ("an ulp apart", joined(&[body.clone(), nudged(&body, &mut random), nudged(&body, &mut random)])),
        ("overlapping in their planes", joined(&[brick.clone(), cuboid(0.75, 3), brick.clone()])),
        (
            "with simplices of measure zero",
            joined(&[without_measure(&lattice), lattice.clone(), without_measure(&brick)]),
        ),
    ];
    for (name, surface) in scenes {
        let mesh = mesh(&[&surface]);
        let tracer = Tracer::new(mesh.clone());
        let (mut wrong, count) = ([0; 2], many(4_000));
        for k in 0..count {
            let from = round_to(&(vector::<D>(&mut random) * [0.5, 2.0][k % 2]), 1.0 / 64.0);
            let to = match k % 3 {
                0 => widen(&mesh.vertices[random.random_range(0..mesh.vertices.len())]),
                1 => round_to(&vector::<D>(&mut random), 1.0 / 64.0),
                _ => vector::<D>(&mut random),
            };
            let ray = Ray::new(narrow(&from), narrow(&(to - from)));
            if ray.direction.amax() == 0.0 {
                continue;
            }
            let expected = first(&mesh, &ray);
            wrong[0] += usize::from(tracer.closest_hit(&ray).map(|hit| hit.simplex) != expected);
            let unit = ray.direction / (2.0 * ray.direction.amax());
            let occluded = PacketTracer::new(Level::best()).count_occluded(
                &tracer,
                &ray.origin,
                Vector::zeros(),
                &[unit],
                f32::INFINITY,
                None,
            );
            let scaled = Ray::new(ray.origin, unit);
            wrong[1] += usize::from((occluded == 1) != first(&mesh, &scaled).is_some());
        }
        println!("{D}D, {name}: {} and {} of {count} rays wrong", wrong[0], wrong[1]);
        assert_eq!(wrong, [0; 2], "{D}D, {name}");
    }
}

#[test]
fn coincident_overlapping_and_flat_simplices() {
    doubled_surfaces::<3>();
    doubled_surfaces::<4>();
}

/// A ray within a simplex's hyperplane doesn't hit it, wherever it goes.
fn rays_in_the_hyperplane<const D: usize>() {
    let mut random = random(22);
    let (mut wrong, mut count) = (0, 0);
    for k in 0..many(100_000) {
        // On a lattice; combinations of edges with whole coefficients are exact.
        let place = |random: &mut ChaCha8Rng| narrow(&round_to(&(vector::<D>(random) * 8.0), 1.0 / 8.0));
        let corners: [Vector<D>; D] = std::array::from_fn(|_| place(&mut random));
        let mut combination = |from: Vector<D>| {
            (1..D).fold(from, |p, i| p + (corners[i] - corners[0]) * f32::from(random.random_range(-3i8..4)))
        };
        let origin = combination(corners[0]);
        let direction = combination(Vector::zeros());
        let scale = 2f32.powi([0, -20, 20][k % 3]);
        let (corners, origin) = (corners.map(|c| c * scale), origin * scale);
        let cone = Cone::of_simplex(&origin, &corners);
        wrong += usize::from(cone.orientation() != 0 || direction.amax() > 0.0 && cone.contains(&direction));
        // An ulp beside it the sign tells the side.
        let normal: Vector64<D> = ao4d::geometry::normal_of(&corners.map(|c| widen(&c)));
        let axis = normal.iamax();
        if normal[axis] != 0.0 {
            let mut beside = origin;
            beside[axis] = if normal[axis] > 0.0 { beside[axis].next_up() } else { beside[axis].next_down() };
            wrong += usize::from(ao4d::geometry::plane_side(&corners, &beside) != 1);
            count += 1;
        }
        count += 1;
    }
    println!("{D}D: {wrong} of {count} points in a simplex's hyperplane, or an ulp beside it, told wrong");
    assert_eq!(wrong, 0);
}

#[test]
fn rays_in_a_simplex_hyperplane_miss_it() {
    rays_in_the_hyperplane::<3>();
    rays_in_the_hyperplane::<4>();
}
