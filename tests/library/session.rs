//! A scene in memory gives the values and the picture that the same scene gives through files; and the example works.

use std::sync::Arc;

use ao4d::io::vtk;
use ao4d::pipeline::{Pipeline, Settings, run};
use ao4d::progress::Silent;
use ao4d::render::{Aov, Shading};
use ao4d::session::Session;
use ao4d::stages::camera::camera;
use ao4d::stages::occlusion::{OcclusionPlan, OcclusionSource};
use ao4d::stages::render::RenderPlan;
use ao4d::stages::scene::AnyMesh;

#[path = "../../examples/mesh_to_volume.rs"]
mod mesh_to_volume;

#[test]
fn the_example_works() {
    mesh_to_volume::main();
}

#[test]
fn a_session_makes_what_a_run_writes() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/pipelines/two_tetrahedra.yaml");
    let out = tempfile::tempdir().unwrap();
    // A session's pictures are looked at once a voxel, and nothing looks at neighbours, unless its caller says so.
    let plain = ["shading=smooth", "supersample=1", "dilate=0"].map(|plain| format!("with-ao.{plain}"));
    let pipeline = Pipeline::load(path.as_ref(), &plain, Some(out.path().to_owned())).unwrap();
    run(&pipeline, &Settings::default(), &Silent).unwrap();
    let Some(AnyMesh::Four(mesh)) = pipeline.prepare(|_| true).unwrap().meshes.remove(0) else { panic!("not in 4D") };
    // It outlives everything it was made with, and can be handed to another thread.
    let session = Arc::new(Session::new(mesh));
    let (_, OcclusionPlan { source: OcclusionSource::Compute(computation), .. }) =
        pipeline.plan.all::<OcclusionPlan>().next().unwrap()
    else {
        panic!("nothing is computed")
    };
    let (estimator, there) = (computation.estimator(), Arc::clone(&session));
    let values = std::thread::spawn(move || there.occlusion(estimator, None, &Silent).unwrap()).join().unwrap();
    assert_eq!(ao4d::occlusion::encode(&values.values), std::fs::read(out.path().join("ao.f32")).unwrap());
    let (_, render) = pipeline.plan.all::<RenderPlan>().find(|(_, render)| render.occlusion.is_some()).unwrap();
    let (camera, shading) = (camera(&render.camera).unwrap(), Shading::Smooth(Arc::new(values)));
    let volume = session.render(camera, render.dimensions, shading, &[Aov::AmbientOcclusion], &Silent).unwrap();
    let written = vtk::read_volume(&out.path().join("with-ao.vti")).unwrap();
    assert_eq!(volume.array("ambient_occlusion").unwrap().values, written.array("ambient_occlusion").unwrap().values);
}
