//! AVX-512F: 16 lanes, 32 registers; VNNI multiplies unsigned by signed bytes, four in each lane at once.

use super::{Codes, Simd};
use std::arch::x86_64::*;

pub(super) struct Avx512;

impl Simd for Avx512 {
    const LANES: usize = 16;
    const MOST: usize = 8;
    const TOGETHER: usize = 4;
    const SPLIT: bool = true;
    type Vector = __m512;
    /// High and low bytes of four inputs.
    type Group = (i32, i32);
    /// Sums of products with high bytes, and with low ones.
    type Sums = (__m512i, __m512i);

    #[inline(always)]
    fn groups(codes: &Codes) -> impl Iterator<Item = (i32, i32)> {
        let groups = codes.high.as_chunks::<4>().0.iter().zip(codes.low.as_chunks::<4>().0);
        groups.map(|(high, low)| (i32::from_le_bytes(*high), i32::from_le_bytes(*low)))
    }

    operations! {
        splat(x: f32) -> __m512 { _mm512_set1_ps(x) }
        load(from: *const f32) -> __m512 { _mm512_loadu_ps(from) }
        load_f16(from: *const u16) -> __m512 { _mm512_cvtph_ps(_mm256_loadu_si256(from.cast())) }
        store(v: __m512, to: *mut f32) -> () { _mm512_storeu_ps(to, v) }
        add(a: __m512, b: __m512) -> __m512 { _mm512_add_ps(a, b) }
        mul(a: __m512, b: __m512) -> __m512 { _mm512_mul_ps(a, b) }
        // As with AVX2, NaN is passed on.
        clamp(x: __m512, low: __m512, high: __m512) -> __m512 { _mm512_min_ps(high, _mm512_max_ps(low, x)) }
        nothing() -> (__m512i, __m512i) { (_mm512_setzero_si512(), _mm512_setzero_si512()) }
        gather(sums: (__m512i, __m512i), group: (i32, i32), weights: *const i8) -> (__m512i, __m512i) {
            let weights = _mm512_loadu_si512(weights.cast());
            (
                _mm512_dpbusd_epi32(sums.0, _mm512_set1_epi32(group.0), weights),
                _mm512_dpbusd_epi32(sums.1, _mm512_set1_epi32(group.1), weights),
            )
        }
        total(sums: (__m512i, __m512i), start: *const i32) -> __m512 {
            // Overflows of 32 bits on the way cancel in the total, which fits.
            let low = _mm512_add_epi32(sums.1, _mm512_loadu_si512(start.cast()));
            _mm512_cvtepi32_ps(_mm512_add_epi32(_mm512_slli_epi32::<8>(sums.0), low))
        }
    }
}
