//! The dimension, sealed to 3 and 4, and what differs between the two.
//!
//! Code that is generic over `D` asks [`Dimension::of::<D>()`](Dimension::of) where the two differ, and matches on the
//! answer. The match is exhaustive, so there is no `else` that silently means one of them; for any other D the question
//! itself does not compile:
//!
//! ```compile_fail
//! let five = ao4d::geometry::Dimension::of::<5>();
//! ```
//!
//! A dimension that is known at run time only, as from a file, becomes one by [`Dimension::new`], which refuses others.

use std::f64::consts::PI;

/// The dimension of a space: 3 or 4.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Dimension {
    /// Surfaces of triangles in R^3.
    Three,
    /// Hypersurfaces of tetrahedra in R^4.
    Four,
}

impl Dimension {
    /// The dimension of code that is generic over D. Costs nothing at run time.
    #[inline(always)]
    pub const fn of<const D: usize>() -> Self {
        const {
            match D {
                3 => Self::Three,
                4 => Self::Four,
                _ => panic!("ao4d works in 3 and 4 dimensions"),
            }
        }
    }

    /// The dimension that a number means, if it is 3 or 4.
    pub const fn new(number: u64) -> Option<Self> {
        match number {
            3 => Some(Self::Three),
            4 => Some(Self::Four),
            _ => None,
        }
    }

    /// The number: 3 or 4.
    #[inline]
    pub const fn get(self) -> usize {
        self.pick(3, 4)
    }

    /// The first value in three dimensions, the second in four.
    #[inline(always)]
    pub const fn pick<T: Copy>(self, three: T, four: T) -> T {
        match self {
            Self::Three => three,
            Self::Four => four,
        }
    }

    /// The axes' names, in order.
    pub const fn axes(self) -> &'static [&'static str] {
        self.pick(&["x", "y", "z"], &["x", "y", "z", "w"])
    }

    /// What a simplex of a surface is called.
    pub const fn simplex(self) -> &'static str {
        self.pick("triangle", "tetrahedron")
    }

    /// What the facet of such a simplex is called.
    pub const fn facet(self) -> &'static str {
        self.pick("edge", "triangle")
    }

    /// (D-1)!: how many simplices a cube of D - 1 dimensions is cut into, and how many times the measure of a simplex
    /// that of the parallelotope over its edges is.
    pub const fn simplices_a_cube(self) -> u32 {
        self.pick(2, 6)
    }

    /// The measure of the horizon of a shading point, all directions of its tangent hyperplane: 2 pi or 4 pi.
    pub const fn horizon_measure(self) -> f64 {
        self.pick(2.0, 4.0) * PI
    }
}

impl serde::Serialize for Dimension {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.get().serialize(serializer)
    }
}

impl std::fmt::Display for Dimension {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.get().fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_two() {
        for (number, known) in [(0, false), (2, false), (3, true), (4, true), (5, false), (u64::MAX, false)] {
            let found = Dimension::new(number);
            assert_eq!(found.map(|d| d.get() as u64), known.then_some(number));
            assert_eq!(found.map(|d| d.axes().len()), known.then_some(number as usize));
        }
        assert_eq!([Dimension::of::<3>(), Dimension::of::<4>()], [Dimension::Three, Dimension::Four]);
    }
}
