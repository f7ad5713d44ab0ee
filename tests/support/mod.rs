//! What several tests make their scenes with.

use ao4d::geometry::Vector64;
use ao4d::mesh::{Mesh, MeshBuilder, Orientation, Surface};

/// A small generator, so that a failure can be repeated.
pub struct Random(pub u32);

impl Random {
    /// In [-1, 1), on a coarse grid with many coincidences if `coarse`.
    pub fn next(&mut self, coarse: bool) -> f64 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        if coarse {
            f64::from((self.0 >> 24) % 5) * 0.5 - 1.0
        } else {
            f64::from(self.0 >> 8) / f64::from(1 << 23) - 1.0
        }
    }

    /// A point of such coordinates.
    pub fn point<const D: usize>(&mut self, coarse: bool) -> Vector64<D> {
        Vector64::from_fn(|_, _| self.next(coarse))
    }

    /// Simplices without any order: each around a random point, within `size` of it along each axis.
    pub fn soup<const D: usize>(&mut self, count: usize, size: f64, coarse: bool) -> Surface<D> {
        let mut vertices = Vec::new();
        for _ in 0..count {
            let centre: Vector64<D> = self.point(coarse);
            vertices.extend((0..D).map(|_| centre + self.point(coarse) * size));
        }
        let simplices = (0..count).map(|s| std::array::from_fn(|i| (s * D + i) as u32)).collect();
        Surface { vertices, simplices, normals: None }
    }
}

/// A scene of one object.
pub fn mesh<const D: usize>(surface: &Surface<D>) -> Mesh<D> {
    let mut builder = MeshBuilder::new();
    builder.add("one", [1.0; 3], surface, Orientation::Input).unwrap();
    builder.finish()
}
