//! Bodies of R^4 and R^3 against what is known of them: isosurfaces, polytopes, products, motions.

use std::collections::HashMap;
use std::f64::consts::PI;
use std::path::Path;

use ao4d::geometry::{Vector64, normal_of};
use ao4d::mesh::Surface;
use ao4d::mesh::topology::{corners, enclosed_volume, facet_pairs, surface_measure, worst_quality};
use ao4d::scene::{ObjectSpec, build_object};
use serde_json::{Value, json};

fn spec(object: Value) -> ObjectSpec {
    serde_json::from_value(object.clone()).unwrap_or_else(|error| panic!("{object}: {error}"))
}

fn build<const D: usize>(object: Value) -> Surface<D> {
    build_object(&spec(object.clone()), Path::new(".")).unwrap_or_else(|error| panic!("{object}: {error}"))
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
            with(json!({"formula": "x + y"}), &grid),
            "isosurface.isovalue: the field is inside everywhere: its values go from -2 to 2, and the isovalue is 7",
        ),
        (
            with(json!({"formula": "sqrt(x - 9)"}), &grid),
            "isosurface.isovalue: the field is outside everywhere: none of its values is a number, and the isovalue is 7",
        ),
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
