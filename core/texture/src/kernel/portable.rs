//! Plain code over four lanes, which compilers turn into SSE2 or NEON. Only its pointers are unsafe.

use super::{Codes, Simd};

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
    const TOGETHER: usize = 1;
    const SPLIT: bool = false;
    type Vector = [f32; 4];
    type Group = i32;
    type Sums = [i32; 4];

    #[inline(always)]
    fn groups(codes: &Codes) -> impl Iterator<Item = i32> {
        codes.codes.iter().map(|code| i32::from(*code))
    }

    operations! {
        splat(x: f32) -> [f32; 4] { [x; 4] }
        load(from: *const f32) -> [f32; 4] { from.cast::<[f32; 4]>().read() }
        load_f16(from: *const u16) -> [f32; 4] { from.cast::<[u16; 4]>().read().map(finite_f16) }
        store(v: [f32; 4], to: *mut f32) -> () { to.cast::<[f32; 4]>().write(v) }
        add(a: [f32; 4], b: [f32; 4]) -> [f32; 4] { each(|i| a[i] + b[i]) }
        mul(a: [f32; 4], b: [f32; 4]) -> [f32; 4] { each(|i| a[i] * b[i]) }
        clamp(x: [f32; 4], low: [f32; 4], high: [f32; 4]) -> [f32; 4] {
            // Comparisons with NaN are false, so NaN is passed on.
            let x = each(|i| if x[i] < low[i] { low[i] } else { x[i] });
            each(|i| if x[i] > high[i] { high[i] } else { x[i] })
        }
        nothing() -> [i32; 4] { [0; 4] }
        gather(sums: [i32; 4], code: i32, weights: *const i8) -> [i32; 4] {
            let weights = weights.cast::<[i8; 4]>().read();
            std::array::from_fn(|i| sums[i].wrapping_add(code * i32::from(weights[i])))
        }
        total(sums: [i32; 4], start: *const i32) -> [f32; 4] {
            let start = start.cast::<[i32; 4]>().read();
            each(|i| sums[i].wrapping_add(start[i]) as f32)
        }
    }
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
