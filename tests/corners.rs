//! Vertices split at creases, and the values there: limits along each face, known in closed form, in 3D and 4D.

use std::path::Path;

use ao4d::accel::Tracer;
use ao4d::geometry::Vector64;
use ao4d::mesh::{Crease, Mesh, MeshBuilder, Orientation, Surface};
use ao4d::occlusion::{Estimator, exact};
use ao4d::progress::Silent;
use ao4d::scene::{CreaseAngle, ObjectSpec, build_object};
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
