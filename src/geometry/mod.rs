//! Points, boxes, rays, simplices and the signs of their determinants, in R^D for D = 3 and 4.
//!
//! A *simplex* of R^D has D vertices: a triangle in R^3, a tetrahedron in R^4. Coordinates are `f32`, as every
//! method of the crate takes the rounded coordinates as *the* geometry; arithmetic is `f64`.
//!
//! What is inside, outside or on a boundary is always decided by the sign of a determinant, and that sign is
//! exact (`sign.rs`): a cheap `f64` value with a bound on its rounding error settles nearly all of them, and
//! expansion arithmetic ([`Expansion`]) the rest. So every engine that asks the same question gets the same answer.
//!
//! Nothing here does I/O and nothing here knows of objects, images or occlusion.

mod aabb;
mod cone;
mod determinant;
mod dimension;
mod expansion;
mod frame;
mod ray;
mod sign;
mod simplex;

pub use aabb::Aabb;
pub use cone::{Cone, Crossing};
pub(crate) use determinant::{WideInteger, cofactors};
pub use determinant::{cross, determinant};
pub use dimension::Dimension;
pub use expansion::Expansion;
pub(crate) use expansion::{two_product, two_sum};
pub use frame::Frame;
pub use ray::Ray;
pub use sign::{Column, determinant_sign, exact_determinant};
pub use simplex::{is_degenerate, measure, normal_of, plane_side};

/// A point or vector of R^D in single precision: the stored geometry.
pub type Vector<const D: usize> = nalgebra::SVector<f32, D>;

/// A point or vector of R^D in double precision: intermediate values, and what generators compute with.
pub type Vector64<const D: usize> = nalgebra::SVector<f64, D>;

/// The same vector in double precision (exact).
#[inline]
pub fn widen<const D: usize>(v: &Vector<D>) -> Vector64<D> {
    v.map(f64::from)
}

/// The vector rounded to single precision, with `-0` made `+0` so that equal points have equal bits.
#[inline]
pub fn narrow<const D: usize>(v: &Vector64<D>) -> Vector<D> {
    v.map(|x| x as f32 + 0.0)
}
