//! Files that are nothing but floats, `.raw` and `.f32`, of any length: looked at block by block.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use super::compare::{Comparison, Differences, Tolerance};
use super::range::Tally;
use super::{ArraySummary, Error};
use crate::volume::{Kind, Values};

/// Numbers of a block: a multiple of three.
const BLOCK: usize = 3 << 14;

/// A file of floats.
pub(super) struct Floats {
    path: PathBuf,
    file: BufReader<File>,
    /// How many floats are left.
    left: usize,
}

impl Floats {
    /// Opens a file, whose length is to be a multiple of `unit` bytes.
    ///
    /// # Errors
    /// If it can't be opened, or has another length.
    pub fn open(path: &Path, unit: usize, why: &'static str) -> Result<Self, Error> {
        let failed = |cause| Error::Open { path: path.into(), cause };
        let found = crate::input::length(path).map_err(failed)? as usize;
        if found == 0 || !found.is_multiple_of(unit) {
            return Err(Error::Length { path: path.into(), found, unit, why });
        }
        let file = BufReader::new(crate::input::open(path).map_err(failed)?);
        Ok(Self { path: path.into(), file, left: found / size_of::<f32>() })
    }

    /// The next numbers, none at the end.
    fn block(&mut self) -> Result<Values, Error> {
        let mut bytes = vec![0; self.left.min(BLOCK) * size_of::<f32>()];
        self.left -= bytes.len() / size_of::<f32>();
        self.file.read_exact(&mut bytes).map_err(|cause| Error::Open { path: self.path.clone(), cause })?;
        Ok(Kind::F32.decode(&bytes, true))
    }

    /// What its numbers are like, of so many components.
    ///
    /// # Errors
    /// If reading fails.
    pub fn summary(mut self, name: &str, components: usize) -> Result<ArraySummary, Error> {
        let tuples = self.left / components;
        let mut tallies = vec![Tally::default(); components];
        while self.left > 0 {
            let block = self.block()?;
            (0..block.len()).for_each(|i| tallies[i % components].add(block.get(i)));
        }
        let ranges = tallies.into_iter().map(Tally::range).collect();
        Ok(ArraySummary { name: name.into(), kind: Kind::F32, components, tuples, ranges, histogram: Vec::new() })
    }

    /// How far the numbers of two files are apart.
    ///
    /// # Errors
    /// If reading fails.
    pub fn compare(mut self, mut other: Self, name: &str, tolerance: &Tolerance) -> Result<Comparison, Error> {
        if self.left != other.left {
            let message = format!("array `{name}` has {} and {} numbers", self.left, other.left);
            return Ok(Comparison { differences: vec![message], ..Comparison::default() });
        }
        let limits = tolerance.of(name);
        let mut differences = Differences::default();
        while self.left > 0 {
            differences.add(&self.block()?, &other.block()?, &limits);
        }
        Ok(Comparison::of(differences.finish(name, 1, None, &limits)))
    }
}
