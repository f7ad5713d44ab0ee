//! Stages at work on a scene that a program holds in memory, with their results in memory: no file is read or written.
//!
//! A binding says what it wants in the words of a pipeline, `render: {dimensions: [64, 64, 64], lights: [...]}`, and so has every
//! key, every default and every complaint that pipelines have. The plan's scene stands for the one that is there; its
//! objects are not looked at. [`values`] gives what the plan's occlusion finds, [`picture`] what its render shows.

use std::cell::RefCell;
use std::path::Path;
use std::rc::Rc;
use std::sync::Arc;

use super::occlusion::{self, OcclusionPlan, OcclusionSource};
use super::picture::Picture;
use super::render::{RenderPlan, Shading};
use super::write::{PictureFiles, WritePlan};
use super::{Invalid, Ledger, Made, Plan, Ref, Run, SceneRun, StageError};
use crate::io;
use crate::occlusion::Estimates;
use crate::progress::Progress;
use crate::render::Accuracy;
use crate::session::Session;
use crate::volume::{Array, Volume};

/// A picture in memory.
#[derive(Clone, Debug)]
pub struct Seen {
    /// Its arrays.
    pub volume: Volume,
    /// How far off its occlusion is, where that was measured.
    pub accuracy: Option<Accuracy>,
    /// What the user should know of it.
    pub notes: Vec<String>,
}

/// The values of the plan's occlusion at the vertices of a scene.
///
/// # Errors
/// If there is no such stage, or as [`Session::occlusion`].
pub fn values<const D: usize>(
    plan: &Plan,
    session: &Session<D>,
    progress: &dyn Progress,
) -> Result<Estimates, StageError> {
    let (me, occlusion) = first::<OcclusionPlan>(plan, "occlusion")?;
    let OcclusionSource::Compute(computation) = &occlusion.source else {
        return Err(Invalid::new(plan.path(me), "loads a file, and there are none here; name a method").into());
    };
    let _running = progress.stage("occlusion", session.mesh().vertices.len() as u64);
    Ok(session.occlusion(computation.estimator(), None, progress)?)
}

/// The picture of the plan's render, with the arrays of its write. Where it is shaded by values at vertices, they are those
/// that are given, or else those of the plan's occlusion.
///
/// # Errors
/// If there is no such stage, or as [`Session::render`].
pub fn picture<const D: usize>(
    plan: &Plan,
    session: Session<D>,
    given: Option<Arc<Estimates>>,
    progress: &dyn Progress,
) -> Result<Seen, StageError> {
    let (_, render) = first::<RenderPlan>(plan, "render")?;
    let arrays = &first::<WritePlan>(plan, "write")?.1.arrays;
    let mut ledger = NoFiles;
    let mut run = Run {
        plan,
        told: "",
        progress,
        ledger: &mut ledger,
        loaded: Default::default(),
        force: false,
        joined: None,
        work: Default::default(),
        early: Default::default(),
    };
    let mut scene = SceneRun::new(session);
    if let Some(of) = render.occlusion {
        let vertices = scene.session.mesh().vertices.len();
        if let Some(given) = given {
            if given.values.len() != vertices || given.errors.len() != vertices {
                let message = format!(
                    "expected one value for each of the mesh's {vertices} vertices, found {}",
                    given.values.len()
                );
                return Err(Invalid::new("occlusion", message).into());
            }
            scene.values.insert(of, given);
        } else if render.shading != Shading::Voxel {
            occlusion::values(of, &mut run, &mut scene)?;
        }
    }
    let skylight = scene.skylight(render.occlusion, render.light_asked(arrays), &run)?;
    let (found, mut grid) = (Rc::new(RefCell::new(Vec::<Array>::new())), None);
    let made = render.picture(("render", None), plan, &scene, skylight, progress, |size, _| {
        grid = Some(*size);
        Ok(PictureFiles::memory(arrays, render.layers, Rc::clone(&found)))
    })?;
    let notes = notes(&made);
    let Some(grid) = grid else { return Err(Invalid::new("render", "made no picture").into()) };
    Ok(Seen { volume: Volume { grid, arrays: found.take(), field_data: Vec::new() }, accuracy: made.accuracy, notes })
}

/// What is worth telling of a picture.
fn notes(made: &Picture) -> Vec<String> {
    let nothing = made.nothing.iter().map(|why| format!("the picture shows background only: {why}"));
    let behind = (made.behind > 0).then(|| {
        format!(
            "{} of the {} voxels that see something see a surface from behind, with the occlusion of its front; turn that \
             object round, or take `shading: voxel`",
            made.behind, made.seen
        )
    });
    nothing.chain(made.in_vain.iter().cloned()).chain(behind).collect()
}

/// The first stage of a kind.
fn first<'p, T: super::Stage>(plan: &'p Plan, kind: &str) -> Result<(Ref<T>, &'p T), StageError> {
    plan.all::<T>().next().ok_or_else(|| Invalid::new("stages", format!("there is no `{kind}`")).into())
}

/// The book of work that leaves no files: all is to be made, and nothing is remembered.
struct NoFiles;

impl Ledger for NoFiles {
    fn is_stale(&self, _: &Path) -> bool {
        true
    }

    fn record(&mut self, _: Made) -> Result<(), io::Error> {
        Ok(())
    }

    fn forget(&mut self, _: &Path) -> Result<(), io::Error> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::geometry::Vector64;
    use crate::io::vtk;
    use crate::mesh::{MeshBuilder, Orientation, Surface};
    use crate::pipeline::{Document, Pipeline, Settings, run};
    use crate::progress::Silent;

    const OBJECT: &str = "{orientation: eye, simplices: {vertices: [[-1, -1, -1, 0], [1, -1, -1, 0.2], [0, 1, -1, 0], [0, 0, 1, -0.3]], cells: [[0, 1, 2, 3]]}}";

    fn pipeline(objects: &str, out: Option<PathBuf>) -> Pipeline {
        let text = format!(
            "name: p\nstages:\n  - scene: {{objects: [{objects}]}}\n  - occlusion: {{samples: 64}}\n  - render: {{dimensions: [9, 8, 40], \
             sky: {{gradient: [0.2, 0.3, 0, 0]}}}}\n  - write: {{vti: p.vti, arrays: [rgba, ambient_occlusion, opacity, normal]}}\n"
        );
        Pipeline::from_document(Document::parse("p.yaml", &text).unwrap(), &[], out).unwrap()
    }

    /// What a run writes is what a program gets, to the last bit.
    #[test]
    fn pictures_in_memory_are_those_of_files() {
        let folder = tempfile::tempdir().unwrap();
        run(&pipeline(OBJECT, Some(folder.path().to_owned())), &Settings::default(), &Silent).unwrap();
        let written = vtk::read_volume(&folder.path().join("p.vti")).unwrap();

        let corner = |c: [f64; 4]| Vector64::<4>::from_iterator(c);
        let corners = [[-1., -1., -1., 0.], [1., -1., -1., 0.2], [0., 1., -1., 0.], [0., 0., 1., -0.3]];
        let surface = Surface { vertices: corners.map(corner).to_vec(), simplices: vec![[0, 1, 2, 3]], normals: None };
        let eye = Orientation::Facing(crate::mesh::Viewpoint::Eye([0., 0., 0., 1.].into()));
        let mut builder = MeshBuilder::<4>::new();
        builder.add("object 1", [0.8; 3], &surface, eye).unwrap();
        let session = Session::new(builder.finish());
        let plan = pipeline("", None).plan;
        let found = values(&plan, &session, &Silent).unwrap();
        for given in [None, Some(Arc::new(found))] {
            let seen = picture(&plan, session.clone(), given, &Silent).unwrap();
            assert_eq!(seen.volume.grid, written.grid);
            for array in &seen.volume.arrays {
                assert_eq!(Some(array), written.array(&array.name), "{}", array.name);
            }
            assert_eq!((seen.volume.arrays.len(), seen.notes.len()), (4, 0));
        }
        let short = Arc::new(Estimates { values: vec![1.0], errors: vec![0.0], rays: 0 });
        let refused = picture(&plan, session, Some(short), &Silent).unwrap_err();
        assert_eq!(refused.to_string(), "occlusion: expected one value for each of the mesh's 4 vertices, found 1");
    }
}
