//! Vertices split at creases, and the values there: limits along each face, known in closed form, in 3D and 4D. Then sheets
//! with two sides, and closed surfaces seen from inside.

use std::path::Path;
use std::sync::Arc;

use ao4d::accel::Tracer;
use ao4d::geometry::{Vector, Vector64, normal_of};
use ao4d::mesh::{Crease, Mesh, MeshBuilder, Orientation, Surface, Viewpoint};
use ao4d::occlusion::{Estimator, exact};
use ao4d::progress::Silent;
use ao4d::render::{Aov, Camera, Shading, View};
use ao4d::scene::{CreaseAngle, ObjectSpec, build_object};
use ao4d::session::Session;
use ao4d::trace::cpu::{CpuBackend, estimate_at};
use ao4d::trace::{RayBackend, Sampling, ShadingPoint};

fn object<const D: usize>(yaml: serde_json::Value) -> (Surface<D>, Crease) {
    let spec: ObjectSpec = serde_json::from_value(yaml).unwrap();
    (build_object(&spec, Path::new(".")).unwrap(), spec.crease().unwrap())
}

fn mesh<const D: usize>(objects: Vec<(Surface<D>, Crease)>) -> Mesh<D> {
    let mut builder = MeshBuilder::new();
    for (i, (surface, crease)) in objects.iter().enumerate() {
        builder.add_creased(&i.to_string(), [0.8; 3], surface, Orientation::Input, *crease).unwrap();
    }
    builder.finish()
}

fn cuboid<const D: usize>(min: f64, max: f64, pieces: u32) -> (Surface<D>, Crease) {
    object(serde_json::json!({"box": {"min": vec![min; D], "max": vec![max; D], "subdivisions": pieces}}))
}

/// Exact values, after sampled ones have been held against them and against the slow way.
fn values<const D: usize>(mesh: &Mesh<D>) -> Vec<f64> {
    let backend = CpuBackend::new(Tracer::new(mesh.clone()));
    let points = ShadingPoint::vertices(mesh);
    let by = |estimator: Estimator| estimator.estimate(&backend, &points, None, &Silent).unwrap().values;
    let sampling = Sampling::new(256, 1);
    let (sampled, exact) = (by(Estimator::Sampled(sampling)), by(Estimator::Exact(exact::Budget::default())));
    for (i, (point, (sampled, exact))) in points.iter().zip(sampled.iter().zip(&exact)).enumerate() {
        assert!((sampled - exact).abs() < 0.04, "{point:?}: {sampled} sampled, {exact} exact");
        if i % 5 != 0 {
            continue;
        }
        let slow = estimate_at(backend.tracer(), point, &sampling, &Silent).unwrap();
        assert_eq!(sampled.to_bits(), slow.value.to_bits(), "{point:?}");
    }
    exact.into_iter().map(f64::from).collect()
}

fn cubes<const D: usize>() {
    let mesh = mesh(vec![cuboid::<D>(-1.0, 1.0, 2), cuboid::<D>(5.0, 6.0, 1)]);
    // A shading point for every facet that a vertex is on; those of the input first.
    let (first, second) = (2 * D * 3usize.pow(D as u32 - 1), (2 * D) << (D - 1));
    assert_eq!(mesh.objects[0].vertices, 0..first);
    assert_eq!(mesh.objects[1].vertices, first..first + second);
    let (given, _) = cuboid::<D>(-1.0, 1.0, 2);
    for (vertex, given) in mesh.vertices.iter().zip(&given.vertices) {
        assert_eq!(vertex.map(f64::from), *given);
    }
    for (v, normal) in mesh.normals.iter().enumerate() {
        assert_eq!((normal.norm(), normal.amax()), (1.0, 1.0), "vertex {v} has the normal of one facet: {normal:?}");
        let same = mesh.identity[v] as usize;
        assert!(same <= v && mesh.vertices[same] == mesh.vertices[v]);
    }
    for (s, simplex) in mesh.simplices.iter().enumerate() {
        assert!(simplex.iter().all(|&v| mesh.normals[v as usize] == mesh.normals[simplex[0] as usize]), "{s}");
    }
}

#[test]
fn a_cube_has_a_shading_point_for_every_facet_around_a_vertex() {
    cubes::<3>();
    cubes::<4>();
}

fn cube_alone<const D: usize>() {
    assert!(values(&mesh(vec![cuboid::<D>(-1.0, 1.0, 2)])).iter().all(|&v| v == 1.0));
}

#[test]
fn a_cube_alone_is_open_at_corners_and_edges() {
    cube_alone::<3>();
    cube_alone::<4>();
}

/// A cube with a notch that takes the upper halves of the first k axes. Where the notch's k walls meet, each sees the
/// 2^-(k-1) of its hemisphere that is before the others. At an end of the notch, on j of the cube's own facets, the walls
/// end too: seen along the facets they hide 2^-j of that, seen along the notch all of it, and from between something between.
fn notch<const D: usize>(k: usize) {
    let from: Vec<f64> = (0..D).map(|axis| if axis < k { 1.0 } else { -1.0 }).collect();
    let body = object::<D>(serde_json::json!({"cut_cube": {
        "min": vec![0.0; D], "max": vec![2.0; D], "cuts": [{"from": from, "to": vec![3.0; D]}], "subdivisions": 2
    }}));
    let mesh = mesh(vec![body]);
    let values = values(&mesh);
    let mut seen = 0;
    for (v, point) in mesh.vertices.iter().enumerate().filter(|(_, point)| (0..k).all(|axis| point[axis] == 1.0)) {
        let ends = (k..D).filter(|&axis| point[axis] != 1.0).count() as i32;
        let wall = (0..k).any(|axis| mesh.normals[v][axis] == 1.0);
        let most = if wall { 1.0 - 0.5f64.powi(k as i32 - 1) } else { 0.0 };
        let hidden = most * 0.5f64.powi(ends)..=most;
        let found = 1.0 - values[v];
        let rounded = found.clamp(*hidden.start(), *hidden.end());
        assert!((found - rounded).abs() < 1e-7, "{point:?} {:?}: {found} not in {hidden:?}", mesh.normals[v]);
        seen += usize::from(wall);
    }
    assert_eq!(seen, k * 3usize.pow((D - k) as u32));
}

#[test]
fn walls_that_meet_hide_what_is_behind_them() {
    (2..=3).for_each(notch::<3>);
    (2..=4).for_each(notch::<4>);
}

/// A box on another one, vertex on vertex: the feet of its walls see half a hemisphere, whatever body the floor is of.
fn foot<const D: usize>() {
    let axes = |low: f64, high: f64, up: [f64; 2]| {
        let side = |x: f64, z: f64| (0..D).map(|axis| if axis + 1 < D { x } else { z }).collect::<Vec<f64>>();
        let pieces: Vec<u32> = (0..D).map(|axis| if axis + 1 < D { (high - low) as u32 } else { 1 }).collect();
        object::<D>(serde_json::json!({"box": {
            "min": side(low, up[0]), "max": side(high, up[1]), "subdivisions": pieces
        }}))
    };
    let mesh = mesh(vec![axes(0.0, 4.0, [-1.0, 0.0]), axes(1.0, 3.0, [0.0, 1.0])]);
    let values = values(&mesh);
    let feet: Vec<usize> = mesh.objects[1]
        .vertices
        .clone()
        .filter(|&v| mesh.vertices[v][D - 1] == 0.0 && mesh.normals[v][D - 1] == 0.0)
        .collect();
    assert!(feet.len() >= 2 * (D - 1) * 2);
    for v in feet {
        assert!((values[v] - 0.5).abs() < 1e-7, "{:?} {:?}: {}", mesh.vertices[v], mesh.normals[v], values[v]);
    }
}

#[test]
fn feet_on_another_body_see_half() {
    foot::<3>();
    foot::<4>();
}

/// Two facets whose normals differ by an angle are one side of a crease up to that angle.
fn roof<const D: usize>() {
    for (degrees, crease, points) in [
        (20.0, Crease::Above(30.0), 0),
        (40.0, Crease::Above(30.0), 1),
        (40.0, Crease::Above(45.0), 0),
        (40.0, Crease::Never, 0),
        (30.0, Crease::Above(30.0), 0),
        (10.0, Crease::Above(0.0), 1),
    ] {
        // The ridge is spanned by D - 1 points; one point each side of it.
        let slope = f64::to_radians(degrees / 2.0);
        let mut vertices: Vec<Vector64<D>> =
            (0..D - 1).map(|i| Vector64::from_fn(|r, _| f64::from(i > 0 && r == i + 1))).collect();
        let side = |sign: f64| Vector64::from_fn(|r, _| [sign * slope.cos(), -slope.sin(), 0.1, 0.1][r]);
        vertices.extend([side(1.0), side(-1.0)]);
        let ridge = |last: u32| -> [u32; D] { std::array::from_fn(|i| if i + 1 < D { i as u32 } else { last }) };
        let mut other = ridge(D as u32);
        other.swap(0, 1);
        let surface = Surface { vertices, simplices: vec![ridge(D as u32 - 1), other], normals: None };
        let split = mesh(vec![(surface.clone(), crease)]);
        assert_eq!(split.vertices.len() - surface.vertices.len(), points * (D - 1), "{degrees} {crease:?}");
        // Normals of the input win.
        let given = Surface { normals: Some(vec![Vector64::from_element(1.0); D + 1]), ..surface };
        assert_eq!(mesh(vec![(given, crease)]).vertices.len(), D + 1);
    }
}

#[test]
fn creases_begin_above_the_angle() {
    roof::<3>();
    roof::<4>();
}

#[test]
fn the_angle_is_said_in_degrees_or_off() {
    let with = |angle: serde_json::Value| -> Result<ObjectSpec, _> {
        serde_json::from_value(serde_json::json!({"tesseract": {}, "crease_angle": angle}))
    };
    assert_eq!(with(45.into()).unwrap().crease().unwrap(), Crease::Above(45.0));
    assert_eq!(with("off".into()).unwrap().crease().unwrap(), Crease::Never);
    assert!(with("on".into()).is_err());
    for wrong in [-1.0, 181.0] {
        let error = with(wrong.into()).unwrap().crease().unwrap_err().to_string();
        assert!(error.starts_with("crease_angle: expected degrees from 0 to 180, or off, found"), "{error}");
    }
    let spec = ObjectSpec { crease_angle: Some(CreaseAngle::Degrees(f64::NAN)), ..with(1.into()).unwrap() };
    assert!(spec.crease().is_err());
}

/// The hyperplane w = 0 (in 3D z = 0) from -1 to 1, in D - 1 dimensions cut into simplices around one diagonal or, mirrored,
/// another; facing up or down. Each copy has vertices of its own.
fn sheet<const D: usize>(mirrored: bool, up: bool) -> Surface<D> {
    let mut orders = vec![vec![]];
    for axis in 0..D - 1 {
        let longer =
            |order: Vec<usize>| (0..=order.len()).map(move |at| [&order[..at], &[axis], &order[at..]].concat());
        orders = orders.into_iter().flat_map(longer).collect();
    }
    let (mut vertices, mut simplices) = (Vec::new(), Vec::new());
    for order in orders {
        let mut corner = Vector64::<D>::from_fn(|r, _| if r < D - 1 { -1.0 } else { 0.0 });
        let mut corners = vec![corner];
        for axis in order {
            corner[axis] = 1.0;
            corners.push(corner);
        }
        if mirrored {
            corners.iter_mut().for_each(|corner| corner[0] = -corner[0]);
        }
        let normal = normal_of(&std::array::from_fn::<_, D, _>(|i| corners[i]));
        if (normal[D - 1] > 0.0) != up {
            corners.swap(0, 1);
        }
        simplices.push(std::array::from_fn(|i| (vertices.len() + i) as u32));
        vertices.extend(corners);
    }
    Surface { vertices, simplices, normals: None }
}

fn joined<const D: usize>(sheets: &[Surface<D>]) -> Surface<D> {
    let mut all = Surface { vertices: Vec::new(), simplices: Vec::new(), normals: None };
    for sheet in sheets {
        let before = all.vertices.len() as u32;
        all.simplices.extend(sheet.simplices.iter().map(|s| s.map(|v| v + before)));
        all.vertices.extend(&sheet.vertices);
    }
    all
}

/// What a camera above the sheet sees of ambient occlusion, by values at vertices, by values at voxels, by few rays at either.
fn seen<const D: usize>(session: &Session<D>, eye: f64) -> Vec<Vec<f32>> {
    let over_all = Vector64::<D>::from_fn(|r, _| if r == D - 1 { eye } else { 0.1 * r as f64 });
    let camera = Camera::new(&View { eye: over_all, ..View::default() }).unwrap();
    let exact = Estimator::Exact(exact::Budget::default());
    let values = |estimator| Arc::new(session.occlusion(estimator, None, &Silent).unwrap());
    let few = Sampling::new(64, 1);
    let shadings = [
        Shading::Smooth(values(exact)),
        Shading::Voxel(exact),
        Shading::Smooth(values(Estimator::Adaptive(few))),
        Shading::Voxel(Estimator::Sampled(few)),
    ];
    let dimensions = if D == 4 { [6, 5, 3] } else { [13, 11, 1] };
    (shadings.into_iter())
        .map(|shading| {
            let found = session.render(camera.clone(), dimensions, shading, &[Aov::AmbientOcclusion], &Silent).unwrap();
            let values = &found.array("ambient_occlusion").unwrap().values;
            (0..values.len()).map(|i| values.get(i) as f32).collect()
        })
        .collect()
}

fn two_sided_sheets<const D: usize>() {
    let box_above = || cuboid::<D>(0.25, 0.75, 1).0;
    let scene = |sheets: &[Surface<D>], crease: Crease| {
        let mut builder = MeshBuilder::new();
        builder.add_creased("sheet", [0.8; 3], &joined(sheets), Orientation::Input, crease).unwrap();
        builder.add_creased("box", [0.8; 3], &box_above(), Orientation::Input, Crease::Above(30.0)).unwrap();
        Session::new(builder.finish())
    };
    for crease in [Crease::Never, Crease::Above(30.0), Crease::Above(180.0)].into_iter().take(6 - D) {
        let [up, down] = [true, false].map(|up| sheet::<D>(false, up));
        // From either side the scene looks as with that side alone.
        for (eye, alone) in [(2.5, &up), (-2.5, &down)] {
            let expected = seen(&scene(std::slice::from_ref(alone), crease), eye);
            assert!(expected[1].iter().any(|&a| a < 0.99) == (eye > 0.0), "the box is above");
            let half = Surface { simplices: down.simplices[1..].to_vec(), ..down.clone() };
            let cut_otherwise = sheet::<D>(true, eye < 0.0);
            let (whole, partial) =
                ([up.clone(), down.clone()], if eye > 0.0 { vec![half, up.clone()] } else { vec![] });
            let other = if eye > 0.0 { [cut_otherwise, up.clone()] } else { [cut_otherwise, down.clone()] };
            for (what, sheets) in [
                ("two", whole.to_vec()),
                ("two, the other first", whole.iter().rev().cloned().collect()),
                ("three", vec![down.clone(), up.clone(), down.clone()]),
                ("four", vec![up.clone(), up.clone(), down.clone(), up.clone()]),
                ("the other side in part", partial),
                ("the other side cut otherwise", other.to_vec()),
                ("the same first", other.iter().rev().cloned().collect()),
            ] {
                // Sides that are cut otherwise share vertices where nothing splits them.
                let shared = what.contains("cut otherwise") || what == "the same first";
                if sheets.is_empty() || (shared && crease != Crease::Above(30.0)) {
                    continue;
                }
                let found = seen(&scene(&sheets, crease), eye);
                for (way, (found, expected)) in found.iter().zip(&expected).enumerate() {
                    // The exact ones are the same; rays of vertices with other numbers are others.
                    let room = if way < 2 { 1e-6 } else { 0.06 };
                    for (i, (a, b)) in found.iter().zip(expected).enumerate() {
                        assert!(
                            (a - b).abs() < room,
                            "{D}D, {crease:?}, {what}, {eye}, way {way}, voxel {i}: {a}, {b}"
                        );
                    }
                }
            }
        }
        // Which side comes first changes no bit.
        let [one, other] = [[&up, &down], [&down, &up]].map(|s| scene(&s.map(Surface::clone), crease));
        assert_eq!(seen(&one, 2.5), seen(&other, 2.5), "{D}D, {crease:?}");
    }
}

#[test]
fn sheets_may_have_two_sides() {
    two_sided_sheets::<3>();
    two_sided_sheets::<4>();
}

/// Whether a vertex's normal points away from the origin.
fn outwards<const D: usize>(mesh: &Mesh<D>, vertices: std::ops::Range<usize>) -> Option<bool> {
    let out: Vec<bool> = vertices.map(|v| mesh.normals[v].dot(&mesh.vertices[v]) > 0.0).collect();
    out.iter().all(|o| *o == out[0]).then(|| out[0])
}

fn rooms<const D: usize>() {
    // Three boxes within each other, as one object: seen from the space between two of them, all face that.
    let shells: Vec<Surface<D>> = [4.0, 2.0, 1.0].map(|half| cuboid::<D>(-half, half, 2).0).to_vec();
    let count = shells[0].vertices.len();
    let all = joined(&shells);
    for (place, expected) in [
        (0.3, [false, false, false]),
        (1.5, [false, false, true]),
        (3.1, [false, true, true]),
        (9.0, [true, true, true]),
    ] {
        let eye = Vector::<D>::from_fn(|r, _| if r == D - 1 { place } else { 0.0 });
        let direction = Vector::<D>::from_fn(|r, _| if r == D - 1 { 1.0 } else { 0.0 });
        for viewpoint in [Viewpoint::Eye(eye), Viewpoint::Parallel { direction, middle: eye }] {
            let mut builder = MeshBuilder::new();
            builder.add("shells", [0.8; 3], &all, Orientation::Facing(viewpoint)).unwrap();
            let mesh = builder.finish();
            assert_eq!((mesh.objects[0].components, mesh.objects[0].closed_components), (3, 3));
            let found = [0, 1, 2].map(|shell| outwards(&mesh, shell * count..(shell + 1) * count));
            assert_eq!(found, expected.map(Some), "{D}D, {viewpoint:?}");
        }
    }
    // A room with a box in it, by rays of some length: values at vertices are those of the inside.
    let view = View { eye: Vector64::from_fn(|r, _| 0.2 * (r + 1) as f64), ..View::default() };
    let camera = Camera::<D>::new(&view).unwrap();
    let picture = |facing: Orientation<D>| {
        let mut builder = MeshBuilder::new();
        let (room, crease) = cuboid::<D>(-1.0, 1.0, 4);
        builder.add_creased("room", [0.8; 3], &room, facing, crease).unwrap();
        builder.add_creased("box", [0.8; 3], &cuboid::<D>(-0.75, -0.25, 1).0, Orientation::Input, crease).unwrap();
        let session = Session::new(builder.finish());
        let estimator = Estimator::Sampled(Sampling { max_distance: 0.8, ..Sampling::new(64, 1) });
        let values = Arc::new(session.occlusion(estimator, None, &Silent).unwrap());
        let dimensions = [12, 12, if D == 4 { 6 } else { 1 }];
        [Shading::Smooth(values), Shading::Voxel(estimator)].map(|shading| {
            let found = session.render(camera.clone(), dimensions, shading, &[Aov::AmbientOcclusion], &Silent).unwrap();
            let values = &found.array("ambient_occlusion").unwrap().values;
            (0..values.len()).map(|i| values.get(i)).sum::<f64>() / values.len() as f64
        })
    };
    let [smooth, voxel] = picture(Orientation::Facing(camera.viewpoint()));
    assert!((smooth - voxel).abs() < 0.06 && voxel < 0.9, "{D}D: {smooth} {voxel}");
    let [outside, inside] = picture(Orientation::Input);
    assert!(outside > voxel + 0.05 && (inside - voxel).abs() < 1e-9, "{D}D: {outside} {inside} {voxel}");
}

#[test]
fn rooms_are_seen_from_inside() {
    rooms::<3>();
    rooms::<4>();
}

#[test]
fn a_body_listed_twice_is_that_body() {
    fn check<const D: usize>() {
        let (once, crease) = cuboid::<D>(-1.0, 1.0, 2);
        let mut inwards = once.clone();
        inwards.simplices.iter_mut().for_each(|s| s.swap(0, 1));
        for twice in [[&once, &once], [&inwards, &inwards]].map(|s| joined(&s.map(Surface::clone))) {
            let mesh = mesh(vec![(twice, crease)]);
            assert_eq!((mesh.objects[0].components, mesh.objects[0].closed_components), (1, 1));
            assert_eq!(
                (mesh.copies.len(), outwards(&mesh, 0..mesh.vertices.len())),
                (once.simplices.len(), Some(true))
            );
            assert!(values(&mesh).iter().all(|&a| a == 1.0));
        }
    }
    check::<3>();
    check::<4>();
}

/// Many simplices in one place cost as many simplices, not their square.
#[test]
fn coincident_simplices_cost_what_others_cost() {
    let corners = [[0.0; 4], [1.0, 0.0, 0.0, 0.1], [0.0, 1.0, 0.0, 0.2], [0.0, 0.0, 1.0, 0.3]].map(Vector64::from);
    let count = 3_000;
    for crease in [Crease::Never, Crease::Above(30.0)] {
        let vertices = std::iter::repeat_n(corners, count).flatten().collect();
        let simplices = (0..count as u32).map(|s| [0, 1, 2, 3].map(|i| 4 * s + i)).collect();
        let mesh = mesh(vec![(Surface { vertices, simplices, normals: None }, crease)]);
        assert_eq!((mesh.vertices.len(), mesh.copies.len()), (4 * count, count - 1));
        let backend = CpuBackend::new(Tracer::new(mesh.clone()));
        let estimator = Estimator::Sampled(Sampling::new(4, 1));
        let found = estimator.estimate(&backend, &ShadingPoint::vertices(&mesh), None, &Silent).unwrap();
        assert!(found.values.iter().all(|&a| a == 1.0));
        // Neither rays nor the cones around a vertex meet more than one of them.
        assert_eq!(backend.tracer().bvh().order, [0]);
        assert!((0..4).all(|v| backend.tracer().incidence().around(v) == [0]));
    }
}
