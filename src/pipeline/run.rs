//! Running a plan: scene by scene, in the order of its stages, as lazily as its files allow.
//!
//! A value is computed when some file that has to be made needs it, and not before: the hierarchy over a scene when
//! something is traced, an occlusion when it is written or a picture is shaded by it. Pictures are made slab by slab
//! and go to all their files at once, so none is ever in memory as a whole.

use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::build::{AnyMesh, camera};
use super::cache::{Cache, Keys};
use super::files::{self, PictureFiles};
use super::occlude::{errors_file, estimator, kept, most_rays};
use super::plan::{Computation, OcclusionSource, Plan, RenderPlan, StageRef, grouped};
use super::prepare::{Loaded, Prepared, sidecar_path};
use super::report::{FileReport, Report};
use super::settings::Backend;
use super::spec;
use super::work::Stale;
use super::{Error, Pipeline, Settings, figure, limits};
use crate::accel::Tracer;
use crate::io;
use crate::mesh::Mesh;
use crate::occlusion::{self, Cancelled, Estimates};
use crate::progress::Progress;
use crate::render::{CameraError, NOTHING, Renderer, Shading, Visibility};
use crate::trace::cpu::CpuBackend;
use crate::trace::opencl::{self, OpenCl, OpenClBackend};
use crate::trace::{self, RayBackend, ShadingPoint};

/// A run that didn't succeed.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// Something is wrong with the pipeline or a file it names; nothing was written.
    #[error(transparent)]
    Refused(#[from] Error),
    /// Ctrl-C.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// There are no values of ambient occlusion.
    #[error("ambient occlusion: {0}")]
    Occlusion(occlusion::Error),
    /// The OpenCL device fails, or there is none.
    #[error(transparent)]
    OpenCl(#[from] opencl::Error),
    /// A file can't be written.
    #[error(transparent)]
    Export(#[from] io::Error),
    /// A picture doesn't fit in memory.
    #[error(
        "render {render}: one layer of its picture takes {needed} bytes of memory, and {available} are free; lower its dimensions, or write fewer arrays"
    )]
    Memory {
        /// The picture.
        render: String,
        /// Bytes that are needed at once.
        needed: u64,
        /// Bytes that are there.
        available: u64,
    },
    /// Rounding left a camera without a frame.
    #[error("a camera can't be placed")]
    Camera(#[from] CameraError),
    /// Threads can't be started.
    #[error("can't start the threads")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

impl From<occlusion::Error> for RunError {
    fn from(error: occlusion::Error) -> Self {
        match error {
            occlusion::Error::Cancelled => Self::Cancelled(Cancelled),
            occlusion::Error::OpenCl(error) => Self::OpenCl(error),
            error => Self::Occlusion(error),
        }
    }
}

impl From<trace::Error> for RunError {
    fn from(error: trace::Error) -> Self {
        occlusion::Error::from(error).into()
    }
}

/// Runs a pipeline and writes its files. The files are the same bytes on any number of threads.
///
/// # Errors
/// [`RunError`]; files that were finished before stay, none is left half-written.
pub fn run(pipeline: &Pipeline, settings: &Settings, progress: &dyn Progress) -> Result<Report, RunError> {
    let threads = settings.threads.map_or(0, std::num::NonZeroUsize::get);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    pool.install(|| run_here(pipeline, settings, progress))
}

fn run_here(pipeline: &Pipeline, settings: &Settings, progress: &dyn Progress) -> Result<Report, RunError> {
    let began = Instant::now();
    let plan = &pipeline.plan;
    let opencl = match &settings.backend {
        Backend::Cpu => None,
        Backend::OpenCl(places) => Some(OpenCl::open(places)?),
    };
    let keys = Keys::new(plan);
    let cache = Cache::open(&plan.out, settings.force);
    let stale = Stale::new(plan, &keys, &cache);
    limits::check(plan, &stale)?;
    progress.begin("scene", 0);
    let prepared = pipeline.prepare(|scene| stale.scene(plan, scene));
    progress.end();
    let Prepared { meshes, loaded, notes } = prepared?;
    if stale.anything() {
        io::check_writable(&plan.out)?;
    }
    let building = began.elapsed();
    let report = Report { out: plan.out.clone(), notes, ..Report::default() };
    let opencl = opencl.as_ref();
    let mut run = Run { plan, opencl, keys, cache, stale, loaded, progress, report, times: BTreeMap::new() };
    for (scene, mesh) in meshes.into_iter().enumerate() {
        match mesh {
            Some(AnyMesh::Three(mesh)) => run.scene(scene, mesh, building)?,
            Some(AnyMesh::Four(mesh)) => run.scene(scene, mesh, building)?,
            None => run.cached_scene(scene)?,
        }
    }
    for (i, figure) in plan.figures.iter().enumerate() {
        let start = Instant::now();
        let (bytes, cached) = figure::write(plan, figure, settings.force)?;
        run.report.files.push(FileReport { path: figure.state.clone(), bytes, cached });
        run.times.insert(StageRef::Figure(i), (start.elapsed(), String::new()));
    }
    let mut report = run.report;
    for &stage in &plan.order {
        let (time, detail) = run.times.remove(&stage).unwrap_or_default();
        report.stage(format!("{} {}", stage.kind(), plan.id(stage)), time, detail);
    }
    report.seconds = began.elapsed().as_secs_f64();
    Ok(report)
}

/// A run in progress.
struct Run<'p> {
    plan: &'p Plan,
    opencl: Option<&'p OpenCl>,
    keys: Keys,
    cache: Cache,
    stale: Stale,
    loaded: Vec<Option<Loaded>>,
    progress: &'p dyn Progress,
    report: Report,
    times: BTreeMap<StageRef, (Duration, String)>,
}

/// What has been made of a scene so far.
struct Scene<'p, const D: usize> {
    mesh: Arc<Mesh<D>>,
    hash: String,
    tracer: Arc<Tracer<D>>,
    opencl: Option<&'p OpenCl>,
    backend: OnceCell<Arc<dyn RayBackend<D>>>,
    values: BTreeMap<usize, Arc<Estimates>>,
}

impl<const D: usize> Scene<'_, D> {
    /// What traces rays. An OpenCL device gets the scene when it is first asked for.
    fn backend(&self) -> Result<&Arc<dyn RayBackend<D>>, RunError> {
        if self.backend.get().is_none() {
            let tracer = Arc::clone(&self.tracer);
            let _ = self.backend.set(match self.opencl {
                Some(opencl) => Arc::new(OpenClBackend::new(opencl, tracer)?),
                None => Arc::new(CpuBackend::new(tracer)),
            });
        }
        let cpu = || Arc::new(CpuBackend::new(Arc::clone(&self.tracer))) as Arc<dyn RayBackend<D>>;
        Ok(self.backend.get_or_init(cpu))
    }
}

impl Run<'_> {
    /// Runs the stages that work on one scene, in order.
    fn scene<const D: usize>(&mut self, index: usize, mesh: Mesh<D>, building: Duration) -> Result<(), RunError> {
        let id = &self.plan.scenes[index].id;
        let detail = format!(
            "{} vertices, {} simplices",
            grouped(mesh.vertices.len() as u64),
            grouped(mesh.simplices.len() as u64)
        );
        self.times.insert(StageRef::Scene(index), (building, detail));
        if !mesh.degenerate.is_empty() {
            let first = mesh.degenerate[0];
            let object = &mesh.objects[mesh.object_of(first)].name;
            self.report.notes.push(format!(
                "scene {id}: {} of {} simplices have measure zero and are left out (the first is number {first}, of {object})",
                mesh.degenerate.len(),
                mesh.simplices.len()
            ));
        }
        let mesh = Arc::new(mesh);
        let tracer = Arc::new(Tracer::new(Arc::clone(&mesh)));
        let (hash, backend, values) = (mesh.content_hash(), OnceCell::new(), BTreeMap::new());
        let mut scene = Scene { mesh, hash, tracer, opencl: self.opencl, backend, values };
        let plan = self.plan;
        for &stage in &plan.order {
            let start = Instant::now();
            let detail = match stage {
                StageRef::Occlusion(i) if plan.occlusions[i].scene == index => self.occlusion(i, &mut scene)?,
                StageRef::Render(i) if plan.renders[i].scene == index => self.render(i, &mut scene)?,
                StageRef::Write(i) if plan.renders[plan.writes[i].render].scene == index => {
                    self.write(i, &mut scene)?
                }
                _ => continue,
            };
            let known = self.times.entry(stage).or_default();
            known.0 += start.elapsed();
            known.1 = detail;
        }
        Ok(())
    }

    /// Reports the files of a scene of which nothing had to be made.
    fn cached_scene(&mut self, index: usize) -> Result<(), RunError> {
        let plan = self.plan;
        for &stage in &plan.order {
            match stage {
                StageRef::Occlusion(i) if plan.occlusions[i].scene == index => {
                    self.note_cached(plan.occlusions[i].file.as_deref());
                }
                StageRef::Write(i) if plan.renders[plan.writes[i].render].scene == index => {
                    plan.writes[i].files().for_each(|f| self.note_cached(Some(f)));
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn note_cached(&mut self, file: Option<&Path>) {
        if let Some(file) = file {
            let bytes = std::fs::metadata(self.plan.out.join(file)).map_or(0, |m| m.len());
            self.report.files.push(FileReport { path: file.to_owned(), bytes, cached: true });
        }
    }

    fn note_written(&mut self, file: &Path, bytes: u64, key: &str) -> Result<(), RunError> {
        self.cache.record(file, key)?;
        self.report.files.push(FileReport { path: file.to_owned(), bytes, cached: false });
        Ok(())
    }

    /// Writes an occlusion's file, if it has one that isn't there yet.
    fn occlusion<const D: usize>(&mut self, index: usize, scene: &mut Scene<D>) -> Result<String, RunError> {
        let Some(file) = self.plan.occlusions[index].file.as_deref() else { return Ok(String::new()) };
        if !self.stale.occlusion[index] {
            self.note_cached(Some(file));
            return Ok("as it was".to_owned());
        }
        let start = Instant::now();
        self.values(index, scene)?;
        let found = &scene.values[&index];
        let detail = rate(found, start.elapsed());
        let plan = self.plan;
        let occlusion = &plan.occlusions[index];
        let sidecar = match (&occlusion.source, &self.loaded[index]) {
            (OcclusionSource::Compute(computation), _) => files::sidecar(found, computation, &scene.hash),
            (OcclusionSource::Load(_), Some(loaded)) => loaded.sidecar.clone(),
            (OcclusionSource::Load(_), None) => return Ok(String::new()),
        };
        let key = self.keys.occlusion(index).to_owned();
        if let Some(errors) = errors_file(occlusion) {
            files::write_whole(&plan.out.join(&errors), &occlusion::encode(&found.errors))?;
            self.cache.record(&errors, &key)?;
        }
        let bytes = files::write_occlusion(&plan.out.join(file), &found.values, &sidecar)?;
        self.cache.record(&sidecar_path(file), &key)?;
        self.note_written(file, bytes, &key)?;
        Ok(detail)
    }

    /// Makes sure that an occlusion's values are known.
    fn values<const D: usize>(&mut self, index: usize, scene: &mut Scene<D>) -> Result<(), RunError> {
        if scene.values.contains_key(&index) {
            return Ok(());
        }
        let occlusion = &self.plan.occlusions[index];
        let values = match &occlusion.source {
            OcclusionSource::Load(_) => {
                let loaded = self.loaded[index].as_mut();
                let take = |l: &mut Loaded| (std::mem::take(&mut l.values), std::mem::take(&mut l.errors));
                let (values, errors) = loaded.map(take).unwrap_or_default();
                Estimates { values, errors, rays: 0 }
            }
            OcclusionSource::Compute(computation) => {
                // A file that is still fresh holds the values already.
                let count = scene.mesh.vertices.len();
                let fresh = !self.stale.occlusion[index];
                match fresh.then(|| kept(&self.plan.out, occlusion, &scene.hash, count)).flatten() {
                    Some(found) => found,
                    None => {
                        let start = Instant::now();
                        let mask = self.mask(index, computation, scene)?;
                        let asked = mask.as_ref().map_or(count, |mask| mask.iter().filter(|&&m| m).count());
                        self.progress.begin(&format!("occlusion {}", occlusion.id), asked as u64);
                        let points = ShadingPoint::vertices(&scene.mesh);
                        let backend = &**scene.backend()?;
                        let found = estimator(computation).estimate(backend, &points, mask.as_deref(), self.progress);
                        self.progress.end();
                        let found = found?;
                        self.times.entry(StageRef::Occlusion(index)).or_default().1 = rate(&found, start.elapsed());
                        found
                    }
                }
            }
        };
        scene.values.insert(index, Arc::new(values));
        Ok(())
    }

    /// The vertices of the simplices that some voxel shows, of the pictures that have to be made; none if all values are
    /// wanted for some file, or if looking costs more than it may save.
    fn mask<const D: usize>(
        &self,
        index: usize,
        computation: &Computation,
        scene: &Scene<D>,
    ) -> Result<Option<Vec<bool>>, RunError> {
        let plan = self.plan;
        let meshes = plan.writes.iter().zip(&self.stale.vtu).filter(|(_, stale)| **stale);
        let shown = meshes.into_iter().any(|(write, _)| plan.renders[write.render].occlusion == Some(index));
        if shown || plan.occlusions[index].file.is_some() {
            return Ok(None);
        }
        let renders = plan.renders.iter().enumerate().filter(|(i, render)| {
            let values = render.occlusion == Some(index) && render.shading != spec::Shading::Voxel;
            values && self.stale.render(plan, *i)
        });
        let mut left = most_rays(computation).saturating_mul(scene.mesh.vertices.len() as u64) / 4;
        let mut mask = vec![false; scene.mesh.vertices.len()];
        for (_, render) in renders {
            let camera = camera::<D>(&render.camera)?;
            let grid = camera.grid(render.dimensions);
            let visibility = Visibility::new(Arc::clone(scene.backend()?), &camera, &grid, render.visibility);
            left = left.saturating_sub(visibility.cost());
            if left == 0 {
                return Ok(None);
            }
            self.progress.begin(&format!("what {} shows", render.id), render.voxels());
            let thick = (SLAB_BYTES / 4 / grid.layer_len()).clamp(1, grid.dimensions[2]);
            for first in (0..grid.dimensions[2]).step_by(thick) {
                let layers = first..grid.dimensions[2].min(first + thick);
                let mut last = NOTHING;
                for simplex in visibility.first_hits(layers, self.progress)? {
                    if simplex != NOTHING && simplex != last {
                        scene.mesh.simplices[simplex as usize].iter().for_each(|&v| mask[v as usize] = true);
                        last = simplex;
                    }
                }
            }
            self.progress.end();
        }
        Ok(Some(mask))
    }

    /// Makes a picture, if some file of it isn't there yet, and its files with it.
    fn render<const D: usize>(&mut self, index: usize, scene: &mut Scene<D>) -> Result<String, RunError> {
        let plan = self.plan;
        if !self.stale.render(plan, index) {
            return Ok("as it was".to_owned());
        }
        let render = &plan.renders[index];
        if let Some(o) = render.occlusion.filter(|_| render.shading != spec::Shading::Voxel) {
            self.values(o, scene)?;
        }
        let camera = camera::<D>(&render.camera)?;
        let shading = shading(plan, render, &scene.values);
        let mut picture = Renderer::new(Arc::clone(scene.backend()?), camera, render.dimensions, shading);
        picture.visibility = render.visibility;
        let start = Instant::now();
        let mut files = PictureFiles::create(plan, index, &self.stale, &picture.grid, &scene.hash)?;
        let channels = files.channels().to_vec();
        // Two passes over the voxels: what is seen, and its shade.
        self.progress.begin(&format!("render {}", render.id), 2 * render.voxels());
        let mut seen = 0;
        picture.render(&channels, None, self.progress, |slab| -> Result<(), RunError> {
            seen += slab.seen;
            Ok(files.add_slab(slab.layers.start, &slab.arrays)?)
        })?;
        self.progress.end();
        let rendering = start.elapsed();
        for (write, kind, file, bytes) in files.finish()? {
            let key = self.keys.file(&plan.writes[write], kind);
            self.note_written(&file, bytes, &key)?;
        }
        if seen == 0 && !scene.mesh.simplices.is_empty() {
            self.report.notes.push(files::nothing_seen(&picture, &render.id));
        }
        let rate = render.voxels() as f64 / rendering.as_secs_f64() / 1e6;
        Ok(format!(
            "{} of {} voxels see something, {rate:.2} million voxels a second",
            grouped(seen),
            grouped(render.voxels())
        ))
    }

    /// Writes a write's mesh, and reports what was there already. Its pictures were written with the render.
    fn write<const D: usize>(&mut self, index: usize, scene: &mut Scene<D>) -> Result<String, RunError> {
        let plan = self.plan;
        let write = &plan.writes[index];
        let fresh = [
            (write.vti.as_deref(), self.stale.vti[index]),
            (write.raw.as_deref(), self.stale.raw[index]),
            (write.png.as_deref(), self.stale.png[index]),
            (write.vtu.as_deref(), self.stale.vtu[index]),
        ];
        fresh.into_iter().filter(|(_, stale)| !stale).for_each(|(file, _)| self.note_cached(file));
        let Some(file) = write.vtu.as_deref().filter(|_| self.stale.vtu[index]) else { return Ok(String::new()) };
        let render = &plan.renders[write.render];
        if let Some(o) = render.occlusion {
            self.values(o, scene)?;
        }
        let camera = camera::<D>(&render.camera)?;
        let values = render.occlusion.map(|o| &*scene.values[&o]);
        let (bytes, left_out) = files::write_mesh(&plan.out.join(file), &scene.mesh, &camera, values)?;
        if left_out > 0 {
            self.report.notes.push(format!(
                "{}: {left_out} of {} simplices are not wholly before the eye and are left out",
                file.display(),
                scene.mesh.simplices.len()
            ));
        }
        let key = self.keys.file(write, "vtu");
        self.note_written(file, bytes, &key)?;
        Ok(String::new())
    }
}

/// How fast values were found.
fn rate(found: &Estimates, time: Duration) -> String {
    let rays = match found.rays {
        0 => String::new(),
        rays => {
            let speed = rays as f64 / time.as_secs_f64() / 1e6;
            format!("{} rays, {speed:.2} million a second, ", grouped(rays))
        }
    };
    match found.errors.len() {
        0 => rays,
        _ => format!("{rays}error {:.1e}", found.error()),
    }
}

/// The working set of a slab: so little that memory is used again for the next, not asked for anew.
const SLAB_BYTES: usize = 16 << 20;

fn shading(plan: &Plan, render: &RenderPlan, values: &BTreeMap<usize, Arc<Estimates>>) -> Shading {
    let Some(o) = render.occlusion else { return Shading::None };
    match (render.shading, &plan.occlusions[o].source) {
        (spec::Shading::Voxel, OcclusionSource::Compute(computation)) => Shading::Voxel(estimator(computation)),
        (spec::Shading::Flat, _) => Shading::Flat(Arc::clone(&values[&o])),
        _ => Shading::Smooth(Arc::clone(&values[&o])),
    }
}
