//! The lanes as registers of x86-64.
//!
//! The methods below use instructions that the processor may lack; the types are private to the engine, which makes
//! them only inside functions compiled for, and called after a check of, the level (`dispatch` in the parent module).
//! They are inlined there, as a function of their own they would be compiled without the instructions.

use std::arch::x86_64::*;

use super::lanes::{Lanes, Words};
use crate::accel::{Row, WIDTH};

/// For each mask the places of its bits, for the permutation that brings them to the front.
static PLACES: [[u8; WIDTH]; 256] = places();

const fn places() -> [[u8; WIDTH]; 256] {
    let mut table = [[0; WIDTH]; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut bit, mut count) = (0, 0);
        while bit < WIDTH {
            if mask >> bit & 1 == 1 {
                table[mask][count] = bit as u8;
                count += 1;
            }
            bit += 1;
        }
        mask += 1;
    }
    table
}

/// What the two levels share: arithmetic on 256 bits.
macro_rules! arithmetic {
    () => {
        #[inline(always)]
        fn load(row: &[f32; WIDTH]) -> Self {
            // SAFETY: AVX by the level; a row is 32 readable bytes, of any alignment.
            Self(unsafe { _mm256_loadu_ps(row.as_ptr()) })
        }

        #[inline(always)]
        fn store(self, row: &mut [f32; WIDTH]) {
            // SAFETY: AVX by the level; a row is 32 writable bytes, of any alignment.
            unsafe { _mm256_storeu_ps(row.as_mut_ptr(), self.0) }
        }

        #[inline(always)]
        fn splat(x: f32) -> Self {
            // SAFETY: AVX by the level.
            Self(unsafe { _mm256_set1_ps(x) })
        }

        #[inline(always)]
        fn add(self, other: Self) -> Self {
            // SAFETY: AVX by the level.
            Self(unsafe { _mm256_add_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn sub(self, other: Self) -> Self {
            // SAFETY: AVX by the level.
            Self(unsafe { _mm256_sub_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn mul(self, other: Self) -> Self {
            // SAFETY: AVX by the level.
            Self(unsafe { _mm256_mul_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn div(self, other: Self) -> Self {
            // SAFETY: AVX by the level.
            Self(unsafe { _mm256_div_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn square_root(self) -> Self {
            // SAFETY: AVX by the level.
            Self(unsafe { _mm256_sqrt_ps(self.0) })
        }

        #[inline(always)]
        fn mul_add(self, factor: Self, term: Self) -> Self {
            // SAFETY: FMA by the level.
            Self(unsafe { _mm256_fmadd_ps(self.0, factor.0, term.0) })
        }

        #[inline(always)]
        fn mul_sub(self, factor: Self, term: Self) -> Self {
            // SAFETY: FMA by the level.
            Self(unsafe { _mm256_fmsub_ps(self.0, factor.0, term.0) })
        }

        #[inline(always)]
        fn negated_mul_add(self, factor: Self, term: Self) -> Self {
            // SAFETY: FMA by the level.
            Self(unsafe { _mm256_fnmadd_ps(self.0, factor.0, term.0) })
        }

        #[inline(always)]
        fn min(self, other: Self) -> Self {
            // SAFETY: AVX by the level.
            Self(unsafe { _mm256_min_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn max(self, other: Self) -> Self {
            // SAFETY: AVX by the level.
            Self(unsafe { _mm256_max_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn abs(self) -> Self {
            // SAFETY: AVX by the level.
            Self(unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0) })
        }

        #[inline(always)]
        fn unmarked() -> __m256i {
            // SAFETY: AVX by the level.
            unsafe { _mm256_setzero_si256() }
        }

        #[inline(always)]
        fn mark(self, other: Self, bit: u32, marks: __m256i) -> __m256i {
            // SAFETY: AVX2 by the level.
            unsafe {
                let met = _mm256_castps_si256(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0));
                _mm256_or_si256(marks, _mm256_and_si256(met, _mm256_set1_epi32(bit as i32)))
            }
        }

        #[inline(always)]
        fn words(marks: __m256i) -> Words {
            let mut words = [0; WIDTH];
            // SAFETY: AVX by the level; an array of eight words is 32 writable bytes, of any alignment.
            unsafe { _mm256_storeu_si256(words.as_mut_ptr().cast(), marks) }
            words
        }

        #[inline(always)]
        fn fetch<const D: usize>(rows: &[Row], place: usize) {
            let start = rows.as_ptr().wrapping_add(place).cast::<i8>();
            // A node's lines; most of a leaf's.
            for line in 0..D + 1 {
                // SAFETY: SSE by the level; a prefetch may be of any address.
                unsafe { _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(64 * line)) }
            }
        }

        #[inline(always)]
        fn or(self, other: Self) -> Self {
            // SAFETY: AVX by the level.
            Self(unsafe { _mm256_or_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn by_mask(mask: u8, inside: f32, outside: f32) -> Self {
            // SAFETY: AVX2 by the level.
            unsafe {
                let bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
                let masked = _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(i32::from(mask)), bits), bits);
                let [inside, outside] = [_mm256_set1_ps(inside), _mm256_set1_ps(outside)];
                Self(_mm256_blendv_ps(outside, inside, _mm256_castsi256_ps(masked)))
            }
        }

        #[inline(always)]
        fn turned_by(self, sign: Self) -> Self {
            // SAFETY: AVX by the level.
            Self(unsafe { _mm256_xor_ps(self.0, _mm256_and_ps(sign.0, _mm256_set1_ps(-0.0))) })
        }

        #[inline(always)]
        fn select(self, negative: Self, other: Self) -> Self {
            // SAFETY: AVX by the level.
            Self(unsafe { _mm256_blendv_ps(other.0, negative.0, self.0) })
        }

        #[inline(always)]
        fn negative(self) -> u8 {
            // SAFETY: AVX by the level.
            unsafe { _mm256_movemask_ps(self.0) as u8 }
        }
    };
}

/// AVX2 and FMA.
#[derive(Clone, Copy)]
pub(super) struct Avx2(__m256);

impl Lanes for Avx2 {
    type Marks = __m256i;

    arithmetic!();

    #[inline(always)]
    fn less_or_equal(self, other: Self) -> u8 {
        // SAFETY: AVX by the level.
        unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0)) as u8 }
    }

    #[inline(always)]
    fn compress(words: &Words, mask: u8, out: &mut Words) {
        // SAFETY: AVX2 by the level; all three arrays are as long as what is read or written.
        unsafe {
            let places = _mm256_cvtepu8_epi32(_mm_loadl_epi64(PLACES[mask as usize].as_ptr().cast()));
            let words = _mm256_loadu_si256(words.as_ptr().cast());
            _mm256_storeu_si256(out.as_mut_ptr().cast(), _mm256_permutevar8x32_epi32(words, places));
        }
    }
}

/// AVX-512's masks, on 256 bits: wider registers gain nothing where eight simplices or boxes meet one ray.
#[derive(Clone, Copy)]
pub(super) struct Avx512(__m256);

impl Lanes for Avx512 {
    type Marks = __m256i;

    arithmetic!();

    #[inline(always)]
    fn less_or_equal(self, other: Self) -> u8 {
        // SAFETY: AVX-512F and VL by the level.
        unsafe { _mm256_cmp_ps_mask::<_CMP_LE_OQ>(self.0, other.0) }
    }

    #[inline(always)]
    fn compress(words: &Words, mask: u8, out: &mut Words) {
        // SAFETY: AVX-512F and VL by the level; both arrays are as long as what is read or written. Compressing into a
        // register first: compressing into memory is microcode on some processors.
        unsafe {
            let words = _mm256_loadu_si256(words.as_ptr().cast());
            _mm256_storeu_si256(out.as_mut_ptr().cast(), _mm256_maskz_compress_epi32(mask, words));
        }
    }
}
