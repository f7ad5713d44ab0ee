//! Scenes with exact values at some of their vertices.

use std::path::Path;

use ao4d::accel::Tracer;
use ao4d::geometry::Vector64;
use ao4d::mesh::{Mesh, MeshBuilder, Orientation, Surface};
use ao4d::occlusion::exact::{Budget, Hemisphere};
use ao4d::pipeline::Pipeline;
use ao4d::stages::scene::AnyMesh;
use ao4d::trace::ShadingPoint;

/// A mesh, and which of its vertices are looked at: some 100 at most, evenly spread.
pub struct Scene<const D: usize> {
    pub name: String,
    pub mesh: Mesh<D>,
    pub vertices: Vec<u32>,
}

impl<const D: usize> Scene<D> {
    fn new(name: &str, mesh: Mesh<D>, most: usize) -> Self {
        let count = mesh.vertices.len();
        let step = count.div_ceil(most);
        Self { name: name.to_owned(), mesh, vertices: (0..count).step_by(step).map(|v| v as u32).collect() }
    }

    /// The exact values at the chosen vertices.
    pub fn exact(&self, tracer: &Tracer<D>) -> Vec<f64> {
        let value = |&v: &u32| {
            let view = Hemisphere::over(tracer, &ShadingPoint::Vertex(v));
            view.map_or(1.0, |view| view.visible_fraction(Budget::default()).unwrap().clamp(0.0, 1.0))
        };
        self.vertices.iter().map(value).collect()
    }
}

/// A scene in whichever dimension it is.
pub fn pipeline(file: &str) -> AnyMesh {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines").join(file);
    let pipeline = Pipeline::load(&path, &[], None).unwrap();
    pipeline.prepare(|_| true).unwrap().meshes.swap_remove(0).unwrap()
}

fn pipeline_in<const D: usize>(file: &str, most: usize) -> Option<Scene<D>> {
    // The dimensions are told apart by copying what fits.
    let mesh: Box<dyn std::any::Any> = match pipeline(file) {
        AnyMesh::Three(mesh) => Box::new(mesh),
        AnyMesh::Four(mesh) => Box::new(mesh),
    };
    mesh.downcast::<Mesh<D>>().ok().map(|mesh| Scene::new(file, *mesh, most))
}

/// Random simplices of size about `size` around the origin, each a surface of its own.
pub fn soup<const D: usize>(seed: u32, count: usize, size: f64) -> Surface<D> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 23) - 1.0
    };
    let mut vertices = Vec::new();
    for _ in 0..count {
        let centre = Vector64::<D>::from_fn(|_, _| next());
        vertices.extend((0..D).map(|_| centre + Vector64::from_fn(|_, _| size * next())));
    }
    let simplices = (0..count).map(|s| std::array::from_fn(|i| (s * D + i) as u32)).collect();
    Surface { vertices, simplices, normals: None }
}

pub fn mesh<const D: usize>(surfaces: &[Surface<D>]) -> Mesh<D> {
    let mut builder = MeshBuilder::new();
    for (i, surface) in surfaces.iter().enumerate() {
        builder.add(&i.to_string(), [0.8; 3], surface, Orientation::Input).unwrap();
    }
    builder.finish()
}

/// All the scenes of a dimension, with at most so many vertices each.
pub fn all<const D: usize>(most: usize) -> Vec<Scene<D>> {
    let files = ["two_tetrahedra.yaml", "thesis/fig_5_4.yaml", "nut.yaml", "thesis/fig_2_3.yaml"];
    let mut scenes: Vec<Scene<D>> = files.iter().filter_map(|file| pipeline_in(file, most)).collect();
    for (name, count, size) in [("soup of 12", 12, 0.8), ("soup of 60", 60, 0.5)] {
        scenes.push(Scene::new(name, mesh(&[soup::<D>(7, count, size)]), most));
    }
    scenes
}
