//! `.png`: a quick look at three slices, without ParaView.

use std::path::PathBuf;

use super::{Content, LeftOut, Opening, OutputFormat, VoxelFile, WritePlan};
use crate::io::png::{self, Slices};
use crate::io::{AtomicFile, Error};
use crate::render::Aov;
use crate::volume::{Array, Values};

pub(super) struct Png;

impl OutputFormat for Png {
    const CONTENT: Content = Content::Voxels;
    const LEFT_OUT: &'static [LeftOut] = &[
        LeftOut::new("/arrays", "about `.vti` only; a `.png` has colours"),
        LeftOut::new("/encoding", "about `.vti` only"),
        LeftOut::new("/compression", "about `.vti` only"),
    ];

    fn arrays(_: &WritePlan) -> Vec<Aov> {
        vec![Aov::Rgba]
    }

    fn open(Opening { path, grid, .. }: Opening) -> Result<Option<Box<dyn VoxelFile>>, Error> {
        let out = AtomicFile::create(path)?;
        Ok(Some(Box::new(File { path: path.to_owned(), out, slices: Slices::new(grid) })))
    }
}

struct File {
    path: PathBuf,
    out: AtomicFile,
    slices: Slices,
}

impl VoxelFile for File {
    fn add_slab(&mut self, first: usize, slab: &[&Array]) -> Result<(), Error> {
        match slab {
            [Array { values: Values::U8(rgba), .. }] => self.slices.add_slab(first, rgba),
            _ => Ok(()),
        }
    }

    fn finish(mut self: Box<Self>) -> Result<u64, Error> {
        png::write(&mut self.out, &[&self.slices]).map_err(AtomicFile::name_in(&self.path))?;
        self.out.commit()
    }
}
