//! A mesh in memory, its ambient occlusion, and a volume of what a 4D camera sees of it; no file is read or written.

use ao4d::geometry::Vector64;
use ao4d::mesh::{MeshBuilder, Orientation, Surface};
use ao4d::occlusion::Estimator;
use ao4d::progress::Silent;
use ao4d::render::{Aov, Camera, Shading, View};
use ao4d::session::Session;
use ao4d::trace::Sampling;

/// Runs the example.
pub fn main() {
    // A tetrahedron that faces the eye, at w = 1, before another one behind it.
    let mut builder = MeshBuilder::<4>::new();
    for (name, w, size) in [("front", -0.2, 0.6), ("back", -0.5, 1.4)] {
        let corner = |x: f64, y: f64, z: f64| Vector64::<4>::new(size * x, size * y, size * z, w);
        let vertices = vec![corner(-1., -1., -1.), corner(1., -1., -1.), corner(0., 1., -1.), corner(0., 0., 1.)];
        let surface = Surface { vertices, simplices: vec![[0, 1, 2, 3]], normals: None };
        let eye = Orientation::Facing(Camera::new(&View::default()).expect("a camera").viewpoint());
        builder.add(name, [0.9, 0.6, 0.3], &surface, eye).expect("a sound mesh");
    }
    let session = Session::new(builder.finish());
    let values = session.occlusion(Estimator::Sampled(Sampling::new(256, 1)), None, &Silent).expect("values");
    println!("occlusion of each vertex: {:?}", values.values);

    let camera = Camera::new(&View::default()).expect("a camera");
    let arrays = [Aov::Rgba, Aov::AmbientOcclusion, Aov::Opacity];
    let shading = Shading::Smooth(values.into());
    let volume = session.render(camera, [20, 20, 20], shading, &arrays, &Silent).expect("a volume");
    for array in &volume.arrays {
        println!("{}: {} x {} numbers", array.name, array.values.len() / array.components, array.components);
    }
    let opacity = volume.array("opacity").expect("was asked for").values.to_f64();
    println!("{} of {} voxels see something", opacity.iter().filter(|&&o| o > 0.0).count(), opacity.len());
}
