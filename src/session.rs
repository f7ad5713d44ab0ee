//! A scene in memory, ready to be shaded and looked at: the door for programs that bring their own meshes.
//!
//! A session owns its scene and shares it by `Arc`, so that whoever holds one, a program or a binding, has nothing to keep
//! alive beside it. `examples/mesh_to_volume.rs` goes from a mesh to a volume in about thirty lines; `ao4d run` makes one
//! session a scene.

use std::sync::{Arc, OnceLock};

use crate::accel::Tracer;
use crate::geometry::Vector64;
use crate::mesh::Mesh;
use crate::occlusion::{Bounced, Directional, Error, Estimates, Estimator};
use crate::progress::Progress;
use crate::render::{Aov, Camera, Renderer, Shading, radiosity};
use crate::trace::cpu::CpuBackend;
use crate::trace::opencl::{OpenCl, OpenClBackend};
use crate::trace::{RayBackend, ShadingPoint};
use crate::volume::Volume;

/// A scene, and what traces rays in it. A copy is cheap: it shares both.
#[derive(Clone, Debug)]
pub struct Session<const D: usize> {
    tracer: Arc<Tracer<D>>,
    hash: OnceLock<String>,
    opencl: Option<Arc<OpenCl>>,
    backend: Arc<dyn RayBackend<D>>,
}

impl<const D: usize> Session<D> {
    /// A scene whose rays are traced by the processor.
    pub fn new(mesh: impl Into<Arc<Mesh<D>>>) -> Self {
        Self::by(mesh, None)
    }

    /// A scene whose rays are traced by OpenCL devices, which get it when they are first asked to.
    pub fn on(mesh: impl Into<Arc<Mesh<D>>>, opencl: Arc<OpenCl>) -> Self {
        Self::by(mesh, Some(opencl))
    }

    /// Another scene, whose rays are traced by the same.
    pub fn with_mesh(&self, mesh: impl Into<Arc<Mesh<D>>>) -> Self {
        Self::by(mesh, self.opencl.clone())
    }

    fn by(mesh: impl Into<Arc<Mesh<D>>>, opencl: Option<Arc<OpenCl>>) -> Self {
        let tracer = Arc::new(Tracer::new(mesh));
        let backend: Arc<dyn RayBackend<D>> = match &opencl {
            None => Arc::new(CpuBackend::new(Arc::clone(&tracer))),
            Some(opencl) => Arc::new(OpenClBackend::new(opencl, Arc::clone(&tracer))),
        };
        Self { tracer, hash: OnceLock::new(), opencl, backend }
    }

    /// The scene's mesh.
    pub fn mesh(&self) -> &Arc<Mesh<D>> {
        self.tracer.mesh()
    }

    /// The hash of the mesh's content.
    pub fn mesh_hash(&self) -> &str {
        self.hash.get_or_init(|| self.mesh().content_hash())
    }

    /// Whether OpenCL devices trace its rays.
    pub fn is_on_opencl(&self) -> bool {
        self.opencl.is_some()
    }

    /// What traces rays.
    pub fn backend(&self) -> &Arc<dyn RayBackend<D>> {
        &self.backend
    }

    /// Ambient occlusion at the vertices. If there is a `mask`, only where it says so; elsewhere values are 1.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if `progress` says so, [`Error::OverBudget`] where a closed form is too expensive, and what goes
    /// wrong on a device.
    pub fn occlusion(
        &self,
        estimator: Estimator,
        mask: Option<&[bool]>,
        progress: &dyn Progress,
    ) -> Result<Estimates, Error> {
        estimator.estimate(&*self.backend, &ShadingPoint::vertices(self.mesh()), mask, progress)
    }

    /// Ambient occlusion at the vertices with the vector b of the open directions.
    ///
    /// # Errors
    /// As [`Session::occlusion`].
    pub fn directional(&self, estimator: Estimator, progress: &dyn Progress) -> Result<Directional<D>, Error> {
        estimator.directional(&*self.backend, &ShadingPoint::vertices(self.mesh()), None, progress)
    }

    /// The light of other surfaces at the vertices, under a sky of this gradient: the radiosity of the vertices, which points
    /// between them gather, and what the vertices gather themselves.
    ///
    /// # Errors
    /// As [`Session::occlusion`].
    pub fn bounced(
        &self,
        estimator: Estimator,
        found: &Directional<D>,
        gradient: &Vector64<D>,
        progress: &dyn Progress,
    ) -> Result<(Vec<[f32; 3]>, Bounced), Error> {
        let radiosity = radiosity(self.mesh(), found, gradient);
        let points = ShadingPoint::vertices(self.mesh());
        let bounced = estimator.bounced(&self.tracer, &points, &found.estimates, &radiosity, progress)?;
        Ok((radiosity, bounced))
    }

    /// A picture to be made slab by slab.
    pub fn renderer(&self, camera: Camera<D>, dimensions: [usize; 3], shading: Shading) -> Renderer<D> {
        Renderer::new(Arc::clone(&self.backend), camera, dimensions, shading)
    }

    /// A whole picture in memory, with these arrays.
    ///
    /// # Errors
    /// As [`Session::occlusion`].
    pub fn render(
        &self,
        camera: Camera<D>,
        dimensions: [usize; 3],
        shading: Shading,
        aovs: &[Aov],
        progress: &dyn Progress,
    ) -> Result<Volume, Error> {
        self.renderer(camera, dimensions, shading).volume(aovs, progress)
    }
}
