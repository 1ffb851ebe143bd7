//! AVX2 with FMA and F16C: 8 lanes, 16 registers.

use super::{Codes, Simd};
use std::arch::x86_64::*;

pub(super) struct Avx2;

impl Simd for Avx2 {
    const LANES: usize = 8;
    const MOST: usize = 12;
    const TOGETHER: usize = 2;
    const SPLIT: bool = false;
    type Vector = __m256;
    type Group = i32;
    type Sums = __m256i;

    #[inline(always)]
    fn groups(codes: &Codes) -> impl Iterator<Item = i32> {
        let (pairs, _) = codes.codes.as_chunks::<2>();
        pairs.iter().map(|[a, b]| i32::from(a.cast_unsigned()) | i32::from(*b) << 16)
    }

    operations! {
        splat(x: f32) -> __m256 { _mm256_set1_ps(x) }
        load(from: *const f32) -> __m256 { _mm256_loadu_ps(from) }
        load_f16(from: *const u16) -> __m256 { _mm256_cvtph_ps(_mm_loadu_si128(from.cast())) }
        store(v: __m256, to: *mut f32) -> () { _mm256_storeu_ps(to, v) }
        add(a: __m256, b: __m256) -> __m256 { _mm256_add_ps(a, b) }
        mul(a: __m256, b: __m256) -> __m256 { _mm256_mul_ps(a, b) }
        // Of a NaN and a number these give the second operand, so NaN is passed on.
        clamp(x: __m256, low: __m256, high: __m256) -> __m256 { _mm256_min_ps(high, _mm256_max_ps(low, x)) }
        nothing() -> __m256i { _mm256_setzero_si256() }
        gather(sums: __m256i, pair: i32, weights: *const i8) -> __m256i {
            let weights = _mm256_cvtepi8_epi16(_mm_loadu_si128(weights.cast()));
            _mm256_add_epi32(sums, _mm256_madd_epi16(_mm256_set1_epi32(pair), weights))
        }
        total(sums: __m256i, start: *const i32) -> __m256 {
            _mm256_cvtepi32_ps(_mm256_add_epi32(sums, _mm256_loadu_si256(start.cast())))
        }
    }
}
