//! The kernels' text, and what becomes of it on a device.

use super::layout;
use crate::trace::sampling::LOWEST_SQUARED_COSINE;

const LAYOUT: &str = include_str!("../../../kernels/layout.cl");
const SAMPLING: &str = include_str!("../../../kernels/sampling.cl");
const CONE: &str = include_str!("../../../kernels/cone.cl");
const TRACE: &str = include_str!("../../../kernels/trace.cl");
const STARS: &str = include_str!("../../../kernels/stars.cl");
const SETS: &str = include_str!("../../../kernels/sets.cl");

/// The most pieces of memory for corners: a device takes at least a quarter of all it has in one piece.
pub(super) const PIECES: usize = 4;

/// The kernels of the program.
#[cfg(test)]
const KERNELS: [&str; 8] =
    ["layout", "directions", "stars", "aimed", "occluded", "occluded_again", "packed", "first_hit"];

/// Work-items of a group. Always the same, as some compilers make a kernel anew for each number.
pub(super) const GROUP: usize = 64;

/// Rays that a work-item takes, where it takes a set of a point's: as many as a `ulong` has bits.
pub(super) const SET: usize = 64;

/// Of how many work-items one has a ray, where there are few: those that graphics processors take in step.
pub(super) fn spread(sets: bool) -> usize {
    if sets { 1 } else { 32 }
}

/// What the kernels are made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shape {
    /// 3 or 4.
    pub dimension: usize,
    /// Nodes on the longest way through the hierarchy.
    pub depth: usize,
    /// Whether rays go through the hierarchy in sets, a work-item for each 64 of a point.
    pub sets: bool,
    /// The most simplices whose corners are in one piece of memory, if there are several pieces.
    pub piece: Option<usize>,
}

/// The text for this. In one piece, as some wrappers and drivers can't take more, and without comments, which some compilers
/// don't take either.
pub(super) fn text(shape: Shape, double: bool) -> String {
    // By steps, so that what was compiled for one mesh serves most others.
    let (depth, pieces) = (shape.depth.max(1).next_multiple_of(4), if shape.piece.is_some() { PIECES } else { 1 });
    let mut text = format!(
        "#define D {}\n#define DEPTH {depth}\n#define PIECES {pieces}\n#define PIECE {}u\n\
         #define LOWEST_SQUARED_COSINE {LOWEST_SQUARED_COSINE:e}f\n#define HALF_ULP {:e}f\n",
        shape.dimension,
        shape.piece.unwrap_or(usize::MAX).min(u32::MAX as usize),
        f32::EPSILON / 2.0,
    );
    if double {
        text += "#pragma OPENCL EXTENSION cl_khr_fp64 : enable\n#define DOUBLE\n";
    }
    text += &format!("#define SPREAD {}\n", spread(shape.sets));
    if shape.sets {
        text += &format!("#define SETS\n#define SET {SET}\n");
    }
    text += LAYOUT;
    text += SAMPLING;
    text += CONE;
    text += TRACE;
    text += STARS;
    if shape.sets {
        text += SETS;
    }
    without_comments(&text)
}

/// Replaces each comment by a space, and joins lines that go on. The kernels have no string with a comment's sign in it.
fn without_comments(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(start) = rest.find("/*") {
        out += &rest[..start];
        out.push(' ');
        rest = rest[start..].find("*/").map_or("", |end| &rest[start + end + 2..]);
    }
    (out + rest).replace("\\\n", " ")
}

/// The kernel's sizes are held against these.
pub(super) fn expected_layout() -> Vec<u32> {
    layout::sizes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_plain() {
        for n in 0..16 {
            let (dimension, double, sets) = (3 + n % 2, n & 2 > 0, n & 8 > 0);
            let shape = Shape { dimension, depth: 20, sets, piece: (n & 4 > 0).then_some(1000) };
            let text = text(shape, double);
            assert!(text.is_ascii() && !text.contains("/*") && !text.contains("//") && !text.contains("??/"));
            assert!(!text.contains("\\\n"));
            for kernel in KERNELS {
                assert_eq!(text.matches(&format!("void {kernel}(")).count(), 1, "{kernel}");
            }
            assert_eq!(text.contains("void occluded_sets("), sets);
            let opened = text.matches("#if").count();
            assert_eq!(opened, text.matches("#endif").count());
            assert_eq!(text.contains("#define DOUBLE"), double);
        }
        assert_eq!(without_comments("a /* b */ c/**/d\\\ne"), "a   c d e");
    }
}
