//! What is known of a part of a picture beside its voxels: how many see something, and which of them may be looked at again.
//!
//! Floats are kept as their bits, so that none is another when it is read.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::geometry::Vector;
use crate::io::Error;
use crate::render::Checked;

/// What is known of a part of a picture.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Its own layers: the first, and the one behind the last.
    pub layers: [usize; 2],
    /// How many of their voxels see something.
    pub seen: u64,
    /// How many of those see a surface from behind, with the occlusion of its front.
    pub behind: u64,
    /// Voxels that may be looked at again, to measure how far off the picture is.
    pub checked: Vec<Bits>,
}

/// A voxel as its number, its simplex, and the bits of its position, its normal and the occlusion that it shows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bits(u64, u32, Vec<u32>);

impl Bits {
    /// The bits of a voxel.
    pub fn new<const D: usize>(checked: &Checked<D>) -> Self {
        let numbers = checked.position.iter().chain(checked.normal.iter()).chain([&checked.shown]);
        Self(checked.number, checked.simplex, numbers.map(|x| x.to_bits()).collect())
    }

    /// The voxel, if it is one of this dimension.
    pub fn checked<const D: usize>(&self) -> Option<Checked<D>> {
        let Self(number, simplex, bits) = self;
        if bits.len() != 2 * D + 1 {
            return None;
        }
        let at = |i: usize| f32::from_bits(bits[i]);
        let (position, normal) = (Vector::from_fn(|r, _| at(r)), Vector::from_fn(|r, _| at(D + r)));
        Some(Checked { number: *number, simplex: *simplex, position, normal, shown: at(2 * D) })
    }
}

impl Record {
    /// As a file has it.
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).unwrap_or_default()
    }

    /// Reads it.
    ///
    /// # Errors
    /// If there is none.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let failed = |cause| Error::File { path: path.to_owned(), action: "be read", cause };
        let text = crate::input::read_text(path).map_err(failed)?;
        serde_json::from_str(&text).map_err(|error| failed(std::io::Error::other(error.to_string())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bit_comes_back() {
        let numbers = [0.1, -0.0, f32::MIN_POSITIVE / 3.0, 1e38];
        let checked = Checked::<4> {
            number: u64::MAX,
            simplex: u32::MAX,
            position: Vector::from_fn(|r, _| numbers[r]),
            normal: Vector::from_fn(|r, _| 1.0 / numbers[3 - r]),
            shown: f32::NAN,
        };
        let record = Record { layers: [3, 7], seen: 1, behind: 0, checked: vec![Bits::new(&checked)] };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("record");
        std::fs::write(&path, record.to_json()).unwrap();
        let again = Record::read(&path).unwrap();
        assert_eq!(again, record);
        assert_eq!(Bits::new(&again.checked[0].checked::<4>().unwrap()), record.checked[0]);
        assert!(again.checked[0].checked::<3>().is_none());
        std::fs::write(&path, "{}").unwrap();
        assert!(Record::read(&path).is_err());
    }
}
