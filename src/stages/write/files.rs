//! The open files of one picture: each slab goes to all of them.

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use super::{Content, Format, Opening, VoxelFile, WritePlan};
use crate::io::Error;
use crate::render::{Accuracy, Aov};
use crate::stages::render::RenderPlan;
use crate::stages::{Plan, Ref, Run};
use crate::volume::{Array, Grid};

/// The open files of one picture.
pub(in crate::stages) struct PictureFiles {
    aovs: Vec<Aov>,
    files: Vec<Open>,
}

struct Open {
    path: PathBuf,
    file: Box<dyn VoxelFile>,
    /// Where among a slab's arrays its own are.
    places: Vec<usize>,
}

impl PictureFiles {
    /// Opens those files of a render that have to be made; of a piece of a run its parts, for a picture that begins with
    /// `first_layer`.
    pub fn create(
        render: Ref<RenderPlan>,
        run: &Run,
        grid: &Grid,
        first_layer: usize,
        mesh_hash: &str,
    ) -> Result<Self, Error> {
        let Run { plan, told, .. } = run;
        let stale = &|file: &Path| run.is_stale(file);
        let layers = plan[render].layers;
        let mut aovs: Vec<Aov> = Vec::new();
        // Each is one array, or one a layer.
        let mut place = |aov: Aov| {
            let nth = aovs.iter().position(|&c| c == aov).unwrap_or_else(|| {
                aovs.push(aov);
                aovs.len() - 1
            });
            let first: usize = aovs[..nth].iter().map(|aov| aov.count(layers)).sum();
            first..first + aov.count(layers)
        };
        let mut files = Vec::new();
        for (_, write) in plan.all::<WritePlan>().filter(|(_, write)| write.render == render) {
            for file in write.stale(Content::Voxels, stale) {
                let name = if plan.piece.is_some() { file.format.part(&file.path) } else { file.path.clone() };
                let path = plan.out.join(&name);
                let seen = &plan[render];
                let opening = Opening { path: &path, plan, write, render: seen, grid, first_layer, mesh_hash, told };
                let opened =
                    if plan.piece.is_some() { file.format.open_part(opening) } else { file.format.open(opening) }?;
                let places = file.format.arrays(write).into_iter().flat_map(&mut place).collect();
                files.extend(opened.map(|opened| Open { path: name, file: opened, places }));
            }
        }
        Ok(Self { aovs, files })
    }

    /// Opens the `.vti` of a frame of an animation, below the output folder: the picture of `render`, as `write` says.
    pub fn frame(
        file: &Path,
        write: &WritePlan,
        render: &RenderPlan,
        plan: &Plan,
        told: &str,
        grid: &Grid,
        mesh_hash: &str,
    ) -> Result<Self, Error> {
        let path = plan.out.join(file);
        let opening = Opening { path: &path, plan, write, render, grid, first_layer: 0, mesh_hash, told };
        let opened = Format::Vti.open(opening)?;
        let aovs = Format::Vti.arrays(write);
        let places: Vec<usize> = (0..aovs.iter().map(|aov| aov.count(render.layers)).sum()).collect();
        let open = opened.map(|opened| Open { path: file.to_owned(), file: opened, places });
        Ok(Self { aovs, files: open.into_iter().collect() })
    }

    /// Opens no file: the arrays of a picture are kept in memory.
    pub fn memory(aovs: &[Aov], layers: usize, kept: Rc<RefCell<Vec<Array>>>) -> Self {
        let places = (0..aovs.iter().map(|aov| aov.count(layers)).sum()).collect();
        let file: Box<dyn VoxelFile> = Box::new(Kept(kept));
        Self { aovs: aovs.to_vec(), files: vec![Open { path: PathBuf::new(), file, places }] }
    }

    /// What the files need of each slab, in this order.
    pub fn aovs(&self) -> &[Aov] {
        &self.aovs
    }

    /// Writes some layers, of which `first` is the first, to all files.
    pub fn add_slab(&mut self, first: usize, slab: &[Array]) -> Result<(), Error> {
        for Open { file, places, .. } in &mut self.files {
            let arrays: Vec<&Array> = places.iter().map(|&place| &slab[place]).collect();
            file.add_slab(first, &arrays)?;
        }
        Ok(())
    }

    /// Takes note of how far off the picture's occlusion is.
    pub fn tell(&mut self, accuracy: &Accuracy) {
        self.files.iter_mut().for_each(|open| open.file.tell(accuracy));
    }

    /// Completes the files and gives them their names; returns each with its length.
    pub fn finish(self) -> Result<Vec<(PathBuf, u64)>, Error> {
        self.files.into_iter().map(|Open { path, file, .. }| Ok((path, file.finish()?))).collect()
    }
}

/// Arrays in memory that grow slab by slab.
struct Kept(Rc<RefCell<Vec<Array>>>);

impl VoxelFile for Kept {
    fn add_slab(&mut self, _: usize, slab: &[&Array]) -> Result<(), Error> {
        let mut kept = self.0.borrow_mut();
        if kept.is_empty() {
            kept.extend(slab.iter().map(|&array| array.clone()));
        } else {
            kept.iter_mut().zip(slab).for_each(|(all, more)| all.values.append(&more.values));
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<u64, Error> {
        Ok(0)
    }
}
