//! Pieces: a run shared by many processes, on one machine or many, that need not know of each other.
//!
//! Piece K of N makes the K-th share of everything that can be shared: a slab of layers of each picture, a range of the
//! vertices wherever a file wants the values of all of them, a range of an animation's frames. It works in a folder of its
//! own, `pieces-N/K` below the pipeline's, with a lock and a cache of its own, and writes into no other. What it makes
//! depends on the pipeline, K and N alone; so a piece that died is made again by itself, anywhere.
//!
//! - The shares are told here, with where they lie.
//! - `values` keeps the values of a share of vertices.
//! - `record` keeps what is known of a part of a picture beside its voxels.
//! - `joined` finds the parts again, for `ao4d merge`, which makes of them the files that one process would have made.
//!
//! What takes no time, or would be needed as a whole by every piece (slices, wireframes, figures), is made when pieces are joined.

mod joined;
mod record;
mod values;

use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::str::FromStr;

pub use joined::Joined;
pub use record::{Bits, Record};
pub use values::Values;

/// The most pieces.
pub const MOST: usize = 1_000_000;

/// Which piece of a run, of how many.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Piece {
    index: usize,
    count: usize,
}

/// Layers of a picture that are a piece's.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Slab {
    /// Those that are its own.
    pub own: Range<usize>,
    /// Behind the last that it writes: the first layer of the next piece is in both, since VTK's cells lie between points.
    pub end: usize,
}

impl Slab {
    /// The layers that it writes.
    pub fn layers(&self) -> Range<usize> {
        self.own.start..self.end
    }

    /// The layers that are looked at for it, if filters look at so many before and behind each.
    pub fn looked_at(&self, reach: usize, layers: usize) -> Range<usize> {
        self.own.start.saturating_sub(reach)..layers.min(self.end + reach)
    }
}

impl Piece {
    /// Piece `index` of `count`, from 0.
    ///
    /// # Errors
    /// What is wrong with the numbers.
    pub fn new(index: usize, count: usize) -> Result<Self, String> {
        match (index, count) {
            (_, 0) => Err("there are no 0 pieces; a run has at least one".to_owned()),
            (_, n) if n > MOST => Err(format!("expected at most {MOST} pieces, found {n}")),
            (k, n) if k >= n => {
                Err(format!("there is no piece {k} of {n}; pieces are counted from 0, so the last is {}/{n}", n - 1))
            }
            _ => Ok(Self { index, count }),
        }
    }

    /// All pieces of a run of so many.
    pub fn all(count: usize) -> impl Iterator<Item = Self> {
        (0..count).map(move |index| Self { index, count })
    }

    /// Its number, from 0.
    pub fn index(self) -> usize {
        self.index
    }

    /// How many there are.
    pub fn count(self) -> usize {
        self.count
    }

    /// Its share of so many things in a row: as many as any other's, or one more.
    pub fn share(self, things: usize) -> Range<usize> {
        let begin = |k: usize| (things as u128 * k as u128 / self.count as u128) as usize;
        begin(self.index)..begin(self.index + 1)
    }

    /// Whether it makes the thing of this number by itself.
    pub fn owns(self, thing: usize) -> bool {
        thing % self.count == self.index
    }

    /// Its layers of the picture of this number, which has so many in all; none where there are too few for all pieces.
    /// Pictures of few layers begin with another piece each, so that not all fall to the same.
    pub fn layers(self, layers: usize, picture: usize) -> Option<Slab> {
        let place = if layers < self.count { (self.index + picture) % self.count } else { self.index };
        let own = Self { index: place, ..self }.share(layers);
        let end = layers.min(own.end + 1);
        (!own.is_empty()).then_some(Slab { own, end })
    }

    /// The pieces that have layers of a picture, in the order of those.
    pub fn of_picture(count: usize, layers: usize, picture: usize) -> Vec<(Self, Slab)> {
        let mut parts: Vec<_> =
            Self::all(count).filter_map(|piece| Some((piece, piece.layers(layers, picture)?))).collect();
        parts.sort_by_key(|(_, slab)| slab.own.start);
        parts
    }

    /// Where it works, for a pipeline whose files go into `out`.
    pub fn folder(self, out: &Path) -> PathBuf {
        folder(out, self.count).join(self.index.to_string())
    }
}

impl fmt::Display for Piece {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

impl FromStr for Piece {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.parse::<usize>().ok().filter(|_| text.bytes().all(|b| b.is_ascii_digit()));
        let pair = text.split_once('/').and_then(|(k, n)| Some((number(k)?, number(n)?)));
        let (k, n) = pair.ok_or("expected K/N, such as 0/4 to 3/4, or none")?;
        Self::new(k, n)
    }
}

/// Where the pieces of a run of so many lie.
pub fn folder(out: &Path, count: usize) -> PathBuf {
    out.join(format!("{FOLDER}{count}"))
}

/// What the names of those folders begin with.
pub const FOLDER: &str = "pieces-";

/// What stands for a file that has no parts in its own format.
pub fn stand_in(file: &Path) -> PathBuf {
    hidden(file, "vti")
}

/// The file that tells what is known of a part beside its voxels.
pub fn record_of(part: &Path) -> PathBuf {
    hidden(part, "part")
}

/// The file that has the values of a share of the vertices, for the occlusion of this number.
pub fn values_of(occlusion: usize) -> PathBuf {
    PathBuf::from(format!(".occlusion-{occlusion}.values"))
}

/// The list of the parts of an image or mesh.
pub fn list_of(file: &Path) -> PathBuf {
    let extension = file.extension().unwrap_or_default().to_string_lossy();
    file.with_extension(format!("p{extension}"))
}

/// Where another piece's file lies, as the file of the same name of any piece names it.
pub fn beside(file: &Path, piece: Piece) -> String {
    let up = "../".repeat(file.components().count());
    let names: Vec<String> = file.components().map(|c| c.as_os_str().to_string_lossy().into_owned()).collect();
    format!("{up}{}/{}", piece.index, names.join("/"))
}

/// A name that no pipeline can give.
fn hidden(file: &Path, extension: &str) -> PathBuf {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    file.with_file_name(format!(".{name}.{extension}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_written_k_of_n() {
        assert_eq!("2/4".parse(), Piece::new(2, 4));
        for text in [
            "",
            "1",
            "1/",
            "/2",
            "a/b",
            "1/2/3",
            "-1/2",
            "+1/2",
            "1 /2",
            "4/4",
            "0/0",
            "0/1000001",
            "0/99999999999999999999",
        ] {
            assert!(text.parse::<Piece>().is_err(), "{text}");
        }
        assert!("4/4".parse::<Piece>().unwrap_err().contains("the last is 3/4"));
    }

    #[test]
    fn shares_have_all_and_nothing_twice() {
        for count in [1, 2, 3, 7, 64, 1000] {
            for things in [0, 1, 5, 64, 100, 12_345] {
                let all: Vec<usize> = Piece::all(count).flat_map(|piece| piece.share(things)).collect();
                assert_eq!(all, (0..things).collect::<Vec<_>>());
                let lengths: Vec<usize> = Piece::all(count).map(|piece| piece.share(things).len()).collect();
                let (least, most) = (lengths.iter().min().unwrap(), lengths.iter().max().unwrap());
                assert!(most - least <= 1);
            }
        }
        assert_eq!(Piece::new(1, 2).unwrap().share(usize::MAX).end, usize::MAX);
    }

    #[test]
    fn parts_of_pictures_touch_and_those_of_few_layers_fall_to_different_pieces() {
        for (count, layers, picture) in [(4, 17, 0), (4, 4, 3), (16, 5, 2), (3, 1, 1), (1, 9, 5)] {
            let parts = Piece::of_picture(count, layers, picture);
            assert_eq!(parts.len(), count.min(layers));
            assert_eq!(
                parts.iter().flat_map(|(_, slab)| slab.own.clone()).collect::<Vec<_>>(),
                (0..layers).collect::<Vec<_>>()
            );
            for pair in parts.windows(2) {
                assert_eq!(pair[0].1.end, pair[1].1.own.start + 1);
            }
            assert_eq!(parts[parts.len() - 1].1.end, layers);
        }
        let of = |picture: usize| Piece::of_picture(4, 1, picture)[0].0.index();
        assert_eq!((0..5).map(of).collect::<Vec<_>>(), [3, 2, 1, 0, 3]);
    }

    #[test]
    fn files_name_those_of_other_pieces() {
        let piece = Piece::new(3, 4).unwrap();
        assert_eq!(beside(Path::new("a.vti"), piece), "../3/a.vti");
        assert_eq!(beside(Path::new("b/a.vti"), piece), "../../3/b/a.vti");
        assert_eq!(list_of(Path::new("b/a.vti")), Path::new("b/a.pvti"));
        assert_eq!(record_of(Path::new("b/a.vti")), Path::new("b/.a.vti.part"));
        assert_eq!(piece.folder(Path::new("out/p")), Path::new("out/p/pieces-4/3"));
    }
}
