//! AVX-512F: 16 lanes, 32 registers.

use super::{Codes, Data, Program, Simd, Weight, Whole, checksum, execute};
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
    unsafe fn add(a: __m512, b: __m512) -> __m512 {
        // SAFETY: the caller has AVX-512F.
        unsafe { _mm512_add_ps(a, b) }
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

/// With VNNI, which multiplies unsigned by signed bytes, four in each lane at once.
impl Whole for Avx512 {
    const TOGETHER: usize = 4;
    const SPLIT: bool = true;
    /// High and low bytes of four inputs.
    type Group = (i32, i32);
    /// Sums of products with high bytes, and with low ones.
    type Sums = (__m512i, __m512i);

    #[inline(always)]
    unsafe fn nothing() -> (__m512i, __m512i) {
        // SAFETY: the caller has AVX-512F.
        unsafe { (_mm512_setzero_si512(), _mm512_setzero_si512()) }
    }

    #[inline(always)]
    fn groups(codes: &Codes) -> impl Iterator<Item = (i32, i32)> {
        let (high, low) = codes.bytes();
        let groups = high.as_chunks::<4>().0.iter().zip(low.as_chunks::<4>().0);
        groups.map(|(high, low)| (i32::from_le_bytes(*high), i32::from_le_bytes(*low)))
    }

    #[inline(always)]
    unsafe fn gather(
        (high, low): (__m512i, __m512i),
        group: (i32, i32),
        weights: *const i8,
    ) -> (__m512i, __m512i) {
        // SAFETY: the caller has AVX-512 VNNI and 64 bytes; the load needs no alignment.
        unsafe {
            let weights = _mm512_loadu_si512(weights.cast());
            (
                _mm512_dpbusd_epi32(high, _mm512_set1_epi32(group.0), weights),
                _mm512_dpbusd_epi32(low, _mm512_set1_epi32(group.1), weights),
            )
        }
    }

    #[inline(always)]
    unsafe fn total((high, low): (__m512i, __m512i), start: *const i32) -> __m512 {
        // Overflows of 32 bits on the way cancel in the total, which fits.
        // SAFETY: the caller has AVX-512F and 16 numbers; the load needs no alignment.
        unsafe {
            let low = _mm512_add_epi32(low, _mm512_loadu_si512(start.cast()));
            _mm512_cvtepi32_ps(_mm512_add_epi32(_mm512_slli_epi32::<8>(high), low))
        }
    }
}

/// # Safety
/// The CPU has AVX-512F.
#[target_feature(enable = "avx512f")]
pub(super) unsafe fn run<W: Weight>(
    program: &Program,
    data: Data<'_, W>,
    codes: &mut Codes,
    arena: &mut [f32],
) -> Option<()> {
    // SAFETY: passed on to the caller.
    unsafe { execute::<Avx512, W>(program, data, codes, arena) }
}

/// # Safety
/// The CPU has AVX-512F, BW and VNNI.
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
pub(super) unsafe fn run_whole<W: Weight>(
    program: &Program,
    data: Data<'_, W>,
    codes: &mut Codes,
    arena: &mut [f32],
) -> Option<()> {
    // SAFETY: passed on to the caller.
    unsafe { execute::<Avx512, W>(program, data, codes, arena) }
}

/// # Safety
/// The CPU has AVX-512F.
#[target_feature(enable = "avx512f")]
pub(super) unsafe fn read<W: Weight>(data: Data<'_, W>) -> u32 {
    checksum(data)
}
