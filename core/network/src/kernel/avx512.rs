//! AVX-512F: 16 lanes, 32 registers.

use super::{Data, Program, Simd, Weight, checksum, execute};
use std::arch::x86_64::*;

pub(super) struct Avx512;

impl Simd for Avx512 {
    const LANES: usize = 16;
    const MOST: usize = 8;
    type Vector = __m512;

    #[inline(always)]
    unsafe fn splat(x: f32) -> __m512 {
        // SAFETY: the caller has AVX-512F.
        unsafe { _mm512_set1_ps(x) }
    }

    #[inline(always)]
    unsafe fn load(from: *const f32) -> __m512 {
        // SAFETY: the caller has AVX-512F and 16 floats; the load needs no alignment.
        unsafe { _mm512_loadu_ps(from) }
    }

    #[inline(always)]
    unsafe fn load_f16(from: *const u16) -> __m512 {
        // SAFETY: the caller has AVX-512F and 16 halves, 32 bytes; the load needs no alignment.
        unsafe { _mm512_cvtph_ps(_mm256_loadu_si256(from.cast())) }
    }

    #[inline(always)]
    unsafe fn store(v: __m512, to: *mut f32) {
        // SAFETY: the caller has AVX-512F and room for 16 floats; the store needs no alignment.
        unsafe { _mm512_storeu_ps(to, v) }
    }

    #[inline(always)]
    unsafe fn mul_add(a: __m512, b: __m512, c: __m512) -> __m512 {
        // SAFETY: the caller has AVX-512F.
        unsafe { _mm512_fmadd_ps(a, b, c) }
    }

    #[inline(always)]
    unsafe fn mul(a: __m512, b: __m512) -> __m512 {
        // SAFETY: the caller has AVX-512F.
        unsafe { _mm512_mul_ps(a, b) }
    }

    #[inline(always)]
    unsafe fn clamp(x: __m512, low: __m512, high: __m512) -> __m512 {
        // Of a NaN and a number these give the second operand, so NaN is passed on.
        // SAFETY: the caller has AVX-512F.
        unsafe { _mm512_min_ps(high, _mm512_max_ps(low, x)) }
    }
}

/// # Safety
/// The CPU has AVX-512F.
#[target_feature(enable = "avx512f")]
pub(super) unsafe fn run<W: Weight>(program: &Program, data: Data<'_, W>, arena: &mut [f32]) -> Option<()> {
    // SAFETY: passed on to the caller.
    unsafe { execute::<Avx512, W>(program, data, arena) }
}

/// # Safety
/// The CPU has AVX-512F.
#[target_feature(enable = "avx512f")]
pub(super) unsafe fn read<W: Weight>(data: Data<'_, W>) -> u32 {
    checksum(data)
}
