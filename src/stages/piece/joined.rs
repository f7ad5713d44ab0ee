//! The parts of all pieces of a run, for whoever makes whole files of them.

use std::path::{Path, PathBuf};

use super::{Piece, Slab, Values};
use crate::io::Error;

/// The pieces of a run, all of which are there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Joined {
    /// The pipeline's own output folder.
    out: PathBuf,
    count: usize,
}

impl Joined {
    /// The pieces of a run of so many, whose files go into `out`.
    pub fn new(out: &Path, count: usize) -> Self {
        Self { out: out.to_owned(), count }
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Where a piece's file is.
    pub fn path(&self, piece: Piece, file: &Path) -> PathBuf {
        piece.folder(&self.out).join(file)
    }

    /// Where the file is that one piece made as a whole: the thing of this number, of so many that are shared in ranges.
    pub fn whole(&self, file: &Path, thing: usize, things: usize) -> Option<PathBuf> {
        let owner = Piece::all(self.count).find(|piece| piece.share(things).contains(&thing));
        owner.map(|piece| self.path(piece, file))
    }

    /// The same of what is shared one by one.
    pub fn owned(&self, file: &Path, thing: usize) -> PathBuf {
        let piece = Piece { index: thing % self.count, count: self.count };
        self.path(piece, file)
    }

    /// The parts of a picture, in the order of their layers.
    pub fn picture(&self, layers: usize, picture: usize) -> Vec<(Piece, Slab)> {
        Piece::of_picture(self.count, layers, picture)
    }

    /// The values of all of so many vertices.
    ///
    /// # Errors
    /// If some can't be read, or are of others than they should be.
    pub fn values(&self, occlusion: usize, vertices: usize) -> Result<Values, Error> {
        let mut all = Values::default();
        for piece in Piece::all(self.count) {
            let path = self.path(piece, &super::values_of(occlusion));
            let part = Values::read(&path)?;
            if part.range() != piece.share(vertices) {
                let cause = std::io::Error::other(format!(
                    "it has the vertices {:?}, not {:?}",
                    part.range(),
                    piece.share(vertices)
                ));
                return Err(Error::File { path, action: "be used", cause });
            }
            all.rays += part.rays;
            all.values.extend(part.values);
            all.errors.extend(part.errors);
            all.vectors.extend(part.vectors);
        }
        Ok(all)
    }
}
