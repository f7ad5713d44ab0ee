//! Occlusion only where a mask asks for it: the same bits there, and the same pictures as with all values.

use std::path::Path;

use ao4d::accel::Tracer;
use ao4d::geometry::Vector;
use ao4d::inspect::compare;
use ao4d::inspect::compare::Tolerance;
use ao4d::mesh::Mesh;
use ao4d::occlusion::exact::Budget;
use ao4d::occlusion::{Deviations, Estimator};
use ao4d::pipeline::{self, Pipeline, Report};
use ao4d::progress::Silent;
use ao4d::trace::cpu::CpuBackend;
use ao4d::trace::{Sampling, ShadingPoint, Target};

use crate::support::{Random, mesh};

fn same_bits<const D: usize>() {
    let mesh: Mesh<D> = mesh(&Random(2).soup(40, 0.6, false));
    let mut points = ShadingPoint::vertices(&mesh);
    for simplex in 0..mesh.simplices.len() as u32 {
        let position = mesh.corners(simplex).into_iter().sum::<Vector<D>>() / D as f32;
        let normal = mesh.normals[mesh.simplices[simplex as usize][0] as usize];
        points.push(ShadingPoint::Inside { position, normal, simplex, number: u64::from(simplex) });
    }
    let backend = CpuBackend::new(Tracer::new(mesh));
    let sobol = Sampling::new(96, 3);
    let target = Some(Target { error: 0.05 });
    let estimators = [
        Estimator::Sampled(sobol),
        Estimator::Sampled(Sampling { target, ..Sampling::random(96, 3) }),
        Estimator::Adaptive(Sampling { target, ..sobol }),
        Estimator::Exact(Budget::default()),
        Estimator::AsPublished(sobol, Deviations::PUBLISHED),
    ];
    let mask: Vec<bool> = (0..points.len()).map(|v| v % 3 == 1).collect();
    for estimator in estimators {
        let all = estimator.estimate(&backend, &points, None, &Silent).unwrap();
        let some = estimator.estimate(&backend, &points, Some(&mask), &Silent).unwrap();
        assert!(all.values.iter().any(|&v| v < 1.0), "{estimator:?}");
        for (v, &asked) in mask.iter().enumerate() {
            let expected = if asked { (all.values[v], all.errors[v]) } else { (1.0, f32::NAN) };
            assert_eq!(
                (some.values[v].to_bits(), some.errors[v].to_bits()),
                (expected.0.to_bits(), expected.1.to_bits())
            );
        }
        assert!(some.rays < all.rays || all.rays == 0, "{estimator:?}: {} of {} rays", some.rays, all.rays);
        assert!(some.error().is_finite());
        // Points in another order have the same values.
        let back: Vec<_> = points.iter().rev().copied().collect();
        let mut backwards = estimator.estimate(&backend, &back, None, &Silent).unwrap();
        backwards.values.reverse();
        backwards.errors.reverse();
        assert_eq!(backwards, all, "{estimator:?}");
    }
    let none = Estimator::Sampled(sobol).estimate(&backend, &points, Some(&vec![false; points.len()]), &Silent);
    assert_eq!(none.unwrap().rays, 0);
}

#[test]
fn masked_values_are_those_of_all() {
    same_bits::<3>();
    same_bits::<4>();
}

/// A ball before another that it hides in part, seen by two cameras, with what is said about the occlusion.
fn balls(folder: &Path, occlusion: &str, more: &str) -> Report {
    let text = format!(
        "name: balls
stages:
  - scene:
      objects:
        - hypersphere: {{radius: 0.5, subdivisions: 5}}
        - hypersphere: {{radius: 0.5, subdivisions: 5, center: [0.3, 0.1, 0, -1.1]}}
  - occlusion: {{id: ao, samples: 64{occlusion}}}
  - render: {{id: a, camera: {{eye: [0, 0, 0, 2], field_of_view: 45}}, dimensions: [20, 22, 18], supersample: 1}}
  - write: {{vti: a.vti, raw: a.raw{more}}}
  - render: {{id: b, camera: {{eye: [1.5, 0, 0, 2], projection: parallel, height: 1.5}}, dimensions: [9, 8, 7], shading: flat}}
  - write: {{raw: b.raw}}
"
    );
    let path = folder.join("p.yaml");
    std::fs::write(&path, text).unwrap();
    let pipeline = Pipeline::load(&path, &[], Some(folder.join("out"))).unwrap();
    pipeline::run(&pipeline, &pipeline::Settings::default(), &Silent).unwrap()
}

/// The number at the start of the occlusion stage's detail.
fn rays(report: &Report) -> u64 {
    let stage = report.stages.iter().find(|s| s.stage == "occlusion ao").unwrap();
    stage.detail.split(" rays").next().unwrap().replace(',', "").parse().unwrap()
}

#[test]
fn pictures_need_only_what_they_show() {
    let folders: Vec<_> = (0..3).map(|_| tempfile::tempdir().unwrap()).collect();
    let some = balls(folders[0].path(), "", "");
    let all = balls(folders[1].path(), ", file: ao.f32", "");
    let mesh = balls(folders[2].path(), "", ", vtu: a.vtu");
    let vertices = 2 * (8 * 125 + 16 * 5) / 3;
    assert_eq!((rays(&all), rays(&mesh)), (64 * vertices, 64 * vertices));
    assert!(rays(&some) > 0 && rays(&some) < 48 * vertices, "{} of {}", rays(&some), 64 * vertices);
    let read = |k: usize, file: &str| std::fs::read(folders[k].path().join("out").join(file)).unwrap();
    for file in ["a.raw", "b.raw"] {
        assert!(read(0, file) == read(1, file) && read(0, file) == read(2, file), "{file}");
    }
    // Beside the pipeline that they tell, which is another.
    let image = |k: usize| folders[k].path().join("out/a.vti");
    for other in [1, 2] {
        assert!(compare(&image(0), &image(other), &Tolerance::default()).unwrap().same, "{other}");
    }
    // Of one picture that has to be made again, only what that shows.
    std::fs::remove_file(folders[0].path().join("out/b.raw")).unwrap();
    let again = balls(folders[0].path(), "", "");
    assert!(rays(&again) > 0 && rays(&again) < rays(&some));
    assert_eq!(read(0, "b.raw"), read(1, "b.raw"));
}

/// What is behind the first surface is shaded too, be it seen through the first or kept in layers.
#[test]
fn pictures_of_what_is_behind_need_more() {
    let run = |keys: [&str; 3], occlusion: &str| {
        let folder = tempfile::tempdir().unwrap();
        let [opacity, layers, arrays] = keys;
        let text = format!(
            "name: behind
stages:
  - scene:
      objects:
        - {{hypersphere: {{radius: 0.5, subdivisions: 4}}{opacity}}}
        - hypersphere: {{radius: 0.5, subdivisions: 4, center: [0.3, 0.1, 0, -1.1]}}
  - occlusion: {{id: ao, samples: 16{occlusion}}}
  - render: {{camera: {{eye: [0, 0, 0, 2], field_of_view: 45}}, dimensions: [9, 8, 7], shading: smooth{layers}}}
  - write: {{vti: a.vti, arrays: [rgba, opacity{arrays}]}}
"
        );
        let path = folder.path().join("p.yaml");
        std::fs::write(&path, text).unwrap();
        let pipeline = Pipeline::load(&path, &[], Some(folder.path().join("out"))).unwrap();
        pipeline::run(&pipeline, &pipeline::Settings::default(), &Silent).unwrap();
        folder
    };
    for keys in [[", opacity: 0.3", "", ""], ["", ", layers: 4", ", layer_ambient_occlusion, layers"]] {
        let [some, all] = ["", ", file: ao.f32"].map(|occlusion| run(keys, occlusion));
        let [some, all] = [&some, &all].map(|folder| folder.path().join("out/a.vti"));
        assert!(compare(&some, &all, &Tolerance::default()).unwrap().same, "{keys:?}");
    }
}
