//! Simplicial hypersurfaces: the surface a generator or a reader makes, and the mesh a scene is traced as.
//!
//! A [`Surface`] is what one object is made of, in `f64` and in its own coordinates. [`MeshBuilder`] places surfaces
//! side by side into one [`Mesh`] and rounds them to `f32` once. From then on the mesh is the geometry, for every
//! method, and its vertices are never renumbered: vertex 7 of the input is vertex 7 of every file.
//!
//! What the builder finds out about the surface, each in a file of its own:
//! - [`identity`]: points with identical coordinates are one point, for intersection across all objects and for
//!   normals within one;
//! - [`copies`]: simplices that lie one on the other;
//! - [`orientation`]: which components are closed, and which side of them is outside;
//! - [`normals`]: measure-weighted vertex normals;
//! - [`rounding`]: which simplices turn over when rounded;
//! - [`corners`]: where the surface creases, and vertices are split so that each side has a normal of its own;
//! - [`crossings`]: where a closed surface passes through itself;
//! - simplices of measure zero, which no ray can hit.
//!
//! What is made of a mesh for the eye: cross-sections ([`section`]), peels of hyperspheres ([`peel`]) and wireframes
//! ([`edges`]), and where the stereographic projection leads them ([`stereographic`]).

mod approach;
mod build;
pub mod copies;
pub mod corners;
pub mod crossings;
pub mod edges;
mod error;
pub mod facets;
pub mod identity;
mod incidence;
mod nesting;
pub mod normals;
pub mod orientation;
pub mod peel;
pub mod rounding;
pub mod section;
pub mod stereographic;
mod surface;
pub mod topology;
mod union_find;
pub mod weld;

use std::ops::Range;

use sha2::{Digest, Sha256};

use crate::geometry::{Aabb, Vector};

pub use approach::approach;
pub use build::MeshBuilder;
pub use copies::Copies;
pub use corners::Crease;
pub use error::MeshError;
pub use incidence::Incidence;
pub use orientation::{Orientation, Viewpoint};
pub use surface::Surface;
pub use union_find::UnionFind;

/// How an object reflects lights in highlights, as far as it differs from what a picture says of all.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gloss {
    /// The share of a light that is reflected so, 0 to 1.
    pub specular: Option<f64>,
    /// The exponent of the highlights: the higher, the smaller they are.
    pub shininess: Option<f64>,
}

/// One object of a scene: which vertices and simplices of the mesh are its own, and how it looks.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// Its name in the pipeline.
    pub name: String,
    /// Linear RGB, each 0 to 1.
    pub color: [f32; 3],
    /// The share of light that each of its surfaces keeps from passing, 0 to 1.
    pub opacity: f32,
    /// How it reflects lights, where it is not as the picture says.
    pub gloss: Gloss,
    /// Its vertices.
    pub vertices: Range<usize>,
    /// Its simplices.
    pub simplices: Range<usize>,
    /// Components connected through facets.
    pub components: usize,
    /// How many of them are closed and orientable.
    pub closed_components: usize,
}

impl Object {
    /// Whether it bounds a solid: all its components are closed.
    pub fn is_closed(&self) -> bool {
        self.components > 0 && self.closed_components == self.components
    }
}

/// All objects of a scene as one list of simplices over one list of vertices, in `f32`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh<const D: usize> {
    /// The points; finite.
    pub vertices: Vec<Vector<D>>,
    /// Unit normals, one a vertex; zero where no simplex gives one.
    pub normals: Vec<Vector<D>>,
    /// The lowest vertex with the same coordinates, one a vertex.
    pub identity: Vec<u32>,
    /// D vertices each, in the order that orients them.
    pub simplices: Vec<[u32; D]>,
    /// The simplices of measure zero, ascending. They are kept, but nothing hits them.
    pub degenerate: Vec<u32>,
    /// The simplices of positive measure that lie on others. They are kept, but rays hit the first of each place.
    pub copies: Copies,
    /// The simplices that rounding to `f32` turned over or made flat, ascending.
    pub turned_over: Vec<u32>,
    /// The objects, in order; their ranges cover all vertices and all simplices.
    pub objects: Vec<Object>,
}

impl<const D: usize> Mesh<D> {
    /// The corners of a simplex.
    #[inline]
    pub fn corners(&self, simplex: u32) -> [Vector<D>; D] {
        self.simplices[simplex as usize].map(|v| self.vertices[v as usize])
    }

    /// The corners of a simplex, as numbers that are the same only if the points are.
    #[inline]
    pub fn places_of(&self, simplex: u32) -> [u32; D] {
        self.simplices[simplex as usize].map(|v| self.identity[v as usize])
    }

    /// The index of the object that a simplex belongs to.
    #[inline]
    pub fn object_of(&self, simplex: u32) -> usize {
        self.objects.partition_point(|o| o.simplices.end <= simplex as usize)
    }

    /// Whether light passes through any object.
    pub fn is_translucent(&self) -> bool {
        self.objects.iter().any(|object| object.opacity < 1.0)
    }

    /// The box around all vertices that a simplex uses.
    pub fn bounds(&self) -> Aabb<D> {
        Aabb::of(self.simplices.iter().flatten().map(|&v| &self.vertices[v as usize]))
    }

    /// SHA-256 over everything that decides a value at a vertex: points, normals and simplices, and what light passes
    /// through. Hexadecimal.
    pub fn content_hash(&self) -> String {
        let mut hash = Sha256::new();
        hash.update([D as u8]);
        for points in [&self.vertices, &self.normals] {
            hash_words(&mut hash, points.len(), points.iter().flatten().map(|x| x.to_le_bytes()));
        }
        hash_words(&mut hash, self.simplices.len(), self.simplices.iter().flatten().map(|i| i.to_le_bytes()));
        if self.is_translucent() {
            for object in &self.objects {
                hash.update((object.simplices.end as u64).to_le_bytes());
                hash.update(object.opacity.to_le_bytes());
            }
        }
        hash.finalize().iter().map(|b| format!("{b:02x}")).collect()
    }
}

/// Feeds a count and then the words to the hash, in blocks.
fn hash_words(hash: &mut Sha256, count: usize, words: impl Iterator<Item = [u8; 4]>) {
    hash.update((count as u64).to_le_bytes());
    let mut block = Vec::with_capacity(1 << 16);
    for word in words {
        block.extend_from_slice(&word);
        if block.len() == 1 << 16 {
            hash.update(&block);
            block.clear();
        }
    }
    hash.update(&block);
}
