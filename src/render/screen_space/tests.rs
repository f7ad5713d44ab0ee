//! Against what is known without rays: planes are open, right angles half open; and against rays where those know.

use std::sync::Arc;

use super::*;
use crate::mesh::{MeshBuilder, Orientation, Surface};
use crate::occlusion::Estimator;
use crate::progress::Silent;
use crate::render::{Aov, Projection, Renderer, Shading, View};
use crate::trace::Sampling;
use crate::trace::cpu::CpuBackend;
use crate::volume::Values;

const PERSPECTIVE: Projection = Projection::Perspective { field_of_view: 90.0 };
const PARALLEL: Projection = Projection::Parallel { height: 2.0 };

/// An image of `across` voxels each way, seen by the default camera, of a surface that lies so far before the eye where it is
/// seen at this place of the image, and steps back by so much for each unit to the right and up.
fn image<const D: usize>(
    projection: Projection,
    across: usize,
    settings: ScreenSpace,
    surface: impl Fn(f64, f64) -> [f64; 3],
) -> DepthImage<D> {
    let camera = Camera::<D>::new(&View { projection, ..View::default() }).unwrap();
    let grid = camera.grid([across, across, if D == 4 { across } else { 1 }]);
    let distance = |n: usize| {
        let place = grid.point(grid.index(n));
        let [start, right, up] = surface(place[0], place[1]);
        // What is at `start + right x + up y` before the eye.
        let rise = right * place[0] + up * place[1];
        match projection {
            Projection::Parallel { .. } => (start + rise) as f32,
            Projection::Perspective { .. } => {
                let length = (1.0 + place.iter().take(D - 1).map(|x| x * x).sum::<f64>()).sqrt();
                (length * start / (1.0 - rise)) as f32
            }
        }
    };
    DepthImage::new(&camera, &grid, (0..grid.len()).map(distance).collect(), settings)
}

impl<const D: usize> DepthImage<D> {
    fn occlusion_at(&self, normal: &Vector<D>, index: [usize; 3]) -> Option<f32> {
        self.seen_at(normal, index).map(|seen| seen.open)
    }
}

/// The normal of a surface that steps back by so much for each unit to the right and up.
fn normal<const D: usize>(right: f32, up: f32) -> Vector<D> {
    Vector::from_fn(|r, _| match r {
        0 => right,
        1 => up,
        _ => f32::from(r == D - 1),
    })
}

fn planes<const D: usize>(across: usize) {
    for projection in [PERSPECTIVE, PARALLEL] {
        for thickness in [Thickness::Auto, Thickness::Given(f32::INFINITY), Thickness::Given(0.0)] {
            for [right, up] in [[0.0, 0.0], [0.5, -0.3]] {
                let settings = ScreenSpace { thickness, ..ScreenSpace::default() };
                let image = image::<D>(projection, across, settings, |_, _| [2.0, f64::from(right), f64::from(up)]);
                for index in [[0, 0, 0], [across / 2; 3], [across / 3, across - 1, across / 4]] {
                    let index = if D == 3 { [index[0], index[1], 0] } else { index };
                    let open = image.occlusion_at(&normal(right, up), index).unwrap();
                    assert!((0.9998..=1.0).contains(&open), "{projection:?} {thickness:?} {index:?}: {open}");
                }
            }
        }
    }
}

#[test]
fn a_plane_is_open() {
    planes::<3>(60);
    planes::<4>(24);
}

/// The mean occlusion at the voxels beside the corner between two walls that meet at a right angle, in the middle of the image.
fn corner<const D: usize>(projection: Projection, across: usize, settings: ScreenSpace) -> f32 {
    let image = image::<D>(projection, across, settings, |x, _| [2.0, -x.signum(), 0.0]);
    let middle = across / 2;
    let layers = if D == 4 { middle - 2..middle + 2 } else { 0..1 };
    let mut sum = (0.0, 0.0);
    for (k, j) in layers.flat_map(|k| (middle - 4..middle + 4).map(move |j| (k, j))) {
        for (i, side) in [(middle - 1, 1.0), (middle, -1.0)] {
            let open = image.occlusion_at(&normal(side, 0.0), [i, j, k]).unwrap();
            assert!((0.42..0.58).contains(&open), "{open}");
            sum = (sum.0 + open, sum.1 + 1.0);
        }
    }
    sum.0 / sum.1
}

#[test]
fn a_right_angle_is_half_open() {
    for projection in [PERSPECTIVE, PARALLEL] {
        // What is missing of the walls lies outside of the image: less, the nearer a voxel is to the corner.
        for thickness in [Thickness::Auto, Thickness::Given(f32::INFINITY)] {
            let three = corner::<3>(projection, 400, ScreenSpace { thickness, ..ScreenSpace::default() });
            assert!((three - 0.5).abs() < 0.005, "{projection:?} {thickness:?}: {three}");
        }
        let four = corner::<4>(projection, 100, ScreenSpace::default());
        assert!((four - 0.5).abs() < 0.015, "{projection:?}: {four}");
        // What is further away than the corner's own voxels doesn't count.
        let near = ScreenSpace { max_distance: 1e-3, ..ScreenSpace::default() };
        let image = image::<4>(projection, 20, near, |x, _| [2.0, -x.signum(), 0.0]);
        assert_eq!(image.occlusion_at(&normal(-1.0, 0.0), [10, 10, 10]), Some(1.0));
    }
}

#[test]
fn what_has_no_depth_or_no_normal_is_told() {
    let camera = Camera::<4>::new(&View::default()).unwrap();
    let grid = camera.grid([3, 2, 2]);
    let mut distances = vec![1.5; 12];
    for (n, nothing) in [f32::INFINITY, f32::NAN, 0.0, -1.0, 1e30].into_iter().enumerate() {
        distances[n] = nothing;
    }
    let image = DepthImage::new(&camera, &grid, distances, ScreenSpace::default());
    assert_eq!((0..12).filter(|&n| image.shows(n)).count(), 7);
    let up = normal(0.0, 0.0);
    assert_eq!(image.occlusion_at(&up, [0, 0, 0]), None);
    assert!(image.occlusion_at(&up, [2, 1, 1]).is_some_and(|open| (0.0..=1.0).contains(&open)));
    // A normal of any length, and of either side.
    assert_eq!(image.occlusion_at(&(up * -1e-3), [2, 1, 1]), image.occlusion_at(&up, [2, 1, 1]));
    for bad in [0.0, f32::NAN, f32::INFINITY] {
        assert_eq!(image.occlusion_at(&(up * bad), [2, 1, 1]), None);
    }
    // Nothing at all.
    let empty = DepthImage::new(&camera, &grid, vec![f32::NAN; 12], ScreenSpace::default());
    assert_eq!((empty.thickness(), empty.shows(3)), (0.0, false));
}

/// A box of simplices: the Kuhn triangulation of each face.
fn cuboid<const D: usize>(min: [f64; 4], max: [f64; 4]) -> Surface<D> {
    let spec: crate::scene::ObjectSpec = serde_json::from_value(
        serde_json::json!({ "box": { "min": ends::<D>(min), "max": ends::<D>(max), "subdivisions": 2 } }),
    )
    .unwrap();
    crate::scene::build_object(&spec, "".as_ref()).unwrap()
}

/// The last number is that of the last axis.
fn ends<const D: usize>(numbers: [f64; 4]) -> Vec<f64> {
    (0..D).map(|r| numbers[if r == D - 1 { 3 } else { r }]).collect()
}

/// A box before a wall, seen from in front; its picture by rays, and in screen space by slabs of this thickness.
fn picture<const D: usize>(shading: Shading, across: usize, slab: usize) -> Vec<f32> {
    let mut builder = MeshBuilder::<D>::new();
    for (name, surface) in [
        ("wall", cuboid([-2.0, -2.0, -2.0, -1.4], [2.0, 2.0, 2.0, -1.0])),
        ("box", cuboid([-0.4, -0.4, -0.4, -1.0], [0.4, 0.4, 0.4, -0.6])),
    ] {
        builder.add(name, [1.0; 3], &surface, Orientation::Input).unwrap();
    }
    let backend = Arc::new(CpuBackend::new(crate::accel::Tracer::new(builder.finish())));
    let camera =
        Camera::new(&View { eye: Vector64::from_fn(|r, _| ends::<D>([0.3, 0.2, 0.1, 1.0])[r]), ..View::default() });
    let dimensions = [across, across, if D == 4 { across } else { 1 }];
    let renderer = Renderer::new(backend, camera.unwrap(), dimensions, shading);
    let mut found = Vec::new();
    let sink = |made: crate::render::Slab| {
        let Values::F32(values) = &made.arrays[0].values else { panic!("not f32") };
        found.extend_from_slice(values);
        Ok::<(), Error>(())
    };
    renderer.render(&[Aov::AmbientOcclusion], Some(slab), &Silent, sink).unwrap();
    found
}

fn rays_agree<const D: usize>(across: usize, most: f64) {
    let rays = picture::<D>(Shading::Voxel(Estimator::Sampled(Sampling::new(128, 1))), across, across);
    let settings = ScreenSpace { thickness: Thickness::Given(0.4), ..ScreenSpace::default() };
    let space = picture::<D>(Shading::ScreenSpace(settings), across, across);
    let squares: f64 = rays.iter().zip(&space).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    let rms = (squares / rays.len() as f64).sqrt();
    let darkest = space.iter().copied().fold(1.0, f32::min);
    println!("{D}D: {rms}, {darkest}");
    assert!(rms < most && darkest < 0.75, "{D}D: {rms}, {darkest}");
    for slab in [1, 3] {
        assert_eq!(picture::<D>(Shading::ScreenSpace(settings), across, slab), space, "slabs of {slab}");
    }
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(one.install(|| picture::<D>(Shading::ScreenSpace(settings), across, across)), space, "one thread");
}

#[test]
fn screen_space_sees_what_rays_see_in_any_slabs_on_any_threads() {
    rays_agree::<3>(40, 0.02);
    rays_agree::<4>(16, 0.02);
}
