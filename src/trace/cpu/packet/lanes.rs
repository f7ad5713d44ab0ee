//! Eight `f32` side by side, and the few operations the packet tracer needs on them.
//!
//! The engine is written once against the trait [`Lanes`] and compiled for each [`super::Level`] of instructions; which one
//! runs is chosen at run time. Levels may round differently (one fuses multiplications into additions, another
//! doesn't), as every value computed here is only a filter whose rounding is bounded: what the filter can't decide goes
//! to exact arithmetic. So all levels give the same results.

use crate::accel::WIDTH;

/// One row of lanes in memory: a number for each simplex of a leaf, or for each child of a node.
pub(super) type Row = [f32; WIDTH];

/// The bits of 32 rays, for each of eight boxes those that meet it.
pub(super) type Words = [u32; WIDTH];

/// Eight numbers. Code that is generic over them must be inlined into the function compiled for the level, so it uses plain
/// loops: a closure handed to an iterator is compiled apart, without the level's instructions. A mask has the bit of each lane, lane 0 lowest.
pub(super) trait Lanes: Copy {
    /// Eight words side by side.
    type Marks: Copy;
    fn load(row: &Row) -> Self;
    fn store(self, row: &mut Row);
    fn splat(x: f32) -> Self;
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    fn square_root(self) -> Self;
    /// `self * factor + term`, rounded once or twice.
    fn mul_add(self, factor: Self, term: Self) -> Self;
    /// `self * factor - term`, rounded once or twice.
    fn mul_sub(self, factor: Self, term: Self) -> Self;
    /// `term - self * factor`, rounded once or twice.
    fn negated_mul_add(self, factor: Self, term: Self) -> Self;
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    fn abs(self) -> Self;
    /// Its sign bits are those set in either; of the rest nothing is promised.
    fn or(self, other: Self) -> Self;
    /// `inside` in the lanes of the mask, `outside` in the others.
    fn by_mask(mask: u8, inside: f32, outside: f32) -> Self;
    /// Each lane with its sign turned where `sign` is negative.
    fn turned_by(self, sign: Self) -> Self;
    /// The lanes of `negative` where the sign bit of `self` is set, of `other` where it isn't.
    fn select(self, negative: Self, other: Self) -> Self;
    /// Lanes with the sign bit set.
    fn negative(self) -> u8;
    fn less_or_equal(self, other: Self) -> u8;
    /// No bit in any word.
    fn unmarked() -> Self::Marks;
    /// Adds the bits of `bit` to the words where `self` is less than or equal to `other`.
    fn mark(self, other: Self, bit: u32, marks: Self::Marks) -> Self::Marks;
    fn words(marks: Self::Marks) -> Words;
    /// Writes those of the eight words that the mask names side by side to the front of `out`; what follows them there is
    /// overwritten too.
    fn compress(words: &Words, mask: u8, out: &mut Words);
    /// Starts to bring a node, or as much of a leaf, into the cache.
    #[inline(always)]
    fn fetch<const D: usize>(_rows: &[crate::accel::Row], _place: usize) {}
}

/// Plain arrays.
#[derive(Clone, Copy)]
pub(super) struct Portable([f32; WIDTH]);

impl Portable {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }
}

impl Lanes for Portable {
    type Marks = Words;

    #[inline(always)]
    fn load(row: &Row) -> Self {
        Self(*row)
    }

    #[inline(always)]
    fn store(self, row: &mut Row) {
        *row = self.0;
    }

    #[inline(always)]
    fn splat(x: f32) -> Self {
        Self([x; WIDTH])
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
    }

    #[inline(always)]
    fn square_root(self) -> Self {
        Self(self.0.map(f32::sqrt))
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        self.mul(factor).add(term)
    }

    #[inline(always)]
    fn mul_sub(self, factor: Self, term: Self) -> Self {
        self.mul(factor).sub(term)
    }

    #[inline(always)]
    fn negated_mul_add(self, factor: Self, term: Self) -> Self {
        term.sub(self.mul(factor))
    }

    // Comparisons, not `f32::min`: there are no NaNs to mind, and this is one instruction.
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.map(f32::abs))
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        self.zip(other, |a, b| f32::from_bits(a.to_bits() | b.to_bits()))
    }

    #[inline(always)]
    fn by_mask(mask: u8, inside: f32, outside: f32) -> Self {
        Self(std::array::from_fn(|i| if mask >> i & 1 == 1 { inside } else { outside }))
    }

    #[inline(always)]
    fn turned_by(self, sign: Self) -> Self {
        self.zip(sign, |a, s| f32::from_bits(a.to_bits() ^ (s.to_bits() & (1 << 31))))
    }

    #[inline(always)]
    fn select(self, negative: Self, other: Self) -> Self {
        Self(std::array::from_fn(|i| if self.0[i].is_sign_negative() { negative.0[i] } else { other.0[i] }))
    }

    #[inline(always)]
    fn negative(self) -> u8 {
        (0..WIDTH).fold(0, |mask, i| mask | (((self.0[i].to_bits() >> 31) as u8) << i))
    }

    #[inline(always)]
    fn less_or_equal(self, other: Self) -> u8 {
        (0..WIDTH).fold(0, |mask, i| mask | (u8::from(self.0[i] <= other.0[i]) << i))
    }

    #[inline(always)]
    fn unmarked() -> Words {
        [0; WIDTH]
    }

    #[inline(always)]
    fn mark(self, other: Self, bit: u32, marks: Words) -> Words {
        std::array::from_fn(|i| marks[i] | if self.0[i] <= other.0[i] { bit } else { 0 })
    }

    #[inline(always)]
    fn words(marks: Words) -> Words {
        marks
    }

    #[inline(always)]
    fn compress(words: &Words, mask: u8, out: &mut Words) {
        let mut count = 0;
        let mut rest = mask;
        while rest != 0 {
            out[count] = words[rest.trailing_zeros() as usize];
            rest &= rest - 1;
            count += 1;
        }
    }
}
