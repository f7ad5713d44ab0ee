//! Objects of a scene against what is known of them exactly: counts, volumes, closedness, and what is refused.

use std::path::{Path, PathBuf};

use ao4d::geometry::{Vector64, normal_of};
use ao4d::mesh::Surface;
use ao4d::mesh::topology::{corners, enclosed_volume, facet_pairs, surface_measure, worst_quality};
use ao4d::scene::{Error, ObjectSpec, build_object};
use serde_json::{Value, json};

fn spec(object: Value) -> ObjectSpec {
    serde_json::from_value(object.clone()).unwrap_or_else(|error| panic!("{object}: {error}"))
}

fn build<const D: usize>(object: Value) -> Surface<D> {
    build_object(&spec(object.clone()), &meshes()).unwrap_or_else(|error| panic!("{object}: {error}"))
}

fn refusal<const D: usize>(object: Value) -> String {
    let error: Error = build_object::<D>(&spec(object.clone()), &meshes()).expect_err(&object.to_string());
    error.to_string()
}

/// The folder that ships with the program.
fn meshes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines/meshes")
}

fn volume<const D: usize>(surface: &Surface<D>) -> f64 {
    enclosed_volume(corners(&surface.vertices, &surface.simplices))
}

fn area<const D: usize>(surface: &Surface<D>) -> f64 {
    surface_measure(corners(&surface.vertices, &surface.simplices))
}

fn close(found: f64, expected: f64) {
    assert!((found - expected).abs() <= 1e-12 * expected.abs(), "{found}, expected {expected}");
}

/// Every facet twice with opposite orientation, facing outwards, no vertex unused or doubled.
fn assert_closed_manifold<const D: usize>(surface: &Surface<D>) {
    let pairs = facet_pairs(&surface.simplices);
    assert!(pairs.is_manifold() && pairs.is_closed(), "{pairs:?}");
    assert!(volume(surface) > 0.0, "faces inwards");
    let mut used = vec![false; surface.vertices.len()];
    surface.simplices.as_flattened().iter().for_each(|&i| used[i as usize] = true);
    assert!(used.iter().all(|&used| used));
    let mut points: Vec<Vec<u64>> =
        surface.vertices.iter().map(|v| v.iter().map(|x| (x + 0.0).to_bits()).collect()).collect();
    points.sort_unstable();
    points.dedup();
    assert_eq!(points.len(), surface.vertices.len(), "two vertices at one place");
}

/// The simplices as sets of points, whatever their numbering.
fn as_points<const D: usize>(surface: &Surface<D>) -> Vec<Vec<Vec<u64>>> {
    let mut simplices: Vec<Vec<Vec<u64>>> = corners(&surface.vertices, &surface.simplices)
        .map(|simplex| {
            let mut points: Vec<Vec<u64>> =
                simplex.iter().map(|v| v.iter().map(|x| (x + 0.0).to_bits()).collect()).collect();
            points.sort_unstable();
            points
        })
        .collect();
    simplices.sort_unstable();
    simplices
}

#[test]
fn tesseracts() {
    for n in [1, 2, 3, 5] {
        let surface = build::<4>(json!({"tesseract": {"subdivisions": n, "size": 1}}));
        assert_eq!(surface.vertices.len(), 8 * n * n * n + 8 * n);
        assert_eq!(surface.simplices.len(), 48 * n * n * n);
        assert_closed_manifold(&surface);
        close(area(&surface), 8.0);
        close(volume(&surface), 1.0);
    }
    close(volume(&build::<4>(json!({"tesseract": {}}))), 16.0);
}

#[test]
fn boxes() {
    let surface = build::<3>(json!({"box": {"min": [-1, 0, 2], "max": [1, 5, 2.5], "subdivisions": [2, 3, 1]}}));
    assert_eq!(surface.simplices.len(), 2 * 2 * (2 * 3 + 2 + 3));
    assert_closed_manifold(&surface);
    close(volume(&surface), 5.0);
    close(area(&surface), 2.0 * (10.0 + 1.0 + 2.5));
    let surface = build::<3>(json!({"box": {"min": [0, 0, 0], "max": [1, 1, 1], "subdivisions": 7}}));
    assert_eq!((surface.vertices.len(), surface.simplices.len()), (6 * 49 + 2, 12 * 49));

    let surface = build::<4>(json!({"box": {"min": [0, 0, 0, -3], "max": [1, 2, 3, 1], "subdivisions": [1, 2, 3, 4]}}));
    assert_closed_manifold(&surface);
    close(volume(&surface), 24.0);
    close(area(&surface), 2.0 * (2.0 * 3.0 * 4.0 + 3.0 * 4.0 + 2.0 * 4.0 + 2.0 * 3.0));
    // Ends are exact, and every normal of a box is along an axis.
    let surface =
        build::<4>(json!({"box": {"min": [0.1, 0.2, 0.3, 0.4], "max": [0.7, 0.8, 0.9, 1.1], "subdivisions": 3}}));
    let highest = surface.vertices.iter().fold(Vector64::<4>::zeros(), |highest, v| highest.sup(v));
    assert_eq!(highest, Vector64::from([0.7, 0.8, 0.9, 1.1]));
    for simplex in corners(&surface.vertices, &surface.simplices) {
        let normal = normal_of(&simplex).normalize();
        let outwards = (simplex.iter().sum::<Vector64<4>>() / 4.0 - Vector64::from([0.4, 0.5, 0.6, 0.75])).dot(&normal);
        assert!((normal.abs().max() - 1.0).abs() < 1e-12 && outwards > 0.29);
    }
}

#[test]
fn spheres() {
    for n in [1usize, 2, 4, 5] {
        let surface = build::<4>(json!({"hypersphere": {"radius": 1, "subdivisions": n}}));
        assert_eq!(surface.vertices.len(), (8 * n * n * n + 16 * n) / 3);
        assert_eq!(surface.simplices.len(), 16 * n * n * n);
        assert_closed_manifold(&surface);
        let surface = build::<3>(json!({"sphere": {"radius": 1, "subdivisions": n}}));
        assert_eq!((surface.vertices.len(), surface.simplices.len()), (4 * n * n + 2, 8 * n * n));
        assert_closed_manifold(&surface);
    }
    // The 16-cell and the octahedron themselves: edges sqrt(2).
    let surface = build::<4>(json!({"hypersphere": {"radius": 1, "subdivisions": 1}}));
    close(area(&surface), 4.0 * 2f64.sqrt() / 3.0 * 2f64.sqrt().powi(3));
    close(volume(&surface), 1.0 / 6.0 * 4.0);
    close(volume(&build::<3>(json!({"sphere": {"radius": 1, "subdivisions": 1}}))), 4.0 / 3.0);
    // Towards pi^2 r^4 / 2 and 4 pi r^3 / 3, with the square of the size of the pieces; never beyond.
    let deficits = |volumes: [f64; 2], limit: f64| volumes.map(|v| 1.0 - v / limit);
    let sphere =
        |n| volume(&build::<4>(json!({"hypersphere": {"radius": 2, "center": [5, 0, 0, -9], "subdivisions": n}})));
    let [coarse, fine] = deficits([sphere(6), sphere(12)], 8.0 * std::f64::consts::PI.powi(2));
    assert!(fine > 0.0 && fine < 0.03 && (3.5..4.2).contains(&(coarse / fine)), "{coarse} {fine}");
    let sphere = |n| volume(&build::<3>(json!({"hypersphere": {"radius": 2, "subdivisions": n}})));
    let [coarse, fine] = deficits([sphere(8), sphere(16)], 32.0 / 3.0 * std::f64::consts::PI);
    assert!(fine > 0.0 && fine < 0.02 && (3.5..4.2).contains(&(coarse / fine)), "{coarse} {fine}");
    for vertex in build::<4>(json!({"hypersphere": {"radius": 3, "subdivisions": 3}})).vertices {
        close(vertex.norm(), 3.0);
    }
}

#[test]
fn ntracer_test_scene() {
    let surface = build::<4>(json!({"hypersphere": {"radius": 1, "subdivisions": 18}}));
    assert_eq!(surface.simplices.len(), 93_312);
    assert!(facet_pairs(&surface.simplices).is_manifold());
}

#[test]
fn cut_cubes() {
    let cube = json!([-1, -1, -1, -1]);
    let notch = json!({"from": [0, 0, -2, -2], "to": [2, 0.5, 2, 2]});
    let surface = build::<4>(json!({"cut_cube": {"min": cube, "max": [1, 1, 1, 1], "cuts": [notch]}}));
    assert_closed_manifold(&surface);
    // A prism over (2 x 2 square without a 1 x 0.5 bite), 2 long along z and w. The bite lengthens the outline by 2.
    close(volume(&surface), 3.5 * 4.0);
    close(area(&surface), (8.0 + 2.0) * 4.0 + 2.0 * 3.5 * 2.0 * 2.0);
    // No cut at all: the same triangulation as the product of intervals makes.
    let whole = build::<4>(json!({"cut_cube": {"min": cube, "max": [1, 1, 1, 1], "cuts": [], "subdivisions": 3}}));
    assert_closed_manifold(&whole);
    assert_eq!(
        as_points(&whole),
        as_points(&build::<4>(json!({"box": {"min": cube, "max": [1, 1, 1, 1], "subdivisions": 3}})))
    );
    // An edge cut off a 3D cube, a hole through it, a cavity within it, cuts that overlap.
    let cut = |cuts: Value, n: u32| {
        let surface =
            build::<3>(json!({"cut_cube": {"min": [0, 0, 0], "max": [4, 4, 4], "cuts": cuts, "subdivisions": n}}));
        assert_closed_manifold(&surface);
        surface
    };
    for n in [1, 4, 10] {
        close(volume(&cut(json!([{"from": [3, 3, -1], "to": [9, 9, 9]}]), n)), 60.0);
        close(area(&cut(json!([{"from": [3, 3, -1], "to": [9, 9, 9]}]), n)), 94.0);
        let hole = cut(json!([{"from": [1, 1, -1], "to": [3, 2, 5]}]), n);
        close(volume(&hole), 64.0 - 8.0);
        assert_eq!(hole.vertices.len() + hole.simplices.len() - 3 * hole.simplices.len() / 2, 0, "a torus");
        close(volume(&cut(json!([{"from": [1, 1, 1], "to": [3, 2, 2]}]), n)), 64.0 - 2.0);
        let overlapping = json!([{"from": [0, 0, 0], "to": [2, 2, 4]}, {"from": [1, 1, 0], "to": [3, 4, 4]}]);
        close(volume(&cut(overlapping, n)), 64.0 - 16.0 - 24.0 + 4.0);
    }
    // Pieces are even between the planes, and the planes are exact.
    let fine = cut(json!([{"from": [3, 3, -1], "to": [9, 9, 9]}]), 8);
    assert_eq!(fine.vertices.iter().filter(|v| v[1] == 0.0 && v[2] == 0.0).count(), 9);
    // Two halves that touch along an edge only: closed, no manifold.
    let touching = json!([{"from": [0, 0, 0], "to": [2, 2, 4]}, {"from": [2, 2, 0], "to": [4, 4, 4]}]);
    let surface = build::<3>(json!({"cut_cube": {"min": [0, 0, 0], "max": [4, 4, 4], "cuts": touching}}));
    let pairs = facet_pairs(&surface.simplices);
    assert_eq!((pairs.is_closed(), pairs.crowded), (true, 1));
    close(volume(&surface), 32.0);
}

#[test]
fn extruded_tetrahedra_are_closed() {
    // The nut: 431 points, 357 of them on the boundary, 1373 tetrahedra, 714 triangles.
    let solid = 32_179.210_808_727_887;
    for layers in [1, 3] {
        let swept = build::<4>(json!({"extrude": {"mesh": "nut.vtu", "from": -0.5, "to": 1.5, "layers": layers}}));
        assert_closed_manifold(&swept);
        assert_eq!(swept.vertices.len(), 2 * 431 + (layers - 1) * 357);
        assert_eq!(swept.simplices.len(), 2 * 1373 + 3 * layers * 714);
        // Points in the file have seven digits.
        assert!((volume(&swept) / (2.0 * solid) - 1.0).abs() < 1e-6);
    }
    let walls = build::<4>(json!({"extrude": {"mesh": "nut.vtu", "from": 0, "to": 1, "caps": false}}));
    assert_eq!((walls.vertices.len(), walls.simplices.len()), (2 * 357, 3 * 714));
    let rims = facet_pairs(&walls.simplices);
    assert_eq!((rims.open, rims.misoriented, rims.crowded), (2 * 714, 0, 0));
    // Backwards, or against w, it faces outwards all the same; a shear keeps the volume.
    for (from, to, direction) in
        [(1, 0, [0, 0, 0, 1]), (0, 1, [0, 0, 0, -1]), (0, 1, [3, 4, 5, 1]), (1, 0, [1, 0, 0, -1])]
    {
        let swept = build::<4>(json!({"extrude": {"mesh": "nut.vtu", "from": from, "to": to, "direction": direction}}));
        assert_closed_manifold(&swept);
        assert!((volume(&swept) / solid - 1.0).abs() < 1e-6);
    }
}

#[test]
fn extruded_triangles_are_walls() {
    let ant = build::<3>(json!({"file": "ant.ply"}));
    assert_closed_manifold(&ant);
    for layers in [1, 2] {
        let walls = build::<4>(json!({"extrude": {"mesh": "ant.ply", "from": 0, "to": 2, "layers": layers}}));
        assert_eq!((walls.vertices.len(), walls.simplices.len()), ((layers + 1) * 486, layers * 3 * 912));
        let rims = facet_pairs(&walls.simplices);
        assert_eq!((rims.open, rims.misoriented, rims.crowded), (2 * 912, 0, 0));
        close(area(&walls), 2.0 * area(&ant));
        // Outwards: the projection of a wall's normal is that of its triangle.
        for (i, prism) in walls.simplices.chunks(3 * layers).enumerate() {
            let [a, b, c] = ant.simplices[i].map(|v| ant.vertices[v as usize]);
            let outwards = (b - a).cross(&(c - a));
            for wall in corners(&walls.vertices, prism) {
                let normal = normal_of(&wall);
                assert!(normal.fixed_rows::<3>(0).dot(&outwards) >= 0.0 && normal[3].abs() < 1e-9);
            }
        }
    }
    // Its legs are bodies of their own that reach into its trunk: each is filled.
    let filled = build::<4>(json!({"extrude": {"mesh": "ant.ply", "from": 0, "to": 2, "caps": true}}));
    assert_closed_manifold(&filled);
    // Flat faces are divided anew, and rounding has moved their corners out of the plane.
    assert!((volume(&filled) / (2.0 * volume(&ant)) - 1.0).abs() < 1e-8);
}

#[test]
fn transforms() {
    let boxed = json!({"min": [1, 2, 3, 4], "max": [2, 4, 6, 8]});
    let placed = |transform: Value| build::<4>(json!({"box": boxed.clone(), "transform": transform}));
    let original = placed(json!([]));
    let same = |surface: &Surface<4>, tolerance: f64| {
        assert_eq!(surface.simplices, original.simplices);
        surface.vertices.iter().zip(&original.vertices).for_each(|(a, b)| assert!((a - b).norm() <= tolerance));
    };
    for plane in ["xy", "xz", "xw", "yz", "yw", "zw", "wx", "zy"] {
        same(&placed(json!([{"rotate": {"plane": plane, "degrees": 360}}])), 0.0);
        same(&placed(json!(vec![json!({"rotate": {"plane": plane, "degrees": 90}}); 4])), 0.0);
        same(&placed(json!(vec![json!({"rotate": {"plane": plane, "degrees": 40}}); 9])), 1e-13);
        let back: String = plane.chars().rev().collect();
        let there = json!([{"rotate": {"plane": plane, "degrees": 33}}, {"rotate": {"plane": back, "degrees": 33}}]);
        same(&placed(there), 1e-13);
        let turned = placed(json!([{"rotate": {"plane": plane, "degrees": 33, "center": [9, 9, 9, 9]}}]));
        assert_closed_manifold(&turned);
        close(volume(&turned), 24.0);
    }
    // x goes to w, w to -x: sense, order of the steps, centre.
    let corner = |transform: Value| placed(transform).vertices[0];
    assert_eq!(corner(json!([{"rotate": {"plane": "xw", "degrees": 90}}])), Vector64::from([-4.0, 2.0, 3.0, 1.0]));
    assert_eq!(corner(json!([{"rotate": {"plane": "wx", "degrees": 90}}])), Vector64::from([4.0, 2.0, 3.0, -1.0]));
    let steps = json!([{"scale": 2}, {"translate": [1, 0, 0, 0]}]);
    assert_eq!(corner(steps), Vector64::from([3.0, 4.0, 6.0, 8.0]));
    let steps = json!([{"translate": [1, 0, 0, 0]}, {"scale": [2, 1, 1, -1]}]);
    assert_eq!(corner(steps), Vector64::from([4.0, 2.0, 3.0, -4.0]));
    let about = json!([{"rotate": {"plane": "xy", "degrees": 90, "center": [1, 2, 0, 0]}}]);
    assert_eq!(corner(about), Vector64::from([1.0, 2.0, 3.0, 4.0]));
    // Mirrors keep outwards outwards.
    for factors in [json!([-1, 1, 1, 1]), json!([-1, -2, 1, 1]), json!([-1, -1, -0.5, 1]), json!(-1)] {
        let mirrored = placed(json!([{"scale": factors}]));
        assert_closed_manifold(&mirrored);
    }
    let mirrored = build::<3>(json!({"sphere": {"radius": 1, "subdivisions": 2}, "transform": [{"scale": -1}]}));
    assert_closed_manifold(&mirrored);

    for (transform, message) in [
        (json!([{"scale": 0}]), "transform.0.scale: a factor of 0 flattens the object; give another"),
        (json!([{"scale": [1, 2, 3]}]), "transform.0.scale: expected 4 numbers, one an axis (x, y, z, w), found 3"),
        (json!([{"scale": 1}, {}]), "transform.1: does nothing; give one of scale, rotate, translate"),
        (
            json!([{"scale": 1, "translate": [0, 0, 0, 0]}]),
            "transform.0: holds more than one of scale, rotate, translate; make it several steps",
        ),
        (
            json!([{"rotate": {"plane": "xv", "degrees": 1}}]),
            "transform.0.rotate.plane: \"xv\" is not a plane; write two of x, y, z, w",
        ),
        (json!([{"translate": [1e39, 0, 0, 0]}]), "transform: vertex 0 has x = 1e39, beyond single precision (3.4e38)"),
        (json!(vec![json!({"scale": 1e300}); 2]), "transform: vertex 0 has x = inf, beyond single precision (3.4e38)"),
    ] {
        assert_eq!(refusal::<4>(json!({"box": boxed.clone(), "transform": transform})), message);
    }
}

#[test]
fn listed_simplices() {
    let vertices = json!([[0, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]);
    let surface = build::<4>(json!({"simplices": {"vertices": vertices, "cells": [[3, 1, 2, 0]]}}));
    assert_eq!((surface.vertices.len(), surface.simplices), (4, vec![[3, 1, 2, 0]]));
    for (cells, message) in [
        (
            json!([[0, 1, 2, 3], [0, 1, 2, 4]]),
            "simplices.cells.1: vertex 4 does not exist; there are 4, counted from 0",
        ),
        (json!([[0, 1, 2]]), "simplices.cells.0: expected the 4 vertices of a tetrahedron, found 3"),
        (json!([[0, 1, 2, 1]]), "simplices.cells.0: names vertex 1 twice"),
    ] {
        assert_eq!(refusal::<4>(json!({"simplices": {"vertices": vertices, "cells": cells}})), message);
    }
    assert_eq!(
        refusal::<3>(json!({"simplices": {"vertices": [[0, 0, 0], [0, 0]], "cells": []}})),
        "simplices.vertices.1: expected 3 numbers, one an axis (x, y, z), found 2"
    );
    let mut nan = spec(json!({"simplices": {"vertices": [[0, 0, 0]], "cells": []}}));
    nan.simplices.as_mut().unwrap().vertices[0][1] = f64::NAN;
    let message = build_object::<3>(&nan, &meshes()).unwrap_err().to_string();
    assert_eq!(message, "simplices.vertices.0: y is NaN, but must be finite");
}

#[test]
fn refusals_name_key_value_and_remedy() {
    let refused = [
        (
            json!({}),
            "the object has no shape; give it one of simplices, file, extrude, cut_cube, box, tesseract, hypersphere, sphere, isosurface, spin, polytope, duoprism, duocylinder, spherinder, cubinder",
        ),
        (
            json!({"tesseract": {}, "hypersphere": {"radius": 1, "subdivisions": 1}}),
            "hypersphere: the object is already a tesseract; an object has one shape, so make it two objects",
        ),
        (json!({"tesseract": {"size": -1}}), "tesseract.size: -1 is not above 0"),
        (json!({"tesseract": {"subdivisions": 0}}), "tesseract.subdivisions: 0 subdivisions; the least is 1"),
        (
            json!({"tesseract": {"subdivisions": 102}}),
            "tesseract.subdivisions: this would make 50937984 simplices; one object may have 50000000 at most",
        ),
        (
            json!({"tesseract": {"subdivisions": 1_000_000_000}}),
            "tesseract.subdivisions: this would make 48000000000000000000000000000 simplices; \
             one object may have 50000000 at most",
        ),
        (
            json!({"hypersphere": {"radius": 1, "subdivisions": 1_000_000_000}}),
            "hypersphere.subdivisions: this would make 16000000000000000000000000000 simplices; \
             one object may have 50000000 at most",
        ),
        (json!({"hypersphere": {"radius": 0, "subdivisions": 3}}), "hypersphere.radius: 0 is not above 0"),
        (
            json!({"hypersphere": {"radius": 1, "center": [1], "subdivisions": 3}}),
            "hypersphere.center: expected 4 numbers, one an axis (x, y, z, w), found 1",
        ),
        (
            json!({"sphere": {"radius": 1, "subdivisions": 3}}),
            "sphere: needs a scene of dimension 3, not 4; take a hypersphere",
        ),
        (
            json!({"box": {"min": [0, 0, 0, 0], "max": [1, 1, 0, 1]}}),
            "box.max: z goes from 0 to 0; max must be above min",
        ),
        (
            json!({"cut_cube": {"min": [0, 0, 0, 0], "max": [1, 1, 1, 1], "cuts": [{"from": [0, 0, 0, 1], "to": [1, 1, 1, 2]}]}}),
            "cut_cube.cuts.0: misses the cube: it spans 1 to 2 along w, the cube 0 to 1",
        ),
        (
            json!({"cut_cube": {"min": [0, 0, 0, 0], "max": [1, 1, 1, 1], "cuts": [{"from": [0, 0, 0, 0], "to": [1, 1, 1, 2]}]}}),
            "cut_cube.cuts: the cuts leave nothing of the cube",
        ),
        (
            json!({"cut_cube": {"min": [0, 0, 0, 0], "max": [1, 1, 1, 1], "cuts": [], "subdivisions": 1000}}),
            "cut_cube.subdivisions: too many pieces: a lattice of 1003003001 points or more; the most is 50000000",
        ),
        (
            json!({"extrude": {"mesh": "nut.vtu", "from": 1, "to": 1}}),
            "extrude.to: 1 is also where the sweep begins; give another",
        ),
        (
            json!({"extrude": {"mesh": "nut.vtu", "from": 0, "to": 1, "layers": 100_000_000}}),
            "extrude.layers: this would make 214200002746 simplices; one object may have 50000000 at most",
        ),
        (
            json!({"extrude": {"mesh": "nut.vtu", "from": 0, "to": 1, "direction": [1, 0, 0, 0]}}),
            "extrude.direction: the last number is 0: the mesh would be swept within its own space, not out of it",
        ),
        (json!({"tesseract": {}, "color": 2}), "color: 2 is not from 0 to 1"),
    ];
    for (object, message) in refused {
        assert_eq!(refusal::<4>(object.clone()), message, "{object}");
    }
    assert_eq!(refusal::<3>(json!({"tesseract": {}})), "tesseract: needs a scene of dimension 4, not 3; take a box");
    assert_eq!(
        refusal::<3>(json!({"extrude": {"mesh": "nut.vtu", "from": 0, "to": 1}})),
        "extrude: needs a scene of dimension 4, not 3; take file"
    );
    // Unknown keys are told with all known ones, so that the nearest can be found.
    let unknown = serde_json::from_value::<ObjectSpec>(json!({"tesserakt": {}})).unwrap_err().to_string();
    for key in ["tesserakt", "tesseract", "box", "cut_cube", "transform", "orientation"] {
        assert!(unknown.contains(&format!("`{key}`")), "{unknown}");
    }
    let wrong = serde_json::from_value::<ObjectSpec>(json!({"tesseract": {}, "transform": [{"scale": "big"}]}));
    assert_eq!(wrong.unwrap_err().to_string(), "expected a number, or a list with one number an axis");
}

/// A folder of files, gone after the test.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn write(&self, name: &str, bytes: &[u8]) {
        std::fs::write(self.0.path().join(name), bytes).unwrap();
    }

    fn read<const D: usize>(&self, name: &str) -> Result<Surface<D>, String> {
        build_object(&spec(json!({"file": name})), self.0.path()).map_err(|error| error.to_string())
    }
}

const CORNER: [[[f32; 3]; 3]; 4] = {
    let (o, x, y, z) = ([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    [[o, y, x], [o, x, z], [o, z, y], [x, y, z]]
};

fn ascii_stl(name: &str, triangles: &[[[f32; 3]; 3]]) -> String {
    let mut text = format!("solid{name}\n");
    for triangle in triangles {
        text += "facet normal 0 0 0\n outer loop\n";
        for [x, y, z] in triangle {
            text += &format!("  vertex {x} {y} {z:e}\n");
        }
        text += " endloop\nendfacet\n";
    }
    text + "endsolid" + name + "\n"
}

fn binary_stl(header: &str) -> Vec<u8> {
    let mut bytes = [b' '; 80].to_vec();
    bytes[..header.len()].copy_from_slice(header.as_bytes());
    bytes.extend((CORNER.len() as u32).to_le_bytes());
    for triangle in CORNER {
        bytes.extend([0u8; 12]);
        triangle.as_flattened().iter().for_each(|x| bytes.extend(x.to_le_bytes()));
        bytes.extend([0u8; 2]);
    }
    bytes
}

fn ascii_ply() -> String {
    let mut text = String::from(
        "ply\nformat ascii 1.0\ncomment by hand\nelement vertex 4\nproperty double x\nproperty float y\nproperty int z\n\
         property uchar red\nelement face 4\nproperty list uchar short vertex_index\nend_header\n",
    );
    text += "0 0 0 9\n1 0 0 9\n0 1 0 9\n0 0 1 9\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
    text
}

fn binary_ply(big: bool) -> Vec<u8> {
    let order = if big { "big" } else { "little" };
    let header = format!(
        "ply\nformat binary_{order}_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
         element face 4\nproperty list uchar int vertex_indices\nend_header\n"
    );
    let mut bytes = header.into_bytes();
    let mut put = |four: [u8; 4]| bytes.extend(if big { four.into_iter().rev().collect() } else { four.to_vec() });
    for point in [[0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
        point.iter().for_each(|x| put(x.to_le_bytes()));
    }
    for face in [[0i32, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] {
        bytes.push(3);
        face.iter().for_each(|i| bytes.extend(if big { i.to_be_bytes() } else { i.to_le_bytes() }));
    }
    bytes
}

/// Tetrahedra or triangles, as VTK writes them in ascii.
fn vtu(points: &[[f64; 3]], arrays: &[(&str, usize, Vec<f64>)], kind: u8, cells: &[&[u32]]) -> String {
    let list = |numbers: &mut dyn Iterator<Item = String>| numbers.collect::<Vec<_>>().join(" ");
    let mut text = format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\">\n\
         <UnstructuredGrid>\n<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n<PointData>\n",
        points.len(),
        cells.len()
    );
    for (name, components, values) in arrays {
        text += &format!(
            "<DataArray type=\"Float64\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"ascii\">\n{}\n</DataArray>\n",
            list(&mut values.iter().map(f64::to_string))
        );
    }
    let mut end = 0;
    text += &format!(
        "</PointData>\n<Points>\n<DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">\n{}\n</DataArray>\n</Points>\n\
         <Cells>\n<DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">\n{}\n</DataArray>\n\
         <DataArray type=\"Int64\" Name=\"offsets\" format=\"ascii\">\n{}\n</DataArray>\n\
         <DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">\n{}\n</DataArray>\n</Cells>\n\
         </Piece>\n</UnstructuredGrid>\n</VTKFile>\n",
        list(&mut points.as_flattened().iter().map(f64::to_string)),
        list(&mut cells.iter().flat_map(|cell| cell.iter().map(u32::to_string))),
        list(&mut cells.iter().map(|cell| {
            end += cell.len();
            end.to_string()
        })),
        list(&mut cells.iter().map(|_| kind.to_string())),
    );
    text
}

const ORIGIN_AND_UNITS: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

#[test]
fn triangle_files() {
    let folder = Folder::new();
    folder.write("named.stl", ascii_stl(" corner of a cube", &CORNER).as_bytes());
    folder.write("bare.stl", ascii_stl("", &CORNER).as_bytes());
    folder.write("upper.STL", ascii_stl("", &CORNER).to_uppercase().replace('\n', "\r\n").as_bytes());
    let two = ascii_stl(" a", &CORNER[..1]) + &ascii_stl(" b", &CORNER[1..]);
    folder.write("two-solids.stl", two.as_bytes());
    folder.write("binary.stl", &binary_stl("made by hand"));
    folder.write("solid-binary.stl", &binary_stl("solid, though binary"));
    folder.write("minus-zero.stl", ascii_stl("", &CORNER).replace("  vertex 0 0", "  vertex -0 0").as_bytes());
    folder.write("ascii.ply", ascii_ply().as_bytes());
    folder.write("little.ply", &binary_ply(false));
    folder.write("big.ply", &binary_ply(true));
    let cells: [&[u32]; 4] = [&[0, 2, 1], &[0, 1, 3], &[0, 3, 2], &[1, 2, 3]];
    folder.write("triangles.vtu", vtu(&ORIGIN_AND_UNITS, &[], 5, &cells).as_bytes());
    for name in [
        "named.stl",
        "bare.stl",
        "upper.STL",
        "two-solids.stl",
        "binary.stl",
        "solid-binary.stl",
        "minus-zero.stl",
        "ascii.ply",
        "little.ply",
        "big.ply",
        "triangles.vtu",
    ] {
        let surface = folder.read::<3>(name).unwrap();
        assert_eq!((surface.vertices.len(), surface.simplices.len()), (4, 4), "{name}");
        assert_closed_manifold(&surface);
        close(volume(&surface), 1.0 / 6.0);
    }
    // A quadrilateral becomes two triangles; this one is not plane, so an ear is cut.
    let quad = ascii_ply().replace("face 4", "face 1").replace("3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n", "4 0 1 3 2\n");
    folder.write("quad.ply", quad.as_bytes());
    assert_eq!(folder.read::<3>("quad.ply").unwrap().simplices, [[3, 2, 1], [2, 0, 1]]);
}

#[test]
fn files_of_tetrahedra_with_positions() {
    let folder = Folder::new();
    let position = |w: f64| -> Vec<f64> { ORIGIN_AND_UNITS.iter().flat_map(|[x, y, z]| [*x, *y, *z, w]).collect() };
    let flat = [[0.0; 3]; 4];
    let one: [&[u32]; 1] = [&[0, 1, 2, 3]];
    folder.write("plain.vtu", vtu(&flat, &[("position", 4, position(-2.0))], 10, &one).as_bytes());
    let surface = folder.read::<4>("plain.vtu").unwrap();
    assert_eq!((surface.simplices.as_slice(), surface.normals.is_none()), ([[0, 1, 2, 3]].as_slice(), true));
    assert_eq!(surface.vertices[2], Vector64::from([0.0, 1.0, 0.0, -2.0]));

    let up = [0.0, 0.0, 0.0, 2.0].repeat(4);
    let arrays = [("position", 4, position(-2.0)), ("normal", 4, up)];
    folder.write("normals.vtu", vtu(&flat, &arrays, 10, &one).as_bytes());
    assert_eq!(folder.read::<4>("normals.vtu").unwrap().normals.unwrap()[3], Vector64::from([0.0, 0.0, 0.0, 2.0]));
    // Placed, normals go along.
    let steps = json!([{"scale": [1, 1, 1, -2]}, {"rotate": {"plane": "xw", "degrees": 90}}]);
    let placed = build_object::<4>(&spec(json!({"file": "normals.vtu", "transform": steps})), folder.0.path()).unwrap();
    assert_eq!(placed.normals.unwrap()[0], Vector64::from([1.0, 0.0, 0.0, -0.0]));

    let refused = |name: &str, text: String, message: &str| {
        folder.write(name, text.as_bytes());
        let found = folder.read::<4>(name).unwrap_err();
        assert!(found.starts_with("file: ") && found.contains(name) && found.ends_with(message), "{found}");
    };
    refused(
        "points.vtu",
        vtu(&ORIGIN_AND_UNITS, &[], 10, &one),
        "has no point array \"position\" of 4 components; extrude sweeps a three-dimensional mesh along w",
    );
    let three = ORIGIN_AND_UNITS.as_flattened().to_vec();
    refused(
        "three.vtu",
        vtu(&flat, &[("position", 3, three)], 10, &one),
        "\"position\" has 3 components and 12 values; expected 4 components at each of 4 points",
    );
    refused("nan.vtu", vtu(&flat, &[("position", 4, position(f64::NAN))], 10, &one), "\"position\" is NaN at point 0");
    refused(
        "index.vtu",
        vtu(&flat, &[], 10, &[&[0, 1, 2, 4]]),
        "array `connectivity` is damaged: point 4 of 4 does not exist",
    );
    refused("none.vtu", vtu(&flat, &[], 10, &[]), "holds no triangle, only 4 points");
    refused(
        "wedge.vtu",
        vtu(&flat, &[], 24, &[&[0, 1, 2, 3, 1, 2, 3, 0, 1, 2]]),
        "cell 0 is a curved tetrahedron (VTK type 24), which is not understood; ParaView's Tetrahedralize divides it, and a \
         mesher's order 1 avoids it",
    );
    refused("short.vtu", vtu(&flat, &[], 10, &[&[0, 1, 2]]), "cell 0 is a tetrahedron of 3 points");
}

/// The same tetrahedron as ParaView saves by default, appended raw, and packed by zlib.
#[test]
fn files_with_appended_and_compressed_arrays() {
    use std::io::Write;
    let folder = Folder::new();
    for packed in [false, true] {
        let mut appended = Vec::new();
        let mut place = |bytes: Vec<u8>| {
            let offset = appended.len();
            if packed {
                let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), Default::default());
                encoder.write_all(&bytes).unwrap();
                let block = encoder.finish().unwrap();
                // One block: how many, how long, how long the last, how long when packed.
                for n in [1, bytes.len(), 0, block.len()] {
                    appended.extend((n as u64).to_le_bytes());
                }
                appended.extend(block);
            } else {
                appended.extend((bytes.len() as u64).to_le_bytes());
                appended.extend(bytes);
            }
            offset
        };
        let floats = |values: &[f64]| values.iter().flat_map(|x| (*x as f32).to_le_bytes()).collect::<Vec<u8>>();
        let position: Vec<f64> = ORIGIN_AND_UNITS.iter().flat_map(|[x, y, z]| [*x, *y, *z, -2.0]).collect();
        let offsets = [
            place(floats(&position)),
            place(floats(ORIGIN_AND_UNITS.as_flattened())),
            place((0..4i64).flat_map(i64::to_le_bytes).collect()),
            place(4i64.to_le_bytes().to_vec()),
            place(vec![10]),
        ];
        let array = |i: usize, kind: &str, name: &str, components: usize| {
            format!(
                "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"appended\" offset=\"{}\"/>",
                offsets[i]
            )
        };
        let compressor = if packed { " compressor=\"vtkZLibDataCompressor\"" } else { "" };
        let mut file = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" \
             header_type=\"UInt64\"{compressor}>\n<UnstructuredGrid>\n<Piece NumberOfPoints=\"4\" NumberOfCells=\"1\">\n\
             <PointData>{}</PointData>\n<Points>{}</Points>\n<Cells>{}{}{}</Cells>\n\
             </Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n_",
            array(0, "Float32", "position", 4),
            array(1, "Float32", "Points", 3),
            array(2, "Int64", "connectivity", 1),
            array(3, "Int64", "offsets", 1),
            array(4, "UInt8", "types", 1),
        )
        .into_bytes();
        file.extend(appended);
        file.extend(b"\n</AppendedData>\n</VTKFile>\n");
        folder.write("t.vtu", &file);
        let surface = folder.read::<4>("t.vtu").unwrap();
        assert_eq!(surface.simplices, [[0, 1, 2, 3]], "packed: {packed}");
        assert_eq!(surface.vertices[1], Vector64::from([1.0, 0.0, 0.0, -2.0]));
        folder.write("t.vtu", &file[..file.len() - 40]);
        let cut = folder.read::<4>("t.vtu").unwrap_err();
        assert!(cut.contains("cut short"), "{cut}");
    }
}

#[test]
fn solids_that_make_no_sense_are_refused() {
    let folder = Folder::new();
    let points = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.2, 0.2, 0.5],
        [0.0, 0.0, -1.0],
        [1.0, 1.0, 0.0],
    ];
    let swept = |name: &str, cells: &[&[u32]]| {
        folder.write(name, vtu(&points, &[], 10, cells).as_bytes());
        let object = spec(json!({"extrude": {"mesh": name, "from": 0, "to": 1}}));
        build_object::<4>(&object, folder.0.path()).map_err(|error| error.to_string())
    };
    // Either orientation of either tetrahedron gives the same closed body.
    for cells in [[[0, 1, 2, 3], [0, 1, 2, 5]], [[0, 2, 1, 3], [0, 1, 2, 5]], [[0, 1, 2, 3], [1, 0, 2, 5]]] {
        let surface = swept("two.vtu", &[&cells[0], &cells[1]]).unwrap();
        assert_closed_manifold(&surface);
        close(volume(&surface), 1.0 / 3.0);
    }
    let ends = |result: Result<Surface<4>, String>, message: &str| {
        let found = result.unwrap_err();
        assert!(found.starts_with("extrude.mesh: ") && found.ends_with(message), "{found}");
    };
    let flat = "tetrahedron 1 is flat: it has no volume, and so no orientation; leave it out";
    ends(swept("flat.vtu", &[&[0, 1, 2, 3], &[0, 1, 2, 6]]), flat);
    let same_side = "tetrahedra 0 and 1 lie on the same side of the triangle they share";
    ends(swept("same-side.vtu", &[&[0, 1, 2, 3], &[0, 1, 2, 4]]), same_side);
    let crowd = "tetrahedra 0, 1, 2 all share one triangle, so some of them overlap";
    ends(swept("crowd.vtu", &[&[0, 1, 2, 3], &[0, 1, 2, 5], &[0, 1, 2, 4]]), crowd);
}

#[test]
fn damaged_files_are_refused_by_name() {
    let folder = Folder::new();
    let refused = |name: &str, bytes: &[u8], message: &str| {
        folder.write(name, bytes);
        let found = folder.read::<3>(name).unwrap_err();
        assert!(found.starts_with("file: ") && found.contains(name) && found.contains(message), "{found}");
    };
    for ending in ["stl", "obj", "ply", "msh", "vtk", "vtu"] {
        refused(&format!("empty.{ending}"), b"", "is empty");
        let foreign = b"PK\x03\x04 something else altogether, long enough to be taken for a header of eighty bytes \xff\xff\xff\xff";
        refused(&format!("foreign.{ending}"), foreign, " ");
        assert!(folder.read::<3>(&format!("missing.{ending}")).unwrap_err().contains("can't read"));
        std::fs::create_dir(folder.0.path().join(format!("folder.{ending}"))).unwrap();
        assert!(folder.read::<3>(&format!("folder.{ending}")).unwrap_err().contains("can't read"));
    }
    refused("mesh.obj", b"v 0 0 0", "holds no triangle");
    refused("mesh.off", b"OFF", "unsupported: .off files; export .ply, .obj or .stl");
    refused(
        "mesh.mine",
        b"OFF",
        "the name must end in .stl, .obj, .ply, .msh, .vtk, .vtp, .vtu, .pvtp, .pvtu, .pvd or",
    );
    refused(
        "no-name",
        b"v 0 0 0",
        "the name must end in .stl, .obj, .ply, .msh, .vtk, .vtp, .vtu, .pvtp, .pvtu, .pvd or",
    );
    refused("cut.stl", &binary_stl("x")[..100], "it declares 4 triangles, which take 284 bytes, and has 100");
    let mut uncounted = binary_stl("x");
    uncounted[80..84].fill(0);
    refused("uncounted.stl", &uncounted, "declares no triangles, and has room for 4");
    refused("none.stl", ascii_stl("", &[]).as_bytes(), "holds no triangle");
    refused("word.stl", ascii_stl("", &CORNER).replace("vertex 1", "vertex one").as_bytes(), "triangle 0");
    refused("nan.stl", ascii_stl("", &CORNER).replace("vertex 1", "vertex nan").as_bytes(), "finite");
    let mut infinite = binary_stl("x");
    infinite[84 + 12..84 + 16].copy_from_slice(&f32::INFINITY.to_le_bytes());
    refused("infinite.stl", &infinite, "point 0 is not finite: (inf, 0, 0)");
    let ply = ascii_ply();
    refused("index.ply", ply.replace("3 1 2 3", "3 1 2 4").as_bytes(), "cell 3 names point 4 of 4");
    refused("negative.ply", ply.replace("3 1 2 3", "3 1 2 -3").as_bytes(), "face 3 has no list");
    refused("two.ply", ply.replace("3 1 2 3", "2 1 2").as_bytes(), "face 3 has 2 vertices");
    refused("count.ply", ply.replace("vertex 4", "vertex 4000000000").as_bytes(), "it declares 4000000000 times");
    refused("no-x.ply", ply.replace("double x", "double u").as_bytes(), "vertex 0 has no coordinate \"x\"");
    refused("no-face.ply", ply.replace("element face", "element facet").as_bytes(), "has no element \"face\"");
    let triangle: [&[u32]; 1] = [&[0, 1, 2]];
    let grid = vtu(&ORIGIN_AND_UNITS, &[], 5, &triangle);
    refused("image.vtu", grid.replace("UnstructuredGrid", "PolyData").as_bytes(), " ");
    let tetrahedron: [&[u32]; 1] = [&[0, 1, 2, 3]];
    refused("solid.vtu", vtu(&ORIGIN_AND_UNITS, &[], 10, &tetrahedron).as_bytes(), "holds tetrahedra");
    assert!(refusal::<4>(json!({"file": "ant.ply"})).contains("take extrude, or dimension: 3"));
}

#[test]
fn files_cut_off_or_changed_anywhere_never_panic() {
    let folder = Folder::new();
    let cells: [&[u32]; 2] = [&[0, 1, 2], &[0, 2, 3]];
    let files: [(&str, Vec<u8>); 6] = [
        ("cut-ascii.stl", ascii_stl("", &CORNER[..2]).into_bytes()),
        ("cut-binary.stl", binary_stl("")),
        ("cut-ascii.ply", ascii_ply().into_bytes()),
        ("cut-little.ply", binary_ply(false)),
        ("cut-big.ply", binary_ply(true)),
        ("cut.vtu", vtu(&ORIGIN_AND_UNITS, &[], 5, &cells).into_bytes()),
    ];
    for (name, whole) in &files {
        folder.write(name, whole);
        let surface = folder.read::<3>(name).unwrap();
        // What follows the last number may be lost without loss.
        let last = whole.trim_ascii_end().len() - if name.ends_with(".vtu") { "</VTKFile>".len() } else { 0 };
        for length in 0..whole.len() {
            folder.write(name, &whole[..length]);
            match folder.read::<3>(name) {
                Err(_) => {}
                Ok(read) => assert!(length >= last && read == surface, "{name} cut to {length} of {}", whole.len()),
            }
        }
        for at in 0..whole.len() {
            for change in [0u8, b'9', 0xff] {
                let mut changed = whole.clone();
                changed[at] = change;
                folder.write(name, &changed);
                // It may still be a mesh; then a whole one.
                if let Ok(read) = folder.read::<3>(name) {
                    assert!(read.simplices.as_flattened().iter().all(|&i| (i as usize) < read.vertices.len()));
                    assert!(read.vertices.iter().all(|v| v.iter().all(|x| x.is_finite())));
                }
            }
        }
    }
}

#[test]
fn shapes_have_no_slivers() {
    let worst = |object: Value| {
        let surface = build::<4>(object);
        worst_quality(corners(&surface.vertices, &surface.simplices)).unwrap().1
    };
    // A path along three edges of a cube: volume 1/6, squared edges 1, 1, 1, 2, 2, 3.
    let path = 12.0 * 0.5f64.powf(2.0 / 3.0) / 10.0;
    close(worst(json!({"tesseract": {"subdivisions": 2}})), path);
    let cut = json!([{"from": [0.5, 0.5, 0, 0], "to": [1, 1, 1, 1]}]);
    let cut = json!({"min": [0, 0, 0, 0], "max": [1, 1, 1, 1], "cuts": cut, "subdivisions": 4});
    close(worst(json!({"cut_cube": cut})), path);
    // Projection distorts the pieces of a sphere, the more the finer they are, but not without limit.
    let sphere = |n| worst(json!({"hypersphere": {"radius": 1, "subdivisions": n}}));
    close(sphere(1), 1.0);
    let (coarse, fine) = (sphere(6), sphere(12));
    assert!(coarse > fine && fine > 0.7, "{coarse} {fine}");
}

/// The schema that editors use knows the keys and what they mean.
#[test]
fn schema_describes_every_key() {
    let schema = serde_json::to_value(schemars::schema_for!(ObjectSpec)).unwrap();
    let properties = schema["properties"].as_object().unwrap();
    for key in ["simplices", "file", "extrude", "cut_cube", "box", "tesseract", "hypersphere", "sphere", "transform"] {
        let described = properties[key]["description"].as_str().unwrap_or_default();
        assert!(described.len() > 10, "{key}: {}", properties[key]);
    }
    assert_eq!(schema["additionalProperties"], json!(false));
    assert_eq!(schema["$defs"]["RotateSpec"]["required"], json!(["plane", "degrees"]));
}
