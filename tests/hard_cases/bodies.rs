//! Closed bodies with points inside them.

use std::path::Path;

use ao4d::geometry::{Vector, Vector64, narrow, widen};
use ao4d::mesh::{Mesh, MeshBuilder, Orientation, Surface};
use ao4d::scene::{ObjectSpec, build_object};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use serde_json::{Value, json};

/// A closed surface, and points around which it winds once.
pub struct Body<const D: usize> {
    pub name: String,
    pub surface: Surface<D>,
    pub inside: Vec<Vector<D>>,
}

pub fn random(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

pub fn mesh<const D: usize>(surfaces: &[&Surface<D>]) -> Mesh<D> {
    let mut builder = MeshBuilder::new();
    for (i, surface) in surfaces.iter().enumerate() {
        builder.add(&format!("{i}"), [1.0; 3], surface, Orientation::Input).unwrap();
    }
    builder.finish()
}

/// An object as a pipeline describes it.
pub fn object<const D: usize>(description: Value) -> Surface<D> {
    let spec: ObjectSpec = serde_json::from_value(description).unwrap();
    build_object(&spec, &Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines")).unwrap()
}

pub fn cuboid<const D: usize>(half: f64, subdivisions: u32) -> Surface<D> {
    object(json!({"box": {"min": vec![-half; D], "max": vec![half; D], "subdivisions": subdivisions}}))
}

pub fn sphere<const D: usize>(radius: f64, subdivisions: u32) -> Surface<D> {
    object(json!({"hypersphere": {"radius": radius, "subdivisions": subdivisions}}))
}

/// A vector with components in [-1, 1).
pub fn vector<const D: usize>(random: &mut ChaCha8Rng) -> Vector64<D> {
    Vector64::from_fn(|_, _| 2.0 * random.random::<f64>() - 1.0)
}

pub fn map<const D: usize>(surface: &Surface<D>, mut place: impl FnMut(&Vector64<D>) -> Vector64<D>) -> Surface<D> {
    Surface { vertices: surface.vertices.iter().map(&mut place).collect(), ..surface.clone() }
}

/// To a multiple of `step`, a power of two: differences and small sums of such numbers are exact.
pub fn round_to<const D: usize>(point: &Vector64<D>, step: f64) -> Vector64<D> {
    point.map(|x| (x / step).round() * step)
}

impl<const D: usize> Body<D> {
    /// A body with some points near its middle, from which all of it is seen.
    fn around_origin(name: impl Into<String>, surface: Surface<D>, reach: f64, step: f64) -> Self {
        let mut random = random(77);
        let mut inside = vec![Vector::zeros()];
        inside.extend((0..30).map(|_| narrow(&round_to(&(vector::<D>(&mut random) * reach), step))));
        Self { name: name.into(), surface, inside }
    }

    /// The body scaled and moved, points and all.
    pub fn placed(&self, factor: f64, offset: f64) -> Self {
        let place = |p: &Vector64<D>| p.map(|x| x * factor + offset);
        Self {
            name: format!("{}, scaled by {factor:e}, moved by {offset:e}", self.name),
            surface: map(&self.surface, place),
            inside: self.inside.iter().map(|p| narrow(&place(&widen(p)))).collect(),
        }
    }
}

/// Boxes, balls, cut cubes and an extruded nut as scenes have them, turned or not.
pub fn plain<const D: usize>() -> Vec<Body<D>> {
    let n = if D == 3 { 24 } else { 8 };
    let mut bodies = vec![
        Body::around_origin("box", cuboid(0.75, n), 0.7, 1.0 / 64.0),
        // Not on the lattice: the coordinates are rounded.
        Body::around_origin("box of odd size", cuboid(0.7321, n - 1), 0.7, 1e-3),
        Body::around_origin("ball", sphere(1.0, n), 0.5, 1e-3),
        Body::around_origin(
            "ball on a lattice",
            map(&sphere(1.0, n), |p| round_to(p, 1.0 / 1024.0)),
            0.5,
            1.0 / 1024.0,
        ),
        Body::around_origin("cross-polytope", sphere(1.0, 1), 0.2, 1.0 / 64.0),
    ];
    if D == 4 {
        let cells = json!({"hypersphere": {"radius": 1, "from": "600-cell", "subdivisions": 2}});
        bodies.push(Body::around_origin("600-cell, subdivided", object(cells), 0.5, 1e-3));
    }
    // A cube with a groove, and points inside it, also in the planes of the groove's sides.
    let (from, to) = (vec![0.25; 2], vec![2.0; 2]);
    let groove = |ends: Vec<f64>, rest: f64| -> Vec<f64> { (0..D).map(|i| *ends.get(i).unwrap_or(&rest)).collect() };
    let grooved: Surface<D> = object(json!({"cut_cube": {
        "min": vec![-1.0; D], "max": vec![1.0; D], "subdivisions": n / 2,
        "cuts": [{"from": groove(from, -2.0), "to": groove(to, 2.0)}],
    }}));
    let mut random = random(5);
    let mut inside: Vec<Vector<D>> = Vec::new();
    while inside.len() < 40 {
        let p = round_to(&vector::<D>(&mut random), 1.0 / 8.0);
        let in_groove = p[0] >= 0.25 && p[1] >= 0.25;
        if p.amax() < 1.0 && !in_groove {
            inside.push(narrow(&p));
        }
    }
    bodies.push(Body { name: "cut cube".into(), surface: grooved, inside });
    bodies
}

/// A tetrahedral mesh swept along w. What is inside is found by counting crossings of a random ray, simplex by simplex.
pub fn nut() -> Body<4> {
    let surface: Surface<4> = object(json!({
        "extrude": {"mesh": "meshes/nut.vtu", "from": -12, "to": 12, "layers": 4},
        "transform": [{"translate": [-81.361, 81.907, 81.361, 0]}, {"scale": 0.045}],
    }));
    let mesh = mesh(&[&surface]);
    assert!(mesh.objects[0].is_closed());
    let bounds = mesh.bounds();
    let mut random = random(6);
    let mut inside = Vec::new();
    while inside.len() < 20 {
        let share = vector::<4>(&mut random);
        let p: Vector<4> =
            Vector::from_fn(|i, _| bounds.min[i] + (bounds.max[i] - bounds.min[i]) * (share[i] as f32 + 1.0) * 0.5);
        let direction = narrow(&vector::<4>(&mut random));
        let crossings = (0..mesh.simplices.len() as u32)
            .filter(|&s| ao4d::geometry::Cone::of_simplex(&p, &mesh.corners(s)).contains(&direction))
            .count();
        if crossings % 2 == 1 {
            inside.push(p);
        }
    }
    Body { name: "extruded nut".into(), surface, inside }
}

/// Bodies that wind once around the origin, and are as badly shaped as can be.
pub fn distorted<const D: usize>() -> Vec<Body<D>> {
    let n = if D == 3 { 16 } else { 6 };
    let mut random = random(8);
    let round = sphere::<D>(1.0, n);
    let mut bodies = Vec::new();
    // Spikes: each vertex moved along its ray.
    for decades in [1.0, 3.0, 6.0] {
        let surface = map(&round, |p| p * 10f64.powf(decades * (random.random::<f64>() - 0.5)));
        bodies.push(Body::around_origin(format!("spikes over {decades} decades"), surface, 0.0, 1.0));
    }
    // Flat in one direction.
    for flatness in [1e-3, 1e-6, 1e-9, 1e-12] {
        let squeeze = |p: &Vector64<D>| Vector64::from_fn(|i, _| if i == 1 { p[i] * flatness } else { p[i] });
        let mut body = Body::around_origin(format!("flattened to {flatness:e}"), map(&round, squeeze), 0.4, 1e-3);
        body.inside.iter_mut().for_each(|p| *p = narrow(&squeeze(&widen(p))));
        bodies.push(body);
        // Along a slanted direction: no facet is parallel to an axis.
        let direction = vector::<D>(&mut random).normalize();
        let squeeze = |p: &Vector64<D>| p - direction * (direction.dot(p) * (1.0 - flatness));
        if flatness >= 1e-6 {
            let surface = map(&round, squeeze);
            bodies.push(Body::around_origin(format!("slanted, flattened to {flatness:e}"), surface, 0.0, 1.0));
        }
    }
    // The vertices of a box's sides strewn over their sides, some onto each other or an ulp beside: slivers of any shape,
    // folded over each other.
    for (name, share) in [("strewn", 1.0), ("all but coincident", 1e-7), ("coincident", 0.0)] {
        let side = cuboid::<D>(1.0, n);
        let surface = map(&side, |p| {
            Vector64::from_fn(|i, _| {
                if p[i].abs() == 1.0 { p[i] } else { 0.3 + (2.0 * random.random::<f64>() - 1.0) * share * 0.7 }
            })
        });
        bodies.push(Body::around_origin(format!("box, vertices {name}"), surface, 0.9, 1.0 / 256.0));
    }
    bodies
}
