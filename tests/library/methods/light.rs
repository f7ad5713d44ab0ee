//! Light from the sky and from other surfaces: open directions by rays and in closed form, linear skies, one bounce.

use std::sync::Arc;

use ao4d::accel::Tracer;
use ao4d::geometry::{Vector, Vector64, normal_of, widen};
use ao4d::mesh::{Crease, Mesh, MeshBuilder, Orientation, Surface};
use ao4d::occlusion::exact::Budget;
use ao4d::occlusion::{Directional, Estimator, open_vector};
use ao4d::progress::Silent;
use ao4d::render::filters::{Dilate, denoise};
use ao4d::render::tone::to_linear;
use ao4d::render::{Aov, Camera, Lighting, Shading, Skylight, View, radiosity, relight};
use ao4d::scene::{BoxSpec, OneOrEach};
use ao4d::session::Session;
use ao4d::trace::cpu::CpuBackend;
use ao4d::trace::{RayBackend, Sampler, Sampling, Sequence, ShadingPoint, Surroundings};
use ao4d::volume::{Array, Values, Volume};

use super::scenes::{mesh, soup};

in_3d_and_4d! {
    vectors_by_rays_and_in_closed_form a_linear_sky_is_lit_exactly surfaces_of_one_radiosity an_endless_fold
    errors_of_the_bounce_are_calibrated pictures_under_a_sky
}

const EXACT: Estimator = Estimator::Exact(Budget { cones: 10_000_000 });

fn backend<const D: usize>(mesh: Mesh<D>) -> CpuBackend<D> {
    CpuBackend::new(Tracer::new(mesh))
}

/// All vertices, and a point inside each of some simplices.
fn points<const D: usize>(mesh: &Mesh<D>) -> Vec<ShadingPoint<D>> {
    let inside = |s: usize| {
        let corners = mesh.corners(s as u32);
        let position = corners.iter().sum::<Vector<D>>() / D as f32;
        let normal = normal_of(&corners.map(|v| widen(&v))).normalize().map(|x| x as f32);
        ShadingPoint::Inside { position, normal, simplex: s as u32, number: 1000 + s as u64 }
    };
    let mut points = ShadingPoint::vertices(mesh);
    points.extend((0..mesh.simplices.len()).step_by(3).map(inside));
    points
}

fn directional<const D: usize>(
    estimator: Estimator,
    backend: &CpuBackend<D>,
    points: &[ShadingPoint<D>],
    radiosity: Option<&[[f32; 3]]>,
) -> Directional<D> {
    estimator.directional(backend, points, radiosity, &Silent).unwrap()
}

fn vectors_by_rays_and_in_closed_form<const D: usize>() {
    for (count, size) in [(12, 0.8), (24, 0.5)] {
        let backend = backend(mesh(&[soup::<D>(7, count, size)]));
        let points = points(backend.tracer().mesh());
        let exact = directional(EXACT, &backend, &points, None);
        let mut squares = 0.0;
        for sampler in [Sampler::Sobol, Sampler::Random] {
            let sampling = Sampling { sampler, ..Sampling::new(1024, 3) };
            let sampled = directional(Estimator::Sampled(sampling), &backend, &points, None);
            // A is the same with directions and without.
            let alone = Estimator::Sampled(sampling).estimate(&backend, &points, None, &Silent).unwrap();
            assert_eq!(sampled.estimates, alone);
            for (i, (a, b)) in sampled.vectors.iter().zip(&exact.vectors).enumerate() {
                let off = f64::from((a - b).norm());
                squares += if sampler == Sampler::Sobol { off * off } else { 0.0 };
                assert!(off < 4.0 / 32.0, "{sampler:?} {i}: {a} {b}");
            }
        }
        let rms = (squares / points.len() as f64).sqrt();
        println!("{D}D, {count} simplices: b by 1,024 rays is {rms:.1e} off");
        assert!(rms < 8e-3, "{rms}");
        // The estimator that chooses between the two is one of them at each point.
        let adaptive = directional(Estimator::Adaptive(Sampling::new(16, 3)), &backend, &points, None);
        let closed = (0..points.len()).filter(|&i| adaptive.estimates.errors[i] == 0.0);
        assert!(closed.clone().count() > 0);
        closed.for_each(|i| assert_eq!(adaptive.vectors[i], exact.vectors[i]));
    }
}

/// Rays that each bring the light of where they go.
fn a_linear_sky_is_lit_exactly<const D: usize>() {
    let backend = backend(mesh(&[soup::<D>(3, 12, 0.7)]));
    let points = points(backend.tracer().mesh());
    let gradient = Vector64::<D>::from_fn(|r, _| [0.5, -0.6, 0.3, 0.4][r]);
    let sampling = Sampling::new(1 << 10, 9);
    let found = directional(EXACT, &backend, &points, None);
    let by_rays = directional(Estimator::Sampled(sampling), &backend, &points, None);
    let (mut squares, mut alone) = (0.0, 0.0);
    for (i, point) in points.iter().enumerate() {
        let around = Surroundings::of(backend.tracer(), point);
        let mut sequence = Sequence::new(sampling.sampler, sampling.seed, point.number());
        let mut light = 0.0;
        for _ in 0..sampling.samples {
            let direction = sequence.next_direction(&around.frame());
            if around.is_visible(backend.tracer(), direction, f32::INFINITY) {
                light += 1.0 + gradient.dot(&widen(&direction));
            }
        }
        light /= f64::from(sampling.samples);
        let lit =
            |found: &Directional<D>| f64::from(found.estimates.values[i]) + gradient.dot(&widen(&found.vectors[i]));
        // By the same rays the two are the same sum; those of a closed form are what rays come near to.
        assert!((lit(&by_rays) - light).abs() < 1e-6);
        squares += (lit(&found) - light).powi(2);
        alone += (f64::from(found.estimates.values[i]) - light).powi(2);
    }
    let [squares, alone] = [squares, alone].map(|s| (s / points.len() as f64).sqrt());
    println!("{D}D: A + g . b is {squares:.1e} off the rays' light, A alone {alone:.1e}");
    assert!(squares < 8e-3 && alone > 0.05, "{squares} {alone}");
}

/// If all that is hit sends the same light, the bounce is that times what is hidden, be the rays few or many.
fn surfaces_of_one_radiosity<const D: usize>() {
    let backend = backend(mesh(&[soup::<D>(5, 16, if D == 4 { 1.2 } else { 0.6 })]));
    let points = points(backend.tracer().mesh());
    let sent = vec![[0.25f32, 0.5, 1.0]; backend.tracer().mesh().vertices.len()];
    for estimator in [EXACT, Estimator::Sampled(Sampling::new(64, 1)), Estimator::Adaptive(Sampling::new(64, 1))] {
        let found = directional(estimator, &backend, &points, Some(&sent));
        let without = directional(estimator, &backend, &points, None);
        assert_eq!((&found.estimates.values, &found.vectors), (&without.estimates.values, &without.vectors));
        let bounced = found.bounced.unwrap();
        assert!(without.bounced.is_none() && bounced.hits > 0 && bounced.behind > 0 && bounced.behind < bounced.hits);
        let mut dark = 0;
        for (i, light) in bounced.light.iter().enumerate() {
            let hidden = 1.0 - found.estimates.values[i];
            // A body seen by no ray sends none, even if the closed form knows of it.
            if light[2] == 0.0 {
                assert!(hidden < 0.1, "{hidden}");
                continue;
            }
            dark += 1;
            for (c, share) in [0.25, 0.5, 1.0].into_iter().enumerate() {
                assert!((light[c] - share * hidden).abs() < 1e-6, "{i}: {light:?} {hidden}");
            }
        }
        assert!(dark > points.len() / 2);
        // Alone it is the same.
        let alone = estimator.bounced(backend.tracer(), &points, &found.estimates, &sent, &Silent).unwrap();
        assert_eq!(alone, bounced);
    }
    // A convex body alone sees nothing of itself.
    let ball = CpuBackend::new(Tracer::new(boxes::<D>(&[([0.9; 3], [-1.0; 4], [1.0; 4])])));
    let vertices = ShadingPoint::vertices(ball.tracer().mesh());
    let sent = vec![[1.0; 3]; vertices.len()];
    let found = directional(Estimator::Sampled(Sampling::new(256, 1)), &ball, &vertices, Some(&sent));
    assert!(found.bounced.unwrap().light.iter().all(|light| *light == [0.0; 3]));
}

/// A sheet over some axes, of a colour, whose normal points to `up`: from 0 to `size` along the first of the axes, from -size
/// to size along the others, with a vertex in the middle.
fn sheet<const D: usize>(builder: &mut MeshBuilder<D>, axes: &[usize], up: usize, size: f64, color: [f32; 3]) {
    let mut orders = vec![vec![]];
    for &axis in axes {
        let inserted = |o: &Vec<usize>| -> Vec<Vec<usize>> {
            (0..=o.len()).map(|i| [&o[..i], &[axis], &o[i..]].concat()).collect()
        };
        orders = orders.iter().flat_map(inserted).collect();
    }
    let mut surface = Surface { vertices: Vec::new(), simplices: Vec::new(), normals: None };
    for signs in 0..1usize << (D - 2) {
        for order in &orders {
            let mut corners = [Vector64::<D>::zeros(); D];
            for (i, &axis) in order.iter().enumerate() {
                let place = axes.iter().position(|&a| a == axis).unwrap();
                let sign = if place > 0 && signs >> (place - 1) & 1 == 1 { -1.0 } else { 1.0 };
                corners[i + 1] = corners[i];
                corners[i + 1][axis] = sign * size;
            }
            if normal_of(&corners)[up] < 0.0 {
                corners.swap(0, 1);
            }
            let first = surface.vertices.len() as u32;
            surface.vertices.extend(corners);
            surface.simplices.push(std::array::from_fn(|i| first + i as u32));
        }
    }
    builder.add("sheet", color, &surface, Orientation::Input).unwrap();
}

/// Two half-hyperplanes at a right angle: each point sees half of its hemisphere hidden by the other one, whose points do
/// so too. With the reflectance r of that other wall the bounce is 1/2 * r * 1/2.
fn an_endless_fold<const D: usize>() {
    let mut builder = MeshBuilder::<D>::new();
    let others: Vec<usize> = (1..D - 1).collect();
    let [floor, wall] = [0, D - 1].map(|first| [&[first], others.as_slice()].concat());
    sheet(&mut builder, &floor, D - 1, 1000.0, [0.0, 1.0, 0.0]);
    sheet(&mut builder, &wall, 0, 1000.0, [1.0, 0.5, 0.0]);
    let session = Session::new(builder.finish());
    let estimator = Estimator::Sampled(Sampling::new(256, 1));
    let found = session.directional(estimator, &Silent).unwrap();
    let (sent, _) = session.bounced(estimator, &found, &Vector64::zeros(), &Silent).unwrap();
    // A point of the floor, close to the wall. It is near the middle of the sheets, on the floor's side of the wall.
    let mesh = session.mesh();
    let position = Vector::<D>::from_fn(|r, _| [0.05, 0.02, 0.01][r.min(2)] * f32::from(u8::from(r < D - 1)));
    let normal = Vector::<D>::from_fn(|r, _| f32::from(u8::from(r == D - 1)));
    let simplex = (0..mesh.simplices.len() as u32).find(|&s| mesh.object_of(s) == 0).unwrap();
    let point = ShadingPoint::Inside { position, normal, simplex, number: 5 };
    let rays = Estimator::Sampled(Sampling::new(1 << 12, 2));
    let lit = rays.directional(&**session.backend(), &[point], Some(&sent), &Silent).unwrap();
    let (bounced, open) = (lit.bounced.unwrap(), f64::from(lit.estimates.values[0]));
    let reflectance = to_linear(0.5);
    println!("{D}D fold: A {open}, bounce {:?} +- {}", bounced.light[0], bounced.errors[0]);
    assert!((open - 0.5).abs() < 2e-3, "{open}");
    for (c, expected) in [0.25, reflectance / 4.0, 0.0].into_iter().enumerate() {
        assert!((f64::from(bounced.light[0][c]) - expected).abs() < 6e-3, "{c}: {:?} {expected}", bounced.light[0]);
    }
    assert_eq!(bounced.behind, 0);
    // Under a sky that is brighter along the wall's normal the wall sends more: half of b along that normal is open.
    let gradient = Vector64::<D>::from_fn(|r, _| if r == 0 { 0.8 } else { 0.0 });
    let brighter = radiosity(mesh, &found, &gradient);
    let in_the_middle = mesh.objects[1].vertices.clone().filter(|&v| mesh.vertices[v].amax() == 0.0);
    assert!(in_the_middle.clone().count() > 0);
    for v in in_the_middle {
        let expected = 0.5 + 0.8 * open_vector(&(gradient / 0.8)).norm() / 2.0;
        assert!((f64::from(brighter[v][0]) - expected).abs() < 2e-2, "{} {expected}", brighter[v][0]);
    }
}

/// Of all bounces at least 85 % lie within two standard errors, whatever the sampler; and errors are as large as said where an
/// eighth of the rays or more hits something. Where hardly one does, more is said: what one ray more could bring.
fn errors_of_the_bounce_are_calibrated<const D: usize>() {
    let backend = backend(mesh(&[if D == 4 { soup::<D>(11, 60, 1.2) } else { soup(11, 20, 0.6) }]));
    let points = points(backend.tracer().mesh());
    let sent: Vec<[f32; 3]> = (0..backend.tracer().mesh().vertices.len())
        .map(|v| [(v * 7 % 11) as f32 / 10.0, (v * 5 % 7) as f32 / 6.0, 0.5])
        .collect();
    let light =
        |sampling: Sampling| directional(Estimator::Sampled(sampling), &backend, &points, Some(&sent)).bounced.unwrap();
    let truth = directional(Estimator::Sampled(Sampling::new(1 << 12, 99)), &backend, &points, Some(&sent));
    let (open, truth) = (truth.estimates.values, truth.bounced.unwrap());
    assert!(open.iter().filter(|&&open| open < 0.875).count() > points.len() / 4, "enough is hidden");
    for sampler in [Sampler::Sobol, Sampler::Random] {
        for samples in [16, 60] {
            let (mut within, mut count, mut said, mut real) = (0, 0, 0.0, 0.0);
            for seed in 0..4 {
                let found = light(Sampling { sampler, ..Sampling::new(samples, seed) });
                for (i, (found_light, &error)) in found.light.iter().zip(&found.errors).enumerate() {
                    if truth.light[i][0] == 0.0 {
                        continue;
                    }
                    let off = (0..3).map(|c| (found_light[c] - truth.light[i][c]).abs()).fold(0.0, f32::max);
                    within += usize::from(off <= 2.0 * error);
                    count += 1;
                    if open[i] < 0.875 {
                        (said, real) = (said + f64::from(error).powi(2), real + f64::from(off).powi(2));
                    }
                }
            }
            let (share, ratio) = (within as f64 / count as f64, (said / real).sqrt());
            println!("{D}D {sampler:?} {samples}: {share:.3} within two errors, said / real {ratio:.2}");
            assert!(share > 0.85 && (0.7..1.8).contains(&ratio), "{sampler:?} {samples}: {share} {ratio}");
        }
    }
}

/// Boxes of colours, by their lowest and highest corner in 4D.
fn boxes<const D: usize>(all: &[([f32; 3], [f64; 4], [f64; 4])]) -> Mesh<D> {
    let mut builder = MeshBuilder::<D>::new();
    // The last axis, which the eye looks along, is the last in 3D too.
    let corner = |of: &[f64; 4]| (0..D).map(|r| of[if r == D - 1 { 3 } else { r }]).collect();
    for (color, min, max) in all {
        let spec = BoxSpec { min: corner(min), max: corner(max), subdivisions: OneOrEach::One(2) };
        builder.add_creased("box", *color, &spec.build().unwrap(), Orientation::Input, Crease::Above(30.0)).unwrap();
    }
    builder.finish()
}

/// A floor below, a wall on the left, a white box between them.
fn room<const D: usize>() -> Mesh<D> {
    boxes(&[
        ([0.9, 0.9, 0.9], [-1.6, -1.4, -1.2, -1.2], [1.6, -1.0, 1.2, 1.2]),
        ([0.9, 0.1, 0.1], [-1.2, -1.0, -1.0, -1.0], [-1.0, 0.8, 1.0, 1.0]),
        ([0.9, 0.9, 0.9], [-0.6, -1.0, -0.4, -0.4], [0.2, 0.0, 0.4, 0.4]),
    ])
}

/// The arrays of a picture fit together, whatever the shading: irradiance is A + g . b and the bounce, light is that times
/// the reflectance and the ambient light; relighting gives the irradiance again; and no number depends on slabs.
fn pictures_under_a_sky<const D: usize>() {
    let session = Session::new(room::<D>());
    let gradient = Vector64::<D>::from_fn(|r, _| [-0.3, 0.7, 0.2, 0.4][if r == D - 1 { 3 } else { r }]);
    let few = Estimator::Sampled(Sampling::new(16, 2));
    let found = Arc::new(session.directional(EXACT, &Silent).unwrap());
    let (sent, bounced) = session.bounced(EXACT, &found, &gradient, &Silent).unwrap();
    let (sent, bounced) = (Arc::new(sent), Arc::new(bounced));
    let values = Arc::new(found.estimates.clone());
    let camera = Camera::new(&View { eye: View::<D>::default().eye * 2.5, ..View::default() }).unwrap();
    let dimensions = if D == 4 { [9, 9, 9] } else { [24, 24, 1] };
    let sampling = Sampling::new(16, 2);
    let aovs = [
        Aov::AmbientOcclusion,
        Aov::BentNormal,
        Aov::Irradiance,
        Aov::Bounce,
        Aov::BounceError,
        Aov::Light,
        Aov::Object,
        Aov::Coverage,
    ];
    for (name, shading) in [
        ("none", Shading::None),
        ("smooth", Shading::Smooth(Arc::clone(&values))),
        ("flat", Shading::Flat(Arc::clone(&values))),
        ("voxel, exact", Shading::Voxel(EXACT)),
        ("voxel, denoised", Shading::Voxel(few)),
        ("auto", Shading::Auto(Arc::clone(&values), few)),
    ] {
        let is_denoised = matches!(name, "auto" | "voxel, denoised");
        let renderer = |lit: bool| {
            let mut renderer = session.renderer(camera.clone(), dimensions, shading.clone());
            let mut skylight = Skylight::new(gradient);
            if !matches!(shading, Shading::None) {
                skylight.radiosity = Some(Arc::clone(&sent));
                skylight.directions = Some(Arc::clone(&found));
                skylight.bounced = Some(Arc::clone(&bounced));
            }
            renderer.skylight = Some(Arc::new(skylight));
            renderer.lighting = lit.then(|| Lighting::new(vec![], 0.7));
            if is_denoised {
                renderer.filters.extend(denoise(&renderer.camera, &renderer.grid, sampling));
            }
            renderer.filters.push(Box::new(Dilate { layers: 1 }));
            renderer
        };
        let picture = renderer(true).volume(&aovs, &Silent).unwrap();
        let array = |aov: Aov| picture.array(aov.name()).unwrap().values.to_f64();
        let (open, vector, irradiance) = (array(Aov::AmbientOcclusion), array(Aov::BentNormal), array(Aov::Irradiance));
        let (bounce, error, light) = (array(Aov::Bounce), array(Aov::BounceError), array(Aov::Light));
        let (object, coverage) = (array(Aov::Object), array(Aov::Coverage));
        let again =
            relight::<D>(&single(&picture, Aov::AmbientOcclusion), &single(&picture, Aov::BentNormal), &gradient);
        let (mut lit_by_others, mut seen, mut reddest) = (0, 0, 0.0f64);
        for i in 0..open.len() {
            let b = Vector64::<D>::from_fn(|r, _| vector[D * i + r]);
            let sky = open[i] + gradient.dot(&b);
            assert!((sky - f64::from(again[i])).abs() < 1e-6 && sky >= -1e-6, "{D}D, {name}: {sky}");
            for c in 0..3 {
                let sum = sky + bounce[3 * i + c];
                assert!((irradiance[3 * i + c] - sum).abs() < 2e-6, "{D}D, {name}: {} {sum}", irradiance[3 * i + c]);
            }
            if coverage[i] == 0.0 {
                continue;
            }
            seen += 1;
            let color = session.mesh().objects[object[i] as usize - 1].color;
            for c in 0..3 {
                let expected = 0.7 * to_linear(f64::from(color[c])) * irradiance[3 * i + c];
                assert!((light[3 * i + c] - expected).abs() < 2e-6, "{D}D, {name}");
            }
            lit_by_others += usize::from(bounce[3 * i] > 0.0 && error[i] > 0.0);
            reddest = reddest.max(bounce[3 * i] - bounce[3 * i + 1]);
        }
        let nothing = matches!(shading, Shading::None);
        assert!(seen > 40 && (nothing || lit_by_others * 3 > seen), "{D}D, {name}: {lit_by_others} of {seen}");
        assert!(nothing || reddest > 0.05, "{D}D, {name}: the wall is red, what it lights by {reddest}");
        // Layer by layer it is the same, and a picture that isn't lit shows colour times occlusion as ever.
        let mut slabs: Vec<Array> = Vec::new();
        renderer(true)
            .render(&aovs, Some(1), &Silent, |slab| {
                if slabs.is_empty() {
                    slabs = slab.arrays;
                } else {
                    slabs.iter_mut().zip(slab.arrays).for_each(|(all, more)| extend(all, more));
                }
                Ok::<(), ao4d::occlusion::Error>(())
            })
            .unwrap();
        assert!(slabs == picture.arrays, "{D}D, {name}: slabs change numbers");
        let plain = renderer(false).volume(&[Aov::Rgb, Aov::Irradiance], &Silent).unwrap();
        let mut without = renderer(false);
        without.skylight = None;
        let without = without.volume(&[Aov::Rgb, Aov::Irradiance, Aov::AmbientOcclusion], &Silent).unwrap();
        assert_eq!(plain.arrays[0], without.arrays[0]);
        let flat = without.arrays[1].values.to_f64();
        assert!(flat.chunks(3).zip(without.arrays[2].values.to_f64()).all(|(e, a)| e.iter().all(|&e| e == a)));
    }
}

/// The numbers of an array as they are.
fn single(picture: &Volume, aov: Aov) -> Vec<f32> {
    match &picture.array(aov.name()).unwrap().values {
        Values::F32(values) => values.clone(),
        other => panic!("{} has numbers of type {:?}", aov.name(), other.kind()),
    }
}

/// Puts the numbers of the next layers behind those of an array.
fn extend(all: &mut Array, more: Array) {
    match (&mut all.values, more.values) {
        (Values::F32(all), Values::F32(more)) => all.extend(more),
        (Values::U16(all), Values::U16(more)) => all.extend(more),
        (all, more) => panic!("{:?} {:?}", all.kind(), more.kind()),
    }
}
