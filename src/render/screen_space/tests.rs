//! Against what is known without rays: planes are open, right angles half open; and against rays where those know.

use std::sync::Arc;

use super::*;
use crate::geometry::Vector64;
use crate::mesh::{MeshBuilder, Orientation, Surface};
use crate::occlusion::Error;
use crate::occlusion::Estimator;
use crate::progress::Silent;
use crate::render::{Aov, Projection, Renderer, Shading, Skylight, View, radiosity};
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

/// What the image says of the middle of a plane, and beside a corner whose walls send light of 0.5.
fn directions<const D: usize>(across: usize) {
    let close = |a: &Vector<D>, b: &Vector<D>, most: f32| assert!((a - b).norm() < most, "{D}D: {a} for {b}");
    let open = |normal: &Vector<D>| narrow(&open_vector(&widen(normal)));
    let layer = |k: usize| if D == 4 { k } else { 0 };
    for projection in [PERSPECTIVE, PARALLEL] {
        let plane = image::<D>(projection, across, ScreenSpace::default(), |_, _| [2.0, 0.5, -0.3]).directed();
        let leaning = normal::<D>(0.5, -0.3);
        let seen = plane.seen_at(&leaning, [across / 3, across / 2, layer(across / 4)]).unwrap();
        close(&seen.vector, &open(&leaning.normalize()), 0.03);
        assert_eq!(seen.bounced, [0.0; 3]);
        let settings = ScreenSpace { thickness: Thickness::Given(f32::INFINITY), ..ScreenSpace::default() };
        let corner = image::<D>(projection, across, settings, |x, _| [2.0, -x.signum(), 0.0]).directed();
        let voxels = corner.ahead.len();
        let corner = corner.lit(
            (0..voxels)
                .map(|n| ([0.5, 0.25, 0.0], normal(if 2 * (n % across) < across { 1.0 } else { -1.0 }, 0.0)))
                .collect(),
        );
        let (middle, mut sum, mut light) = (across / 2, Vector::<D>::zeros(), 0.0);
        let places = (0..16).map(|n| [middle, middle - 2 + n % 4, layer(middle - 2 + n / 4)]);
        for index in places {
            let seen = corner.seen_at(&normal(-1.0, 0.0), index).unwrap();
            sum += seen.vector / 16.0;
            light += seen.bounced[0] / 16.0;
            // All that is hidden is hidden by what sends this light.
            assert!((seen.bounced[0] - 0.5 * (1.0 - seen.open)).abs() < 1e-5 && seen.bounced[2] == 0.0);
            assert!((seen.bounced[1] - 0.5 * seen.bounced[0]).abs() < 1e-6);
        }
        assert!((light - 0.25).abs() < 0.02, "{light}");
        // Half of b along the own normal, and as much along the other wall's as a half-space of the directions has:
        // c_D times the integral of x z over a quarter of the ball.
        let (own, other) = (normal::<D>(-1.0, 0.0).normalize(), normal::<D>(1.0, 0.0).normalize());
        let along = if D == 3 { 2.0 / (3.0 * std::f32::consts::PI) } else { 3.0 / 16.0 };
        close(&sum, &(open(&own) * 0.5 + other * along), 0.03);
    }
}

#[test]
fn open_directions_and_light_of_planes_and_right_angles() {
    directions::<3>(200);
    directions::<4>(60);
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
    arrays::<D>(shading, across, slab, &[Aov::AmbientOcclusion]).remove(0)
}

/// The same, under a sky, with these arrays.
fn arrays<const D: usize>(shading: Shading, across: usize, slab: usize, aovs: &[Aov]) -> Vec<Vec<f32>> {
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
    let mut renderer = Renderer::new(backend, camera.unwrap(), dimensions, shading);
    let gradient = Vector64::from_fn(|r, _| [0.3, 0.5, 0.0, 0.2][if r == D - 1 { 3 } else { r }]);
    let mut skylight = Skylight::new(gradient);
    match renderer.shading {
        Shading::Voxel(estimator) => {
            let points = crate::trace::ShadingPoint::vertices(renderer.tracer().mesh());
            let found = estimator.directional(&*renderer.backend, &points, None, &Silent).unwrap();
            skylight.radiosity = Some(Arc::new(radiosity(renderer.tracer().mesh(), &found, &gradient)));
        }
        _ => skylight.in_image = Some(true),
    }
    renderer.skylight = Some(Arc::new(skylight));
    let mut found = vec![Vec::new(); aovs.len()];
    let sink = |made: crate::render::Slab| {
        for (found, array) in found.iter_mut().zip(&made.arrays) {
            let Values::F32(values) = &array.values else { panic!("not f32") };
            found.extend_from_slice(values);
        }
        Ok::<(), Error>(())
    };
    renderer.render(aovs, Some(slab), &Silent, sink).unwrap();
    found
}

/// Where the sky is open and what light comes from other surfaces, against rays: the root mean square of what each is off, and
/// of what each is. All light here comes from the box's sides, of which the image shows little.
fn rays_agree_on_light<const D: usize>(across: usize, most: [f64; 2]) {
    let aovs = [Aov::BentNormal, Aov::Bounce, Aov::Irradiance];
    let rays = arrays::<D>(Shading::Voxel(Estimator::Sampled(Sampling::new(128, 1))), across, across, &aovs);
    let settings = ScreenSpace { thickness: Thickness::Given(0.4), ..ScreenSpace::default() };
    let space = arrays::<D>(Shading::ScreenSpace(settings), across, across, &aovs);
    let rms = |values: &mut dyn Iterator<Item = f32>, count: usize| {
        (values.map(|x| f64::from(x).powi(2)).sum::<f64>() / count as f64).sqrt()
    };
    for (a, (name, most)) in ["b", "bounce"].into_iter().zip(most).enumerate() {
        let off = rms(&mut rays[a].iter().zip(&space[a]).map(|(a, b)| a - b), rays[a].len());
        let size = rms(&mut rays[a].iter().copied(), rays[a].len());
        println!("{D}D, {name}: {off} of {size}");
        assert!(off < most && off < 0.7 * size, "{D}D, {name}: {off} of {size}");
    }
    assert_eq!(arrays::<D>(Shading::ScreenSpace(settings), across, 3, &aovs), space, "slabs");
}

#[test]
fn screen_space_sees_the_light_that_rays_see() {
    rays_agree_on_light::<3>(40, [0.01, 0.025]);
    rays_agree_on_light::<4>(16, [0.02, 0.025]);
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
