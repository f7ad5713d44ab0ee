//! The open files of one picture: each slab goes to all of them.

use std::path::{Path, PathBuf};

use super::{Content, Opening, VoxelFile, WritePlan};
use crate::io::Error;
use crate::render::Channel;
use crate::stages::render::RenderPlan;
use crate::stages::{Plan, Ref};
use crate::volume::{Array, Grid, Values};

/// The open files of one picture.
pub(in crate::stages) struct PictureFiles {
    channels: Vec<Channel>,
    files: Vec<Open>,
}

struct Open {
    path: PathBuf,
    file: Box<dyn VoxelFile>,
    /// Where among the channels its arrays are.
    places: Vec<usize>,
}

impl PictureFiles {
    /// Opens those files of a render that have to be made.
    pub fn create(
        render: Ref<RenderPlan>,
        plan: &Plan,
        stale: &dyn Fn(&Path) -> bool,
        grid: &Grid,
        mesh_hash: &str,
    ) -> Result<Self, Error> {
        // What is seen is counted by opacity, so that is always made.
        let mut channels = vec![Channel::Opacity];
        let mut place = |channel: Channel| {
            channels.iter().position(|&c| c == channel).unwrap_or_else(|| {
                channels.push(channel);
                channels.len() - 1
            })
        };
        let mut files = Vec::new();
        for (_, write) in plan.all::<WritePlan>().filter(|(_, write)| write.render == render) {
            for file in write.stale(Content::Voxels, stale) {
                let path = plan.out.join(&file.path);
                let opened = file.format.open(Opening { path: &path, plan, write, grid, mesh_hash })?;
                let places = file.format.arrays(write).into_iter().map(&mut place).collect();
                files.extend(opened.map(|opened| Open { path: file.path.clone(), file: opened, places }));
            }
        }
        Ok(Self { channels, files })
    }

    /// What the files need of each slab, in this order.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// Writes some layers to all files; returns how many of their voxels see something.
    pub fn add_slab(&mut self, first: usize, slab: &[Array]) -> Result<u64, Error> {
        for Open { file, places, .. } in &mut self.files {
            let arrays: Vec<&Array> = places.iter().map(|&place| &slab[place]).collect();
            file.add_slab(first, &arrays)?;
        }
        Ok(match slab.first().map(|opacity| &opacity.values) {
            Some(Values::F32(opacity)) => opacity.iter().filter(|&&o| o > 0.0).count() as u64,
            _ => 0,
        })
    }

    /// Completes the files and gives them their names; returns each with its length.
    pub fn finish(self) -> Result<Vec<(PathBuf, u64)>, Error> {
        self.files.into_iter().map(|Open { path, file, .. }| Ok((path, file.finish()?))).collect()
    }
}
