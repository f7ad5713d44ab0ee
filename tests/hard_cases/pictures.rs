//! Voxel centres exactly on vertices, edges and facets.

use std::sync::Arc;

use ao4d::accel::Tracer;
use ao4d::geometry::Vector64;
use ao4d::progress::Silent;
use ao4d::render::{Aov, Camera, Projection, Renderer, Shading, View};
use ao4d::trace::cpu::CpuBackend;
use ao4d::volume::Values;

use crate::bodies::{cuboid, map, mesh};

/// Looks along the last axis at a box whose pieces are as large as voxels, corner on centre: each voxel's ray goes through
/// a vertex, or with `half` through the middle of a piece, which is on a diagonal that pieces share.
fn voxels_on_facets<const D: usize>(half: bool, perspective: bool) -> usize {
    let (count, pieces) = (16usize, if half { 8 } else { 7 });
    let spacing = 0.25;
    // The front side in the hyperplane w = 0, as deep as wide.
    let size = spacing * f64::from(pieces) / 2.0;
    let back = |p: &Vector64<D>| Vector64::from_fn(|i, _| if i == D - 1 { p[i] - size } else { p[i] });
    let mesh = mesh(&[&map(&cuboid::<D>(size, pieces), back)]);
    let backend = Arc::new(CpuBackend::new(Tracer::new(mesh)));
    let height = spacing * count as f64;
    let (distance, projection) = if perspective {
        (height / 2.0, Projection::Perspective { field_of_view: 90.0 })
    } else {
        (1.0, Projection::Parallel { height })
    };
    let eye = View::<D>::default().eye * distance;
    let camera = Camera::new(&View { eye, projection, ..View::default() }).unwrap();
    let dimensions = [count, count, if D == 4 { count } else { 1 }];
    let renderer = Renderer::new(backend, camera, dimensions, Shading::None);
    let grid = renderer.grid;
    let arrays = renderer.volume(&[Aov::Opacity, Aov::Depth], &Silent).unwrap().arrays;
    let (Values::F32(opacity), Values::F32(depth)) = (&arrays[0].values, &arrays[1].values) else { panic!("types") };
    let mut wrong = 0;
    for (n, (&opacity, &depth)) in opacity.iter().zip(depth).enumerate() {
        // Voxel centres are at odd multiples of 1/8. In perspective the image is where the front side is.
        let index = [n % count, n / count % count, n / count / count];
        let point = (0..D - 1).map(|a| (2.0 * index[a] as f64 + 1.0 - count as f64) * spacing / 2.0);
        let far = point.clone().map(f64::abs).fold(0.0, f64::max);
        if perspective && far == size {
            continue; // A direction of length 1 is rounded: the ray may pass on either side of the silhouette.
        }
        let length = if perspective { point.map(|x| x * x).sum::<f64>() + distance * distance } else { 1.0 }.sqrt();
        let right =
            if far <= size { opacity == 1.0 && (f64::from(depth) - length).abs() < 1e-6 } else { opacity == 0.0 };
        wrong += usize::from(!right);
    }
    println!("{D}D, half {half}, perspective {perspective}: {wrong} of {} voxels wrong", grid.len());
    wrong
}

#[test]
fn voxel_centres_on_facets_see_the_surface() {
    for half in [false, true] {
        for perspective in [false, true] {
            assert_eq!(voxels_on_facets::<3>(half, perspective) + voxels_on_facets::<4>(half, perspective), 0);
        }
    }
}
