//! The values of a share of a scene's vertices, as a piece keeps them until all are joined.
//!
//! The file is a line of JSON that says what there is, and the numbers behind it, little-endian: values, errors, and where
//! they were asked for, directions.

use std::ops::Range;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::io::Error;

/// The values of a share of a scene's vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Values {
    /// The first vertex.
    pub first: usize,
    /// Ambient occlusion.
    pub values: Vec<f32>,
    /// The standard errors.
    pub errors: Vec<f32>,
    /// Rays asked for them.
    pub rays: u64,
    /// The coordinates of the vectors b, vertex by vertex; none where nobody asked for them.
    pub vectors: Vec<f32>,
}

/// What the file says before its numbers.
#[derive(Serialize, Deserialize)]
struct Head {
    first: usize,
    count: usize,
    rays: u64,
    vectors: usize,
}

impl Values {
    /// Which vertices.
    pub fn range(&self) -> Range<usize> {
        self.first..self.first + self.values.len()
    }

    /// As a file has them.
    pub fn to_bytes(&self) -> Vec<u8> {
        let head = Head { first: self.first, count: self.values.len(), rays: self.rays, vectors: self.vectors.len() };
        let mut bytes = serde_json::to_vec(&head).unwrap_or_default();
        bytes.push(b'\n');
        for x in self.values.iter().chain(&self.errors).chain(&self.vectors) {
            bytes.extend(x.to_le_bytes());
        }
        bytes
    }

    /// Reads them.
    ///
    /// # Errors
    /// If there are none, or the file is damaged.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let failed = |cause| Error::File { path: path.to_owned(), action: "be read", cause };
        let bytes = crate::input::read(path).map_err(failed)?;
        Self::parse(&bytes).ok_or_else(|| failed(std::io::Error::other("it holds no values of vertices")))
    }

    fn parse(bytes: &[u8]) -> Option<Self> {
        let end = bytes.iter().position(|&b| b == b'\n')?;
        let Head { first, count, rays, vectors } = serde_json::from_slice(&bytes[..end]).ok()?;
        let numbers = &bytes[end + 1..];
        if numbers.len() as u128 != 4 * (2 * count as u128 + vectors as u128) || first.checked_add(count).is_none() {
            return None;
        }
        let mut numbers = numbers.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        let mut take = |n: usize| numbers.by_ref().take(n).collect::<Vec<f32>>();
        Some(Self { first, values: take(count), errors: take(count), rays, vectors: take(vectors) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_come_back_or_are_refused() {
        let values =
            Values { first: 7, values: vec![0.5, 1.0], errors: vec![0.0, f32::NAN], rays: 512, vectors: vec![1.0; 8] };
        let bytes = values.to_bytes();
        let again = Values::parse(&bytes).unwrap();
        assert_eq!((again.range(), again.rays, again.vectors.len()), (7..9, 512, 8));
        assert_eq!(again.to_bytes(), bytes);
        assert!(Values::parse(&bytes[..bytes.len() - 1]).is_none());
        assert!(Values::parse(b"").is_none());
        let huge = format!("{{\"first\":{0},\"count\":{0},\"rays\":0,\"vectors\":{0}}}\n", usize::MAX);
        assert!(Values::parse(huge.as_bytes()).is_none());
    }
}
