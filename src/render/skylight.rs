//! Light from the sky and from other surfaces: what occlusion is for.
//!
//! A sky whose light is linear in the direction, L(w) = 1 + g . w with |g| at most 1, lights a point by A + g . b, exactly
//! ([`crate::occlusion::Directional`]); what hides it may send light too, one bounce. The sum is the irradiance, in which an
//! open surface under a sky of 1 has 1.
//!
//! The G-buffer does not hold b and the bounce, but two means, over what is open and over what is hidden:
//!
//! ```text
//! direction = b / A                hidden = bounce / (1 - A)
//! irradiance = A (1 + g . direction) + (1 - A) hidden
//! ```
//!
//! They vary less than b and the bounce where A jumps, and irradiance is never below zero. So where A is found voxel by
//! voxel while these are interpolated between vertices (`auto`), or where A was denoised, both still fit together.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use super::gbuffer::{Columns, GBuffer};
use super::light::reflectance;
use crate::geometry::{Vector64, widen};
use crate::mesh::Mesh;
use crate::occlusion::{Bounced, Directional};

/// Light from the sky and from other surfaces.
#[derive(Debug)]
pub struct Skylight<const D: usize> {
    /// The sky's gradient g: from the direction w comes the light 1 + g . w.
    pub gradient: Vector64<D>,
    /// A and b at the vertices, for points that interpolate.
    pub directions: Option<Arc<Directional<D>>>,
    /// The light of other surfaces at the vertices, for points that interpolate.
    pub bounced: Option<Arc<Bounced>>,
    /// The light that leaves the surface at each vertex ([`radiosity`]), for points that look for themselves.
    pub radiosity: Option<Arc<Vec<[f32; 3]>>>,
    /// Whether all of it is looked for in the image itself, in screen space, and if so, whether the light of other surfaces is too.
    pub in_image: Option<bool>,
    /// Rays of such points that hit something, and those that hit it from behind.
    hits: AtomicU64,
    behind: AtomicU64,
}

impl<const D: usize> Skylight<D> {
    /// A sky of this gradient over scenes without occlusion.
    pub fn new(gradient: Vector64<D>) -> Self {
        let (hits, behind) = (AtomicU64::new(0), AtomicU64::new(0));
        Self { gradient, directions: None, bounced: None, radiosity: None, in_image: None, hits, behind }
    }

    /// Whether it shines on all sides alike.
    pub fn is_even(&self) -> bool {
        self.gradient.amax() == 0.0
    }

    /// Takes note of rays that looked for other surfaces.
    pub(super) fn count(&self, bounced: &Bounced) {
        self.hits.fetch_add(bounced.hits, Ordering::Relaxed);
        self.behind.fetch_add(bounced.behind, Ordering::Relaxed);
    }

    /// How many of the rays for pictures so far hit other surfaces, and how many of those hit them from behind.
    pub fn seen(&self) -> (u64, u64) {
        let at_vertices = self.bounced.as_ref().map_or((0, 0), |bounced| (bounced.hits, bounced.behind));
        (at_vertices.0 + self.hits.load(Ordering::Relaxed), at_vertices.1 + self.behind.load(Ordering::Relaxed))
    }

    /// The columns that irradiance is made of.
    pub(super) fn columns(&self) -> Columns {
        let direction = if self.is_even() { Columns::empty() } else { Columns::DIRECTION };
        let hidden = match (&self.bounced, &self.radiosity) {
            (None, None) if self.in_image != Some(true) => Columns::empty(),
            _ => Columns::HIDDEN,
        };
        direction | hidden
    }
}

/// Sets the irradiance of a buffer that has the column; without a skylight that of an even sky.
pub(super) fn shine<const D: usize>(skylight: Option<&Skylight<D>>, buffer: &mut GBuffer<D>) {
    let gradient = skylight.map_or_else(Vector64::zeros, |skylight| skylight.gradient);
    buffer.rows_mut().into_par_iter().for_each(|row| {
        for (i, out) in row.irradiance.iter_mut().enumerate() {
            let open = f64::from(row.occlusion[i]);
            let sky = row.direction.get(i).map_or(open, |w| open * (1.0 + gradient.dot(&widen(w))).max(0.0));
            let hidden = row.hidden.get(i).copied().unwrap_or_default();
            *out = hidden.map(|c| (sky + (1.0 - open) * f64::from(c)) as f32);
        }
    });
}

/// The light that leaves the surface at each vertex under a sky of this gradient: its reflectance, from the object's colour,
/// times A + g . b.
pub fn radiosity<const D: usize>(mesh: &Mesh<D>, found: &Directional<D>, gradient: &Vector64<D>) -> Vec<[f32; 3]> {
    let mut radiosity = vec![[0.0; 3]; mesh.vertices.len()];
    for object in &mesh.objects {
        let reflectance = reflectance(object.color);
        for v in object.vertices.clone() {
            let light = f64::from(found.estimates.values[v]) + gradient.dot(&widen(&found.vectors[v]));
            radiosity[v] = reflectance.map(|c| (c * light.max(0.0)) as f32);
        }
    }
    radiosity
}

/// Relights a picture: A + g . b of each voxel, from its arrays `ambient_occlusion` and `bent_normal` (D numbers a voxel) and
/// the gradient of a new sky. No ray is traced. Voxels that one of the two has no numbers of are left out.
pub fn relight<const D: usize>(occlusion: &[f32], bent_normal: &[f32], gradient: &Vector64<D>) -> Vec<f32> {
    let gradient: [f32; D] = std::array::from_fn(|i| gradient[i] as f32);
    let vectors = bent_normal.par_chunks_exact(D).with_min_len(1 << 14);
    let light = |(&a, b): (&f32, &[f32])| (0..D).fold(a, |sum, i| sum + gradient[i] * b[i]).max(0.0);
    occlusion.par_iter().with_min_len(1 << 14).zip(vectors).map(light).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vector;

    fn relighting<const D: usize>() {
        let voxels = 1000;
        let number = |i: usize| ((i * 7919) % 1000) as f32 / 1000.0;
        let occlusion: Vec<f32> = (0..voxels).map(number).collect();
        let direction = |i: usize| Vector::<D>::from_fn(|r, _| (number(3 * i + r) - 0.5) * 0.9);
        let bent: Vec<f32> =
            (0..voxels).flat_map(|i| (direction(i) * occlusion[i]).iter().copied().collect::<Vec<_>>()).collect();
        let gradient = Vector64::<D>::from_fn(|r, _| [0.3, -0.6, 0.2, 0.5][r]);
        let columns = Columns::OCCLUSION | Columns::DIRECTION | Columns::IRRADIANCE;
        let mut buffer = GBuffer::<D>::new([voxels, 1, 1], 0..1, columns);
        buffer.occlusion = occlusion.clone();
        buffer.direction = (0..voxels).map(direction).collect();
        shine(Some(&Skylight::new(gradient)), &mut buffer);
        let again = relight::<D>(&occlusion, &bent, &gradient);
        assert_eq!(again.len(), voxels);
        for (i, light) in again.iter().enumerate() {
            let expected = f64::from(occlusion[i]) * (1.0 + gradient.dot(&widen(&direction(i))));
            assert!((f64::from(*light) - expected).abs() < 1e-6, "{light} {expected}");
            assert!((f64::from(buffer.irradiance[i][1]) - expected).abs() < 1e-6);
        }
        assert_eq!(relight::<D>(&occlusion, &bent[..D * 10], &gradient).len(), 10);
    }

    #[test]
    fn relighting_a_picture_gives_its_irradiance_under_another_sky() {
        relighting::<3>();
        relighting::<4>();
    }

    /// A million voxels in 20 ms, told where it is run optimised: `cargo test --release relighting_is_quick -- --ignored --nocapture`.
    #[test]
    #[ignore = "a measurement"]
    fn relighting_is_quick() {
        let (occlusion, bent) = (vec![0.5f32; 1_000_000], vec![0.1f32; 4_000_000]);
        let gradient = Vector64::<4>::from_fn(|r, _| [0.3, -0.6, 0.2, 0.5][r]);
        let mut best = f64::INFINITY;
        for _ in 0..20 {
            let start = std::time::Instant::now();
            assert_eq!(relight::<4>(&occlusion, &bent, &gradient).len(), 1_000_000);
            best = best.min(start.elapsed().as_secs_f64());
        }
        println!("{:.2} ms for 100^3 voxels in 4D", best * 1e3);
        assert!(best < 0.02, "{best}");
    }
}
