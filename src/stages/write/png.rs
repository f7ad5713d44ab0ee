//! `.png`: a quick look at three slices, without ParaView.

use std::io::Read;
use std::path::{Path, PathBuf};

use super::{Content, Image, LeftOut, Opening, OutputFormat, Retell, VoxelFile, WritePlan, copy_over, vti};
use crate::io::png::{self, Slices};
use crate::io::{AtomicFile, Error, PIPELINE};
use crate::render::Aov;
use crate::stages::piece;
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

    const RETELL: Option<Retell> = Some(|path, _, text| {
        copy_over(path, |mut source, out| {
            let mut bytes = Vec::new();
            source.read_to_end(&mut bytes)?;
            png::retell(&bytes, out, (PIPELINE, text))
        })
    });

    /// The colours of its layers.
    fn part(file: &Path) -> PathBuf {
        piece::stand_in(file)
    }

    fn open_part(Opening { path, grid, first_layer, .. }: Opening) -> Result<Option<Box<dyn VoxelFile>>, Error> {
        vti::open_colours(path, grid, first_layer)
    }

    fn read_part(path: &Path, _: &WritePlan, _: Image, voxels: usize) -> Result<Vec<Array>, Error> {
        vti::read_colours(path, voxels)
    }

    fn open(Opening { path, grid, told, .. }: Opening) -> Result<Option<Box<dyn VoxelFile>>, Error> {
        let out = AtomicFile::create(path)?;
        Ok(Some(Box::new(File { path: path.to_owned(), out, slices: Slices::new(grid), told: told.to_owned() })))
    }
}

struct File {
    path: PathBuf,
    out: AtomicFile,
    slices: Slices,
    told: String,
}

impl VoxelFile for File {
    fn add_slab(&mut self, first: usize, slab: &[&Array]) -> Result<(), Error> {
        match slab {
            [Array { values: Values::U8(rgba), .. }] => self.slices.add_slab(first, rgba),
            _ => Ok(()),
        }
    }

    fn finish(mut self: Box<Self>) -> Result<u64, Error> {
        let text = Some((PIPELINE, &*self.told));
        png::write_told(&mut self.out, &[&self.slices], text).map_err(AtomicFile::name_in(&self.path))?;
        self.out.commit()
    }
}
