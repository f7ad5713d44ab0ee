//! Simplices whose corners lie on the rays of points, as nearly as coordinates allow: whether such a ray hits is always a close call.

use ao4d::geometry::{Frame, Vector, Vector64};
use ao4d::mesh::{Mesh, MeshBuilder, Orientation, Surface};
use ao4d::trace::{Sampling, Sequence, ShadingPoint};

/// Points around `offset`, and for each of them some simplices with corners on rays of the sampling; the more of them, the more rays are
/// close to several.
pub fn on_rays<const D: usize>(
    count: u64,
    simplices: usize,
    offset: f64,
    sampling: &Sampling,
) -> (Mesh<D>, Vec<ShadingPoint<D>>) {
    let mut state = count.wrapping_mul(0x9e37_79b9_7f4a_7c15) + 1;
    let mut number = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
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
