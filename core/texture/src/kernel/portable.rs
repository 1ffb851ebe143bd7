//! Plain code over four lanes, which compilers turn into SSE2 or NEON. Only its pointers are unsafe.

use super::{Codes, Data, Program, Simd, Weight, Whole, checksum, execute};

pub(super) struct Portable;

#[inline(always)]
fn each(f: impl Fn(usize) -> f32) -> [f32; 4] {
    [f(0), f(1), f(2), f(3)]
}

/// f16 bits of a finite number as f32, exactly. No intermediate is subnormal: a thread may flush those
/// to zero.
#[inline(always)]
fn finite_f16(bits: u16) -> f32 {
    let bits = u32::from(bits);
    let moved = (bits & 0x7fff) << 13;
    // A subnormal half is a multiple of 2^-24: it is computed as that much above 2^-14, minus 2^-14.
    let above = f32::from_bits(moved + (113 << 23)) - f32::from_bits(113 << 23);
    let found = if moved < 1 << 23 { above.to_bits() } else { moved + (112 << 23) };
    f32::from_bits(found | (bits & 0x8000) << 16)
}

impl Simd for Portable {
    const LANES: usize = 4;
    const MOST: usize = 8;
    type Vector = [f32; 4];

    #[inline(always)]
    unsafe fn splat(x: f32) -> [f32; 4] {
        [x; 4]
    }

    #[inline(always)]
    unsafe fn load(from: *const f32) -> [f32; 4] {
        // SAFETY: the caller gives 4 floats.
        unsafe { from.cast::<[f32; 4]>().read() }
    }

    #[inline(always)]
    unsafe fn load_f16(from: *const u16) -> [f32; 4] {
        // SAFETY: the caller gives 4 halves; arrays are aligned as their elements.
        let bits = unsafe { from.cast::<[u16; 4]>().read() };
        each(|i| finite_f16(bits[i]))
    }

    #[inline(always)]
    unsafe fn store(v: [f32; 4], to: *mut f32) {
        // SAFETY: the caller gives room for 4 floats.
        unsafe { to.cast::<[f32; 4]>().write(v) }
    }

    #[inline(always)]
    unsafe fn add(a: [f32; 4], b: [f32; 4]) -> [f32; 4] {
        each(|i| a[i] + b[i])
    }

    #[inline(always)]
    unsafe fn mul(a: [f32; 4], b: [f32; 4]) -> [f32; 4] {
        each(|i| a[i] * b[i])
    }

    #[inline(always)]
    unsafe fn clamp(x: [f32; 4], low: [f32; 4], high: [f32; 4]) -> [f32; 4] {
        // Comparisons with NaN are false, so NaN is passed on.
        let x = each(|i| if x[i] < low[i] { low[i] } else { x[i] });
        each(|i| if x[i] > high[i] { high[i] } else { x[i] })
    }
}

impl Whole for Portable {
    const TOGETHER: usize = 1;
    const SPLIT: bool = false;
    type Group = i32;
    type Sums = [i32; 4];

    #[inline(always)]
    unsafe fn nothing() -> [i32; 4] {
        [0; 4]
    }

    #[inline(always)]
    fn groups(codes: &Codes) -> impl Iterator<Item = i32> {
        codes.codes().iter().map(|code| i32::from(*code))
    }

    #[inline(always)]
    unsafe fn gather(sums: [i32; 4], code: i32, weights: *const i8) -> [i32; 4] {
        // SAFETY: the caller gives 4 bytes.
        let weights = unsafe { weights.cast::<[i8; 4]>().read() };
        std::array::from_fn(|i| sums[i].wrapping_add(code * i32::from(weights[i])))
    }

    #[inline(always)]
    unsafe fn total(sums: [i32; 4], start: *const i32) -> [f32; 4] {
        // SAFETY: the caller gives 4 numbers.
        let start = unsafe { start.cast::<[i32; 4]>().read() };
        each(|i| sums[i].wrapping_add(start[i]) as f32)
    }
}

/// # Safety
/// None needed: the signature is that of the other instruction sets.
pub(super) unsafe fn run<W: Weight>(
    program: &Program,
    data: Data<'_, W>,
    codes: &mut Codes,
    arena: &mut [f32],
) -> Option<()> {
    // SAFETY: portable code runs on every CPU.
    unsafe { execute::<Portable, W>(program, data, codes, arena) }
}

/// # Safety
/// None needed, as for [`run`].
pub(super) unsafe fn read<W: Weight>(data: Data<'_, W>) -> u32 {
    checksum(data)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_finite_f16_is_converted_exactly() {
        for bits in 0..=u16::MAX {
            let half = half::f16::from_bits(bits);
            if half.is_finite() {
                assert_eq!(finite_f16(bits).to_bits(), half.to_f32().to_bits(), "{bits:#06x}");
            }
        }
    }
}
