//! `.raw`: colours alone, without a header, as the thesis had them.

use std::path::{Path, PathBuf};

use super::{Content, Image, LeftOut, Opening, OutputFormat, VoxelFile, WritePlan};
use crate::io::raw::RawWriter;
use crate::io::{AtomicFile, Error};
use crate::render::Aov;
use crate::volume::{Array, Kind, Values};

pub(super) struct Raw;

impl OutputFormat for Raw {
    const CONTENT: Content = Content::Voxels;
    const LEFT_OUT: &'static [LeftOut] = &[
        LeftOut::new("/arrays", "about `.vti` only; a `.raw` has colours"),
        LeftOut::new("/encoding", "about `.vti` only"),
        LeftOut::new("/compression", "about `.vti` only"),
    ];

    fn arrays(_: &WritePlan) -> Vec<Aov> {
        vec![Aov::Rgb]
    }

    fn voxel_bytes(_: &WritePlan, image: Image) -> u64 {
        image.bytes(Aov::Rgb)
    }

    fn read_part(path: &Path, _: &WritePlan, _: Image, voxels: usize) -> Result<Vec<Array>, Error> {
        let failed = |cause| Error::File { path: path.to_owned(), action: "be used as a part", cause };
        let bytes = crate::input::read(path).map_err(failed)?;
        if bytes.len() as u128 != 12 * voxels as u128 {
            return Err(failed(std::io::Error::other(format!("it has {} bytes, not {voxels} times 12", bytes.len()))));
        }
        Ok(vec![Array::new(Aov::Rgb.name(), 3, Kind::F32.decode(&bytes, true))])
    }

    fn open(Opening { path, grid, .. }: Opening) -> Result<Option<Box<dyn VoxelFile>>, Error> {
        let writer = RawWriter::new(AtomicFile::create(path)?, grid);
        Ok(Some(Box::new(File { path: path.to_owned(), writer })))
    }
}

struct File {
    path: PathBuf,
    writer: RawWriter<AtomicFile>,
}

impl VoxelFile for File {
    fn add_slab(&mut self, first: usize, slab: &[&Array]) -> Result<(), Error> {
        if let [Array { values: Values::F32(rgb), .. }] = slab {
            self.writer.write_slab(first, rgb).map_err(AtomicFile::name_in(&self.path))?;
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<u64, Error> {
        self.writer.finish().map_err(AtomicFile::name_in(&self.path))?.commit()
    }
}
