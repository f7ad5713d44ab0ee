//! What the rays of a shading point bring beside the share that escapes: where the open directions are, and the light of the
//! surfaces that the others hit.
//!
//! The rays are those of ambient occlusion, so A is the same to the bit. Of each ray that escapes the direction counts,
//!
//! ```text
//! b = mean over rays of V(w) w
//! ```
//!
//! and of each that is blocked the light that leaves the surface it hits first (its radiosity, in the unit of a sky of 1):
//! one bounce. Surfaces are diffuse, so what leaves them depends on no direction, and is interpolated between the values at
//! the simplex's vertices. A ray that the vertex's own star hides meets the simplex right there, at the vertex.
//!
//! The error of the bounce is found as that of A ([`super::Estimate`]), by the scatter of 8 to 15 groups of rays, and is at
//! least what the error of A makes of a surface of the mean radiosity: the border of what is hidden is one for both.
//!
//! Packets tell on the processor which rays escape; what the others hit is looked for ray by ray. OpenCL devices tell how many
//! rays escape, not which.

use rayon::prelude::*;

use super::cpu::PacketTracer;
use super::estimate::{Estimate, variance_together};
use super::surroundings::{Met, Surroundings};
use super::{Sampler, Sampling, ShadingPoint};
use crate::accel::Tracer;
use crate::geometry::{Dimension, Vector, Vector64, normal_of, widen};
use crate::progress::{Cancelled, Progress};

/// Points that a thread takes at a time.
const BATCH: usize = 16;

/// Groups of rays, at most twice as many.
const GROUPS: usize = 8;

/// What the rays of a point bring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gathered<const D: usize> {
    /// Ambient occlusion A, the same as without directions.
    pub open: Estimate,
    /// The vector b: the mean over all rays of direction times visibility.
    pub vector: Vector64<D>,
    /// The light of other surfaces, red, green and blue, where that of an open sky is 1.
    pub bounced: [f64; 3],
    /// Its standard error, of the channel where it is largest.
    pub bounced_error: f64,
    /// How many rays hit something.
    pub hits: u32,
    /// How many of those hit a surface from behind, whose radiosity is that of its front.
    pub behind: u32,
}

/// Sums over groups of rays. As rays come in two groups become one, so that there are [`GROUPS`] to twice as many.
struct Light {
    groups: Vec<[f64; 3]>,
    /// Rays a group.
    size: u32,
    begun: u32,
    sum: [f64; 3],
    squares: [f64; 3],
}

impl Light {
    fn new() -> Self {
        Self { groups: vec![[0.0; 3]], size: 1, begun: 0, sum: [0.0; 3], squares: [0.0; 3] }
    }

    /// The next ray's.
    fn add(&mut self, light: [f64; 3]) {
        if self.begun == self.size {
            self.begun = 0;
            if self.groups.len() == 2 * GROUPS {
                let both = |pair: &[[f64; 3]]| std::array::from_fn(|c| pair[0][c] + pair[1][c]);
                self.groups = self.groups.chunks_exact(2).map(both).collect();
                self.size *= 2;
            }
            self.groups.push([0.0; 3]);
        }
        self.begun += 1;
        let last = self.groups.len() - 1;
        for (c, light) in light.into_iter().enumerate() {
            self.groups[last][c] += light;
            self.sum[c] += light;
            self.squares[c] += light * light;
        }
    }

    /// The standard error of the channel where it is largest, of so many rays in all.
    fn error(&self, rays: u32, even_in: Option<Dimension>) -> f64 {
        let rays = f64::from(rays);
        let Some(dimension) = even_in else {
            let variance =
                |c: usize| (self.squares[c] - self.sum[c] * self.sum[c] / rays) / (rays * (rays - 1.0).max(1.0));
            return (0..3).map(variance).fold(0.0, f64::max).sqrt();
        };
        let full = self.groups.len() - usize::from(self.begun < self.size);
        let (count, size) = (full as f64, f64::from(self.size));
        if full < 2 {
            return 0.0;
        }
        let variance = |c: usize| {
            let sum: f64 = self.groups[..full].iter().map(|g| g[c]).sum();
            let scatter: f64 = self.groups[..full].iter().map(|g| (g[c] - sum / count).powi(2)).sum();
            scatter / ((count - 1.0) * count * size * size)
        };
        let together = variance_together(count, dimension);
        ((0..3).map(variance).fold(0.0, f64::max) * together).sqrt()
    }
}

/// What the rays of these points bring, in their order: as many as the sampling says. With `radiosity`, one value a vertex,
/// the light of what they hit too; else none. Each point is a step of `progress`.
///
/// # Errors
/// [`Cancelled`] if `progress` says so.
///
/// # Panics
/// If there are fewer radiosities than vertices.
pub fn gather<const D: usize>(
    tracer: &Tracer<D>,
    points: &[ShadingPoint<D>],
    sampling: &Sampling,
    radiosity: Option<&[[f32; 3]]>,
    progress: &dyn Progress,
) -> Result<Vec<Gathered<D>>, Cancelled> {
    assert!(radiosity.is_none_or(|r| r.len() >= tracer.mesh().vertices.len()), "one radiosity a vertex");
    if radiosity.is_some() {
        // What rays hit is found one by one.
        tracer.prepare();
    }
    tracer.prepare_wide();
    let brightest = radiosity.into_iter().flatten().flatten().fold(0.0f32, |most, &r| most.max(r));
    let radiosity = radiosity.map(|r| (r, f64::from(brightest)));
    let found = points.par_chunks(BATCH).map_init(PacketTracer::default, |packets, points| {
        let at = |point| {
            let found = at_point(packets, tracer, point, sampling, radiosity, progress)?;
            progress.advance(1);
            Ok(found)
        };
        points.iter().map(at).collect::<Result<Vec<_>, Cancelled>>()
    });
    Ok(found.collect::<Result<Vec<_>, Cancelled>>()?.concat())
}

fn at_point<const D: usize>(
    packets: &mut PacketTracer<D>,
    tracer: &Tracer<D>,
    point: &ShadingPoint<D>,
    sampling: &Sampling,
    radiosity: Option<(&[[f32; 3]], f64)>,
    progress: &dyn Progress,
) -> Result<Gathered<D>, Cancelled> {
    let nothing = Gathered {
        open: Estimate::known(1.0),
        vector: Vector64::zeros(),
        bounced: [0.0; 3],
        bounced_error: 0.0,
        hits: 0,
        behind: 0,
    };
    let mut found = nothing;
    let Some((radiosity, brightest)) = radiosity else {
        let mut watch = |direction: Vector<D>, is_open: bool| {
            if is_open {
                found.vector += widen(&direction);
            }
        };
        found.open = packets.watched(tracer, point, sampling, &mut watch, progress)?;
        found.vector /= f64::from(found.open.rays.max(1));
        return Ok(found);
    };
    let (mesh, surroundings, mut light) = (tracer.mesh(), Surroundings::of(tracer, point), Light::new());
    let mut watch = |direction: Vector<D>, is_open: bool| {
        let met = if is_open { None } else { surroundings.meets(tracer, direction, sampling.max_distance) };
        let mut sent = [0.0; 3];
        match met {
            None => found.vector += widen(&direction),
            Some(Met { simplex, barycentric }) => {
                let corners = mesh.corners(simplex).map(|v| widen(&v));
                found.hits += 1;
                found.behind += u32::from(normal_of(&corners).dot(&widen(&direction)) > 0.0);
                for (&vertex, weight) in mesh.simplices[simplex as usize].iter().zip(barycentric) {
                    (0..3).for_each(|c| sent[c] += weight * f64::from(radiosity[vertex as usize][c]));
                }
            }
        }
        light.add(sent);
    };
    found.open = packets.watched(tracer, point, sampling, &mut watch, progress)?;
    let rays = found.open.rays;
    if rays == 0 {
        return Ok(nothing);
    }
    found.vector /= f64::from(rays);
    found.bounced = light.sum.map(|c| c / f64::from(rays));
    let even_in = (sampling.sampler == Sampler::Sobol).then_some(Dimension::of::<D>());
    let most = light.sum.into_iter().fold(0.0, f64::max);
    let mean = if found.hits > 0 { most / f64::from(found.hits) } else { brightest };
    found.bounced_error = light.error(rays, even_in).max(mean * f64::from(found.open.error));
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_hold_every_ray_once_and_are_as_large_as_each_other() {
        for rays in 1..400u32 {
            let mut light = Light::new();
            (0..rays).for_each(|i| light.add([1.0, f64::from(i), 0.0]));
            let counts: Vec<f64> = light.groups.iter().map(|g| g[0]).collect();
            assert_eq!(counts.iter().sum::<f64>(), f64::from(rays));
            let (last, before) = counts.split_last().unwrap();
            assert!(before.iter().all(|&c| c == f64::from(light.size)) && *last <= f64::from(light.size), "{counts:?}");
            assert!(counts.len() <= 2 * GROUPS && (rays < 16 || counts.len() >= GROUPS), "{rays}: {counts:?}");
            // Of rays that are all alike there is no scatter.
            let alike = Light { groups: light.groups.iter().map(|g| [g[0], 0.0, 0.0]).collect(), ..light };
            assert!(alike.error(rays, Some(Dimension::Four)) < 1e-12);
        }
    }

    #[test]
    fn independent_rays_have_the_error_of_their_scatter() {
        let mut light = Light::new();
        let values: Vec<f64> = (0..300u32).map(|i| f64::from(i.wrapping_mul(2_654_435_769) >> 20)).collect();
        values.iter().for_each(|&v| light.add([v, 0.0, 0.0]));
        let mean = values.iter().sum::<f64>() / 300.0;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 299.0 / 300.0;
        assert!((light.error(300, None) / variance.sqrt() - 1.0).abs() < 1e-9);
    }
}
