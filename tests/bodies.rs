//! Bodies of R^4 and R^3 against what is known of them: isosurfaces, polytopes, products, motions.

use std::collections::HashMap;
use std::f64::consts::PI;
use std::path::Path;

use ao4d::geometry::{Vector64, normal_of};
use ao4d::mesh::Surface;
use ao4d::mesh::topology::{corners, enclosed_volume, facet_pairs, singular_vertices, surface_measure, worst_quality};
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
    assert!(refusal::<3>(json!({"polytope": {"cells": 8}})).contains("dimension 4, not 3"));
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
