//! Bodies of R^4 and R^3 against what is known of them: isosurfaces, polytopes, products, motions.

use std::collections::HashMap;
use std::f64::consts::PI;
use std::fs;
use std::path::Path;

use ao4d::geometry::{Dimension, Vector, Vector64, normal_of};
use ao4d::io::vtk;
use ao4d::mesh::edges::{Edges, edges};
use ao4d::mesh::peel::Hopf;
use ao4d::mesh::section::{Hyperplane, Section, section};
use ao4d::mesh::topology::{corners, enclosed_volume, facet_pairs, singular_vertices, surface_measure, worst_quality};
use ao4d::mesh::{Crease, Mesh, MeshBuilder, Orientation, Surface};
use ao4d::pipeline::{self, Document, Pipeline, Settings};
use ao4d::progress::Silent;
use ao4d::scene::{ObjectSpec, build_object};
use serde_json::{Value, json};

fn spec(object: Value) -> ObjectSpec {
    serde_json::from_value(object.clone()).unwrap_or_else(|error| panic!("{object}: {error}"))
}

fn build<const D: usize>(object: Value) -> Surface<D> {
    build_object(&spec(object.clone()), Path::new(".")).unwrap_or_else(|error| panic!("{object}: {error}"))
}

/// With the meshes that ship with the program.
fn build_of_mesh<const D: usize>(object: Value) -> Surface<D> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines/meshes");
    build_object(&spec(object.clone()), &folder).unwrap_or_else(|error| panic!("{object}: {error}"))
}

fn refusal<const D: usize>(object: Value) -> String {
    build_object::<D>(&spec(object.clone()), Path::new(".")).expect_err(&object.to_string()).to_string()
}

fn volume<const D: usize>(surface: &Surface<D>) -> f64 {
    enclosed_volume(corners(&surface.vertices, &surface.simplices))
}

fn area<const D: usize>(surface: &Surface<D>) -> f64 {
    surface_measure(corners(&surface.vertices, &surface.simplices))
}

fn near(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance * expected.abs(), "{found}, expected {expected}");
}

/// Every facet twice with opposite orientation, facing outwards, no vertex unused.
fn assert_closed_manifold<const D: usize>(surface: &Surface<D>) {
    let pairs = facet_pairs(&surface.simplices);
    assert!(pairs.is_manifold() && pairs.is_closed(), "{pairs:?}");
    assert!(volume(surface) > 0.0, "faces inwards");
    assert_eq!(singular_vertices(&surface.simplices), 0, "touches itself");
    let mut used = vec![false; surface.vertices.len()];
    surface.simplices.as_flattened().iter().for_each(|&i| used[i as usize] = true);
    assert!(used.iter().all(|&used| used));
    if D == 4 {
        // Euler characteristic 0, with 2 facets a simplex: V - E + T = 0.
        let edges = surface.simplices.iter().flat_map(|s| (0..D).flat_map(move |i| (0..i).map(move |j| (s[i], s[j]))));
        let mut edges: Vec<(u32, u32)> = edges.map(|(a, b)| (a.min(b), a.max(b))).collect();
        edges.sort_unstable();
        edges.dedup();
        assert_eq!(edges.len(), surface.vertices.len() + surface.simplices.len());
    }
}

fn isosurface(field: Value, cells: u32) -> Value {
    json!({"isosurface": {"field": field, "grid": {"cells": cells}}})
}

#[test]
fn bodies_converge_with_the_square_of_the_cells() {
    let bodies = [
        (json!({"hypersphere": {"radius": 2}}), 2.0 * PI * PI * 8.0, PI * PI * 8.0),
        (json!({"tiger": {"major": [1.0, 1.2], "minor": 0.5}}), 8.0 * PI.powi(3) * 0.6, 4.0 * PI.powi(3) * 0.3),
        (
            json!({"torisphere": {"major": 1, "minor": 0.5}}),
            8.0 * PI * PI * 0.5 + 0.5 * PI * PI,
            PI * PI + PI * PI / 16.0,
        ),
        (json!({"spheritorus": {"major": 1, "minor": 0.5}}), 2.0 * PI * PI, PI * PI / 3.0),
        (json!({"ditorus": {"major": 2, "middle": 1, "minor": 0.5}}), 8.0 * PI.powi(3), 4.0 * PI.powi(3) * 0.5),
    ];
    for (body, area_there, volume_there) in bodies {
        let errors = [12, 24].map(|cells| {
            let surface = build::<4>(isosurface(body.clone(), cells));
            assert_closed_manifold(&surface);
            [1.0 - area(&surface) / area_there, 1.0 - volume(&surface) / volume_there]
        });
        for (coarse, fine) in errors[0].into_iter().zip(errors[1]) {
            assert!(fine > 0.0 && fine < 0.04 && (3.0..5.5).contains(&(coarse / fine)), "{body}: {coarse} {fine}");
        }
    }
}

#[test]
fn marching_cubes_in_3d() {
    for (body, area_there, volume_there) in [
        (json!({"hypersphere": {"radius": 1}}), 4.0 * PI, 4.0 / 3.0 * PI),
        (json!({"torus": {"major": 1, "minor": 0.4}}), 4.0 * PI * PI * 0.4, 2.0 * PI * PI * 0.16),
    ] {
        let errors = [20, 40].map(|cells| {
            let surface = build::<3>(isosurface(body.clone(), cells));
            assert_closed_manifold(&surface);
            [1.0 - area(&surface) / area_there, 1.0 - volume(&surface) / volume_there]
        });
        for (coarse, fine) in errors[0].into_iter().zip(errors[1]) {
            assert!(fine > 0.0 && fine < 0.02 && (3.0..5.5).contains(&(coarse / fine)), "{body}: {coarse} {fine}");
        }
    }
}

/// Marching pentatopes: each cell of a grid of unit cells cut into 24 simplices along the orders of the axes (Kuhn), each
/// simplex parted by the product of its corners inside and outside. Independent of the table.
fn pentatopes(cells: usize, depth: impl Fn([usize; 4]) -> f64) -> Surface<4> {
    let mut surface = Surface::default();
    let mut numbers: HashMap<([usize; 4], [usize; 4]), u32> = HashMap::new();
    let orders: Vec<[usize; 4]> = (0..256)
        .map(|code| std::array::from_fn(|i| code / 4usize.pow(i as u32) % 4))
        .filter(|order: &[usize; 4]| (0..4).all(|axis| order.contains(&axis)))
        .collect();
    for cell in 0..cells.pow(4) {
        let start: [usize; 4] = std::array::from_fn(|axis| cell / cells.pow(axis as u32) % cells);
        for order in &orders {
            let mut at = start;
            let path: [[usize; 4]; 5] = std::array::from_fn(|step| {
                if step > 0 {
                    at[order[step - 1]] += 1;
                }
                at
            });
            let (inside, outside): (Vec<_>, Vec<_>) = path.into_iter().partition(|&point| depth(point) >= 0.0);
            if inside.is_empty() || outside.is_empty() {
                continue;
            }
            let mut vertex = |a: [usize; 4], b: [usize; 4]| {
                *numbers.entry((a, b)).or_insert_with(|| {
                    let share = depth(a) / (depth(a) - depth(b));
                    let place = |axis: usize| a[axis] as f64 + (b[axis] as f64 - a[axis] as f64) * share;
                    surface.vertices.push(Vector64::from_fn(|axis, _| place(axis)));
                    (surface.vertices.len() - 1) as u32
                })
            };
            // Staircases through pairs (inside, outside): three steps.
            for steps in 0..8u32 {
                if steps.count_ones() as usize != inside.len() - 1 {
                    continue;
                }
                let (mut i, mut j) = (0, 0);
                let mut simplex = [vertex(inside[0], outside[0]); 4];
                for (step, slot) in simplex[1..].iter_mut().enumerate() {
                    if steps >> step & 1 == 1 {
                        i += 1
                    } else {
                        j += 1
                    }
                    *slot = vertex(inside[i], outside[j]);
                }
                surface.simplices.push(simplex);
            }
        }
    }
    // Away from the inside: along the descent of depth, as its gradient at the nearest grid point has it.
    for i in 0..surface.simplices.len() {
        let points = surface.simplices[i].map(|v| surface.vertices[v as usize]);
        let middle = points.iter().sum::<Vector64<4>>() / 4.0;
        let low: [usize; 4] = std::array::from_fn(|axis| (middle[axis].floor() as usize).min(cells - 1));
        let slope = Vector64::<4>::from_fn(|axis, _| {
            let mut high = low;
            high[axis] += 1;
            depth(high) - depth(low)
        });
        if normal_of(&points).dot(&slope) > 0.0 {
            surface.simplices[i].swap(2, 3);
        }
    }
    surface
}

#[test]
fn hypercubes_and_pentatopes_agree() {
    // A plane that passes no edge within a tenth of its ends: both are the same flat piece, exactly.
    let plane = json!({"isosurface": {
        "field": {"formula": "x + 2*y + 3*z + 5*w"}, "isovalue": 20.5, "pad": false,
        "grid": {"min": [0, 0, 0, 0], "max": [4, 4, 4, 4], "cells": 4},
    }});
    let hypercubes = build::<4>(plane);
    let simplices = pentatopes(4, |[x, y, z, w]| 20.5 - (x + 2 * y + 3 * z + 5 * w) as f64);
    near(area(&hypercubes), area(&simplices), 1e-12);
    let normal = Vector64::from([1.0, 2.0, 3.0, 5.0]).normalize();
    for simplex in corners(&hypercubes.vertices, &hypercubes.simplices) {
        assert!((normal_of(&simplex).normalize() - normal).norm() < 1e-9);
    }
    // A sphere: both miss about as much of it, and the simplices need five times as many pieces.
    let cells = 12;
    let radius = 0.42 * cells as f64;
    let sphere = json!({"isosurface": {
        "field": {"formula": format!("sqrt(({})) - {radius}", "(x-6)^2 + (y-6)^2 + (z-6)^2 + (w-6)^2")},
        "grid": {"min": [0, 0, 0, 0], "max": [12, 12, 12, 12], "cells": cells},
    }});
    let hypercubes = build::<4>(sphere);
    let simplices =
        pentatopes(cells, |point| radius - point.iter().map(|&x| (x as f64 - 6.0).powi(2)).sum::<f64>().sqrt());
    assert_closed_manifold(&hypercubes);
    assert_closed_manifold(&simplices);
    near(volume(&hypercubes), volume(&simplices), 0.02);
    near(area(&hypercubes), area(&simplices), 0.02);
    let ratio = simplices.simplices.len() as f64 / hypercubes.simplices.len() as f64;
    assert!((4.5..6.5).contains(&ratio), "{ratio}");
}

#[test]
fn isosurfaces_close_at_the_end_of_the_grid() {
    // Half a ball, cut off where the grid ends, a fiftieth of a cell further out.
    let half = |pad: bool| {
        json!({"isosurface": {
            "field": {"formula": "sqrt(x^2 + y^2 + z^2 + w^2)"}, "isovalue": 1, "pad": pad,
            "grid": {"min": [-1.1, -1.1, -1.1, 0], "max": [1.1, 1.1, 1.1, 1.1], "cells": [22, 22, 22, 11]},
        }})
    };
    let closed = build::<4>(half(true));
    assert_closed_manifold(&closed);
    near(volume(&closed), PI * PI / 4.0, 0.03);
    let lowest = closed.vertices.iter().fold(f64::INFINITY, |low, v| low.min(v[3]));
    near(lowest, -0.02 * 0.1, 1e-9);
    let open = facet_pairs(&build::<4>(half(false)).simplices);
    assert!(open.open > 0 && open.misoriented == 0 && open.crowded == 0, "{open:?}");
    // Noise, or as good as: closed as a sum of simplices, whatever happens.
    for formula in ["sin(97*x + 31*y^2) + sin(59*z*y - 77*w*x)", "sqrt(x) + sin(40*y) * cos(40*z*w)"] {
        let noise = build::<4>(json!({"isosurface": {
            "field": {"formula": formula}, "inside": "above",
            "grid": {"min": [-1, -1, -1, -1], "max": [1, 1, 1, 1], "cells": [9, 8, 7, 6]},
        }}));
        let pairs = facet_pairs(&noise.simplices);
        assert!(pairs.is_closed(), "{pairs:?}");
        assert!(volume(&noise) > 0.0);
        // Nothing flat: clamped vertices are all apart.
        assert!(corners(&noise.vertices, &noise.simplices).all(|s| normal_of(&s).norm() > 0.0));
    }
}

#[test]
fn isosurfaces_do_not_depend_on_threads() {
    // More than 64 points a row, so that words of signs meet within it.
    let object = json!({"isosurface": {
        "field": {"gyroid": {"period": 1.3, "wall": 0.3}},
        "grid": {"min": [-1, -0.1, -0.2, -0.2], "max": [1, 0.1, 0.2, 0.2], "cells": [140, 7, 9, 5]},
    }});
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| build::<4>(object.clone()))
    };
    let one = on(1);
    assert!(one == on(2) && one == on(5));
    assert!(facet_pairs(&one.simplices).is_closed());
}

#[test]
fn sides_and_components() {
    // Two balls of different size; the smaller one has far fewer simplices.
    let balls = |extra: Value| {
        let mut object = json!({"isosurface": {
            "field": {"formula": "min(sqrt((x+1)^2 + y^2 + z^2 + w^2) - 0.8, sqrt((x-1)^2 + y^2 + z^2 + w^2) - 0.3)"},
            "grid": {"min": [-2, -1, -1, -1], "max": [2, 1, 1, 1], "cells": [32, 16, 16, 16]},
        }});
        object["isosurface"].as_object_mut().unwrap().extend(extra.as_object().unwrap().clone());
        object
    };
    let both = build::<4>(balls(json!({})));
    let large = build::<4>(balls(json!({"smallest_component": 5000})));
    assert_closed_manifold(&both);
    assert_closed_manifold(&large);
    assert!(large.simplices.len() > 5000 && both.simplices.len() - large.simplices.len() > 200);
    assert!(large.vertices.iter().all(|v| v[0] < 0.0));
    near(volume(&large), PI * PI / 2.0 * 0.8f64.powi(4), 0.03);
    let refused = refusal::<4>(balls(json!({"smallest_component": 1_000_000})));
    assert!(refused.contains("no component of the surface has that many"), "{refused}");
    // Inside out: the box without the balls.
    let without = build::<4>(balls(json!({"inside": "above"})));
    assert!(facet_pairs(&without.simplices).is_closed());
    near(volume(&without) + volume(&both), 32.0, 0.02);
}

#[test]
fn isosurfaces_are_refused_with_reasons() {
    let grid = json!({"min": [-1, -1, -1, -1], "max": [1, 1, 1, 1], "cells": 4});
    let with = |field: Value, grid: &Value| json!({"isosurface": {"field": field, "grid": grid, "isovalue": 7}});
    for (object, message) in [
        (
            with(json!({"formula": "x +* y"}), &grid),
            "isosurface.field.formula: at character 4 (\"*\"): expected a number, a name or \"(\"",
        ),
        (
            with(json!({"formula": "x"}), &json!({"cells": 4})),
            "isosurface.grid: needs min and max: the field has no end of its own",
        ),
        (
            with(json!({"formula": "x"}), &json!({"cells": 4, "min": [0, 0, 0, 0]})),
            "isosurface.grid: has only one of min and max; give both or neither",
        ),
        (with(json!({"formula": "x"}), &json!({"cells": 0})), "isosurface.grid.cells: 0 cells; the least is 1"),
        (
            with(json!({"formula": "x"}), &json!({"cells": [1, 2]})),
            "isosurface.grid.cells: expected 4 numbers, one an axis (x, y, z, w), found 2",
        ),
        (
            with(json!({"tiger": {"major": [1, 0], "minor": 1}}), &grid),
            "isosurface.field.tiger.major: 0 is not above 0",
        ),
        (
            with(json!({"torus": {"major": 1, "minor": 1}}), &grid),
            "isosurface.field.torus: needs a scene of dimension 3, not 4",
        ),
    ] {
        assert_eq!(refusal::<4>(object), message);
    }
    let huge = refusal::<4>(with(json!({"formula": "x"}), &json!({"cells": 100_000})));
    assert!(huge.starts_with("isosurface.grid.cells: the grid has 100004000060000400001 points"), "{huge}");
    let noise = json!({"isosurface": {"field": {"formula": "sin(1e5*x)*sin(1e5*y+z*1e4)*cos(1e5*w)"},
        "grid": {"min": [-1, -1, -1, -1], "max": [1, 1, 1, 1], "cells": 100}}});
    if cfg!(not(debug_assertions)) {
        assert!(refusal::<4>(noise).contains("more than 50000000 simplices"));
    }
}

/// Distinct facets and edges.
fn edges_and_facets(surface: &Surface<4>) -> (usize, usize) {
    let edges = surface.simplices.iter().flat_map(|s| (0..4).flat_map(move |i| (0..i).map(move |j| (s[i], s[j]))));
    let mut edges: Vec<(u32, u32)> = edges.map(|(a, b)| (a.min(b), a.max(b))).collect();
    edges.sort_unstable();
    edges.dedup();
    (edges.len(), facet_pairs(&surface.simplices).facets)
}

#[test]
fn regular_polytopes() {
    let (two, five) = (2f64.sqrt(), 5f64.sqrt());
    for (cells, vertices, tetrahedra, area_there, volume_there) in [
        (5, 5, 5, 5.0 * two / 12.0, five / 96.0),
        (8, 16, 48, 8.0, 1.0),
        (16, 8, 16, 4.0 * two / 3.0, 1.0 / 6.0),
        (24, 24, 96, 8.0 * two, 2.0),
        (120, 600, 3240, 30.0 * (15.0 + 7.0 * five), 15.0 * (105.0 + 47.0 * five) / 4.0),
        (600, 120, 600, 50.0 * two, 25.0 * (2.0 + five) / 4.0),
    ] {
        for n in [1usize, 2, 3] {
            let polytope = json!({"polytope": {"cells": cells, "size": 1, "subdivisions": n}});
            let surface = build::<4>(polytope);
            assert_closed_manifold(&surface);
            assert_eq!(surface.simplices.len(), tetrahedra * n.pow(3));
            // Sums of tens of thousands of terms lose a digit.
            let tolerance = if n == 1 { 1e-12 } else { 1e-11 };
            near(area(&surface), area_there, tolerance);
            near(volume(&surface), volume_there, tolerance);
            if n == 1 {
                assert_eq!(surface.vertices.len(), vertices);
            }
        }
        let unit = build::<4>(json!({"polytope": {"cells": cells}}));
        unit.vertices.iter().for_each(|v| near(v.norm(), 1.0, 1e-14));
    }
    // Those of tetrahedra have no edges and triangles but their own.
    let f_vector = |cells: u32| edges_and_facets(&build::<4>(json!({"polytope": {"cells": cells}})));
    assert_eq!((f_vector(5), f_vector(16), f_vector(600)), ((10, 10), (24, 32), (720, 1200)));
    assert_eq!(
        refusal::<4>(json!({"polytope": {"cells": 7}})),
        "polytope.cells: there is none of 7 cells; the six have 5, 8, 16, 24, 120 and 600"
    );
    assert_eq!(
        refusal::<3>(json!({"polytope": {"cells": 24}})),
        "polytope.cells: there is none of 24 faces; the six have 4, 6, 8, 12, 14 and 20"
    );
    assert!(refusal::<4>(json!({"polytope": {"cells": 600, "subdivisions": 50}})).contains("75000000 simplices"));
}

#[test]
fn hypersphere_from_the_600_cell() {
    let sphere = |n: u32| build::<4>(json!({"hypersphere": {"radius": 1, "subdivisions": n, "from": "600-cell"}}));
    let missing = |surface: &Surface<4>| 1.0 - volume(surface) / (PI * PI / 2.0);
    let (one, two, four) = (sphere(1), sphere(2), sphere(4));
    assert_eq!((two.vertices.len(), two.simplices.len()), (840, 4800));
    assert_eq!((four.vertices.len(), four.simplices.len()), (6480, 38400));
    for surface in [&one, &two, &four] {
        assert_closed_manifold(surface);
        surface.vertices.iter().for_each(|v| near(v.norm(), 1.0, 1e-14));
    }
    let order = missing(&two) / missing(&four);
    assert!((3.5..4.2).contains(&order), "{order}");
    let quality = |surface: &Surface<4>| worst_quality(corners(&surface.vertices, &surface.simplices)).unwrap().1;
    let from_16 = build::<4>(json!({"hypersphere": {"radius": 1, "subdivisions": 13}}));
    assert!(quality(&four) > 0.6 && quality(&four) > quality(&from_16), "{} {}", quality(&four), quality(&from_16));
    let refused = refusal::<3>(json!({"sphere": {"radius": 1, "subdivisions": 1, "from": "600-cell"}}));
    assert!(refused.starts_with("sphere.from"), "{refused}");
}

#[test]
fn products() {
    for (p, q) in [(3usize, 3usize), (3, 5), (4, 4), (6, 7)] {
        let [a, b] = [1.0, 0.7];
        let polygon = |n: usize, r: f64| {
            let half = PI / n as f64;
            (n as f64 * r * r * half.sin() * half.cos(), 2.0 * n as f64 * r * half.sin())
        };
        let ((area_p, rim_p), (area_q, rim_q)) = (polygon(p, a), polygon(q, b));
        for n in [1, 2, 4] {
            let surface = build::<4>(json!({"duoprism": {"sides": [p, q], "radii": [a, b], "subdivisions": n}}));
            assert_closed_manifold(&surface);
            near(volume(&surface), area_p * area_q, 1e-12);
            near(area(&surface), rim_p * area_q + area_p * rim_q, 1e-12);
            if n == 1 {
                assert_eq!(surface.vertices.len(), p * q);
                assert_eq!(surface.simplices.len(), 3 * (p * (q - 2) + q * (p - 2)));
            }
        }
    }
    for (body, area_there, volume_there) in [
        (json!({"duocylinder": {"radii": [1, 0.5]}}), PI * PI * 1.5, PI * PI * 0.25),
        (json!({"spherinder": {"radius": 1, "height": 2}}), 8.0 * PI + 8.0 / 3.0 * PI, 8.0 / 3.0 * PI),
        (json!({"cubinder": {"radius": 1, "sides": [2, 2]}}), 16.0 * PI, 4.0 * PI),
    ] {
        let errors = [4, 8].map(|n| {
            let mut body = body.clone();
            body.as_object_mut().unwrap().values_mut().for_each(|spec| spec["subdivisions"] = json!(n));
            let surface = build::<4>(body);
            assert_closed_manifold(&surface);
            [1.0 - area(&surface) / area_there, 1.0 - volume(&surface) / volume_there]
        });
        for (coarse, fine) in errors[0].into_iter().zip(errors[1]) {
            assert!(fine > 0.0 && fine < 0.04 && (3.3..4.3).contains(&(coarse / fine)), "{body}: {coarse} {fine}");
        }
    }
    for (object, message) in [
        (json!({"duoprism": {"sides": [2, 3]}}), "duoprism.sides: 2 is not from 3 to 100000"),
        (json!({"duocylinder": {"subdivisions": 0}}), "duocylinder.subdivisions: 0 subdivisions; the least is 1"),
        (
            json!({"duocylinder": {"subdivisions": 4000}}),
            "duocylinder.subdivisions: this would make 13824000000000 simplices; one object may have 50000000 at most",
        ),
        (json!({"spherinder": {"radius": 1, "height": 0, "subdivisions": 2}}), "spherinder.height: 0 is not above 0"),
        (json!({"cubinder": {"radius": 1, "sides": [1, -1], "subdivisions": 2}}), "cubinder.sides: -1 is not above 0"),
    ] {
        assert_eq!(refusal::<4>(object), message);
    }
}

#[test]
fn moving_bodies() {
    let swept = |layers: u32, motion: Value| {
        let object = json!({"extrude": {"mesh": "nut.vtu", "from": -1, "to": 2, "layers": layers, "motion": motion}});
        let surface = build_of_mesh::<4>(object);
        assert_closed_manifold(&surface);
        surface
    };
    let still = swept(1, json!([]));
    let solid = volume(&still) / 3.0;
    // Moving is a shear; scaling by s over the sweep gives a frustum: both are exact with any layers.
    for layers in [1, 4] {
        near(volume(&swept(layers, json!([{"translate": [30, -10, 5]}]))), 3.0 * solid, 1e-12);
        let frustum = 3.0 * solid * (1.0 + 0.5 + 0.25 + 0.125) / 4.0;
        near(volume(&swept(layers, json!([{"scale": 0.5}]))), frustum, if layers == 1 { 0.05 } else { 0.005 });
    }
    assert!(still.simplices == swept(1, json!([{"scale": [1, 1, 2]}])).simplices);
    // Turning loses volume between layers, with the square of their distance.
    let missing = |layers: u32| {
        let turn = json!([{"rotate": {"plane": "xy", "degrees": 60, "center": [81, -82, -81]}}]);
        1.0 - volume(&swept(layers, turn)) / (3.0 * solid)
    };
    let (coarse, fine) = (missing(8), missing(16));
    assert!(fine.abs() < 0.01 && (3.0..5.0).contains(&(coarse / fine)), "{coarse} {fine}");
    let first = |surface: &Surface<4>| surface.vertices.iter().filter(|v| v[3] == -1.0).copied().collect::<Vec<_>>();
    assert_eq!(first(&still), first(&swept(3, json!([{"scale": 2}, {"translate": [1, 2, 3]}]))));
    for (motion, message) in [
        (json!([{"scale": -1}]), "extrude.motion.0.scale: -1 is not above 0"),
        (
            json!([{"translate": [1, 2, 3]}, {"rotate": {"plane": "xw", "degrees": 1}}]),
            "extrude.motion.1.rotate.plane: ",
        ),
        (json!([{"translate": [1, 2, 3, 4]}]), "extrude.motion.0.translate: expected 3 numbers"),
    ] {
        let found = refusal::<4>(json!({"extrude": {"mesh": "nut.vtu", "from": 0, "to": 1, "motion": motion}}));
        assert!(found.starts_with(message), "{found}");
    }
}

#[test]
fn bodies_of_revolution() {
    // Pappus: the volume is that of the mesh times the way of its middle.
    let ant = build_of_mesh::<3>(json!({"file": "ant.ply"}));
    let offset = 20.0;
    let moment: f64 = corners(&ant.vertices, &ant.simplices)
        .map(|t| ao4d::geometry::determinant(&t) / 6.0 * (t[0][1] + t[1][1] + t[2][1]) / 4.0)
        .sum();
    let expected = 2.0 * PI * (moment + offset * volume(&ant));
    let missing = [40, 80].map(|steps| {
        let spun = json!({"spin": {"mesh": "ant.ply", "plane": "yw", "offset": offset, "steps": steps}});
        let surface = build_of_mesh::<4>(spun);
        assert_closed_manifold(&surface);
        assert_eq!((surface.vertices.len(), surface.simplices.len()), (486 * steps, 912 * 3 * steps));
        1.0 - volume(&surface) / expected
    });
    assert!(missing[1] > 0.0 && missing[1] < 0.003 && (3.5..4.5).contains(&(missing[0] / missing[1])), "{missing:?}");
    // Half a ball on the axis becomes a hypersphere: what is on the axis collapses, and the rest is closed.
    let folder = tempfile::tempdir().unwrap();
    let half = build::<3>(json!({"isosurface": {
        "field": {"formula": "sqrt(x^2 + y^2 + z^2) - 1"}, "pad": false,
        "grid": {"min": [0, -1.2, -1.2], "max": [1.2, 1.2, 1.2], "cells": [12, 24, 24]},
    }}));
    let mut obj = String::from("# half a ball\no half\n");
    half.vertices.iter().for_each(|v| obj += &format!("v {} {} {}\n", v[0], v[1], v[2]));
    half.simplices.iter().for_each(|t| obj += &format!("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1));
    std::fs::write(folder.path().join("half.obj"), obj).unwrap();
    let spun = spec(json!({"spin": {"mesh": "half.obj", "steps": 48}}));
    let sphere = build_object::<4>(&spun, folder.path()).unwrap();
    assert_closed_manifold(&sphere);
    near(volume(&sphere), PI * PI / 2.0, 0.02);
    let negative =
        build_object::<4>(&spec(json!({"spin": {"mesh": "half.obj", "plane": "yw", "steps": 8}})), folder.path());
    assert!(negative.unwrap_err().to_string().starts_with("spin.offset: a point has y = -"));
    for (key, value, message) in [
        ("plane", json!("xy"), "spin.plane: \"xy\" is none of xw, yw and zw"),
        ("steps", json!(2), "spin.steps: 2 steps; the least is 3"),
    ] {
        let mut object = json!({"spin": {"mesh": "half.obj", "steps": 8}});
        object["spin"][key] = value;
        assert_eq!(build_object::<4>(&spec(object), folder.path()).unwrap_err().to_string(), message);
    }
}

#[test]
fn meshes_from_obj_msh_and_vtk() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let extruded =
        |name: &str| build_object::<4>(&spec(json!({"extrude": {"mesh": name, "from": 0, "to": 2}})), folder.path());
    // The corner simplex, of volume 1/6, its nodes with tags out of order.
    let nodes = "7 0 0 0\n3 1 0 0\n12 0 1 0\n5 0 0 1\n";
    let elements = "1 15 2 0 1 7\n2 2 2 0 1 7 3 12\n9 4 2 0 1 7 3 12 5\n";
    let second = format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n{nodes}$EndNodes\n$Elements\n3\n{elements}$EndElements\n"
    );
    write("two.msh", &second);
    let fourth = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n0 0 0 1\n1 0 0 0 1 1 1 0 0\n$EndEntities\n\
        $Nodes\n2 4 3 12\n0 1 0 1\n7\n0 0 0\n3 1 0 3\n3\n12\n5\n1 0 0\n0 1 0\n0 0 1\n$EndNodes\n\
        $Elements\n2 2 1 9\n0 1 15 1\n1 7\n3 1 4 1\n9 7 3 12 5\n$EndElements\n";
    write("four.msh", fourth);
    let text = "# vtk DataFile Version 3.0\ncorner\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n\
        0 0 0 1 0 0 0 1 0 0 0 1\nCELLS 2 9\n4 0 1 2 3\n3 0 1 2\nCELL_TYPES 2\n10\n5\nPOINT_DATA 4\n";
    write("old.vtk", text);
    let mut binary = b"# vtk DataFile Version 5.1\nc\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n".to_vec();
    [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0].iter().for_each(|x| binary.extend(x.to_be_bytes()));
    binary.extend(b"\nMETADATA\nINFORMATION 0\n\nCELLS 2 4\nOFFSETS vtktypeint64\n");
    [0i64, 4].iter().for_each(|x| binary.extend(x.to_be_bytes()));
    binary.extend(b"\nCONNECTIVITY vtktypeint64\n");
    [0i64, 1, 2, 3].iter().for_each(|x| binary.extend(x.to_be_bytes()));
    binary.extend(b"\nCELL_TYPES 1\n");
    binary.extend(10i32.to_be_bytes());
    std::fs::write(folder.path().join("new.vtk"), &binary).unwrap();
    std::fs::write(folder.path().join("cut.vtk"), &binary[..binary.len() - 30]).unwrap();
    write("hex.vtk", &text.replace("10\n5\n", "12\n5\n"));
    write("types.vtk", &text.replace("CELL_TYPES 2\n10\n5\n", "CELL_TYPES 1\n10\n"));
    write("many.vtk", &text.replace("POINTS 4", "POINTS 6000000000000000000"));
    write("image.vtk", &text.replace("UNSTRUCTURED_GRID", "STRUCTURED_POINTS"));
    write("grid.vtk", &text.replace("UNSTRUCTURED_GRID", "STRUCTURED_GRID"));
    for name in ["two.msh", "four.msh", "old.vtk", "new.vtk"] {
        let surface = extruded(name).unwrap();
        assert_closed_manifold(&surface);
        near(volume(&surface), 2.0 / 6.0, 1e-14);
    }
    // A cube of quadrilaterals, in two objects that share points; negative indices, slashes.
    write(
        "cube.obj",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\nvn 0 0 1\no a\nf 4 3 2 1\nf 5 6 7 8\n\
         f 1//1 2//1 6//1 5//1\no b\nf 3 4 8 7\nf -8 -4 -1 -5\nf 2 3 7 6\n",
    );
    let cube = build_object::<3>(&spec(json!({"file": "cube.obj"})), folder.path()).unwrap();
    assert_closed_manifold(&cube);
    assert_eq!((cube.vertices.len(), cube.simplices.len()), (8, 12));
    near(volume(&cube), 1.0, 1e-15);
    write("bad.obj", "v 0 0 0\nf 1 2 3\n");
    write("words.obj", "v 0 0 x\nf 1 1 1\n");
    write("quads.msh", &second.replace("9 4 2 0 1 7 3 12 5", "9 11 2 0 1 7 3 12 5 7 3 12 5 7 3"));
    write("gap.msh", &second.replace("7 3 12 5\n", "7 3 12 6\n"));
    write("binary.msh", "$MeshFormat\n4.1 1 8\n");
    write("old.msh", "$MeshFormat\n1 0 8\n");
    write("cut.msh", &fourth[..fourth.len() - 30]);
    write("none.msh", "hello");
    for (name, message) in [
        ("bad.obj", "is damaged, or no OBJ file"),
        ("words.obj", "is damaged, or no OBJ file"),
        ("quads.msh", "cell 2 is a curved tetrahedron"),
        ("gap.msh", "has an element with node 6, which is not there"),
        ("binary.msh", "is cut off"),
        ("old.msh", "is of version 1; 2.2 and 4.1"),
        ("cut.msh", "is cut off"),
        ("none.msh", "has no $MeshFormat"),
        ("cut.vtk", "is cut off"),
        ("hex.vtk", "cell 0 is a hexahedron of 4 points"),
        ("types.vtk", "has 2 cells and 1 types of cells"),
        ("many.vtk", "is cut off: it declares more numbers than there are"),
        ("image.vtk", "has dimensions [0, 0, 0]"),
        ("grid.vtk", "STRUCTURED_GRID cannot be read here; UNSTRUCTURED_GRID, POLYDATA"),
    ] {
        let found = extruded(name).unwrap_err().to_string();
        assert!(found.contains(message) && found.contains(name), "{found}");
    }
}

/// Runs the stages of a pipeline in a folder; tells what is noted.
fn run_stages(folder: &Path, stages: &str) -> Result<Vec<String>, String> {
    let document = Document::parse("p.yaml", &format!("name: p\nstages:\n{stages}")).map_err(|e| e.to_string())?;
    let pipeline = Pipeline::from_document(document, &[], Some(folder.to_owned())).map_err(|e| e.to_string())?;
    let report = pipeline::run(&pipeline, &Settings::default(), &Silent).map_err(|e| e.to_string())?;
    Ok(report.notes)
}

fn read_mesh(file: &Path) -> vtk::UnstructuredGrid {
    match vtk::read(file).unwrap() {
        vtk::DataSet::Unstructured(mesh) => mesh,
        vtk::DataSet::Image(_) => panic!("{}: an image", file.display()),
    }
}

fn array(mesh: &vtk::UnstructuredGrid, name: &str) -> Vec<f64> {
    mesh.point_array(name).unwrap_or_else(|| panic!("no {name}")).values.to_f64()
}

/// What shows or lights nothing is told, in 3D and 4D, and is no error.
#[test]
fn what_meets_nothing_is_told() {
    for dimension in [3, 4] {
        let (three, inside, ball) = match dimension {
            3 => ("dimension: 3, ", "0, 0, -1", "sphere"),
            _ => ("", "0, 0, 0, -1", "hypersphere"),
        };
        let (size, down) = (vec!["5"; dimension - 1].join(", "), vec!["-1"; dimension].join(", "));
        let folder = tempfile::tempdir().unwrap();
        let lights = format!(
            "lights: [{{position: [{inside}]}}, {{direction: [{down}], intensity: 0}}, {{direction: [{down}], color: 0}}]"
        );
        let stages = format!(
            "  - scene: {{{three}objects: [{{{ball}: {{radius: 0.4, subdivisions: 2}}, transform: [{{translate: [{inside}]}}]}}]}}
  - occlusion: {{samples: 4}}
  - render: {{id: r, dimensions: [{size}], {lights}}}
  - write: {{vti: a.vti}}
  - wireframe: {{id: edges, angle: 90, vtp: e.vtp}}
  - animate: {{id: film, frames: 1, turn: {{plane: xy}}, vti: f.vti}}
  - slice: {{id: past, range: [3, 4], count: 3, vtp: past.vtp}}
  - slice: {{id: by, range: [-1, 4], count: 3, vtp: by.vtp}}
"
        );
        let notes = run_stages(folder.path(), &stages).unwrap();
        let dark = "reaches nothing that is seen: its intensity or its color is 0";
        for told in [
            "render r: lights[0] reaches nothing that is seen: it is inside a body or behind one".to_owned(),
            "animate film: in some frames lights[0] reaches nothing that is seen: it is inside a body".to_owned(),
            format!("render r: lights[1] {dark}"),
            format!("render r: lights[2] {dark}"),
            "edges: there are no such edges".to_owned(),
            "past: no hyperplane meets anything; all files are empty".to_owned(),
        ] {
            assert_eq!(notes.iter().filter(|note| note.contains(&told)).count(), 1, "{dimension}D, {told}: {notes:?}");
        }
        assert!(!notes.iter().any(|note| note.starts_with("by")), "{notes:?}");
        assert!(folder.path().join("f_0000.vti").is_file() && !folder.path().join("f_0001.vti").exists());
        assert_eq!(fs::read_to_string(folder.path().join("f.pvd")).unwrap().matches("<DataSet").count(), 1);
    }
}

#[test]
fn slices_are_files() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path();
    let stages = "  - scene: {id: s, objects: [{tesseract: {size: 2, subdivisions: 2}}, {tesseract: {size: 1}, transform: [{translate: [2, 0, 0, 0]}]}]}
  - occlusion: {id: o, samples: 16, file: o.f32}
  - slice: {id: one, at: 0.25, vtp: one.vtp}
  - slice: {id: open, normal: [0, 0, 2, 0], at: 1, occlusion: none, vtp: open.vtp}
  - slice: {id: many, normal: [1, 0, 0, 0], range: [-0.5, 2.25], count: 12, vtp: in/many.vtp}
  - slice: {id: past, at: 3, vtp: past.vtp}
";
    let notes = run_stages(out, stages).unwrap();
    assert_eq!(notes, ["past: the hyperplane meets nothing; the file is empty"]);
    let one = read_mesh(&out.join("one.vtp"));
    let (position, object) = (array(&one, "position"), array(&one, "object"));
    for ((point, position), object) in one.points.iter().zip(position.chunks(4)).zip(object) {
        assert_eq!((point[..].to_vec(), position[3]), (position[..3].to_vec(), 0.25));
        assert_eq!(object, if point[0] > 1.2 { 2.0 } else { 1.0 });
    }
    let (values, errors) = (array(&one, "ambient_occlusion"), array(&one, "occlusion_error"));
    assert!(values.contains(&1.0) && values.iter().any(|&v| v < 0.95));
    assert!(values.iter().all(|v| (0.0..=1.0).contains(v)) && errors.iter().all(|&e| (0.0..0.2).contains(&e)));
    let info = ao4d::inspect::surface::SurfaceSummary::of(&one).unwrap();
    assert!(info.closed && info.oriented && info.manifold && info.components == 2, "{info:?}");
    near(info.enclosed_volume.unwrap(), 9.0, 1e-6);
    // n = (0, 0, 2, 0) and c = 1: z = 1/2, along a facet of the smaller one.
    let open = read_mesh(&out.join("open.vtp"));
    assert!(open.point_array("ambient_occlusion").is_none());
    assert!(array(&open, "position").chunks(4).all(|p| p[2] == 0.5));
    near(ao4d::inspect::surface::SurfaceSummary::of(&open).unwrap().enclosed_volume.unwrap(), 9.0, 1e-6);
    let list = std::fs::read_to_string(out.join("in/many.pvd")).unwrap();
    for (i, expected) in [8.0, 8.0, 8.0, 8.0, 8.0, 8.0, 8.0, 0.0, 0.0, 1.0, 1.0, 1.0].into_iter().enumerate() {
        let name = format!("many-{i:02}.vtp");
        let at = -0.5 + 0.25 * i as f64;
        assert!(list.contains(&format!("timestep=\"{at:?}\" group=\"\" part=\"0\" file=\"{name}\"")), "{list}");
        let slice = read_mesh(&out.join("in").join(name));
        let volume = ao4d::inspect::surface::SurfaceSummary::of(&slice).map_or(0.0, |s| s.enclosed_volume.unwrap());
        // x = 1 is along a facet of one, x = 3/2 along one of the other, which begins there.
        assert!((volume - expected).abs() < 1e-6, "{at}: {volume}");
    }
    // A slice of a 3D scene is an outline.
    let three =
        "  - scene: {dimension: 3, objects: [{sphere: {radius: 1, subdivisions: 4}}]}\n  - slice: {vtp: flat.vtp}\n";
    run_stages(&out.join("three"), three).unwrap();
    let flat = read_mesh(&out.join("three/flat.vtp"));
    assert!(flat.cells().all(|(kind, points)| kind == 3 && points.len() == 2) && flat.cells().count() > 8);
    assert!(array(&flat, "position").chunks(3).zip(&flat.points).all(|(p, q)| p == [q[0], q[1], 0.0] && q[2] == 0.0));
}

#[test]
fn wireframes_are_seen_by_the_render_s_camera() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path();
    let stages = "  - scene: {id: s, objects: [{tesseract: {size: 2}, transform: [{rotate: {plane: xw, degrees: 30}}, {translate: [0.1, 0.2, 0.3, -2]}]}]}
  - render: {id: r, occlusion: none, dimensions: [2, 2, 2], camera: {eye: [0, 0, 0, 2], target: [0, 0, 0, 0]}}
  - wireframe: {vtp: far.vtp}
  - render: {id: within, occlusion: none, dimensions: [2, 2, 2], camera: {eye: [0, 0, 0, -2], target: [0, 0, 0, -4]}}
  - wireframe: {near: 0.125, vtp: near.vtp}
  - render: {id: flat, occlusion: none, dimensions: [2, 2, 2], camera: {eye: [0, 0, 0, 2], projection: parallel}}
  - wireframe: {input: flat, edges: all, vtp: all.vtp}
  - render: {id: away, occlusion: none, dimensions: [2, 2, 2], camera: {eye: [0, 0, 0, 2], target: [0, 0, 0, 4]}}
  - wireframe: {vtp: away.vtp}
";
    let notes = run_stages(out, stages).unwrap();
    assert_eq!(notes, ["wireframe-4: all edges are behind the eye, nearer than `near`, or hidden"]);
    // The default camera's image axes are x, y and z; it looks along -w.
    let check = |file: &str, eye: f64, perspective: bool, lines: usize| {
        let mesh = read_mesh(&out.join(file));
        assert_eq!(mesh.cells().count(), lines, "{file}");
        let (position, w, depth) = (array(&mesh, "position"), array(&mesh, "w"), array(&mesh, "depth"));
        let mut nearest = f64::INFINITY;
        for (i, p) in position.chunks(4).enumerate() {
            let distance = eye - p[3];
            nearest = nearest.min(distance);
            let scale = if perspective { 1.0 / distance } else { 1.0 };
            (0..3).for_each(|a| assert!((mesh.points[i][a] - p[a] * scale).abs() < 1e-5 * scale.max(1.0), "{file}"));
            let away = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2] + distance * distance).sqrt();
            assert!((depth[i] - if perspective { away } else { distance }).abs() < 1e-5 && w[i] == p[3]);
        }
        (mesh, nearest)
    };
    let (_, nearest) = check("far.vtp", 2.0, true, 32);
    assert!(nearest > 1.0);
    // From within: of the 32 edges those wholly behind the eye are gone, and those that pass it end before it.
    let corners = |k: u32| {
        let c: [f64; 4] = std::array::from_fn(|i| if k >> i & 1 == 1 { 1.0 } else { -1.0 });
        c[0] * 0.5 + c[3] * (PI / 6.0).cos()
    };
    let edges = (0..16u32).flat_map(|k| (0..4).filter(move |i| k >> i & 1 == 0).map(move |i| (k, k | 1 << i)));
    let seen = edges.filter(|&(a, b)| -corners(a) >= 0.125 || -corners(b) >= 0.125).count();
    let (mesh, nearest) = check("near.vtp", -2.0, true, seen);
    assert!(seen < 32 && (nearest - 0.125).abs() < 1e-6 && mesh.points.len() > 8, "{seen} {nearest}");
    check("all.vtp", 2.0, false, edges_of_a_tesseract());
}

/// Of a tesseract whose 8 cubes are 6 tetrahedra each: V - E + F - T = 0 and F = 2 T.
fn edges_of_a_tesseract() -> usize {
    let tetrahedra = build::<4>(json!({"tesseract": {"size": 2}})).simplices.len();
    16 + tetrahedra
}

#[test]
fn slices_and_wireframes_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let four = "  - scene: {id: s, objects: [{tesseract: {size: 1}}]}\n";
    for (stage, message) in [
        (
            "slice: {vtp: a.vtp, normal: [0, 0, 0, 0]}",
            "normal: the normal is zero, and no hyperplane has that; try `normal: [0, 0, 0, 1]`",
        ),
        ("slice: {vtp: a.vtp, normal: [0, 0, 1]}", "normal: expected 4 numbers (the scene is 4D), found 3"),
        ("slice: {vtp: a.vtp, normal: [0, 0, 1, 1e13]}", "normal[3]: expected a number of size up to 1e12, found 1e13"),
        ("slice: {vtp: a.vtu}", "vtp: expected a name that ends in .vtp, found \"a.vtu\""),
        ("slice: {vtp: a.vtp, at: 1e13}", "at: expected a number of size up to 1e12, found 1e13"),
        (
            "slice: {vtp: a.vtp, at: 0, range: [0, 1], count: 3}",
            "at: `at` is for one slice, `range` and `count` for several; take one of them out",
        ),
        ("slice: {vtp: a.vtp, range: [0, 1]}", "range: a range needs the number of its slices: add `count`"),
        ("slice: {vtp: a.vtp, count: 3}", "count: so many slices need a `range: [FIRST, LAST]`"),
        (
            "slice: {vtp: a.vtp, range: [0, 1], count: 1}",
            "count: expected 2 to 10000 slices, found 1; for one, say `at` instead",
        ),
        (
            "slice: {vtp: a.vtp, range: [1, 1], count: 2}",
            "range: the range begins and ends at 1; for one slice, say `at`",
        ),
        ("wireframe: {vtp: a.vtp}", "there is no earlier `render` whose camera it could look through; put one first"),
        (
            "render: {dimensions: [1, 1, 1]}\n  - wireframe: {vtp: a.vtp, angle: 190}",
            "angle: expected 0 to 180 degrees, found 190",
        ),
        (
            "render: {dimensions: [1, 1, 1]}\n  - wireframe: {vtp: a.vtp, near: 0}",
            "near: expected a number above 0, found 0",
        ),
        ("slice: {vtp: a.vtp, peel: hopf, at: 90}", "at: expected more than 0 and less than 90 degrees, found 90"),
        ("slice: {vtp: a.vtp, peel: hopf, range: [0, 80], count: 3}", "range[0]: expected more than 0"),
        ("slice: {vtp: a.vtp, peel: hopf, axis: [0, 0, 0]}", "axis: the axis is zero"),
        ("slice: {vtp: a.vtp, axis: [0, 0, 1]}", "axis: is for `peel: hopf` alone; take it out"),
        ("slice: {vtp: a.vtp, peel: w, normal: [0, 0, 0, 1]}", "normal: `peel` says already along what it is cut"),
        ("slice: {vtp: a.vtp, peel: hopf, projection: plane}", "projection: a torus of Hopf lies in no hyperplane"),
        ("slice: {vtp: a.vtp, projection: camera}", "projection: slices are shown in their own `plane`"),
        ("slice: {vtp: a.vtp, pole: [0, 0, 0, 1]}", "pole: is for `projection: stereographic`"),
        ("slice: {vtp: a.vtp, peel: hopf, center: [0, 0, 1]}", "center: expected 4 numbers (the scene is 4D), found 3"),
        ("slice: {vtp: a.vtp, peel: hopf, pole: [0, 0, 0, 0]}", "pole: the pole is zero, and that is no direction"),
        ("slice: {vtp: a.vtp, peel: hops}", "did you mean `hopf`?"),
        // What is seen only when it runs: the pole on the slice, the centre on an edge.
        (
            "slice: {vtp: a.vtp, projection: stereographic, pole: [0, 0, 1, 0]}",
            "pole: the pole of the projection, from the centre in direction [0.0, 0.0, 1.0, 0.0], lies on what is shown of",
        ),
        (
            "wireframe: {vtp: a.vtp, projection: stereographic, center: [0.5, 0.5, 0.5, 0], pole: [1, 1, 1, 0.2]}",
            "center: the centre of the projection, [0.5, 0.5, 0.5, 0.0], lies on what is shown of",
        ),
        ("wireframe: {vtp: a.vtp, projection: plane}", "projection: edges lie in no common hyperplane"),
        ("wireframe: {vtp: a.vtp, projection: stereographic, near: 1}", "near: is for what a camera sees"),
        ("wireframe: {vtp: a.vtp, projection: stereographic, hidden: mark}", "hidden: is for what a camera sees"),
        (
            "render: {dimensions: [1, 1, 1]}\n  - wireframe: {vtp: a.vtp, center: [0, 0, 0, 0]}",
            "center: is for `projection: stereographic`",
        ),
        (
            "wireframe: {id: e, projection: stereographic, vtp: a.vtp}\n  - paraview: {input: e, state: a.py, edges: {color_by: depth}}",
            "edges.color_by: `e` is projected stereographically and has no depth",
        ),
        (
            "wireframe: {id: e, projection: stereographic, vtp: a.vtp}\n  - paraview: {input: e, state: a.py, edges: {over: e}}",
            "edges.over: `e` is projected stereographically, as no image is; name it in `input`",
        ),
        (
            "render: {dimensions: [1, 1, 1]}\n  - write: {vti: a.vti}\n  - paraview: {state: a.py, edges: {}}",
            "edges: there is no earlier `wireframe` that a camera sees; put one first",
        ),
        (
            "render: {dimensions: [1, 1, 1]}\n  - write: {vti: a.vti}\n  - wireframe: {vtp: a.vtp}\n  - paraview: {state: a.py, edges: {skin: 2}}",
            "edges.skin: expected a number from 0 to 1, found 2",
        ),
    ] {
        let error = run_stages(folder.path(), &format!("{four}  - {stage}\n")).expect_err(stage);
        assert!(error.contains(message), "{stage}: {error}");
    }
    let written = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name());
    let results: Vec<_> = written.filter(|name| !name.to_string_lossy().starts_with('.')).collect();
    assert!(results.is_empty(), "nothing is written: {results:?}");
    let three = "  - scene: {dimension: 3, objects: [{sphere: {radius: 1, subdivisions: 2}}]}\n";
    let error = run_stages(folder.path(), &format!("{three}  - slice: {{vtp: a.vtp, peel: w}}\n")).unwrap_err();
    assert!(error.contains("peel: the scene is 3D, and peels are of hyperspheres in 4D"), "{error}");
}

/// The area of a file's triangles, and what they enclose, in the file's own points.
fn sizes_of(mesh: &vtk::UnstructuredGrid) -> [f64; 2] {
    let points: Vec<Vector64<3>> = mesh.points.iter().map(|&p| p.into()).collect();
    let faces: Vec<[u32; 3]> = mesh.cells().map(|(_, c)| std::array::from_fn(|i| c[i])).collect();
    assert!(facet_pairs(&faces).is_closed());
    [surface_measure(corners(&points, &faces)), enclosed_volume(corners(&points, &faces))]
}

#[test]
fn peels_of_a_hypersphere_are_the_tori_of_hopf() {
    // At the angle a the torus is a product of circles of radii cos a and sin a, whatever the axis.
    let mesh = mesh_of::<4>(json!({"hypersphere": {"radius": 1, "subdivisions": 10, "center": [0.5, 0, 0, -1]}}));
    for axis in [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [-0.6, 0.8, 1.0]] {
        for degrees in [20.0f64, 45.0, 70.0] {
            let peel = Hopf::new([0.5, 0.0, 0.0, -1.0].into(), axis, degrees).unwrap();
            let found = section(&mesh, &peel, None);
            let pairs = facet_pairs(&found.faces);
            assert!(pairs.is_closed() && pairs.is_manifold(), "{axis:?} {degrees}: {pairs:?}");
            let f_vector = ao4d::mesh::topology::f_vector(&found.faces);
            assert_eq!(f_vector[0] + f_vector[2], f_vector[1], "a torus: {axis:?} {degrees}");
            let points: Vec<Vector64<4>> = found.points.iter().map(|point| point.position(&mesh)).collect();
            let triangle = |face: &[u32; 3]| {
                let [a, b, c] = face.map(|i| points[i as usize]);
                let (u, v) = (b - a, c - a);
                0.5 * (u.norm_squared() * v.norm_squared() - u.dot(&v).powi(2)).max(0.0).sqrt()
            };
            let area: f64 = found.faces.iter().map(triangle).sum();
            let (sine, cosine) = degrees.to_radians().sin_cos();
            near(area, 4.0 * PI * PI * sine * cosine, 0.04);
        }
    }
    // By the stereographic projection from w each is a ring torus around the circle in xy, with radii 1 / cos a and
    // tan a, that faces outwards.
    let folder = tempfile::tempdir().unwrap();
    let notes = run_stages(
        folder.path(),
        "  - scene: {objects: [{hypersphere: {radius: 2, subdivisions: 12}, transform: [{translate: [0, 1, 0, 0]}]}]}
  - occlusion: {samples: 4}
  - slice: {peel: hopf, center: [0, 1, 0, 0], range: [30, 60], count: 3, vtp: peel.vtp}
  - slice: {peel: hopf, center: [0, 1, 0, 0], axis: [1, 0, 0], at: 30, vtp: other.vtp}
  - slice: {peel: w, at: -0.5, center: [0, 1, 0, 0], projection: stereographic, vtp: w.vtp}
  - slice: {id: lost, peel: hopf, center: [9, 9, 9, 9], at: 1, pole: [0, 0, 1, 0], vtp: lost.vtp}
",
    )
    .unwrap();
    assert_eq!(notes, ["lost: the torus meets nothing; the file is empty. Is `center` within the body?"]);
    for (i, degrees) in [30.0f64, 45.0, 60.0].into_iter().enumerate() {
        let mesh = read_mesh(&folder.path().join(format!("peel-{i}.vtp")));
        let (major, minor) = (1.0 / degrees.to_radians().cos(), degrees.to_radians().tan());
        let [area, volume] = sizes_of(&mesh);
        near(area, 4.0 * PI * PI * major * minor, 0.05);
        near(volume, 2.0 * PI * PI * major * minor * minor, 0.05);
        // Convex bodies are open everywhere, and points are where they are said to be.
        assert!(array(&mesh, "ambient_occlusion").iter().all(|&a| a == 1.0));
        for (image, p) in mesh.points.iter().zip(array(&mesh, "position").chunks(4)) {
            let p = [p[0], p[1] - 1.0, p[2], p[3]];
            let length = p.iter().map(|x| x * x).sum::<f64>().sqrt();
            assert!((0.9 * 2.0..=2.0 + 1e-6).contains(&length));
            let expected: Vec<f64> = p[..3].iter().map(|x| x / length / (1.0 - p[3] / length)).collect();
            assert!(expected.iter().zip(image).all(|(a, b)| (a - b).abs() < 1e-4), "{expected:?} {image:?}");
            let angle = p[2].hypot(p[3]).atan2(p[0].hypot(p[1])).to_degrees();
            assert!((angle - degrees).abs() < 1e-3, "{angle}");
        }
    }
    assert!(sizes_of(&read_mesh(&folder.path().join("other.vtp")))[0] > 10.0);
    // A circle of latitude's sphere is a sphere: w = -1/2 of 2 comes to one of radius tan(1/2 acos(1/4)), which is
    // sqrt(0.75 / 1.25), and faces outwards, to larger w.
    let radius = (0.75f64 / 1.25).sqrt();
    let [area, volume] = sizes_of(&read_mesh(&folder.path().join("w.vtp")));
    near(area, 4.0 * PI * radius.powi(2), 0.03);
    near(volume, 4.0 / 3.0 * PI * radius.powi(3), 0.03);
}

#[test]
fn edges_tell_whether_they_are_seen() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path();
    let eye = [1.5, -0.4, 0.3, 3.0];
    let stages = "  - scene: {id: s, objects: [{tesseract: {size: 2}}]}
  - render: {id: r, occlusion: none, dimensions: [20, 20, 20], camera: {eye: [1.5, -0.4, 0.3, 3], target: [0, 0, 0, 0]}}
  - wireframe: {vtp: marked.vtp}
  - wireframe: {hidden: leave_out, vtp: seen.vtp}
  - wireframe: {hidden: ignore, vtp: all.vtp}
  - wireframe: {input: s, projection: stereographic, pole: [0.1, 0.2, 0.3, 1], vtp: arcs.vtp}
  - scene: {id: flat, dimension: 3, objects: [{box: {min: [-2, -2, -3], max: [2, 2, -2]}}, {box: {min: [1.5, -0.5, 0], max: [2.5, 0.5, 0.2]}}]}
  - render: {id: f, input: flat, occlusion: none, dimensions: [400, 400], camera: {projection: parallel, eye: [0, 0, 4], target: [0, 0, 0], height: 8}}
  - wireframe: {vtp: flat.vtp}
";
    assert_eq!(run_stages(out, stages).unwrap(), Vec::<String>::new());
    let visible = |mesh: &vtk::UnstructuredGrid| -> Vec<bool> {
        let array = mesh.cell_arrays.iter().find(|a| a.name == "visible").expect("visible");
        array.values.to_f64().iter().map(|&v| v == 1.0).collect()
    };
    let middles = |mesh: &vtk::UnstructuredGrid, count: usize| -> Vec<Vec<f64>> {
        let position = array(mesh, "position");
        let middle = |c: &[u32]| {
            (0..count).map(|a| c.iter().map(|&i| position[count * i as usize + a]).sum::<f64>() / 2.0).collect()
        };
        mesh.cells().map(|(_, c)| middle(c)).collect()
    };
    // An edge of a convex body is seen if one of its cells faces the eye; none is seen in part.
    let marked = read_mesh(&out.join("marked.vtp"));
    let seen = visible(&marked);
    assert_eq!(seen.len(), 32);
    for (p, seen) in middles(&marked, 4).iter().zip(&seen) {
        let faces = (0..4).any(|a| p[a].abs() > 0.99 && p[a].signum() * eye[a] > 1.0);
        assert_eq!(*seen, faces, "{p:?}");
    }
    let count = seen.iter().filter(|&&seen| seen).count();
    assert!(count > 10 && count < 32, "{count}");
    assert_eq!(read_mesh(&out.join("seen.vtp")).cells().count(), count);
    let all = read_mesh(&out.join("all.vtp"));
    assert!(all.cell_arrays.is_empty() && all.cells().count() == 32);
    // What a box in front covers of the edges behind is hidden, to a pixel.
    let flat = read_mesh(&out.join("flat.vtp"));
    let (mut hidden, mut rest) = (0.0, 0.0);
    let position = array(&flat, "position");
    for ((_, ends), seen) in flat.cells().zip(visible(&flat)) {
        let [a, b] = [0, 1].map(|k| &position[3 * ends[k] as usize..][..3]);
        if [a, b].iter().all(|p| p[0] == 2.0 && p[2] == -2.0) {
            let covered = (a[1] + b[1]).abs() < 1.0;
            assert_eq!(seen, !covered, "{a:?} {b:?}");
            *(if seen { &mut rest } else { &mut hidden }) += (a[1] - b[1]).abs();
        }
    }
    assert!((hidden - 1.0f64).abs() <= 0.04 && (rest + hidden - 4.0f64).abs() < 1e-6, "{hidden} {rest}");
    // Arcs lie on the images of great circles: each point is the projection of a point of its edge.
    let arcs = read_mesh(&out.join("arcs.vtp"));
    assert!(arcs.point_array("depth").is_none() && arcs.cells().count() > 32 * 8);
    for p in array(&arcs, "position").chunks(4) {
        let on_edge = p.iter().filter(|x| (x.abs() - 1.0).abs() < 1e-6).count();
        assert!(on_edge >= 3, "{p:?}");
    }
    let longest = arcs.cells().map(|(_, c)| {
        let [a, b] = [arcs.points[c[0] as usize], arcs.points[c[1] as usize]];
        (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
    });
    assert!(longest.fold(0.0, f64::max) < 0.6);
}

#[test]
fn slabs_are_closed_and_add_up_to_the_body() {
    fn check<const D: usize>(object: Value) {
        let whole = volume(&build::<D>(object.clone()));
        for normal in [[0.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.0], [0.5, -0.7, 0.6, 0.3]] {
            let normal = if D == 3 && normal[3] == 1.0 { [0.0, 0.0, 1.0, 0.0] } else { normal };
            let part = |from: Option<f64>, to: Option<f64>| {
                let mut slab = json!({"normal": normal[..D].to_vec()});
                from.into_iter().for_each(|x| slab["from"] = json!(x));
                to.into_iter().for_each(|x| slab["to"] = json!(x));
                let mut object = object.clone();
                object["slab"] = slab;
                let part = build::<D>(object.clone());
                let pairs = facet_pairs(&part.simplices);
                assert!(pairs.is_closed(), "{object}: {pairs:?}");
                // It stays where it is to be.
                for vertex in &part.vertices {
                    let height: f64 = vertex.iter().zip(normal).map(|(x, n)| x * n).sum();
                    assert!(from.is_none_or(|c| height > c - 1e-6) && to.is_none_or(|c| height < c + 1e-6), "{height}");
                }
                volume(&part)
            };
            let parts = [part(None, Some(-0.21)), part(Some(-0.21), Some(0.13)), part(Some(0.13), None)];
            assert!(parts.iter().all(|&v| v > 0.0), "{object} {normal:?}: {parts:?}");
            near(parts.iter().sum(), whole, 1e-6);
        }
    }
    let notch = |d: usize| {
        let cuts = json!([{"from": vec![-0.3; d], "to": vec![2; d]}]);
        json!({"cut_cube": {"min": vec![-1; d], "max": vec![1; d], "cuts": cuts, "subdivisions": 2}})
    };
    let groove = json!({"cut_cube": {"min": [-1, -1, -1, -1], "max": [1, 1, 1, 1],
        "cuts": [{"from": [-0.3, 0, -2, -2], "to": [0.3, 2, 2, 2]}]}});
    check::<3>(notch(3));
    check::<3>(json!({"sphere": {"radius": 1, "subdivisions": 6}}));
    check::<3>(isosurface(json!({"torus": {"major": 1, "minor": 0.4}}), 12));
    check::<4>(json!({"box": {"min": [-1, -1, -1, -1], "max": [1, 1, 1, 1], "subdivisions": 2}}));
    check::<4>(json!({"polytope": {"cells": 24}}));
    check::<4>(json!({"hypersphere": {"radius": 1, "subdivisions": 4}}));
    check::<4>(notch(4));
    check::<4>(groove);
    // Along the layers of a body's own vertices: of the tesseract's eight layers two are left, with all its corners.
    let slab = json!({"tesseract": {"size": 1, "subdivisions": 8}, "slab": {"from": -0.125, "to": 0.125}});
    let surface = build::<4>(slab);
    assert!(facet_pairs(&surface.simplices).is_closed());
    near(volume(&surface), 0.25, 1e-12);
    near(area(&surface), 2.0 + 6.0 * 0.25, 1e-12);
    for (slab, message) in [
        (json!({}), "slab: a slab lies between two hyperplanes: give it `from`, `to`, or both"),
        (json!({"from": 1, "to": 1}), "slab.to: expected a number above `from`, 1, found 1"),
        (json!({"from": 5}), "slab: the body has no part between 5 and infinity"),
        (json!({"to": 0, "normal": [0, 0, 0, 0]}), "slab.normal: the normal is zero"),
        (json!({"to": 0, "normal": [0, 0, 1]}), "slab.normal: expected 4 numbers"),
    ] {
        let found = refusal::<4>(json!({"tesseract": {"size": 1}, "slab": slab}));
        assert!(found.contains(message), "{found}");
    }
}

/// An object as a scene of its own.
fn mesh_of<const D: usize>(object: Value) -> Mesh<D> {
    let mut builder = MeshBuilder::new();
    let crease = Crease::Above(30.0);
    builder.add_creased("body", [1.0; 3], &build::<D>(object), Orientation::Input, crease).unwrap();
    builder.finish()
}

fn hyperplane<const D: usize>(normal: [f64; 4], at: f64) -> Hyperplane<D> {
    Hyperplane::new(Vector64::from_fn(|r, _| normal[r]), at).unwrap()
}

/// A cube or tesseract of edge 1 around the origin.
fn cube<const D: usize>(pieces: u32) -> Mesh<D> {
    mesh_of(json!({"box": {"min": vec![-0.5; D], "max": vec![0.5; D], "subdivisions": pieces}}))
}

/// The points of a section within its hyperplane, in both dimensions.
fn section_points<const D: usize>(mesh: &Mesh<D>, plane: &Hyperplane<D>, found: &Section) -> Vec<[f64; 3]> {
    found.points.iter().map(|point| plane.coordinates(&point.position(mesh))).collect()
}

/// Whether a section has no rim: in 3D as many lines begin at each point as end there.
fn is_closed<const D: usize>(found: &Section) -> bool {
    match Dimension::of::<D>() {
        Dimension::Four => facet_pairs(&found.faces).is_closed(),
        Dimension::Three => {
            let mut surplus = vec![0; found.points.len()];
            for &[from, to, _] in &found.faces {
                (surplus[from as usize], surplus[to as usize]) = (surplus[from as usize] + 1, surplus[to as usize] - 1);
            }
            surplus.iter().all(|&surplus| surplus == 0)
        }
    }
}

/// The measure of a section, and what it encloses: length and area in 3D, area and volume in 4D.
fn section_sizes<const D: usize>(mesh: &Mesh<D>, plane: &Hyperplane<D>, found: &Section) -> [f64; 2] {
    let points = section_points(mesh, plane, found);
    match Dimension::of::<D>() {
        Dimension::Four => {
            let points: Vec<Vector64<3>> = points.iter().map(|&p| p.into()).collect();
            let triangles = || corners(&points, &found.faces);
            [surface_measure(triangles()), enclosed_volume(triangles())]
        }
        Dimension::Three => {
            let ends = found.faces.iter().map(|face| (points[face[0] as usize], points[face[1] as usize]));
            let sum = |f: &dyn Fn([f64; 3], [f64; 3]) -> f64| ends.clone().map(|(p, q)| f(p, q)).sum::<f64>();
            let length = sum(&|p, q| (p[0] - q[0]).hypot(p[1] - q[1]));
            [length, sum(&|p, q| (p[0] * q[1] - p[1] * q[0]) / 2.0)]
        }
    }
}

#[test]
fn slices_of_balls_are_balls() {
    fn check<const D: usize>(object: Value) {
        let mesh = mesh_of::<D>(object);
        for (normal, at) in [
            ([0.0, 0.0, 1.0, 0.0], 0.3),
            ([0.0, 1.0, 0.0, 0.0], 0.0),
            ([-1.0, 0.0, 0.0, 0.0], -0.7),
            ([0.6, 0.0, -0.8, 0.0], 0.25),
            ([0.5, -0.5, 0.5, 0.5], -0.4),
        ] {
            let plane = hyperplane::<D>(normal, at);
            let found = section(&mesh, &plane, None);
            assert!(is_closed::<D>(&found), "{normal:?}");
            if D == 4 {
                assert!(facet_pairs(&found.faces).is_manifold(), "{normal:?}");
                let f_vector = ao4d::mesh::topology::f_vector(&found.faces);
                assert_eq!(f_vector[0] + f_vector[2], f_vector[1] + 2, "Euler characteristic 2");
            }
            // A hyperplane n.x = c is |c| / |n| from the origin.
            let length = normal[..D].iter().map(|x| x * x).sum::<f64>().sqrt();
            let radius = (1.0 - (at / length).powi(2)).sqrt();
            let expected = Dimension::of::<D>().pick(
                [2.0 * PI * radius, PI * radius.powi(2)],
                [4.0 * PI * radius.powi(2), 4.0 / 3.0 * PI * radius.powi(3)],
            );
            for (size, expected) in section_sizes(&mesh, &plane, &found).into_iter().zip(expected) {
                assert!(size < expected, "it lies within the ball: {size}, {expected}");
                near(size, expected, 0.03);
            }
            for point in &found.points {
                let place = point.position(&mesh);
                let height = place.iter().zip(normal).map(|(x, n)| x * n).sum::<f64>() - at;
                assert!(height.abs() < 1e-12, "{height}");
                // Faces look outwards, and points are where they were in space.
                assert!((0.97..=1.0 + 1e-6).contains(&place.norm()));
            }
        }
        let beyond = hyperplane::<D>([1.0, 0.0, 0.0, 0.0], 1.5);
        assert_eq!(section(&mesh, &beyond, None), Section::default());
    }
    check::<3>(json!({"sphere": {"radius": 1, "subdivisions": 24}}));
    check::<4>(json!({"hypersphere": {"radius": 1, "subdivisions": 14}}));
}

#[test]
fn slices_of_cubes_through_their_corners() {
    // Across a long diagonal, through the middle: a regular hexagon, a regular octahedron. Both go through corners.
    for pieces in [1, 2, 3] {
        let (square, tesseract) = (cube::<3>(pieces), cube::<4>(pieces));
        let plane = hyperplane::<3>([1.0; 4], 0.0);
        let [length, area] = section_sizes(&square, &plane, &section(&square, &plane, None));
        near(length, 6.0 * 0.5f64.sqrt(), 1e-12);
        near(area, 3.0 * 3f64.sqrt() / 4.0, 1e-12);
        let plane = hyperplane::<4>([1.0; 4], 0.0);
        let found = section(&tesseract, &plane, None);
        let [area, volume] = section_sizes(&tesseract, &plane, &found);
        near(area, 4.0 * 3f64.sqrt(), 1e-12);
        near(volume, 4.0 / 3.0, 1e-12);
        let pairs = facet_pairs(&found.faces);
        assert!(pairs.is_manifold() && pairs.is_closed(), "{pairs:?}");
    }
    // Along facets of the body and of its pieces a slice is that just below; what only touches from above, or with less
    // than a facet, is nothing.
    fn check<const D: usize>(mesh: &Mesh<D>) {
        let one = Dimension::of::<D>().pick(4.0, 6.0);
        for axis in 0..D {
            let along: [f64; 4] = std::array::from_fn(|i| f64::from(i == axis));
            for (sign, at, full) in [
                (1.0, 0.5, true),
                (1.0, 0.0, true),
                (1.0, -0.5, false),
                (-1.0, 0.5, true),
                (1.0, 0.5f64.next_up(), false),
                (1.0, (-0.5f64).next_up(), true),
            ] {
                let plane = hyperplane::<D>(along.map(|x| x * sign), at);
                let found = section(mesh, &plane, None);
                let sizes = section_sizes(mesh, &plane, &found);
                assert!(is_closed::<D>(&found));
                let expected = if full { [one, 1.0] } else { [0.0; 2] };
                let apart = sizes.iter().zip(expected).any(|(size, expected)| (size - expected).abs() > 1e-12);
                assert!(!apart, "{axis} {sign} {at}: {sizes:?}");
            }
        }
        for normal in [[1.0f64, 1.0, 0.0, 0.0], [1.0, -1.0, 1.0, 0.0], [1.0; 4]] {
            let most = normal[..D].iter().map(|x| x.abs() / 2.0).sum::<f64>();
            for at in [most, -most] {
                assert_eq!(section(mesh, &hyperplane::<D>(normal, at), None), Section::default(), "{normal:?} {at}");
            }
        }
    }
    for pieces in [1, 2, 4] {
        check(&cube::<3>(pieces));
        check(&cube::<4>(pieces));
    }
}

#[test]
fn slices_add_up_to_the_body() {
    fn check<const D: usize>(object: Value) {
        let mesh = mesh_of::<D>(object.clone());
        let body = volume(&build::<D>(object.clone()));
        for normal in [[0.0, 0.0, 1.0, 0.0], [0.5, 0.5, -0.5, 0.5], [0.36, 0.48, 0.8, 0.0]] {
            let unit = Vector64::<D>::from_fn(|r, _| normal[r]).normalize();
            let normal: [f64; 4] = std::array::from_fn(|i| unit.get(i).copied().unwrap_or(0.0));
            let (steps, reach) = (240, 3.0);
            let width = 2.0 * reach / f64::from(steps);
            let sum: f64 = (0..steps)
                .map(|i| {
                    let plane = hyperplane::<D>(normal, -reach + (f64::from(i) + 0.5) * width);
                    let found = section(&mesh, &plane, None);
                    assert!(is_closed::<D>(&found), "{object} {normal:?}");
                    section_sizes(&mesh, &plane, &found)[1] * width
                })
                .sum();
            near(sum, body, 0.01);
        }
    }
    let notch = |d: usize| {
        let cuts = json!([{"from": vec![0; d], "to": vec![2; d]}]);
        json!({"cut_cube": {"min": vec![-1; d], "max": vec![1; d], "cuts": cuts}})
    };
    check::<3>(notch(3));
    check::<4>(notch(4));
    check::<4>(json!({"polytope": {"cells": 24}}));
    check::<4>(json!({"duoprism": {"sides": [5, 3], "radii": [1, 1]}}));
    check::<3>(isosurface(json!({"torus": {"major": 1, "minor": 0.4}}), 12));
    check::<4>(isosurface(json!({"tiger": {"major": [1.0, 1.2], "minor": 0.5}}), 10));
}

#[test]
fn slices_through_many_corners_at_once_are_closed() {
    // Whole numbers as coordinates and as hyperplanes: vertices, edges and simplices lie in them all the time.
    fn check<const D: usize>(object: Value) {
        let mesh = mesh_of::<D>(object.clone());
        let (mut cut, mut through) = (0, 0);
        for code in 0..3u32.pow(D as u32) {
            let normal: [f64; 4] = std::array::from_fn(|i| f64::from(code / 3u32.pow(i as u32) % 3) - 1.0);
            if normal[..D].iter().all(|&x| x == 0.0) {
                continue;
            }
            for at in -4..=4 {
                let plane = hyperplane::<D>(normal, f64::from(at));
                let found = section(&mesh, &plane, None);
                assert!(is_closed::<D>(&found), "{object} {normal:?} {at}");
                // The limit of those below.
                let below = hyperplane::<D>(normal, f64::from(at) - 1e-6);
                let sizes = [&plane, &below].map(|plane| section_sizes(&mesh, plane, &section(&mesh, plane, None))[1]);
                assert!((sizes[0] - sizes[1]).abs() < 1e-3, "{object} {normal:?} {at}: {sizes:?}");
                cut += usize::from(!found.faces.is_empty());
                through += usize::from(found.points.iter().any(|point| point.from == point.to));
            }
        }
        assert!(cut > 50 && through > 50, "{cut} {through}");
    }
    check::<3>(json!({"box": {"min": [-2, -2, -2], "max": [2, 2, 2], "subdivisions": 4}}));
    check::<4>(json!({"box": {"min": [-2, -2, -2, -2], "max": [2, 2, 2, 2], "subdivisions": 2}}));
    let cuts = json!([{"from": [0, -1, -1, -1], "to": [3, 1, 3, 3]}]);
    check::<4>(json!({"cut_cube": {"min": [-2, -2, -2, -2], "max": [2, 2, 2, 2], "cuts": cuts, "subdivisions": 4}}));
}

#[test]
fn values_go_along_and_creases_stay_sharp() {
    fn check<const D: usize>() {
        let mesh = cube::<D>(3);
        let plane = hyperplane::<D>([0.3, -0.5, 0.7, 0.2], 0.1);
        // What is linear in space is so on the slice.
        let linear = |x: f64, y: f64| 0.5 + 0.25 * x - 0.125 * y;
        let values: Vec<f32> = mesh.vertices.iter().map(|v| linear(f64::from(v[0]), f64::from(v[1])) as f32).collect();
        let found = section(&mesh, &plane, Some(&values));
        assert_eq!(found, section(&mesh, &plane, None), "where values agree, points are one");
        for point in &found.points {
            let place = point.position(&mesh);
            assert!((f64::from(point.value(&values)) - linear(place[0], place[1])).abs() < 1e-6);
            let error = point.error(&vec![0.5; mesh.vertices.len()]);
            let expected = 0.5 * (1.0 - point.share).hypot(point.share);
            assert!((f64::from(error) - expected).abs() < 1e-6);
        }
        // Each face of the box has a value of its own, and so has each face of the slice.
        let sides: Vec<f32> = (mesh.normals.iter())
            .map(|n| n.iter().enumerate().map(|(i, x)| x * (i + 1) as f32).sum::<f32>().round())
            .collect();
        let split = section(&mesh, &plane, Some(&sides));
        assert!(split.points.len() > found.points.len() && split.faces.len() == found.faces.len());
        for face in &split.faces {
            let on_face: Vec<f32> = face[..D - 1].iter().map(|&p| split.points[p as usize].value(&sides)).collect();
            assert!(on_face.iter().all(|&value| value == on_face[0]), "{on_face:?}");
        }
        // The points of both sides are at the same place to the last bit, so that it closes when they are welded.
        let places = |found: &Section| -> Vec<Vec<u32>> {
            let bits = |p: &[f64; 3]| p.iter().map(|x| (*x as f32).to_bits()).collect();
            let mut places: Vec<Vec<u32>> = section_points(&mesh, &plane, found).iter().map(bits).collect();
            places.sort_unstable();
            places.dedup();
            places
        };
        assert_eq!(places(&split), places(&found));
    }
    check::<3>();
    check::<4>();
}

#[test]
fn signs_of_heights_are_exact() {
    // 0.1 + 0.2 - 0.3 in exact arithmetic on what is stored, by fractions.
    let point = Vector::<4>::from([0.1, 0.2, 1.0, 0.0]);
    let plane = hyperplane::<4>([1.0, 1.0, -1.0, 0.0], f64::from(0.1f32) + f64::from(0.2f32) - 1.0);
    assert_eq!(plane.height(&point), 0.0);
    for (i, next) in [(0, 0.1f32.next_up()), (1, 0.2f32.next_down())] {
        let mut moved = point;
        moved[i] = next;
        assert_eq!(plane.height(&moved).signum(), f64::from(next - point[i]).signum());
    }
    // Whole numbers of 53 and 24 bits, in 128-bit arithmetic; the hyperplane is as near to the point as a double tells.
    let mut state = 7u64;
    let mut random = |bits: u32| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        i128::from(state >> (64 - bits)) - (1i128 << (bits - 1))
    };
    let mut signs = [0; 3];
    for _ in 0..2000 {
        let (n, x): ([i128; 4], [i128; 4]) = (std::array::from_fn(|_| random(54)), std::array::from_fn(|_| random(25)));
        let sum: i128 = n.iter().zip(&x).map(|(n, x)| n * x).sum();
        let at = sum as f64;
        let expected = (sum - at as i128).signum();
        let plane = hyperplane::<4>(n.map(|n| n as f64), at);
        let found = plane.height(&Vector::from(x.map(|x| x as f32)));
        assert_eq!(if found == 0.0 { 0 } else { found.signum() as i128 }, expected);
        signs[(expected + 1) as usize] += 1;
    }
    assert!(signs[0] > 500 && signs[2] > 500, "{signs:?}");
    for normal in [[0.0; 4], [f64::NAN, 0.0, 0.0, 1.0], [f64::INFINITY, 0.0, 0.0, 0.0], [1e-300, 0.0, 0.0, 0.0]] {
        assert_eq!(Hyperplane::<4>::new(normal.into(), 0.0), None);
    }
}

#[test]
fn wireframes_have_the_edges_of_polytopes() {
    fn length<const D: usize>(mesh: &Mesh<D>, which: Edges) -> (usize, f64) {
        let found = edges(mesh, which);
        let long = |ends: [u32; 2]| {
            let [a, b] = ends.map(|v| mesh.vertices[v as usize].cast::<f64>());
            (a - b).norm()
        };
        (found.len(), found.iter().map(|edge| long(edge.ends)).sum())
    }
    for (cells, count) in [(5, 10), (8, 32), (16, 24), (24, 96), (120, 1200), (600, 720)] {
        let mesh = mesh_of::<4>(json!({"polytope": {"cells": cells}}));
        let (found, whole) = length(&mesh, Edges::Feature(10.0));
        assert_eq!(found, count, "{cells}");
        let one = whole / count as f64;
        for edge in edges(&mesh, Edges::Feature(10.0)) {
            let [a, b] = edge.ends.map(|v| mesh.vertices[v as usize]);
            assert!((f64::from((a - b).norm()) - one).abs() < 1e-5, "{cells}");
        }
        if cells < 100 {
            let finer = mesh_of::<4>(json!({"polytope": {"cells": cells, "subdivisions": 3}}));
            let (pieces, long) = length(&finer, Edges::Feature(10.0));
            assert_eq!(pieces, 3 * count);
            near(long, whole, 1e-5);
        }
    }
    for pieces in [1, 4] {
        let cube = json!({"box": {"min": [0, 0, 0], "max": [1, 2, 3], "subdivisions": pieces}});
        let (found, long) = length(&mesh_of::<3>(cube), Edges::Feature(10.0));
        assert_eq!(found, 12 * pieces);
        near(long, 4.0 * (1.0 + 2.0 + 3.0), 1e-6);
        let tesseract = json!({"box": {"min": [0, 0, 0, 0], "max": [1, 2, 3, 4], "subdivisions": pieces}});
        let (found, long) = length(&mesh_of::<4>(tesseract), Edges::Feature(10.0));
        assert_eq!(found, 32 * pieces);
        near(long, 8.0 * (1.0 + 2.0 + 3.0 + 4.0), 1e-6);
    }
    // The angle decides: neighbouring cells of the 600-cell meet at 15.5 degrees, faces of a sphere at less than 20.
    let mesh = mesh_of::<4>(json!({"polytope": {"cells": 600}}));
    assert_eq!([15.4, 15.6].map(|angle| length(&mesh, Edges::Feature(angle)).0), [720, 0]);
    let sphere = mesh_of::<3>(json!({"sphere": {"radius": 1, "subdivisions": 12}}));
    assert_eq!(length(&sphere, Edges::Feature(20.0)).0, 0);
    // Euler: the sphere's edges are its triangles' sides, each shared by two.
    assert_eq!(length(&sphere, Edges::All).0 * 2, sphere.simplices.len() * 3);
    // An open body has its rim.
    let corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]];
    let wall = json!({"simplices": {"vertices": corners, "cells": [[0, 1, 2], [0, 2, 3]]}});
    assert_eq!(length(&mesh_of::<3>(wall), Edges::Feature(10.0)), (4, 4.0));
}
