//! AVX2 with FMA and F16C: 8 lanes, 16 registers.

use super::{Codes, Data, Program, Simd, Weight, Whole, checksum, execute};
use std::arch::x86_64::*;

pub(super) struct Avx2;

impl Simd for Avx2 {
    const LANES: usize = 8;
    const MOST: usize = 12;
    type Vector = __m256;

    #[inline(always)]
    unsafe fn splat(x: f32) -> __m256 {
        // SAFETY: the caller has AVX.
        unsafe { _mm256_set1_ps(x) }
    }

    #[inline(always)]
    unsafe fn load(from: *const f32) -> __m256 {
        // SAFETY: the caller has AVX and 8 floats; the load needs no alignment.
        unsafe { _mm256_loadu_ps(from) }
    }

    #[inline(always)]
    unsafe fn load_f16(from: *const u16) -> __m256 {
        // SAFETY: the caller has F16C and 8 halves, 16 bytes; the load needs no alignment.
        unsafe { _mm256_cvtph_ps(_mm_loadu_si128(from.cast())) }
    }

    #[inline(always)]
    unsafe fn store(v: __m256, to: *mut f32) {
        // SAFETY: the caller has AVX and room for 8 floats; the store needs no alignment.
        unsafe { _mm256_storeu_ps(to, v) }
    }

    #[inline(always)]
    unsafe fn add(a: __m256, b: __m256) -> __m256 {
        // SAFETY: the caller has AVX.
        unsafe { _mm256_add_ps(a, b) }
    }

    #[inline(always)]
    unsafe fn mul(a: __m256, b: __m256) -> __m256 {
        // SAFETY: the caller has AVX.
        unsafe { _mm256_mul_ps(a, b) }
    }

    #[inline(always)]
    unsafe fn clamp(x: __m256, low: __m256, high: __m256) -> __m256 {
        // Of a NaN and a number these give the second operand, so NaN is passed on.
        // SAFETY: the caller has AVX.
        unsafe { _mm256_min_ps(high, _mm256_max_ps(low, x)) }
    }
}

impl Whole for Avx2 {
    const TOGETHER: usize = 2;
    const SPLIT: bool = false;
    type Group = i32;
    type Sums = __m256i;

    #[inline(always)]
    unsafe fn nothing() -> __m256i {
        // SAFETY: the caller has AVX.
        unsafe { _mm256_setzero_si256() }
    }

    #[inline(always)]
    fn groups(codes: &Codes) -> impl Iterator<Item = i32> {
        let (pairs, _) = codes.codes().as_chunks::<2>();
        pairs.iter().map(|[a, b]| i32::from(a.cast_unsigned()) | i32::from(*b) << 16)
    }

    #[inline(always)]
    unsafe fn gather(sums: __m256i, pair: i32, weights: *const i8) -> __m256i {
        // SAFETY: the caller has AVX2 and 16 bytes; the load needs no alignment.
        unsafe {
            let weights = _mm256_cvtepi8_epi16(_mm_loadu_si128(weights.cast()));
            _mm256_add_epi32(sums, _mm256_madd_epi16(_mm256_set1_epi32(pair), weights))
        }
    }

    #[inline(always)]
    unsafe fn total(sums: __m256i, start: *const i32) -> __m256 {
        // SAFETY: the caller has AVX2 and 8 numbers; the load needs no alignment.
        unsafe { _mm256_cvtepi32_ps(_mm256_add_epi32(sums, _mm256_loadu_si256(start.cast()))) }
    }
}

/// # Safety
/// The CPU has AVX2, FMA and F16C.
#[target_feature(enable = "avx2,fma,f16c")]
pub(super) unsafe fn run<W: Weight>(
    program: &Program,
    data: Data<'_, W>,
    codes: &mut Codes,
    arena: &mut [f32],
) -> Option<()> {
    // SAFETY: passed on to the caller.
    unsafe { execute::<Avx2, W>(program, data, codes, arena) }
}

/// # Safety
/// The CPU has AVX2, FMA and F16C.
#[target_feature(enable = "avx2,fma,f16c")]
pub(super) unsafe fn read<W: Weight>(data: Data<'_, W>) -> u32 {
    checksum(data)
}
