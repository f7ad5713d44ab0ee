//! Closed forms over what rays have found: a control variate.
//!
//! A quarter of the rays finds some occluders. What these leave open together is known in closed form; the other rays,
//! independent of the first, estimate what else is hidden. Without bias, and the better the more of the occlusion comes
//! from the few simplices that were found.

use ao4d::accel::Tracer;
use ao4d::geometry::Ray;
use ao4d::mesh::Mesh;
use ao4d::occlusion::exact::{Budget, Hemisphere};
use ao4d::trace::{Sampler, Sequence, ShadingPoint, Surroundings};

/// The value at a vertex.
pub fn estimate<const D: usize>(mesh: &Mesh<D>, tracer: &Tracer<D>, vertex: u32, rays: u32, seed: u64) -> f64 {
    let point = ShadingPoint::Vertex(vertex);
    let surroundings = Surroundings::of(tracer, &point);
    let frame = surroundings.frame();
    let mut known: Vec<u32> = tracer.incidence().around(mesh.identity[vertex as usize]).to_vec();
    let mut first = Sequence::new(Sampler::Sobol, seed, u64::from(vertex));
    for _ in 0..rays / 4 {
        let ray = Ray::new(surroundings.position, first.next_direction(&frame));
        known.extend(tracer.closest_hit(&ray).map(|hit| hit.simplex));
    }
    known.sort_unstable();
    known.dedup();
    let simplices = known.iter().map(|&s| mesh.simplices[s as usize]).collect();
    let part = Mesh { simplices, degenerate: Vec::new(), objects: Vec::new(), ..mesh.clone() };
    let part_tracer = Tracer::new(part);
    let view = Hemisphere::over(&part_tracer, &point);
    let Some(Ok(open)) = view.map(|view| view.visible_fraction(Budget::default())) else { return f64::NAN };
    let part_surroundings = Surroundings::of(&part_tracer, &point);
    let mut second = Sequence::new(Sampler::Sobol, seed ^ 0x5eed, u64::from(vertex));
    let others = rays - rays / 4;
    let hidden = (0..others)
        .filter(|_| {
            let direction = second.next_direction(&frame);
            part_surroundings.is_visible(&part_tracer, direction, f32::INFINITY)
                && !surroundings.is_visible(tracer, direction, f32::INFINITY)
        })
        .count();
    open - hidden as f64 / f64::from(others)
}
