//! Caps of extruded surfaces: the solid within is met exactly, whatever its form, and what has no inside is refused.

use std::fmt::Write;
use std::path::Path;

use ao4d::accel::Tracer;
use ao4d::geometry::{Vector64, measure};
use ao4d::mesh::rounding::turned_over;
use ao4d::mesh::topology::{corners, enclosed_volume, facet_pairs};
use ao4d::mesh::{MeshBuilder, Orientation, Surface};
use ao4d::occlusion::Estimator;
use ao4d::occlusion::exact::{Budget, Hemisphere};
use ao4d::progress::Silent;
use ao4d::scene::{ObjectSpec, build_object, build_object_with_notes};
use ao4d::trace::cpu::{CpuBackend, PacketTracer};
use ao4d::trace::{RayBackend, Sampling, ShadingPoint};
use serde_json::{Value, json};

fn build<const D: usize>(object: Value, folder: &Path) -> Result<Surface<D>, String> {
    let spec: ObjectSpec = serde_json::from_value(object.clone()).unwrap_or_else(|e| panic!("{object}: {e}"));
    build_object(&spec, folder).map_err(|error| error.to_string())
}

fn volume<const D: usize>(surface: &Surface<D>) -> f64 {
    enclosed_volume(corners(&surface.vertices, &surface.simplices))
}

/// A surface as an OBJ file has it.
fn text(surface: &Surface<3>) -> String {
    let mut obj = String::new();
    surface.vertices.iter().for_each(|v| writeln!(obj, "v {} {} {}", v[0], v[1], v[2]).unwrap());
    surface.simplices.iter().for_each(|t| writeln!(obj, "f {} {} {}", t[0] + 1, t[1] + 1, t[2] + 1).unwrap());
    obj
}

fn capped(surface: &Surface<3>) -> Result<Surface<4>, String> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("x.obj"), text(surface)).unwrap();
    build(json!({"extrude": {"mesh": "x.obj", "from": -1, "to": 1, "caps": true}}), folder.path())
}

/// Checks the body swept from a surface, and tells how many tetrahedra and points it has.
fn check(name: &str, surface: &Surface<3>) -> (usize, usize) {
    check_within(name, surface, 1e-11)
}

/// The same, with volumes within a tolerance: where rounding has moved corners of a flat face out of its plane, other triangles over the
/// same corners enclose a little more or less.
fn check_within(name: &str, surface: &Surface<3>, tolerance: f64) -> (usize, usize) {
    let body = capped(surface).unwrap_or_else(|error| panic!("{name}: {error}"));
    let pairs = facet_pairs(&body.simplices);
    assert!(pairs.is_closed() && pairs.open == 0, "{name}: {pairs:?}");
    let solid = volume(surface).abs();
    assert!((volume(&body) / (2.0 * solid) - 1.0).abs() < tolerance, "{name}: {} {}", volume(&body), 2.0 * solid);
    // No part of a cap twice: the sizes of its tetrahedra, all counted as positive, make up the solid.
    for end in [-1.0, 1.0] {
        let cap: f64 = corners(&body.vertices, &body.simplices)
            .filter(|simplex| simplex.iter().all(|v| v[3] == end))
            .map(|simplex| measure(&simplex))
            .sum();
        assert!((cap / solid - 1.0).abs() < tolerance, "{name}: {cap} {solid}");
        // Its own vertices are all there.
        let mut there: Vec<[u64; 3]> =
            body.vertices.iter().filter(|v| v[3] == end).map(|v| [0, 1, 2].map(|i| (v[i] + 0.0).to_bits())).collect();
        there.sort_unstable();
        for v in &surface.vertices {
            assert!(there.binary_search(&[0, 1, 2].map(|i| (v[i] + 0.0).to_bits())).is_ok(), "{name}: {v}");
        }
    }
    (body.simplices.len(), body.vertices.len())
}

fn shape(object: Value) -> Surface<3> {
    build(object, &Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines/meshes")).unwrap()
}

/// Both surfaces as one, vertices apart.
fn together(mut a: Surface<3>, b: &Surface<3>) -> Surface<3> {
    let count = a.vertices.len() as u32;
    a.vertices.extend(&b.vertices);
    a.simplices.extend(b.simplices.iter().map(|t| t.map(|i| i + count)));
    a
}

fn cube(low: f64, high: f64, subdivisions: u32) -> Surface<3> {
    shape(json!({"box": {"min": [low, low, low], "max": [high, high, high], "subdivisions": subdivisions}}))
}

fn turned(mut surface: Surface<3>) -> Surface<3> {
    surface.simplices.iter_mut().for_each(|t| t.swap(1, 2));
    surface
}

#[test]
fn solids_of_all_forms_are_filled() {
    // Convex: one point inside, and one tetrahedron a triangle.
    assert_eq!(check("cube", &cube(0.0, 1.0, 1)), (12 * 3 + 2 * 12, 2 * 9));
    check("cube that faces inwards", &turned(cube(0.0, 1.0, 1)));
    let ball = shape(json!({"sphere": {"radius": 0.7, "subdivisions": 2}}));
    let (tetrahedra, points) = check("ball", &ball);
    assert_eq!(points, 2 * (ball.vertices.len() + 1));
    assert_eq!(tetrahedra, (3 + 2) * ball.simplices.len());
    check("cube in pieces", &cube(-0.3, 0.7, 4));
    check("cube with thirds", &cube(1.0 / 3.0, 2.0 / 3.0, 3));
    for (name, object) in [
        (
            "notches",
            json!({"cut_cube": {"min": [0, 0, 0], "max": [1, 1, 1], "cuts": [
                {"from": [0.5, 0.3, -1], "to": [2, 0.6, 0.5]}, {"from": [-1, 0.2, 0.7], "to": [0.4, 0.8, 2]}]}}),
        ),
        ("torus", json!({"isosurface": {"field": {"torus": {"major": 1, "minor": 0.4}}, "grid": {"cells": 9}}})),
        (
            "labyrinth",
            json!({"isosurface": {"field": {"gyroid": {"period": 1.7}},
                "grid": {"min": [-1, -1, -1], "max": [1, 1, 1], "cells": 6}}}),
        ),
    ] {
        check(name, &shape(object.clone()));
        // Turned, all planes are askew and all coordinates long.
        let mut askew = object;
        askew["transform"] =
            json!([{"rotate": {"plane": "xy", "degrees": 17}}, {"rotate": {"plane": "yz", "degrees": 31}}]);
        check(name, &shape(askew));
    }
    check("hollow", &together(cube(0.0, 1.0, 1), &turned(cube(0.25, 0.75, 2))));
    check("two", &together(cube(0.0, 1.0, 1), &cube(2.0, 3.0, 1)));
    check("two that share a corner", &together(cube(0.0, 1.0, 2), &cube(1.0, 2.0, 1)));
}

#[test]
fn large_solids_are_filled() {
    // Hundreds of triangles, askew, with many planes that nearly coincide.
    let object = json!({
        "isosurface": {"field": {"gyroid": {"period": 1.3, "wall": 0.5}},
            "grid": {"min": [-1, -1, -1], "max": [1, 1, 1], "cells": 5}},
        "transform": [{"rotate": {"plane": "xy", "degrees": 17}}, {"rotate": {"plane": "yz", "degrees": 31}}],
    });
    let surface = shape(object);
    assert!(surface.simplices.len() > 500);
    let started = std::time::Instant::now();
    let (tetrahedra, points) = check("labyrinth", &surface);
    let (count, seconds) = (surface.simplices.len(), started.elapsed().as_secs_f64());
    println!("{count} triangles: {tetrahedra} tetrahedra, {points} points, {seconds:.2} s");
}

#[test]
fn bodies_that_overlap_are_told_by_place() {
    let folder = tempfile::tempdir().unwrap();
    let told = |low: f64| {
        let surface = together(cube(0.0, 1.0, 2), &cube(low, 1.5, 1));
        std::fs::write(folder.path().join("x.obj"), text(&surface)).unwrap();
        let object = json!({"extrude": {"mesh": "x.obj", "from": -1, "to": 1, "caps": true}});
        let mut notes = Vec::new();
        let spec: ObjectSpec = serde_json::from_value(object).unwrap();
        build_object_with_notes::<4>(&spec, folder.path(), &mut notes).unwrap();
        notes
    };
    let notes = told(0.6);
    assert!(notes.len() == 1 && notes[0].starts_with("extrude.mesh: "), "{notes:?}");
    assert!(notes[0].contains("passes through itself, or has bodies that overlap: the triangle"), "{notes:?}");
    assert_eq!(told(1.0), [""; 0], "those that touch at a corner");
    // As a surface in 3D, too; vertices apart are welded to see it, and an open one encloses nothing.
    let told = |low: f64, left_out: usize| {
        let mut surface = together(cube(0.0, 1.0, 2), &cube(low, 1.5, 1));
        surface.simplices.truncate(surface.simplices.len() - left_out);
        std::fs::write(folder.path().join("x.obj"), text(&surface)).unwrap();
        let mut notes = Vec::new();
        let spec: ObjectSpec = serde_json::from_value(json!({"file": "x.obj"})).unwrap();
        build_object_with_notes::<3>(&spec, folder.path(), &mut notes).unwrap();
        notes
    };
    let notes = told(0.6, 0);
    assert!(notes.len() == 1 && notes[0].starts_with("file: "), "{notes:?}");
    assert!(notes[0].contains("passes through itself, or has bodies that overlap: the triangle"), "{notes:?}");
    assert_eq!((told(1.0, 0), told(0.6, 1)), (vec![], vec![]));
}

#[test]
fn surfaces_without_an_inside_are_refused() {
    let mut open = cube(0.0, 1.0, 1);
    open.simplices.pop();
    // The middle of the top, pushed out through the bottom.
    let mut pushed = cube(0.0, 1.0, 4);
    let inner = |x: f64| (0.3..0.7).contains(&x);
    pushed.vertices.iter_mut().filter(|v| inner(v[0]) && inner(v[1]) && v[2] == 1.0).for_each(|v| v[2] = -0.5);
    let mut flat = cube(0.0, 1.0, 1);
    flat.vertices.iter_mut().for_each(|v| v[2] = 0.0);
    for (surface, message) in [
        (open, "is open at 3 edges: caps need a closed surface; repair it, or write caps: false for walls only"),
        (pushed, "passes through itself"),
        (flat, "encloses nothing"),
    ] {
        let found = capped(&surface).unwrap_err();
        assert!(found.starts_with("extrude.mesh: ") && found.contains(message), "{found}");
    }
}

#[test]
fn triangles_that_face_the_wrong_way_are_turned() {
    let mut flipped = cube(0.0, 1.0, 2);
    flipped.simplices.iter_mut().step_by(3).for_each(|t| t.swap(0, 1));
    let whole = capped(&cube(0.0, 1.0, 2)).unwrap();
    assert_eq!(volume(&capped(&flipped).unwrap()), volume(&whole));
    // A body within another is a cavity, as for `file`, and bodies apart are bodies.
    let within = capped(&together(cube(0.0, 1.0, 1), &cube(0.25, 0.75, 1))).unwrap();
    assert!((volume(&within) / 2.0 - (1.0 - 0.125)).abs() < 1e-12);
    let apart = capped(&together(cube(0.0, 1.0, 1), &turned(cube(2.0, 3.0, 1)))).unwrap();
    assert!((volume(&apart) / 2.0 - 2.0).abs() < 1e-12);
}

/// A prism over a regular polygon, in layers; its ends are fans around their middles, its sides have collinear vertices.
fn prism(corners: u32, layers: u32) -> Surface<3> {
    let mut vertices = Vec::new();
    for layer in 0..=layers {
        for corner in 0..corners {
            let (sine, cosine) = libm::sincos(std::f64::consts::TAU * f64::from(corner) / f64::from(corners));
            vertices.push(Vector64::from([cosine, sine, f64::from(layer) / f64::from(layers)]));
        }
    }
    let ends = vertices.len() as u32;
    vertices.extend([Vector64::from([0.0, 0.0, 0.0]), Vector64::from([0.0, 0.0, 1.0])]);
    let mut simplices = Vec::new();
    for i in 0..corners {
        let j = (i + 1) % corners;
        for layer in 0..layers {
            let [a, b, c, d] = [i, j, i + corners, j + corners].map(|v| v + layer * corners);
            simplices.extend([[a, b, d], [a, d, c]]);
        }
        simplices.extend([[ends, j, i], [ends + 1, i + layers * corners, j + layers * corners]]);
    }
    Surface { vertices, simplices, normals: None }
}

/// Turned about two axes, moved, and rounded as a file of single precision holds it.
fn askew(mut surface: Surface<3>, degrees: f64, by: f64) -> Surface<3> {
    let (s, c) = libm::sincos(degrees.to_radians());
    for v in &mut surface.vertices {
        let [x, y, z] = [c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]];
        let turned = [x + by, c * y - s * z + 2.0 * by, s * y + c * z - by];
        *v = Vector64::from(turned.map(|x| f64::from(x as f32)));
    }
    surface
}

#[test]
fn convex_bodies_have_no_shadows() {
    for (name, body) in [("prism", prism(12, 2)), ("box", cube(-0.3, 0.7, 3))] {
        for (degrees, by) in [(0.0, 0.0), (31.0, 0.0), (77.0, 3.0)] {
            let surface = askew(body.clone(), degrees, by);
            let mut swept = capped(&surface).unwrap();
            assert_eq!(swept.simplices.len(), 5 * surface.simplices.len(), "{name}: one tetrahedron a triangle");
            let (s, c) = libm::sincos((degrees / 2.0).to_radians());
            swept.vertices.iter_mut().for_each(|v| (v[0], v[3]) = (c * v[0] - s * v[3] - by, s * v[0] + c * v[3] + by));
            assert!(turned_over(&swept).is_empty());
            let mut builder = MeshBuilder::new();
            builder.add("body", [0.8; 3], &swept, Orientation::Input).unwrap();
            let mesh = builder.finish();
            let count = mesh.vertices.len() as u32;
            let backend = CpuBackend::new(Tracer::new(mesh));
            let tracer = backend.tracer().clone();
            let (mut packets, sampling) = (PacketTracer::default(), Sampling::new(256, 3));
            for vertex in 0..count {
                let point = ShadingPoint::Vertex(vertex);
                let sampled = packets.estimate(&tracer, &point, &sampling, &Silent).unwrap().value;
                assert_eq!(sampled, 1.0, "{name} {degrees} vertex {vertex}");
                if vertex % 5 == 1 {
                    let random = Sampling::random(64, 3);
                    for estimator in [Estimator::Sampled(random), Estimator::Adaptive(sampling)] {
                        let found = estimator.estimate(&backend, &[point], None, &Silent).unwrap().values[0];
                        assert!(found > 1.0 - 1e-5, "{name} {degrees} vertex {vertex}, {estimator:?}: {found}");
                    }
                }
                if vertex % 5 == 0 {
                    let view = Hemisphere::over(&tracer, &point);
                    let exact = view.map_or(1.0, |view| view.visible_fraction(Budget::default()).unwrap());
                    assert!(exact > 1.0 - 1e-5, "{name} {degrees} vertex {vertex}: {exact}");
                }
            }
        }
    }
}

#[test]
fn triangles_without_area_are_no_obstacle() {
    // A square within a square, with corners in the middle of each edge, which the ends reach by triangles without area.
    let prism = |half: f64, low: f64, high: f64| {
        let outline =
            [[-1.0, -1.0], [0.0, -1.0], [1.0, -1.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [-1.0, 1.0], [-1.0, 0.0]];
        let point = |i: usize| [half * outline[i % 8][0], half * outline[i % 8][1], if i < 8 { low } else { high }];
        let mut simplices = vec![[8, 10, 12], [8, 12, 14]];
        simplices.extend([0u32, 2, 4, 6].map(|i| [i + 8, i + 9, (i + 2) % 8 + 8]));
        simplices.extend(simplices.clone().iter().map(|t| [t[0] - 8, t[2] - 8, t[1] - 8]));
        (0..8).for_each(|i| simplices.extend([[i, (i + 1) % 8, (i + 1) % 8 + 8], [i, (i + 1) % 8 + 8, i + 8]]));
        Surface { vertices: (0..16).map(|i| Vector64::from(point(i))).collect(), simplices, normals: None }
    };
    let hollow = together(prism(1.0, -1.0, 1.0), &turned(prism(0.6, -0.5, 0.7)));
    for (degrees, by) in [(0.0, 0.0), (20.0, 0.0), (133.0, 3.0)] {
        let surface = askew(hollow.clone(), degrees, by);
        let body = capped(&surface).unwrap();
        let pairs = facet_pairs(&body.simplices);
        assert!(pairs.is_closed() && pairs.open == 0 && turned_over(&body).is_empty(), "{degrees}: {pairs:?}");
        // Where corners were rounded out of line, turned triangles pass by them by as much.
        let expected = 2.0 * volume(&surface);
        assert!((volume(&body) / expected - 1.0).abs() < 1e-6, "{degrees}: {} {expected}", volume(&body));
    }
}

#[test]
fn parts_with_flat_faces_take_few_pieces() {
    let plate = json!({"cut_cube": {"min": [0, 0, 0], "max": [4, 3, 0.2], "cuts": [
        {"from": [0.5, 0.5, -1], "to": [1, 1, 1]}, {"from": [2, 0.5, -1], "to": [3.5, 1, 0.1]},
        {"from": [0.5, 1.7, 0.05], "to": [1.4, 2.5, 2]}, {"from": [2, 2, -1], "to": [5, 4, 1]}]}});
    let frame = together(prism(24, 2), &turned(scaled(prism(24, 1), 0.5)));
    let cavities = together(cube(0.0, 1.0, 4), &turned(cube(0.1, 0.4, 2)));
    let cavities = together(cavities, &turned(cube(0.6, 0.9, 2)));
    let nested = together(together(cube(0.0, 1.0, 2), &turned(cube(0.2, 0.8, 2))), &cube(0.4, 0.6, 2));
    for (name, surface, most) in [
        ("plate", shape(plate), 30),
        ("frame", frame, 30),
        ("cavities", cavities, 30),
        ("nested", nested, 30),
        ("gear", gear(20), 15),
    ] {
        for degrees in [0.0, 20.0, 133.0] {
            let surface = askew(surface.clone(), degrees, degrees / 50.0);
            let tolerance = if degrees == 0.0 && name != "frame" && name != "gear" { 1e-11 } else { 1e-7 };
            let (tetrahedra, _) = check_within(&format!("{name} {degrees}"), &surface, tolerance);
            assert!(turned_over(&capped(&surface).unwrap()).is_empty());
            let filling = (tetrahedra - 3 * surface.simplices.len()) / 2;
            assert!(
                filling <= most * surface.simplices.len(),
                "{name} {degrees}: {filling} of {}",
                surface.simplices.len()
            );
        }
    }
}

#[test]
fn faces_cut_by_ear_clipping_take_few_pieces() {
    // A gear with a round hole and a slit, so that each end is one polygon; the reader cuts it by ear clipping.
    let folder = tempfile::tempdir().unwrap();
    for (teeth, most) in [(20, 6), (60, 6)] {
        let (outer, inner) = (4 * teeth, 2 * teeth);
        let at = |i: u32, count: u32| std::f64::consts::TAU * 0.99 * f64::from(i) / f64::from(count - 1);
        let mut outline: Vec<[f64; 2]> = Vec::new();
        outline.extend((0..outer).map(|i| {
            let radius = if i % 4 < 2 { 0.85 } else { 1.0 };
            [radius * libm::cos(at(i, outer)), radius * libm::sin(at(i, outer))]
        }));
        outline.extend((0..inner).rev().map(|i| [libm::cos(at(i, inner)), libm::sin(at(i, inner))].map(|x| 0.3 * x)));
        let count = outline.len();
        let mut obj = String::new();
        for z in [0.0, 0.3] {
            outline.iter().for_each(|[x, y]| writeln!(obj, "v {x} {y} {z}").unwrap());
        }
        let face = |corners: Vec<usize>| corners.iter().map(|i| format!(" {}", i + 1)).collect::<String>();
        writeln!(obj, "f{}\nf{}", face((0..count).rev().collect()), face((count..2 * count).collect())).unwrap();
        for i in 0..count {
            let j = (i + 1) % count;
            writeln!(obj, "f{}", face(vec![i, j, j + count, i + count])).unwrap();
        }
        std::fs::write(folder.path().join("gear.obj"), obj).unwrap();
        let surface: Surface<3> = build(json!({"file": "gear.obj"}), folder.path()).unwrap();
        assert_eq!(surface.simplices.len(), 2 * (count - 2) + 2 * count);
        for degrees in [0.0, 20.0] {
            let surface = askew(surface.clone(), degrees, degrees / 50.0);
            let name = format!("{teeth} teeth, {degrees} degrees");
            let (tetrahedra, _) = check_within(&name, &surface, 1e-7);
            assert!(turned_over(&capped(&surface).unwrap()).is_empty(), "{name}");
            let (filling, count) = ((tetrahedra - 3 * surface.simplices.len()) / 2, surface.simplices.len());
            assert!(filling <= most * count, "{name}: {filling} of {count}");
        }
    }
}

/// A gear with a round hole: a ring of prisms, four a tooth.
fn gear(teeth: u32) -> Surface<3> {
    let count = 4 * teeth;
    let mut vertices = Vec::new();
    for height in [0.0, 0.3] {
        for i in 0..count {
            let turn = (f64::from(i / 4) + [0.0, 0.35, 0.5, 0.85][(i % 4) as usize]) / f64::from(teeth);
            let (sine, cosine) = libm::sincos(std::f64::consts::TAU * turn);
            let outer = if i % 4 < 2 { 0.85 } else { 1.0 };
            vertices.extend([outer, 0.3].map(|r| Vector64::from([r * cosine, r * sine, height])));
        }
    }
    let mut simplices = Vec::new();
    for i in 0..count {
        let [a, b] = [2 * i, 2 * ((i + 1) % count)];
        let [top, next] = [a + 2 * count, b + 2 * count];
        for [p, q, r, s] in
            [[a, b, next, top], [b + 1, a + 1, top + 1, next + 1], [top, next, next + 1, top + 1], [b, a, a + 1, b + 1]]
        {
            simplices.extend([[p, q, r], [p, r, s]]);
        }
    }
    Surface { vertices, simplices, normals: None }
}

fn scaled(mut surface: Surface<3>, by: f64) -> Surface<3> {
    surface
        .vertices
        .iter_mut()
        .for_each(|v| *v = (*v - Vector64::from([0.0, 0.0, 0.5])) * by + Vector64::from([0.0, 0.0, 0.5]));
    surface
}
