//! The local frame of a shading point: one reflection that takes the last axis to the normal.

use super::Vector;

/// A Householder reflection that maps e_D to a unit vector n; where n is near e_D itself, it maps e_D to -n and the
/// sign is turned afterwards, so that no digits cancel. The order of the operations is fixed: every backend gets the
/// same bits.
#[derive(Clone, Copy, Debug)]
pub struct Frame<const D: usize> {
    axis: Vector<D>,
    factor: f32,
    turned: bool,
}

impl<const D: usize> Frame<D> {
    /// The frame of a unit normal.
    pub fn new(normal: &Vector<D>) -> Self {
        let turned = normal[D - 1] > 0.0;
        let mut axis = if turned { *normal } else { -normal };
        axis[D - 1] += 1.0;
        let mut square = 0.0;
        for x in axis.iter() {
            square += x * x;
        }
        Self { axis, factor: 2.0 / square, turned }
    }

    /// The axis a of the reflection, the factor 2 / a.a, and whether the sign is turned: what [`Frame::to_world`]
    /// works with, for code that turns many directions at once by the same operations.
    pub fn parts(&self) -> (&Vector<D>, f32, bool) {
        (&self.axis, self.factor, self.turned)
    }

    /// A local direction, whose last component is along the normal, in the coordinates of the scene.
    #[inline]
    pub fn to_world(&self, local: &Vector<D>) -> Vector<D> {
        let mut product = 0.0;
        for i in 0..D {
            product += self.axis[i] * local[i];
        }
        let scale = self.factor * product;
        let mut world = Vector::zeros();
        for i in 0..D {
            let x = local[i] - scale * self.axis[i];
            world[i] = if self.turned { -x } else { x };
        }
        world
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check<const D: usize>() {
        let up = Vector::<D>::from_fn(|r, _| f32::from(r == D - 1));
        let mut normals = vec![up, -up];
        normals.extend((0..40).map(|k| {
            Vector::<D>::from_fn(|r, _| {
                ((k * 7 + r * 13) % 11) as f32 - 4.9 + if r == D - 1 { 1e3 } else { 0.0 } * f32::from(k % 3 == 0)
            })
            .normalize()
        }));
        for normal in normals {
            let frame = Frame::new(&normal);
            assert!((frame.to_world(&up) - normal).norm() < 1e-6);
            for k in 0..D {
                let axis = Vector::<D>::from_fn(|r, _| f32::from(r == k));
                let image = frame.to_world(&axis);
                assert!((image.norm() - 1.0).abs() < 1e-6);
                assert!((image.dot(&normal) - axis.dot(&up)).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn frame_is_an_isometry_that_takes_the_last_axis_to_the_normal() {
        check::<3>();
        check::<4>();
    }
}
