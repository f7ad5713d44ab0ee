//! Simplices whose corners lie on the rays of points, as nearly as coordinates allow: whether such a ray hits is always a close call.

use ao4d::geometry::{Frame, Vector, Vector64};
use ao4d::mesh::{Mesh, MeshBuilder, Orientation, Surface};
use ao4d::trace::{Sampling, Sequence, ShadingPoint};

/// Numbers between 0 and 1.
fn numbers(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) + 1;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Points around `offset`, and for each of them some simplices with corners on rays of the sampling; the more of them, the more rays are
/// close to several.
pub fn on_rays<const D: usize>(
    count: u64,
    simplices: usize,
    offset: f64,
    sampling: &Sampling,
) -> (Mesh<D>, Vec<ShadingPoint<D>>) {
    let mut number = numbers(count);
    // Simplex 0 is the one that all points are in; it is hit by none of their rays.
    let mut surface = Surface::<D> {
        vertices: (0..D).map(|i| Vector64::from_fn(|k, _| offset + 0.001 * f64::from(u8::from(i == k)))).collect(),
        simplices: vec![std::array::from_fn(|i| i as u32)],
        normals: None,
    };
    let mut points = Vec::new();
    for point in 0..count {
        let position = Vector::<D>::from_fn(|_, _| (offset + number() - 0.5) as f32);
        let normal = Vector::<D>::from_fn(|_, _| number() as f32 - 0.5).normalize();
        points.push(ShadingPoint::Inside { position, normal, simplex: 0, number: point });
        let (frame, mut sequence) = (Frame::new(&normal), Sequence::new(sampling.sampler, sampling.seed, point));
        let rays: Vec<Vector<D>> = (0..sampling.samples).map(|_| sequence.next_direction(&frame)).collect();
        for _ in 0..simplices {
            let first = surface.vertices.len() as u32;
            for _ in 0..D {
                let ray = rays[(number() * rays.len() as f64) as usize];
                let distance = 0.05 * (0.1 + number());
                surface.vertices.push(Vector64::from_fn(|k, _| f64::from(position[k]) + distance * f64::from(ray[k])));
            }
            surface.simplices.push(std::array::from_fn(|i| first + i as u32));
        }
    }
    let mut builder = MeshBuilder::new();
    builder.add("on rays", [0.8; 3], &surface, Orientation::Input).unwrap();
    (builder.finish(), points)
}

/// Vertices around `offset`, each of which has a simplex whose edges from there lie above rays of its own, or on them: whether the simplex hides
/// such a ray, which then lies between an edge and the inverted normal, is a close call.
pub fn stars_on_rays<const D: usize>(
    count: usize,
    offset: f64,
    sampling: &Sampling,
) -> (Mesh<D>, Vec<ShadingPoint<D>>) {
    let mut number = numbers(count as u64);
    let mut random = |middle: f64| Vector64::<D>::from_fn(|_, _| middle + number() - 0.5);
    let mut surface = Surface::<D> {
        vertices: (0..D * count).map(|_| random(offset)).collect(),
        simplices: (0..count).map(|k| std::array::from_fn(|i| (D * k + i) as u32)).collect(),
        normals: Some((0..D * count).map(|_| random(0.0)).collect()),
    };
    let build = |surface: &Surface<D>| {
        let mut builder = MeshBuilder::new();
        builder.add("stars on rays", [0.8; 3], surface, Orientation::Input).unwrap();
        builder.finish()
    };
    // As the mesh has them, places and normals are rounded.
    let mesh = build(&surface);
    let apices: Vec<u32> = (0..count).map(|k| (D * k) as u32).collect();
    for &apex in &apices {
        let (position, normal) = (mesh.vertices[apex as usize], mesh.normals[apex as usize]);
        let frame = Frame::new(&normal);
        let mut sequence = Sequence::new(sampling.sampler, sampling.seed, u64::from(apex));
        let rays: Vec<Vector<D>> = (0..sampling.samples).map(|_| sequence.next_direction(&frame)).collect();
        for corner in 1..D {
            let ray = rays[(number() * rays.len() as f64) as usize];
            let (distance, above) = (0.05 * (0.1 + number()), (number() - 0.3).max(0.0));
            // Some along the normal: rounding decides which way their flat cones are turned.
            let ray = if number() < 0.1 { normal } else { ray };
            surface.vertices[apex as usize + corner] = Vector64::from_fn(|k, _| {
                f64::from(position[k]) + distance * (f64::from(ray[k]) + above * f64::from(normal[k]))
            });
        }
    }
    (build(&surface), apices.into_iter().map(ShadingPoint::Vertex).collect())
}
